//! The univariate part of one level: its knots, its Bézier matrices, and its relation to the next finer level.

use crate::KnotVector;

/// One direction of one level.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    pub(crate) knots: KnotVector,
    /// `(p + 1)²` numbers per span.
    bezier: Vec<f64>,
    /// `(p + 1)²` numbers per span of the *finer* level: entry `(i, j)` is the weight of this level's `i`-th local
    /// coefficient in the finer level's `j`-th local coefficient.
    subdivision: Vec<f64>,
}

impl Level {
    pub(crate) fn new(knots: KnotVector) -> Self {
        let order = knots.degree() + 1;
        let bezier = (0..knots.n_spans()).flat_map(|span| knots.bezier_matrix(span)).collect();
        let fine = knots.refined();
        let rows: Vec<_> = (0..fine.n_functions()).map(|j| knots.coefficient_weights(&fine, j)).collect();
        let mut subdivision = vec![0.0; fine.n_spans() * order * order];
        for (span, matrix) in subdivision.chunks_exact_mut(order * order).enumerate() {
            let coarse_first = knots.first_function(span / 2);
            for j in 0..order {
                let (first, weights) = &rows[fine.first_function(span) + j];
                for i in 0..order {
                    if let Some(k) = (coarse_first + i).checked_sub(*first).filter(|k| *k < order) {
                        matrix[i * order + j] = weights[k];
                    }
                }
            }
        }
        Self { knots, bezier, subdivision }
    }

    /// Bézier matrix of a span of this level.
    pub(crate) fn bezier(&self, span: usize) -> &[f64] {
        let size = (self.knots.degree() + 1).pow(2);
        &self.bezier[span * size..(span + 1) * size]
    }

    /// Subdivision matrix onto a span of the next finer level.
    pub(crate) fn subdivision(&self, fine_span: usize) -> &[f64] {
        let size = (self.knots.degree() + 1).pow(2);
        &self.subdivision[fine_span * size..(fine_span + 1) * size]
    }
}
