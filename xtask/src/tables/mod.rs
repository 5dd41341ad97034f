//! Published tables, computed anew from seeds and set beside the printed figures.

pub mod classical;
mod crossings;
mod markdown;
pub mod parcnn;
pub mod qi;
pub mod rwls;
mod voids;
