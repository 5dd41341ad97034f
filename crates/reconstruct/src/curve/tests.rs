//! Curves whose truth is known.

use ndarray::{Array2, array};
use proptest::prelude::*;

use super::*;
use crate::{LambdaChoice, Mark, Method, Tolerance};

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
