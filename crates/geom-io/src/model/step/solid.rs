//! Surfaces of several patches as one solid, or as an open shell.
//!
//! Topology comes from the patches, not from comparing points: one `VERTEX_POINT` a vertex, one `EDGE_CURVE` an arc whose curve is the
//! boundary B-spline that both patches have there, to the last bit, and one face a patch. A closed surface is a
//! `MANIFOLD_SOLID_BREP`, an open one a `SHELL_BASED_SURFACE_MODEL`.

use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;

use ndarray::ArrayView2;
use thb_core::{CellSpace, MultiPatchSpace, SplineMap, TensorSpace};

use super::shell::{Edge, Face, in_space};
use super::{StepOptions, StepSize, UNCERTAINTY_SHARE, diagonal, document, write_edge, write_face, write_vertex};
use crate::model::step::part21::{Part21, list};
use crate::model::{LengthUnit, ModelError, ModelErrorKind, named};
use crate::write::write_atomically;

/// A surface of several patches in the form that goes to a STEP file: everything that can be wrong with it is found when it is made.
pub struct SolidFile {
    vertices: Vec<[f64; 3]>,
    edges: Vec<Edge>,
    faces: Vec<Face>,
    is_closed: bool,
    unit: LengthUnit,
    uncertainty: f64,
    options: StepOptions,
}

impl SolidFile {
    /// Takes a map apart into faces, edges and vertices. For a solid `S_u × S_v` points outward; [`StepOptions::flip`] turns all
    /// faces round if it points inward.
    ///
    /// # Errors
    /// [`ModelErrorKind::PointDimension`]; [`ModelErrorKind::Misoriented`] if neighbours disagree on which side is outside;
    /// [`ModelErrorKind::Degenerate`] without extent.
    pub fn new(
        map: &SplineMap<2, MultiPatchSpace>,
        unit: LengthUnit,
        options: &StepOptions,
    ) -> Result<Self, ModelErrorKind> {
        if map.dim() != 3 {
            return Err(ModelErrorKind::PointDimension { given: map.dim() });
        }
        let (space, coefficients) = (map.space().as_ref(), map.coefficients());
        let topology = space.topology();
        if let Some(arc) = topology.misoriented_arc() {
            return Err(ModelErrorKind::Misoriented { arc });
        }
        let uncertainty = UNCERTAINTY_SHARE * diagonal(coefficients);
        if !(uncertainty > 0.0 && uncertainty.is_finite()) {
            return Err(ModelErrorKind::Degenerate {
                lower: vec![0.0; 2],
                upper: vec![1.0; 2],
                tolerance: uncertainty,
            });
        }
        // At a vertex one function does not vanish, the vertex's own, and it has the vertex's number.
        let vertices = (0..topology.n_vertices()).map(|vertex| in_space(coefficients.row(vertex))).collect();
        let mut edges = Vec::with_capacity(topology.arcs().len());
        for arc in 0..topology.arcs().len() {
            edges.push(edge(space, coefficients, arc)?);
        }
        let mut faces = Vec::with_capacity(space.n_patches());
        for (patch, sides) in topology.patches().iter().enumerate() {
            let surface = tensor_product(&space.patch_map(patch, coefficients)?)?;
            let boundary = sides.iter().map(|side| (side.arc as usize, !side.reversed)).collect();
            faces.push(Face { surface, closed: [false; 2], boundary, holes: Vec::new() });
        }
        let is_closed = topology.is_closed();
        Ok(Self { vertices, edges, faces, is_closed, unit, uncertainty, options: options.clone() })
    }

    /// Number of control points of all faces.
    pub fn n_control_points(&self) -> usize {
        self.faces.iter().map(|face| face.surface.space().n_functions()).sum()
    }

    /// How large it is.
    pub fn size(&self) -> StepSize {
        StepSize { faces: self.faces.len(), poles: self.n_control_points() }
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
        let mut vertices = Vec::with_capacity(self.vertices.len());
        for vertex in &self.vertices {
            vertices.push(write_vertex(file, vertex)?);
        }
        let mut edges = Vec::with_capacity(self.edges.len());
        for edge in &self.edges {
            edges.push(Some(write_edge(file, edge, &edge.vertices.map(|vertex| vertices[vertex]))?));
        }
        let mut faces = Vec::with_capacity(self.faces.len());
        for face in &self.faces {
            faces.push(write_face(file, face, &edges, self.options.flip)?);
        }
        let (kind, item) = if self.is_closed {
            let shell = file.entity(format_args!("CLOSED_SHELL('',{})", list(faces)))?;
            ("ADVANCED_BREP", file.entity(format_args!("MANIFOLD_SOLID_BREP('',{shell})"))?)
        } else {
            let shell = file.entity(format_args!("OPEN_SHELL('',{})", list(faces)))?;
            ("MANIFOLD_SURFACE", file.entity(format_args!("SHELL_BASED_SURFACE_MODEL('',({shell}))"))?)
        };
        let shape = file.entity(format_args!("{kind}_SHAPE_REPRESENTATION('',({item}),{context})"))?;
        file.entity(format_args!("SHAPE_DEFINITION_REPRESENTATION({definition},{shape})"))?;
        document::end(file)
    }
}

/// The tensor-product form of a patch. One level has it already, and keeps its control points to the last bit.
fn tensor_product(patch: &SplineMap<2>) -> Result<SplineMap<2, TensorSpace<2>>, ModelErrorKind> {
    let own = patch.space();
    if own.n_levels() > 1 {
        return Ok(patch.tensor_product()?);
    }
    let space = TensorSpace::new([own.knots(0, 0)?.clone(), own.knots(0, 1)?.clone()])?;
    Ok(SplineMap::new(Arc::new(space), patch.coefficients().to_owned())?)
}

/// The curve of an arc, from its start to its end.
fn edge(space: &MultiPatchSpace, coefficients: ArrayView2<'_, f64>, arc: usize) -> Result<Edge, ModelErrorKind> {
    let knots = space.arc_knots(arc)?;
    let functions = space.arc_functions(arc);
    Ok(Edge {
        vertices: space.topology().arcs()[arc].map(|vertex| vertex as usize),
        degree: knots.degree(),
        knots: knots.knots().to_vec(),
        points: functions.iter().map(|&f| in_space(coefficients.row(f as usize))).collect(),
    })
}

/// Writes a surface of several patches into a STEP file, whole or not at all: a closed one is a solid. Returns how large it is.
///
/// # Errors
/// [`ModelError`] with what the system says, or what the format cannot hold.
pub fn write_solid(
    path: &Path,
    map: &SplineMap<2, MultiPatchSpace>,
    unit: LengthUnit,
    options: &StepOptions,
) -> Result<StepSize, ModelError> {
    let write = || -> Result<StepSize, ModelErrorKind> {
        let file = SolidFile::new(map, unit, &named(path, options))?;
        write_atomically(path, |out| file.write(out))?;
        Ok(file.size())
    };
    write().map_err(|kind| ModelError { path: path.to_owned(), kind })
}
