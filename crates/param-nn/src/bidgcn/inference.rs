//! The network without what a gradient would need: the same function as [`super::network::forward`], tile by tile.

use faer::MatRef;
use rayon::prelude::*;

use super::layers::{VARIANCE_FLOOR, WIDTH, own_matrix, rows};
use super::layout::{HIDDEN, Layout, MessageSlots};
use super::network::{Input, feature_graph};
use super::symmetry::Symmetry;
use crate::graph::Graph;
use crate::real::{add_product, matrix, product, vectorized};

/// Rows of a tile: with their 256 channels they stay in the cache from one layer to the next, and are enough for
/// products to be fast. Sums go over tiles first, so it enters into round-off.
const TILE: usize = 128;

/// Lengths of rows are multiples of it.
const LANES: usize = 16;

/// Memory that is used again from image to image: the system takes longer to give pages than the layers to fill them.
#[derive(Default)]
pub(super) struct Memory {
    interior_sources: Vec<f32>,
    boundary_sources: Vec<f32>,
    features: Vec<f32>,
    next: Vec<f32>,
    packed: Vec<f32>,
    channels: Vec<f32>,
}

/// The network reading one cloud.
pub(super) struct Inference<'a> {
    layout: &'a Layout,
    theta: &'a [f32],
    input: &'a Input<f32>,
    interior_moments: EdgeMoments,
    boundary_moments: EdgeMoments,
    /// Matrices that act on own rows in the hidden layers.
    own: Vec<Vec<f32>>,
}

impl<'a> Inference<'a> {
    pub(super) fn new(layout: &'a Layout, theta: &'a [f32], input: &'a Input<f32>) -> Self {
        let own = layout.hidden.iter().map(|slots| own_matrix(&theta[slots.weights.clone()])).collect();
        let interior_moments = EdgeMoments::new(&input.interior_graph, &input.interior, &input.interior, 3);
        let boundary_moments = EdgeMoments::new(&input.boundary_graph, &input.interior, &input.boundary, 5);
        Self { layout, theta, input, interior_moments, boundary_moments, own }
    }

    fn part(&self, range: &std::ops::Range<usize>) -> &'a [f32] {
        &self.theta[range.clone()]
    }

    /// Logits of the image of the cloud, two numbers a point, on the given graphs of the hidden layers. Without them they
    /// follow from the features, and are handed out.
    pub(super) fn logits(
        &self,
        symmetry: Symmetry,
        given: Option<&[Graph]>,
        memory: &mut Memory,
    ) -> (Vec<f32>, Vec<Graph>) {
        let n = self.input.len();
        let Memory { features, next, packed, channels, .. } = memory;
        let mut features = std::mem::take(features);
        let mut next = std::mem::take(next);
        let (mut packed, mut channels) = (std::mem::take(packed), std::mem::take(channels));
        let width = self.layout.output[0].bias.len();
        features.resize(n * WIDTH, 0.0);
        next.resize(n * WIDTH, 0.0);
        channels.resize(n * width, 0.0);
        let mut used = self.first_layer(symmetry, &mut features, memory);
        let (mut graphs, mut moments) = (Vec::new(), Vec::new());
        for k in 0..HIDDEN {
            if given.is_none() {
                graphs.push(feature_graph(&features, self.input.neighbours));
            }
            let graph = &given.unwrap_or(&graphs)[k];
            let layer = Hidden::new(self, k, &used);
            layer.pack(&features, &mut packed);
            let tiles: Vec<([u32; WIDTH], Moments)> = next
                .par_chunks_mut(TILE * WIDTH)
                .zip(channels.par_chunks_mut(TILE * width))
                .enumerate()
                .map_init(Vec::new, |scratch, (tile, (next, channels))| {
                    layer.tile(&packed, graph, tile * TILE, next, channels, scratch)
                })
                .collect();
            used = union(tiles.iter().map(|(used, _)| used));
            moments = tiles.into_iter().map(|(_, moments)| moments).collect();
            std::mem::swap(&mut features, &mut next);
        }
        let logits = self.output(&moments, &mut channels);
        (memory.features, memory.next, memory.packed, memory.channels) = (features, next, packed, channels);
        (logits, graphs)
    }

    /// The input layer; which bits its outputs use.
    fn first_layer(&self, symmetry: Symmetry, features: &mut [f32], memory: &mut Memory) -> [u32; WIDTH] {
        let Self { layout, input, .. } = self;
        let interior = MessageLayer::new(self, &layout.interior, &self.interior_moments, symmetry);
        interior.sources(&input.interior, &mut memory.interior_sources);
        let boundary = layout.boundary.as_ref().map(|slots| {
            let layer = MessageLayer::new(self, slots, &self.boundary_moments, symmetry);
            layer.sources(&input.boundary, &mut memory.boundary_sources);
            (layer, self.part(&slots.bias))
        });
        let (bias, memory) = (self.part(&layout.interior.bias), &*memory);
        let tile = |tile: usize, out: &mut [f32], room: &mut [Vec<f32>; 2]| {
            let start = tile * TILE;
            for row in out.chunks_exact_mut(WIDTH) {
                row.copy_from_slice(bias);
            }
            let points = &input.interior[3 * start..][..out.len() / WIDTH * 3];
            interior.add(&input.interior_graph, start, points, &memory.interior_sources, room, out);
            if let Some((layer, bias)) = &boundary {
                layer.add(&input.boundary_graph, start, points, &memory.boundary_sources, room, out);
                for (i, row) in out.chunks_exact_mut(WIDTH).enumerate() {
                    // Without a message there is no mean, so no bias either.
                    if !input.boundary_graph.of(start + i).is_empty() {
                        row.iter_mut().zip(*bias).for_each(|(x, b)| *x += b);
                    }
                }
            }
            relu_used(out)
        };
        let used: Vec<[u32; WIDTH]> = features
            .par_chunks_mut(TILE * WIDTH)
            .enumerate()
            .map_init(Default::default, |scratch, (index, out)| tile(index, out, scratch))
            .collect();
        union(used.iter())
    }

    /// The output network, from its first layer before the normalization.
    fn output(&self, moments: &[Moments], channels: &mut [f32]) -> Vec<f32> {
        let [one, two, three] = &self.layout.output;
        let (width, inner) = (one.bias.len(), two.bias.len());
        debug_assert_eq!(width, inner, "the second layer takes the place of the first one");
        let first = Affine::new(moments, self.part(&one.norm));
        let weights: MatRef<'_, f32> = matrix(self.part(&two.weights), inner);
        let moments: Vec<Moments> = channels
            .par_chunks_mut(TILE * width)
            .map_init(Vec::new, |scratch, tile| {
                scratch.resize(tile.len(), 0.0);
                first.relu(tile, scratch);
                product(tile, matrix(scratch, width), weights);
                Moments::new(tile, inner)
            })
            .collect();
        let second = Affine::new(&moments, self.part(&two.norm));
        let (weights, bias) = (self.part(&three.weights), self.part(&three.bias));
        let mut logits = vec![0.0; channels.len() / inner * 2];
        channels.par_chunks(TILE * inner).zip(logits.par_chunks_mut(TILE * 2)).for_each_init(
            Vec::new,
            |scratch, (tile, logits)| {
                scratch.resize(tile.len(), 0.0);
                second.relu(tile, scratch);
                product(logits, matrix(scratch, inner), matrix(weights, 2));
                logits.chunks_exact_mut(2).for_each(|pair| (0..2).for_each(|k| pair[k] += bias[k]));
            },
        );
        logits
    }
}

/// Bits that are used in any of the rows.
fn union<'a>(parts: impl Iterator<Item = &'a [u32; WIDTH]>) -> [u32; WIDTH] {
    parts.fold([0; WIDTH], |all, part| std::array::from_fn(|k| all[k] | part[k]))
}

/// Cuts off what is negative, and says which bits are used in each column.
fn relu_used(x: &mut [f32]) -> [u32; WIDTH] {
    let mut used = [0; WIDTH];
    vectorized(
        #[inline(always)]
        || {
            for row in x.as_chunks_mut::<WIDTH>().0 {
                for k in 0..WIDTH {
                    row[k] = if row[k] > 0.0 { row[k] } else { 0.0 };
                    used[k] |= row[k].to_bits();
                }
            }
        },
    );
    used
}

/// Most coordinates of a source: those of a boundary point and its parameters.
const WIDEST: usize = 5;

/// Mean and covariance over the edges of what they connect: the coordinates of target and source, side by side. The
/// first layer of the messages is linear in them, so mean and variance of all its channels follow.
struct EdgeMoments {
    mean: Vec<f64>,
    /// Row-major.
    covariance: Vec<f64>,
}

impl EdgeMoments {
    /// Targets have three coordinates, sources `inputs`.
    fn new(graph: &Graph, targets: &[f32], sources: &[f32], inputs: usize) -> Self {
        let size = 3 + inputs;
        let share = 1.0 / graph.edges().max(1) as f64;
        let source = |j: u32| &sources[j as usize * inputs..][..inputs];
        let target = |i: usize| &targets[3 * i..][..3];
        // How often each point is a source; what is added up is a row of a point times the number of its edges.
        let mut uses = vec![0u32; sources.len() / inputs];
        graph.sources.iter().for_each(|&j| uses[j as usize] += 1);
        let mut mean = vec![0.0; size];
        let mut add = |first: usize, row: &[f32], count: usize| {
            mean[first..].iter_mut().zip(row).for_each(|(m, x)| *m += count as f64 * share * f64::from(*x));
        };
        (0..graph.targets()).for_each(|i| add(0, target(i), graph.of(i).len()));
        uses.iter().zip(0..).for_each(|(count, j)| add(3, source(j), *count as usize));
        let mut covariance = vec![0.0; size * size];
        let mut add = |first: [usize; 2], a: &[f64], b: &[f64], factor: f64| {
            for (row, a) in covariance.chunks_exact_mut(size).skip(first[0]).zip(a) {
                row[first[1]..].iter_mut().zip(b).for_each(|(c, b)| *c += factor * a * b);
            }
        };
        let centered = |row: &[f32], first: usize| -> [f64; WIDEST] {
            std::array::from_fn(|k| row.get(k).map_or(0.0, |x| f64::from(*x) - mean[first + k]))
        };
        for i in 0..graph.targets() {
            let target = centered(target(i), 0);
            let mut sum = [0.0; WIDEST];
            for &j in graph.of(i) {
                sum.iter_mut().zip(source(j)).zip(&mean[3..]).for_each(|((s, x), m)| *s += f64::from(*x) - m);
            }
            add([0, 0], &target[..3], &target[..3], share * graph.of(i).len() as f64);
            add([0, 3], &target[..3], &sum[..inputs], share);
            add([3, 0], &sum[..inputs], &target[..3], share);
        }
        for (count, j) in uses.iter().zip(0..) {
            let source = centered(source(j), 3);
            add([3, 3], &source[..inputs], &source[..inputs], share * f64::from(*count));
        }
        Self { mean, covariance }
    }
}

/// One of the two networks of the input layer, its normalization made part of the first linear map.
struct MessageLayer<'a> {
    /// From targets and from sources to the channels.
    targets: Vec<f32>,
    sources: Vec<f32>,
    shift: [f32; WIDTH],
    second: &'a [f32],
}

impl<'a> MessageLayer<'a> {
    fn new(network: &Inference<'a>, slots: &MessageSlots, moments: &EdgeMoments, symmetry: Symmetry) -> Self {
        let first = network.part(&slots.first);
        let mut targets = own_matrix(&first[..6 * WIDTH]);
        let mut sources = first[3 * WIDTH..].to_vec();
        symmetry.pull_back(&mut targets);
        symmetry.pull_back(&mut sources);
        let affine = network.part(&slots.norm);
        let size = moments.mean.len();
        let mut shift = [0.0; WIDTH];
        for k in 0..WIDTH {
            let column: Vec<f64> =
                targets.iter().chain(&sources).skip(k).step_by(WIDTH).map(|&w| f64::from(w)).collect();
            let dot = |row: &[f64]| row.iter().zip(&column).map(|(a, b)| a * b).sum::<f64>();
            let products: Vec<f64> = moments.covariance.chunks_exact(size).map(dot).collect();
            let scale = f64::from(affine[k]) / (dot(&products).max(0.0) + VARIANCE_FLOOR).sqrt();
            shift[k] = (f64::from(affine[WIDTH + k]) - scale * dot(&moments.mean)) as f32;
            for w in targets.iter_mut().chain(&mut sources).skip(k).step_by(WIDTH) {
                *w = (f64::from(*w) * scale) as f32;
            }
        }
        Self { targets, sources, shift, second: network.part(&slots.second) }
    }

    fn sources(&self, sources: &[f32], out: &mut Vec<f32>) {
        let inputs = self.sources.len() / WIDTH;
        out.resize(sources.len() / inputs * WIDTH, 0.0);
        product(out, matrix(sources, inputs), matrix(&self.sources, WIDTH));
    }

    /// Adds the mean messages to the rows of a tile, after the second linear map. `targets` and `means` are
    /// room for them.
    fn add(
        &self,
        graph: &Graph,
        start: usize,
        points: &[f32],
        sources: &[f32],
        [targets, means]: &mut [Vec<f32>; 2],
        out: &mut [f32],
    ) {
        targets.resize(out.len(), 0.0);
        means.resize(out.len(), 0.0);
        product(targets, matrix(points, 3), matrix(&self.targets, WIDTH));
        vectorized(
            #[inline(always)]
            || {
                let sources = rows(sources);
                for (i, (own, mean)) in rows(targets).iter().zip(means.as_chunks_mut::<WIDTH>().0).enumerate() {
                    let around = graph.of(start + i);
                    let own: [f32; WIDTH] = std::array::from_fn(|k| own[k] + self.shift[k]);
                    let mut sum = [0.0f32; WIDTH];
                    for &j in around {
                        let other = &sources[j as usize];
                        for k in 0..WIDTH {
                            let y = own[k] + other[k];
                            sum[k] += if y > 0.0 { y } else { 0.0 };
                        }
                    }
                    let share = 1.0 / around.len().max(1) as f32;
                    for k in 0..WIDTH {
                        mean[k] = sum[k] * share;
                    }
                }
            },
        );
        add_product(out, matrix(means, WIDTH), matrix(self.second, WIDTH));
    }
}

/// A hidden layer on the columns that are not zero in all points: after training, most are.
struct Hidden<'a> {
    network: &'a Inference<'a>,
    columns: Vec<usize>,
    /// Their number, filled up.
    width: usize,
    /// Rows for own features, then those for means of neighbours.
    weights: Vec<f32>,
    bias: &'a [f32],
    /// Rows of the first output layer for these features.
    output: Vec<f32>,
    index: usize,
}

impl<'a> Hidden<'a> {
    fn new(network: &'a Inference<'a>, index: usize, used: &[u32; WIDTH]) -> Self {
        let columns: Vec<usize> = (0..WIDTH).filter(|&k| used[k] != 0).collect();
        let width = columns.len().max(1).next_multiple_of(LANES);
        let slots = &network.layout.hidden[index];
        let (own, all) = (&network.own[index], network.part(&slots.weights));
        let select = |weights: &[f32], outputs: usize| {
            let mut rows = Vec::with_capacity(width * outputs);
            columns.iter().for_each(|&k| rows.extend_from_slice(&weights[k * outputs..][..outputs]));
            rows.resize(width * outputs, 0.0);
            rows
        };
        let mut weights = select(own, WIDTH);
        weights.extend(select(&all[WIDTH * WIDTH..], WIDTH));
        let outputs = network.layout.output[0].bias.len();
        let output = select(network.output_rows(index), outputs);
        Self { network, columns, width, weights, bias: network.part(&slots.bias), output, index }
    }

    fn pack(&self, features: &[f32], packed: &mut Vec<f32>) {
        packed.clear();
        packed.resize(features.len() / WIDTH * self.width, 0.0);
        for (row, out) in rows(features).iter().zip(packed.chunks_exact_mut(self.width)) {
            out.iter_mut().zip(&self.columns).for_each(|(x, &k)| *x = row[k]);
        }
    }

    /// The rows of a tile, and their part in the output network; the bits they use, and the moments of that.
    fn tile(
        &self,
        packed: &[f32],
        graph: &Graph,
        start: usize,
        next: &mut [f32],
        channels: &mut [f32],
        scratch: &mut Vec<f32>,
    ) -> ([u32; WIDTH], Moments) {
        let (width, last) = (self.width, self.index + 1 == HIDDEN);
        scratch.resize(next.len() / WIDTH * 2 * width, 0.0);
        vectorized(
            #[inline(always)]
            || match width / LANES {
                1 => own_and_means::<1>(packed, graph, start, scratch),
                2 => own_and_means::<2>(packed, graph, start, scratch),
                3 => own_and_means::<3>(packed, graph, start, scratch),
                _ => own_and_means::<4>(packed, graph, start, scratch),
            },
        );
        let both = matrix(scratch, 2 * width);
        next.chunks_exact_mut(WIDTH).for_each(|row| row.copy_from_slice(self.bias));
        add_product(next, both, matrix(&self.weights, WIDTH));
        let used = if last { [0; WIDTH] } else { relu_used(next) };
        let outputs = self.output.len() / width;
        let (own, weights) = (both.subcols(0, width), matrix(&self.output, outputs));
        match self.index {
            0 => product(channels, own, weights),
            _ => add_product(channels, own, weights),
        }
        if !last {
            return (used, Moments::default());
        }
        add_product(channels, matrix(next, WIDTH), matrix(self.network.output_rows(HIDDEN), outputs));
        (used, Moments::new(channels, outputs))
    }
}

/// Rows of points and means of the rows of their neighbours, side by side.
#[inline(always)]
fn own_and_means<const CHUNKS: usize>(packed: &[f32], graph: &Graph, start: usize, out: &mut [f32]) {
    let rows = packed.as_chunks::<LANES>().0.as_chunks::<CHUNKS>().0;
    let out = out.as_chunks_mut::<LANES>().0.as_chunks_mut::<CHUNKS>().0;
    for (i, pair) in out.chunks_exact_mut(2).enumerate() {
        let around = graph.of(start + i);
        let mut sum = [[0.0f32; LANES]; CHUNKS];
        for &j in around {
            let row = &rows[j as usize];
            for c in 0..CHUNKS {
                for k in 0..LANES {
                    sum[c][k] += row[c][k];
                }
            }
        }
        let share = 1.0 / around.len().max(1) as f32;
        pair[0] = rows[start + i];
        for c in 0..CHUNKS {
            for k in 0..LANES {
                pair[1][c][k] = sum[c][k] * share;
            }
        }
    }
}

impl<'a> Inference<'a> {
    /// The rows of the first output layer that the features of a layer meet.
    fn output_rows(&self, index: usize) -> &'a [f32] {
        let one = &self.layout.output[0];
        let size = WIDTH * one.bias.len();
        &self.part(&one.weights)[index * size..][..size]
    }
}

/// Means of the columns of a tile, and sums of the squared deviations from them.
#[derive(Default)]
struct Moments {
    count: usize,
    means: Vec<f32>,
    squares: Vec<f32>,
}

impl Moments {
    fn new(tile: &[f32], width: usize) -> Self {
        let count = tile.len() / width;
        let share = 1.0 / count.max(1) as f32;
        let (mut means, mut squares) = (vec![0.0; width], vec![0.0; width]);
        vectorized(
            #[inline(always)]
            || {
                for row in tile.chunks_exact(width) {
                    means.iter_mut().zip(row).for_each(|(m, x)| *m += *x);
                }
                means.iter_mut().for_each(|m| *m *= share);
                for row in tile.chunks_exact(width) {
                    squares.iter_mut().zip(row.iter().zip(&means)).for_each(|(s, (x, m))| *s += (x - m) * (x - m));
                }
            },
        );
        Self { count, means, squares }
    }
}

/// Batch normalization as `scale x + shift`.
struct Affine {
    scale: Vec<f32>,
    shift: Vec<f32>,
}

impl Affine {
    /// From the moments of all tiles, and γ and β.
    fn new(tiles: &[Moments], affine: &[f32]) -> Self {
        let (gamma, beta) = affine.split_at(affine.len() / 2);
        let share = 1.0 / tiles.iter().map(|tile| tile.count).sum::<usize>().max(1) as f64;
        let column = |k: usize| {
            let mean = tiles.iter().map(|t| t.count as f64 * f64::from(t.means[k])).sum::<f64>() * share;
            let spread =
                |t: &Moments| f64::from(t.squares[k]) + t.count as f64 * (f64::from(t.means[k]) - mean).powi(2);
            let variance = tiles.iter().map(spread).sum::<f64>() * share;
            let scale = f64::from(gamma[k]) / (variance + VARIANCE_FLOOR).sqrt();
            (scale as f32, (f64::from(beta[k]) - scale * mean) as f32)
        };
        let (scale, shift) = (0..gamma.len()).map(column).unzip();
        Self { scale, shift }
    }

    fn relu(&self, x: &[f32], out: &mut [f32]) {
        vectorized(
            #[inline(always)]
            || {
                let width = self.scale.len();
                for (row, out) in x.chunks_exact(width).zip(out.chunks_exact_mut(width)) {
                    let affine = self.scale.iter().zip(&self.shift);
                    for ((y, x), (scale, shift)) in out.iter_mut().zip(row).zip(affine) {
                        let value = scale * x + shift;
                        *y = if value > 0.0 { value } else { 0.0 };
                    }
                }
            },
        );
    }
}

#[cfg(test)]
#[path = "inference_tests.rs"]
mod tests;
