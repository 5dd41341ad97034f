//! Spaces and maps from a file's numbers, without trust in their size.

use std::sync::Arc;

use ndarray::Array2;
use point_cloud::MAX_COORDINATE;
use thb_core::{HierarchicalMesh, HierarchicalSpace, Kind, KnotVector, MAX_LEVELS, SplineMap};

use super::ModelErrorKind;

/// Most spans of the finest level in one direction. Univariate relations of all spans of all levels are stored, about
/// 48 (p+1)² bytes for each finest one: a short file that asks for 15 levels on many elements would fill the memory.
/// 2¹⁸ are 1000 elements refined eight times, at most 0.2 GB at degree 3.
const MAX_FINEST_SPANS: usize = 1 << 18;

/// What a file says of a spline map.
pub(super) struct Parts<const D: usize> {
    pub(super) kind: Kind,
    pub(super) knots: [KnotVector; D],
    pub(super) coefficients: Array2<f64>,
}

impl<const D: usize> Parts<D> {
    /// Number of cells of level 0 per direction.
    pub(super) fn grid(&self) -> [usize; D] {
        std::array::from_fn(|d| self.knots[d].n_spans())
    }

    /// Refuses sizes that the coefficients contradict, before anything of those sizes is built.
    ///
    /// Splines of level 0 lie in every refinement's span, so their number bounds the number of coefficients from below.
    pub(super) fn check_size(&self, n_levels: usize) -> Result<(), ModelErrorKind> {
        if n_levels > MAX_LEVELS {
            let (given, limit) = (n_levels as u64, MAX_LEVELS as u64);
            return Err(ModelErrorKind::TooLarge { what: "number of levels", given, limit });
        }
        let coarse = self.knots.iter().fold(1_usize, |product, knots| product.saturating_mul(knots.n_functions()));
        let found = self.coefficients.nrows();
        if coarse > found {
            let expected = format!("at least {coarse}, the number of B-splines of level 0,");
            return Err(ModelErrorKind::Count { what: "coefficients", found, expected });
        }
        let finest = self.grid().iter().map(|&n| n << n_levels.saturating_sub(1)).max().unwrap_or(0);
        if finest > MAX_FINEST_SPANS {
            let (given, limit) = (finest as u64, MAX_FINEST_SPANS as u64);
            return Err(ModelErrorKind::TooLarge { what: "cells of the finest level in one direction", given, limit });
        }
        Ok(())
    }

    /// The map on a mesh. Coefficients that points could not have are refused: squares of them overflow.
    pub(super) fn map(self, mesh: HierarchicalMesh<D>) -> Result<SplineMap<D>, ModelErrorKind> {
        let is_usable = |value: f64| value.abs() <= MAX_COORDINATE;
        if let Some(((row, _), &value)) = self.coefficients.indexed_iter().find(|&(_, &value)| !is_usable(value)) {
            return Err(ModelErrorKind::Coefficient { row, value, limit: MAX_COORDINATE });
        }
        let space = HierarchicalSpace::new(self.kind, self.knots)?.with_mesh(mesh)?;
        Ok(SplineMap::new(Arc::new(space), self.coefficients)?)
    }
}
