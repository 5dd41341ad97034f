//! Tests of trained networks: files, invariances, refusals.

use super::*;
use crate::synthetic::{ControlPoints, ScatteredSpec, stream, uniform_rotation};
use crate::train::Validation;

/// A cloud with its boundary points scattered among the others: points, boundary rows, boundary parameters.
fn cloud(interior: usize) -> (Array2<f64>, Vec<u32>, Array2<f64>) {
    let spec = ScatteredSpec { control_points: ControlPoints::Jittered, degree: 2, interior, noise: 0.0 };
    let sample = spec.sample(&mut stream(21, 0)).unwrap();
    let m = sample.points.nrows();
    // A stride that shares no divisor with any number of points here visits every row once.
    let place = |row: usize| (row * 7919) % m;
    let mut points = Array2::zeros((m, 3));
    (0..m).for_each(|row| points.row_mut(place(row)).assign(&sample.points.row(row)));
    let boundary: Vec<u32> = (interior..m).map(|row| place(row) as u32).collect();
    let parameters = Array2::from_shape_fn((boundary.len(), 2), |(i, k)| sample.parameters[[interior + i, k]]);
    (points, boundary, parameters)
}

fn largest_difference(a: &Array2<f64>, b: &Array2<f64>) -> f64 {
    a.iter().zip(b).fold(0.0, |d, (x, y)| d.max((x - y).abs()))
}

#[test]
fn the_embedded_network_comes_near_the_true_parameters() {
    let network = Bidgcn::embedded().unwrap();
    assert_eq!((network.weights(), network.variant()), (192_130, Variant::Bidgcn));
    // Of biquadratic fits to such clouds: UNIF leaves 1e-3 to 4e-3, RECD 1e-3 to 3e-3, LPSP 1e-4 to 2e-4.
    for score in Validation::new(77, 3).unwrap().scores(&network) {
        assert!(score.mse < 2e-4, "{score:?}");
        assert!(score.parameter_error < 0.06, "{score:?}");
    }
}

#[test]
fn averages_over_symmetries_are_nearer_to_the_truth() {
    let network = Bidgcn::embedded().unwrap();
    let averaged = network.clone().read_as(Reading::BEST);
    let validation = Validation::small(78, 3).unwrap();
    for (once, mean) in validation.scores(&network).into_iter().zip(validation.scores(&averaged)) {
        assert!(mean.mse < once.mse, "{mean:?} {once:?}");
    }
}

#[test]
fn averages_depend_less_on_how_the_square_lies() {
    let (points, boundary, parameters) = cloud(200);
    let turned = Array2::from_shape_fn(parameters.dim(), |(i, k)| [1.0 - parameters[[i, 1]], parameters[[i, 0]]][k]);
    let differ = |network: &Bidgcn| {
        let predict = |fixed: &Array2<f64>| network.predict(points.view(), &boundary, fixed.view()).unwrap();
        let image = predict(&turned);
        let back = Array2::from_shape_fn(image.dim(), |(i, k)| [image[[i, 1]], 1.0 - image[[i, 0]]][k]);
        largest_difference(&predict(&parameters), &back)
    };
    let network = Bidgcn::embedded().unwrap();
    let once = differ(&network);
    let averaged = differ(&network.read_as(Reading { symmetries: Symmetries::Eight, midpoints_up_to: 0 }));
    assert!(averaged < 0.5 * once, "{averaged}, {once} of a single reading");
}

#[test]
fn boundary_points_keep_their_parameters_and_the_rest_lies_in_the_square() {
    let (points, boundary, parameters) = cloud(200);
    let uv = Bidgcn::embedded().unwrap().predict(points.view(), &boundary, parameters.view()).unwrap();
    for (&row, given) in boundary.iter().zip(parameters.rows()) {
        assert_eq!(uv.row(row as usize), given);
    }
    assert!(uv.iter().all(|x| (0.0..=1.0).contains(x)));
}

#[test]
fn rotation_shift_and_scale_do_not_matter() {
    let (points, boundary, parameters) = cloud(200);
    let network = Bidgcn::embedded().unwrap();
    let first = network.predict(points.view(), &boundary, parameters.view()).unwrap();
    let shifted = &points * 730.0 - 1e4;
    let second = network.predict(shifted.view(), &boundary, parameters.view()).unwrap();
    let turned = points.dot(&uniform_rotation(&mut stream(5, 0)).t());
    let third = network.predict(turned.view(), &boundary, parameters.view()).unwrap();
    // Round-off of single precision may add or drop a neighbour at the rim of a graph.
    assert!(largest_difference(&first, &second) < 5e-3, "{}", largest_difference(&first, &second));
    assert!(largest_difference(&first, &third) < 5e-3, "{}", largest_difference(&first, &third));
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let (points, boundary, parameters) = cloud(300);
    let network = Bidgcn::embedded().unwrap();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| network.predict(points.view(), &boundary, parameters.view()).unwrap())
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn weights_come_back_from_their_file() {
    let network = Bidgcn::embedded().unwrap();
    let again = Bidgcn::load(&network.to_bytes()).unwrap();
    assert_eq!((&again.theta, again.notes()), (&network.theta, network.notes()));
    let mut other = network.to_archive();
    other.tensors.remove("hidden.2.bias");
    assert!(matches!(Bidgcn::of_archive(other), Err(NnError::OtherWeights { what: "tensors", .. })));
    for name in ["version", "architecture", "frame"] {
        let mut other = network.to_archive();
        other.metadata.insert(name.into(), "other".into());
        assert!(matches!(Bidgcn::of_archive(other), Err(NnError::OtherWeights { .. })), "{name}");
    }
    assert!(matches!(Bidgcn::load(b"no weights"), Err(NnError::DamagedWeights { .. })));
}

#[test]
fn wrong_input_is_an_error() {
    let (points, boundary, parameters) = cloud(20);
    let network = Bidgcn::embedded().unwrap();
    let predict = |boundary: &[u32], parameters: &Array2<f64>| {
        network.predict(points.view(), boundary, parameters.view()).unwrap_err()
    };
    assert!(matches!(predict(&boundary[1..], &parameters), NnError::WrongShape { .. }));
    let mut wrong = boundary.clone();
    wrong[2] = wrong[1];
    assert!(matches!(predict(&wrong, &parameters), NnError::BadBoundaryPoint { index: 2, .. }));
    wrong[2] = 1 << 20;
    assert!(matches!(predict(&wrong, &parameters), NnError::BadBoundaryPoint { index: 2, .. }));
    let inside = parameters.mapv(|x| 0.2 + 0.5 * x);
    assert!(matches!(predict(&boundary, &inside), NnError::BadBoundaryPoint { index: 0, .. }));
    let many = Array2::from_shape_fn((LARGEST_CLOUD + 1, 3), |(i, k)| ((i * (k + 1)) as f64).sin());
    let error = network.predict(many.view(), &boundary, parameters.view()).unwrap_err();
    assert_eq!(error, NnError::TooManyPoints { given: LARGEST_CLOUD + 1, limit: LARGEST_CLOUD });
    let equal = Array2::ones((30, 3));
    assert!(matches!(network.predict(equal.view(), &[], Array2::zeros((0, 2)).view()), Err(NnError::Cloud(_))));
}

#[test]
fn a_cloud_that_is_all_boundary_and_one_without_a_boundary_have_results() {
    let (points, boundary, parameters) = cloud(20);
    let network = Bidgcn::embedded().unwrap();
    let rows: Vec<usize> = boundary.iter().map(|&row| row as usize).collect();
    let outline = points.select(ndarray::Axis(0), &rows);
    let all: Vec<u32> = (0..rows.len() as u32).collect();
    assert_eq!(network.predict(outline.view(), &all, parameters.view()).unwrap(), parameters);
    let free = network.predict(points.view(), &[], Array2::zeros((0, 2)).view()).unwrap();
    assert!(free.iter().all(|x| (0.0..=1.0).contains(x)));
}
