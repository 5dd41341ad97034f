//! A surface of several patches.

use thb_core::{MultiPatchSpace, SplineMap};

/// A surface of several patches in space.
pub type Surface = SplineMap<2, MultiPatchSpace>;
