//! Closed surfaces: planted periodic splines, a tube and a torus.

use std::f64::consts::TAU;
use std::sync::Arc;

use adaptive::{Stop, run};
use fit_ls::{Error, Lambda, LeastSquares, Options, Side, boundary_coefficients, boundary_functions};
use ndarray::Array2;
use proptest::prelude::*;
use thb_core::{HierarchicalSpace, Kind, KnotVector, Refinement, SplineMap};

struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn space(degree: usize, elements: usize, periodic: [bool; 2]) -> HierarchicalSpace<2> {
    let knots = periodic.map(|p| {
        if p { KnotVector::uniform_periodic(degree, elements) } else { KnotVector::uniform(degree, elements) }.unwrap()
    });
    HierarchicalSpace::new(Kind::Thb, knots).unwrap()
}

fn fixed(lambda: f64) -> Options<2> {
    Options { lambda: Lambda::Fixed(lambda), ..Options::default() }
}

/// A wavy tube of radius 1 along z, or a torus with radii 3 and 1; both have their seams in the plane y = 0.
fn point(u: f64, v: f64, torus: bool) -> [f64; 3] {
    let (sine, cosine) = (TAU * u).sin_cos();
    let bump = 0.1 * (2.0 * TAU * u).cos() * (TAU * v).cos();
    if torus {
        let radius = 3.0 + (1.0 + bump) * (TAU * v).cos();
        [radius * cosine, radius * sine, (1.0 + bump) * (TAU * v).sin()]
    } else {
        [(1.0 + bump) * cosine, (1.0 + bump) * sine, 4.0 * v]
    }
}

fn samples(m: usize, torus: bool) -> (Array2<f64>, Array2<f64>) {
    let mut random = Random(7);
    let parameters = Array2::from_shape_simple_fn((m, 2), || random.next());
    let points = Array2::from_shape_fn((m, 3), |(i, k)| point(parameters[[i, 0]], parameters[[i, 1]], torus)[k]);
    (parameters, points)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    #[test]
    fn planted_periodic_splines_are_reproduced(degree in 1_usize..=4, both in any::<bool>(), seed in any::<u64>(),
                                               marks in prop::collection::vec(any::<u16>(), 0..3)) {
        let mut space = space(degree, degree + 2, [true, both]);
        for mark in marks {
            let cell = usize::from(mark) % thb_core::CellSpace::n_cells(&space);
            space = space.refine(&[cell], &Refinement { extension: [2; 2], max_levels: 3, ..Refinement::default() }).unwrap();
        }
        let space = Arc::new(space);
        let mut random = Random(seed);
        let c = Array2::from_shape_simple_fn((thb_core::CellSpace::n_functions(space.as_ref()), 3), || random.next());
        let planted = SplineMap::new(space.clone(), c).unwrap();
        let per = 8 * (degree + 2);
        // Points on the seam from both of its sides.
        let parameters = Array2::from_shape_fn((per * per, 2), |(i, d)| {
            (if d == 0 { i % per } else { i / per }) as f64 / (per - 1) as f64
        });
        let points = planted.eval_batch(parameters.view()).unwrap();
        let mut fit = LeastSquares::new(parameters.view(), points.view(), None, fixed(0.0)).unwrap();
        let found = fit.fit(&space).unwrap();
        for (a, b) in found.coefficients().iter().zip(planted.coefficients()) {
            prop_assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }
}

#[test]
fn a_tube_and_a_torus_are_fitted_to_tolerance_without_a_seam() {
    for torus in [false, true] {
        let (parameters, points) = samples(6000, torus);
        let mut fit = LeastSquares::new(parameters.view(), points.view(), None, fixed(1e-9)).unwrap();
        let tolerance = 2e-3;
        let rules = adaptive::Options {
            tolerance,
            refinement: Refinement { extension: [2; 2], ..Refinement::default() },
            max_dofs: 6000,
            ..adaptive::Options::default()
        };
        let start = Arc::new(space(3, 5, [true, torus]));
        let outcome =
            run(&mut fit, start, &rules, &mut |_: &adaptive::Iteration| std::ops::ControlFlow::Continue(())).unwrap();
        assert_eq!(outcome.stop, Stop::ToleranceReached, "{:?}", outcome.history.last());
        let map = outcome.map;
        for i in 0..40 {
            let t = f64::from(i) / 40.0;
            for order in 0..=2 {
                let near = |a: Vec<f64>, b: Vec<f64>| {
                    let scale = a.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
                    a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-10 * scale)
                };
                let d = |u, v, order| map.derivative([u, v], order).unwrap();
                assert!(near(d(0.0, t, [order, 0]), d(1.0, t, [order, 0])), "order {order} at v = {t}");
                assert!(!torus || near(d(t, 0.0, [0, order]), d(t, 1.0, [0, order])), "order {order} at u = {t}");
            }
            // Away from the points too, and on the seam most of all.
            let distance = |u: f64, v: f64| {
                let found = map.eval([u, v]).unwrap();
                found.iter().zip(point(u, v, torus)).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
            };
            assert!(distance(0.0, t) < 2.0 * tolerance && distance(1.0, t) < 2.0 * tolerance);
        }
    }
}

#[test]
fn a_seam_is_no_boundary() {
    let space = Arc::new(space(2, 4, [true, false]));
    assert!(boundary_functions(&space, Side::Left).is_empty() && boundary_functions(&space, Side::Right).is_empty());
    assert_eq!(boundary_functions(&space, Side::Bottom).len(), 4);
    let line = HierarchicalSpace::new(Kind::Thb, [KnotVector::uniform(1, 1).unwrap()]).unwrap();
    let line = SplineMap::new(Arc::new(line), Array2::ones((2, 3))).unwrap();
    assert_eq!(boundary_coefficients(&space, Side::Left, &line).unwrap_err(), Error::Seam { direction: 0 });
    let around = HierarchicalSpace::new(Kind::Thb, [KnotVector::uniform_periodic(2, 4).unwrap()]).unwrap();
    let circle = Array2::from_shape_fn((4, 3), |(i, k)| (i * k) as f64);
    let curve = SplineMap::new(Arc::new(around), circle.clone()).unwrap();
    let given = boundary_coefficients(&space, Side::Top, &curve).unwrap();
    for (row, (_, found)) in circle.outer_iter().zip(&given) {
        assert!(row.iter().zip(found).all(|(a, b)| (a - b).abs() < 1e-9));
    }
}
