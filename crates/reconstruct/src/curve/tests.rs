//! Curves whose truth is known.

use std::borrow::Cow;

use ndarray::{Array2, array};
use proptest::prelude::*;

use super::*;
use crate::{LambdaChoice, Mark, Method, Tolerance};
use deviation::Verdict;

fn curve(count: usize, point: impl Fn(f64) -> [f64; 2]) -> Array2<f64> {
    Array2::from_shape_fn((count, 2), |(i, k)| point(i as f64 / (count - 1) as f64)[k])
}

fn tight(tol: f64) -> CurveOptions {
    CurveOptions { tol: Tolerance::Absolute(tol), lambda: LambdaChoice::Fixed(0.0), ..CurveOptions::default() }
}

#[test]
fn a_drop_closes_at_its_corner() {
    // Two legs that meet at a corner and an arc between them; the sequence starts elsewhere.
    let shape = |t: f64| {
        let s = std::f64::consts::PI * t;
        [(2.0 * s).sin() * s.sin(), -(s.sin()) * (1.0 + 0.3 * s.sin())]
    };
    let all = curve(201, shape);
    let order: Vec<usize> = (70..200).chain(0..=70).collect();
    let points = all.select(ndarray::Axis(0), &order);
    let fit = fit_sequence(points.view(), "drop", &tight(1e-4)).unwrap();
    assert_eq!(fit.report.input.closed, "at a corner");
    assert_eq!(fit.report.input.corners, [130]);
    assert!(fit.reached(), "{}", fit.report);
    let (a, b) = (fit.curve().eval([0.0]).unwrap(), fit.curve().eval([1.0]).unwrap());
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-14));
    // The same without the corner rounds it off, and needs more control points for less.
    let round = CurveOptions { corners: CornerChoice::None, ..tight(1e-4) };
    let rounded = fit_sequence(points.view(), "drop", &round).unwrap();
    assert_eq!(rounded.report.input.closed, "periodic");
    assert!(rounded.report.result.control_points > fit.report.result.control_points);
}

#[test]
fn a_polygon_closes_without_its_first_point_again() {
    let corner = |k: usize| [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]][k % 4];
    let points = Array2::from_shape_fn((40, 2), |(i, k)| {
        let (side, t) = (i / 10, (i % 10) as f64 / 10.0);
        corner(side)[k] + t * (corner(side + 1)[k] - corner(side)[k])
    });
    let fit = fit_sequence(points.view(), "rectangle", &tight(1e-9)).unwrap();
    assert_eq!(fit.report.input.closed, "at a corner");
    assert_eq!(fit.report.input.corners, [0, 10, 20, 30]);
    // Four straight sides.
    assert!(fit.reached() && fit.report.result.spans == 4, "{}", fit.report);
}

#[test]
fn corners_inside_get_knots_of_full_multiplicity() {
    // A polyline of smooth pieces: |t| over a parabola.
    let points = curve(101, |t| [t, (t - 0.3).abs() + 0.2 * t * t]);
    let fit = fit_sequence(points.view(), "kink", &tight(1e-6)).unwrap();
    assert_eq!(fit.report.input.corners, [30]);
    let corner = fit.parameters[30];
    assert_eq!(fit.report.result.knots.iter().filter(|&&t| t == corner).count(), 3);
    let given = CurveOptions { corners: CornerChoice::Rows(vec![30]), ..tight(1e-6) };
    assert_eq!(fit_sequence(points.view(), "kink", &given).unwrap().report.result.knots, fit.report.result.knots);
    assert!(fit.reached(), "{}", fit.report);
}

#[test]
fn a_cubic_needs_no_knots_and_few_knots_follow_a_bend() {
    let cubic = curve(40, |t| [t, t * t * t - t]);
    let options = CurveOptions { graph: true, ..tight(1e-10) };
    let fit = fit_sequence(cubic.view(), "cubic", &options).unwrap();
    assert_eq!(fit.report.result.control_points, 4);
    // The graph's first coordinate is the parameter.
    assert!((fit.curve().eval([0.37]).unwrap()[0] - 0.37).abs() < 1e-15);
    // A step: dyadic knots gather where it is.
    let step = curve(400, |t| [t, ((t - 0.7) * 60.0).tanh()]);
    let fit = fit_sequence(step.view(), "step", &CurveOptions { graph: true, ..tight(1e-4) }).unwrap();
    assert!(fit.reached(), "{}", fit.report);
    let knots = &fit.report.result.knots;
    let near = knots.iter().filter(|t| (**t - 0.7).abs() < 0.1).count();
    assert!(2 * near > knots.len() - 8, "{knots:?}");
    assert!(knots.iter().all(|t| (t * 65536.0).fract() == 0.0), "{knots:?}");
}

#[test]
fn moving_parameters_need_fewer_control_points() {
    // Unevenly sampled: chord length suits neither end.
    let points = curve(120, |t| {
        let s = std::f64::consts::TAU * t * t;
        [2.0 * s.cos() * (0.6 + 0.4 * s.cos()), s.sin() + 0.4 * (2.0 * s).sin()]
    });
    let open = CurveOptions { closed: ClosedChoice::No, corners: CornerChoice::None, ..tight(1e-4) };
    let dofs = |method| {
        let fit = fit_sequence(points.view(), "loop", &CurveOptions { method, ..open.clone() }).unwrap();
        assert!(fit.reached(), "{}", fit.report);
        fit.report.result.control_points
    };
    let fixed = dofs(Method::Ls);
    assert!(dofs(Method::Joint) < fixed);
    assert!(dofs(Method::APdm) <= fixed);
}

#[test]
fn values_alone_are_a_function_of_their_number() {
    let values = Array2::from_shape_fn((60, 1), |(i, _)| (i as f64 / 10.0).sin());
    let fit = fit_sequence(values.view(), "values", &tight(1e-3)).unwrap();
    assert_eq!((fit.report.input.parameterization, fit.report.input.closed), ("uniform", "open"));
    assert!(fit.reached() && fit.report.input.corners.is_empty());
    assert!((fit.curve().eval([0.5]).unwrap()[0] - 2.95_f64.sin()).abs() < 1e-3);
}

#[test]
fn held_ends_are_met() {
    let points = curve(50, |t| [t, (5.0 * t).sin() + 0.05 * (91.0 * t).sin()]);
    let options = CurveOptions { ends: Ends::Held, knots: KnotChoice::Averaged(4), ..tight(1e-3) };
    for method in [Method::Ls, Method::Joint] {
        let fit = fit_sequence(points.view(), "held", &CurveOptions { method, ..options.clone() }).unwrap();
        for (u, row) in [(0.0, 0), (1.0, 49)] {
            let end = fit.curve().eval([u]).unwrap();
            assert!(end.iter().zip(points.row(row)).all(|(a, b)| (a - b).abs() < 1e-14), "{end:?}");
        }
        assert_eq!((fit.report.result.control_points, fit.report.result.stop), (8, "fixed-knots"));
    }
}

#[test]
fn averaged_knots_of_as_many_as_points_are_those_of_the_book() {
    // Piegl and Tiller, The NURBS Book, Example 9.1: parameters 0, 5/17, 9/17, 14/17, 1 give the one inner knot 28/51.
    let points = array![[0.0, 0.0], [3.0, 4.0], [-1.0, 4.0], [-4.0, 0.0], [-4.0, -3.0]];
    let options = CurveOptions { knots: KnotChoice::Averaged(1), closed: ClosedChoice::No, ..tight(1e-9) };
    let fit = fit_sequence(points.view(), "book", &options).unwrap();
    assert!((fit.report.result.knots[4] - 28.0 / 51.0).abs() < 1e-15);
    assert!(fit.report.result.max < 1e-12, "as many control points as points interpolate");
}

#[test]
fn what_cannot_be_fitted_is_refused_with_its_numbers() {
    let points = curve(10, |t| [t, t]);
    let with = |options: CurveOptions| fit_sequence(points.view(), "line", &options).unwrap_err().to_string();
    assert!(with(CurveOptions { knots: KnotChoice::Averaged(7), ..tight(1e-3) }).contains("11 control points"));
    assert!(with(CurveOptions { method: Method::Qi, ..tight(1e-3) }).contains("--method"));
    assert!(with(CurveOptions { graph: true, method: Method::Joint, ..tight(1e-3) }).contains("--graph"));
    assert!(with(CurveOptions { corners: CornerChoice::Rows(vec![10]), ..tight(1e-3) }).contains("row 10"));
    let four = Array2::<f64>::zeros((10, 4));
    assert!(fit_sequence(four.view(), "four", &CurveOptions::default()).is_err());
    let bad = array![[0.0, 1.0], [1.0, f64::NAN]];
    assert!(fit_sequence(bad.view(), "nan", &CurveOptions::default()).is_err());
    let one = array![[0.0, 1.0]];
    assert!(fit_sequence(one.view(), "one", &CurveOptions::default()).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Splines on dyadic knots come back: the adaptive fit ends with all points met, whatever dimension and degree.
    #[test]
    fn random_sequences_are_met(
        dimension in 1..=3usize, degree in 1..=5usize, seed in 0..1000u64, count in 12..60usize,
    ) {
        let points = Array2::from_shape_fn((count, dimension), |(i, k)| {
            let t = i as f64 / count as f64;
            (seed as f64 + (3.0 + k as f64) * t).sin() + 0.3 * (7.0 * t * (k + 1) as f64).cos()
        });
        let options = CurveOptions { degree, param: CurveParameters::Uniform, mark: Mark(adaptive::Marking::Threshold), ..tight(1e-3) };
        let fit = fit_sequence(points.view(), "random", &options).unwrap();
        let result = &fit.report.result;
        prop_assert!(result.reached || result.control_points + degree >= count / 2, "{}", fit.report);
        prop_assert_eq!(fit.errors.len(), fit.parameters.len());
    }
}

/// Random numbers in [0, 1).
fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A normal variable, from twelve uniform ones.
fn normal(next: &mut impl FnMut() -> f64) -> f64 {
    (0..12).map(|_| next()).sum::<f64>() - 6.0
}

fn rows(places: &[[f64; 2]]) -> Array2<f64> {
    Array2::from_shape_fn((places.len(), 2), |(i, k)| places[i][k])
}

/// Places of a curve, many a span.
fn samples(fit: &CurveFit) -> Array2<f64> {
    let knots = &fit.report.result.knots;
    let (first, last) = (knots[0], knots[knots.len() - 1]);
    let at = Array2::from_shape_fn((20_001, 1), |(i, _)| first + (last - first) * i as f64 / 20_000.0);
    fit.curve().eval_batch(at.view()).unwrap()
}

/// How far a curve leaves the box with the given corners.
fn beyond_box(fit: &CurveFit, lower: [f64; 2], upper: [f64; 2]) -> f64 {
    let beyond =
        |p: ndarray::ArrayView1<'_, f64>| (0..2).map(|k| (lower[k] - p[k]).max(p[k] - upper[k])).fold(0.0, f64::max);
    samples(fit).outer_iter().map(beyond).fold(0.0, f64::max)
}

/// A rectangle of half sizes `a` and `b` with arcs of radius `r`, of `count` points each, closed by its first point; the straights
/// have no points. `a = r` or `b = r` makes a slot, whose arcs meet.
fn rounded(a: f64, b: f64, r: f64, count: usize) -> Array2<f64> {
    let mut places: Vec<[f64; 2]> = Vec::new();
    for (quarter, [x, y]) in [[a - r, b - r], [r - a, b - r], [r - a, r - b], [a - r, r - b]].into_iter().enumerate() {
        for i in 0..count {
            let t = std::f64::consts::FRAC_PI_2 * (quarter as f64 + i as f64 / (count - 1) as f64);
            let place = [x + r * t.cos(), y + r * t.sin()];
            if places.last().is_none_or(|p| (p[0] - place[0]).hypot(p[1] - place[1]) > 1e-9 * r) {
                places.push(place);
            }
        }
    }
    if (places[0][0] - places[places.len() - 1][0]).hypot(places[0][1] - places[places.len() - 1][1]) < 1e-9 * r {
        places.pop();
    }
    places.push(places[0]);
    rows(&places)
}

#[test]
fn rounded_rectangles_and_slots_stay_inside_their_boxes() {
    for (a, b, r, count) in [
        (21.0, 63.0, 3.75, 9),
        (5.0, 80.0, 1.0, 5),
        (100.0, 100.0, 10.0, 13),
        (30.0, 4.0, 2.0, 17),
        (0.4, 0.3, 0.02, 7),
        // Slots: half circles of 13, 7 and 25 points.
        (102.0, 2.0, 2.0, 7),
        (20.0, 1.0, 1.0, 4),
        (3.0, 50.0, 3.0, 13),
    ] {
        let points = rounded(a, b, r, count);
        let default = fit_sequence(points.view(), "rounded", &CurveOptions::default()).unwrap();
        assert_eq!(default.verdict(), Verdict::Good, "{a} {b} {r} {count}: {:?}", default.report.result.reasons);
        for options in [
            CurveOptions::default(),
            CurveOptions { lambda: LambdaChoice::Auto, ..CurveOptions::default() },
            CurveOptions { lambda: LambdaChoice::Fixed(0.0), ..CurveOptions::default() },
            CurveOptions { knots: KnotChoice::Averaged(12), ..CurveOptions::default() },
            CurveOptions { elements: 16, ..CurveOptions::default() },
            CurveOptions { method: Method::Joint, ..CurveOptions::default() },
            CurveOptions { method: Method::APdm, ..CurveOptions::default() },
        ] {
            let fit = fit_sequence(points.view(), "rounded", &options).unwrap();
            let beyond = beyond_box(&fit, [-a, -b], [a, b]) / fit.report.result.tolerance;
            assert!(
                fit.verdict() == Verdict::Failed || beyond <= 1.25,
                "{a} {b} {r} {count}: {beyond}, {}",
                fit.report
            );
        }
    }
}

#[test]
fn dense_ends_with_a_sparse_middle_do_not_swing() {
    for (length, count) in [(98.0, 14), (400.0, 30), (20.0, 8)] {
        for middle in [0, 1, 3] {
            let mut places: Vec<[f64; 2]> = (0..=count)
                .map(|i| {
                    let t = i as f64 / count as f64;
                    [t, 0.5 * t * t]
                })
                .collect();
            places.extend((1..=middle).map(|k| [1.0 + length * k as f64 / (middle + 1) as f64, 0.5]));
            places.extend((0..=count).map(|i| {
                let t = i as f64 / count as f64;
                [1.0 + length + t, 0.5 + 0.5 * t * t]
            }));
            let points = rows(&places);
            let fit = fit_sequence(points.view(), "uneven", &CurveOptions::default()).unwrap();
            let beyond = beyond_box(&fit, [0.0, 0.0], [length + 2.0, 1.0]) / fit.report.result.tolerance;
            assert!(fit.verdict() != Verdict::Failed && beyond <= 1.25, "{length} {middle}: {beyond}, {}", fit.report);
            // The bend into the straight is no corner, but the end of a parabola.
            assert!(fit.report.input.corners.is_empty(), "{:?}", fit.report.input.corners);
        }
    }
}

/// Few points may be missed by a closed spline of as few functions; but nothing else may be told.
fn only_missed(fit: &CurveFit, seed: u64) {
    let reasons = &fit.report.result.reasons;
    assert!(reasons.iter().all(|reason| reason.code == "share"), "seed {seed}: {reasons:?}");
}

#[test]
fn few_points_of_a_smooth_curve_are_no_swing() {
    let square = rows(&[[0.0, 0.0], [1.0, -1.0], [2.0, 0.0], [1.0, 1.0], [0.0, 0.0]]);
    let uneven =
        rows(&[[2.75, 1.5], [2.4, 1.9], [1.9, 1.4], [1.4, 1.1], [1.0, 1.3], [0.4, 1.0], [0.1, 0.2], [1.4, -0.3]]);
    let twice = rows(&[[-50.0, 1.0], [-50.0, 1.0], [-54.0, 1.0], [-54.0, 1.0]]);
    let closed = CurveOptions { closed: ClosedChoice::Yes, ..CurveOptions::default() };
    for (points, options) in [(square, &closed), (uneven, &closed), (twice, &CurveOptions::default())] {
        let fit = fit_sequence(points.view(), "few", options).unwrap();
        let result = &fit.report.result;
        assert!(result.verdict == Verdict::Good && result.support_points == 0, "{:?}", result.reasons);
        assert!(fit.report.warnings.is_empty(), "{:?}", fit.report.warnings);
    }
    // Ellipses with few points at random places, and waves.
    for seed in 1..=20 {
        let mut next = random(seed);
        let (ratio, count) = (1.0 + 2.0 * next(), 12 + (20.0 * next()) as usize);
        let ellipse: Vec<[f64; 2]> = (0..count)
            .map(|i| {
                let t = std::f64::consts::TAU * (i as f64 + 0.5 * next()) / count as f64;
                [ratio * t.cos(), t.sin()]
            })
            .collect();
        let fit = fit_sequence(rows(&ellipse).view(), "ellipse", &closed).unwrap();
        only_missed(&fit, seed);
        let wave: Vec<[f64; 2]> = (0..2 * count)
            .map(|i| {
                let t = 6.0 * (i as f64 + 0.5 * next()) / count as f64;
                [t, (1.3 * t).sin()]
            })
            .collect();
        let fit = fit_sequence(rows(&wave).view(), "wave", &CurveOptions::default()).unwrap();
        only_missed(&fit, seed);
    }
}

#[test]
fn noisy_sections_close() {
    let mut open = 0;
    for seed in 1..=20 {
        let mut next = random(seed);
        let count = 100 * (1 + seed as usize % 4);
        let mut angles: Vec<f64> = (0..count).map(|_| std::f64::consts::TAU * next()).collect();
        angles.sort_by(f64::total_cmp);
        let section: Vec<[f64; 2]> = angles
            .iter()
            .map(|t| {
                let r = 1.0 + 0.05 * (3.0 * t).cos();
                [12.0 * r * t.cos() + 0.02 * normal(&mut next), 10.0 * r * t.sin() + 0.02 * normal(&mut next)]
            })
            .collect();
        for lambda in [LambdaChoice::Fixed(1e-12), LambdaChoice::CrossValidation] {
            let options = CurveOptions { tol: Tolerance::Absolute(0.09), lambda, ..CurveOptions::default() };
            let fit = fit_sequence(rows(&section).view(), "section", &options).unwrap();
            open += usize::from(fit.report.input.closed == "open");
            assert_ne!(fit.verdict(), Verdict::Failed, "seed {seed}: {:?}", fit.report.result.reasons);
        }
    }
    assert!(open <= 2, "{open} of 40");
}

#[test]
fn rings_with_a_gap_stay_open() {
    for count in [45, 90, 200] {
        for gap in [2.0, 3.0, 5.0, 10.0] {
            let step = std::f64::consts::TAU / count as f64;
            let left = count - gap as usize + 1;
            let ring: Vec<[f64; 2]> =
                (0..left).map(|i| step * i as f64).map(|t| [30.0 * t.cos(), 30.0 * t.sin()]).collect();
            let fit = fit_sequence(rows(&ring).view(), "ring", &CurveOptions::default()).unwrap();
            assert_eq!((fit.report.input.closed, fit.verdict()), ("open", Verdict::Good), "{count} {gap}");
            let told = fit.report.warnings.iter().any(|w| w.contains("taken to be open"));
            // Where the curve would turn by less than 60° at both ends of the gap.
            assert_eq!(told, gap * step < 0.9, "{:?}", fit.report.warnings);
        }
    }
}

#[test]
fn a_turn_and_a_bit_is_one_turn() {
    for (count, extra, noise) in [(360, 5, 0.0), (360, 5, 0.01), (90, 1, 0.0), (90, 12, 0.0), (200, 40, 0.02)] {
        for closed in [ClosedChoice::Yes, ClosedChoice::Auto] {
            let mut next = random(7);
            let turn: Vec<[f64; 2]> = (0..=count + extra)
                .map(|i| {
                    let t = std::f64::consts::TAU * i as f64 / count as f64;
                    let r = 12.0 + 0.6 * (5.0 * t).cos() + noise * normal(&mut next);
                    [r * t.cos(), r * t.sin()]
                })
                .collect();
            let options = CurveOptions { closed, tol: Tolerance::Absolute(0.08), ..CurveOptions::default() };
            let fit = fit_sequence(rows(&turn).view(), "turn", &options).unwrap();
            assert_eq!((fit.report.input.closed, fit.verdict()), ("periodic", Verdict::Good), "{}", fit.report);
            assert!(fit.report.warnings.iter().any(|w| w.contains("round once more")), "{:?}", fit.report.warnings);
            // It goes round once, and nowhere back.
            let places = samples(&fit);
            let angle = |i: usize| places[[i, 1]].atan2(places[[i, 0]]);
            let mut turned = 0.0;
            for i in 1..places.nrows() {
                let step = (angle(i) - angle(i - 1) + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU)
                    - std::f64::consts::PI;
                assert!(step > 0.0, "back by {step} at {}", angle(i));
                turned += step;
            }
            assert!((turned - std::f64::consts::TAU).abs() < 1e-9);
        }
    }
}

#[test]
fn blunt_trailing_edges_keep_their_corners() {
    for thickness in [0.001, 0.0025, 0.01, 0.03] {
        for count in [20, 40, 100] {
            let half = |x: f64| {
                0.6 * (0.2969 * x.sqrt() - 0.126 * x - 0.3516 * x * x + 0.2843 * x.powi(3) - 0.1036 * x.powi(4))
                    + 0.5 * thickness * x
            };
            let x = |i: usize| 0.5 + 0.5 * (std::f64::consts::PI * i as f64 / count as f64).cos();
            let mut section: Vec<[f64; 2]> = (0..=count).map(|i| [x(i), half(x(i))]).collect();
            section.extend((0..count).rev().map(|i| [x(i), -half(x(i))]));
            // From the trailing edge, from the leading edge, and with a point on the edge.
            let from_nose: Vec<[f64; 2]> = section[count..].iter().chain(&section[..count]).copied().collect();
            let with_middle: Vec<[f64; 2]> = section.iter().copied().chain([[1.0, 0.0]]).collect();
            for (name, places) in [("tail", &section), ("nose", &from_nose), ("middle", &with_middle)] {
                let options = CurveOptions { tol: Tolerance::Absolute(1e-4), ..CurveOptions::default() };
                let fit = fit_sequence(rows(places).view(), name, &options).unwrap();
                let input = &fit.report.input;
                // Forty points a turn don't determine the nose to this tolerance.
                let enough = count > 20;
                assert!(!enough || fit.verdict() != Verdict::Failed, "{thickness} {count}: {}", fit.report);
                assert_ne!(input.closed, "periodic", "{name} {thickness} {count}");
                if input.closed == "at a corner" {
                    assert_eq!(input.corners.len(), 2, "{name} {thickness} {count}: {:?}", input.corners);
                }
                // Both corners are met, and nothing is behind the edge.
                let curve = samples(&fit);
                for y in [0.5 * thickness, -0.5 * thickness] {
                    let tip = half(1.0) * y.signum();
                    let near = curve.outer_iter().map(|p| (p[0] - 1.0).hypot(p[1] - tip)).fold(f64::INFINITY, f64::min);
                    assert!(near <= 2e-4, "{name} {thickness} {count}: {near}");
                }
                assert!(beyond_box(&fit, [0.0, -1.0], [1.0, 1.0]) <= 2e-4);
            }
        }
    }
}

#[test]
fn moving_parameters_never_end_worse() {
    let mut kept = 0;
    for seed in 1..=3 {
        // A rough coast.
        let mut next = random(seed);
        let coast: Vec<[f64; 2]> = (0..300)
            .map(|i| {
                let t = std::f64::consts::TAU * i as f64 / 300.0;
                let waves = 0.2 * (7.0 * t).sin() + 0.1 * (31.0 * t + seed as f64).sin();
                let r = 10.0 * (1.0 + waves) + 0.25 * normal(&mut next);
                [r * t.cos(), r * t.sin()]
            })
            .collect();
        let points = rows(&coast);
        let options = CurveOptions { tol: Tolerance::Percent(2.0), ..CurveOptions::default() };
        let fixed = fit_sequence(points.view(), "coast", &options).unwrap();
        for method in [Method::Joint, Method::APdm, Method::ATdm] {
            let moved = fit_sequence(points.view(), "coast", &CurveOptions { method, ..options.clone() }).unwrap();
            let two_sided = |fit: &CurveFit| fit.report.result.dhd.max(fit.report.result.swing);
            let (own, tolerance) = (two_sided(&moved), moved.report.result.tolerance);
            assert!(moved.verdict() <= fixed.verdict(), "{method}, seed {seed}: {}", moved.report);
            assert!(own <= two_sided(&fixed).max(tolerance), "{method}, seed {seed}: {own}");
            kept += usize::from(moved.report.warnings.iter().any(|w| w.contains("parameters were kept")));
        }
    }
    // Otherwise nothing was put to the test.
    assert!(kept > 0);
}

#[test]
fn what_a_polygon_crosses_a_curve_may_cross() {
    let eight = curve(121, |t| {
        let s = std::f64::consts::TAU * t;
        [s.sin(), (2.0 * s).sin()]
    });
    let fit = fit_sequence(eight.view(), "eight", &CurveOptions::default()).unwrap();
    let result = &fit.report.result;
    assert!(result.verdict == Verdict::Good && result.crossings == Some(0), "{:?}", result.reasons);
    // In space nothing crosses.
    let helix = Array2::from_shape_fn((200, 3), |(i, k)| {
        let t = 0.1 * i as f64;
        [t.cos(), t.sin(), 0.1 * t][k]
    });
    let fit = fit_sequence(helix.view(), "helix", &CurveOptions::default()).unwrap();
    assert!(fit.verdict() == Verdict::Good && fit.report.result.crossings.is_none());
}

#[test]
fn planted_faults_are_told_with_their_size_and_place() {
    use super::sequence::{Closing, Sequence};
    use super::verdict::{Subject, judge};

    // The points of a straight line, and curves that do something else between them.
    let count = 41;
    let points = Array2::from_shape_fn((count, 2), |(i, k)| [i as f64 / 4.0, 0.0][k]);
    let parameters = ndarray::Array1::from_shape_fn(count, |i| i as f64 / (count - 1) as f64);
    let sequence = Sequence {
        points: points.clone(),
        parameters: parameters.clone(),
        domain: (0.0, 1.0),
        closing: Closing::Open,
        held: false,
        corners: Vec::new(),
        corner_rows: Vec::new(),
        rows: (0..count).collect(),
        method: "chord",
        notes: Vec::new(),
    };
    // A bulge between the rows 20 and 21, or a loop there.
    let bump = |u: f64, size: f64| {
        let t = (u - 0.5) * (count - 1) as f64;
        if (0.0..1.0).contains(&t) { size * (std::f64::consts::PI * t).sin().powi(2) } else { 0.0 }
    };
    let made = |place: &dyn Fn(f64) -> [f64; 2]| {
        let dense = curve(6001, place);
        let options = CurveOptions {
            knots: KnotChoice::Uniform(800),
            param: CurveParameters::Uniform,
            closed: ClosedChoice::No,
            corners: CornerChoice::None,
            ..tight(1e-3)
        };
        fit_sequence(dense.view(), "made", &options).unwrap().curve().clone()
    };
    let judged = |map: &thb_core::SplineMap<1>| {
        let errors = ndarray::Array1::from_iter(points.outer_iter().zip(&parameters).map(|(p, &u)| {
            let at = map.eval([u]).unwrap();
            (p[0] - at[0]).hypot(p[1] - at[1])
        }));
        judge(&Subject {
            map,
            sequence: &sequence,
            parameters: &parameters,
            errors: &errors,
            tolerance: 0.02,
            within: 1.0,
            is_function: false,
        })
        .unwrap()
    };
    let codes = |judgement: &super::verdict::Judgement| -> Vec<&'static str> {
        let code = |reason: &deviation::Reason| match &reason.code {
            Cow::Borrowed(code) => *code,
            Cow::Owned(code) => panic!("{code} is none of ours"),
        };
        judgement.reasons.iter().map(code).collect()
    };
    let straight = judged(&made(&|u| [10.0 * u, 0.0]));
    assert!(straight.verdict() == Verdict::Good, "{:?}", straight.reasons);
    for size in [0.05, 0.3, 1.0] {
        let bulged = judged(&made(&|u| [10.0 * u, bump(u, size)]));
        assert_eq!(codes(&bulged), ["swing"], "{size}");
        let reason = &bulged.reasons[0];
        assert!((reason.figure - size).abs() < 0.03 * size, "{size}: {}", reason.figure);
        let place = reason.place.unwrap();
        assert!((5.0..5.25).contains(&place[0]) && (place[1] - size).abs() < 0.03 * size, "{place:?}");
        assert!(reason.text.contains("rows 20 and 21"), "{}", reason.text);
    }
    // A loop: forth, back and forth again.
    let looped = judged(&made(&|u| {
        let t = ((u - 0.5) * (count - 1) as f64).clamp(0.0, 1.0);
        let around = std::f64::consts::TAU * t;
        [10.0 * u + 0.4 * around.sin(), 0.4 * (1.0 - around.cos())]
    }));
    assert!(codes(&looped).contains(&"crossing") && codes(&looped).contains(&"swing"), "{:?}", codes(&looped));
    assert_eq!(looped.crossings, Some(1));
    // Points that are missed: a step of a tenth of the length.
    let missed = judged(&made(&|u| [10.0 * u, if u > 0.9 { 0.5 * ((u - 0.9) / 0.02).min(1.0) } else { 0.0 }]));
    let found = codes(&missed);
    assert!(found.contains(&"share") && !found.contains(&"crossing"), "{found:?}");
    assert!((missed.share - 0.9).abs() < 0.03 && missed.reasons[0].verdict == Verdict::Failed);
    // A curve that runs beyond its last point.
    let long = judged(&made(&|u| [11.5 * u, 0.0]));
    assert!(codes(&long).contains(&"box"), "{:?}", codes(&long));
}

#[test]
fn a_hairpin_does_not_cross_itself() {
    // Two banks of a creek, 0.6 tolerances apart at its end: each bank alone is met by a curve that crosses.
    for width in [0.5, 1.0, 2.0] {
        let creek = curve(160, |t| {
            let s = 4.0 * (t - 0.5).abs();
            let open = 0.02 * width * (0.3 + s * s);
            [3.0 - s + 0.03 * (40.0 * t).sin(), open * (t - 0.5).signum() + 0.02 * (25.0 * t).cos()]
        });
        let options = CurveOptions { tol: Tolerance::Absolute(0.03), ..CurveOptions::default() };
        let fit = fit_sequence(creek.view(), "creek", &options).unwrap();
        let result = &fit.report.result;
        assert_eq!(result.crossings == Some(0), result.verdict != Verdict::Failed, "{:?}", result.reasons);
    }
}
