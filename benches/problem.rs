//! The peaks problem: scattered points of a height field with three cusps, fitted adaptively.

use std::ops::ControlFlow;
use std::sync::Arc;

use adaptive::{Iteration, Outcome, run};
use fit_ls::{Lambda, LeastSquares};
use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use thb_core::{HierarchicalSpace, Kind, KnotVector, Quadrature};

/// Elements per direction of the coarsest space.
const ELEMENTS: usize = 8;

/// Solves of the adaptive loop.
pub const SOLVES: usize = 7;

/// Seed of the points.
const SEED: u64 = 1;

/// What goes wrong in setting up a problem.
pub type Failure = Box<dyn std::error::Error>;

/// Parameters `(m, 2)` and points `(m, 3)` of
/// `f(x, y) = ⅔ (e^{−|(10x−3, 10y−3)|} + e^{−|(10x+3, 10y+3)|} + e^{−|(10x, 10y)|})` on `[−1, 1]²`
/// (Imperatore 2024, (3.13)), at uniform random places.
pub fn points(m: usize) -> (Array2<f64>, Array2<f64>) {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let parameters = Array2::from_shape_simple_fn((m, 2), || random.random::<f64>());
    let mut points = Array2::zeros((m, 3));
    for (uv, mut point) in parameters.rows().into_iter().zip(points.rows_mut()) {
        let (x, y) = (2.0 * uv[0] - 1.0, 2.0 * uv[1] - 1.0);
        let cusp = |shift: f64| (-(10.0 * x + shift).hypot(10.0 * y + shift)).exp();
        point[0] = x;
        point[1] = y;
        point[2] = 2.0 / 3.0 * (cusp(-3.0) + cusp(3.0) + cusp(0.0));
    }
    (parameters, points)
}

/// The settings of the comparison with G+Smo: λ = 1e-7 and its Gauss rule.
pub fn fitting() -> fit_ls::Options<2> {
    fit_ls::Options { lambda: Lambda::Fixed(1e-7), quadrature: Quadrature::GaussP, lengths: [1.0; 2] }
}

/// The unrefined space of a degree.
///
/// # Errors
/// Those of the space.
pub fn coarse(degree: usize) -> Result<Arc<HierarchicalSpace<2>>, Failure> {
    let knots = KnotVector::uniform(degree, ELEMENTS)?;
    Ok(Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots])?))
}

/// The adaptive loop: threshold 1e-4, one ring of neighbours, seven solves; it ends early at `dofs` functions.
///
/// # Errors
/// Those of the method.
pub fn adapt(method: &mut LeastSquares<2>, degree: usize, dofs: usize) -> Result<Outcome<2, fit_ls::Error>, Failure> {
    let options = adaptive::Options { tolerance: 1e-4, within: 1.0, max_iterations: SOLVES, ..Default::default() };
    let mut enough = |i: &Iteration| if i.dofs >= dofs { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
    Ok(run(method, coarse(degree)?, &options, &mut enough)?)
}
