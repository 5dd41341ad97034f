//! What can be wrong with the input of a spline space.

use thiserror::Error;

use crate::TopologyError;

/// Errors of this crate.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// The degree is not between 1 and the limit (0 is allowed nowhere: the surfaces would not be continuous).
    #[error("degree {given} is not between 1 and {limit}")]
    Degree {
        /// The degree asked for.
        given: usize,
        /// The largest degree.
        limit: usize,
    },
    /// Too few knots for one element.
    #[error("{given} knots are too few for degree {degree}: at least {needed} are needed")]
    TooFewKnots {
        /// Number of knots.
        given: usize,
        /// The degree.
        degree: usize,
        /// Smallest number of knots, `2 (degree + 1)`.
        needed: usize,
    },
    /// A span that has no number in its middle.
    #[error(
        "a knot span of direction {direction} is too narrow for level {level}: the middle between its ends rounds to one of them"
    )]
    SpanTooNarrow {
        /// The direction, from 0.
        direction: usize,
        /// The level that would halve it.
        level: usize,
    },
    /// The number of elements is zero or beyond what cell indices can hold.
    #[error("{given} elements in a direction: between 1 and {limit} are possible")]
    Elements {
        /// Number of elements asked for.
        given: usize,
        /// The largest number.
        limit: usize,
    },
    /// A knot is not finite or smaller than its predecessor.
    #[error("knot {index} = {value} is not finite or smaller than the knot before it")]
    KnotOrder {
        /// Index of the knot, from 0.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// A knot is so large that lengths between knots would overflow.
    #[error("knot {value:e} is beyond {limit:e}")]
    KnotRange {
        /// The knot.
        value: f64,
        /// The largest absolute value of a knot.
        limit: f64,
    },
    /// A span so short that quotients of lengths would overflow, or that it vanishes a period on.
    #[error("the knot span from {lower:e} to {upper:e} is shorter than {limit:e}, the least that can be computed with")]
    KnotSpan {
        /// The lower end.
        lower: f64,
        /// The upper end.
        upper: f64,
        /// The shortest length of a span here.
        limit: f64,
    },
    /// A knot occurs too often, or an end knot not often enough.
    #[error(
        "knot {value} occurs {given} times; degree {degree} asks for {degree}+1 times at the ends and at most as often inside"
    )]
    Multiplicity {
        /// The knot.
        value: f64,
        /// How often it occurs.
        given: usize,
        /// The degree.
        degree: usize,
    },
    /// A knot of a periodic vector occurs twice.
    #[error("knot {index} = {value} occurs twice: the knots of a periodic direction are simple")]
    RepeatedKnot {
        /// Index of the knot, from 0.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// Too few elements in a periodic direction: a B-spline would overlap itself.
    #[error("{given} elements are too few in a periodic direction of degree {degree}: at least {needed} are needed")]
    TooFewPeriodicElements {
        /// Number of elements.
        given: usize,
        /// The degree.
        degree: usize,
        /// Smallest number of elements, `degree + 1`.
        needed: usize,
    },
    /// Periodic knots where only open ones are possible.
    #[error("the knots of direction {direction} are periodic: open them first")]
    PeriodicKnots {
        /// The direction, from 0.
        direction: usize,
    },
    /// A parameter lies outside the domain, or is not finite.
    #[error("parameter {value} in direction {direction} lies outside the domain [{lower}, {upper}]")]
    OutsideDomain {
        /// The parameter.
        value: f64,
        /// The direction, from 0.
        direction: usize,
        /// Lower end of the domain.
        lower: f64,
        /// Upper end of the domain.
        upper: f64,
    },
    /// An array has a wrong number of rows or columns.
    #[error("{what}: {given} given, {expected} expected")]
    Shape {
        /// What was counted.
        what: &'static str,
        /// The number found.
        given: usize,
        /// The number expected.
        expected: usize,
    },
    /// A coefficient is NaN or infinite.
    #[error("coefficient {row}, component {component}, is not finite")]
    NotFinite {
        /// Row of the coefficient.
        row: usize,
        /// Component within the row.
        component: usize,
    },
    /// More levels than the crate stores.
    #[error("level {given} is beyond the finest possible level {limit}")]
    TooManyLevels {
        /// The level asked for, from 0.
        given: usize,
        /// The finest level possible.
        limit: usize,
    },
    /// A cell, named by level and index, is not part of the grid of its level.
    #[error("cell {index} of level {level} in direction {direction} does not exist: the level has {cells} cells there")]
    NoSuchCell {
        /// Level, from 0.
        level: usize,
        /// The direction, from 0.
        direction: usize,
        /// Index of the cell.
        index: usize,
        /// Number of cells in that direction.
        cells: usize,
    },
    /// Coefficients can be transferred to a refinement of the same space only.
    #[error("the target space is no refinement of the source space: {reason}")]
    NotNested {
        /// What differs.
        reason: &'static str,
    },
    /// Patches cannot be glued.
    #[error(transparent)]
    Topology(#[from] TopologyError),
    /// A place names a patch that does not exist.
    #[error("patch {patch} does not exist: there are {patches}")]
    NoSuchPatch {
        /// The patch.
        patch: usize,
        /// Number of patches.
        patches: usize,
    },
}
