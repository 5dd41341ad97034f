//! Univariate matrices of the spans of a level, in the B-splines that do not vanish there.

use std::sync::Arc;

use thb_core::bernstein::{binomial, inner_products};
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector};

use crate::Error;

/// One span of a level in one direction.
#[derive(Clone, Debug)]
pub(crate) struct Span {
    /// `(p + 1)²`: Bernstein coefficients of each B-spline.
    pub(crate) bezier: Vec<f64>,
    /// For each pair of B-splines i ≤ j, row by row, the coefficients of their product's moments: `(2p + 1)` numbers each.
    pub(crate) products: Vec<f64>,
    /// Inner products of derivatives of order 0, 1, 2, `(p + 1)²` each.
    pub(crate) energy: [Vec<f64>; 3],
}

/// The spans of one direction of a level, made when they are needed.
#[derive(Debug)]
pub(crate) struct Spans {
    /// The knots as a univariate space, whose cells know their Bézier matrices.
    space: Arc<HierarchicalSpace<1>>,
    spans: Vec<Option<Span>>,
    unit: Unit,
}

/// What all spans share.
#[derive(Debug)]
struct Unit {
    degree: usize,
    /// Share of the moment `a + b` in the product of Bernstein polynomials `a` and `b`, `(p + 1)²`.
    shares: Vec<f64>,
    /// Inner products of derivatives of order 0, 1, 2 of Bernstein polynomials on the unit interval, `(p + 1)²` each.
    energy: [Vec<f64>; 3],
}

impl Spans {
    pub(crate) fn new(knots: &KnotVector) -> Result<Self, Error> {
        let space = HierarchicalSpace::new(Kind::Thb, [knots.clone()])?;
        let degree = knots.degree();
        let share = |a: usize, b: usize| binomial(degree, a) * binomial(degree, b) / binomial(2 * degree, a + b);
        let unit = Unit {
            degree,
            shares: (0..=degree).flat_map(|a| (0..=degree).map(move |b| share(a, b))).collect(),
            energy: [0, 1, 2].map(|derivative| inner_products(degree, derivative, derivative)),
        };
        Ok(Self { spans: vec![None; space.n_cells()], space: Arc::new(space), unit })
    }

    /// A span that was prepared.
    #[inline(always)]
    pub(crate) fn get(&self, span: usize) -> Option<&Span> {
        self.spans[span].as_ref()
    }

    /// Computes the matrices of a span unless they are there.
    pub(crate) fn prepare(&mut self, span: usize) {
        if self.spans[span].is_none() {
            let cell = self.space.cell(span);
            self.spans[span] = Some(self.unit.span(cell.lower[0], cell.upper[0], cell.bezier[0]));
        }
    }
}

impl Unit {
    fn span(&self, lower: f64, upper: f64, bezier: &[f64]) -> Span {
        let order = self.degree + 1;
        let mut products = Vec::with_capacity(order * (order + 1) / 2 * (2 * order - 1));
        for i in 0..order {
            for j in i..order {
                let mut row = vec![0.0; 2 * order - 1];
                for a in 0..order {
                    for b in 0..order {
                        row[a + b] += self.shares[a * order + b] * bezier[i * order + a] * bezier[j * order + b];
                    }
                }
                products.extend(row);
            }
        }
        let energy = std::array::from_fn(|derivative| {
            // Over a length h, derivatives of order r bring h^{1−2r} times the integral on the unit interval.
            let scale = (upper - lower).powi(1 - 2 * derivative as i32);
            let unit = &self.energy[derivative];
            let entry = |k: usize| {
                let (i, j) = (k / order, k % order);
                let term = |a: usize, b: usize| bezier[i * order + a] * unit[a * order + b] * bezier[j * order + b];
                scale * (0..order * order).map(|ab| term(ab / order, ab % order)).sum::<f64>()
            };
            (0..order * order).map(entry).collect()
        });
        Span { bezier: bezier.to_vec(), products, energy }
    }
}

/// Number of the pair i ≤ j of `order` things, row by row.
pub(crate) fn pair(order: usize, i: usize, j: usize) -> usize {
    let (i, j) = (i.min(j), i.max(j));
    i * order - i * (i + 1) / 2 + j
}
