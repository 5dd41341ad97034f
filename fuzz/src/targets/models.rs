//! Models that are read back: JSON and G+Smo's XML.

use geom_io::model::{dxf, gismo, json, step, svg};
use geom_io::{Geometry, Model, ModelErrorKind, StepOptions, SvgOptions};

use super::messages;
use crate::bounds::{Bounds, bounded};

/// Control points up to which what was read is also written: patches of STEP files take a while.
const WRITTEN: usize = 400;

/// Reads the bytes as both, and what was read is written and read again.
pub(super) fn run(bytes: &[u8]) {
    for (name, parse) in [("JSON", json::parse_json as fn(&[u8]) -> _), ("XML", gismo::parse_gismo)] {
        let bounds = Bounds::of_reading(bytes.len(), bytes.len());
        let Some(model) = bounded(bounds, || told(parse(bytes))) else { continue };
        let size = coefficients(&model).len();
        assert!(coefficients(&model).iter().all(|c| c.is_finite()), "{name}: a coefficient is not finite");
        if size > 3 * WRITTEN {
            continue;
        }
        // What is written takes more bytes than what was read.
        let bounds = Bounds::of_reading(4096 + 40 * bytes.len(), 4096 + 40 * bytes.len());
        bounded(bounds, || round_trips(&model));
    }
}

fn round_trips(model: &Model) {
    let mut text = Vec::new();
    json::write_json(&mut text, model).expect("memory takes what is written");
    let again = json::parse_json(&text).expect("what was written is read");
    assert_eq!(coefficients(&again), coefficients(model), "coefficients after JSON");
    text.clear();
    gismo::write_gismo(&mut text, model).expect("memory takes what is written");
    let again = told(gismo::parse_gismo(&text)).expect("what was written is read");
    // Periodic directions are opened there, so the number of coefficients may differ.
    assert_eq!(coefficients(&again).ncols(), coefficients(model).ncols(), "coordinates after XML");
    match &model.geometry {
        Geometry::Curve(map) => {
            let (lower, upper) = map.space().domain();
            let point = map.eval([0.5 * (lower[0] + upper[0])]).expect("the middle is within the domain");
            assert_eq!(point.len(), map.dim(), "coordinates of a point");
            if let Some(picture) = told(svg::draw_svg(model, &SvgOptions::default())) {
                check_written(&picture);
            }
            if let Some(file) = told(dxf::DxfFile::new(model)) {
                check_written(&written(|out| file.write(out)));
            }
        }
        Geometry::Surface(map) => {
            let (lower, upper) = map.space().domain();
            let middle = [0, 1].map(|d| 0.5 * (lower[d] + upper[d]));
            assert_eq!(map.eval(middle).expect("the middle is within the domain").len(), map.dim(), "a point");
        }
    }
    let options = StepOptions { max_control_points: 60, ..StepOptions::default() };
    if let Some(file) = told(step::StepFile::new(model, &options)) {
        check_written(&written(|out| file.write(out)));
    }
}

fn coefficients(model: &Model) -> ndarray::ArrayView2<'_, f64> {
    match &model.geometry {
        Geometry::Curve(map) => map.coefficients(),
        Geometry::Surface(map) => map.coefficients(),
    }
}

/// The text that is written.
pub(super) fn written(write: impl FnOnce(&mut dyn std::io::Write) -> std::io::Result<()>) -> String {
    let mut text = Vec::new();
    write(&mut text).expect("memory takes what is written");
    String::from_utf8(text).expect("what is written is text")
}

/// Checks that no number of a file is none.
pub(super) fn check_written(text: &str) {
    let is_word = |word: &str| {
        let word = word.trim_matches(|c: char| !c.is_ascii_alphabetic());
        ["nan", "inf", "infinity"].iter().any(|none| word.eq_ignore_ascii_case(none))
    };
    let found = text.split(|c: char| c.is_whitespace() || ",()=\"'".contains(c)).find(|word| is_word(word));
    assert!(found.is_none(), "a number is {found:?}");
}

/// What came of it; a message, if there is one, is checked.
pub(super) fn told<T>(result: Result<T, ModelErrorKind>) -> Option<T> {
    result.inspect_err(|error| messages::check(&error.to_string())).ok()
}
