//! Tests of what the crate offers, in one program: each of its own would be linked anew.

mod blocks;
mod boundaries;
mod closed;
mod common;
mod equations;
mod golden;
mod interpolants;
mod planted;
mod reweighted;
mod smoothing;
mod spaces;
