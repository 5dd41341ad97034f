//! The knots that a curve fit starts from.

use ndarray::Array1;
use thb_core::KnotVector;

use super::choices::KnotChoice;
use super::options::CurveOptions;
use super::sequence::{Closing, Sequence};
use crate::Error;

/// The knots of level 0: corners have as many as the degree, so that the curve may turn there.
pub(super) fn start_knots(sequence: &Sequence, options: &CurveOptions) -> Result<KnotVector, Error> {
    let (degree, (lower, upper)) = (options.degree, sequence.domain);
    let corners: Vec<f64> = sequence.corners.iter().map(|&row| sequence.parameters[row]).collect();
    let breaks: Vec<f64> = std::iter::once(lower).chain(corners.iter().copied()).chain([upper]).collect();
    let between = |count: usize| (1..count).map(move |k| k as f64 / count as f64);
    let mut inner: Vec<f64> = match options.knots {
        KnotChoice::Adaptive if sequence.closing == Closing::Periodic => {
            between(options.elements.max(degree + 1)).map(|t| lower + t * (upper - lower)).collect()
        }
        KnotChoice::Adaptive => {
            let pieces = breaks.windows(2);
            pieces.flat_map(|w| between(options.elements).map(move |t| w[0] + t * (w[1] - w[0]))).collect()
        }
        KnotChoice::Uniform(count) => between(count + 1).map(|t| lower + t * (upper - lower)).collect(),
        KnotChoice::Averaged(count) => averaged(&sequence.parameters, sequence, degree, count)?,
    };
    if sequence.closing == Closing::Periodic {
        inner.dedup();
        return Ok(KnotVector::periodic(degree, std::iter::once(lower).chain(inner).chain([upper]).collect())?);
    }
    inner.retain(|t| !corners.contains(t));
    inner.extend(corners.iter().flat_map(|&corner| std::iter::repeat_n(corner, degree)));
    inner.sort_by(f64::total_cmp);
    let ends = |t| std::iter::repeat_n(t, degree + 1);
    Ok(KnotVector::new(degree, ends(lower).chain(inner).chain(ends(upper)).collect())?)
}

/// Inner knots by averaging. The sorted parameters are cut into as many groups of nearly equal size as there will be
/// control points, and knot `j` is the mean of the means of the groups `j` to `j + p − 1`; for as many control points as
/// points this is the averaging of Piegl and Tiller, The NURBS Book, (9.8). Around a periodic curve groups go on.
fn averaged(parameters: &Array1<f64>, sequence: &Sequence, degree: usize, count: usize) -> Result<Vec<f64>, Error> {
    let mut sorted = parameters.to_vec();
    sorted.sort_by(f64::total_cmp);
    let m = sorted.len();
    let periodic = sequence.closing == Closing::Periodic;
    let groups = if periodic { count + 1 } else { count + degree + 1 };
    if groups > m {
        return Err(Error::TooManyKnots { given: count, control_points: groups, points: m });
    }
    let group = |k: usize| k * m / groups;
    let means: Vec<f64> = (0..groups)
        .map(|k| {
            let members = &sorted[group(k)..group(k + 1)];
            members.iter().sum::<f64>() / members.len() as f64
        })
        .collect();
    if periodic {
        return Ok(means.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect());
    }
    Ok((1..=count).map(|j| means[j..j + degree].iter().sum::<f64>() / degree as f64).collect())
}
