//! A cloud as the networks read it.

use ndarray::{Array2, ArrayView2, Axis};
use point_cloud::check_surface_cloud;

use super::frame::turned;
use super::network::Input;
use crate::error::NnError;
use crate::graph::Neighbours;
use crate::real::Real;
use crate::synthetic::ScatteredCloud;

/// How far from the boundary of the square a boundary parameter may lie: parameters read from text have nine digits.
pub(super) const BOUNDARY_TOLERANCE: f64 = 1e-9;

/// Points with the interior ones first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cloud {
    pub(crate) xyz: Vec<[f64; 3]>,
    /// Parameters; of interior points the true ones where they are known, else zeros.
    pub(crate) uv: Vec<[f64; 2]>,
    pub(crate) interior: usize,
    /// Row of each point in the cloud it comes from.
    pub(crate) rows: Vec<usize>,
}

impl Cloud {
    pub(crate) fn of_sample(sample: &ScatteredCloud) -> Self {
        Self {
            xyz: sample.points.rows().into_iter().map(|p| [p[0], p[1], p[2]]).collect(),
            uv: sample.parameters.rows().into_iter().map(|u| [u[0], u[1]]).collect(),
            interior: sample.interior,
            rows: (0..sample.points.nrows()).collect(),
        }
    }

    /// Checks points `(m, 3)`, the rows of the boundary points and their parameters.
    pub(crate) fn new(
        points: ArrayView2<'_, f64>,
        boundary: &[u32],
        boundary_parameters: ArrayView2<'_, f64>,
    ) -> Result<Self, NnError> {
        check_surface_cloud(points, 4)?;
        if points.ncols() != 3 {
            return Err(NnError::WrongShape {
                what: "points",
                given: points.dim().into(),
                required: [points.nrows(), 3],
            });
        }
        let required = [boundary.len(), 2];
        if <[usize; 2]>::from(boundary_parameters.dim()) != required {
            let given = boundary_parameters.dim().into();
            return Err(NnError::WrongShape { what: "boundary parameters", given, required });
        }
        let mut fixed = vec![false; points.nrows()];
        let mut boundary_uv = Vec::with_capacity(boundary.len());
        for (index, (&point, uv)) in boundary.iter().zip(boundary_parameters.rows()).enumerate() {
            let parameters = [uv[0], uv[1]];
            let depth = parameters.iter().fold(1.0f64, |d, x| d.min(*x).min(1.0 - x));
            let problem = match fixed.get_mut(point as usize) {
                None => "is not a row of the cloud",
                Some(true) => "is named a second time",
                Some(_) if !(-BOUNDARY_TOLERANCE..=BOUNDARY_TOLERANCE).contains(&depth) => {
                    "does not lie on the boundary of the unit square"
                }
                Some(place) => {
                    *place = true;
                    boundary_uv.push(parameters.map(|x| x.clamp(0.0, 1.0)));
                    continue;
                }
            };
            return Err(NnError::BadBoundaryPoint { index, point, parameters, problem });
        }
        let mut rows: Vec<usize> = (0..points.nrows()).filter(|&row| !fixed[row]).collect();
        let interior = rows.len();
        rows.extend(boundary.iter().map(|&point| point as usize));
        let mut uv = vec![[0.0; 2]; interior];
        uv.extend(boundary_uv);
        let place = |&row: &usize| std::array::from_fn(|k| points[[row, k]]);
        Ok(Self { xyz: rows.iter().map(place).collect(), uv, interior, rows })
    }

    pub(crate) fn boundary_uv(&self) -> &[[f64; 2]] {
        &self.uv[self.interior..]
    }

    /// The points in the unit cube, before that turned into the frame of the boundary where `frame` says so and there is
    /// one.
    pub(crate) fn scaled(&self, frame: bool) -> Vec<[f64; 3]> {
        let mut points = self.xyz.clone();
        into_unit_cube(&mut points);
        if frame && let Some(mut turned) = turned(&points, &points[self.interior..], self.boundary_uv()) {
            into_unit_cube(&mut turned);
            points = turned;
        }
        points
    }

    /// What the network is given.
    pub(crate) fn input<T: Real>(&self, frame: bool, neighbours: Neighbours) -> Input<T> {
        let points = self.scaled(frame);
        Input::new(&points[..self.interior], &points[self.interior..], self.boundary_uv(), neighbours)
    }

    /// Parameters of all points in the order of the original cloud, from those of the interior points.
    pub(crate) fn scattered(&self, interior: &[[f64; 2]]) -> Array2<f64> {
        let mut all = Array2::zeros((self.rows.len(), 2));
        for (&row, uv) in self.rows.iter().zip(interior.iter().chain(self.boundary_uv())) {
            all.index_axis_mut(Axis(0), row).iter_mut().zip(uv).for_each(|(x, u)| *x = *u);
        }
        all
    }
}

/// Moves and scales points into the unit cube by one common factor.
fn into_unit_cube(points: &mut [[f64; 3]]) {
    let mut lower = [f64::INFINITY; 3];
    let mut upper = [f64::NEG_INFINITY; 3];
    for p in points.iter() {
        (0..3).for_each(|k| (lower[k], upper[k]) = (lower[k].min(p[k]), upper[k].max(p[k])));
    }
    let longest = (0..3).map(|k| upper[k] - lower[k]).fold(0.0, f64::max);
    let unit = if longest > 0.0 { longest } else { 1.0 };
    points.iter_mut().for_each(|p| *p = std::array::from_fn(|k| (p[k] - lower[k]) / unit));
}
