//! Curves as SVG and DXF, read back by what stands in the files.

use std::sync::Arc;

use geom_io::model::{dxf::DxfFile, svg::draw_svg};
use geom_io::{GRAPH, LengthUnit, Model, ModelErrorKind, SvgOptions, WriteOptions, write_model};
use ndarray::Array2;
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, SplineMap};

fn curve(knots: KnotVector, dimension: usize) -> SplineMap<1> {
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots]).unwrap());
    let coefficients =
        Array2::from_shape_fn((space.n_functions(), dimension), |(i, k)| (1.7 * i as f64 + 2.0 * k as f64).sin() * 3.0);
    SplineMap::new(space, coefficients).unwrap()
}

fn open(degree: usize) -> KnotVector {
    let ends = |t| std::iter::repeat_n(t, degree + 1);
    KnotVector::new(degree, ends(0.0).chain([0.2, 0.5, 0.5, 0.9]).chain(ends(1.0)).collect()).unwrap()
}

/// End points and control points of the path.
fn path(svg: &str) -> Vec<[f64; 2]> {
    let data = svg.split(" d=\"").nth(1).unwrap().split('"').next().unwrap();
    let numbers: Vec<f64> =
        data.split(|c: char| !(c.is_ascii_digit() || "-.e".contains(c))).filter_map(|t| t.parse().ok()).collect();
    numbers.chunks(2).map(|p| [p[0], p[1]]).collect()
}

/// The points of the path's segments at a share of each.
fn along(path: &[[f64; 2]], t: f64) -> Vec<[f64; 2]> {
    let s = 1.0 - t;
    let weights = [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t];
    let segments = (0..path.len() / 3).map(|k| &path[3 * k..3 * k + 4]);
    segments.map(|p| [0, 1].map(|k| (0..4).map(|i| weights[i] * p[i][k]).sum())).collect()
}

#[test]
fn paths_are_the_curve() {
    for (degree, unit, scale) in [(2, LengthUnit::Millimetre, 1.0), (3, LengthUnit::Inch, 25.4)] {
        let map = curve(open(degree), 2);
        let model = Model::curve(map.clone(), unit);
        let path = path(&draw_svg(&model, &SvgOptions::default()).unwrap());
        let spans = map.space().n_cells();
        assert_eq!(path.len(), 3 * spans + 1);
        let start = map.eval([0.0]).unwrap();
        for t in [0.0, 0.3, 1.0] {
            for (cell, place) in along(&path, t).into_iter().enumerate() {
                let span = map.space().cell(cell);
                let u = span.lower[0] + t * (span.upper[0] - span.lower[0]);
                let mut point = [0.0; 2];
                map.bezier().derivative(cell, [u], [0], &mut point);
                // The page's y runs down.
                let x = place[0] - path[0][0] - scale * (point[0] - start[0]);
                let y = place[1] - path[0][1] + scale * (point[1] - start[1]);
                assert!(x.abs() < 1e-10 && y.abs() < 1e-10, "{degree} {cell} {t}: {x} {y}");
            }
        }
    }
    // At a knot of multiplicity above the degree the pen is lifted.
    let jump = Model::curve(curve(open(1), 2), LengthUnit::Millimetre);
    assert_eq!(draw_svg(&jump, &SvgOptions::default()).unwrap().matches('M').count(), 2);
    // Higher degrees are divided until they are met.
    let map = curve(open(6), 2);
    let path = path(&draw_svg(&Model::curve(map.clone(), LengthUnit::Millimetre), &SvgOptions::default()).unwrap());
    assert!(path.len() > 3 * map.space().n_cells() + 1);
    let end = map.eval([1.0]).unwrap();
    let start = map.eval([0.0]).unwrap();
    let last = path[path.len() - 1];
    assert!((last[0] - path[0][0] - (end[0] - start[0])).abs() < 1e-10);
}

#[test]
fn pictures_have_points_knots_and_a_frame_for_graphs() {
    let map = curve(open(3), 2);
    let mut model = Model::curve(map, LengthUnit::Millimetre);
    let options = SvgOptions { points: Some(Array2::ones((7, 2))), knots: true };
    let svg = draw_svg(&model, &options).unwrap();
    assert_eq!(svg.matches("<circle").count(), 7 + 5);
    model.metadata.insert(GRAPH.into(), true.into());
    assert!(draw_svg(&model, &options).unwrap().contains("width=\"172.8mm\""));
    // A function of its parameter, a curve in space, a closed one.
    for (knots, dimension) in [(open(3), 1), (open(2), 3), (KnotVector::uniform_periodic(3, 6).unwrap(), 2)] {
        let closed = knots.is_periodic();
        let svg = draw_svg(&Model::curve(curve(knots, dimension), LengthUnit::Metre), &options).unwrap();
        assert_eq!(svg.contains("Z\"/>"), closed);
    }
}

/// Values of a group code of the entity.
fn values(dxf: &str, code: &str) -> Vec<f64> {
    let entity = dxf.split("AcDbSpline\n").nth(1).unwrap().split("ENDSEC").next().unwrap();
    let lines: Vec<&str> = entity.lines().collect();
    lines.chunks_exact(2).filter(|pair| pair[0] == code).map(|pair| pair[1].parse().unwrap()).collect()
}

#[test]
fn drawings_hold_knots_and_control_points_to_the_last_bit() {
    for (knots, flags) in [(open(3), 8.0), (KnotVector::uniform_periodic(3, 6).unwrap(), 9.0)] {
        let map = curve(knots, 2);
        let mut out = Vec::new();
        DxfFile::new(&Model::curve(map.clone(), LengthUnit::Inch)).unwrap().write(&mut out).unwrap();
        let dxf = String::from_utf8(out).unwrap();
        let opened = map.tensor_product().unwrap();
        assert_eq!(values(&dxf, "40"), opened.space().knots(0).knots());
        assert_eq!(values(&dxf, "10"), opened.coefficients().column(0).to_vec());
        assert_eq!(values(&dxf, "20"), opened.coefficients().column(1).to_vec());
        assert_eq!(values(&dxf, "70"), [flags]);
        assert!(dxf.contains("$INSUNITS\n70\n1\n") && dxf.ends_with("0\nEOF\n"));
        // Each code has its value, and handles are used once.
        let lines: Vec<&str> = dxf.lines().collect();
        assert!(lines.len().is_multiple_of(2) && lines.chunks(2).all(|pair| pair[0].parse::<u32>().is_ok()));
        let mut handles: Vec<&str> =
            lines.chunks(2).filter(|p| ["5", "105"].contains(&p[0]) && p[1] != "200").map(|p| p[1]).collect();
        let count = handles.len();
        handles.sort_unstable();
        handles.dedup();
        assert_eq!(handles.len(), count);
    }
}

#[test]
fn what_is_no_curve_of_the_plane_or_space_is_refused() {
    let knots = KnotVector::uniform(1, 1).unwrap();
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
    let surface = Model::surface(SplineMap::new(space, Array2::ones((4, 3))).unwrap(), LengthUnit::Metre);
    assert!(matches!(draw_svg(&surface, &SvgOptions::default()), Err(ModelErrorKind::CurvesOnly { format: "SVG" })));
    assert!(matches!(DxfFile::new(&surface).err(), Some(ModelErrorKind::CurvesOnly { format: "DXF" })));
    let function = Model::curve(curve(open(3), 1), LengthUnit::Metre);
    assert!(matches!(DxfFile::new(&function).err(), Some(ModelErrorKind::PointDimension { given: 1 })));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("surface.dxf");
    assert!(write_model(&path, &surface, &WriteOptions::default()).is_err() && !path.exists());
}
