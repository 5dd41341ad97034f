//! The network: parameters of the interior points from points and boundary, and the gradient by all weights.
//!
//! Imperatore 2024, §4.3. Messages of the hidden layers are one linear map of `(x_i, x_j − x_i)`, and they are averaged; so
//! are those of the second linear map of the input layer. Both commute with the mean, and the work is done per point in
//! place of per edge.

use super::layers::{
    Messages, Normalized, WIDTH, add_column_sums, add_edge_gradients, add_linear, add_row, add_weight_gradient,
    input_gradient, linear, neighbour_means, neighbour_means_backward, own_matrix, relu, relu_backward, rows, zeros,
};
use super::layout::{HIDDEN, Layout, MessageSlots};
use crate::graph::{Graph, Neighbours, radius_graph};
use crate::real::Real;

/// Radius of all graphs, in the unit cube and in the spaces of features; the text is silent, the published code has it.
const RADIUS: f32 = 0.1;

/// Most neighbours of an interior point; most interior points that a boundary point speaks to.
const CAP: usize = 32;

/// Radius and cap of a graph.
fn reach(neighbours: Neighbours) -> (f32, usize) {
    match neighbours {
        Neighbours::WithinRadius => (RADIUS, CAP),
        Neighbours::Nearest(count) => (f32::INFINITY, usize::from(count)),
    }
}

/// What the network is given.
#[derive(Clone, Debug)]
pub(crate) struct Input<T> {
    pub(super) neighbours: Neighbours,
    /// Interior points, three numbers each, in the unit cube.
    pub(super) interior: Vec<T>,
    /// Boundary points and their parameters, five numbers each.
    pub(super) boundary: Vec<T>,
    pub(super) interior_graph: Graph,
    /// Edges from boundary points to interior points.
    pub(super) boundary_graph: Graph,
}

impl<T: Real> Input<T> {
    pub(crate) fn new(
        interior: &[[f64; 3]],
        boundary: &[[f64; 3]],
        boundary_uv: &[[f64; 2]],
        neighbours: Neighbours,
    ) -> Self {
        let (radius, cap) = reach(neighbours);
        let flat = |points: &[[f64; 3]]| -> Vec<f32> { points.iter().flatten().map(|&x| x as f32).collect() };
        let (inside, around) = (flat(interior), flat(boundary));
        // The limit counts for the boundary points: they choose whom they speak to.
        let spoken_to = radius_graph(&around, &inside, 3, radius, cap, false);
        let five = |(p, uv): (&[f64; 3], &[f64; 2])| [p[0], p[1], p[2], uv[0], uv[1]];
        Self {
            neighbours,
            interior: interior.iter().flatten().map(|&x| T::from_f64(x)).collect(),
            boundary: boundary.iter().zip(boundary_uv).flat_map(five).map(T::from_f64).collect(),
            interior_graph: radius_graph(&inside, &inside, 3, radius, cap, true),
            boundary_graph: spoken_to.reversed(interior.len()),
        }
    }

    /// Number of interior points.
    pub(crate) fn len(&self) -> usize {
        self.interior.len() / 3
    }
}

/// What the forward pass leaves for the backward pass.
#[derive(Debug)]
pub(crate) struct Tape<T> {
    interior: Messages<T>,
    boundary: Option<Messages<T>>,
    /// Outputs of the input layer and of the hidden layers.
    features: Vec<Vec<T>>,
    means: Vec<Vec<T>>,
    /// Of the hidden layers.
    pub(super) graphs: Vec<Graph>,
    first: Normalized<T>,
    second: Normalized<T>,
}

/// Sides of a message network: rows that the targets contribute to its first layer, and rows of the sources.
fn ends<T: Real>(slots: &MessageSlots, theta: &[T], targets: &[T], sources: &[T]) -> (Vec<T>, Vec<T>) {
    let weights = &theta[slots.first.clone()];
    let (own, other) = (own_matrix(&weights[..6 * WIDTH]), &weights[3 * WIDTH..]);
    (linear(targets, 3, &own), linear(sources, slots.inputs - 3, other))
}

/// Logits of the parameters of the interior points, two numbers each. `graphs` replaces the graphs of the hidden layers,
/// which otherwise follow from the features.
pub(crate) fn forward<T: Real>(
    layout: &Layout,
    theta: &[T],
    input: &Input<T>,
    graphs: Option<&[Graph]>,
) -> (Vec<T>, Tape<T>) {
    let n = input.len();
    let part = |range: &std::ops::Range<usize>| &theta[range.clone()];
    let (targets, sources) = ends(&layout.interior, theta, &input.interior, &input.interior);
    let interior = Messages::new(&input.interior_graph, targets, sources, part(&layout.interior.norm));
    let mut x = linear(&interior.means, WIDTH, part(&layout.interior.second));
    add_row(&mut x, part(&layout.interior.bias));
    let boundary = layout.boundary.as_ref().map(|slots| {
        let (targets, sources) = ends(slots, theta, &input.interior, &input.boundary);
        let messages = Messages::new(&input.boundary_graph, targets, sources, part(&slots.norm));
        add_linear(&mut x, &messages.means, WIDTH, part(&slots.second));
        for (i, row) in x.chunks_exact_mut(WIDTH).enumerate() {
            // Without a message there is no mean, so no bias either.
            if !input.boundary_graph.of(i).is_empty() {
                add_row(row, part(&slots.bias));
            }
        }
        messages
    });
    relu(&mut x);
    let (mut features, mut means, mut dynamic) = (vec![x], Vec::new(), Vec::new());
    for (k, slots) in layout.hidden.iter().enumerate() {
        let x = &features[k];
        let graph = match graphs {
            Some(graphs) => graphs[k].clone(),
            None => feature_graph(x, input.neighbours),
        };
        let mean = neighbour_means(&graph, x);
        let weights = part(&slots.weights);
        let mut y = linear(x, WIDTH, &own_matrix(weights));
        add_linear(&mut y, &mean, WIDTH, &weights[WIDTH * WIDTH..]);
        add_row(&mut y, part(&slots.bias));
        if k + 1 < HIDDEN {
            relu(&mut y);
        }
        means.push(mean);
        dynamic.push(graph);
        features.push(y);
    }
    let [one, two, three] = &layout.output;
    let mut y = zeros(n * (one.bias.len()));
    for (x, weights) in features.iter().zip(part(&one.weights).chunks_exact(WIDTH * one.bias.len())) {
        add_linear(&mut y, x, WIDTH, weights);
    }
    let first = Normalized::new(y, part(&one.norm));
    let second = Normalized::new(linear(&first.result, one.bias.len(), part(&two.weights)), part(&two.norm));
    let mut logits = linear(&second.result, two.bias.len(), part(&three.weights));
    add_row(&mut logits, part(&three.bias));
    (logits, Tape { interior, boundary, features, means, graphs: dynamic, first, second })
}

/// The graph of a hidden layer.
pub(super) fn feature_graph<T: Real>(x: &[T], neighbours: Neighbours) -> Graph {
    let (radius, cap) = reach(neighbours);
    let features = T::singles(x);
    radius_graph(&features, &features, WIDTH, radius, cap, true)
}

/// Gradient by all weights, from that of the logits; the graphs count as constant. Biases before a batch normalization
/// have gradient zero.
pub(crate) fn backward<T: Real>(
    layout: &Layout,
    theta: &[T],
    input: &Input<T>,
    tape: &Tape<T>,
    logit_gradient: &[T],
) -> Vec<T> {
    let mut gradient: Vec<T> = zeros(layout.len());
    let part = |range: &std::ops::Range<usize>| &theta[range.clone()];
    let [one, two, three] = &layout.output;
    let (width, inner) = (one.bias.len(), two.bias.len());
    add_column_sums(&mut gradient[three.bias.clone()], logit_gradient);
    add_weight_gradient(&mut gradient[three.weights.clone()], &tape.second.result, inner, logit_gradient);
    let dy = input_gradient(logit_gradient, inner, part(&three.weights));
    let dy = tape.second.backward(dy, part(&two.norm), &mut gradient[two.norm.clone()]);
    add_weight_gradient(&mut gradient[two.weights.clone()], &tape.first.result, width, &dy);
    let dy = input_gradient(&dy, width, part(&two.weights));
    let dy = tape.first.backward(dy, part(&one.norm), &mut gradient[one.norm.clone()]);
    let size = WIDTH * width;
    let mut dx = Vec::new();
    for (k, x) in tape.features.iter().enumerate() {
        let place = one.weights.start + k * size;
        add_weight_gradient(&mut gradient[place..place + size], x, WIDTH, &dy);
        dx.push(input_gradient(&dy, WIDTH, &theta[place..place + size]));
    }
    for (k, slots) in layout.hidden.iter().enumerate().rev() {
        let Some(mut dy) = dx.pop() else { break };
        if k + 1 < HIDDEN {
            relu_backward(&mut dy, &tape.features[k + 1]);
            add_column_sums(&mut gradient[slots.bias.clone()], &dy);
        }
        let weights = part(&slots.weights);
        let own = own_matrix(weights);
        let (mut for_own, mut for_neighbours) = (zeros(own.len()), zeros(own.len()));
        add_weight_gradient(&mut for_own, &tape.features[k], WIDTH, &dy);
        add_weight_gradient(&mut for_neighbours, &tape.means[k], WIDTH, &dy);
        add_edge_gradients(&mut gradient[slots.weights.clone()], &for_own, &for_neighbours);
        let through_own = input_gradient(&dy, WIDTH, &own);
        let through_means = input_gradient(&dy, WIDTH, &weights[own.len()..]);
        if let Some(dx) = dx.last_mut() {
            dx.iter_mut().zip(&through_own).for_each(|(d, t)| *d += *t);
            neighbour_means_backward(&tape.graphs[k], &through_means, dx);
        }
    }
    let Some(mut dy) = dx.pop() else { return gradient };
    relu_backward(&mut dy, &tape.features[0]);
    let network = |slots: &MessageSlots, graph: &Graph, tape: &Messages<T>, sources: &[T], dy: &[T], out: &mut [T]| {
        add_weight_gradient(&mut out[slots.second.clone()], &tape.means, WIDTH, dy);
        let for_means = input_gradient(dy, WIDTH, part(&slots.second));
        let (p, q) = tape.backward(graph, &for_means, part(&slots.norm), &mut out[slots.norm.clone()]);
        let (mut for_own, mut for_sources) = (zeros(3 * WIDTH), zeros((slots.inputs - 3) * WIDTH));
        add_weight_gradient(&mut for_own, &input.interior, 3, &p);
        add_weight_gradient(&mut for_sources, sources, slots.inputs - 3, &q);
        let out = &mut out[slots.first.clone()];
        let (edge, parameters) = out.split_at_mut(6 * WIDTH);
        add_edge_gradients(edge, &for_own, &for_sources[..3 * WIDTH]);
        parameters.iter_mut().zip(&for_sources[3 * WIDTH..]).for_each(|(o, g)| *o += *g);
    };
    network(&layout.interior, &input.interior_graph, &tape.interior, &input.interior, &dy, &mut gradient);
    add_column_sums(&mut gradient[layout.interior.bias.clone()], &dy);
    if let (Some(slots), Some(messages)) = (&layout.boundary, &tape.boundary) {
        network(slots, &input.boundary_graph, messages, &input.boundary, &dy, &mut gradient);
        for (i, row) in rows(&dy).iter().enumerate() {
            if !input.boundary_graph.of(i).is_empty() {
                add_column_sums(&mut gradient[slots.bias.clone()], row);
            }
        }
    }
    gradient
}

#[cfg(test)]
#[path = "network_tests.rs"]
mod tests;
