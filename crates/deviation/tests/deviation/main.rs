//! Tests of what the crate offers, in one program: each of its own would be linked anew.

mod common;
mod distances;
