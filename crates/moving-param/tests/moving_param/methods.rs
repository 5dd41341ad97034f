//! The methods on planted splines, on curves, and where parameters are exact already.

use std::sync::Arc;

use adaptive::Solve;
use fit_ls::Lambda;
use moving_param::{Blend, Boundary, Distance, Error, JointOptions, Method, MovingFit, Options, Schedule};
use ndarray::Array2;
use thb_core::{HierarchicalSpace, Kind, KnotVector, SplineMap};

struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

const ELEMENTS: usize = 3;

fn space<const D: usize>(degree: usize) -> Arc<HierarchicalSpace<D>> {
    let knots = KnotVector::uniform(degree, ELEMENTS).unwrap();
    Arc::new(HierarchicalSpace::new(Kind::Thb, std::array::from_fn(|_| knots.clone())).unwrap())
}

/// A map near the identity in its first directions with bumps across.
fn planted<const D: usize>(space: &Arc<HierarchicalSpace<D>>, n: usize) -> SplineMap<D> {
    let knots = space.knots(0, 0).unwrap();
    let (count, degree) = (knots.n_functions(), knots.degree());
    let mut random = Random(3);
    let coefficients = Array2::from_shape_fn((count.pow(D as u32), n), |(j, k)| {
        let i = j / count.pow(k as u32) % count;
        let greville = knots.knots()[i + 1..=i + degree].iter().sum::<f64>() / degree as f64;
        if k < D { greville + 0.02 * random.next() } else { 0.5 * random.next() }
    });
    SplineMap::new(space.clone(), coefficients).unwrap()
}

/// Regular parameters with the boundary, `per` in each direction.
fn lattice<const D: usize>(per: usize) -> Array2<f64> {
    Array2::from_shape_fn((per.pow(D as u32), D), |(i, d)| (i / per.pow(d as u32) % per) as f64 / (per - 1) as f64)
}

/// Moves the parameters by up to a share of a cell, boundary points along their side.
fn perturbed(parameters: &Array2<f64>, share: f64) -> Array2<f64> {
    let mut random = Random(5);
    parameters.mapv(|u| {
        let moved = u + share / ELEMENTS as f64 * (2.0 * random.next() - 1.0);
        if u == 0.0 || u == 1.0 { u } else { moved.clamp(0.0, 1.0) }
    })
}

fn options(method: Method) -> Options {
    Options { method, guard: false, ..Options::default() }
}

fn exact(max_steps: usize) -> Method {
    Method::Joint(JointOptions { max_steps, decrease: 0.0, ..JointOptions::WITHOUT_SPRINGS })
}

/// Largest distance after fitting once in the space.
fn fitted<const D: usize>(
    space: &Arc<HierarchicalSpace<D>>,
    parameters: &Array2<f64>,
    points: &Array2<f64>,
    options: Options,
) -> (f64, MovingFit<D>) {
    let fitting = fit_ls::Options { lambda: Lambda::Fixed(0.0), ..fit_ls::Options::default() };
    let mut method = MovingFit::new(parameters.view(), points.view(), None, fitting, options).unwrap();
    let map = method.solve(space, None).unwrap().map;
    let largest = method.estimate(&map).unwrap().errors.iter().copied().fold(0.0, f64::max);
    (largest, method)
}

fn all_methods() -> Vec<Method> {
    let alternating = |distance| Method::Alternating { distance, corrections: 3 };
    vec![
        alternating(Distance::Point),
        alternating(Distance::Tangent { damping: 1e-6 }),
        alternating(Distance::Hybrid(Blend::ErrorDriven)),
        alternating(Distance::Hybrid(Blend::Constant(0.1))),
        exact(5),
        Method::JointLbfgs(Schedule::Constant { gradient: 1e-14, max_iterations: 20 }),
    ]
}

#[test]
fn exact_parameters_stay_at_round_off() {
    let space = space::<2>(2);
    let parameters = lattice::<2>(15);
    let points = planted(&space, 3).eval_batch(parameters.view()).unwrap();
    for method in all_methods() {
        let (largest, _) = fitted(&space, &parameters, &points, options(method.clone()));
        assert!(largest < 1e-12, "{method:?}: {largest:e}");
    }
}

#[test]
fn the_joint_method_recovers_perturbed_parameters_in_few_steps() {
    for boundary in [Boundary::Kept, Boundary::Free] {
        let space = space::<2>(3);
        let parameters = lattice::<2>(20);
        let points = planted(&space, 3).eval_batch(parameters.view()).unwrap();
        let start = perturbed(&parameters, 0.05);
        let (largest, method) = fitted(&space, &start, &points, Options { boundary, ..options(exact(15)) });
        let diagonal = 2.0_f64.sqrt();
        assert!(largest < 1e-10 * diagonal, "{boundary:?}: {largest:e} after {:?}", method.reports());
        assert!(method.reports()[0].corrections <= 15);
        let kept = method.parameters();
        for (row, before) in kept.outer_iter().zip(start.outer_iter()).filter(|_| boundary == Boundary::Kept) {
            for d in 0..2 {
                assert!(before[d] != 0.0 && before[d] != 1.0 || row[d] == before[d], "a point left its side");
            }
        }
    }
}

#[test]
fn springs_hold_parameters_where_they_started() {
    let space = space::<2>(3);
    let parameters = lattice::<2>(20);
    let points = planted(&space, 3).eval_batch(parameters.view()).unwrap();
    let start = perturbed(&parameters, 0.05);
    let moved = |stiffness: f64| {
        let method =
            Method::Joint(JointOptions { max_steps: 15, decrease: 0.0, stiffness, ..JointOptions::WITHOUT_SPRINGS });
        let (largest, method) = fitted(&space, &start, &points, options(method));
        let moves = (&method.parameters() - &start).mapv(|x| x * x).sum().sqrt();
        (moves, largest)
    };
    let [free, soft, stiff, rigid] = [0.0, 1e-2, 1.0, 1e8].map(moved);
    assert!(free.0 > soft.0 && soft.0 > stiff.0 && stiff.0 > 100.0 * rigid.0, "{free:?} {soft:?} {stiff:?} {rigid:?}");
    assert!(free.1 < soft.1 && soft.1 < stiff.1 && stiff.1 < rigid.1, "{free:?} {soft:?} {stiff:?} {rigid:?}");
    let fixed = Method::Alternating { distance: Distance::Point, corrections: 0 };
    let (unmoved, _) = fitted(&space, &start, &points, options(fixed));
    assert!((rigid.1 / unmoved - 1.0).abs() < 1e-3, "{} instead of {unmoved}", rigid.1);
}

#[test]
fn alternating_and_quasi_newton_methods_descend() {
    let space = space::<2>(2);
    let parameters = lattice::<2>(15);
    let points = planted(&space, 3).eval_batch(parameters.view()).unwrap();
    let start = perturbed(&parameters, 0.05);
    let rmse = |method| {
        let (_, method) = fitted(&space, &start, &points, options(method));
        method.reports()[0].rmse
    };
    let alternating = |distance, corrections| Method::Alternating { distance, corrections };
    // Point distances converge linearly: some more corrections, some more digits.
    let [fixed, few] = rmse(alternating(Distance::Point, 5));
    let [_, many] = rmse(alternating(Distance::Point, 40));
    assert!(few < 0.5 * fixed && many < 0.8 * few, "{fixed:e} {few:e} {many:e}");
    // All blends beat point distances with as many corrections.
    let [_, same] = rmse(alternating(Distance::Point, 20));
    for distance in [
        Distance::Tangent { damping: 1e-6 },
        Distance::Hybrid(Blend::Constant(0.01)),
        Distance::Hybrid(Blend::ErrorDriven),
        Distance::Hybrid(Blend::CurvatureDriven(vec![1.0; points.nrows()])),
    ] {
        let reached = rmse(alternating(distance.clone(), 20))[1];
        assert!(reached < same, "{distance:?}: {reached:e} instead of {same:e}");
    }
    let joint = rmse(Method::JointLbfgs(Schedule::Constant { gradient: 1e-13, max_iterations: 300 }))[1];
    assert!(joint < 0.5 * many, "{joint:e} {many:e}");
}

#[test]
fn curves_in_the_plane_and_in_space() {
    for n in [2, 3] {
        let space = space::<1>(3);
        let parameters = lattice::<1>(40);
        let points = planted(&space, n).eval_batch(parameters.view()).unwrap();
        let start = perturbed(&parameters, 0.05);
        let (largest, _) = fitted(&space, &start, &points, options(exact(15)));
        assert!(largest < 1e-10, "dimension {n}: {largest:e}");
        for method in all_methods() {
            let (_, fit) = fitted(&space, &start, &points, options(method.clone()));
            let [before, after] = fit.reports()[0].rmse;
            assert!(after < 0.7 * before, "dimension {n}, {method:?}: {before:e} to {after:e}");
        }
    }
}

/// The triangles of a lattice.
fn triangles(per: usize) -> Vec<[u32; 3]> {
    let cell = |k: usize| {
        let a = (k / (per - 1) * per + k % (per - 1)) as u32;
        let b = a + per as u32;
        [[a, a + 1, b], [a + 1, b + 1, b]]
    };
    (0..(per - 1) * (per - 1)).flat_map(cell).collect()
}

#[test]
fn no_triangle_folds_behind_the_barrier() {
    let space = space::<2>(2);
    let parameters = lattice::<2>(16);
    let mut random = Random(17);
    // Noise about as large as the distance of the points folds what is free to fold.
    let points = planted(&space, 3).eval_batch(parameters.view()).unwrap().mapv(|x| x + 0.08 * (random.next() - 0.5));
    for method in [exact(10), Method::Alternating { distance: Distance::Point, corrections: 5 }] {
        let folds = |barrier: bool| {
            let fitting = fit_ls::Options { lambda: Lambda::Fixed(1e-7), ..fit_ls::Options::default() };
            let made = MovingFit::new(parameters.view(), points.view(), None, fitting, options(method.clone()));
            let mut fit = made.unwrap();
            if barrier {
                fit = fit.with_triangles(&triangles(16)).unwrap();
            }
            fit.solve(&space, None).unwrap();
            let moved = fit.parameters();
            let area = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|i| moved.row(i as usize));
                (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            };
            let folds = triangles(16).iter().filter(|t| area(t) <= 0.0).count();
            assert!(!barrier || fit.reports()[0].folds == folds);
            (folds, fit.reports()[0].held)
        };
        assert!(folds(false).0 > 0, "{method:?}: there is nothing to hold");
        let (folds, held) = folds(true);
        assert!(folds == 0 && held > 0, "{method:?}: {folds} folds, {held} held");
    }
}

#[test]
fn the_guard_does_not_end_worse_than_fixed_parameters() {
    // Exact parameters of a function with a peak that the coarse spaces cannot follow.
    let mut random = Random(23);
    let parameters = Array2::from_shape_simple_fn((1500, 2), || random.next());
    let points = Array2::from_shape_fn((1500, 3), |(i, k)| {
        let [u, v] = [parameters[[i, 0]], parameters[[i, 1]]];
        [u, v, (-12.0 * (u - 0.4).hypot(v - 0.6)).exp()][k]
    });
    let fitting = fit_ls::Options { lambda: Lambda::Fixed(1e-7), ..fit_ls::Options::default() };
    let knots = KnotVector::uniform(2, 4).unwrap();
    let start = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
    let tolerance = 2e-3;
    let adaptive = adaptive::Options { tolerance, within: 1.0, max_iterations: 4, ..adaptive::Options::default() };
    let mut go_on = |_: &adaptive::Iteration| std::ops::ControlFlow::Continue(());
    let mut fixed = fit_ls::LeastSquares::new(parameters.view(), points.view(), None, fitting.clone()).unwrap();
    let reference = adaptive::run(&mut fixed, start.clone(), &adaptive, &mut go_on).unwrap();
    let last = reference.history.last().unwrap();
    let options = Options { tolerance, ..Options::default() };
    for method in [options.method.clone(), Method::Alternating { distance: Distance::Point, corrections: 1 }] {
        let options = Options { method, ..options.clone() };
        let mut fit = MovingFit::new(parameters.view(), points.view(), None, fitting.clone(), options.clone()).unwrap();
        let outcome = adaptive::run(&mut fit, start.clone(), &adaptive, &mut go_on).unwrap();
        let reached = outcome.history.last().unwrap();
        assert!(reached.deviation.within >= last.deviation.within, "{:?}", options.method);
        assert!(reached.dofs <= last.dofs, "{:?}: {} instead of {}", options.method, reached.dofs, last.dofs);
        assert_eq!(fit.reports().len(), outcome.history.len());
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let space = space::<2>(2);
    let parameters = lattice::<2>(40);
    let points = planted(&space, 3).eval_batch(parameters.view()).unwrap();
    let start = perturbed(&parameters, 0.05);
    let with = |threads: usize, method: &Method| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fitted(&space, &start, &points, options(method.clone())).1.parameters())
    };
    for method in all_methods() {
        assert_eq!(with(1, &method), with(3, &method), "{method:?}");
    }
}

#[test]
fn wrong_options_are_named() {
    let parameters = lattice::<2>(5);
    let made = |points: &Array2<f64>, options: Options| {
        MovingFit::<2>::new(parameters.view(), points.view(), None, fit_ls::Options::default(), options).err()
    };
    let plane = parameters.clone();
    assert_eq!(made(&plane, options(exact(1))), Some(Error::NoNormal { parameters: 2, points: 2 }));
    let points = Array2::zeros((25, 3));
    let alternating = |distance| options(Method::Alternating { distance, corrections: 1 });
    let blend = alternating(Distance::Hybrid(Blend::Constant(1.5)));
    assert!(matches!(made(&points, blend), Some(Error::Option { value: 1.5, .. })));
    let curvatures = alternating(Distance::Hybrid(Blend::CurvatureDriven(vec![0.0; 7])));
    assert!(matches!(made(&points, curvatures), Some(Error::Shape { given: 7, expected: 25, .. })));
    assert_eq!(made(&Array2::zeros((25, 4)), options(exact(1))), Some(Error::Dimension { given: 4, limit: 3 }));
    let fit =
        MovingFit::<2>::new(parameters.view(), points.view(), None, fit_ls::Options::default(), options(exact(1)));
    let triangle = fit.unwrap().with_triangles(&[[0, 1, 2], [3, 99, 4]]).err();
    assert_eq!(triangle, Some(Error::Triangle { triangle: 1, point: 99, points: 25 }));
}

/// Share of neighbouring samples, 48 a direction, between which the normal of a surface turns by more than a right angle.
fn creases(map: &SplineMap<2>) -> f64 {
    let side = 48;
    let normal = |i: usize, j: usize| {
        let at = |i: usize| (i as f64 + 0.5) / side as f64;
        let [a, b] = [[1, 0], [0, 1]].map(|order| map.derivative([at(i), at(j)], order).unwrap());
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let turns = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2] < 0.0;
    let pairs = (0..side * (side - 1)).flat_map(|k| {
        let (i, j) = (k % (side - 1), k / (side - 1));
        [turns(normal(i, j), normal(i + 1, j)), turns(normal(j, i), normal(j, i + 1))]
    });
    let turned = pairs.filter(|turns| *turns).count();
    turned as f64 / (2 * side * (side - 1)) as f64
}

#[test]
fn surfaces_do_not_crease_where_parameters_move_to_a_ridge() {
    let side = 50;
    let start = Array2::from_shape_fn((side * side, 2), |(i, d)| [i % side, i / side][d] as f64 / (side - 1) as f64);
    let points = Array2::from_shape_fn((side * side, 3), |(i, k)| {
        let (x, y) = (start[[i, 0]], start[[i, 1]]);
        [x, y, 0.5 * (-(x - y).abs() / 0.08).exp()][k]
    });
    let knots = KnotVector::uniform(2, 6).unwrap();
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
    let share = |regularity: f64| {
        let method = Method::Joint(JointOptions { regularity, ..JointOptions::WITHOUT_SPRINGS });
        let options = Options { method, tolerance: 5e-3, guard: false, ..Options::default() };
        let fitting = fit_ls::Options { lambda: Lambda::Fixed(1e-7), ..fit_ls::Options::default() };
        let mut fit = MovingFit::new(start.view(), points.view(), None, fitting, options).unwrap();
        let map = fit.solve(&space, None).unwrap().map;
        let report = fit.reports()[0];
        assert!(report.rmse[1] < 0.5 * report.rmse[0], "{report:?}");
        creases(&map)
    };
    let (free, held) = (share(0.0), share(JointOptions::default().regularity));
    assert!(free > 2e-3, "{free}");
    assert!(held < 0.2 * free, "{held} against {free}");
}
