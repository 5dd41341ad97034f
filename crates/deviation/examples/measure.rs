//! How long measuring takes on one thread: triangles, crossings, creases and radii of curvature of surfaces of some 5000 cells.
//!
//! Of each kind it prints the truth next to what is found: a bumpy graph that meets itself nowhere, a tube whose wall is pushed
//! through the other wall, and a graph of which a part is turned over.

use std::f64::consts::TAU;
use std::sync::Arc;
use std::time::Instant;

use deviation::{TessellatedPatch, Tessellation, creases, curvature_radii, self_crossings};
use ndarray::Array2;
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, SplineMap};

/// Elements per direction.
const ELEMENTS: usize = 70;

#[expect(clippy::print_stdout, reason = "an example prints its result")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let bump = |u: f64, v: f64, depth: f64| depth * (-((u - 0.5) / 0.1).powi(2) - ((v - 0.5) / 0.05).powi(2)).exp();
    let graph = |u: f64, v: f64| [u, v, 0.02 * ((30.0 * u).sin() + (23.0 * v + 11.0 * u).cos())];
    let tube = |u: f64, v: f64| {
        let (sin, cos) = (TAU * u).sin_cos();
        [0.2 * (cos + bump(u, v, 2.6)), 0.2 * sin, v]
    };
    let folded = |u: f64, v: f64| [u - 0.03 * (60.0 * u).sin() * bump(u, v, 1.0), v, 0.01 * (40.0 * v).sin()];
    println!(
        "{:24} {:>5} {:>8}  {:>9} {:>9} {:>7} {:>6} ms",
        "", "cells", "triangles", "triangles", "crossings", "creases", "radii"
    );
    for (name, truth, map) in [
        ("bumpy graph", "none", surface([false, false], graph)?),
        ("tube with a dent", "1 crossing", surface([true, false], tube)?),
        ("graph turned over", "folded", surface([false, false], folded)?),
    ] {
        for chord in [1e-3, 2e-4, 5e-5] {
            map.bezier();
            let start = Instant::now();
            let mut last = 0.0;
            let mut lap = || {
                let now = 1e3 * start.elapsed().as_secs_f64();
                now - std::mem::replace(&mut last, now)
            };
            let tessellation = Tessellation::new(&map, chord, 1_000_000)?;
            let of_triangles = lap();
            let crossings = self_crossings(&[TessellatedPatch { map: &map, tessellation: &tessellation }], 1e-9)?;
            let of_crossings = lap();
            let creased = creases(&map, 8)?;
            let of_creases = lap();
            let radii = curvature_radii(&map, &tessellation)?;
            let of_radii = lap();
            println!(
                "{name:24} {:5} {:8}  {of_triangles:9.1} {of_crossings:9.1} {of_creases:7.1} {of_radii:6.1}    {} crossings, {:.3} % \
                 creased, radius {:.1e} ({truth})",
                map.space().n_cells(),
                tessellation.triangles.len(),
                crossings.places.len(),
                100.0 * creased,
                radii.smallest,
            );
        }
    }
    Ok(())
}

/// A bicubic surface whose control points lie on a shape.
fn surface(
    periodic: [bool; 2],
    shape: impl Fn(f64, f64) -> [f64; 3],
) -> Result<SplineMap<2>, Box<dyn std::error::Error>> {
    let knots = |periodic: bool| {
        if periodic { KnotVector::uniform_periodic(3, ELEMENTS) } else { KnotVector::uniform(3, ELEMENTS) }
    };
    let knots = [knots(periodic[0])?, knots(periodic[1])?];
    let sites = [knots[0].greville(), knots[1].greville()];
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, knots)?);
    let columns = sites[0].len();
    let coefficients = Array2::from_shape_fn((space.n_functions(), 3), |(row, k)| {
        shape(sites[0][row % columns], sites[1][row / columns])[k]
    });
    Ok(SplineMap::new(space, coefficients)?)
}
