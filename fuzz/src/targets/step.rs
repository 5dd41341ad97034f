//! Writing STEP: spaces, surfaces, holes and limits that follow from the bytes.

use std::f64::consts::TAU;
use std::sync::Arc;

use geom_io::model::step::StepFile;
use geom_io::{Geometry, LengthUnit, Model, StepOptions};
use ndarray::Array2;
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, Refinement, SplineMap};

use super::models::{check_written, told, written};
use crate::bounds::{Bounds, bounded};

/// Bytes that a file may stand for: what is bounded is the cost of a face.
const BYTES: usize = 1 << 18;

/// Functions up to which a space is refined further: larger ones take long, and nothing else happens in them.
const FUNCTIONS: usize = 200;

/// The next byte, 0 after the last one.
struct Bytes<'a>(std::slice::Iter<'a, u8>);

impl Bytes<'_> {
    fn next(&mut self) -> usize {
        self.0.next().copied().unwrap_or(0).into()
    }

    fn below(&mut self, bound: usize) -> usize {
        self.next() % bound
    }
}

/// Writes a model that follows from the bytes.
pub(super) fn run(bytes: &[u8]) {
    let mut bytes = Bytes(bytes.iter());
    let model = match bytes.below(4) {
        0 => space::<1>(&mut bytes).map(|space| model(Geometry::Curve(map(space, &mut bytes)))),
        _ => space::<2>(&mut bytes).map(|space| model(Geometry::Surface(map(space, &mut bytes)))),
    };
    let Some(model) = model else { return };
    let text = |bytes: &mut Bytes<'_>| -> String {
        let length = bytes.below(6);
        (0..length).map(|_| char::from_u32(bytes.next() as u32 * 37).unwrap_or('?')).collect()
    };
    let options = StepOptions {
        max_control_points: 1 << bytes.below(12),
        holes: (0..bytes.below(3)).map(|_| hole(&mut bytes)).collect(),
        flip: bytes.below(2) == 1,
        file_name: text(&mut bytes),
        product: text(&mut bytes),
        author: text(&mut bytes),
        ..StepOptions::default()
    };
    bounded(Bounds::of_reading(BYTES, BYTES), || {
        let Some(file) = told(StepFile::new(&model, &options)) else { return };
        let text = written(|out| file.write(out));
        assert!(text.starts_with("ISO-10303-21;") && text.trim_end().ends_with("END-ISO-10303-21;"), "no whole file");
        assert!(text.is_ascii(), "Part 21 is ASCII");
        assert!(file.n_control_points() > 0);
        check_written(&text);
    });
}

fn model(geometry: Geometry) -> Model {
    let unit = LengthUnit::Millimetre;
    match geometry {
        Geometry::Curve(map) => Model::curve(map, unit),
        Geometry::Surface(map) => Model::surface(map, unit),
    }
}

/// A space with a few refinements; `None` where the bytes make none.
fn space<const D: usize>(bytes: &mut Bytes<'_>) -> Option<HierarchicalSpace<D>> {
    let kind = if bytes.below(4) == 0 { Kind::Hb } else { Kind::Thb };
    let mut knots = Vec::new();
    for _ in 0..D {
        let (degree, elements, is_periodic) = (1 + bytes.below(8), 1 + bytes.below(6), bytes.below(4) == 0);
        let vector = match is_periodic {
            true => KnotVector::uniform_periodic(degree, elements + degree),
            false => KnotVector::uniform(degree, elements),
        };
        knots.push(vector.ok()?);
    }
    let mut space = HierarchicalSpace::new(kind, knots.try_into().ok()?).ok()?;
    for _ in 0..bytes.below(5) {
        let refinement = Refinement {
            extension: std::array::from_fn(|_| bytes.below(3)),
            admissible: [None, Some(2), Some(3), None][bytes.below(4)],
            max_levels: 6,
        };
        let cells: Vec<usize> = (0..=bytes.below(3)).map(|_| bytes.next() % space.n_cells()).collect();
        let finer = space.refine(&cells, &refinement).ok()?;
        if finer.n_functions() > FUNCTIONS {
            break;
        }
        space = finer;
    }
    Some(space)
}

/// A map with coefficients of the sizes that go wrong.
fn map<const D: usize>(space: HierarchicalSpace<D>, bytes: &mut Bytes<'_>) -> SplineMap<D> {
    const SCALES: [f64; 8] = [1.0, 1.0, 1.0, 0.0, 1e-12, 1e12, 1e99, f64::MIN_POSITIVE];
    let (scale, shift) = (SCALES[bytes.below(8)], SCALES[bytes.below(8)]);
    let dim = 1 + bytes.below(4);
    let coefficients = Array2::from_shape_simple_fn((space.n_functions(), dim), || match bytes.next() {
        0 => 0.0,
        byte => scale * (byte as f64 / 128.0 - 1.0) + shift,
    });
    SplineMap::new(Arc::new(space), coefficients).expect("there is a row for each function")
}

/// A round hole anywhere in the domain, or beyond it.
fn hole(bytes: &mut Bytes<'_>) -> Array2<f64> {
    let [u, v, radius] = [(); 3].map(|()| bytes.next() as f64 / 255.0);
    let count = bytes.below(9);
    Array2::from_shape_fn((count, 2), |(i, d)| {
        let angle = TAU * i as f64 / count as f64;
        if d == 0 { u + 0.4 * radius * angle.cos() } else { v + 0.4 * radius * angle.sin() }
    })
}
