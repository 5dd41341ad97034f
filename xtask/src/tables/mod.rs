//! Published tables, computed anew from seeds and set beside the printed figures.

pub mod bidgcn;
pub mod classical;
mod mapped;
mod markdown;
pub mod parcnn;
pub mod pargcn;
pub mod qi;
mod voids;
