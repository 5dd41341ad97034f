//! Tests of inference against the forward pass of training.

use super::*;
use crate::bidgcn::Symmetries;
use crate::bidgcn::cloud::Cloud;
use crate::bidgcn::layout::Variant;
use crate::bidgcn::network::forward;
use crate::graph::Neighbours;
use crate::synthetic::{ControlPoints, ScatteredSpec, stream};
use rand::RngExt;

fn input(interior: usize) -> Input<f32> {
    let spec = ScatteredSpec { control_points: ControlPoints::Jittered, degree: 2, interior, noise: 0.0 };
    Cloud::of_sample(&spec.sample(&mut stream(31, 0)).unwrap()).input(true, Neighbours::default())
}

/// Largest difference of the parameters, over all images of a cloud.
fn largest_difference(layout: &Layout, theta: &[f32], input: &Input<f32>) -> f32 {
    let inference = Inference::new(layout, theta, input);
    let mut memory = Memory::default();
    let identity: Vec<Symmetry> = Symmetries::One.all().collect();
    let (_, graphs) = inference.logits(identity[0], None, &mut memory);
    let difference = |symmetry: Symmetry| {
        let (logits, none) = inference.logits(symmetry, Some(&graphs), &mut memory);
        assert!(none.is_empty());
        let (expected, _) = forward(layout, theta, &symmetry.image(input), Some(&graphs));
        assert_eq!(logits.len(), expected.len());
        let sigmoid = |x: &f32| 1.0 / (1.0 + (-x).exp());
        logits.iter().zip(&expected).map(|(a, b)| (sigmoid(a) - sigmoid(b)).abs()).fold(0.0, f32::max)
    };
    Symmetries::Eight.all().map(difference).fold(0.0, f32::max)
}

#[test]
fn inference_of_the_embedded_network_is_its_forward_pass_in_all_images() {
    let network = crate::Bidgcn::embedded().unwrap();
    // Fewer points than a tile, and several tiles with a part of one.
    for n in [40, 700] {
        let difference = largest_difference(&network.layout, &network.theta, &input(n));
        assert!(difference < 2e-5, "{n} points: {difference}");
    }
}

#[test]
fn inference_is_the_forward_pass_where_all_features_are_used() {
    for variant in [Variant::Bidgcn, Variant::Dgcnn] {
        let layout = Layout::new(variant);
        let mut random = stream(32, 0);
        let mut theta = vec![0.0f32; layout.len()];
        for slot in layout.slots() {
            let bound = slot.fan_in.map_or(0.3, |fan_in| 1.0 / (fan_in as f32).sqrt());
            let shift = if slot.fan_in.is_none() { 0.5 } else { 0.0 };
            slot.range.clone().for_each(|k| theta[k] = shift + bound * (2.0 * random.random::<f32>() - 1.0));
        }
        let difference = largest_difference(&layout, &theta, &input(300));
        assert!(difference < 2e-5, "{variant:?}: {difference}");
    }
}

#[test]
fn moments_of_the_edges_are_those_of_their_rows() {
    let input = input(60);
    let graph = &input.boundary_graph;
    let mut edges: Vec<Vec<f64>> = Vec::new();
    for i in 0..graph.targets() {
        for &j in graph.of(i) {
            let (target, source) = (&input.interior[3 * i..][..3], &input.boundary[5 * j as usize..][..5]);
            edges.push(target.iter().chain(source).map(|&x| f64::from(x)).collect());
        }
    }
    assert!(edges.len() > 20, "{} edges", edges.len());
    let moments = EdgeMoments::new(graph, &input.interior, &input.boundary, 5);
    let mean = |f: &dyn Fn(&[f64]) -> f64| edges.iter().map(|e| f(e)).sum::<f64>() / edges.len() as f64;
    let means: Vec<f64> = (0..8).map(|k| mean(&|e| e[k])).collect();
    for a in 0..8 {
        assert!((moments.mean[a] - means[a]).abs() < 1e-12);
        for b in 0..8 {
            let expected = mean(&|e| (e[a] - means[a]) * (e[b] - means[b]));
            assert!((moments.covariance[8 * a + b] - expected).abs() < 1e-12);
        }
    }
}
