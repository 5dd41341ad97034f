//! Writes models and points on them for the scripts in `tests/peers`, which open them with other software.
//!
//! The files go to the folder that Cargo keeps for tests, `target/tmp/peers`.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::model_common::{cap, curve, dome, ring, sheet, spots};
use geom_io::model::{Geometry, LengthUnit, Model, StepOptions, WriteOptions, read_model, write_model};
use ndarray::Array2;
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, SplineMap};

/// Sites per direction, cell boundaries among them.
const SITES: usize = 41;

fn folder() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("peers");
    fs::create_dir_all(&folder).unwrap();
    folder
}

fn site(i: usize) -> f64 {
    i as f64 / (SITES - 1) as f64
}

fn write_points<const D: usize>(path: &Path, map: &SplineMap<D>) {
    let names = ["u", "v"];
    let mut text = format!("{},x,y,z\n", names[..D].join(","));
    for i in 0..SITES.pow(D as u32) {
        let u: [f64; D] = std::array::from_fn(|d| site(i / SITES.pow(d as u32) % SITES));
        let numbers: Vec<String> = u.iter().chain(&map.eval(u).unwrap()).map(|x| format!("{x:?}")).collect();
        text += &numbers.join(",");
        text += "\n";
    }
    fs::write(path, text).unwrap();
}

fn step(max_control_points: usize, flip: bool) -> WriteOptions {
    let step = StepOptions { max_control_points, flip, ..StepOptions::default() };
    WriteOptions { step, ..WriteOptions::default() }
}

#[test]
fn surfaces() {
    let cases = [
        ("biquadratic", sheet(Kind::Thb, [2, 2], [6, 4], 5), LengthUnit::Millimetre, 400),
        ("bicubic", sheet(Kind::Thb, [3, 3], [5, 7], 5), LengthUnit::Inch, 400),
        ("mixed", sheet(Kind::Thb, [2, 3], [8, 3], 4), LengthUnit::Metre, 400),
        ("hierarchical", sheet(Kind::Hb, [3, 2], [4, 4], 3), LengthUnit::Millimetre, 400),
        ("spots", spots([2, 2], [12, 8], 7), LengthUnit::Millimetre, 400),
        ("dome", dome(5), LengthUnit::Millimetre, 150),
    ];
    for (name, map, unit, limit) in cases {
        write_points(&folder().join(format!("{name}.csv")), &map);
        let model = Model::surface(map.clone(), unit);
        for suffix in [".xml", ".json"] {
            let path = folder().join(format!("{name}{suffix}"));
            write_model(&path, &model, &WriteOptions::default()).unwrap();
            let Geometry::Surface(back) = read_model(&path).unwrap().geometry else { panic!("{path:?}: no surface") };
            assert_eq!(back.coefficients(), map.coefficients());
            assert_eq!(back.eval([0.3, 0.41]).unwrap(), map.eval([0.3, 0.41]).unwrap());
        }
        write_model(&folder().join(format!("{name}_one.step")), &model, &step(usize::MAX, false)).unwrap();
        write_model(&folder().join(format!("{name}_many.stp")), &model, &step(limit, true)).unwrap();
    }
}

#[test]
fn closed_surfaces() {
    let ring = |torus| ring(Kind::Thb, [3, 2], [8, 6], torus, 4);
    for (name, map) in [("tube", ring(false)), ("torus", ring(true)), ("cap", cap(4))] {
        write_points(&folder().join(format!("{name}.csv")), &map);
        let model = Model::surface(map.clone(), LengthUnit::Millimetre);
        for suffix in [".xml", ".json"] {
            let path = folder().join(format!("{name}{suffix}"));
            write_model(&path, &model, &WriteOptions::default()).unwrap();
            let Geometry::Surface(back) = read_model(&path).unwrap().geometry else { panic!("{path:?}: no surface") };
            let (a, b) = (back.eval([0.3, 0.41]).unwrap(), map.eval([0.3, 0.41]).unwrap());
            assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-12 * 60.0));
        }
        write_model(&folder().join(format!("{name}_one.step")), &model, &step(usize::MAX, false)).unwrap();
        write_model(&folder().join(format!("{name}_many.stp")), &model, &step(400, true)).unwrap();
    }
}

/// Holes and points along their rims, for `check_step.py --holes`.
#[test]
fn holes() {
    let rim = |centre: [f64; 2], radius: [f64; 2], spans: usize| {
        Array2::from_shape_fn((spans, 2), |(i, d)| {
            let (sine, cosine) = (std::f64::consts::TAU * i as f64 / spans as f64).sin_cos();
            centre[d] + radius[d] * [cosine, sine][d]
        })
    };
    let sheet_holes = vec![rim([0.3, 0.5], [0.15, 0.2], 12), rim([0.8, 0.25], [0.04, 0.08], 8)];
    let tube_holes = vec![rim([0.5, 0.5], [0.2, 0.25], 16)];
    let cases = [
        ("pierced-sheet", sheet(Kind::Thb, [3, 3], [5, 7], 5), sheet_holes, 900),
        ("pierced-tube", ring(Kind::Thb, [3, 2], [8, 6], false, 4), tube_holes, 600),
    ];
    for (name, map, holes, limit) in cases {
        write_points(&folder().join(format!("{name}.csv")), &map);
        let mut text = String::from("hole,u,v\n");
        for (number, control) in holes.iter().enumerate() {
            let knots = KnotVector::uniform_periodic(3, control.nrows()).unwrap();
            let space = HierarchicalSpace::new(Kind::Thb, [knots]).unwrap();
            let curve = SplineMap::new(Arc::new(space), control.clone()).unwrap();
            for k in 0..200 {
                let uv = curve.eval([f64::from(k) / 200.0]).unwrap();
                text += &format!("{number},{:?},{:?}\n", uv[0], uv[1]);
            }
        }
        fs::write(folder().join(format!("{name}-holes.csv")), text).unwrap();
        let model = Model::surface(map, LengthUnit::Millimetre);
        for (file, limit, flip) in [("one.step", usize::MAX, false), ("many.stp", limit, true)] {
            let mut options = step(limit, flip);
            options.step.holes = holes.clone();
            write_model(&folder().join(format!("{name}_{file}")), &model, &options).unwrap();
        }
    }
}

#[test]
fn curves() {
    let map = curve(3);
    write_points(&folder().join("curve.csv"), &map);
    let n = map.space().n_functions();
    let model = Model::curve(map, LengthUnit::Metre);
    for suffix in [".xml", ".step"] {
        write_model(&folder().join(format!("curve{suffix}")), &model, &WriteOptions::default()).unwrap();
    }
    let back = read_model(&folder().join("curve.xml")).unwrap();
    let Geometry::Curve(back) = back.geometry else { panic!("no curve") };
    assert_eq!(back.space().n_functions(), n);
}
