//! Writing G+Smo's XML.

use std::io::{self, Write};

use thb_core::{Kind, SplineMap};

use super::boxes::boxes_of_mesh;
use crate::model::{Geometry, LengthUnit, Model};

/// Writes a model as one geometry with `id="0"`.
///
/// # Errors
/// What `out` says.
pub fn write_gismo(out: &mut dyn Write, model: &Model) -> io::Result<()> {
    match &model.geometry {
        Geometry::Curve(map) => write_map(out, map, model.unit),
        Geometry::Surface(map) => write_map(out, map, model.unit),
    }
}

fn write_map<const D: usize>(out: &mut dyn Write, map: &SplineMap<D>, unit: LengthUnit) -> io::Result<()> {
    let opened = map.opened().map_err(io::Error::other)?;
    let (map, space) = (&opened, opened.space());
    let name = match space.kind() {
        Kind::Hb => "HBSpline",
        Kind::Thb => "THBSpline",
    };
    writeln!(out, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<xml>")?;
    writeln!(out, " <Geometry type=\"{name}{D}\" id=\"0\" unit=\"{}\">", unit.name())?;
    writeln!(out, "  <Basis type=\"{name}Basis{D}\">")?;
    // One direction is no tensor product in G+Smo: the basis of level 0 is then the B-spline basis itself.
    if D > 1 {
        writeln!(out, "   <Basis type=\"TensorBSplineBasis{D}\">")?;
    }
    for d in 0..D {
        let knots = space.knots(0, d).map_err(io::Error::other)?;
        writeln!(out, "    <Basis type=\"BSplineBasis\" index=\"{d}\">")?;
        write!(out, "     <KnotVector degree=\"{}\">", knots.degree())?;
        write_row(out, knots.knots().iter())?;
        writeln!(out, "</KnotVector>\n    </Basis>")?;
    }
    if D > 1 {
        writeln!(out, "   </Basis>")?;
    }
    for b in boxes_of_mesh(space.mesh()) {
        let numbers: Vec<String> = b.lower.iter().chain(&b.upper).map(u32::to_string).collect();
        writeln!(out, "   <box level=\"{}\">{}</box>", b.level, numbers.join(" "))?;
    }
    writeln!(out, "  </Basis>\n  <coefs geoDim=\"{}\">", map.dim())?;
    for row in map.coefficients().outer_iter() {
        write_row(out, row.iter())?;
        writeln!(out)?;
    }
    writeln!(out, "  </coefs>\n </Geometry>\n</xml>")
}

/// Numbers with one blank between them, in the shortest form that reads back to the same bits.
fn write_row<'a>(out: &mut dyn Write, numbers: impl Iterator<Item = &'a f64>) -> io::Result<()> {
    for (i, number) in numbers.enumerate() {
        let blank = if i == 0 { "" } else { " " };
        write!(out, "{blank}{number:?}")?;
    }
    Ok(())
}
