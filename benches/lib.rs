//! Shared helpers of the benches: the problem that is timed, and the floor kernels it is compared with.

pub mod floor;
pub mod memory;
pub mod problem;
