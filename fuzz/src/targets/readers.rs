//! Readers of scans.

use geom_io::{Decimal, Format, ReadErrorKind, ReadOptions, Scan, parse_scan};

use super::{files, messages};
use crate::bounds::{Bounds, bounded};
use crate::expansion::expanded;
use crate::random::Choices;

/// Largest absolute coordinate that a reader gives.
const MAX_COORDINATE: f64 = 1e100;

/// Reads a file of a format as `thb info` does.
pub(super) fn read(bytes: &[u8], format: Format) {
    with(bytes, format, &ReadOptions::default());
}

/// Reads a table, also with options that follow from its bytes.
pub(super) fn table(bytes: &[u8]) {
    let mut choices = Choices::of(bytes);
    let format = choices.one_of(&[Format::Xyz, Format::Csv]);
    read(bytes, format);
    let columns = |choices: &mut Choices, count: usize| -> Vec<String> {
        let names = ["1", "2", "3", "4", "5", "9", "x", "y", "z", "X", "nx", "i", "u", "weight", "q", " y "];
        (0..count).map(|_| choices.one_of(&names).to_owned()).collect()
    };
    let mut options = ReadOptions::default();
    if choices.with(0.5) {
        let count = 1 + choices.below(4);
        options.columns = columns(&mut choices, count);
    }
    for (chosen, count) in [(&mut options.normals, 3), (&mut options.grid, 2)] {
        if choices.with(0.25) {
            *chosen = Some(if choices.with(0.5) { Vec::new() } else { columns(&mut choices, count) });
        }
    }
    options.skip = if choices.with(0.25) { choices.below(5) } else { 0 };
    options.decimal = choices.one_of(&[None, None, Some(Decimal::Point), Some(Decimal::Comma)]);
    options.weights = if choices.with(0.25) { columns(&mut choices, 1).pop() } else { None };
    options.height_field = choices.with(0.25);
    with(bytes, format, &options);
}

/// Reads LAS or LAZ, also some classes of it.
pub(super) fn las(bytes: &[u8]) {
    read(bytes, Format::Las);
    let mut choices = Choices::of(bytes);
    if choices.with(0.125) {
        with(bytes, Format::Las, &ReadOptions { classes: vec![2, 9], ..ReadOptions::default() });
    }
}

/// Reads what lies in gzip or zip, as a format that follows from the bytes inside, or that a name says.
pub(super) fn contained(bytes: &[u8]) {
    for ending in ["xyz.gz", "zip"] {
        info(bytes, ending, &ReadOptions::default(), Format::Xyz);
    }
    read(bytes, Choices::of(bytes).one_of(&Format::ALL));
}

fn with(bytes: &[u8], format: Format, options: &ReadOptions) {
    let bounds = Bounds::of_reading(bytes.len(), expanded(bytes, format));
    let is_read = bounded(bounds, || match parse_scan(bytes, format, options) {
        Ok(scan) => {
            check(&scan);
            true
        }
        Err(error) => {
            messages::check(&error.to_string());
            matches!(error, ReadErrorKind::HoldsModel { .. })
        }
    });
    // What cannot be read says nothing more as a file.
    if is_read {
        let options = ReadOptions { format: Some(format), ..options.clone() };
        info(bytes, format.extensions()[0], &options, format);
    }
}

/// What `thb info` says of a file.
fn info(bytes: &[u8], ending: &str, options: &ReadOptions, format: Format) {
    let file = files::Temporary::new(ending, bytes);
    let bounds = Bounds::of_reading(bytes.len(), expanded(bytes, format));
    bounded(bounds, || match reconstruct::info(file.path(), options) {
        Ok(info) => {
            let text = serde_json::to_string(&info).expect("what a file holds can be told");
            assert!(!text.contains("\"diagonal\":null"), "bounds that are no numbers: {text}");
            if let reconstruct::Info::Scan { notes, .. } = info {
                notes.iter().for_each(|note| messages::check(note));
            }
        }
        Err(error) => {
            let message = error.to_string();
            messages::check(&message);
            let name = file.path().display().to_string();
            assert!(message.contains(&name), "a message does not name the file: {message}");
        }
    });
}

/// Checks that what was read is sound.
fn check(scan: &Scan) {
    let points = &scan.cloud.points;
    let count = points.nrows();
    assert!(count > 0, "no points and no error");
    assert!(points.iter().all(|c| c.abs() <= MAX_COORDINATE), "a coordinate is not finite, or too large");
    assert_eq!(scan.rows.len(), count, "rows of points");
    if let Some(parameters) = &scan.cloud.parameters {
        assert_eq!(parameters.nrows(), count, "parameters of points");
        assert!(parameters.iter().all(|u| u.is_finite()), "a parameter is not finite");
    }
    if let Some(grid) = scan.cloud.grid {
        assert_eq!(grid.n_u * grid.n_v, count, "points of a grid");
    }
    let in_range = |triangle: &[u32; 3]| triangle.iter().all(|&vertex| (vertex as usize) < count);
    assert!(scan.triangles.iter().flatten().all(in_range), "a triangle has a vertex that is no point");
    let lengths = [
        scan.on_boundary.as_ref().map(Vec::len),
        scan.weights.as_ref().map(Vec::len),
        scan.normals.as_ref().map(Vec::len),
    ];
    assert!(lengths.iter().flatten().all(|&length| length == count), "values of points: {lengths:?} of {count}");
    assert!(scan.weights.iter().flatten().all(|w| *w >= 0.0 && w.is_finite()), "a weight is below 0 or not finite");
    scan.notes.iter().for_each(|note| messages::check(note));
    // Lines are told for all points or for none.
    assert!((0..count.min(3)).all(|at| scan.line(at).is_some() == scan.line(0).is_some()), "lines of points");
}
