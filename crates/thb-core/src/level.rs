//! The univariate part of one level: its knots, its Bézier matrices, and its relation to the next finer level.

use crate::KnotVector;
use crate::knots::Row;

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
        let rows: Vec<_> = (0..fine.n_images()).map(|j| knots.coefficient_weights(&fine, j)).collect();
        let mut subdivision = vec![0.0; fine.n_spans() * order * order];
        for (span, matrix) in subdivision.chunks_exact_mut(order * order).enumerate() {
            let fine_first = fine.first_function(span);
            local_weights(matrix, knots.first_function(span / 2), &rows[fine_first..fine_first + order]);
        }
        Self { knots, bezier, subdivision }
    }

    /// Matrix from the local coefficients on a span of a periodic level to those of the opened knots, in the layout of the
    /// subdivision matrices.
    pub(crate) fn opening(&self, opened: &KnotVector, span: usize) -> Vec<f64> {
        let order = self.knots.degree() + 1;
        let first = opened.first_function(span);
        let rows: Vec<_> = (first..first + order).map(|j| self.knots.coefficient_weights(opened, j)).collect();
        let mut matrix = vec![0.0; order * order];
        local_weights(&mut matrix, self.knots.first_function(span), &rows);
        matrix
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

/// Fills a square matrix with the weights of the coarse coefficients `coarse_first..` in some fine coefficients, one column
/// per fine coefficient.
fn local_weights(matrix: &mut [f64], coarse_first: usize, fine: &[(isize, Row)]) {
    let order = fine.len();
    for (j, (first, weights)) in fine.iter().enumerate() {
        for i in 0..order {
            let k = usize::try_from((coarse_first + i) as isize - first).ok().filter(|k| *k < order);
            if let Some(k) = k {
                matrix[i * order + j] = weights[k];
            }
        }
    }
}
