//! STEP, ISO 10303: AP214, which every CAD system opens, or AP242 ([`StepSchema`]).
//!
//! STEP knows no hierarchical splines. A surface becomes
//! - one `B_SPLINE_SURFACE_WITH_KNOTS` on one face, if the smallest tensor-product space that holds it has at most
//!   [`StepOptions::max_control_points`] functions; else
//! - a shell of such faces, one for each box of a partition of the domain along cell boundaries. Neighbours share edges
//!   and vertices also where a long side meets several short ones, so that the shell is connected as it stands.
//!
//! Several surfaces, such as the pieces of one part, become a shell each in one shape.
//!
//! Both are exact: knot insertion and nothing else. Each face keeps the parameters of the model. A curve becomes a
//! `B_SPLINE_CURVE_WITH_KNOTS` in a `GEOMETRIC_CURVE_SET`.
//!
//! Sides that collapse to a point get no edge, and their ends are one vertex. Knots of multiplicity above the degree, along
//! which the map may jump, are refused.
//!
//! Holes are cut out of faces as inner bounds, each a closed edge whose curve follows the surface to 10⁻⁷ of its size. A face is
//! not divided where a hole lies.
//!
//! In a periodic direction the shell closes: a face all round has an edge on the seam that its loop follows both ways, and
//! of several faces the last shares that edge with the first. A shell without any boundary, of a torus, is a
//! `CLOSED_SHELL`. Opposite sides of open directions stay two edges, even where they coincide.

mod document;
mod part21;
mod partition;
mod shell;
mod solid;
mod trim;

use std::io::{self, Write};

use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};
use thb_core::{CellSpace, HierarchicalSpace, SplineMap, TensorSpace};

use super::{Geometry, LengthUnit, Model, ModelErrorKind};
use part21::{Id, Part21, list, reals};
use shell::{Edge, Face, Shell, in_space};

pub use solid::{SolidFile, write_solid};

/// Distance below which CAD may take points for the same, and below which an edge counts as collapsed, as a share of the
/// diagonal of the control points' box. Gaps between edges and faces, which are rounding, are 10⁶ times smaller. Larger
/// values would make CAD weld the ends of short edges: cells of the finest level can be 10⁻⁵ of the diagonal.
const UNCERTAINTY_SHARE: f64 = 1e-9;

/// How a model is written to STEP.
#[derive(Clone, Debug, PartialEq)]
pub struct StepOptions {
    /// Largest number of control points of one face, 20 000 unless told. CAD systems open such faces at once, and
    /// larger ones slowly; smaller values give more faces.
    pub max_control_points: usize,
    /// Holes of a surface: of each the control points, shape `(n, 2)` with n ≥ 4, of a closed uniform cubic B-spline in the
    /// parameter domain, in either direction. They must lie inside the domain, off the seam of a closed direction, and neither
    /// meet each other nor themselves, which is not checked.
    pub holes: Vec<Array2<f64>>,
    /// Turns the normal of all faces round: it is ∂u × ∂v otherwise.
    pub flip: bool,
    /// Name of the file, for its header.
    pub file_name: String,
    /// Name of the part; empty for that of the file, without its extension.
    pub product: String,
    /// The program that made the model, with its version, for the header; empty for this crate.
    pub originating_system: String,
    /// The schema.
    pub schema: StepSchema,
    /// Author, for the header.
    pub author: String,
    /// Organization, for the header.
    pub organization: String,
    /// Time of writing, ISO 8601 such as `2025-03-01T12:00:00`; the start of 1970 unless told, so that equal models give
    /// equal files.
    pub time_stamp: String,
}

impl Default for StepOptions {
    fn default() -> Self {
        Self {
            max_control_points: 20_000,
            holes: Vec::new(),
            flip: false,
            file_name: String::new(),
            product: String::new(),
            originating_system: String::new(),
            schema: StepSchema::default(),
            author: String::new(),
            organization: String::new(),
            time_stamp: "1970-01-01T00:00:00".to_owned(),
        }
    }
}

/// The application protocol of a STEP file. The entities of a model are the same in both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StepSchema {
    /// ISO 10303-214, automotive design: read by every CAD system.
    #[default]
    Ap214,
    /// ISO 10303-242, managed model-based 3D engineering, which has taken its place.
    Ap242,
}

/// How large a STEP file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub struct StepSize {
    /// Faces.
    pub faces: usize,
    /// Control points of their surfaces, which CAD calls poles. A hierarchical surface has fewer: each face is a tensor product.
    pub poles: usize,
}

/// A surface for a STEP file of several.
#[derive(Clone, Copy, Debug)]
pub struct StepSurface<'a> {
    /// Its map.
    pub map: &'a SplineMap<2>,
    /// How it is written.
    pub options: &'a StepOptions,
}

/// A model in the form that goes to a STEP file: everything that can be wrong with it is found when it is made.
pub struct StepFile {
    shapes: Vec<Shape>,
    unit: LengthUnit,
    uncertainty: f64,
    options: StepOptions,
}

enum Shape {
    Shell { shell: Shell, flip: bool },
    Curve { map: SplineMap<1, TensorSpace<1>>, closed: bool },
}

impl StepFile {
    /// Brings a model into tensor-product form.
    ///
    /// # Errors
    /// [`ModelErrorKind::PointDimension`], [`ModelErrorKind::Discontinuous`], [`ModelErrorKind::Degenerate`],
    /// [`ModelErrorKind::HoleOutside`].
    pub fn new(model: &Model, options: &StepOptions) -> Result<Self, ModelErrorKind> {
        match &model.geometry {
            Geometry::Surface(map) => Self::of_surfaces(&[StepSurface { map, options }], model.unit),
            Geometry::Curve(map) => {
                let closed = map.space().periodic()[0];
                let shapes = vec![Shape::Curve { map: map.tensor_product()?, closed }];
                Ok(Self { shapes, unit: model.unit, uncertainty: checked_tolerance(map)?, options: options.clone() })
            }
        }
    }

    /// Brings several surfaces, with coordinates in one unit, into tensor-product form: each becomes a shell. What the header says
    /// is as in the options of the first.
    ///
    /// # Errors
    /// As of [`Self::new`].
    pub fn of_surfaces(surfaces: &[StepSurface<'_>], unit: LengthUnit) -> Result<Self, ModelErrorKind> {
        let mut shapes = Vec::with_capacity(surfaces.len());
        // Edges of the smallest surface must not be taken for points.
        let mut uncertainty = f64::INFINITY;
        for StepSurface { map, options } in surfaces {
            let tolerance = checked_tolerance(map)?;
            let (limit, size) = (options.max_control_points, diagonal(map.coefficients()));
            let shell = Shell::new(map, limit, tolerance, &options.holes, size)?;
            shapes.push(Shape::Shell { shell, flip: options.flip });
            uncertainty = uncertainty.min(tolerance);
        }
        let options = surfaces.first().map_or_else(StepOptions::default, |surface| surface.options.clone());
        Ok(Self { shapes, unit, uncertainty, options })
    }

    /// Number of faces; 0 for a curve.
    pub fn n_faces(&self) -> usize {
        let of_shape = |shape: &Shape| match shape {
            Shape::Shell { shell, .. } => shell.faces.len(),
            Shape::Curve { .. } => 0,
        };
        self.shapes.iter().map(of_shape).sum()
    }

    /// Number of control points of all faces, or of the curve.
    pub fn n_control_points(&self) -> usize {
        let of_shape = |shape: &Shape| match shape {
            Shape::Shell { shell, .. } => shell.faces.iter().map(|face| face.surface.space().n_functions()).sum(),
            Shape::Curve { map, .. } => map.space().n_functions(),
        };
        self.shapes.iter().map(of_shape).sum()
    }

    /// How large it is.
    pub fn size(&self) -> StepSize {
        StepSize { faces: self.n_faces(), poles: self.n_control_points() }
    }

    /// Writes the file.
    ///
    /// # Errors
    /// What `out` says.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let file = &mut Part21::new(out);
        document::begin(file, &self.options)?;
        let definition = document::product(file, &self.options)?;
        let context = document::context(file, self.unit, self.uncertainty)?;
        let (mut kind, mut items) = ("MANIFOLD_SURFACE", Vec::with_capacity(self.shapes.len() + 1));
        for shape in &self.shapes {
            items.push(match shape {
                Shape::Shell { shell, flip } => write_shell(file, shell, *flip)?,
                Shape::Curve { map, closed } => {
                    kind = "GEOMETRICALLY_BOUNDED_WIREFRAME";
                    let knots = map.space().knots(0);
                    let points: Vec<[f64; 3]> = map.coefficients().outer_iter().map(in_space).collect();
                    let curve = write_curve(file, knots.degree(), knots.knots(), &points, *closed)?;
                    file.entity(format_args!("GEOMETRIC_CURVE_SET('',({curve}))"))?
                }
            });
        }
        let shape = file.entity(format_args!("{kind}_SHAPE_REPRESENTATION('',{},{context})", list(items)))?;
        file.entity(format_args!("SHAPE_DEFINITION_REPRESENTATION({definition},{shape})"))?;
        document::end(file)
    }
}

/// Refuses what STEP cannot hold, and returns the distance below which points are the same.
fn checked_tolerance<const D: usize>(map: &SplineMap<D>) -> Result<f64, ModelErrorKind> {
    if !(2..=3).contains(&map.dim()) {
        return Err(ModelErrorKind::PointDimension { given: map.dim() });
    }
    let space: &HierarchicalSpace<D> = map.space();
    for direction in 0..D {
        let (knots, degree) = (space.knots(0, direction)?, space.degree()[direction]);
        let inner = &knots.breaks()[1..knots.n_spans()];
        let count = |value: f64| knots.knots().iter().filter(|&&k| k == value).count();
        if let Some(&value) = inner.iter().find(|&&value| count(value) > degree) {
            return Err(ModelErrorKind::Discontinuous { direction, value, given: count(value), limit: degree });
        }
    }
    let (lower, upper) = space.domain();
    let tolerance = UNCERTAINTY_SHARE * diagonal(map.coefficients());
    if tolerance > 0.0 && tolerance.is_finite() {
        return Ok(tolerance);
    }
    Err(ModelErrorKind::Degenerate { lower: lower.to_vec(), upper: upper.to_vec(), tolerance })
}

/// Diagonal of the box around points.
fn diagonal(points: ArrayView2<'_, f64>) -> f64 {
    let extent = |column: ndarray::ArrayView1<'_, f64>| {
        column.fold(f64::NEG_INFINITY, |a, &b| a.max(b)) - column.fold(f64::INFINITY, |a, &b| a.min(b))
    };
    points.columns().into_iter().map(|column| extent(column).powi(2)).sum::<f64>().sqrt()
}

fn write_shell(file: &mut Part21<'_>, shell: &Shell, flip: bool) -> io::Result<Id> {
    let mut used = vec![false; shell.edges.len()];
    shell.faces.iter().flat_map(|face| &face.boundary).for_each(|(edge, _)| used[*edge] = true);
    shell.faces.iter().flat_map(|face| &face.holes).for_each(|edge| used[*edge] = true);
    let mut vertices: Vec<Option<Id>> = vec![None; shell.vertices.len()];
    let mut edges: Vec<Option<Id>> = vec![None; shell.edges.len()];
    for (number, edge) in shell.edges.iter().enumerate().filter(|(number, _)| used[*number]) {
        let mut ends = Vec::with_capacity(2);
        for vertex in edge.vertices {
            ends.push(match vertices[vertex] {
                Some(written) => written,
                None => *vertices[vertex].insert(write_vertex(file, &shell.vertices[vertex])?),
            });
        }
        edges[number] = Some(write_edge(file, edge, &ends)?);
    }
    let mut faces = Vec::with_capacity(shell.faces.len());
    for face in &shell.faces {
        faces.push(write_face(file, face, &edges, flip)?);
    }
    let kind = if shell.is_closed() { "CLOSED_SHELL" } else { "OPEN_SHELL" };
    let shell = file.entity(format_args!("{kind}('',{})", list(faces)))?;
    file.entity(format_args!("SHELL_BASED_SURFACE_MODEL('',({shell}))"))
}

fn write_vertex(file: &mut Part21<'_>, point: &[f64; 3]) -> io::Result<Id> {
    let point = file.point(point)?;
    file.entity(format_args!("VERTEX_POINT('',{point})"))
}

fn write_edge(file: &mut Part21<'_>, edge: &Edge, ends: &[Id]) -> io::Result<Id> {
    let curve = write_curve(file, edge.degree, &edge.knots, &edge.points, edge.vertices[0] == edge.vertices[1])?;
    file.entity(format_args!("EDGE_CURVE('',{},{},{curve},.T.)", ends[0], ends[1]))
}

fn write_face(file: &mut Part21<'_>, face: &Face, edges: &[Option<Id>], flip: bool) -> io::Result<Id> {
    let surface = write_surface(file, face)?;
    let mut oriented = Vec::with_capacity(face.boundary.len());
    for &(edge, forward) in &face.boundary {
        if let Some(edge) = edges[edge] {
            let forward = logical(forward != flip);
            oriented.push(file.entity(format_args!("ORIENTED_EDGE('',*,*,{edge},{forward})"))?);
        }
    }
    // A loop runs counter-clockwise about the normal of its face, so it turns round with the normal.
    if flip {
        oriented.reverse();
    }
    let boundary = file.entity(format_args!("EDGE_LOOP('',{})", list(oriented)))?;
    let mut bounds = vec![file.entity(format_args!("FACE_OUTER_BOUND('',{boundary},.T.)"))?];
    for edge in face.holes.iter().filter_map(|&edge| edges[edge]) {
        let oriented = file.entity(format_args!("ORIENTED_EDGE('',*,*,{edge},{})", logical(!flip)))?;
        let rim = file.entity(format_args!("EDGE_LOOP('',({oriented}))"))?;
        bounds.push(file.entity(format_args!("FACE_BOUND('',{rim},.T.)"))?);
    }
    file.entity(format_args!("ADVANCED_FACE('',{},{surface},{})", list(bounds), logical(!flip)))
}

fn logical(value: bool) -> &'static str {
    if value { ".T." } else { ".F." }
}

fn write_points(file: &mut Part21<'_>, points: impl Iterator<Item = [f64; 3]>) -> io::Result<Vec<Id>> {
    points.map(|point| file.point(&point)).collect()
}

fn write_curve(
    file: &mut Part21<'_>,
    degree: usize,
    knots: &[f64],
    points: &[[f64; 3]],
    closed: bool,
) -> io::Result<Id> {
    let closed = logical(closed);
    let points = list(write_points(file, points.iter().copied())?);
    let (values, multiplicities) = with_multiplicities(knots);
    file.entity(format_args!(
        "B_SPLINE_CURVE_WITH_KNOTS('',{degree},{points},.UNSPECIFIED.,{closed},.U.,{multiplicities},{values},.UNSPECIFIED.)"
    ))
}

fn write_surface(file: &mut Part21<'_>, face: &Face) -> io::Result<Id> {
    let map = &face.surface;
    let [u_closed, v_closed] = face.closed.map(logical);
    let [u, v] = [map.space().knots(0), map.space().knots(1)];
    let points = write_points(file, map.coefficients().outer_iter().map(in_space))?;
    // STEP lists rows of constant u; our coefficients run along u first.
    let rows = (0..u.n_functions()).map(|i| list(points.iter().skip(i).step_by(u.n_functions())));
    let rows: Vec<String> = rows.collect();
    let points = format!("({})", rows.join(",\n"));
    let ((u_values, u_multiplicities), (v_values, v_multiplicities)) =
        (with_multiplicities(u.knots()), with_multiplicities(v.knots()));
    file.entity(format_args!(
        "B_SPLINE_SURFACE_WITH_KNOTS('',{},{},{points},.UNSPECIFIED.,{u_closed},{v_closed},.U.,\
         {u_multiplicities},{v_multiplicities},{u_values},{v_values},.UNSPECIFIED.)",
        u.degree(),
        v.degree()
    ))
}

/// Different knots, and how often each occurs, as lists.
fn with_multiplicities(knots: &[f64]) -> (String, String) {
    let groups: Vec<&[f64]> = knots.chunk_by(|a, b| a == b).collect();
    let values: Vec<f64> = groups.iter().map(|group| group[0]).collect();
    (reals(&values), list(groups.iter().map(|group| group.len())))
}
