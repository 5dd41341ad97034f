//! Stanford PLY (Turk 1994): ASCII and binary, any scalar types.
//!
//! Of element `vertex` the properties `x`, `y`, `z` and `nx`, `ny`, `nz` are read, of elements `face` and `tristrips` the list
//! `vertex_indices` (or `vertex_index`), all in upper or lower case; everything else is stepped over.

mod body;
mod header;

use self::body::{Body, Place};
use self::header::{Element, Header, Kind};
use super::faces::{Faces, vertex_index};
use super::text::{Lines, quote};
use super::{Format, Scan, rows, with_room};
use crate::error::{ReadErrorKind, plain};

pub(super) fn read(bytes: &[u8]) -> Result<Scan, ReadErrorKind> {
    let mut lines = Lines::new(bytes);
    let header = Header::parse(&mut lines)?;
    let vertex_count = header.elements.iter().find(|e| e.is_named("vertex")).map_or(0, |e| e.count);
    let mut body = Body::new(lines, header.encoding);
    let (mut coordinates, mut normals) = (Vec::new(), None);
    let mut faces = Faces::default();
    let mut notes = Vec::new();
    for element in &header.elements {
        match element.name.to_ascii_lowercase().as_str() {
            "vertex" if coordinates.is_empty() => (coordinates, normals) = read_vertices(&mut body, element)?,
            name @ ("face" | "tristrips") => match element.corner_list() {
                Some(list) => {
                    let kind = if name == "face" { Corners::Polygon } else { Corners::Strips };
                    read_faces(&mut body, element, (list, kind), vertex_count, &mut faces)?;
                }
                None => {
                    body.for_each(element, &[], |_, _| Ok(()))?;
                    notes.push(format!("element {name} lists no vertices and was ignored"));
                }
            },
            _ => {
                body.for_each(element, &[], |_, _| Ok(()))?;
                let name = plain(&quote(element.name.as_bytes()));
                notes.push(format!("{} records of element {name} were ignored", element.count));
            }
        }
    }
    let surplus = body.bytes_left();
    if surplus > 0 {
        notes.push(format!("{surplus} bytes after the last element were ignored"));
    }
    let mut scan = Scan::new(Format::Ply, rows(coordinates, 3));
    scan.normals = normals;
    scan.triangles = faces.finish(&mut notes);
    scan.notes = notes;
    Ok(scan)
}

/// Coordinates, and the normals of vertices that have such.
type Vertices = (Vec<f64>, Option<Vec<[f64; 3]>>);

fn read_vertices(body: &mut Body<'_>, element: &Element) -> Result<Vertices, ReadErrorKind> {
    let column = |property: &'static str| {
        let scalar = |p: &header::Property| p.name.eq_ignore_ascii_case(property) && matches!(p.kind, Kind::Scalar(_));
        element.properties.iter().position(scalar).ok_or_else(|| ReadErrorKind::MissingProperty {
            property,
            found: element.properties.iter().map(|p| quote(p.name.as_bytes())).collect(),
        })
    };
    let columns = [column("x")?, column("y")?, column("z")?];
    let normal = match (column("nx"), column("ny"), column("nz")) {
        (Ok(x), Ok(y), Ok(z)) => Some([x, y, z]),
        _ => None,
    };
    // Values arrive in the order of the file's properties.
    let mut in_file_order: Vec<usize> = columns.into_iter().chain(normal.into_iter().flatten()).collect();
    in_file_order.sort_unstable();
    let place_of = |column: usize| in_file_order.iter().position(|&c| c == column).unwrap_or_default();
    let (order, normal) = (columns.map(place_of), normal.map(|normal| normal.map(place_of)));

    let mut coordinates: Vec<f64> = with_room(3 * body.at_most(element))?;
    let mut normals = Vec::new();
    body.for_each(element, &in_file_order, |values, _| {
        for axis in order {
            coordinates.push(values[axis]);
        }
        normals.extend(normal.map(|normal| normal.map(|at| values[at])));
        Ok(())
    })?;
    Ok((coordinates, normal.map(|_| normals)))
}

/// What the indices of a list are.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Corners {
    /// Those of one polygon.
    Polygon,
    /// Those of strips of triangles, one after the other with −1 between two.
    Strips,
}

fn read_faces(
    body: &mut Body<'_>,
    element: &Element,
    (list, kind): (usize, Corners),
    vertex_count: usize,
    faces: &mut Faces,
) -> Result<(), ReadErrorKind> {
    let mut corners = Vec::new();
    body.for_each(element, &[list], |indices, place| {
        for indices in indices.split(|&index| kind == Corners::Strips && index == -1.0) {
            corners.clear();
            for &index in indices {
                corners.push(corner(index, vertex_count, &place)?);
            }
            match kind {
                Corners::Polygon => faces.push(&corners),
                Corners::Strips => faces.push_strip(&corners),
            }
        }
        Ok(())
    })
}

fn corner(index: f64, vertex_count: usize, place: &Place<'_>) -> Result<u32, ReadErrorKind> {
    if index.fract() != 0.0 {
        return Err(ReadErrorKind::NotAnIndex { location: place.location(), text: index.to_string() });
    }
    vertex_index(index as i64, vertex_count, || place.location())
}
