//! The step to which coordinates are rounded.

use ndarray::ArrayView2;
use rayon::prelude::*;

use crate::{CloudError, check_finite};

/// Largest decimal step that is looked for, and the number of smaller ones. Limit: ten-thousands to 10⁻⁹ of a unit.
const DECIMALS: (i32, i32) = (4, -9);

/// Multiples of a decimal step that are steps, too, largest first.
const MULTIPLES: [f64; 3] = [5.0, 2.0, 1.0];

/// Steps between the smallest and the largest coordinate from which on a step is one of rounding. Limit: with fewer it is the shape.
const LEAST_STEPS: f64 = 4.0;

/// Steps, or points for each different coordinate, one of which there must be too. Limit: with fewer it may as well be the shape, as
/// of a saddle over a lattice of a few points, whose heights are multiples of a tenth.
const MANY: (f64, usize) = (32.0, 8);

/// Round-off of a multiple of a step, as a share of the largest coordinate. Derived: a half of [`f64::EPSILON`] for each of the two
/// coordinates, for their difference, for the step and for the quotient, and as much again in reserve.
const ROUND_OFF: f64 = 4.0 * f64::EPSILON;

/// Largest distance of a multiple from a whole number. Limit: of steps nearer to round-off any number would be a multiple.
const OFF_WHOLE: f64 = 1e-3;

/// Places of a lattice for each of its points, least and most. Limit: half of them may be empty, and one point in ten may be there twice.
const PLACES_PER_POINT: (f64, f64) = (0.9, 2.0);

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
    let m = points.nrows() as f64;
    let columns: Vec<Vec<f64>> = points.columns().into_iter().map(|column| column.to_vec()).collect();
    let axes: Vec<Axis> = columns.iter().map(|column| Axis::of(column)).collect();
    // Of a lattice each place has one point. Of pairs with about as many places the one with the most points apart.
    let pairs = (0..axes.len()).flat_map(|a| (0..a).map(move |b| [a, b]));
    let is_lattice = |pair: &[usize; 2]| {
        let places = pair.map(|d| axes[d].different as f64).iter().product::<f64>();
        (PLACES_PER_POINT.0 * m..=PLACES_PER_POINT.1 * m).contains(&places)
    };
    let lattice = pairs
        .filter(is_lattice)
        .max_by_key(|&[a, b]| places_taken(&columns[a], &columns[b]))
        .unwrap_or([usize::MAX; 2]);
    let decimal = (0..axes.len()).filter(|d| !lattice.contains(d)).filter_map(|d| axes[d].step).fold(0.0_f64, f64::max);
    Ok(decimal.max(single_precision(points)))
}

/// Number of different pairs of coordinates.
fn places_taken(first: &[f64], second: &[f64]) -> usize {
    let mut places: Vec<[u64; 2]> = first.iter().zip(second).map(|(x, y)| [x.to_bits(), y.to_bits()]).collect();
    places.par_sort_unstable();
    places.dedup();
    places.len()
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
        let is_many = |step: &f64| upper - lower >= MANY.0 * step || values.len() >= MANY.1 * different;
        Self { step: step.filter(is_many), different }
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
