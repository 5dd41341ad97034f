//! Residuals and tangents of a map at the parameters of points.

use fit_ls::SortedPoints;
use pulp::{Simd, WithSimd};
use rayon::prelude::*;
use thb_core::{BezierMap, ParameterBox, SplineMap};

use crate::Error;
use crate::points::check::check;
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
pub(crate) fn frames_at<const D: usize, S: ParameterBox<D>>(
    map: &SplineMap<D, S>,
    points: &SortedPoints<D>,
) -> Result<Vec<Frame<D>>, Error> {
    let mut frames = Vec::new();
    frames_into(map, points, &mut frames)?;
    Ok(frames)
}

/// The same in a buffer that is used again.
pub(crate) fn frames_into<const D: usize, S: ParameterBox<D>>(
    map: &SplineMap<D, S>,
    points: &SortedPoints<D>,
    frames: &mut Vec<Frame<D>>,
) -> Result<(), Error> {
    check(map, points)?;
    let map = map.bezier();
    frames.resize(points.len(), Frame { residual: [0.0; 4], tangents: [[0.0; 4]; D] });
    frames.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, frames)| {
        pulp::Arch::new().dispatch(Chunk { map, points, first: chunk * CHUNK, frames });
    });
    Ok(())
}

struct Chunk<'a, const D: usize> {
    map: &'a BezierMap<D>,
    points: &'a SortedPoints<D>,
    first: usize,
    frames: &'a mut [Frame<D>],
}

impl<const D: usize> WithSimd for Chunk<'_, D> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { map, points, first, frames } = self;
        let mut around = PatchOfPlace::new(map, points, first);
        for (at, frame) in (first..).zip(frames) {
            let jet = around.at(at).first_jet(points.parameter(at));
            *frame = Frame { residual: difference(&jet.value, &point(points, at)), tangents: jet.first };
        }
    }
}

/// The polynomial of the cell of one sorted point after the other.
pub(crate) struct PatchOfPlace<'a, const D: usize> {
    map: &'a BezierMap<D>,
    offsets: &'a [usize],
    cell: usize,
    patch: Patch<D>,
}

impl<'a, const D: usize> PatchOfPlace<'a, D> {
    pub(crate) fn new(map: &'a BezierMap<D>, points: &'a SortedPoints<D>, first: usize) -> Self {
        let offsets = points.offsets();
        let cell = offsets.partition_point(|&o| o <= first) - 1;
        Self { map, offsets, cell, patch: Patch::new(map, cell) }
    }

    /// The polynomial at a place that is not before the last one asked for.
    #[inline(always)]
    pub(crate) fn at(&mut self, place: usize) -> &Patch<D> {
        while self.offsets[self.cell + 1] <= place {
            self.cell += 1;
        }
        if self.patch.cell() != self.cell {
            self.patch.load(self.map, self.cell);
        }
        &self.patch
    }
}
