//! The linear system of a convex-combination map.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::lu::{LuSymbolicParams, NumericLu, factorize_symbolic_lu};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Conj, Mat, Par};

use crate::ParamError;

/// `(vertex, neighbour, weight)`; several entries of one pair add up.
pub(crate) type WeightEntry = (u32, u32, f64);

/// A vertex is the weighted mean of its neighbours; some vertices are fixed.
pub(crate) struct BarycentricSystem {
    /// Row of each vertex in the system; `None` for the fixed ones.
    unknown: Vec<Option<usize>>,
    /// The entries of all rows, one after another, weights of a row summing to 1, sorted by neighbour.
    entries: Vec<(u32, f64)>,
    /// Where each row begins in `entries`, and the end.
    starts: Vec<usize>,
    /// What is added to the mean of the first coordinate in each row.
    jumps: Vec<f64>,
}

impl BarycentricSystem {
    /// Collects the weights; those of fixed vertices are passed over.
    pub(crate) fn new(fixed: &[bool], mut weights: Vec<WeightEntry>) -> Self {
        let mut count = 0;
        let unknown: Vec<Option<usize>> = fixed
            .iter()
            .map(|&f| {
                count += usize::from(!f);
                (!f).then(|| count - 1)
            })
            .collect();
        weights.retain(|(i, _, _)| !fixed[*i as usize]);
        // A stable sort keeps the order of the summands, and with it the last bit of the sums.
        weights.sort_by_key(|(i, j, _)| (*i, *j));
        let mut entries = Vec::with_capacity(weights.len() / 2);
        let mut starts = vec![0];
        for row in weights.chunk_by(|a, b| a.0 == b.0) {
            let total: f64 = row.iter().map(|(_, _, w)| w).sum();
            for pair in row.chunk_by(|a, b| a.1 == b.1) {
                entries.push((pair[0].1, pair.iter().map(|(_, _, w)| w).sum::<f64>() / total));
            }
            starts.push(entries.len());
        }
        let jumps = vec![0.0; starts.len() - 1];
        Self { unknown, entries, starts, jumps }
    }

    /// The same system where the first coordinate wraps: `jumps` has, for each vertex, the mean of the whole turns by which its
    /// neighbours are farther than they say.
    pub(crate) fn with_jumps(mut self, jumps: &[f64]) -> Self {
        for (row, jump) in self.unknown.iter().zip(jumps) {
            if let Some(row) = *row {
                self.jumps[row] = *jump;
            }
        }
        self
    }

    /// Number of unknown vertices.
    pub(crate) fn unknowns(&self) -> usize {
        self.starts.len() - 1
    }

    /// The neighbours of an unknown vertex with their weights; nothing for a fixed one.
    pub(crate) fn neighbours(&self, vertex: usize) -> &[(u32, f64)] {
        match self.unknown[vertex] {
            Some(row) => &self.entries[self.starts[row]..self.starts[row + 1]],
            None => &[],
        }
    }

    /// Solves for the unknown vertices in place; the fixed ones in `uv` are given.
    pub(crate) fn solve(&self, uv: &mut [[f64; 2]]) -> Result<(), ParamError> {
        let n = self.unknowns();
        if n == 0 {
            return Ok(());
        }
        let failed = |reason: String| ParamError::Solve { unknowns: n, reason };
        let mut triplets = Vec::with_capacity(n + self.entries.len());
        let mut solution = Mat::<f64>::zeros(n, 2);
        for (vertex, row) in self.unknown.iter().enumerate() {
            let Some(row) = *row else { continue };
            triplets.push(Triplet::new(row, row, 1.0));
            solution[(row, 0)] = self.jumps[row];
            for &(neighbour, weight) in self.neighbours(vertex) {
                match self.unknown[neighbour as usize] {
                    Some(column) => triplets.push(Triplet::new(row, column, -weight)),
                    None => {
                        for k in 0..2 {
                            solution[(row, k)] += weight * uv[neighbour as usize][k];
                        }
                    }
                }
            }
        }
        let matrix =
            SparseColMat::<usize, f64>::try_new_from_triplets(n, n, &triplets).map_err(|e| failed(format!("{e:?}")))?;
        // The low-level calls take the parallelism as an argument; the high-level ones read a process-wide setting, on
        // which the last bits would depend.
        let symbolic = factorize_symbolic_lu(matrix.symbolic(), LuSymbolicParams::default())
            .map_err(|e| failed(format!("{e:?}")))?;
        let scratch = symbolic
            .factorize_numeric_lu_scratch::<f64>(Par::Seq, Default::default())
            .or(symbolic.solve_in_place_scratch::<f64>(2, Par::Seq));
        let mut buffer = MemBuffer::try_new(scratch).map_err(|e| failed(format!("{e:?}")))?;
        let stack = MemStack::new(&mut buffer);
        let mut numeric = NumericLu::new();
        let lu = symbolic
            .factorize_numeric_lu(&mut numeric, matrix.as_ref(), Par::Seq, stack, Default::default())
            .map_err(|e| failed(format!("{e:?}")))?;
        lu.solve_in_place_with_conj(Conj::No, solution.as_mut(), Par::Seq, stack);
        for (vertex, row) in self.unknown.iter().enumerate() {
            let Some(row) = *row else { continue };
            uv[vertex] = [solution[(row, 0)], solution[(row, 1)]];
            // A singular matrix shows only here: the factorization reports success.
            if !uv[vertex].iter().all(|x| x.is_finite()) {
                return Err(failed(format!("vertex {vertex} comes out as {:?}", uv[vertex])));
            }
        }
        Ok(())
    }

    /// Largest distance, in the maximum norm, of an unknown vertex from the mean of its neighbours.
    pub(crate) fn residual(&self, uv: &[[f64; 2]]) -> f64 {
        let mut worst = 0.0f64;
        for (vertex, &at) in uv.iter().enumerate() {
            let Some(row) = self.unknown[vertex] else { continue };
            for k in 0..2 {
                let sum: f64 = self.neighbours(vertex).iter().map(|&(j, w)| w * uv[j as usize][k]).sum();
                let mean = sum + if k == 0 { self.jumps[row] } else { 0.0 };
                worst = worst.max((at[k] - mean).abs());
            }
        }
        worst
    }
}
