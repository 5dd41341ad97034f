//! Fits of surfaces that are known.

use std::f64::consts::PI;
use std::sync::Arc;

use point_cloud::vec3::{norm, unit};
use thb_core::{CellSpace, MultiPatchSpace, PatchPlace, PatchSide, PatchTopology, side_point};

use crate::testing::{cube, ellipsoid, fit_cube, on_cube, space};
use crate::{Error, Fitted, Options, Problem, Sample, angles, fit, folds, integrals};

const SMOOTH: [bool; 12] = [false; 12];

fn options(smoothness: f64) -> Options {
    Options { plates: 1e-9, smoothness, diagonal: 2.0 * 3.0_f64.sqrt(), ..Options::default() }
}

fn rms(fitted: &Fitted) -> f64 {
    (fitted.distances.iter().map(|d| d * d).sum::<f64>() / fitted.distances.len() as f64).sqrt()
}

#[test]
fn a_sphere_is_met_smoothly_and_outward() {
    let fitted = fit_cube(&space(3, 4), &SMOOTH, ellipsoid(24, [1.0; 3]), &options(1.0)).unwrap();
    assert!(rms(&fitted) < 2e-4, "{}", rms(&fitted));
    let found = angles(&fitted.surface, &SMOOTH);
    assert!(found.max < 0.1 && found.at_vertices < 0.1 && found.arcs == 12, "{found:?}");
    let sizes = integrals(&fitted.surface);
    assert!((sizes.volume / (4.0 / 3.0 * PI) - 1.0).abs() < 1e-4, "{sizes:?}");
    assert!((sizes.area / (4.0 * PI) - 1.0).abs() < 1e-3, "{sizes:?}");
    assert_eq!(folds(&fitted.surface, |point, _| unit(point)), []);
}

#[test]
fn without_the_angle_term_there_are_kinks() {
    let (with, without) = (options(1.0), options(0.0));
    let [with, without] = [with, without].map(|options| {
        let fitted = fit_cube(&space(3, 2), &SMOOTH, ellipsoid(12, [1.0, 0.7, 0.5]), &options).unwrap();
        (angles(&fitted.surface, &SMOOTH), rms(&fitted))
    });
    assert!(without.0.max > 5.0 * with.0.max, "{with:?} {without:?}");
    assert!(with.1 < 2.0 * without.1, "{with:?} {without:?}");
}

/// Samples of the cube itself, with its edges.
fn samples_of_cube(n: usize) -> Vec<Sample> {
    let mut samples = Vec::new();
    for face in 0..6 {
        for k in 0..n * n {
            let u = [k % n, k / n].map(|i| (i as f64 + 0.5) / n as f64);
            let place = PatchPlace { patch: face as u32, u };
            let normal = unit(on_cube(face, [0.5; 2]));
            samples.push(Sample { point: on_cube(face, u), normal, weight: 1.0, place, arc: None });
        }
    }
    let topology = cube();
    for arc in 0..12 {
        let on = topology.uses(arc)[0];
        for k in 0..=n {
            let u = side_point(on.side, k as f64 / n as f64);
            let place = PatchPlace { patch: on.patch, u };
            let point = on_cube(on.patch as usize, u);
            samples.push(Sample { point, normal: [0.0; 3], weight: 1.0, place, arc: Some(arc as u32) });
        }
    }
    samples
}

#[test]
fn sharp_arcs_stay_sharp() {
    let fitted = fit_cube(&space(3, 3), &[true; 12], samples_of_cube(8), &options(1.0)).unwrap();
    assert!(fitted.distances.iter().all(|d| *d < 1e-9), "{:?}", fitted.distances.iter().copied().fold(0.0, f64::max));
    assert!((integrals(&fitted.surface).volume - 8.0).abs() < 1e-9);
    // Measured as smooth ones they are at right angles.
    let found = angles(&fitted.surface, &SMOOTH);
    assert!((found.max - 90.0).abs() < 1e-6 && (found.p99 - 90.0).abs() < 1e-6, "{found:?}");
    assert_eq!(angles(&fitted.surface, &[true; 12]).arcs, 0);
}

#[test]
fn parameters_cross_smooth_arcs_but_no_sharp_ones() {
    // Parameters that were taken from a cube turned by some degrees: many samples begin on the wrong patch.
    let turned = |p: [f64; 3]| {
        let (sin, cos) = 0.2_f64.sin_cos();
        [cos * p[0] - sin * p[1], sin * p[0] + cos * p[1], p[2]]
    };
    let samples: Vec<Sample> = ellipsoid(16, [1.0, 0.9, 0.8])
        .into_iter()
        .map(|sample| Sample { point: turned(sample.point), normal: turned(sample.normal), ..sample })
        .collect();
    let before: Vec<u32> = samples.iter().map(|sample| sample.place.patch).collect();
    // A blob that keeps to the cube: its own samples hold it, the turned ones follow.
    let all: Vec<Sample> = ellipsoid(16, [1.0; 3]).into_iter().chain(samples).collect();
    let moved = |sharp: &[bool; 12]| {
        let fitted = fit_cube(&space(3, 3), sharp, all.clone(), &options(1.0)).unwrap();
        let after = fitted.samples.as_slice()[6 * 16 * 16..].iter().map(|sample| sample.place.patch);
        after.zip(&before).filter(|(after, before)| after != *before).count()
    };
    assert!(moved(&SMOOTH) > 100, "{}", moved(&SMOOTH));
    assert_eq!(moved(&[true; 12]), 0);
}

#[test]
fn results_do_not_depend_on_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let fitted = fit_cube(&space(3, 2), &SMOOTH, ellipsoid(10, [1.0, 0.7, 0.5]), &options(1.0)).unwrap();
            fitted.surface.coefficients().iter().map(|c| c.to_bits()).collect::<Vec<_>>()
        })
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let space = space(3, 2);
    let good = ellipsoid(8, [1.0; 3]);
    let refused = |samples: Vec<Sample>, options: &Options| fit_cube(&space, &SMOOTH, samples, options).unwrap_err();
    assert!(matches!(refused(Vec::new(), &options(1.0)), Error::NoSamples));
    let mut bad = good.clone();
    bad[3].point[1] = f64::NAN;
    assert!(matches!(refused(bad, &options(1.0)), Error::BadSample { index: 3 }));
    let mut tied = good.clone();
    let sides = cube().patches()[0];
    let foreign = (0..12).find(|arc| sides.iter().all(|side| side.arc != *arc)).unwrap();
    tied[0].arc = Some(foreign);
    assert!(matches!(refused(tied, &options(1.0)), Error::ForeignArc { index: 0, patch: 0, .. }));
    let negative = Options { smoothness: -1.0, ..options(1.0) };
    assert!(matches!(refused(good.clone(), &negative), Error::Option { name: "smoothness", .. }));
    let flags = fit_cube(&space, &[false; 3], good.clone(), &options(1.0)).unwrap_err();
    assert!(matches!(flags, Error::Space(thb_core::Error::Shape { given: 3, expected: 12, .. })));
    let flat = Problem {
        space: &space,
        sharp: &SMOOTH,
        sizes: &[[1.0, 0.0]; 6],
        samples: good.clone(),
        outward: &|point, _| unit(point),
    };
    assert!(matches!(fit(flat, &options(1.0)), Err(Error::BadSize { patch: 0, .. })));
    // One sample leaves the plates' planes undetermined.
    assert!(matches!(refused(good[..1].to_vec(), &options(0.0)), Error::Solve { .. }));
    assert!(space.n_functions() > 0 && norm(good[0].normal) > 0.0);
}

/// Two strips of 64° and a hundredth of the radius wide, side by side in a plane: nothing but the plates holds the line between them.
#[test]
fn long_patches_do_not_leave_their_borders() {
    let (inner, width, sweep) = (1.0, 0.01, 64_f64.to_radians());
    let arcs = vec![[0, 1], [1, 3], [3, 2], [2, 0], [3, 5], [5, 4], [4, 2]];
    let side = |arc, reversed| PatchSide { arc, reversed };
    let patches = vec![
        [side(0, false), side(1, false), side(2, false), side(3, false)],
        [side(2, true), side(4, false), side(5, false), side(6, false)],
    ];
    let topology = Arc::new(PatchTopology::new(6, arcs, patches).unwrap());
    let space = Arc::new(MultiPatchSpace::uniform(Arc::clone(&topology), 3, 4).unwrap());
    let at = |u: f64, v: f64| {
        let (sin, cos) = (sweep * u).sin_cos();
        let radius = inner + width * v;
        [radius * sin, -radius * cos, 0.0]
    };
    let mut samples = Vec::new();
    for patch in 0..2_u32 {
        for k in 0..40 * 8 {
            let u = [(k % 40) as f64 / 39.0, (k / 40) as f64 / 7.0];
            let place = PatchPlace { patch, u };
            let point = at(u[0], f64::from(patch) + u[1]);
            samples.push(Sample { point, normal: [0.0, 0.0, 1.0], weight: 1.0, place, arc: None });
        }
    }
    for arc in (0..7).filter(|arc| *arc != 2) {
        let on = topology.uses(arc)[0];
        for k in 0..=32 {
            let u = side_point(on.side, f64::from(k) / 32.0);
            let place = PatchPlace { patch: on.patch, u };
            let point = at(u[0], f64::from(on.patch) + u[1]);
            samples.push(Sample { point, normal: [0.0; 3], weight: 1.0, place, arc: Some(arc as u32) });
        }
    }
    let fitted = |sizes: &[[f64; 2]]| {
        let outward = &|_, _| [0.0, 0.0, 1.0];
        let problem = Problem { space: &space, sharp: &[false; 7], sizes, samples: samples.clone(), outward };
        let options = Options { plates: 1e-6, diagonal: 1.0, ..Options::default() };
        let surface = fit(problem, &options).unwrap().surface;
        let middle = |k: u32| {
            let place = PatchPlace { patch: 0, u: [f64::from(k) / 20.0, 1.0] };
            surface.bezier().jet(space.locate(place).unwrap(), place.u).value
        };
        (0..=20).map(|k| (norm(middle(k)) - inner - width).abs()).fold(0.0, f64::max)
    };
    let (told, untold) = (fitted(&[[sweep, width]; 2]), fitted(&[[1.0; 2]; 2]));
    assert!(told < 0.1 * width && untold > width, "{told:e} {untold:e}");
}
