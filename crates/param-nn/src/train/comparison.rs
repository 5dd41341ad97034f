//! Training of the networks that PARCNN is compared with.

use candle_core::{D, Device, Tensor, Var};
use candle_nn::ops::softmax;
use ndarray::{Array1, ArrayView2};

use super::gridded::{FLOOR, POWER};
use super::optimizer::{Optimizer, Recipe};
use super::{LAST_RATE, cosine_rate};
use crate::error::NnError;
use crate::gridded::scale_to_unit_box;
use crate::parcnn::SplineSpace;
use crate::parcnn::comparison::{ComparisonNetwork, SequenceError, edges, merge_windows, random_tasks};
use crate::parcnn::grid::Grid;
use crate::parcnn::pass::Task;

/// Random sequences that batch normalization takes its statistics from.
const REFERENCE: usize = 64;

/// A trained network for plane sequences on curves of one degree.
#[derive(Clone, Debug)]
pub struct Comparison {
    network: ComparisonNetwork,
    degree: usize,
    theta: Vec<f32>,
}

impl Comparison {
    /// Trains on fresh sequences of 2d + 1 points, `batch` a step.
    ///
    /// # Errors
    /// [`NnError::Training`].
    pub fn train(
        network: ComparisonNetwork,
        degree: usize,
        (steps, batch): (u64, usize),
        rate: f64,
        seed: u64,
    ) -> Result<Self, NnError> {
        let mut theta = network.initial_weights(degree, seed);
        let mut optimizer = Optimizer::new(Recipe::AdamW, theta.len());
        for step in 0..steps {
            let tasks = random_tasks(degree, batch, seed, step)?;
            let differentiate = || -> candle_core::Result<Vec<f32>> {
                let var = Var::from_vec(theta.clone(), theta.len(), &Device::Cpu)?;
                let logits = network.logits(degree, var.as_tensor(), &edges(&tasks)?)?;
                let loss = softmax(&logits, D::Minus1)?.apply_op1(SequenceError::new(tasks.clone(), POWER, FLOOR))?;
                let gradients = loss.backward()?;
                gradients.get(&var).ok_or_else(|| candle_core::Error::msg("no gradient"))?.to_vec1()
            };
            let gradient = differentiate().map_err(|e| NnError::Training { step, reason: e.to_string() })?;
            if !gradient.iter().all(|g| g.is_finite()) {
                return Err(NnError::Training { step, reason: "gradient is not finite; lower the rate".into() });
            }
            optimizer.step(&mut theta, &gradient, cosine_rate(rate, LAST_RATE, step, step as f64 / steps as f64));
        }
        Ok(Self { network, degree, theta })
    }

    /// Parameters of a plane sequence, shape `(m, 2)`, m ≥ 2d + 1; longer ones are cut into windows. Batch normalization takes the statistics of `reference`, random sequences of the kind trained on, and the
    /// windows.
    ///
    /// # Errors
    /// [`NnError::WrongShape`], [`NnError::Training`] if candle fails.
    pub fn predict(&self, points: ArrayView2<'_, f64>, reference: u64) -> Result<Array1<f64>, NnError> {
        let width = 2 * self.degree + 1;
        if points.nrows() < width || points.ncols() != 2 {
            return Err(NnError::WrongShape { what: "points", given: points.dim().into(), required: [width, 2] });
        }
        let xyz: Vec<[f64; 3]> = points.rows().into_iter().map(|p| [p[0], p[1], 0.0]).collect();
        let space = SplineSpace::polynomials(self.degree);
        let task = |window: &[[f64; 3]]| {
            // As large as what the network was trained on.
            let mut xyz = window.to_vec();
            scale_to_unit_box(&mut xyz);
            Task::new(Grid { xyz, size: [width, 1], dimension: 2 }, space)
        };
        let mut tasks: Vec<Task> = xyz.windows(width).map(task).collect();
        let count = tasks.len();
        if self.network == ComparisonNetwork::Residual {
            tasks.extend(random_tasks(self.degree, REFERENCE, reference, 0)?);
        }
        let run = || -> candle_core::Result<Vec<Vec<f32>>> {
            let theta = Tensor::from_slice(&self.theta, self.theta.len(), &Device::Cpu)?;
            softmax(&self.network.logits(self.degree, &theta, &edges(&tasks)?)?, D::Minus1)?.to_vec2()
        };
        let steps = run().map_err(|e| NnError::Training { step: 0, reason: e.to_string() })?;
        let windows: Vec<Vec<f64>> =
            steps[..count].iter().map(|row| row.iter().map(|&s| f64::from(s)).collect()).collect();
        let grid = Grid { xyz, size: [points.nrows(), 1], dimension: 2 };
        Ok(grid.parameters(&[merge_windows(&windows)]).iter().map(|uv| uv[0]).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gridded::{GriddedSpec, Shape};
    use crate::synthetic::stream;

    #[test]
    fn training_lowers_the_error_and_any_length_is_read() {
        let spec =
            |count| GriddedSpec { shape: Shape::Curve { degree: 2, dimension: 2 }, size: [count, 1], noise: 0.0 };
        let error = |network: &Comparison| -> f64 {
            (0..20)
                .map(|k| {
                    let points = spec(5).sample(&mut stream(9, k)).unwrap().points;
                    let u = network.predict(points.view(), 1).unwrap();
                    let uv: Vec<[f64; 2]> = u.iter().map(|&u| [u, 0.0]).collect();
                    let xyz: Vec<[f64; 3]> = points.rows().into_iter().map(|p| [p[0], p[1], 0.0]).collect();
                    let spaces = [SplineSpace::polynomials(2), crate::parcnn::CONSTANTS];
                    crate::parcnn::GridFit::new(spaces, &uv, &xyz).mse
                })
                .sum()
        };
        let train = |steps| Comparison::train(ComparisonNetwork::Mlp, 2, (steps, 16), 2e-3, 1).unwrap();
        let (before, after) = (train(0), train(400));
        assert!(error(&after) < 0.5 * error(&before), "{} {}", error(&after), error(&before));
        let long = spec(20).sample(&mut stream(9, 99)).unwrap().points;
        let u = after.predict(long.view(), 1).unwrap();
        assert!(u.len() == 20 && u[0] == 0.0 && u[19] == 1.0 && u.windows(2).into_iter().all(|w| w[0] <= w[1]));
    }
}
