//! The network against its definition on the explicit line graph.

use super::*;
use crate::synthetic::stream;
use rand::RngExt;

fn graph(points: usize, interior: usize) -> (EdgeGraph, Vec<[f64; 3]>) {
    let mut random = stream(31, 0);
    let points: Vec<[f64; 3]> = (0..points).map(|_| [random.random(), random.random(), 0.2]).collect();
    (EdgeGraph::new(&points, interior, 0.35, 9).unwrap(), points)
}

fn random_rows(count: usize, seed: u64) -> Vec<f64> {
    let mut random = stream(seed, 0);
    (0..count).map(|_| 2.0 * random.random::<f64>() - 1.0).collect()
}

/// L̂ = −D^(−½) W D^(−½) of the line graph, entry by entry from its definition: edge (i, j) leads to edge (j, l), D counts the
/// edges that an edge leads to.
fn explicit_argument(graph: &EdgeGraph) -> Vec<Vec<f64>> {
    let ends: Vec<(u32, u32)> =
        (0..graph.interior).flat_map(|i| graph.leaving.of(i).iter().map(move |&j| (i as u32, j))).collect();
    let successors = |e: &(u32, u32)| ends.iter().filter(|f| f.0 == e.1).count();
    let root = |e: &(u32, u32)| match successors(e) {
        0 => 0.0,
        count => (count as f64).sqrt().recip(),
    };
    let entry = |to: &(u32, u32), from: &(u32, u32)| if from.1 == to.0 { -root(to) * root(from) } else { 0.0 };
    ends.iter().map(|to| ends.iter().map(|from| entry(to, from)).collect()).collect()
}

fn apply(matrix: &[Vec<f64>], x: &[f64], width: usize) -> Vec<f64> {
    let row = |row: &Vec<f64>| -> Vec<f64> {
        (0..width).map(|k| row.iter().enumerate().map(|(e, a)| a * x[e * width + k]).sum()).collect()
    };
    matrix.iter().flat_map(row).collect()
}

#[test]
fn a_convolution_equals_the_one_on_the_explicit_line_graph() {
    let (graph, _) = graph(60, 40);
    assert!(graph.leaving.sources.iter().any(|&j| j >= 40), "no edge ends on the boundary");
    let matrix = explicit_argument(&graph);
    let layout = Layout::new();
    let theta = random_rows(layout.len(), 32);
    for slots in &layout.convolutions[..2] {
        let x = random_rows(graph.edges() * slots.inputs, 33);
        let mut polynomials = vec![x.clone(), apply(&matrix, &x, slots.inputs)];
        for k in 2..POLYNOMIALS {
            let twice = apply(&matrix, &polynomials[k - 1], slots.inputs);
            polynomials.push(twice.iter().zip(&polynomials[k - 2]).map(|(a, b)| 2.0 * a - b).collect());
        }
        let mut expected = zeros::<f64>(graph.edges() * WIDTH);
        let weights = theta[slots.weights.clone()].chunks_exact(slots.inputs * WIDTH);
        for (x, weights) in polynomials.iter().zip(weights) {
            add_linear(&mut expected, x, slots.inputs, weights);
        }
        add_row(&mut expected, &theta[slots.bias.clone()]);
        relu(&mut expected);
        let (y, _) = convolve(slots, &theta, &graph, &x);
        let distance = y.iter().zip(&expected).fold(0.0f64, |d, (a, b)| d.max((a - b).abs()));
        assert!(distance < 1e-10, "{distance}");
    }
}

#[test]
fn without_a_tape_the_logits_are_the_same_and_single_precision_is_near() {
    let (graph, _) = graph(60, 40);
    let layout = Layout::new();
    let theta: Vec<f64> = crate::train::initial_weights(layout.slots(), 5).into_iter().map(f64::from).collect();
    let x = random_rows(graph.edges() * FEATURES, 34);
    let (kept, tape) = forward(&layout, &theta, &graph, x.clone(), true);
    let (dropped, none) = forward(&layout, &theta, &graph, x.clone(), false);
    assert!(tape.is_some() && none.is_none());
    assert_eq!(kept, dropped);
    let single = |x: &[f64]| -> Vec<f32> { x.iter().map(|&x| x as f32).collect() };
    let (logits, _) = forward(&layout, &single(&theta), &graph, single(&x), false);
    let distance = logits.iter().zip(&kept).fold(0.0f64, |d, (a, b)| d.max((f64::from(*a) - b).abs()));
    assert!(distance < 1e-4, "{distance}");
}
