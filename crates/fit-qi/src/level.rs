//! Coefficients of many functions of one level.

use std::collections::BTreeMap;

use fit_ls::SortedPoints;
use rayon::prelude::*;
use thb_core::unravel;

use crate::cells::{Layout, LevelCells};
use crate::local::{Chosen, Demand, LocalSolver, Verdict, choose};
use crate::order::MortonOrder;
use crate::region::Region;
use crate::{Error, LocalLambda};

/// Functions of one parallel task: enough to share the memory of a solver.
const CHUNK: usize = 64;

/// The solver of local problems of all levels.
#[derive(Debug)]
pub(crate) struct LevelSolver<'a, const D: usize> {
    pub(crate) levels: &'a mut [LevelCells<D>],
    pub(crate) order: &'a MortonOrder<D>,
    pub(crate) points: &'a SortedPoints<D>,
    pub(crate) demand: Demand,
    pub(crate) lambda: LocalLambda,
    pub(crate) layout: Layout<D>,
}

/// Coefficients of functions of a level, and how they were found.
#[derive(Debug, Default)]
pub(crate) struct Found {
    /// One row per function, in their order.
    pub(crate) rows: Vec<f64>,
    pub(crate) collinear: Vec<u64>,
    pub(crate) inherited: usize,
    pub(crate) enlarged: usize,
    pub(crate) max_rings: usize,
    pub(crate) weakest: f64,
    pub(crate) summed: usize,
}

impl<const D: usize> LevelSolver<'_, D> {
    /// The coefficients of functions of a level, given by increasing tensor indices.
    pub(crate) fn coefficients(&mut self, level: usize, functions: &[u64]) -> Result<Found, Error> {
        let columns = self.layout.columns;
        let counts: [usize; D] = std::array::from_fn(|d| self.levels[level].knots[d].n_functions());
        let before = self.levels[level].summed;
        let mut found = Found { rows: vec![0.0; functions.len() * columns], weakest: 1.0, ..Found::default() };
        let mut poor = Vec::new();
        let start = |(at, &function): (usize, &u64)| Pending {
            at,
            index: unravel(function as usize, counts),
            region: Region::support(&self.levels[level].knots, unravel(function as usize, counts)),
            rings: 0,
        };
        let mut pending: Vec<Pending<D>> = functions.iter().enumerate().map(start).collect();
        // Usually one round; what a region does not determine, or determines by extrapolation, is tried again in a larger
        // one.
        while !pending.is_empty() {
            let mut next = Vec::new();
            for (Pending { at, index, .. }, solved) in self.round(level, &pending)? {
                let Some((chosen, verdict, row)) = solved else {
                    poor.push(at);
                    continue;
                };
                match verdict {
                    Verdict::Solved(left) => found.weakest = found.weakest.min(left),
                    Verdict::Collinear => found.collinear.push(functions[at]),
                    Verdict::Undetermined(_) | Verdict::OneSided => {
                        let lambda = if let Verdict::Undetermined(lambda) = verdict { lambda } else { 0.0 };
                        let (function, points) = (functions[at] as usize, chosen.points);
                        let grown = chosen.region.grown(&self.levels[level].knots);
                        let region = grown.ok_or(Error::NotDetermined { function, level, points, lambda })?;
                        next.push(Pending { at, index, region, rings: chosen.rings + 1 });
                        continue;
                    }
                }
                found.enlarged += usize::from(chosen.rings > 0);
                found.max_rings = found.max_rings.max(chosen.rings);
                found.rows[at * columns..(at + 1) * columns].copy_from_slice(&row);
            }
            pending = next;
        }
        found.summed = self.levels[level].summed - before;
        found.inherited = poor.len();
        if !poor.is_empty() {
            self.inherit(level, functions, &poor, counts, &mut found)?;
        }
        Ok(found)
    }

    /// Coefficients of functions that have too few points near them: those that the quasi-interpolant of the coarser level
    /// has in the B-splines of this level. Polynomials are reproduced as by the coarser level.
    fn inherit(
        &mut self,
        level: usize,
        functions: &[u64],
        poor: &[usize],
        counts: [usize; D],
        found: &mut Found,
    ) -> Result<(), Error> {
        let (coarse, fine) = (&self.levels[level - 1].knots, &self.levels[level].knots);
        let coarse_counts: [usize; D] = std::array::from_fn(|d| coarse[d].n_functions());
        let order = self.layout.degree.map(|p| p + 1);
        let mut shares: Vec<(usize, u64, f64)> = Vec::new();
        for &at in poor {
            let index = unravel(functions[at] as usize, counts);
            let weights: [(isize, _); D] = std::array::from_fn(|d| coarse[d].coefficient_weights(&fine[d], index[d]));
            for local in 0..order.iter().product() {
                let local: [usize; D] = unravel(local, order);
                let weight: f64 = (0..D).map(|d| weights[d].1[local[d]]).product();
                if weight != 0.0 {
                    let function = (0..D).rev().fold(0, |linear, d| {
                        let k = (weights[d].0 + local[d] as isize).rem_euclid(coarse_counts[d] as isize);
                        linear * coarse_counts[d] as u64 + k as u64
                    });
                    shares.push((at, function, weight));
                }
            }
        }
        let mut place: BTreeMap<u64, usize> = shares.iter().map(|&(_, function, _)| (function, 0)).collect();
        place.values_mut().enumerate().for_each(|(k, place)| *place = k);
        let parents: Vec<u64> = place.keys().copied().collect();
        let of_parents = self.coefficients(level - 1, &parents)?;
        found.summed += of_parents.summed;
        found.weakest = found.weakest.min(of_parents.weakest);
        let columns = self.layout.columns;
        for (at, function, weight) in shares {
            let row = &of_parents.rows[place[&function] * columns..][..columns];
            let target = &mut found.rows[at * columns..(at + 1) * columns];
            target.iter_mut().zip(row).for_each(|(t, x)| *t += weight * x);
        }
        Ok(())
    }

    /// Solves local problems, each in the smallest sufficient region that holds the given one, as far as there is one. Each
    /// result is a function of its problem only, so the number of threads does not matter.
    fn round<'p>(
        &mut self,
        level: usize,
        pending: &'p [Pending<D>],
    ) -> Result<impl Iterator<Item = (Pending<D>, Option<Solved<D>>)> + use<'p, D>, Error> {
        // Level 0 has no coarser one to inherit from.
        let rings = if level == 0 { usize::MAX } else { self.demand.rings };
        let demand = Demand { rings, ..self.demand };
        let (order, layout, lambda) = (self.order, self.layout, self.lambda);
        let cells = &mut self.levels[level];
        let chosen: Vec<Option<Chosen<D>>> = pending
            .par_iter()
            .with_min_len(CHUNK)
            .map(|task| choose(cells, order, demand, task.region, task.rings))
            .collect();
        let knots = cells.knots.clone();
        for Chosen { region, .. } in chosen.iter().flatten() {
            for d in 0..D {
                for place in 0..region.len[d] {
                    cells.spans[d].prepare(region.span(&knots, d, place));
                }
            }
        }
        let needed = chosen.iter().flatten().flat_map(|Chosen { region, cells, .. }| {
            let knots = &knots;
            let spans = move |place: [u32; D]| std::array::from_fn(|d| region.span(knots, d, place[d] as usize));
            cells.iter().map(move |&(cell, place)| (cell, spans(place)))
        });
        cells.sum(self.points, needed)?;
        let cells = &*cells;
        let solved: Vec<Option<(Verdict, Vec<f64>)>> = pending
            .par_iter()
            .zip(&chosen)
            .with_min_len(CHUNK)
            .map_init(
                || LocalSolver::new(layout),
                |solver, (task, chosen)| {
                    let mut row = vec![0.0; layout.columns];
                    let verdict = solver.solve(cells, chosen.as_ref()?, task.index, lambda, &mut row);
                    Some((verdict, row))
                },
            )
            .collect();
        let all = pending.iter().zip(chosen).zip(solved);
        Ok(all.map(|((task, chosen), solved)| {
            (*task, chosen.zip(solved).map(|(chosen, (verdict, row))| (chosen, verdict, row)))
        }))
    }
}

/// A function whose coefficient is to be found.
#[derive(Clone, Copy, Debug)]
struct Pending<const D: usize> {
    /// Its place among the functions asked for.
    at: usize,
    index: [usize; D],
    region: Region<D>,
    rings: usize,
}

/// The region of a problem, what came of it, and the coefficient.
type Solved<const D: usize> = (Chosen<D>, Verdict, Vec<f64>);
