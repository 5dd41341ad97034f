//! From logits to parameters: softmax, the linear system of the map, and their adjoints.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::lu::{LuSymbolicParams, NumericLu, factorize_symbolic_lu};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Conj, Mat, Par};
use param_classic::ParamError;

use super::edges::EdgeGraph;
use crate::error::NnError;

/// Weights of each neighbourhood from the logits of its edges.
pub(crate) fn softmax(graph: &EdgeGraph, logits: &[f64]) -> Vec<f64> {
    let mut weights = logits.to_vec();
    for i in 0..graph.interior {
        let part = &mut weights[graph.edges_of(i)];
        let largest = part.iter().fold(f64::NEG_INFINITY, |m, x| m.max(*x));
        part.iter_mut().for_each(|x| *x = (*x - largest).exp());
        let sum: f64 = part.iter().sum();
        part.iter_mut().for_each(|x| *x /= sum);
    }
    weights
}

/// Gradient by the logits from that by the weights.
pub(crate) fn softmax_backward(graph: &EdgeGraph, weights: &[f64], given: &[f64]) -> Vec<f64> {
    let mut gradient = Vec::with_capacity(given.len());
    for i in 0..graph.interior {
        let edges = graph.edges_of(i);
        let mean: f64 = edges.clone().map(|e| weights[e] * given[e]).sum();
        gradient.extend(edges.map(|e| weights[e] * (given[e] - mean)));
    }
    gradient
}

/// Parameters of all points: those of the boundary as given, each interior one the weighted mean of its neighbours
/// (Imperatore 2024, (4.12)). `gradient` maps them to the derivatives of a function by the interior ones; the second result
/// is then its gradient by the weights, through the transposed system. It is empty if there are none.
pub(crate) fn solve(
    graph: &EdgeGraph,
    weights: &[f64],
    boundary_uv: &[[f64; 2]],
    gradient: impl FnOnce(&[[f64; 2]]) -> Vec<[f64; 2]>,
) -> Result<(Vec<[f64; 2]>, Vec<f64>), NnError> {
    let n = graph.interior;
    let failed = |reason: String| NnError::from(ParamError::Solve { unknowns: n, reason });
    let mut triplets: Vec<Triplet<usize, usize, f64>> = (0..n).map(|i| Triplet::new(i, i, 1.0)).collect();
    let mut solution = Mat::<f64>::zeros(n, 2);
    for i in 0..n {
        for edge in graph.edges_of(i) {
            let head = graph.leaving.sources[edge] as usize;
            match boundary_uv.get(head.wrapping_sub(n)) {
                Some(uv) => (0..2).for_each(|k| solution[(i, k)] += weights[edge] * uv[k]),
                None => triplets.push(Triplet::new(i, head, -weights[edge])),
            }
        }
    }
    let matrix =
        SparseColMat::<usize, f64>::try_new_from_triplets(n, n, &triplets).map_err(|e| failed(format!("{e:?}")))?;
    let symbolic =
        factorize_symbolic_lu(matrix.symbolic(), LuSymbolicParams::default()).map_err(|e| failed(format!("{e:?}")))?;
    let scratch = symbolic
        .factorize_numeric_lu_scratch::<f64>(Par::Seq, Default::default())
        .or(symbolic.solve_in_place_scratch::<f64>(2, Par::Seq))
        .or(symbolic.solve_transpose_in_place_scratch::<f64>(2, Par::Seq));
    let mut buffer = MemBuffer::try_new(scratch).map_err(|e| failed(format!("{e:?}")))?;
    let stack = MemStack::new(&mut buffer);
    let mut numeric = NumericLu::new();
    // One thread: its callers run side by side, and the last bits do not depend on how many there are.
    let lu = symbolic
        .factorize_numeric_lu(&mut numeric, matrix.as_ref(), Par::Seq, stack, Default::default())
        .map_err(|e| failed(format!("{e:?}")))?;
    lu.solve_in_place_with_conj(Conj::No, solution.as_mut(), Par::Seq, stack);
    // A mean lies in the square; round-off may leave it by a last bit.
    let mut uv: Vec<[f64; 2]> = (0..n).map(|i| [0, 1].map(|k| solution[(i, k)].clamp(0.0, 1.0))).collect();
    if let Some(row) = uv.iter().position(|uv| !uv.iter().all(|x| x.is_finite())) {
        return Err(failed(format!("interior point {row} comes out as {:?}", uv[row])));
    }
    uv.extend_from_slice(boundary_uv);
    let given = gradient(&uv);
    if given.is_empty() {
        return Ok((uv, Vec::new()));
    }
    let mut adjoint = Mat::from_fn(n, 2, |i, k| given[i][k]);
    lu.solve_transpose_in_place_with_conj(Conj::No, adjoint.as_mut(), Par::Seq, stack);
    let mut by_weights = Vec::with_capacity(weights.len());
    for i in 0..n {
        for edge in graph.edges_of(i) {
            let head = uv[graph.leaving.sources[edge] as usize];
            by_weights.push(adjoint[(i, 0)] * head[0] + adjoint[(i, 1)] * head[1]);
        }
    }
    Ok((uv, by_weights))
}
