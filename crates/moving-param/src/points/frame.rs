//! Residuals and tangents of a map at the parameters of points.

use std::ops::Range;

use fit_ls::SortedPoints;
use pulp::{Simd, WithSimd};
use rayon::prelude::*;
use thb_core::{BezierMap, CellSpace, SplineMap};

use crate::Error;
use crate::points::foot_point::check;
use crate::points::patch::Patch;
use crate::points::vector::{Vector, difference, dot, point};

/// Residual `s(u) − p` and tangents of the map at one point.
#[derive(Clone, Copy, Debug)]
pub struct Frame<const D: usize> {
    /// The residual, padded with zeros.
    pub residual: Vector,
    /// The derivatives of the map by the parameters.
    pub tangents: [Vector; D],
}

impl<const D: usize> Frame<D> {
    /// `|s(u) − p|`.
    pub(crate) fn distance(&self) -> f64 {
        dot(&self.residual, &self.residual).sqrt()
    }
}

/// Points of one parallel task.
const CHUNK: usize = 512;

/// The frames of sorted points, in their order.
pub(crate) fn frames_at<const D: usize, S: CellSpace<D>>(
    map: &SplineMap<D, S>,
    points: &SortedPoints<D>,
) -> Result<Vec<Frame<D>>, Error> {
    check(map, points)?;
    let chunks: Vec<Vec<Frame<D>>> = (0..points.len().div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let range = chunk * CHUNK..(chunk * CHUNK + CHUNK).min(points.len());
            pulp::Arch::new().dispatch(Chunk { map: map.bezier(), points, range })
        })
        .collect();
    Ok(chunks.concat())
}

struct Chunk<'a, const D: usize> {
    map: &'a BezierMap<D>,
    points: &'a SortedPoints<D>,
    range: Range<usize>,
}

impl<const D: usize> WithSimd for Chunk<'_, D> {
    type Output = Vec<Frame<D>>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        let Self { map, points, range } = self;
        let offsets = points.offsets();
        let mut cell = offsets.partition_point(|&o| o <= range.start) - 1;
        let mut patch = Patch::new(map, cell);
        let mut frames = Vec::with_capacity(range.len());
        for at in range {
            while offsets[cell + 1] <= at {
                cell += 1;
            }
            if patch.cell() != cell {
                patch.load(map, cell);
            }
            let jet = patch.first_jet(points.parameter(at));
            let residual = difference(&jet.value, &point(points, at));
            frames.push(Frame { residual, tangents: jet.first });
        }
        frames
    }
}
