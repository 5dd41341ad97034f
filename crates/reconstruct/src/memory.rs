//! Points and meshes in memory, as scans.

use std::ops::ControlFlow;

use geom_io::Scan;
use ndarray::{Array2, Array3, ArrayView2};
use point_cloud::{CloudError, GridShape, check_finite};

use crate::fit::{Fit, fit_scan};
use crate::problem::rows_of;
use crate::{Error, FitOptions};

/// What reports call points that have no file.
const NAME: &str = "memory";

/// Points in memory, with what is known of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Points(Scan);

impl Points {
    /// Scattered points, shape `(m, 3)`.
    ///
    /// # Errors
    /// [`CloudError::WrongDimension`], [`CloudError::NonFinite`], [`CloudError::TooLarge`].
    pub fn new(points: Array2<f64>) -> Result<Self, Error> {
        check_columns(points.view(), 3)?;
        check_finite(points.view())?;
        Ok(Self(Scan::in_memory(points)))
    }

    /// Points in rows and columns, shape `(rows, columns, 3)`: neighbours in the array are neighbours on the surface.
    ///
    /// # Errors
    /// As [`Points::new`].
    pub fn grid(points: Array3<f64>) -> Result<Self, Error> {
        let (n_u, n_v, dimension) = points.dim();
        let rows = points.into_shape_with_order((n_u * n_v, dimension));
        let mut points = Self::new(rows.map_err(|_| CloudError::WrongDimension { given: dimension, required: 3 })?)?;
        points.0.cloud.grid = Some(GridShape { n_u, n_v });
        Ok(points)
    }

    /// Heights over a grid with cells of the given size along x and y: row i, column j at `(j · cell[0], i · cell[1])`. NaN stands for a
    /// cell without data.
    ///
    /// # Errors
    /// Fewer than 2 × 2 cells, coordinates that are too large.
    pub fn heights(heights: ArrayView2<'_, f64>, cell: [f64; 2]) -> Result<Self, Error> {
        let scan = Scan::of_heights(heights, cell).map_err(|kind| geom_io::ReadError { path: NAME.into(), kind })?;
        check_finite(scan.cloud.points.view())?;
        Ok(Self(scan))
    }
}

/// A triangle mesh in memory, with what is known of its vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh(Scan);

impl Mesh {
    /// Vertices, shape `(m, 3)`, and the vertices of each triangle, counter-clockwise seen from outside.
    ///
    /// # Errors
    /// As [`Points::new`]; [`CloudError::NoTriangles`], [`CloudError::VertexOutOfRange`].
    pub fn new(vertices: Array2<f64>, triangles: Vec<[u32; 3]>) -> Result<Self, Error> {
        let Points(mut scan) = Points::new(vertices)?;
        let count = scan.cloud.points.nrows();
        if triangles.is_empty() {
            return Err(CloudError::NoTriangles.into());
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&vertex| vertex as usize >= count) {
                return Err(CloudError::VertexOutOfRange { triangle, vertex, count }.into());
            }
        }
        scan.triangles = Some(triangles);
        Ok(Self(scan))
    }
}

/// What may be known of the points of [`Points`] and of [`Mesh`].
macro_rules! with_more_known {
    ($($type:ident),*) => {$(
        impl $type {
            /// The parameters (u, v) of each point, shape `(m, 2)`: they are kept as they are.
            ///
            /// # Errors
            /// [`Error::RowsDiffer`], [`CloudError::WrongDimension`], [`CloudError::NonFinite`], [`CloudError::TooLarge`].
            pub fn with_parameters(mut self, parameters: Array2<f64>) -> Result<Self, Error> {
                check_shape(&self.0, parameters.view(), 2, "parameters")?;
                check_finite(parameters.view())?;
                self.0.cloud.parameters = Some(parameters);
                Ok(self)
            }

            /// The confidence in each point, 0 or more.
            ///
            /// # Errors
            /// [`Error::RowsDiffer`], [`Error::Weight`].
            pub fn with_weights(mut self, weights: Vec<f64>) -> Result<Self, Error> {
                check_rows(&self.0, weights.len(), "weights")?;
                let bad = weights.iter().position(|weight| !(0.0..=f64::MAX).contains(weight));
                if let Some(point) = bad {
                    return Err(Error::Weight { point, value: weights[point] });
                }
                self.0.weights = Some(weights);
                Ok(self)
            }

            /// The normal of the surface at each point, shape `(m, 3)`, of any length, NaN where there is none: they tell the outside.
            ///
            /// # Errors
            /// [`Error::RowsDiffer`], [`CloudError::WrongDimension`].
            pub fn with_normals(mut self, normals: ArrayView2<'_, f64>) -> Result<Self, Error> {
                check_shape(&self.0, normals, 3, "normals")?;
                self.0.normals = Some(rows_of(normals));
                Ok(self)
            }
        }

        impl From<$type> for Scan {
            fn from(given: $type) -> Self {
                given.0
            }
        }
    )*};
}

with_more_known!(Points, Mesh);

/// Fits [`Points`] or a [`Mesh`]: [`fit_scan`] without a name and without being told how it goes.
///
/// # Errors
/// [`Error`]. A tolerance that is not reached is no error: the report has the verdict.
pub fn fit(scan: impl Into<Scan>, options: &FitOptions) -> Result<Fit, Error> {
    fit_scan(scan.into(), NAME, options, &mut |_| ControlFlow::Continue(()))
}

fn check_rows(scan: &Scan, given: usize, what: &'static str) -> Result<(), Error> {
    let points = scan.cloud.points.nrows();
    if given == points { Ok(()) } else { Err(Error::RowsDiffer { what, given, points }) }
}

/// Whether there is a row for each point, of so many columns.
fn check_shape(scan: &Scan, given: ArrayView2<'_, f64>, required: usize, what: &'static str) -> Result<(), Error> {
    check_rows(scan, given.nrows(), what)?;
    check_columns(given, required)
}

fn check_columns(given: ArrayView2<'_, f64>, required: usize) -> Result<(), Error> {
    if given.ncols() == required {
        return Ok(());
    }
    Err(CloudError::WrongDimension { given: given.ncols(), required }.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Tolerance;
    use ndarray::Axis;

    fn shape(u: f64, v: f64) -> [f64; 3] {
        [2.0 * u, v, 0.3 * (3.0 * u).sin() * v]
    }

    fn cloud(n: usize) -> (Array2<f64>, Array2<f64>) {
        let parameters = Array2::from_shape_fn((n * n, 2), |(i, d)| [i / n, i % n][d] as f64 / (n - 1) as f64);
        let points = Array2::from_shape_fn((n * n, 3), |(i, k)| shape(parameters[[i, 0]], parameters[[i, 1]])[k]);
        (points, parameters)
    }

    fn options() -> FitOptions {
        FitOptions { tol: Tolerance::Percent(0.1), ..FitOptions::default() }
    }

    #[test]
    fn arrays_of_every_kind_are_fitted() {
        let n = 20;
        let (points, parameters) = cloud(n);
        let grid = points.clone().into_shape_with_order((n, n, 3)).unwrap();
        let corners = (0..n - 1).flat_map(|i| (0..n - 1).map(move |j| (n * i + j) as u32));
        let m = n as u32;
        let triangles = corners.flat_map(|a| [[a, a + m, a + m + 1], [a, a + m + 1, a + 1]]).collect();
        let heights = Array2::from_shape_fn((n, n), |(i, j)| shape(j as f64 / 19.0, i as f64 / 19.0)[2]);
        let up = Array2::from_shape_fn((n * n, 3), |(_, k)| if k == 2 { -1.0 } else { 0.0 });
        let scans: Vec<(&str, Scan)> = vec![
            ("points", Points::new(points.clone()).unwrap().with_normals(up.view()).unwrap().into()),
            ("grid", Points::grid(grid).unwrap().into()),
            ("heights", Points::heights(heights.view(), [2.0 / 19.0, 1.0 / 19.0]).unwrap().into()),
            ("given", Points::new(points.clone()).unwrap().with_parameters(parameters.clone()).unwrap().into()),
            ("mesh", Mesh::new(points.clone(), triangles).unwrap().with_weights(vec![2.0; n * n]).unwrap().into()),
        ];
        for (name, scan) in scans {
            let found = fit(scan, &options()).unwrap();
            assert!(found.reached(), "{name}: {:?}", found.report.result.reasons);
            assert_eq!((found.report.input.file.as_str(), found.report.input.format), (NAME, NAME));
            assert!(!found.reversed || name == "points", "{name}");
        }
    }

    #[test]
    fn normals_tell_the_outside() {
        let (points, _) = cloud(12);
        let reversed = [1.0, -1.0].map(|z| {
            let normals = Array2::from_shape_fn(points.raw_dim(), |(_, k)| if k == 2 { z } else { 0.0 });
            fit(Points::new(points.clone()).unwrap().with_normals(normals.view()).unwrap(), &options())
                .unwrap()
                .reversed
        });
        assert_ne!(reversed[0], reversed[1]);
    }

    #[test]
    fn parameters_that_are_given_are_kept() {
        let (points, parameters) = cloud(15);
        let found = fit(Points::new(points).unwrap().with_parameters(parameters.clone()).unwrap(), &options()).unwrap();
        assert_eq!(found.report.input.parameterization, "given");
        let mut sorted = parameters.clone();
        sorted.axis_iter_mut(Axis(0)).zip(found.parameters.rows()).for_each(|(mut a, b)| a.assign(&b));
        assert_eq!(sorted, found.parameters);
    }

    #[test]
    fn what_cannot_be_is_told_with_its_place() {
        let (points, parameters) = cloud(5);
        let told = |result: Result<(), Error>, words: &str| {
            let message = result.unwrap_err().to_string();
            assert!(message.contains(words), "{message}");
        };
        let made = || Points::new(points.clone()).unwrap();
        let mut bad = points.clone();
        bad[[7, 1]] = f64::NAN;
        told(Points::new(bad).map(drop), "point 7");
        told(Points::new(parameters.clone()).map(drop), "2 coordinates, 3 are needed");
        told(
            made().with_parameters(parameters.slice_axis(Axis(0), (..24).into()).to_owned()).map(drop),
            "24 parameters",
        );
        told(made().with_parameters(points.clone()).map(drop), "3 coordinates, 2 are needed");
        told(made().with_weights(vec![1.0; 26]).map(drop), "26 weights");
        let mut weights = vec![1.0; 25];
        weights[3] = -1.0;
        told(made().with_weights(weights).map(drop), "point 3");
        told(made().with_normals(parameters.view()).map(drop), "2 coordinates, 3 are needed");
        told(Mesh::new(points.clone(), vec![[0, 1, 25]]).map(drop), "triangle 0 uses vertex 25");
        told(Mesh::new(points.clone(), Vec::new()).map(drop), "no triangle");
        told(Points::heights(Array2::zeros((1, 4)).view(), [1.0, 1.0]).map(drop), "memory");
    }
}
