//! Files, invariance, errors, and the quality of the embedded networks.

use ndarray::{Array2, Axis, array};

use super::*;
use crate::gridded::{GriddedSpec, Shape};
use crate::synthetic::{stream, uniform_rotation};

fn sequence(degree: usize, dimension: usize, count: usize, seed: u64) -> Array2<f64> {
    let spec = GriddedSpec { shape: Shape::Curve { degree, dimension }, size: [count, 1], noise: 0.0 };
    spec.sample(&mut stream(seed, 0)).unwrap().points
}

fn surface(degree: usize, size: [usize; 2], seed: u64) -> Array3<f64> {
    let spec = GriddedSpec { shape: Shape::Surface { degree }, size, noise: 0.0 };
    let points = spec.sample(&mut stream(seed, 0)).unwrap().points;
    points.into_shape_with_order((size[0], size[1], 3)).unwrap()
}

fn task(points: &Array2<f64>, space: SplineSpace) -> Task {
    let xyz = points.rows().into_iter().map(|p| std::array::from_fn(|k| p.get(k).copied().unwrap_or(0.0)));
    Task::new(Grid { xyz: xyz.collect(), size: [points.nrows(), 1], dimension: points.ncols() }, space)
}

#[test]
fn files_come_back_and_others_are_refused() {
    let network = Parcnn::embedded(2, 1).unwrap();
    let bytes = network.to_bytes();
    let again = Parcnn::load(&bytes).unwrap();
    assert_eq!(
        (again.theta, again.notes, again.layout.architecture),
        (network.theta.clone(), network.notes.clone(), network.layout.architecture)
    );
    assert!(matches!(Parcnn::load(&bytes[..1000]), Err(NnError::DamagedWeights { .. })));
    let changed = |name: &str, value: &str| {
        let mut archive = network.to_archive();
        archive.metadata.insert(name.into(), value.into());
        Parcnn::load(&archive.to_bytes())
    };
    assert!(matches!(changed("version", "2"), Err(NnError::OtherWeights { what: "format version", .. })));
    for architecture in ["", "bidgcn", "feedback 2 1 6", "feedback 4 1 6 64", "feedback 2 1 6 99999999999999"] {
        let error = changed("architecture", architecture);
        assert!(matches!(error, Err(NnError::OtherWeights { what: "architecture", .. })), "{architecture}: {error:?}");
    }
    assert!(matches!(changed("architecture", "feedback 3 1 6 64"), Err(NnError::OtherWeights { what: "tensors", .. })));
    let mut archive = network.to_archive();
    archive.tensors.get_mut("input.weight").unwrap().1[3] = f32::NAN;
    assert!(matches!(Parcnn::load(&archive.to_bytes()), Err(NnError::OtherWeights { what: "tensors", .. })));
    let bidgcn = crate::bidgcn::Bidgcn::embedded().unwrap().to_bytes();
    assert!(matches!(Parcnn::load(&bidgcn), Err(NnError::OtherWeights { .. })));
}

#[test]
fn names_of_architectures_come_back() {
    for form in [Form::Feedback { blocks: 6, width: 64 }, Form::Published { degree: 3, blocks: 4, width: 100 }] {
        for (dimension, directions) in [(2, 1), (3, 1), (3, 2)] {
            let architecture = Architecture { dimension, directions, form };
            assert_eq!(parse(&name(architecture)), Some(architecture));
        }
    }
}

#[test]
fn untrained_networks_give_the_best_classical_parameters() {
    let architecture = Architecture { dimension: 2, directions: 1, form: super::super::SHIPPED_FORM };
    let layout = Arc::new(Layout::new(architecture));
    let theta = layout.initial_weights(3);
    let network = Parcnn { layout, theta, notes: BTreeMap::new() };
    let task = task(&sequence(3, 2, 30, 1), SplineSpace::polynomials(3));
    let (given, classical) = (network.last_state(&task), task.classical_state());
    for (a, b) in given.uv.iter().zip(&classical.uv) {
        assert!((a[0] - b[0]).abs() < 1e-12);
    }
}

#[test]
fn exact_fits_are_left_alone() {
    let count = 24;
    let line: Vec<f64> = (0..count).map(|k| k as f64 / 23.0).collect();
    let points = Array2::from_shape_fn((count, 2), |(i, k)| if k == 0 { line[i] } else { 2.0 * line[i] });
    let u = sequence_parameters(points.view(), Some(SplineSpace::polynomials(2))).unwrap();
    assert!(u.iter().zip(&line).all(|(a, b)| (a - b).abs() < 1e-7), "{u}");
}

#[test]
fn fits_of_sequences_beat_classical_ones_at_any_length() {
    for dimension in [2, 3] {
        let network = Parcnn::embedded(dimension, 1).unwrap();
        for degree in 2..=5 {
            let (mut learned, mut standard) = (0.0, [0.0; 3]);
            for (k, count) in [2 * degree + 1, 13, 37, 100, 260].into_iter().enumerate() {
                let task = task(&sequence(degree, dimension, count, 50 + k as u64), SplineSpace::polynomials(degree));
                learned += network.last_state(&task).fit.mse;
                for (sum, power) in standard.iter_mut().zip([0.0, 0.5, 1.0]) {
                    *sum += task.grid.state(task.spaces, task.grid.classical_steps(power, true)).fit.mse;
                }
            }
            let standard = standard.into_iter().fold(f64::INFINITY, f64::min);
            assert!(learned < 0.2 * standard, "{dimension} {degree}: {learned} {standard}");
        }
    }
}

#[test]
fn fits_of_grids_beat_classical_ones_at_any_size() {
    let error = |uv: Array3<f64>, points: &Array3<f64>, space: SplineSpace| {
        let uv: Vec<[f64; 2]> = uv.rows().into_iter().map(|r| [r[0], r[1]]).collect();
        let xyz: Vec<[f64; 3]> = points.rows().into_iter().map(|p| [p[0], p[1], p[2]]).collect();
        (crate::parcnn::GridFit::new([space; 2], &uv, &xyz).mse, xyz)
    };
    let (mut learned, mut standard) = (0.0, 0.0);
    for (degree, size) in [(2, [12, 12]), (3, [7, 15]), (4, [20, 11]), (5, [13, 13])] {
        let space = SplineSpace::polynomials(degree);
        let points = surface(degree, size, 3 + degree as u64);
        let (mse, xyz) = error(grid_parameters(points.view(), Some(space)).unwrap(), &points, space);
        let grid = Grid { xyz, size, dimension: 3 };
        learned += mse;
        standard += grid.state([space; 2], grid.classical_steps(1.0, true)).fit.mse;
    }
    assert!(learned < 0.5 * standard, "{learned} {standard}");
}

#[test]
fn position_size_and_orientation_do_not_matter() {
    let space = SplineSpace { degree: 3, elements: 2 };
    let rotation = uniform_rotation(&mut stream(2, 0));
    let points = sequence(4, 3, 40, 8);
    let moved = points.dot(&rotation.t()) * -250.0 + &array![1e3, -2e3, 5.0];
    let [u, v] = [points, moved].map(|p| sequence_parameters(p.view(), Some(space)).unwrap());
    assert!(u.iter().zip(&v).all(|(a, b)| (a - b).abs() < 1e-4), "{u} {v}");
    let points = surface(3, [9, 14], 8);
    let rows = points.to_shape((9 * 14, 3)).unwrap();
    let moved = (rows.dot(&rotation.t()) * 0.01 - &array![3.0, 7.0, 1.0]).into_shape_with_order((9, 14, 3)).unwrap();
    let [u, v] = [points, moved].map(|p| grid_parameters(p.view(), Some(space)).unwrap());
    assert!(u.iter().zip(&v).all(|(a, b)| (a - b).abs() < 1e-4));
}

#[test]
fn turning_a_grid_swaps_its_parameters() {
    let points = surface(4, [10, 13], 5);
    let space = Some(SplineSpace::polynomials(4));
    let uv = grid_parameters(points.view(), space).unwrap();
    let turned = grid_parameters(points.permuted_axes([1, 0, 2]).view(), space).unwrap();
    for ((i, j, k), x) in uv.indexed_iter() {
        assert!((x - turned[[j, i, 1 - k]]).abs() < 1e-4);
    }
}

#[test]
fn parameters_rise_along_all_lines() {
    let uv = grid_parameters(surface(5, [11, 17], 6).view(), None).unwrap();
    for k in 0..2 {
        for line in uv.index_axis(Axis(2), k).lanes(Axis(k)) {
            assert_eq!((line[0], line[line.len() - 1]), (0.0, 1.0));
            assert!(line.windows(2).into_iter().all(|w| w[0] < w[1]));
        }
    }
}

#[test]
fn the_result_is_the_same_in_every_run() {
    let points = sequence(5, 2, 100, 4);
    let [a, b] = [0, 1].map(|_| sequence_parameters(points.view(), None).unwrap());
    assert_eq!(a, b);
}

#[test]
fn unusable_points_are_errors() {
    let points = sequence(3, 2, 12, 1);
    let given = |points: &Array2<f64>| sequence_parameters(points.view(), None).unwrap_err();
    let mut double = points.clone();
    let row = double.row(6).to_owned();
    double.row_mut(7).assign(&row);
    assert!(matches!(given(&double), NnError::BadGrid { direction: 0, line: 0, place: 7, .. }));
    let mut broken = points.clone();
    broken[[3, 1]] = f64::NAN;
    assert!(matches!(given(&broken), NnError::Cloud(_)));
    assert!(matches!(given(&points.select(Axis(0), &[0, 1])), NnError::BadGrid { place: 2, .. }));
    assert!(matches!(given(&Array2::zeros((9, 4))), NnError::NoNetwork { dimension: 4, .. }));
    assert!(matches!(given(&Array2::zeros((9, 1))), NnError::NoNetwork { dimension: 1, .. }));
    let grid = surface(3, [8, 9], 1);
    let mut backwards = grid.clone();
    for i in 0..8 {
        backwards.index_axis_mut(Axis(0), i).row_mut(4).assign(&grid.index_axis(Axis(0), 7 - i).row(4));
    }
    let error = grid_parameters(backwards.view(), None).unwrap_err();
    assert!(matches!(error, NnError::BadGrid { direction: 0, line: 4, .. }), "{error}");
    let space = |degree, elements| Some(SplineSpace { degree, elements });
    for (wrong, name) in
        [(space(0, 1), "degree"), (space(9, 1), "degree"), (space(3, 0), "elements"), (space(3, 22), "elements")]
    {
        let error = sequence_parameters(points.view(), wrong).unwrap_err();
        assert!(matches!(error, NnError::BadOption { name: n, .. } if n == name), "{error}");
    }
    let network = Parcnn::embedded(3, 2).unwrap();
    assert!(matches!(
        network.predict_sequence(sequence(3, 3, 9, 1).view(), SplineSpace::suggested(9)),
        Err(NnError::OtherWeights { .. })
    ));
}

#[test]
fn the_smallest_inputs_are_parameterized() {
    let three = array![[0.0, 0.0], [1.0, 0.5], [3.0, 0.0]];
    let u = sequence_parameters(three.view(), None).unwrap();
    assert!(u[0] == 0.0 && u[2] == 1.0 && u[1] > 0.0 && u[1] < 1.0);
    let uv = grid_parameters(surface(2, [3, 3], 1).view(), None).unwrap();
    assert!(uv.iter().all(|x| (0.0..=1.0).contains(x)));
}

/// A wave whose points lie unevenly; in space it climbs.
fn wave(dimension: usize) -> Array2<f64> {
    Array2::from_shape_fn((12, dimension), |(i, k)| {
        let t = (i as f64 / 11.0).powf(1.4);
        [t, 0.3 * (5.0 * t).sin(), t * t][k]
    })
}

/// Whoever replaces the weights replaces these numbers.
#[test]
fn embedded_networks_give_what_they_gave_when_they_were_shipped() {
    let space = SplineSpace { degree: 3, elements: 2 };
    let grid = Array3::from_shape_fn((5, 6, 3), |(i, j, k)| {
        let (u, v) = ((i as f64 / 4.0).powf(1.3), (j as f64 / 5.0).powf(0.8));
        [u, v, 0.4 * (2.0 * u + v).sin()][k]
    });
    let uv = grid_parameters(grid.view(), Some(SplineSpace::polynomials(2))).unwrap();
    let plane = sequence_parameters(wave(2).view(), Some(space)).unwrap();
    let solid = sequence_parameters(wave(3).view(), Some(space)).unwrap();
    let given =
        [plane[1], plane[6], plane[10], solid[1], solid[6], solid[10], uv[[1, 2, 0]], uv[[1, 2, 1]], uv[[3, 4, 1]]];
    let shipped = [
        0.045_952_4,
        0.494_106_8,
        0.894_052_7,
        0.044_021_5,
        0.489_776_6,
        0.893_663_1,
        0.159_421_9,
        0.479_155_7,
        0.836_885_2,
    ];
    for (a, b) in given.iter().zip(shipped) {
        assert!((a - b).abs() < 1e-5, "{given:?}");
    }
}
