//! Published tables, computed anew from seeds and set beside the printed figures.

pub mod box_splines;
pub mod classical;
pub mod curves;
mod markdown;
pub mod parcnn;
pub mod qi;
mod shapes;
mod voids;
