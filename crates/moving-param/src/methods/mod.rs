//! The methods: each picks terms, safeguards and a schedule.

mod alternating;
mod joint;
mod lbfgs;
pub(crate) mod quasi;
pub(crate) mod square;
pub(crate) mod square_map;
pub(crate) mod unknowns;
