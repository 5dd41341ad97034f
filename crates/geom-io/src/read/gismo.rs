//! Parametrized clouds in G+Smo's XML: matrix 0 holds the parameters, matrix 1 the points, a column each.

use ndarray::Array2;
use roxmltree::{Document, Node};

use super::text::{number_or_nan, parse_count, quote};
use super::{Format, Scan, xml};
use crate::error::{Location, ReadErrorKind};

const PARAMETERS: usize = 0;
const POINTS: usize = 1;

pub(super) fn read(bytes: &[u8]) -> Result<Scan, ReadErrorKind> {
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let before = &bytes[..error.valid_up_to()];
        ReadErrorKind::NotText { line: 1 + before.iter().filter(|&&b| b == b'\n').count() }
    })?;
    xml::check(text).map_err(|reason| ReadErrorKind::Xml { reason })?;
    let document = Document::parse(text).map_err(|error| ReadErrorKind::Xml { reason: error.to_string() })?;
    let named = |name: &'static str| document.descendants().filter(move |node| node.has_tag_name(name));

    let matrices: Vec<_> = named("Matrix").collect();
    if matrices.is_empty()
        && let Some(geometry) = named("Geometry").next()
    {
        let geometry = geometry.attribute("type").unwrap_or("without type");
        return Err(ReadErrorKind::HoldsModel { geometry: quote(geometry.as_bytes()) });
    }
    let only = |id: usize| {
        let mut found = matrices.iter().filter(|m| m.attribute("id").and_then(|a| a.trim().parse().ok()) == Some(id));
        match (found.next(), found.next()) {
            (Some(matrix), None) => Ok(*matrix),
            _ => Err(ReadErrorKind::MatrixIds {
                ids: matrices.iter().map(|m| quote(m.attribute("id").unwrap_or("none").as_bytes())).collect(),
            }),
        }
    };
    let parameters = read_matrix(only(PARAMETERS)?, PARAMETERS)?;
    let points = read_matrix(only(POINTS)?, POINTS)?;
    let (parameters, mut points) = as_rows(parameters, points)?;
    // A point without parameters is as one without coordinates: it is left out.
    for (mut point, parameters) in points.outer_iter_mut().zip(parameters.outer_iter()) {
        if parameters.iter().any(|parameter| parameter.is_nan()) {
            point.fill(f64::NAN);
        }
    }

    let mut scan = Scan::new(Format::GismoXml, points);
    scan.cloud.parameters = Some(parameters);
    Ok(scan)
}

fn read_matrix(node: Node<'_, '_>, id: usize) -> Result<Array2<f64>, ReadErrorKind> {
    let attribute = |attribute: &'static str, expected| {
        let value = node.attribute(attribute).unwrap_or_default();
        (value.trim(), ReadErrorKind::MatrixAttribute { id, attribute, value: quote(value.as_bytes()), expected })
    };
    let size = |name| {
        let (value, error) = attribute(name, "expected a number of rows or columns");
        parse_count(value.as_bytes()).ok_or(error)
    };
    let (rows, cols) = (size("rows")?, size("cols")?);
    let (encoding, error) = attribute("format", "only ASCII matrices can be read");
    if !encoding.is_empty() && !encoding.eq_ignore_ascii_case("ascii") {
        return Err(error);
    }

    let mut values = Vec::new();
    for text in node.children().filter_map(|child| child.is_text().then(|| child.text()).flatten()) {
        for field in text.split_ascii_whitespace() {
            let location = Location::MatrixValue { id, index: values.len() };
            let value = number_or_nan(field.as_bytes())
                .ok_or_else(|| ReadErrorKind::NotANumber { location, text: quote(field.as_bytes()) })?;
            values.push(value);
        }
    }
    let found = values.len();
    Array2::from_shape_vec((rows, cols), values).map_err(|_| ReadErrorKind::MatrixSize { id, rows, cols, found })
}

/// Both matrices with one row a point. A column a point is G+Smo's layout and goes first where both would do.
fn as_rows(parameters: Array2<f64>, points: Array2<f64>) -> Result<(Array2<f64>, Array2<f64>), ReadErrorKind> {
    let shapes = (parameters.dim(), points.dim());
    for (parameters_flipped, points_flipped) in [(true, true), (false, false), (true, false), (false, true)] {
        let flip = |(rows, cols), flipped| if flipped { (cols, rows) } else { (rows, cols) };
        let (m, two) = flip(shapes.0, parameters_flipped);
        if two == 2 && flip(shapes.1, points_flipped) == (m, 3) {
            let layout = |matrix: Array2<f64>, flipped| match flipped {
                true => matrix.t().as_standard_layout().into_owned(),
                false => matrix,
            };
            return Ok((layout(parameters, parameters_flipped), layout(points, points_flipped)));
        }
    }
    Err(ReadErrorKind::MatrixShapes { parameters: shapes.0, points: shapes.1 })
}
