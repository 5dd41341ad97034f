//! Every term against differences of its energy.

use std::sync::Arc;

use thb_core::{CellSpace, MultiPatchSpace, SymmetricPattern};

use super::{Angles, Data, Form, Plates, angle_energy};
use crate::arc_points::{ArcElement, arc_elements};
use crate::equations::{Equations, Solver};
use crate::samples::Samples;
use crate::term::{State, Term};
use crate::testing::{ellipsoid, fit_cube, on_cube, random, space};

/// Coefficients of a lumpy sphere: those of the cube's corners and so on are where their Greville points are, and moved at random.
fn lumpy(space: &MultiPatchSpace, seed: u64) -> Vec<f64> {
    let mut coefficients = vec![0.0; 3 * space.n_functions()];
    for patch in 0..space.n_patches() {
        let own = space.patch(patch);
        let greville = [0, 1].map(|d| own.knots(0, d).unwrap().greville());
        for (local, &number) in space.numbers(patch).iter().enumerate() {
            let (i, j) = (local % greville[0].len(), local / greville[0].len());
            let p = point_cloud::vec3::unit(on_cube(patch, [greville[0][i], greville[1][j]]));
            coefficients[3 * number as usize..][..3].copy_from_slice(&p);
        }
    }
    coefficients.iter_mut().zip(random(seed, 3 * space.n_functions())).for_each(|(c, x)| *c += 0.05 * x);
    coefficients
}

/// The value of the model `E(c) − 2 g·d + dᵀ H d` at a step, without E(c).
fn model(equations: &Equations, d: &[f64]) -> f64 {
    let slope: f64 = equations.right.iter().zip(d).map(|(g, d)| -2.0 * g * d).sum();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let alike: f64 = (0..3)
        .map(|k| {
            let column: Vec<f64> = d.iter().skip(k).step_by(3).copied().collect();
            dot(&equations.alike.multiply(&column), &column)
        })
        .sum();
    slope + alike + equations.coupled.as_ref().map_or(0.0, |matrix| dot(&matrix.multiply(d), d))
}

/// Compares slopes, and curvatures of a term that is a sum of squares of functions with curvature `remainder` at most.
fn check(term: &dyn Term, is_coupled: bool, is_quadratic: bool, degree: usize) {
    let space = space(degree, 2);
    let samples = Samples::new(&space, ellipsoid(5, [1.0, 0.8, 0.6])).unwrap();
    let groups: Vec<Vec<u32>> =
        arc_elements(&space, &[false; 12]).unwrap().iter().map(|element| element.functions.clone()).collect();
    let mut solver = Solver::new(&SymmetricPattern::with_groups(space.as_ref(), &groups)).unwrap();
    let coefficients = lumpy(&space, 3);
    let energy = |coefficients: &[f64]| term.energy(&State { space: &space, coefficients, samples: &samples });
    let mut equations = solver.equations(is_coupled).unwrap();
    term.linearize(&State { space: &space, coefficients: &coefficients, samples: &samples }, &mut equations);
    let at = energy(&coefficients);
    assert!(at > 0.0, "the term vanishes here, and nothing is tested");
    for seed in 5..9 {
        let direction = random(seed, coefficients.len());
        let moved = |h: f64| -> Vec<f64> { coefficients.iter().zip(&direction).map(|(c, d)| c + h * d).collect() };
        let scaled = |h: f64| -> Vec<f64> { direction.iter().map(|d| h * d).collect() };
        let h = 1e-5;
        let slope = (energy(&moved(h)) - energy(&moved(-h))) / (2.0 * h);
        let expected = (model(&equations, &scaled(h)) - model(&equations, &scaled(-h))) / (2.0 * h);
        assert!((slope - expected).abs() < 1e-6 * (slope.abs() + at), "slope {slope}, {expected}");
        if is_quadratic {
            let (found, expected) = (energy(&moved(0.3)) - at, model(&equations, &scaled(0.3)));
            assert!((found - expected).abs() < 1e-9 * (found.abs() + at), "{found}, {expected}");
        }
    }
}

#[test]
fn data_are_quadratic() {
    for degree in 2..5 {
        check(&Data, false, true, degree);
    }
}

#[test]
fn plates_are_quadratic() {
    for degree in 2..5 {
        let space = space(degree, 2);
        let groups: Vec<Vec<u32>> =
            arc_elements(&space, &[false; 12]).unwrap().iter().map(|element| element.functions.clone()).collect();
        let sizes: Vec<[f64; 2]> = (1..=6).map(|k| [f64::from(k), 2.0]).collect();
        let mut plates = Plates::new(&space, &SymmetricPattern::with_groups(space.as_ref(), &groups), &sizes);
        plates.set_stiffness(&space, &(1..=space.n_functions()).map(|i| i as f64).collect::<Vec<_>>());
        plates.set_weight(1e-2);
        check(&plates, false, true, degree);
    }
}

#[test]
fn held_angles_are_quadratic() {
    for degree in 2..5 {
        let space = space(degree, 2);
        let elements: Arc<[ArcElement]> = arc_elements(&space, &[false; 12]).unwrap().into();
        for form in [Form::AcrossPlanes, Form::Whole] {
            check(&Angles::frozen(elements.clone(), 0.7, form, &lumpy(&space, 3)), true, true, degree);
        }
    }
}

/// Close to a smooth join the form that is held and the squared sine are the same to second order.
#[test]
fn held_angles_are_angles_where_planes_nearly_agree() {
    let space = space(3, 4);
    let samples = Samples::new(&space, ellipsoid(12, [1.0, 0.8, 0.6])).unwrap();
    let fitted = fit_cube(&space, &[false; 12], samples.as_slice().to_vec(), &crate::Options::default()).unwrap();
    let coefficients: Vec<f64> = fitted.surface.coefficients().iter().copied().collect();
    let elements: Arc<[ArcElement]> = arc_elements(&space, &[false; 12]).unwrap().into();
    let state = State { space: &space, coefficients: &coefficients, samples: &samples };
    let by_sine = angle_energy(&elements, 1.0, &coefficients);
    for form in [Form::AcrossPlanes, Form::Whole] {
        let held = Angles::frozen(elements.clone(), 1.0, form, &coefficients).energy(&state);
        assert!(by_sine > 0.0 && (held / by_sine - 1.0).abs() < 1e-4, "{form:?}: {by_sine} {held}");
    }
}

/// Whatever moves in the plane of both patches is free, and a fold counts as two.
#[test]
fn in_a_plane_angles_leave_everything_free_but_folds() {
    let space = space(3, 2);
    let elements: Arc<[ArcElement]> = arc_elements(&space, &[false; 12]).unwrap().into();
    // Flattened, the cube's patches are folded over along some arcs and smooth along others.
    let mut flat = lumpy(&space, 3);
    flat.iter_mut().skip(2).step_by(3).for_each(|z| *z = 0.0);
    let samples = Samples::new(&space, ellipsoid(5, [1.0, 0.8, 0.6])).unwrap();
    let mut folded = 0;
    for element in elements.iter() {
        let angles = Angles::frozen([element.clone()].into(), 1.0, Form::AcrossPlanes, &flat);
        let energy = |coefficients: &[f64]| angles.energy(&State { space: &space, coefficients, samples: &samples });
        let turned = element.points.iter().filter(|point| {
            let [t, left, right] = element.derivatives(point, &flat);
            let up = |d: [f64; 3]| t[0] * d[1] - t[1] * d[0];
            up(left) * up(right) > 0.0
        });
        let weight: f64 = turned.map(|point| point.weight).sum();
        assert!((energy(&flat) - 4.0 * weight).abs() < 1e-9 * (1.0 + weight), "{} {weight}", energy(&flat));
        folded += usize::from(weight > 0.0);
        if weight == 0.0 {
            let moved: Vec<f64> = (flat.iter().zip(random(7, flat.len())).enumerate())
                .map(|(i, (c, x))| if i % 3 == 2 { *c } else { c + 0.1 * x })
                .collect();
            assert!(energy(&moved) < 1e-20, "{}", energy(&moved));
        }
    }
    assert!(0 < folded && folded < elements.len(), "{folded} of {} are folded", elements.len());
}
