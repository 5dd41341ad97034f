//! Published tables, computed anew from seeds and set beside the printed figures.

pub mod all;
pub mod bidgcn;
pub mod box_splines;
pub mod classical;
mod crossings;
pub mod curves;
mod finished;
mod mapped;
pub(crate) mod markdown;
pub mod moving;
pub mod parcnn;
pub mod pargcn;
pub mod published;
pub mod qi;
pub mod rwls;
mod shapes;
pub mod solids;
pub mod truth;
mod voids;
