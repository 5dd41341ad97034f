//! The formats, and which one a file has.

use std::path::Path;

use serde::{Serialize, Serializer};

use crate::error::ReadErrorKind;

/// A file format that holds a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// Stanford PLY, ASCII or binary: cloud or mesh.
    Ply,
    /// Wavefront OBJ: cloud or mesh.
    Obj,
    /// Object File Format (OFF, and its variants with colours, normals, texture): cloud or mesh.
    Off,
    /// STL, ASCII or binary: triangles, each with its own three points.
    Stl,
    /// Binary glTF: the triangles of all meshes, where the nodes put them.
    Glb,
    /// 3D Manufacturing Format: the triangles of all objects, where the build puts them.
    ThreeMf,
    /// Text with one point a line.
    Xyz,
    /// Text with one point a line and a line that names the columns.
    Csv,
    /// ESRI ASCII grid of heights.
    EsriGrid,
    /// Surfer text grid of heights.
    SurferGrid,
    /// GeoTIFF with one band of heights.
    GeoTiff,
    /// Leica PTX: scans in rows and columns with their poses, as text.
    Ptx,
    /// Point Cloud Data of the Point Cloud Library: ASCII, binary, or compressed binary.
    Pcd,
    /// ASPRS LAS, or LAZ, its compressed form: points with classes.
    Las,
    /// ASTM E2807 (E57): one or several scans.
    E57,
    /// G+Smo XML with a matrix of parameters and one of points.
    GismoXml,
    /// No file: arrays in memory.
    Memory,
}

impl Format {
    /// All formats of files.
    pub const ALL: [Self; 16] = [
        Self::Ply,
        Self::Obj,
        Self::Off,
        Self::Stl,
        Self::Glb,
        Self::ThreeMf,
        Self::Xyz,
        Self::Csv,
        Self::EsriGrid,
        Self::SurferGrid,
        Self::GeoTiff,
        Self::Ptx,
        Self::Pcd,
        Self::Las,
        Self::E57,
        Self::GismoXml,
    ];

    /// The format's name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ply => "PLY",
            Self::Obj => "OBJ",
            Self::Off => "OFF",
            Self::Stl => "STL",
            Self::Glb => "GLB",
            Self::ThreeMf => "3MF",
            Self::Xyz => "XYZ",
            Self::Csv => "CSV",
            Self::EsriGrid => "ESRI ASCII grid",
            Self::SurferGrid => "Surfer grid",
            Self::GeoTiff => "GeoTIFF",
            Self::Ptx => "PTX",
            Self::Pcd => "PCD",
            Self::Las => "LAS",
            Self::E57 => "E57",
            Self::GismoXml => "G+Smo XML",
            Self::Memory => "memory",
        }
    }

    /// Extensions of the format's files, in lower case and without the dot.
    pub fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Ply => &["ply"],
            Self::Obj => &["obj"],
            Self::Off => &["off"],
            Self::Stl => &["stl"],
            Self::Glb => &["glb"],
            Self::ThreeMf => &["3mf"],
            Self::Xyz => &["xyz", "txt", "pts", "dat"],
            Self::Csv => &["csv"],
            Self::EsriGrid => &["asc"],
            Self::SurferGrid => &["grd"],
            Self::GeoTiff => &["tif", "tiff"],
            Self::Ptx => &["ptx"],
            Self::Pcd => &["pcd"],
            Self::Las => &["las", "laz"],
            Self::E57 => &["e57"],
            Self::GismoXml => &["xml"],
            Self::Memory => &[],
        }
    }

    /// The format that an extension, in upper or lower case and without the dot, stands for.
    ///
    /// # Errors
    /// [`ReadErrorKind::UnknownExtension`].
    pub fn from_extension(extension: &str) -> Result<Self, ReadErrorKind> {
        let extension = extension.to_ascii_lowercase();
        let known = Self::ALL.into_iter().find(|f| f.extensions().contains(&extension.as_str()));
        known.ok_or_else(|| {
            let supported: Vec<_> = Self::ALL.iter().flat_map(|f| f.extensions()).map(|e| format!(".{e}")).collect();
            ReadErrorKind::UnknownExtension { extension, supported: supported.join(", ") }
        })
    }

    /// The format that the extension of a path stands for; `.gz` behind it does not count.
    ///
    /// # Errors
    /// [`ReadErrorKind::UnknownExtension`].
    pub fn from_path(path: &Path) -> Result<Self, ReadErrorKind> {
        let compressed = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"));
        let inner = if compressed { path.with_extension("") } else { path.to_owned() };
        Self::from_extension(&inner.extension().map(|e| e.to_string_lossy()).unwrap_or_default())
    }

    /// Whether the first bytes of the format's files are text, at whose start a byte order mark may stand.
    pub(super) fn opens_with_text(self) -> bool {
        !matches!(self, Self::Stl | Self::Glb | Self::ThreeMf | Self::GeoTiff | Self::Las | Self::E57)
    }
}

/// By its first extension.
impl Serialize for Format {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.extensions()[0])
    }
}
