//! Fixed sequences and grids on which networks are compared with classical parameters.

use super::data::PUBLISHED_GRID;
use crate::error::NnError;
use crate::gridded::{GriddedSpec, Shape};
use crate::parcnn::layout::{Architecture, Form};
use crate::parcnn::model::Parcnn;
use crate::parcnn::pass::Task;
use crate::synthetic::{normal, stream};

/// Means over the items of a kind.
#[derive(Clone, Debug, PartialEq)]
pub struct GridScore {
    /// Points, degree, noise.
    pub kind: String,
    /// Mean squared distance of the network's polynomial fit, all coordinates summed.
    pub mse: f64,
    /// The same at the best of uniform, centripetal and chord-length parameters, chosen for the kind.
    pub standard: f64,
}

/// Fixed tasks, in kinds.
#[derive(Clone, Debug)]
pub struct GridValidation {
    kinds: Vec<(String, Vec<Task>, f64)>,
}

const DEGREES: [usize; 4] = [2, 3, 4, 5];
/// Standard deviation on each coordinate of the scaled points; half of it on surfaces.
const NOISE: f64 = 1e-2;

/// Points as a function of the degree.
type Size = fn(usize) -> [usize; 2];

/// Name, points, degrees, noise.
type Kind = (String, Size, Vec<usize>, f64);

impl GridValidation {
    /// `count` items of each kind that an architecture is for.
    ///
    /// # Errors
    /// Those of the generator.
    pub fn new(architecture: Architecture, seed: u64, count: u64) -> Result<Self, NnError> {
        let degrees: Vec<usize> = match architecture.form {
            Form::Published { degree, .. } => vec![degree],
            Form::Feedback { .. } => DEGREES.to_vec(),
        };
        let kinds: Vec<Kind> = if architecture.directions == 1 {
            vec![
                ("2d+1".into(), |d| [2 * d + 1, 1], degrees.clone(), 0.0),
                ("20".into(), |_| [20, 1], degrees.clone(), 0.0),
                ("50".into(), |_| [50, 1], degrees.clone(), 0.0),
                ("80".into(), |_| [80, 1], degrees.clone(), 0.0),
                ("50 noise".into(), |_| [50, 1], degrees, NOISE),
            ]
        } else {
            let mut kinds: Vec<Kind> =
                degrees.iter().map(|&d| (format!("d={d}"), (|_| [12, 12]) as fn(usize) -> _, vec![d], 0.0)).collect();
            kinds.push(("noise".into(), |_| [12, 12], degrees, NOISE / 2.0));
            kinds
        };
        Self::of_kinds(architecture, kinds, seed, count)
    }

    /// What networks of the published recipe are judged on: items like those they are trained on, at lengths of 2d + 1, 20,
    /// 50 and 80 points or, if `shortest`, at the first alone.
    ///
    /// # Errors
    /// Those of the generator.
    pub fn published(
        architecture: Architecture,
        degree: usize,
        shortest: bool,
        seed: u64,
        count: u64,
    ) -> Result<Self, NnError> {
        let kinds: [(&str, Size); 4] =
            [("2d+1", |d| [2 * d + 1, 1]), ("20", |_| [20, 1]), ("50", |_| [50, 1]), ("80", |_| [80, 1])];
        let kinds = match architecture.directions {
            1 => kinds[..if shortest { 1 } else { kinds.len() }].to_vec(),
            _ => vec![("10x10", (|_| PUBLISHED_GRID) as Size)],
        };
        let kinds = kinds.into_iter().map(|(name, size)| (name.to_owned(), size, vec![degree], 0.0)).collect();
        Self::of_kinds(architecture, kinds, seed, count)
    }

    fn of_kinds(architecture: Architecture, kinds: Vec<Kind>, seed: u64, count: u64) -> Result<Self, NnError> {
        let mut validation = Self { kinds: Vec::new() };
        for (k, (name, size, degrees, noise)) in kinds.into_iter().enumerate() {
            let (mut tasks, mut standard) = (Vec::new(), 0.0);
            for &degree in &degrees {
                let shape = match architecture.directions {
                    1 => Shape::Curve { degree, dimension: architecture.dimension },
                    _ => Shape::Surface { degree },
                };
                let spec = GriddedSpec { shape, size: size(degree), noise: 0.0 };
                let mut sums = [0.0; 3];
                for index in 0..count {
                    let item = (k * 8 + degree) as u64 * count + index;
                    let mut random = stream(seed, item);
                    let mut cloud = spec.sample(&mut random)?;
                    if noise > 0.0 {
                        cloud.points.iter_mut().for_each(|x| *x += noise * normal(&mut random));
                    }
                    let task = Task::of_sample(&cloud, degree);
                    for (sum, power) in sums.iter_mut().zip([0.0, 0.5, 1.0]) {
                        let steps = task.grid.classical_steps(power, true);
                        *sum += task.grid.state(task.spaces, steps).fit.mse / (count as usize * degrees.len()) as f64;
                    }
                    tasks.push(task);
                }
                standard += sums.into_iter().fold(f64::INFINITY, f64::min);
            }
            validation.kinds.push((name, tasks, standard));
        }
        Ok(validation)
    }

    /// Scores of a network, one a kind.
    pub fn scores(&self, network: &Parcnn) -> Vec<GridScore> {
        self.scores_of(|task| network.last_state(task).fit.mse)
    }

    /// Scores of whatever gives a task its mean squared error, one a kind.
    pub(crate) fn scores_of(&self, mse: impl Fn(&Task) -> f64) -> Vec<GridScore> {
        let one = |(kind, tasks, standard): &(String, Vec<Task>, f64)| {
            let sum: f64 = tasks.iter().map(&mse).sum();
            GridScore { kind: kind.clone(), mse: sum / tasks.len().max(1) as f64, standard: *standard }
        };
        self.kinds.iter().map(one).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twice the errors of the shipped networks on other items of the same kinds, the mean over all kinds without noise.
    #[test]
    fn shipped_networks_keep_their_errors() {
        for (dimension, directions, largest) in [(2, 1, 4e-6), (3, 1, 6e-6), (3, 2, 8e-8)] {
            let network = Parcnn::embedded(dimension, directions).unwrap();
            let scores = GridValidation::new(network.architecture(), 77, 12).unwrap().scores(&network);
            let exact = &scores[..4];
            let [mse, standard] = [|s: &GridScore| s.mse, |s: &GridScore| s.standard]
                .map(|of| exact.iter().map(of).sum::<f64>() / exact.len() as f64);
            assert!(mse < largest && mse < 0.05 * standard, "{dimension} {directions}: {scores:?}");
            assert!(scores.iter().all(|s| s.mse < 0.5 * s.standard), "{dimension} {directions}: {scores:?}");
        }
    }
}
