//! Moving parameters on closed surfaces: they pass the seam.

use std::f64::consts::TAU;
use std::sync::Arc;

use adaptive::Solve;
use fit_ls::Lambda;
use moving_param::{
    Boundary, Descent, Distance, FootPointOptions, JointOptions, Method, MovingFit, Options, Schedule, project,
};
use ndarray::Array2;
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, ParameterBox, SplineMap};

/// A bicubic tube, closed in u, with an oval section.
fn tube() -> SplineMap<2> {
    let knots = [KnotVector::uniform_periodic(3, 8).unwrap(), KnotVector::uniform(3, 3).unwrap()];
    let heights = knots[1].greville();
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, knots).unwrap());
    let coefficients = Array2::from_shape_fn((space.n_functions(), 3), |(j, k)| {
        let angle = TAU * (j % 8) as f64 / 8.0;
        [2.0 * angle.cos(), 1.5 * angle.sin(), 3.0 * heights[j / 8]][k]
    });
    SplineMap::new(space, coefficients).unwrap()
}

/// Rings of points, closed and without a second one on the seam.
fn lattice(around: usize, along: usize) -> Array2<f64> {
    Array2::from_shape_fn((around * along, 2), |(i, d)| match d {
        0 => (i % around) as f64 / around as f64,
        _ => (i / around) as f64 / (along - 1) as f64,
    })
}

/// Parameters turned about the axis, which brings those next to the seam to its other side.
fn turned(parameters: &Array2<f64>, by: f64) -> Array2<f64> {
    let mut turned = parameters.clone();
    turned.column_mut(0).mapv_inplace(|u| (u + by).rem_euclid(1.0));
    turned
}

#[test]
fn foot_points_pass_the_seam() {
    let map = tube();
    let exact = lattice(40, 9);
    let points = map.eval_batch(exact.view()).unwrap();
    for by in [0.03, -0.03] {
        let start = turned(&exact, by);
        for descent in
            [Descent::Newton, Descent::QuasiNewton { min_step: 1e-12 }, Descent::Gradient { min_step: 1e-12 }]
        {
            let options = FootPointOptions { descent, max_steps: 200, ..FootPointOptions::default() };
            let (found, distances, report) =
                project(&map, start.view(), points.view(), Boundary::Kept, &options).unwrap();
            let largest = distances.iter().copied().fold(0.0, f64::max);
            assert!(largest < 1e-5, "{descent:?}: {largest:e}");
            // No move is longer than the turn was, though many led across the seam.
            assert!(report.max_move < 0.04, "{descent:?}: {report:?}");
            for (u, v) in found.outer_iter().zip(exact.outer_iter()) {
                let way = map.space().way([u[0], u[1]], [v[0], v[1]]);
                assert!(way.iter().all(|w| w.abs() < 1e-5), "{u} {v}");
                assert!((0.0..1.0).contains(&u[0]));
            }
        }
    }
}

#[test]
fn all_methods_recover_a_tube_from_turned_parameters() {
    let map = tube();
    let exact = lattice(40, 9);
    let points = map.eval_batch(exact.view()).unwrap();
    // Each point is turned by its own amount, some across the seam.
    let mut start = exact.clone();
    for (i, mut row) in start.outer_iter_mut().enumerate() {
        row[0] = (row[0] + 0.008 * (37.0 * i as f64).sin()).rem_euclid(1.0);
    }
    let alternating = |distance| Method::Alternating { distance, corrections: 4 };
    // What is left of the errors: only the joint method gets to round-off in few steps.
    for (method, left) in [
        (alternating(Distance::Point), 0.6),
        (alternating(Distance::Tangent { damping: 1e-6 }), 0.3),
        (Method::Joint(JointOptions { max_steps: 15, decrease: 0.0, ..JointOptions::WITHOUT_SPRINGS }), 1e-6),
        (Method::JointLbfgs(Schedule::Constant { gradient: 1e-14, max_iterations: 100 }), 0.1),
    ] {
        let fitting = fit_ls::Options { lambda: Lambda::Fixed(0.0), ..fit_ls::Options::default() };
        let options = Options { method: method.clone(), guard: false, ..Options::default() };
        let around = (0..40).flat_map(|i| (0..8).map(move |j| (i, j)));
        let triangles: Vec<[u32; 3]> = around
            .flat_map(|(i, j)| {
                let at = |i: u32, j: u32| j * 40 + i % 40;
                [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
            })
            .collect();
        let mut fit = MovingFit::new(start.view(), points.view(), None, fitting, options)
            .unwrap()
            .with_triangles(&triangles)
            .unwrap();
        fit.solve(map.space(), None).unwrap();
        let report = fit.reports()[0];
        assert!(report.rmse[1] < left * report.rmse[0], "{method:?}: {report:?}");
        assert_eq!(report.folds, 0, "{method:?}");
        assert!(report.max_move < 0.1, "{method:?}: {report:?}");
        // Points on the open rims stay there.
        for (row, before) in fit.parameters().outer_iter().zip(start.outer_iter()) {
            assert!((before[1] != 0.0 && before[1] != 1.0) || row[1] == before[1]);
            assert!((0.0..=1.0).contains(&row[0]));
        }
    }
}
