//! Published tables, computed anew from seeds and set beside the printed figures.

pub mod classical;
mod markdown;
