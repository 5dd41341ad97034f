//! Spline models in files: our own JSON, G+Smo's XML, STEP; curves also as SVG and DXF.
//!
//! JSON is read back to the last bit and is the format to keep. XML goes to and comes from G+Smo. STEP goes to CAD:
//! it knows no hierarchical splines, so a surface becomes one tensor-product face or a shell of several, without any
//! approximation ([`step`]).

mod build;
pub mod dxf;
mod error;
pub mod gismo;
pub mod json;
mod layout;
pub mod step;
pub mod svg;

use std::path::Path;

use serde::{Deserialize, Serialize};
use thb_core::SplineMap;

pub use error::{ModelError, ModelErrorKind};
pub use layout::{LayoutFile, LayoutQuad, parse_layout, read_layout};
pub use step::{SolidFile, StepOptions, StepSchema, StepSize, StepSurface, write_solid};
pub use svg::{GRAPH, SvgOptions};

use crate::read::read_bytes;
use crate::write::write_atomically;

/// A fitted curve or surface, with what a file needs to know beyond its coefficients.
#[derive(Clone, Debug)]
pub struct Model {
    /// The map.
    pub geometry: Geometry,
    /// Unit of its coordinates.
    pub unit: LengthUnit,
    /// Anything else worth keeping, such as where the model came from. JSON only; empty after reading other formats.
    pub metadata: serde_json::Map<String, serde_json::Value>,
}

/// A spline map of parameter dimension 1 or 2.
#[derive(Clone, Debug)]
pub enum Geometry {
    /// A curve.
    Curve(SplineMap<1>),
    /// A surface.
    Surface(SplineMap<2>),
}

/// The length of 1 in the coordinates of a model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LengthUnit {
    /// 10⁻⁶ m.
    Micrometre,
    /// 0.001 m.
    #[default]
    Millimetre,
    /// 0.01 m.
    Centimetre,
    /// 1 m.
    Metre,
    /// 0.0254 m.
    Inch,
    /// 0.3048 m.
    Foot,
}

impl LengthUnit {
    /// All units.
    pub const ALL: [Self; 6] =
        [Self::Micrometre, Self::Millimetre, Self::Centimetre, Self::Metre, Self::Inch, Self::Foot];

    /// The unit's name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Micrometre => "micrometre",
            Self::Millimetre => "millimetre",
            Self::Centimetre => "centimetre",
            Self::Metre => "metre",
            Self::Inch => "inch",
            Self::Foot => "foot",
        }
    }

    /// The unit of a name in files.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| unit.name() == name)
    }

    /// The unit's length in millimetres.
    pub fn millimetres(self) -> f64 {
        match self {
            Self::Micrometre => 1e-3,
            Self::Millimetre => 1.0,
            Self::Centimetre => 10.0,
            Self::Metre => 1000.0,
            Self::Inch => 25.4,
            Self::Foot => 304.8,
        }
    }
}

impl Model {
    /// A curve without metadata.
    pub fn curve(map: SplineMap<1>, unit: LengthUnit) -> Self {
        Self { geometry: Geometry::Curve(map), unit, metadata: serde_json::Map::new() }
    }

    /// A surface without metadata.
    pub fn surface(map: SplineMap<2>, unit: LengthUnit) -> Self {
        Self { geometry: Geometry::Surface(map), unit, metadata: serde_json::Map::new() }
    }
}

/// A format for models.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelFormat {
    /// Our own format, `.json`.
    Json,
    /// G+Smo's, `.xml`.
    GismoXml,
    /// AP214, `.step` or `.stp`; written only.
    Step,
    /// A picture of a curve, `.svg`; written only.
    Svg,
    /// A drawing of a curve, `.dxf`; written only.
    Dxf,
}

impl ModelFormat {
    /// The format of a file name's extension, in any case.
    pub fn from_path(path: &Path) -> Option<Self> {
        match extension(path).as_str() {
            "json" => Some(Self::Json),
            "xml" => Some(Self::GismoXml),
            "step" | "stp" => Some(Self::Step),
            "svg" => Some(Self::Svg),
            "dxf" => Some(Self::Dxf),
            _ => None,
        }
    }

    /// Whether the format holds surfaces; all hold curves.
    pub fn holds_surfaces(self) -> bool {
        !matches!(self, Self::Svg | Self::Dxf)
    }
}

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// How a model is written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WriteOptions {
    /// For STEP. An empty file name there is replaced by that of the file.
    pub step: StepOptions,
    /// For SVG.
    pub svg: SvgOptions,
}

/// Writes a model in the format of the file name's extension (`.step`, `.stp`, `.xml`, `.json`; for curves `.svg`,
/// `.dxf`), whole or not at all.
///
/// # Errors
/// [`ModelError`] with [`ModelErrorKind::UnknownExtension`], what the system says, or what the format cannot hold.
pub fn write_model(path: &Path, model: &Model, options: &WriteOptions) -> Result<(), ModelError> {
    let write = || -> Result<(), ModelErrorKind> {
        let unknown = || ModelErrorKind::UnknownExtension {
            extension: extension(path),
            supported: ".step .stp .xml .json .svg .dxf",
        };
        match ModelFormat::from_path(path).ok_or_else(unknown)? {
            ModelFormat::Json => write_atomically(path, |out| json::write_json(out, model))?,
            ModelFormat::GismoXml => write_atomically(path, |out| gismo::write_gismo(out, model))?,
            ModelFormat::Step => {
                let file = step::StepFile::new(model, &named(path, &options.step))?;
                write_atomically(path, |out| file.write(out))?;
            }
            ModelFormat::Svg => {
                let text = svg::draw_svg(model, &options.svg)?;
                write_atomically(path, |out| out.write_all(text.as_bytes()))?;
            }
            ModelFormat::Dxf => {
                let file = dxf::DxfFile::new(model)?;
                write_atomically(path, |out| file.write(out))?;
            }
        }
        Ok(())
    };
    write().map_err(|kind| ModelError { path: path.to_owned(), kind })
}

/// Writes several surfaces, with coordinates in one unit, into one STEP file, whole or not at all: each becomes a shell. Returns how large
/// the file is.
///
/// # Errors
/// [`ModelError`] with what the system says, or what the format cannot hold.
pub fn write_step(path: &Path, surfaces: &[StepSurface<'_>], unit: LengthUnit) -> Result<StepSize, ModelError> {
    let write = || -> Result<StepSize, ModelErrorKind> {
        let options: Vec<StepOptions> = surfaces.iter().map(|surface| named(path, surface.options)).collect();
        let named = surfaces.iter().zip(&options);
        let surfaces: Vec<StepSurface<'_>> =
            named.map(|(&StepSurface { map, .. }, options)| StepSurface { map, options }).collect();
        let file = step::StepFile::of_surfaces(&surfaces, unit)?;
        write_atomically(path, |out| file.write(out))?;
        Ok(file.size())
    };
    write().map_err(|kind| ModelError { path: path.to_owned(), kind })
}

/// Options with the name of the file, where they have none, for it and for the part.
fn named(path: &Path, options: &StepOptions) -> StepOptions {
    let mut options = options.clone();
    if options.file_name.is_empty() {
        options.file_name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    }
    if options.product.is_empty() {
        options.product = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    }
    options
}

/// Reads a model from a `.json` or `.xml` file.
///
/// # Errors
/// [`ModelError`] that names the file and the violated condition.
pub fn read_model(path: &Path) -> Result<Model, ModelError> {
    let read = || match ModelFormat::from_path(path) {
        Some(ModelFormat::Json) => json::parse_json(&read_bytes(path)?),
        Some(ModelFormat::GismoXml) => gismo::parse_gismo(&read_bytes(path)?),
        _ => Err(ModelErrorKind::UnknownExtension { extension: extension(path), supported: ".json .xml" }),
    };
    read().map_err(|kind| ModelError { path: path.to_owned(), kind })
}
