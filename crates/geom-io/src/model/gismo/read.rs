//! Reading G+Smo's XML.

use ndarray::Array2;
use roxmltree::{Document, Node};
use thb_core::{HierarchicalMesh, Kind, KnotVector, SplineMap};

use super::boxes::{LevelBox, refine_to_boxes};
use crate::error::quote;
use crate::model::build::Parts;
use crate::model::{Geometry, LengthUnit, Model, ModelErrorKind};
use crate::read::check_xml;

/// Reads the one geometry of a file.
///
/// # Errors
/// [`ModelErrorKind`]: not well-formed, another kind of geometry, or numbers that make no spline map.
pub fn parse_gismo(bytes: &[u8]) -> Result<Model, ModelErrorKind> {
    let text = std::str::from_utf8(bytes).map_err(|error| ModelErrorKind::Xml { reason: error.to_string() })?;
    check_xml(text).map_err(|reason| ModelErrorKind::Xml { reason })?;
    let document = Document::parse(text).map_err(|error| ModelErrorKind::Xml { reason: error.to_string() })?;
    let geometries: Vec<_> = document.descendants().filter(|node| node.has_tag_name("Geometry")).collect();
    let [geometry] = geometries[..] else {
        return Err(ModelErrorKind::Geometries { found: geometries.len() });
    };
    let kind = geometry.attribute("type").unwrap_or_default();
    let geometry_map = match kind {
        "BSpline" | "THBSpline1" => Geometry::Curve(read_map(geometry, Kind::Thb)?),
        "HBSpline1" => Geometry::Curve(read_map(geometry, Kind::Hb)?),
        "TensorBSpline2" | "THBSpline2" => Geometry::Surface(read_map(geometry, Kind::Thb)?),
        "HBSpline2" => Geometry::Surface(read_map(geometry, Kind::Hb)?),
        other => return Err(ModelErrorKind::GeometryType { found: quote(other) }),
    };
    let unit = match geometry.attribute("unit") {
        None => LengthUnit::default(),
        Some(name) => LengthUnit::from_name(name).ok_or_else(|| ModelErrorKind::Value {
            what: "attribute unit",
            text: quote(name),
            expected: "micrometre, millimetre, centimetre, metre, inch or foot",
        })?,
    };
    Ok(Model { geometry: geometry_map, unit, metadata: serde_json::Map::new() })
}

fn read_map<const D: usize>(geometry: Node<'_, '_>, kind: Kind) -> Result<SplineMap<D>, ModelErrorKind> {
    let basis = only_child(geometry, "Basis")?;
    let mut knots = read_knots(basis)?;
    let found = knots.len();
    knots.sort_by_key(|(index, _)| *index);
    let knots: Vec<KnotVector> = knots.into_iter().map(|(_, knots)| knots).collect();
    let knots: [KnotVector; D] =
        knots.try_into().map_err(|_| ModelErrorKind::Count { what: "knot vectors", found, expected: D.to_string() })?;
    let parts = Parts { kind, knots, coefficients: read_coefficients(geometry)? };
    let boxes = read_boxes(basis, parts.grid(), |n_levels| parts.check_size(n_levels))?;
    let mut mesh = HierarchicalMesh::new(parts.grid())?;
    refine_to_boxes(&mut mesh, &boxes, parts.coefficients.nrows())?;
    parts.map(mesh)
}

/// The knot vectors of level 0, each with the index of its direction.
fn read_knots(basis: Node<'_, '_>) -> Result<Vec<(usize, KnotVector)>, ModelErrorKind> {
    let mut knots = Vec::new();
    for node in basis.descendants().filter(|node| node.has_tag_name("KnotVector")) {
        // The direction is an attribute of the basis around the knots; a curve's basis needs none.
        let index = match node.parent().and_then(|parent| parent.attribute("index")) {
            Some(text) => parse("attribute index", text, "a direction, from 0")?,
            None => 0,
        };
        let degree = parse("attribute degree", node.attribute("degree").unwrap_or_default(), "a degree")?;
        knots.push((index, KnotVector::new(degree, numbers("KnotVector", node)?)?));
    }
    Ok(knots)
}

fn read_boxes<const D: usize>(
    basis: Node<'_, '_>,
    grid: [usize; D],
    check_size: impl Fn(usize) -> Result<(), ModelErrorKind>,
) -> Result<Vec<LevelBox<D>>, ModelErrorKind> {
    check_size(1)?;
    let mut boxes = Vec::new();
    for (index, node) in basis.children().filter(|node| node.has_tag_name("box")).enumerate() {
        let level: usize = parse("attribute level", node.attribute("level").unwrap_or_default(), "a level, from 0")?;
        check_size(level.saturating_add(1))?;
        let numbers: Vec<u32> =
            fields(node).map(|text| parse("box", text, "an index, from 0")).collect::<Result<_, _>>()?;
        if numbers.len() != 2 * D {
            let expected = (2 * D).to_string();
            return Err(ModelErrorKind::Count { what: "numbers of a box", found: numbers.len(), expected });
        }
        let (lower, upper) = (std::array::from_fn(|d| numbers[d]), std::array::from_fn(|d| numbers[D + d]));
        let grid = grid.map(|n| n << level);
        if (0..D).any(|d| lower[d] >= upper[d] || upper[d] as usize > grid[d]) {
            return Err(ModelErrorKind::Box { index, numbers, level, grid: grid.to_vec() });
        }
        boxes.push(LevelBox { level, lower, upper });
    }
    Ok(boxes)
}

fn read_coefficients(geometry: Node<'_, '_>) -> Result<Array2<f64>, ModelErrorKind> {
    let node = only_child(geometry, "coefs")?;
    let dim: usize = parse("attribute geoDim", node.attribute("geoDim").unwrap_or_default(), "a dimension, from 1")?;
    let values: Vec<f64> = numbers("coefs", node)?;
    let found = values.len();
    let rows = found.checked_div(dim).unwrap_or(0);
    Array2::from_shape_vec((rows, dim), values).map_err(|_| ModelErrorKind::Count {
        what: "components of the coefficients",
        found,
        expected: format!("a multiple of {dim}"),
    })
}

fn only_child<'a, 'b>(node: Node<'a, 'b>, element: &'static str) -> Result<Node<'a, 'b>, ModelErrorKind> {
    let mut found = node.children().filter(|child| child.has_tag_name(element));
    match (found.next(), found.next()) {
        (Some(child), None) => Ok(child),
        _ => Err(ModelErrorKind::Element { element }),
    }
}

/// The blank-separated fields of an element's text, comments skipped.
fn fields<'a>(node: Node<'a, '_>) -> impl Iterator<Item = &'a str> {
    node.children()
        .filter(|child| child.is_text())
        .filter_map(|child| child.text())
        .flat_map(str::split_ascii_whitespace)
}

fn numbers(what: &'static str, node: Node<'_, '_>) -> Result<Vec<f64>, ModelErrorKind> {
    fields(node).map(|text| parse(what, text, "a number")).collect()
}

fn parse<T: std::str::FromStr>(what: &'static str, text: &str, expected: &'static str) -> Result<T, ModelErrorKind> {
    text.trim().parse().map_err(|_| ModelErrorKind::Value { what, text: quote(text), expected })
}
