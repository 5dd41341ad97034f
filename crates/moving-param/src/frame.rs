//! Residuals and tangents of a map at the parameters of points, and the weights that follow from them.

use std::ops::Range;

use fit_ls::SortedPoints;
use pulp::{Simd, WithSimd};
use rayon::prelude::*;
use thb_core::{BezierMap, SmallCholesky, SplineMap};

use crate::Error;
use crate::points::constraint::Constraints;
use crate::points::foot_point::{check, point};
use crate::points::patch::{MAX_DIM, Patch, Vector, difference, dot};
use crate::terms::springs::Anchor;

/// Residual `s(u) − p` and tangents of the map at one point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame<const D: usize> {
    pub(crate) residual: Vector,
    pub(crate) tangents: [Vector; D],
    /// Stiffness and force of the parameter's spring; zero without an anchor.
    pub(crate) stiffness: [f64; D],
    pub(crate) pull: [f64; D],
}

/// Points of one parallel task.
const CHUNK: usize = 512;

/// The frames of sorted points, in their order.
pub(crate) fn frames<const D: usize>(map: &SplineMap<D>, points: &SortedPoints<D>) -> Result<Vec<Frame<D>>, Error> {
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
            frames.push(Frame { residual, tangents: jet.first, stiffness: [0.0; D], pull: [0.0; D] });
        }
        frames
    }
}

impl<const D: usize> Frame<D> {
    /// `TᵀT`.
    pub(crate) fn metric(&self) -> [[f64; D]; D] {
        std::array::from_fn(|a| std::array::from_fn(|b| dot(&self.tangents[a], &self.tangents[b])))
    }

    /// Hangs the parameter of a point on a spring.
    pub(crate) fn anchored(mut self, anchor: &Anchor<D>, index: usize, u: [f64; D]) -> Self {
        (self.stiffness, self.pull) = (anchor.stiffness(index), anchor.pull(index, u));
        self
    }

    /// The move of the parameter that minimizes `½|residual + T δu|² + ½ μ δuᵀ diag(TᵀT) δu` and the energy of the spring
    /// in the free directions. Zero where the tangents are degenerate.
    pub(crate) fn parameter_step(&self, residual: &Vector, damping: f64, free: [bool; D]) -> [f64; D] {
        self.step_against(residual, &self.pull, damping, free)
    }

    /// The same with another force of the spring.
    pub(crate) fn step_against(&self, residual: &Vector, pull: &[f64; D], damping: f64, free: [bool; D]) -> [f64; D] {
        self.elimination(damping, free).map_or([0.0; D], |factor| self.step_by(&factor, residual, pull))
    }

    /// What moves of the parameter are solved with; `None` where the tangents are degenerate.
    fn elimination(&self, damping: f64, free: [bool; D]) -> Option<SmallCholesky<D>> {
        let metric = self.metric();
        let mut matrix = metric;
        (0..D).for_each(|a| matrix[a][a] += self.stiffness[a]);
        let added = std::array::from_fn(|a| damping.max(LEAST_DAMPING) * metric[a][a]);
        SmallCholesky::new(&matrix, &added, free)
    }

    fn step_by(&self, factor: &SmallCholesky<D>, residual: &Vector, pull: &[f64; D]) -> [f64; D] {
        factor.step(&std::array::from_fn(|a| dot(&self.tangents[a], residual) + pull[a]))
    }

    /// `W v + w` for `W = I − T (TᵀT + μ diag(TᵀT) + K)⁻¹ Tᵀ`, where `w` is the move that the force of the spring makes:
    /// what is left of a vector when the parameter has moved. `μ = 0` leaves the part normal to the map, large `μ` the
    /// vector itself.
    fn reduced(&self, v: &Vector, pull: &[f64; D], elimination: Option<&SmallCholesky<D>>) -> Vector {
        let Some(factor) = elimination else { return *v };
        let step = self.step_by(factor, v, pull);
        let mut rest = *v;
        for a in 0..D {
            (0..4).for_each(|k| rest[k] += step[a] * self.tangents[a][k]);
        }
        rest
    }
}

/// Damping that keeps parallel tangents apart from round-off.
const LEAST_DAMPING: f64 = 1e-12;

/// How a point's distance counts: `γ I + (1 − γ) W(μ)` times its weight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Share {
    /// γ.
    pub(crate) point: f64,
    /// μ.
    pub(crate) damping: f64,
    /// ω.
    pub(crate) weight: f64,
}

/// Columns for [`fit_ls::BlockEquations`]: the weights and minus the weighted residuals.
pub(crate) struct Columns {
    pub(crate) weights: Vec<Vec<f64>>,
    pub(crate) right: Vec<Vec<f64>>,
}

/// The columns of all points; `share` is asked by position, `free` by index.
pub(crate) fn columns<const D: usize>(
    points: &SortedPoints<D>,
    frames: &[Frame<D>],
    constraints: &Constraints<D>,
    share: impl Fn(usize) -> Share + Sync,
) -> Columns {
    let n = points.dim();
    let rows: Vec<([f64; 6], Vector)> = (0..points.len())
        .into_par_iter()
        .with_min_len(CHUNK)
        .map(|at| {
            let Share { point, damping, weight } = share(at);
            let free = constraints.free(points.order()[at] as usize);
            let frame = &frames[at];
            let elimination = if point == 1.0 { None } else { frame.elimination(damping, free) };
            let blend = |v: &Vector, pull: &[f64; D]| -> Vector {
                if point == 1.0 {
                    return v.map(|x| weight * x);
                }
                let reduced = frame.reduced(v, pull, elimination.as_ref());
                std::array::from_fn(|k| weight * (point * v[k] + (1.0 - point) * reduced[k]))
            };
            let mut entries = [0.0; 6];
            let mut next = 0;
            for a in 0..n {
                let mut unit = [0.0; 4];
                unit[a] = 1.0;
                let column = blend(&unit, &[0.0; D]);
                for b in a..n {
                    entries[next] = column[b];
                    next += 1;
                }
            }
            (entries, blend(&frame.residual, &frame.pull))
        })
        .collect();
    debug_assert!(n <= MAX_DIM);
    Columns {
        weights: (0..n * (n + 1) / 2).map(|k| rows.iter().map(|row| row.0[k]).collect()).collect(),
        right: (0..n).map(|k| rows.iter().map(|row| -row.1[k]).collect()).collect(),
    }
}
