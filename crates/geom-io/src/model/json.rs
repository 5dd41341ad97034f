//! Our own format: a JSON object from which a model is rebuilt to the last bit.
//!
//! ```text
//! { "format": "thb-spline-model", "version": 1,
//!   "dimension": 2, "kind": "thb" | "hb", "unit": "millimetre" | "metre" | "inch",
//!   "degrees": [p, q], "knots": [[…], […]], "periodic": [false, false],
//!   "splits": [{"level": 0, "cells": [[i, j], …]}, {"level": 1, "cells": […]}, …],
//!   "coefficients": [[x, y, z], …],
//!   "metadata": {…} }
//! ```
//!
//! `knots` are those of level 0, with repetitions; where `periodic` says so, the breaks, of which the last is the first one
//! a period on. `periodic` is absent where nothing is periodic; a file that has it is of version 2. `splits` are the cells that were split, in the order in which their
//! children were created: split anew in this order they give the same mesh with the same numbers. Coefficients are in
//! the order of the functions: by level, then by tensor index with the first direction fastest. `metadata` may be absent.

use std::io::{self, Write};

use ndarray::Array2;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use thb_core::{HierarchicalMesh, Kind, KnotVector, SplineMap};

use super::build::Parts;
use super::{Geometry, LengthUnit, Model, ModelErrorKind};

const FORMAT: &str = "thb-spline-model";
/// The version that is written, but for maps with periodic directions.
const VERSION: u64 = 1;
/// The version with `periodic`.
const PERIODIC_VERSION: u64 = 2;

/// What every version says first.
#[derive(Deserialize)]
struct Header {
    #[serde(default)]
    format: Value,
    #[serde(default)]
    version: u64,
}

#[derive(Deserialize)]
struct Document {
    dimension: usize,
    kind: KindName,
    unit: LengthUnit,
    degrees: Vec<usize>,
    knots: Vec<Vec<f64>>,
    #[serde(default)]
    periodic: Option<Vec<bool>>,
    splits: Vec<Splits>,
    coefficients: Vec<Vec<f64>>,
    #[serde(default)]
    metadata: Map<String, Value>,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum KindName {
    Hb,
    Thb,
}

/// Cells of one level that were split one after the other.
#[derive(Serialize, Deserialize)]
struct Splits {
    level: usize,
    cells: Vec<Vec<u32>>,
}

/// Writes a model; one coefficient a line, so that versions of a file can be compared line by line.
///
/// # Errors
/// What `out` says.
pub fn write_json(out: &mut dyn Write, model: &Model) -> io::Result<()> {
    match &model.geometry {
        Geometry::Curve(map) => write_map(out, map, model),
        Geometry::Surface(map) => write_map(out, map, model),
    }
}

fn write_map<const D: usize>(out: &mut dyn Write, map: &SplineMap<D>, model: &Model) -> io::Result<()> {
    let space = map.space();
    let kind = match space.kind() {
        Kind::Hb => KindName::Hb,
        Kind::Thb => KindName::Thb,
    };
    let mut knots = Vec::with_capacity(D);
    for d in 0..D {
        knots.push(space.knots(0, d).map_err(io::Error::other)?);
    }
    let degrees: Vec<usize> = knots.iter().map(|k| k.degree()).collect();
    let knots: Vec<&[f64]> = knots.iter().map(|k| if k.is_periodic() { k.breaks() } else { k.knots() }).collect();
    let periodic = space.periodic();
    let version = if periodic.contains(&true) { PERIODIC_VERSION } else { VERSION };
    writeln!(out, "{{\n\"format\": \"{FORMAT}\",\n\"version\": {version},\n\"dimension\": {D},")?;
    field(out, "kind", &kind)?;
    field(out, "unit", &model.unit)?;
    field(out, "degrees", &degrees)?;
    field(out, "knots", &knots)?;
    if version == PERIODIC_VERSION {
        field(out, "periodic", &periodic.to_vec())?;
    }
    field(out, "splits", &splits(space.mesh()))?;
    if !model.metadata.is_empty() {
        field(out, "metadata", &model.metadata)?;
    }
    write!(out, "\"coefficients\": [")?;
    for (i, row) in map.coefficients().outer_iter().enumerate() {
        out.write_all(if i == 0 { b"\n" } else { b",\n" })?;
        serde_json::to_writer(&mut *out, &row.to_vec())?;
    }
    writeln!(out, "\n]\n}}")
}

fn field(out: &mut dyn Write, name: &str, value: &impl Serialize) -> io::Result<()> {
    write!(out, "\"{name}\": ")?;
    serde_json::to_writer(&mut *out, value)?;
    writeln!(out, ",")
}

/// The split cells in the order in which their children were created, neighbours of equal level together.
fn splits<const D: usize>(mesh: &HierarchicalMesh<D>) -> Vec<Splits> {
    let mut split: Vec<_> =
        mesh.nodes().filter_map(|node| mesh.children(node).next().map(|child| (child, node))).collect();
    split.sort_unstable();
    let mut groups: Vec<Splits> = Vec::new();
    for (_, node) in split {
        let (level, cell) = (mesh.level(node), mesh.cell_index(node).to_vec());
        match groups.last_mut() {
            Some(group) if group.level == level => group.cells.push(cell),
            _ => groups.push(Splits { level, cells: vec![cell] }),
        }
    }
    groups
}

/// Reads a model.
///
/// # Errors
/// [`ModelErrorKind`]: not JSON, another format, a later version, or numbers that make no spline map.
pub fn parse_json(bytes: &[u8]) -> Result<Model, ModelErrorKind> {
    let header: Header = serde_json::from_slice(bytes).map_err(damaged)?;
    match header.format.as_str() {
        Some(FORMAT) => {}
        other => {
            let found = crate::error::quote(other.unwrap_or_default());
            return Err(ModelErrorKind::ForeignFormat { found, expected: FORMAT });
        }
    }
    if !(VERSION..=PERIODIC_VERSION).contains(&header.version) {
        return Err(ModelErrorKind::Version { found: header.version, supported: PERIODIC_VERSION });
    }
    let document: Document = serde_json::from_slice(bytes).map_err(damaged)?;
    let unit = document.unit;
    let mut document = document;
    let metadata = std::mem::take(&mut document.metadata);
    let geometry = match document.dimension {
        1 => Geometry::Curve(document.map()?),
        2 => Geometry::Surface(document.map()?),
        found => {
            let expected = "1 or 2".to_owned();
            return Err(ModelErrorKind::Count { what: "parameter dimension", found, expected });
        }
    };
    Ok(Model { geometry, unit, metadata })
}

fn damaged(error: serde_json::Error) -> ModelErrorKind {
    ModelErrorKind::Json { line: error.line(), column: error.column(), reason: error.to_string() }
}

impl Document {
    fn map<const D: usize>(self) -> Result<SplineMap<D>, ModelErrorKind> {
        let degrees: [usize; D] = exactly("degrees", self.degrees)?;
        let lists: [Vec<f64>; D] = exactly("knot vectors", self.knots)?;
        let mut knots = Vec::with_capacity(D);
        let periodic: [bool; D] = exactly("flags of periodic directions", self.periodic.unwrap_or(vec![false; D]))?;
        for ((degree, list), periodic) in degrees.into_iter().zip(lists).zip(periodic) {
            knots.push(if periodic { KnotVector::periodic(degree, list)? } else { KnotVector::new(degree, list)? });
        }
        let kind = match self.kind {
            KindName::Hb => Kind::Hb,
            KindName::Thb => Kind::Thb,
        };
        let parts = Parts { kind, knots: exactly("knot vectors", knots)?, coefficients: rows(self.coefficients)? };
        let finest = self.splits.iter().map(|group| group.level.saturating_add(1)).max().unwrap_or(0);
        parts.check_size(finest.saturating_add(1))?;
        let mut mesh = HierarchicalMesh::new(parts.grid())?;
        let mut index = 0;
        for group in &self.splits {
            for cell in &group.cells {
                let at: [u32; D] = exactly("indices of a split cell", cell.clone())?;
                let inside = (0..D).all(|d| (at[d] as usize) < mesh.grid(group.level)[d]);
                let leaf = inside && mesh.find(group.level, at).is_some_and(|node| mesh.is_leaf(node));
                if !leaf {
                    return Err(ModelErrorKind::Split { index, level: group.level, cell: cell.clone() });
                }
                mesh.split(group.level, at)?;
                index += 1;
            }
        }
        parts.map(mesh)
    }
}

fn exactly<T, const D: usize>(what: &'static str, list: Vec<T>) -> Result<[T; D], ModelErrorKind> {
    let found = list.len();
    list.try_into().map_err(|_| ModelErrorKind::Count { what, found, expected: D.to_string() })
}

fn rows(rows: Vec<Vec<f64>>) -> Result<Array2<f64>, ModelErrorKind> {
    let expected = rows.first().map_or(0, Vec::len);
    if let Some((row, bad)) = rows.iter().enumerate().find(|(_, row)| row.len() != expected) {
        return Err(ModelErrorKind::RaggedCoefficients { row, found: bad.len(), expected });
    }
    let (n, flat): (usize, Vec<f64>) = (rows.len(), rows.into_iter().flatten().collect());
    let found = flat.len();
    Array2::from_shape_vec((n, expected), flat).map_err(|_| ModelErrorKind::Count {
        what: "components of the coefficients",
        found,
        expected: format!("{n} × {expected}"),
    })
}
