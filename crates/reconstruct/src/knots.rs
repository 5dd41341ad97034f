//! Knots of the spaces that this crate begins with.

use thb_core::KnotVector;

use crate::Error;

/// Even knots over the unit interval.
pub(crate) fn uniform_knots(degree: usize, elements: usize, closed: bool) -> Result<KnotVector, Error> {
    Ok(if closed { KnotVector::uniform_periodic(degree, elements)? } else { KnotVector::uniform(degree, elements)? })
}
