//! Layers with closed-form derivatives: linear maps, batch normalization, means over neighbours and over messages.

use faer::MatRef;

use crate::graph::Graph;
use crate::real::{Real, add_product, matrix, product, vectorized};

/// Channels of every hidden layer.
pub(super) const WIDTH: usize = 64;

/// Added to a variance before its root is divided by; PyTorch's default, which the published network has.
pub(super) const VARIANCE_FLOOR: f64 = 1e-5;

pub(super) fn rows<T>(x: &[T]) -> &[[T; WIDTH]] {
    x.as_chunks().0
}

fn rows_mut<T>(x: &mut [T]) -> &mut [[T; WIDTH]] {
    x.as_chunks_mut().0
}

pub(crate) fn zeros<T: Real>(count: usize) -> Vec<T> {
    vec![T::from_f64(0.0); count]
}

/// Adds a row to every row.
pub(crate) fn add_row<T: Real>(x: &mut [T], row: &[T]) {
    vectorized(
        #[inline(always)]
        || x.chunks_exact_mut(row.len()).for_each(|x| x.iter_mut().zip(row).for_each(|(x, r)| *x += *r)),
    );
}

/// Adds the sum of all rows to `sums`.
pub(crate) fn add_column_sums<T: Real>(sums: &mut [T], x: &[T]) {
    vectorized(
        #[inline(always)]
        || x.chunks_exact(sums.len()).for_each(|x| sums.iter_mut().zip(x).for_each(|(s, x)| *s += *x)),
    );
}

/// Negative numbers become zero.
pub(crate) fn relu<T: Real>(x: &mut [T]) {
    let zero = T::from_f64(0.0);
    vectorized(
        #[inline(always)]
        || x.iter_mut().for_each(|x| *x = if *x > zero { *x } else { zero }),
    );
}

/// Gradients pass where the result was positive.
pub(crate) fn relu_backward<T: Real>(gradient: &mut [T], result: &[T]) {
    let zero = T::from_f64(0.0);
    vectorized(
        #[inline(always)]
        || gradient.iter_mut().zip(result).for_each(|(g, x)| *g = if *x > zero { *g } else { zero }),
    );
}

/// Means of the sources' rows over the edges of each target; zero where there are none.
pub(super) fn neighbour_means<T: Real>(graph: &Graph, x: &[T]) -> Vec<T> {
    let mut means = zeros(graph.targets() * WIDTH);
    vectorized(
        #[inline(always)]
        || {
            let x = rows(x);
            for (i, mean) in rows_mut(&mut means).iter_mut().enumerate() {
                let around = graph.of(i);
                let mut sum = [T::from_f64(0.0); WIDTH];
                for &j in around {
                    let row = &x[j as usize];
                    for k in 0..WIDTH {
                        sum[k] += row[k];
                    }
                }
                let share = T::from_f64(1.0 / around.len().max(1) as f64);
                for k in 0..WIDTH {
                    mean[k] = sum[k] * share;
                }
            }
        },
    );
    means
}

/// The adjoint of [`neighbour_means`]: adds to the gradient of the sources.
pub(super) fn neighbour_means_backward<T: Real>(graph: &Graph, mean_gradient: &[T], gradient: &mut [T]) {
    vectorized(
        #[inline(always)]
        || {
            let gradient = rows_mut(gradient);
            for (i, given) in rows(mean_gradient).iter().enumerate() {
                let around = graph.of(i);
                let share = T::from_f64(1.0 / around.len().max(1) as f64);
                let given: [T; WIDTH] = std::array::from_fn(|k| given[k] * share);
                for &j in around {
                    let row = &mut gradient[j as usize];
                    for k in 0..WIDTH {
                        row[k] += given[k];
                    }
                }
            }
        },
    );
}

/// `W₁ − W₂`, the two halves of an edge layer's matrix: what acts on a point's own row once the message
/// `W₁ x_i + W₂ (x_j − x_i)` is pulled apart.
pub(super) fn own_matrix<T: Real>(weights: &[T]) -> Vec<T> {
    let (first, second) = weights.split_at(weights.len() / 2);
    first.iter().zip(second).map(|(a, b)| *a - *b).collect()
}

/// Gradients of both halves from those of the own matrix and of the neighbours' matrix.
pub(super) fn add_edge_gradients<T: Real>(gradient: &mut [T], own: &[T], neighbours: &[T]) {
    let (first, second) = gradient.split_at_mut(own.len());
    first.iter_mut().zip(own).for_each(|(g, o)| *g += *o);
    for (g, (o, n)) in second.iter_mut().zip(own.iter().zip(neighbours)) {
        *g += *n - *o;
    }
}

/// Batch normalization with the statistics of the rows at hand, then ReLU.
#[derive(Debug)]
pub(crate) struct Normalized<T> {
    /// Rows with mean 0 and variance 1.
    normal: Vec<T>,
    inverse_deviation: Vec<T>,
    /// `relu(γ x + β)`.
    pub(crate) result: Vec<T>,
}

impl<T: Real> Normalized<T> {
    /// `affine` holds γ, then β; its half length is the number of channels.
    pub(crate) fn new(mut x: Vec<T>, affine: &[T]) -> Self {
        let width = affine.len() / 2;
        let (gamma, beta) = affine.split_at(width);
        let share = T::from_f64(width as f64 / x.len().max(1) as f64);
        let mut mean = zeros(width);
        add_column_sums(&mut mean, &x);
        mean.iter_mut().for_each(|m| *m = T::from_f64(0.0) - *m * share);
        add_row(&mut x, &mean);
        let mut variance: Vec<T> = zeros(width);
        let mut result = zeros(x.len());
        let mut inverse_deviation = zeros(width);
        vectorized(
            #[inline(always)]
            || {
                for row in x.chunks_exact(width) {
                    variance.iter_mut().zip(row).for_each(|(v, x)| *v += *x * *x);
                }
                for (inverse, v) in inverse_deviation.iter_mut().zip(&variance) {
                    let floored: T = *v * share + T::from_f64(VARIANCE_FLOOR);
                    *inverse = T::from_f64(1.0) / floored.root();
                }
                let zero = T::from_f64(0.0);
                for (row, out) in x.chunks_exact_mut(width).zip(result.chunks_exact_mut(width)) {
                    // PERF: zipped, since indices of slices would be checked one by one.
                    let affine = inverse_deviation.iter().zip(gamma.iter().zip(beta));
                    for ((x, y), (inverse, (gamma, beta))) in row.iter_mut().zip(out).zip(affine) {
                        *x *= *inverse;
                        let value = *gamma * *x + *beta;
                        *y = if value > zero { value } else { zero };
                    }
                }
            },
        );
        Self { normal: x, inverse_deviation, result }
    }

    /// Gradient of the input from that of the result; adds to that of γ and β.
    pub(crate) fn backward(&self, mut gradient: Vec<T>, affine: &[T], affine_gradient: &mut [T]) -> Vec<T> {
        relu_backward(&mut gradient, &self.result);
        let width = affine.len() / 2;
        let share = T::from_f64(width as f64 / gradient.len().max(1) as f64);
        let (mut for_gamma, mut for_beta) = (zeros::<T>(width), zeros::<T>(width));
        vectorized(
            #[inline(always)]
            || {
                for (g, x) in gradient.chunks_exact(width).zip(self.normal.chunks_exact(width)) {
                    let sums = for_gamma.iter_mut().zip(&mut for_beta);
                    for ((gamma, beta), (g, x)) in sums.zip(g.iter().zip(x)) {
                        *gamma += *g * *x;
                        *beta += *g;
                    }
                }
                for (g, x) in gradient.chunks_exact_mut(width).zip(self.normal.chunks_exact(width)) {
                    let factors = affine.iter().zip(&self.inverse_deviation).zip(for_beta.iter().zip(&for_gamma));
                    for ((g, x), ((gamma, inverse), (beta_sum, gamma_sum))) in g.iter_mut().zip(x).zip(factors) {
                        *g = *gamma * *inverse * (*g - share * (*beta_sum + *x * *gamma_sum));
                    }
                }
            },
        );
        affine_gradient.iter_mut().zip(for_gamma.iter().chain(&for_beta)).for_each(|(a, g)| *a += *g);
        gradient
    }
}

/// Means over each target's edges of `relu(batch_norm(p_target + q_source))`, the statistics over all edges: the first
/// layer of an edge network, pulled apart into a row of each target and one of each source.
#[derive(Debug)]
pub(super) struct Messages<T> {
    /// Rows of targets and sources, moved and scaled so that their sums have mean 0 and variance 1 over the edges.
    targets: Vec<T>,
    sources: Vec<T>,
    inverse_deviation: Vec<T>,
    /// Means of the messages, a row a target.
    pub(super) means: Vec<T>,
}

impl<T: Real> Messages<T> {
    pub(super) fn new(graph: &Graph, mut targets: Vec<T>, mut sources: Vec<T>, affine: &[T]) -> Self {
        let share = T::from_f64(1.0 / graph.edges().max(1) as f64);
        let zero = T::from_f64(0.0);
        let mut mean = [zero; WIDTH];
        let mut variance = [zero; WIDTH];
        let mut inverse = [zero; WIDTH];
        let mut means = zeros(targets.len());
        let (gamma, beta) = (&rows(affine)[0], &rows(affine)[1]);
        vectorized(
            #[inline(always)]
            || {
                {
                    let (p, q) = (rows(&targets), rows(&sources));
                    for (i, p) in p.iter().enumerate() {
                        let around = graph.of(i);
                        let count = T::from_f64(around.len() as f64);
                        let mut sum: [T; WIDTH] = std::array::from_fn(|k| count * p[k]);
                        for &j in around {
                            let q = &q[j as usize];
                            for k in 0..WIDTH {
                                sum[k] += q[k];
                            }
                        }
                        for k in 0..WIDTH {
                            mean[k] += sum[k] * share;
                        }
                    }
                }
                for p in rows_mut(&mut targets) {
                    for k in 0..WIDTH {
                        p[k] -= mean[k];
                    }
                }
                let (p, q) = (rows(&targets), rows(&sources));
                for (i, p) in p.iter().enumerate() {
                    let mut sum = [zero; WIDTH];
                    for &j in graph.of(i) {
                        let q = &q[j as usize];
                        for k in 0..WIDTH {
                            let h = p[k] + q[k];
                            sum[k] += h * h;
                        }
                    }
                    for k in 0..WIDTH {
                        variance[k] += sum[k] * share;
                    }
                }
                for k in 0..WIDTH {
                    let floored: T = variance[k] + T::from_f64(VARIANCE_FLOOR);
                    inverse[k] = T::from_f64(1.0) / floored.root();
                }
                for row in rows_mut(&mut targets).iter_mut().chain(rows_mut(&mut sources)) {
                    for k in 0..WIDTH {
                        row[k] *= inverse[k];
                    }
                }
                let (p, q) = (rows(&targets), rows(&sources));
                for (i, out) in rows_mut(&mut means).iter_mut().enumerate() {
                    let around = graph.of(i);
                    let own: [T; WIDTH] = std::array::from_fn(|k| gamma[k] * p[i][k] + beta[k]);
                    let mut sum = [zero; WIDTH];
                    for &j in around {
                        let q = &q[j as usize];
                        for k in 0..WIDTH {
                            let y = own[k] + gamma[k] * q[k];
                            sum[k] += if y > zero { y } else { zero };
                        }
                    }
                    let share = T::from_f64(1.0 / around.len().max(1) as f64);
                    for k in 0..WIDTH {
                        out[k] = sum[k] * share;
                    }
                }
            },
        );
        Self { targets, sources, inverse_deviation: inverse.to_vec(), means }
    }

    /// Gradients of the targets' and the sources' rows from that of the means; adds to that of γ and β.
    pub(super) fn backward(
        &self,
        graph: &Graph,
        mean_gradient: &[T],
        affine: &[T],
        affine_gradient: &mut [T],
    ) -> (Vec<T>, Vec<T>) {
        let zero = T::from_f64(0.0);
        let share = T::from_f64(1.0 / graph.edges().max(1) as f64);
        let (gamma, beta) = (&rows(affine)[0], &rows(affine)[1]);
        let (p, q) = (rows(&self.targets), rows(&self.sources));
        let (mut for_gamma, mut for_beta) = ([zero; WIDTH], [zero; WIDTH]);
        let (mut for_targets, mut for_sources) = (zeros(self.targets.len()), zeros(self.sources.len()));
        vectorized(
            #[inline(always)]
            || {
                let given = rows(mean_gradient);
                for (i, given) in given.iter().enumerate() {
                    let around = graph.of(i);
                    let part = T::from_f64(1.0 / around.len().max(1) as f64);
                    let given: [T; WIDTH] = std::array::from_fn(|k| given[k] * part);
                    let (mut gamma_sum, mut beta_sum) = ([zero; WIDTH], [zero; WIDTH]);
                    for &j in around {
                        let q = &q[j as usize];
                        for k in 0..WIDTH {
                            let h = p[i][k] + q[k];
                            let g = if gamma[k] * h + beta[k] > zero { given[k] } else { zero };
                            gamma_sum[k] += g * h;
                            beta_sum[k] += g;
                        }
                    }
                    for k in 0..WIDTH {
                        for_gamma[k] += gamma_sum[k];
                        for_beta[k] += beta_sum[k];
                    }
                }
                let inverse = &rows(&self.inverse_deviation)[0];
                let factor: [T; WIDTH] = std::array::from_fn(|k| gamma[k] * inverse[k]);
                let level: [T; WIDTH] = std::array::from_fn(|k| share * for_beta[k]);
                let slope: [T; WIDTH] = std::array::from_fn(|k| share * for_gamma[k]);
                let for_sources = rows_mut(&mut for_sources);
                for (i, own) in rows_mut(&mut for_targets).iter_mut().enumerate() {
                    let around = graph.of(i);
                    let part = T::from_f64(1.0 / around.len().max(1) as f64);
                    let given: [T; WIDTH] = std::array::from_fn(|k| given[i][k] * part);
                    for &j in around {
                        let (q, other) = (&q[j as usize], &mut for_sources[j as usize]);
                        for k in 0..WIDTH {
                            let h = p[i][k] + q[k];
                            let g = if gamma[k] * h + beta[k] > zero { given[k] } else { zero };
                            let d = factor[k] * (g - level[k] - slope[k] * h);
                            own[k] += d;
                            other[k] += d;
                        }
                    }
                }
            },
        );
        affine_gradient.iter_mut().zip(for_gamma.iter().chain(&for_beta)).for_each(|(a, g)| *a += *g);
        (for_targets, for_sources)
    }
}

/// `x W` for rows of `inputs` numbers.
pub(crate) fn linear<T: Real>(x: &[T], inputs: usize, weights: &[T]) -> Vec<T> {
    let outputs = weights.len() / inputs;
    let mut y = zeros(x.len() / inputs * outputs);
    product(&mut y, matrix(x, inputs), matrix(weights, outputs));
    y
}

/// `y += x W`.
pub(crate) fn add_linear<T: Real>(y: &mut [T], x: &[T], inputs: usize, weights: &[T]) {
    add_product(y, matrix(x, inputs), matrix(weights, weights.len() / inputs));
}

/// `gradient += xᵀ dy`, the gradient of W in `x W`.
pub(crate) fn add_weight_gradient<T: Real>(gradient: &mut [T], x: &[T], inputs: usize, dy: &[T]) {
    add_product(gradient, matrix(x, inputs).transpose(), matrix(dy, gradient.len() / inputs));
}

/// `dy Wᵀ`, the gradient of x in `x W`.
pub(crate) fn input_gradient<T: Real>(dy: &[T], inputs: usize, weights: &[T]) -> Vec<T> {
    let weights: MatRef<'_, T> = matrix(weights, weights.len() / inputs);
    let mut dx = zeros(dy.len() / weights.ncols() * inputs);
    product(&mut dx, matrix(dy, weights.ncols()), weights.transpose());
    dx
}
