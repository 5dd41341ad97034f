//! Tests of pages of fits.

use std::ops::ControlFlow;

use geom_io::Scan;
use ndarray::Array2;

use super::*;
use crate::{FitOptions, Mesh, Points, Tolerance, fit};

/// A wave of n × n points, as a cloud with normals or as a mesh.
fn wave(n: usize) -> Array2<f64> {
    Array2::from_shape_fn((n * n, 3), |(i, k)| {
        let (x, y) = ((i % n) as f64 / (n - 1) as f64, (i / n) as f64 / (n - 1) as f64);
        [x, y, 0.1 * (5.0 * x).sin() * y][k]
    })
}

fn options() -> FitOptions {
    FitOptions { tol: Tolerance::Percent(0.5), ..FitOptions::default() }
}

fn mesh(n: usize) -> Mesh {
    let m = n as u32;
    let corners = (0..m - 1).flat_map(|j| (0..m - 1).map(move |i| m * j + i));
    Mesh::new(wave(n), corners.flat_map(|a| [[a, a + 1, a + m + 1], [a, a + m + 1, a + m]]).collect()).unwrap()
}

#[test]
fn the_page_of_a_mesh_has_signs_cells_and_a_net() {
    let fitted = fit(mesh(20), &options()).unwrap();
    let page = page_of(&fitted).unwrap();
    let [part] = &page.parts[..] else { panic!("{} parts", page.parts.len()) };
    assert!(page.is_signed && page.signs == SIGNS);
    assert_eq!((part.scan.points.len(), part.scan.deviations.len(), part.scan.weights.len()), (400, 400, 400));
    let total: f64 = part.scan.weights.iter().sum();
    assert!((total - fitted.report.result.deviation.area).abs() < 0.01 * total);
    // The largest of the points is no larger than that of the area, and the signs are not all alike.
    let largest = part.scan.deviations.iter().fold(0.0_f64, |most, d| most.max(d.abs()));
    assert!(largest <= 1.001 * fitted.report.result.deviation.scan_to_surface.max.max(fitted.report.result.dhd));
    assert!(part.scan.deviations.iter().any(|&d| d > 0.0) && part.scan.deviations.iter().any(|&d| d < 0.0));
    let surface = &part.surface;
    assert_eq!(surface.control_points.len(), fitted.report.result.dofs);
    assert_eq!(surface.cells.len(), fitted.report.result.cells);
    assert!(!surface.cell_lines.is_empty() && !surface.face_lines.is_empty() && !surface.control_lines.is_empty());
    assert!(surface.normals.iter().all(|&n| (point_cloud::vec3::norm(n) - 1.0).abs() < 1e-12 && n[2] > 0.0));
    assert_eq!(page.steps.len(), fitted.report.history.len());
    assert!(page.facts.iter().any(|fact| fact.name == "program" && fact.value.starts_with("thb ")));
}

#[test]
fn flipping_the_face_flips_signs_and_clouds_without_normals_have_none() {
    let deviations = |flip: bool| {
        let fitted = fit(mesh(12), &FitOptions { flip, ..options() }).unwrap();
        page_of(&fitted).unwrap().parts[0].scan.deviations.clone()
    };
    let turned: Vec<f64> = deviations(true).iter().map(|d| -d).collect();
    assert_eq!(deviations(false), turned);
    let cloud = fit(Points::new(wave(12)).unwrap(), &options()).unwrap();
    let page = page_of(&cloud).unwrap();
    assert!(!page.is_signed && page.signs == NO_SIGNS && page.worst.iter().all(|place| place.deviation >= 0.0));
}

#[test]
fn what_was_left_out_is_shown_and_copies_of_fitted_points_are_not() {
    let mut points = wave(15);
    // A copy of a point, and one that stands alone.
    points.append(ndarray::Axis(0), ndarray::array![[0.0, 0.0, 0.0], [0.5, 0.5, 0.9]].view()).unwrap();
    let cloud = fit(Points::new(points).unwrap(), &options()).unwrap();
    assert_eq!(cloud.scanned.left_out, [[0.5, 0.5, 0.9]]);
}

#[test]
fn pieces_are_parts_of_one_page() {
    let mut scan = Scan::from(mesh(12));
    let other = scan.clone();
    let moved = &other.cloud.points + &ndarray::array![3.0, 0.0, 0.0];
    scan.cloud.points.append(ndarray::Axis(0), moved.view()).unwrap();
    let count = other.rows.len() as u32;
    scan.rows.extend(other.rows.iter().map(|row| row + count));
    let triangles = scan.triangles.as_mut().unwrap();
    triangles.extend(other.triangles.unwrap().iter().map(|corners| corners.map(|v| v + count)));
    let all = FitOptions { all_pieces: true, ..options() };
    let fits = crate::fit_pieces(scan, "two.ply", &all, &mut |_| ControlFlow::Continue(())).unwrap();
    let page = page_of_pieces(&fits).unwrap().unwrap();
    assert_eq!(page.parts.len(), 2);
    assert_eq!((page.parts[0].name.as_str(), page.headline.title.as_str()), ("piece 1", "two.ply"));
}
