//! The step to which coordinates are rounded.

use ndarray::ArrayView2;
use rayon::prelude::*;

use crate::{CloudError, check_finite};

/// Largest decimal step that is looked for, and the number of smaller ones. Limit: ten-thousands to 10⁻⁹ of a unit.
const DECIMALS: (i32, i32) = (4, -9);

/// Multiples of a decimal step that are steps, too, largest first.
const MULTIPLES: [f64; 3] = [5.0, 2.0, 1.0];

/// Steps between the smallest and the largest coordinate from which on a step is one of rounding. Limit: with fewer it may as well be
/// the shape.
const LEAST_STEPS: f64 = 4.0;

/// Round-off of a multiple of a step, as a share of the largest coordinate. Derived: a half of [`f64::EPSILON`] for each of the two
/// coordinates, for their difference, for the step and for the quotient, and as much again in reserve.
const ROUND_OFF: f64 = 4.0 * f64::EPSILON;

/// Largest distance of a multiple from a whole number. Limit: of steps nearer to round-off any number would be a multiple.
const OFF_WHOLE: f64 = 1e-3;

/// Places of a lattice for each of its points, from which on two directions are no lattice. Limit: half of one may be missing.
const PLACES_PER_POINT: f64 = 2.0;

/// The largest step to which a coordinate of the points, shape `(m, 3)`, is rounded: a power of ten, or twice or five times one, of which
/// all differences are multiples; the step of single precision at the largest coordinate where all are such numbers. 0 where none is.
///
/// Where two directions make a lattice, as those of a height field, their steps are places and not errors: only the third counts. O(m),
/// beside sorting coordinates that have a step.
///
/// # Errors
/// Those of [`check_finite`].
pub fn rounding_step(points: ArrayView2<'_, f64>) -> Result<f64, CloudError> {
    check_finite(points)?;
    let m = points.nrows();
    let axes: Vec<Axis> = points.columns().into_iter().map(|column| Axis::of(&column.to_vec())).collect();
    let pairs = (0..axes.len()).flat_map(|a| (0..a).map(move |b| [a, b]));
    let places = |pair: [usize; 2]| pair.map(|d| axes[d].different as f64).iter().product::<f64>();
    let lattice = pairs
        .min_by(|&p, &q| places(p).total_cmp(&places(q)))
        .filter(|&pair| places(pair) <= PLACES_PER_POINT * m as f64)
        .unwrap_or([usize::MAX; 2]);
    let decimal = (0..axes.len()).filter(|d| !lattice.contains(d)).filter_map(|d| axes[d].step).fold(0.0_f64, f64::max);
    Ok(decimal.max(single_precision(points)))
}

/// A coordinate of all points.
struct Axis {
    /// The decimal step, if there is one.
    step: Option<f64>,
    /// How many different values there are; without a step that many points.
    different: usize,
}

impl Axis {
    fn of(values: &[f64]) -> Self {
        let lower = values.iter().fold(f64::INFINITY, |low, x| low.min(*x));
        let upper = values.iter().fold(f64::NEG_INFINITY, |high, x| high.max(*x));
        let round_off = ROUND_OFF * lower.abs().max(upper.abs());
        let multiple = |x: f64, step: f64| (x - lower) / step;
        let is_step = |step: &f64| {
            let off = round_off / step;
            let is_multiple = |x: &f64| (multiple(*x, *step) - multiple(*x, *step).round()).abs() <= off.max(1e-9);
            LEAST_STEPS * step <= upper - lower && off <= OFF_WHOLE && values.iter().all(is_multiple)
        };
        let mut decimals =
            (DECIMALS.1..=DECIMALS.0).rev().flat_map(|e| MULTIPLES.map(|factor| factor * 10_f64.powi(e)));
        let step = decimals.find(is_step);
        let different = match step {
            None if lower == upper => 1,
            None => {
                // A lattice may have any step.
                let mut sorted = values.to_vec();
                sorted.par_sort_unstable_by(f64::total_cmp);
                sorted.dedup_by(|a, b| *a - *b <= round_off);
                sorted.len()
            }
            Some(step) => {
                let mut places: Vec<i64> = values.iter().map(|x| multiple(*x, step).round() as i64).collect();
                places.par_sort_unstable();
                places.dedup();
                places.len()
            }
        };
        Self { step, different }
    }
}

/// The step of single precision at the largest coordinate if all are numbers of single precision but not all small whole ones.
fn single_precision(points: ArrayView2<'_, f64>) -> f64 {
    let is_single = |x: &f64| f64::from(*x as f32) == *x;
    let largest = points.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    if largest == 0.0 || !points.iter().all(is_single) || points.iter().all(|x| x.fract() == 0.0) {
        return 0.0;
    }
    // Derived: 23 bits after the leading one.
    2_f64.powi(largest.log2().floor() as i32 - 23)
}
