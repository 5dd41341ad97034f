//! Files that stand beside a scan: markers, an outline, a mask, parameters to evaluate.

use std::ops::ControlFlow;
use std::sync::LazyLock;

use geom_io::{Format, ReadOptions, Scan, parse_scan};
use reconstruct::{FitOptions, MarkerChoice, Method, ParameterOptions, ReweightingOptions, eval_model, fit_scan};

use super::{files, messages};
use crate::bounds::{Bounds, bounded};

/// Points along a side of the scan.
const SIDE: usize = 5;

/// A model with one cell, z = u v.
const MODEL: &str = include_str!("../../corpus/models/bilinear.json");

/// How many times as long as reading a fit of a few points may take.
const FITTED: u32 = 8;

/// Reads the bytes as each of the files.
pub(super) fn run(bytes: &[u8]) {
    let text = files::Temporary::new("txt", bytes);
    let path = text.path().to_owned();
    let bounds = Bounds::of_reading(bytes.len(), bytes.len());
    let bounds = Bounds { time: bounds.time * FITTED, ..bounds };
    let quiet = &mut |_: reconstruct::Event<'_>| ControlFlow::Continue(());
    bounded(bounds, || {
        let markers = Some(MarkerChoice::File(path.clone()));
        let reweighting = ReweightingOptions { markers, ..ReweightingOptions::default() };
        let options = FitOptions { method: Method::Ls, levels: 1, reweighting, ..FitOptions::default() };
        told(fit_scan(SCANS[1].clone(), "markers", &options, quiet));
        let options = ParameterOptions { outline: Some(path.clone()), ..ParameterOptions::default() };
        told(reconstruct::parameterize(SCANS[0].clone(), &options, quiet));
    });
    drop(text);
    let mask = files::Temporary::new("asc", bytes);
    bounded(bounds, || {
        let options = ParameterOptions { mask: Some(mask.path().to_owned()), ..ParameterOptions::default() };
        told(reconstruct::parameterize(SCANS[1].clone(), &options, quiet));
    });
    drop(mask);
    let (parameters, model) = (files::Temporary::new("csv", bytes), files::Temporary::new("json", MODEL.as_bytes()));
    bounded(bounds, || {
        if let Some(evaluation) = told(eval_model(model.path(), parameters.path())) {
            assert!(evaluation.rows.iter().all(|value| value.is_finite()), "a point is not finite");
            assert_eq!(evaluation.rows.ncols(), evaluation.columns.len(), "columns of points");
        }
    });
}

/// The sheet without parameters, and with.
static SCANS: LazyLock<[Scan; 2]> = LazyLock::new(|| [false, true].map(scan));

/// A sheet of few points, with parameters or without.
fn scan(with_parameters: bool) -> Scan {
    let mut text = String::from(if with_parameters { "x,y,z,u,v\n" } else { "x,y,z\n" });
    for (i, j) in (0..SIDE).flat_map(|i| (0..SIDE).map(move |j| (i, j))) {
        let [u, v] = [i, j].map(|k| k as f64 / (SIDE - 1) as f64);
        text += &format!("{u},{v},{}", u * v);
        text += &if with_parameters { format!(",{u},{v}\n") } else { "\n".to_owned() };
    }
    parse_scan(text.as_bytes(), Format::Csv, &ReadOptions::default()).expect("the sheet is a table")
}

/// What came of it; a message, if there is one, is checked.
fn told<T>(result: Result<T, reconstruct::Error>) -> Option<T> {
    result.inspect_err(|error| messages::check(&error.to_string())).ok()
}
