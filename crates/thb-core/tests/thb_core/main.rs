//! Tests of what the crate offers, in one program: each of its own would be linked anew.

mod box_splines;
mod closest;
mod common;
mod multi_patch;
mod periodic;
mod theorems;
