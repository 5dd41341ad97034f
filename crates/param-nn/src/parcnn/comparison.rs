//! The networks that PARCNN is compared with (Imperatore 2024, §4.1.5 and Table 4.1), for plane sequences.

use std::sync::Mutex;

use candle_core::{CpuStorage, CustomOp1, D, Device, Error, IndexOp, Result, Shape, Tensor};
use candle_nn::ops::softmax;
use rand::RngExt;

use super::pass::Task;
use crate::synthetic::stream;

/// Points of the plane.
const PLANE: usize = 2;

/// Hidden units of the MLP, and hidden layers between its first and its last layer.
const MLP_WIDTH: usize = 100;
const MLP_HIDDEN: usize = 5;

/// Encoder layers of the transformer, and width of their inner layers.
const ENCODERS: usize = 6;
const INNER: usize = 2048;

/// Channels of the residual network.
const CHANNELS: usize = 75;

/// Width and residual blocks of the PPN-like network, three layers a block; the text states the number of weights only.
const PPN_WIDTH: usize = 42;
const PPN_BLOCKS: usize = 10;
const PPN_DEPTH: usize = 3;

/// Added to a variance before its root is divided by, as in PyTorch.
const VARIANCE_FLOOR: f64 = 1e-5;

/// Stream of the random initial weights.
const WEIGHT_STREAM: u64 = u64::MAX;

/// The architectures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ComparisonNetwork {
    /// Seven fully connected layers of 100 units.
    Mlp,
    /// Six encoder layers on edges as words of two numbers, a convolution behind them. The normalization
    /// of two numbers leaves their order only, so what it reads is two kinds of words at most: parameters stay uniform, and
    /// the printed errors are those of uniform parameters.
    Transformer,
    /// Three convolutions of up to 75 channels, each with batch normalization, ReLU and a skip connection.
    Residual,
    /// Fully connected with residual blocks, as the parameterization network for polynomial curves of Scholz and Jüttler
    /// (2021); longer sequences are cut into windows.
    Ppn,
}

/// A tensor of weights: shape, and inputs of its layer (0: ones, as of a normalization).
type Weight = (Vec<usize>, usize);

impl ComparisonNetwork {
    /// Tensors in the order in which [`ComparisonNetwork::logits`] takes them.
    fn tensors(self, degree: usize) -> Vec<Weight> {
        let edges = 2 * degree;
        let kernel = 2 * degree + 1;
        let mut tensors: Vec<Weight> = Vec::new();
        let mut linear = |inputs: usize, outputs: usize| {
            tensors.push((vec![inputs, outputs], inputs));
            tensors.push((vec![1, outputs], inputs));
        };
        match self {
            Self::Mlp => {
                linear(PLANE * edges, MLP_WIDTH);
                (0..MLP_HIDDEN).for_each(|_| linear(MLP_WIDTH, MLP_WIDTH));
                linear(MLP_WIDTH, edges + 1);
            }
            Self::Transformer => {
                for _ in 0..ENCODERS {
                    linear(PLANE, 3 * PLANE);
                    linear(PLANE, PLANE);
                    linear(PLANE, INNER);
                    linear(INNER, PLANE);
                }
                linear(kernel * PLANE, 1);
                // Scale and shift of the two normalizations of each layer.
                (0..2 * ENCODERS).for_each(|_| {
                    tensors.push((vec![1, PLANE], 0));
                    tensors.push((vec![1, PLANE], usize::MAX));
                });
            }
            Self::Residual => {
                linear(kernel * PLANE, CHANNELS);
                linear(kernel * CHANNELS, CHANNELS);
                linear(kernel * CHANNELS, 1);
                linear(PLANE, CHANNELS);
                linear(CHANNELS, 1);
                for width in [CHANNELS, CHANNELS, 1] {
                    tensors.push((vec![1, width], 0));
                    tensors.push((vec![1, width], usize::MAX));
                }
            }
            Self::Ppn => {
                linear(PLANE * edges, PPN_WIDTH);
                (0..PPN_BLOCKS * PPN_DEPTH).for_each(|_| linear(PPN_WIDTH, PPN_WIDTH));
                linear(PPN_WIDTH, edges);
            }
        }
        tensors
    }

    /// Its name in files and commands.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mlp => "mlp",
            Self::Transformer => "tra",
            Self::Residual => "res",
            Self::Ppn => "ppn",
        }
    }

    /// The network of a name.
    pub fn named(name: &str) -> Option<Self> {
        [Self::Mlp, Self::Transformer, Self::Residual, Self::Ppn].into_iter().find(|network| network.name() == name)
    }

    /// Number of weights for sequences of 2d + 1 points.
    pub fn weights(self, degree: usize) -> usize {
        self.tensors(degree).iter().map(|(shape, _)| shape.iter().product::<usize>()).sum()
    }

    pub(crate) fn initial_weights(self, degree: usize, seed: u64) -> Vec<f32> {
        let mut random = stream(seed, WEIGHT_STREAM);
        let mut theta = Vec::new();
        for (shape, inputs) in self.tensors(degree) {
            let count: usize = shape.iter().product();
            match inputs {
                0 => theta.extend(vec![1.0; count]),
                usize::MAX => theta.extend(vec![0.0; count]),
                inputs => {
                    let bound = 1.0 / (inputs as f32).sqrt();
                    theta.extend((0..count).map(|_| bound * (2.0 * random.random::<f32>() - 1.0)));
                }
            }
        }
        theta
    }

    /// Logits of the steps, shape `(b, 2d)`, from edges, shape `(b, 2d, 2)`.
    pub(crate) fn logits(self, degree: usize, theta: &Tensor, edges: &Tensor) -> Result<Tensor> {
        self.logits_in_training(degree, theta, edges, &mut |x| Ok(x))
    }

    /// The same; what a transformer computes goes through `dropout`.
    pub(crate) fn logits_in_training(
        self,
        degree: usize,
        theta: &Tensor,
        edges: &Tensor,
        dropout: &mut dyn FnMut(Tensor) -> Result<Tensor>,
    ) -> Result<Tensor> {
        let mut weights = Weights { theta, tensors: self.tensors(degree).into_iter(), at: 0 };
        let (batch, count, _) = edges.dims3()?;
        match self {
            Self::Mlp => {
                let mut x = edges.reshape((batch, count * PLANE))?;
                for _ in 0..=MLP_HIDDEN {
                    x = weights.linear(&x)?.relu()?;
                }
                // An output each point: the first moves all parameters by the same amount and drops out.
                weights.linear(&x)?.i((.., 1..))?.contiguous()
            }
            Self::Transformer => weights.transformer(edges, 2 * degree + 1, dropout),
            Self::Residual => weights.residual(edges, 2 * degree + 1),
            Self::Ppn => {
                let mut x = weights.linear(&edges.reshape((batch, count * PLANE))?)?.relu()?;
                for _ in 0..PPN_BLOCKS {
                    let mut y = x.clone();
                    for _ in 0..PPN_DEPTH {
                        y = weights.linear(&y)?.relu()?;
                    }
                    x = (x + y)?;
                }
                weights.linear(&x)
            }
        }
    }
}

/// Takes tensors out of the vector of all weights, one after the other.
struct Weights<'a> {
    theta: &'a Tensor,
    tensors: std::vec::IntoIter<Weight>,
    at: usize,
}

impl Weights<'_> {
    fn take(&mut self) -> Result<Tensor> {
        let (shape, _) = self.tensors.next().ok_or_else(|| Error::msg("more tensors than the network has"))?;
        let count = shape.iter().product();
        let tensor = self.theta.narrow(0, self.at, count)?.reshape(shape)?;
        self.at += count;
        Ok(tensor)
    }

    /// What is left after the next `count` tensors.
    fn beyond(&self, count: usize) -> Self {
        let mut tensors = self.tensors.clone();
        let skipped = tensors.by_ref().take(count).map(|(shape, _)| shape.iter().product::<usize>());
        Self { theta: self.theta, at: self.at + skipped.sum::<usize>(), tensors }
    }

    /// Rows in, rows out.
    fn linear(&mut self, x: &Tensor) -> Result<Tensor> {
        let (weight, bias) = (self.take()?, self.take()?);
        x.matmul(&weight)?.broadcast_add(&bias)
    }

    /// The linear map of every edge's neighbours under the kernel; the ends count again outside.
    fn convolve(&mut self, x: &Tensor, kernel: usize) -> Result<Tensor> {
        let (batch, count, width) = x.dims3()?;
        let half = kernel / 2;
        let source = |k: usize| (k / kernel + k % kernel).saturating_sub(half).min(count - 1) as u32;
        let index = Tensor::from_iter((0..count * kernel).map(source), x.device())?;
        let columns = x.index_select(&index, 1)?.reshape((batch * count, kernel * width))?;
        let y = self.linear(&columns)?;
        y.reshape((batch, count, y.dim(1)?))
    }

    /// Batch normalization with the statistics of the batch at hand, or layer normalization over the last dimension.
    fn normalize(&mut self, rows: &Tensor, over: usize) -> Result<Tensor> {
        let (scale, shift) = (self.take()?, self.take()?);
        let centred = rows.broadcast_sub(&rows.mean_keepdim(over)?)?;
        let deviation = (centred.sqr()?.mean_keepdim(over)? + VARIANCE_FLOOR)?.sqrt()?;
        centred.broadcast_div(&deviation)?.broadcast_mul(&scale)?.broadcast_add(&shift)
    }

    fn transformer(
        &mut self,
        edges: &Tensor,
        kernel: usize,
        dropout: &mut dyn FnMut(Tensor) -> Result<Tensor>,
    ) -> Result<Tensor> {
        let (batch, count, _) = edges.dims3()?;
        let rows = batch * count;
        // Normalizations stand behind all linear layers: eight tensors an encoder, two of the convolution.
        let mut norms = self.beyond(8 * ENCODERS + 2);
        let mut x = edges.reshape((rows, PLANE))?;
        for _ in 0..ENCODERS {
            let projected = self.linear(&x)?.reshape((batch, count, 3 * PLANE))?;
            let mut heads = Vec::new();
            for head in 0..PLANE {
                // Heads of width 1: no scaling of the scores.
                let part = |k: usize| projected.narrow(2, k * PLANE + head, 1)?.contiguous();
                let (query, key, value) = (part(0)?, part(1)?, part(2)?);
                let scores = query.broadcast_mul(&key.reshape((batch, 1, count))?)?;
                heads.push(dropout(softmax(&scores, D::Minus1)?)?.matmul(&value)?);
            }
            let attended = self.linear(&Tensor::cat(&heads, 2)?.reshape((rows, PLANE))?)?;
            x = norms.normalize(&(x + dropout(attended)?)?, 1)?;
            let inner = dropout(self.linear(&x)?.relu()?)?;
            let outer = dropout(self.linear(&inner)?)?;
            x = norms.normalize(&(x + outer)?, 1)?;
        }
        self.convolve(&x.reshape((batch, count, PLANE))?, kernel)?.squeeze(2)
    }

    fn residual(&mut self, edges: &Tensor, kernel: usize) -> Result<Tensor> {
        let (batch, count, _) = edges.dims3()?;
        let rows = batch * count;
        // Three convolutions, two skips and the normalizations stand in this order.
        let (mut skips, mut norms) = (self.beyond(6), self.beyond(10));
        let mut x = edges.clone();
        for block in 0..3 {
            let y = self.convolve(&x, kernel)?;
            let width = y.dim(2)?;
            let y = norms.normalize(&y.reshape((rows, width))?, 0)?.relu()?;
            let flat = x.reshape((rows, x.dim(2)?))?;
            // Between equal widths the skip is the identity.
            let kept = if block == 1 { flat } else { skips.linear(&flat)? };
            x = (y + kept)?.reshape((batch, count, width))?;
        }
        x.squeeze(2)
    }
}

/// From the steps of sequences, shape `(b, 2d)`, to the mean over the batch of a power of the mean squared error of the
/// polynomial of least squares; in double precision inside.
pub(crate) struct SequenceError {
    tasks: Vec<Task>,
    power: f64,
    floor: f64,
    gradient: Mutex<Vec<f64>>,
}

impl SequenceError {
    pub(crate) fn new(tasks: Vec<Task>, power: f64, floor: f64) -> Self {
        Self { tasks, power, floor, gradient: Mutex::new(Vec::new()) }
    }
}

impl CustomOp1 for SequenceError {
    fn name(&self) -> &'static str {
        "sequence-error"
    }

    fn cpu_fwd(&self, storage: &CpuStorage, layout: &candle_core::Layout) -> Result<(CpuStorage, Shape)> {
        let (start, end) = layout.contiguous_offsets().ok_or_else(|| Error::msg("the argument is not contiguous"))?;
        let single = matches!(storage, CpuStorage::F32(_));
        let steps: Vec<f64> = match single {
            true => storage.as_slice::<f32>()?[start..end].iter().map(|&x| f64::from(x)).collect(),
            false => storage.as_slice::<f64>()?[start..end].to_vec(),
        };
        let (mut loss, mut gradient) = (0.0, Vec::with_capacity(steps.len()));
        let share = 1.0 / self.tasks.len().max(1) as f64;
        for (task, steps) in self.tasks.iter().zip(steps.chunks_exact(steps.len() / self.tasks.len().max(1))) {
            let state = task.grid.state(task.spaces, vec![steps.to_vec()]);
            loss += share * (state.fit.mse + self.floor).powf(self.power);
            let factor = share * self.power * (state.fit.mse + self.floor).powf(self.power - 1.0);
            let by_uv = state.fit.gradient();
            let mut sum = 0.0;
            // A step moves all points behind it but the last, which is held at 1.
            let mut by_steps = vec![0.0; steps.len()];
            for edge in (0..steps.len() - 1).rev() {
                sum += factor * by_uv[edge + 1][0];
                by_steps[edge] = sum;
            }
            gradient.extend(by_steps);
        }
        *self.gradient.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = gradient;
        let storage = if single { CpuStorage::F32(vec![loss as f32]) } else { CpuStorage::F64(vec![loss]) };
        Ok((storage, Shape::from(())))
    }

    fn bwd(&self, steps: &Tensor, _loss: &Tensor, factor: &Tensor) -> Result<Option<Tensor>> {
        let gradient = self.gradient.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clone();
        let gradient = Tensor::from_vec(gradient, steps.shape(), steps.device())?.to_dtype(steps.dtype())?;
        Ok(Some(gradient.broadcast_mul(factor)?))
    }
}

/// Edges of sequences of equal length, shape `(b, m − 1, 2)`.
pub(crate) fn edges(tasks: &[Task]) -> Result<Tensor> {
    let count = tasks[0].grid.size[0] - 1;
    let mut values = Vec::with_capacity(tasks.len() * count * PLANE);
    for task in tasks {
        for pair in task.grid.xyz.windows(2) {
            values.extend((0..PLANE).map(|k| (pair[1][k] - pair[0][k]) as f32));
        }
    }
    Tensor::from_vec(values, (tasks.len(), count, PLANE), &Device::Cpu)
}

/// Random sequences of 2d + 1 points on polynomial curves of degree d (Imperatore 2024, Algorithm 5).
pub(crate) fn random_tasks(
    degree: usize,
    batch: usize,
    seed: u64,
    step: u64,
) -> std::result::Result<Vec<Task>, crate::NnError> {
    use crate::gridded::{GriddedSpec, Shape as Kind};
    let shape = Kind::Curve { degree, dimension: PLANE };
    let spec = GriddedSpec { shape, size: [2 * degree + 1, 1], noise: 0.0 };
    let mut random = stream(seed, step);
    (0..batch).map(|_| Ok(Task::of_sample(&spec.sample(&mut random)?, degree))).collect()
}

/// Steps of a long sequence from those of all its windows of equal length, one edge apart: in logarithms, every window is
/// moved so that it agrees in the mean with those before it, then all windows that see an edge are averaged.
pub(crate) fn merge_windows(windows: &[Vec<f64>]) -> Vec<f64> {
    let width = windows.first().map_or(0, Vec::len);
    let count = windows.len() + width - 1;
    let (mut sums, mut seen) = (vec![0.0; count], vec![0.0; count]);
    for (start, window) in windows.iter().enumerate() {
        let logarithms = window.iter().map(|s| s.max(f64::MIN_POSITIVE).ln());
        let logarithms: Vec<f64> = logarithms.collect();
        let known: Vec<f64> = (0..width)
            .filter(|k| seen[start + k] > 0.0)
            .map(|k| sums[start + k] / seen[start + k] - logarithms[k])
            .collect();
        let offset = known.iter().sum::<f64>() / known.len().max(1) as f64;
        for (k, logarithm) in logarithms.iter().enumerate() {
            sums[start + k] += logarithm + offset;
            seen[start + k] += 1.0;
        }
    }
    let steps: Vec<f64> = sums.iter().zip(&seen).map(|(s, n)| (s / n).exp()).collect();
    let total: f64 = steps.iter().sum();
    steps.iter().map(|s| s / total).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ComparisonNetwork::{Mlp, Ppn, Residual, Transformer};
    use candle_core::Var;

    #[test]
    fn numbers_of_weights_are_those_of_table_4_1() {
        for (network, printed) in [
            (Mlp, [5.19e4, 5.25e4, 5.31e4, 5.37e4]),
            (Transformer, [6.17e4, 6.17e4, 6.17e4, 6.17e4]),
            (Residual, [3.02e4, 4.19e4, 5.36e4, 6.52e4]),
            (Ppn, [5.45e4, 5.47e4, 5.50e4, 5.52e4]),
        ] {
            for (degree, printed) in (2..).zip(printed) {
                let ratio = network.weights(degree) as f64 / printed;
                assert!((ratio - 1.0).abs() < 0.01, "{network:?} {degree}: {ratio}");
            }
        }
    }

    #[test]
    fn gradients_of_the_loss_agree_with_differences() {
        for network in [Mlp, Transformer, Residual, Ppn] {
            let degree = 3;
            let tasks = random_tasks(degree, 3, 1, 0).unwrap();
            // Large weights of the transformer make all edges the same word, and all gradients vanish, as the network's doc says.
            let size = if network == Transformer { 0.3 } else { 1.0 };
            let theta: Vec<f64> = network.initial_weights(degree, 1).into_iter().map(|x| size * f64::from(x)).collect();
            let edges = edges(&tasks).unwrap().to_dtype(candle_core::DType::F64).unwrap();
            let loss = |theta: &Tensor| {
                let steps = softmax(&network.logits(degree, theta, &edges).unwrap(), D::Minus1).unwrap();
                steps.apply_op1(SequenceError::new(tasks.clone(), 0.6, 1e-9)).unwrap()
            };
            let var = Var::from_vec(theta.clone(), theta.len(), &Device::Cpu).unwrap();
            let gradients = loss(var.as_tensor()).backward().unwrap();
            let gradient = gradients.get(&var).unwrap().to_vec1::<f64>().unwrap();
            let norm = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
            assert!(norm > 0.0);
            let at = |h: f64| {
                let moved: Vec<f64> = theta.iter().zip(&gradient).map(|(t, g)| t + h * g / norm).collect();
                loss(&Tensor::from_vec(moved, theta.len(), &Device::Cpu).unwrap()).to_scalar::<f64>().unwrap()
            };
            let h = 1e-6;
            let difference = (at(h) - at(-h)) / (2.0 * h);
            assert!((difference / norm - 1.0).abs() < 1e-5, "{network:?}: {difference} against {norm}");
        }
    }

    #[test]
    fn windows_of_one_sequence_merge_to_it() {
        let steps = [0.1, 0.3, 0.05, 0.25, 0.1, 0.2];
        let window = |start: usize| -> Vec<f64> {
            let part = &steps[start..start + 4];
            part.iter().map(|s| s / part.iter().sum::<f64>()).collect()
        };
        let merged = merge_windows(&[window(0), window(1), window(2)]);
        assert!(merged.iter().zip(steps).all(|(a, b)| (a - b).abs() < 1e-12), "{merged:?}");
    }
}
