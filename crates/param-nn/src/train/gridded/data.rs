//! Fresh training grids: sizes, degrees, elements, spacings and noise are mixed; those of a batch have equal sizes.

use std::f64::consts::TAU;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::error::NnError;
use crate::gridded::{
    GriddedSpec, Shape, Trigonometric, normalize_parameters, scale_to_unit_box, sorted_parameters, vector,
};
use crate::parcnn::grid::Grid;
use crate::parcnn::layout::{Architecture, Form};
use crate::parcnn::pass::Task;
use crate::parcnn::{SplineCurve, SplineSpace};
use crate::synthetic::{normal, uniform_rotation};

/// Degrees that are trained for.
const DEGREES: [usize; 4] = [2, 3, 4, 5];

/// Share of batches with 2d + 1 points, the fewest that tell a curve of degree d (Imperatore 2024, §4.1.6 (a)).
const SHORTEST_SHARE: f64 = 0.25;

/// Points of the longest sequences.
const LONGEST: f64 = 100.0;

/// Share of curves that are splines with more than one element, and the most elements.
const SPLINE_SHARE: f64 = 0.25;
const MOST_ELEMENTS: usize = 8;

/// Share of the spline tasks whose points lie on trigonometric curves.
const TRIGONOMETRIC_SHARE: f64 = 0.4;

/// Share of grids of 12 × 12 points, the others have from 5 to 24 along each direction; most points of a grid.
const TWELVE_SHARE: f64 = 0.5;
const GRID_LINE: [f64; 2] = [5.0, 24.0];
const MOST_GRID_POINTS: usize = 400;

/// Points of the published grids, 100.
pub(super) const PUBLISHED_GRID: [usize; 2] = [10, 10];

/// Share of surfaces whose control points leave the Greville abscissae, and by how much, in units of their spacing.
const JITTERED_SHARE: f64 = 0.35;
const JITTER: f64 = 0.5;

/// Share of surfaces with more than one element, and the most elements.
const SPLINE_SURFACE_SHARE: f64 = 0.2;
const MOST_SURFACE_ELEMENTS: usize = 4;

/// Share of grids with noise, and its smallest and largest standard deviation, in logarithmic measure.
const NOISY_SHARE: f64 = 0.2;
const NOISE: [f64; 2] = [1e-3, 2e-2];

/// Shares of parameters that are nearly equidistant, and of denser and sparser parts.
const EVEN_SHARE: f64 = 0.15;
const UNEVEN_SHARE: f64 = 0.1;

/// A task, and the parameters its points were sampled at where these make a fit without error (but for noise).
#[derive(Clone, Debug)]
pub(super) struct Example {
    pub(super) task: Task,
    pub(super) truth: Option<Vec<[f64; 2]>>,
}

/// A batch for an architecture.
pub(super) fn draw(architecture: Architecture, batch: usize, shortest: bool, random: &mut ChaCha8Rng) -> Vec<Example> {
    match (architecture.form, architecture.directions) {
        (Form::Feedback { .. }, 1) => curves(architecture.dimension, batch, None, shortest, random),
        (Form::Published { degree, .. }, 1) => curves(architecture.dimension, batch, Some(degree), shortest, random),
        (Form::Feedback { .. }, _) => surfaces(batch, None, random),
        (Form::Published { degree, .. }, _) => surfaces(batch, Some(degree), random),
    }
}

/// A batch as published, for one degree: polynomials without noise, `shortest` ones or of a length drawn for the batch; grids
/// of 10 × 10 points (Imperatore 2024, §4.1.4).
pub(super) fn draw_published(
    architecture: Architecture,
    degree: usize,
    (batch, shortest): (usize, bool),
    random: &mut ChaCha8Rng,
) -> Result<Vec<Task>, NnError> {
    let Architecture { dimension, directions, .. } = architecture;
    let spec = match directions {
        1 => {
            let fewest = 2 * degree + 1;
            let count = if shortest { fewest } else { integer(fewest, LONGEST as usize, random) };
            GriddedSpec { shape: Shape::Curve { degree, dimension }, size: [count, 1], noise: 0.0 }
        }
        _ => GriddedSpec { shape: Shape::Surface { degree }, size: PUBLISHED_GRID, noise: 0.0 },
    };
    (0..batch).map(|_| Ok(Task::of_sample(&spec.sample(random)?, degree))).collect()
}

fn chance(share: f64, random: &mut ChaCha8Rng) -> bool {
    random.random::<f64>() < share
}

fn logarithmic([low, high]: [f64; 2], random: &mut ChaCha8Rng) -> f64 {
    low * (high / low).powf(random.random::<f64>())
}

/// A number from `low` to `high`.
fn integer(low: usize, high: usize, random: &mut ChaCha8Rng) -> usize {
    low + ((high + 1 - low) as f64 * random.random::<f64>()) as usize
}

fn spacing(count: usize, random: &mut ChaCha8Rng) -> Vec<f64> {
    let kind: f64 = random.random();
    if kind < EVEN_SHARE {
        let jitter = random.random::<f64>();
        let mut along: Vec<f64> = (0..count).map(|k| k as f64 + jitter * random.random::<f64>()).collect();
        normalize_parameters(&mut along);
        return along;
    }
    let mut along = sorted_parameters(count, random);
    if kind < EVEN_SHARE + UNEVEN_SHARE {
        let strength = 1.4 * random.random::<f64>() - 0.7;
        along.iter_mut().for_each(|t| *t += strength * (TAU * *t).sin() / TAU);
        normalize_parameters(&mut along);
    }
    along
}

fn add_noise(points: &mut [[f64; 3]], dimension: usize, random: &mut ChaCha8Rng) {
    if chance(NOISY_SHARE, random) {
        let deviation = logarithmic(NOISE, random);
        points.iter_mut().for_each(|p| p[..dimension].iter_mut().for_each(|x| *x += deviation * normal(random)));
    }
}

fn curves(
    dimension: usize,
    batch: usize,
    only: Option<usize>,
    shortest: bool,
    random: &mut ChaCha8Rng,
) -> Vec<Example> {
    let shortest = chance(SHORTEST_SHARE, random) || shortest;
    let degree = only.unwrap_or(integer(DEGREES[0], DEGREES[3], random));
    let shortest_count = (2 * degree + 1) as f64;
    let count = if shortest { shortest_count } else { logarithmic([shortest_count, LONGEST], random) } as usize;
    let one = |_| {
        let degree = match only {
            None if !shortest => integer(DEGREES[0], DEGREES[3].min((count - 1) / 2), random),
            _ => degree,
        };
        // A space with n functions takes 2n − 1 points as polynomials do.
        let most = count.div_ceil(2).saturating_sub(degree).min(MOST_ELEMENTS);
        let several = only.is_none() && most > 1 && chance(SPLINE_SHARE, random);
        let elements = if several { integer(2, most, random) } else { 1 };
        let space = SplineSpace { degree, elements };
        let along = spacing(count, random);
        let trigonometric = several && elements > 2 && chance(TRIGONOMETRIC_SHARE, random);
        let mut points: Vec<[f64; 3]> = if trigonometric {
            let curve = Trigonometric::random(integer(1, 1 + elements / 2, random), dimension, TAU, random);
            along.iter().map(|&t| curve.point(t)).collect()
        } else {
            let mut curve = SplineCurve::random(space, dimension, random);
            if several && chance(0.5, random) {
                // A random walk: long shapes in place of knots.
                let drift = vector(dimension, random);
                let mut sum = [0.0; 3];
                for control in &mut curve.control {
                    (0..3).for_each(|k| sum[k] += control[k] + drift[k]);
                    *control = sum;
                }
            }
            along.iter().map(|&t| curve.point(t)).collect()
        };
        scale_to_unit_box(&mut points);
        add_noise(&mut points, dimension, random);
        let truth = (!trigonometric).then(|| along.iter().map(|&t| [t, 0.0]).collect());
        Example { task: Task::new(Grid { xyz: points, size: [count, 1], dimension }, space), truth }
    };
    (0..batch).map(one).collect()
}

fn surfaces(batch: usize, only: Option<usize>, random: &mut ChaCha8Rng) -> Vec<Example> {
    let degree = only.unwrap_or(integer(DEGREES[0], DEGREES[3], random));
    let size = match only {
        // As published: 100 points.
        Some(_) => PUBLISHED_GRID,
        None if chance(TWELVE_SHARE, random) => [12, 12],
        None => {
            let low = GRID_LINE[0].max((2 * degree) as f64);
            let first = logarithmic([low, GRID_LINE[1]], random) as usize;
            let second = logarithmic([low, GRID_LINE[1]], random) as usize;
            [first, second.min(MOST_GRID_POINTS / first)]
        }
    };
    let one = |_| {
        let most = (2 * size[0].min(size[1]) / 3).saturating_sub(degree).clamp(1, MOST_SURFACE_ELEMENTS);
        let several = only.is_none() && most > 1 && chance(SPLINE_SURFACE_SHARE, random);
        let space = SplineSpace { degree, elements: if several { integer(2, most, random) } else { 1 } };
        let along = size.map(|count| spacing(count, random));
        let mut points = surface(space, &along, only.is_none(), random);
        scale_to_unit_box(&mut points);
        add_noise(&mut points, 3, random);
        let truth = along[0].iter().flat_map(|&u| along[1].iter().map(move |&v| [u, v])).collect();
        Example { task: Task::new(Grid { xyz: points, size, dimension: 3 }, space), truth: Some(truth) }
    };
    (0..batch).map(one).collect()
}

/// Points of a random surface, its control points over the Greville abscissae or near them.
fn surface(space: SplineSpace, along: &[Vec<f64>; 2], varied: bool, random: &mut ChaCha8Rng) -> Vec<[f64; 3]> {
    let n = space.functions();
    let greville = space.greville();
    let jittered = varied && chance(JITTERED_SHARE, random);
    let jitter = if jittered { JITTER / (n - 1) as f64 } else { 0.0 };
    let (height, aspect) = match jittered {
        true => (logarithmic([0.3, 2.0], random), logarithmic([0.3, 1.0], random)),
        false => (1.0, 1.0),
    };
    let rotation = uniform_rotation(random);
    let mut control = Vec::with_capacity(n * n);
    for u in &greville {
        for v in &greville {
            let mut moved = |x: f64| x + jitter * (2.0 * random.random::<f64>() - 1.0);
            let (x, y) = (moved(*u), aspect * moved(*v));
            let z = height * random.random::<f64>();
            control.push([0, 1, 2].map(|k| rotation[[k, 0]] * x + rotation[[k, 1]] * y + rotation[[k, 2]] * z));
        }
    }
    let [first, second] = along.each_ref().map(|along| along.iter().map(|&t| space.values(t)).collect::<Vec<_>>());
    let mut points = Vec::with_capacity(first.len() * second.len());
    for bu in &first {
        // Control points of the curve over this parameter.
        let line: Vec<[f64; 3]> =
            (0..n).map(|j| std::array::from_fn(|k| (0..n).map(|i| bu[i] * control[i * n + j][k]).sum())).collect();
        for bv in &second {
            points.push(std::array::from_fn(|k| (0..n).map(|j| bv[j] * line[j][k]).sum()));
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parcnn::layout::SHIPPED_FORM;
    use crate::synthetic::stream;

    #[test]
    fn all_kinds_are_drawn_and_the_truth_fits() {
        for (dimension, directions) in [(2, 1), (3, 1), (3, 2)] {
            let architecture = Architecture { dimension, directions, form: SHIPPED_FORM };
            let (mut exact, mut degrees, mut sizes) = (0, [0; 6], Vec::new());
            for step in 0..40 {
                for example in draw(architecture, 2, false, &mut stream(1, step)) {
                    let Task { grid, spaces } = &example.task;
                    degrees[spaces[0].degree] += 1;
                    sizes.push(grid.size[0]);
                    assert_eq!(grid.xyz.len(), grid.size[0] * grid.size[1]);
                    if let Some(truth) = &example.truth {
                        let mse = crate::parcnn::GridFit::new(*spaces, truth, &grid.xyz).mse;
                        // Noise has at most 3 · 0.02²; without, the truth is exact.
                        assert!(mse < 4e-3, "{mse}");
                        exact += usize::from(mse < 1e-16);
                    }
                }
            }
            assert!(exact > 40, "{exact} exact");
            assert!(degrees[2..].iter().all(|&n| n > 5), "{degrees:?}");
            assert!(sizes.iter().any(|&m| m < 10) && sizes.iter().any(|&m| m > 15), "{sizes:?}");
        }
    }
}
