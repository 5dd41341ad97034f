//! A smooth map of the domain by few control points.

use ndarray::Array2;
use thb_core::{HierarchicalSpace, KnotVector};

use crate::Error;
use crate::terms::map_barrier::MapBarrier;

/// Degree of the map, unless it has too few control points.
const DEGREE: usize = 3;

/// The map `Φ` of the domain, with what the points need of it.
#[derive(Clone, Debug)]
pub(crate) struct SquareMap<const D: usize> {
    pub(super) knots: KnotVector,
    /// Control points, `(per_side^D, D)`; the first direction runs fastest.
    pub(super) control_points: Vec<[f64; D]>,
    /// Control point and direction of each unknown: none leaves its side.
    pub(super) free: Vec<(usize, usize)>,
    /// For each point, by index, the functions that do not vanish at its first parameter.
    pub(super) active: Vec<Vec<(u32, f64)>>,
    pub(super) barrier: MapBarrier<D>,
}

impl<const D: usize> SquareMap<D> {
    /// The identity with `per_side` control points in each direction, for points at first parameters `(m, D)`.
    pub(super) fn identity(per_side: usize, space: &HierarchicalSpace<D>, start: &Array2<f64>) -> Result<Self, Error> {
        let degree = DEGREE.min(per_side - 1);
        let (lower, upper) = space.domain();
        let knots = KnotVector::uniform(degree, per_side - degree)?;
        let sites = knots.greville();
        let count = per_side.pow(D as u32);
        let along = |j: usize, d: usize| j / per_side.pow(d as u32) % per_side;
        let control_points = (0..count)
            .map(|j| std::array::from_fn(|d| lower[d] + sites[along(j, d)] * (upper[d] - lower[d])))
            .collect();
        let is_free = |&(j, d): &(usize, usize)| (1..per_side - 1).contains(&along(j, d));
        let free = (0..count).flat_map(|j| (0..D).map(move |d| (j, d))).filter(is_free).collect();
        let unit = |row: ndarray::ArrayView1<'_, f64>| -> [f64; D] {
            std::array::from_fn(|d| ((row[d] - lower[d]) / (upper[d] - lower[d])).clamp(0.0, 1.0))
        };
        let active = start.outer_iter().map(|row| products(&knots, unit(row))).collect::<Result<_, Error>>()?;
        let barrier = MapBarrier::new(&knots, std::array::from_fn(|d| upper[d] - lower[d]))?;
        Ok(Self { knots, control_points, free, active, barrier })
    }

    /// Control points per direction.
    pub(super) fn per_side(&self) -> usize {
        self.knots.n_functions()
    }

    /// The parameter of a point, by index.
    pub(super) fn parameter(&self, index: usize) -> [f64; D] {
        let mut u = [0.0; D];
        for &(j, share) in &self.active[index] {
            (0..D).for_each(|d| u[d] += share * self.control_points[j as usize][d]);
        }
        u
    }

    /// The map after a step of the unknowns.
    pub(super) fn stepped(&self, step: &[f64]) -> Self {
        let mut next = self.clone();
        for (&(j, d), x) in self.free.iter().zip(step) {
            next.control_points[j][d] += x;
        }
        next
    }

    /// The place of each pair of control point and direction among the unknowns, at `j D + d`.
    pub(super) fn places(&self) -> Vec<Option<u32>> {
        let mut places = vec![None; self.control_points.len() * D];
        for (place, &(j, d)) in self.free.iter().enumerate() {
            places[j * D + d] = Some(place as u32);
        }
        places
    }
}

/// The tensor products of the B-splines that do not vanish at a parameter of the unit cube, with their numbers.
pub(crate) fn products<const D: usize>(knots: &KnotVector, u: [f64; D]) -> Result<Vec<(u32, f64)>, Error> {
    let count = knots.n_functions();
    let mut all = vec![(0_u32, 1.0)];
    for d in (0..D).rev() {
        let (first, values) = knots.basis(u[d])?;
        all = all
            .iter()
            .flat_map(|&(j, share)| {
                values.iter().enumerate().map(move |(i, x)| (j * count as u32 + (first + i) as u32, share * x))
            })
            .collect();
    }
    Ok(all)
}
