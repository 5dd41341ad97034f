//! The outside of a surface, where the points of a scan come with normals.

use std::fmt;

use ndarray::Array2;
use rayon::prelude::*;
use serde::Serialize;
use thb_core::SplineMap;

use crate::Error;

/// Share of the normals that have to agree on the outside: noisy ones do, those that were never made consistent do not.
///
/// Derived: of normals with signs by chance, 100 agree by 90 % once in 10¹⁵ files.
const AGREEMENT: f64 = 0.9;

/// What the normals of a file say about the outside of the surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NormalsReport {
    /// Fitted points with a normal that lies to one side of the surface.
    pub points: usize,
    /// Share of them whose normals point to the outside that was taken, that of the majority.
    pub agreeing: f64,
    /// Whether the outside is opposite to `S_u × S_v`.
    #[serde(skip)]
    pub reversed: bool,
}

impl NormalsReport {
    /// What to say where too few agree.
    pub(crate) fn warning(&self) -> Option<String> {
        (self.agreeing < AGREEMENT).then(|| self.to_string())
    }
}

impl fmt::Display for NormalsReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "only {:.1} % of the {} normals of the file point to the same side of the surface; that side was taken for its outside: \
             --flip turns the face normal, --normals none leaves the normals of a text file out",
            100.0 * self.agreeing,
            self.points
        )
    }
}

/// Lets the normals at points vote, each with its parameters; `None` where no normal says anything.
///
/// # Errors
/// [`Error`] where a parameter lies outside the domain.
pub(crate) fn vote(
    map: &SplineMap<2>,
    parameters: &Array2<f64>,
    normals: &[[f64; 3]],
) -> Result<Option<NormalsReport>, Error> {
    let count = parameters.nrows().min(normals.len());
    let side = |point: usize| side(map, [parameters[[point, 0]], parameters[[point, 1]]], &normals[point]);
    let sides = (0..count).into_par_iter().map(side).collect::<Result<Vec<f64>, Error>>()?;
    let mut votes = [0_usize; 2];
    for side in sides.into_iter().filter(|side| *side != 0.0 && side.is_finite()) {
        votes[usize::from(side < 0.0)] += 1;
    }
    let points = votes[0] + votes[1];
    let reversed = votes[1] > votes[0];
    let agreeing = votes[usize::from(reversed)] as f64 / points.max(1) as f64;
    Ok((points > 0).then_some(NormalsReport { points, agreeing, reversed }))
}

/// Above 0 where a normal points to the side of `S_u × S_v`.
fn side(map: &SplineMap<2>, u: [f64; 2], normal: &[f64; 3]) -> Result<f64, Error> {
    let bezier = map.bezier();
    let cell = map.space().locate_cell(u)?;
    let [mut a, mut b] = [[0.0; 3]; 2];
    bezier.derivative(cell, u, [1, 0], &mut a);
    bezier.derivative(cell, u, [0, 1], &mut b);
    let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    Ok(cross.iter().zip(normal).map(|(c, n)| c * n).sum())
}
