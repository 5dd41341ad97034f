//! What is fitted.

use std::sync::Arc;

use thb_core::MultiPatchSpace;

use crate::{Error, Sample};

/// Samples of a surface, and what is known of it.
#[derive(Clone)]
pub struct Problem<'a> {
    /// The patches, with the elements of each.
    pub space: &'a Arc<MultiPatchSpace>,
    /// Of each arc whether the surface may have a kink there.
    pub sharp: &'a [bool],
    /// About how long each patch is along u and along v. Only ratios count.
    pub sizes: &'a [[f64; 2]],
    /// The samples.
    pub samples: Vec<Sample>,
    /// The normal that is right near a point of the surface, given also the normal that the surface has there.
    pub outward: &'a (dyn Fn([f64; 3], [f64; 3]) -> [f64; 3] + Sync),
}

impl Problem<'_> {
    /// Refuses what does not belong to the patches.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let shape = |what, given, expected| {
            if given == expected { Ok(()) } else { Err(thb_core::Error::Shape { what, given, expected }) }
        };
        shape("flags of sharp arcs", self.sharp.len(), self.space.topology().arcs().len())?;
        shape("sizes of patches", self.sizes.len(), self.space.n_patches())?;
        let is_size = |size: &[f64; 2]| size.iter().all(|length| *length > 0.0 && length.is_finite());
        match self.sizes.iter().position(|size| !is_size(size)) {
            Some(patch) => Err(Error::BadSize { patch, size: self.sizes[patch] }),
            None => Ok(()),
        }
    }
}
