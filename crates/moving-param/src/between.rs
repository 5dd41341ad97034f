//! Weak samples of the triangles between the points.

use fit_ls::{BlockEquations, SortedPoints};
use ndarray::Array2;
use thb_core::{CellSpace, HierarchicalSpace, SplineMap, SymmetricPattern};

use crate::Error;
use crate::foot_point::point;
use crate::frame::{Frame, frames};
use crate::patch::{Vector, cross, difference, dot, unit};

/// Adds `½ Σ r_tᵀ W_t r_t`, `r_t = s(u_t) − p_t`, to the objective of the joint method: `p_t` are the centres of triangles
/// over the points, `u_t` those of their parameters, and `W_t = ω (n_t n_tᵀ + τ (I − n_t n_tᵀ))` with normals `n_t`.
///
/// A point whose parameter is free holds the surface in one direction only. With few points a cell the surface may then
/// swing between them, at no distance from any.
#[derive(Debug)]
pub(crate) struct Between {
    triangles: Vec<[u32; 3]>,
    /// The centres, `(t, N)`.
    centres: Array2<f64>,
    /// Unit normals of the triangles.
    normals: Vec<Vector>,
    weight: f64,
}

/// `τ`: how much less a centre holds along its triangle. With 1 the parameters of centres are held where a map that is
/// linear over triangles has them, which costs control points; with 0 more edges remain between points.
const ALONG: f64 = 0.03;

/// Cells with this many points for each of their functions hold the surface by themselves; triangles in them are left out,
/// which spares most of the work on dense clouds.
const ENOUGH: usize = 2;

impl Between {
    /// Samples of those triangles, by indices of points, that lie in cells with few points; `None` if there are none.
    pub(crate) fn new<const D: usize>(
        triangles: &[[u32; 3]],
        space: &HierarchicalSpace<D>,
        points: &SortedPoints<D>,
        weight: f64,
    ) -> Result<Option<Self>, Error> {
        let at_of = points.places();
        let enough = ENOUGH * space.degree().iter().map(|p| p + 1).product::<usize>();
        let offsets = points.offsets();
        let mut kept = Vec::new();
        for &triangle in triangles {
            let cell = space.locate_cell(centre(space, |at| points.parameter(at), &at_of, triangle))?;
            if offsets[cell + 1] - offsets[cell] < enough {
                kept.push(triangle);
            }
        }
        if kept.is_empty() {
            return Ok(None);
        }
        let point = |i: u32| point(points, at_of[i as usize]);
        let normals = (points.dim() == 3).then(|| vertex_normals(triangles, points.len(), point));
        let mut centres = Array2::zeros((kept.len(), points.dim()));
        for (mut row, corners) in centres.outer_iter_mut().zip(&kept) {
            let centre = curved_centre(corners.map(point), normals.as_ref().map(|n| corners.map(|i| n[i as usize])));
            row.iter_mut().zip(centre).for_each(|(target, x)| *target = x);
        }
        let normal = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(point);
            unit(cross(&difference(&b, &a), &difference(&c, &a)))
        };
        let normals = kept.iter().map(normal).collect();
        Ok(Some(Self { triangles: kept, centres, normals, weight }))
    }

    /// The samples where the points, in their order, have some parameters; sorted by cell.
    fn samples<const D: usize>(
        &self,
        space: &HierarchicalSpace<D>,
        points: &SortedPoints<D>,
        parameter: impl Fn(usize) -> [f64; D],
    ) -> Result<SortedPoints<D>, Error> {
        let at_of = points.places();
        let mut parameters = Array2::zeros((self.triangles.len(), D));
        for (mut row, &triangle) in parameters.outer_iter_mut().zip(&self.triangles) {
            row.iter_mut().zip(centre(space, &parameter, &at_of, triangle)).for_each(|(target, u)| *target = u);
        }
        let mut samples = SortedPoints::new(parameters.view(), self.centres.view(), None)?;
        samples.sort_refined(space, None)?;
        Ok(samples)
    }

    /// `½ Σ rᵀ W r`, given the parameters of the points.
    pub(crate) fn energy<const D: usize>(
        &self,
        map: &SplineMap<D>,
        points: &SortedPoints<D>,
        parameter: impl Fn(usize) -> [f64; D],
    ) -> Result<f64, Error> {
        let samples = self.samples(map.space(), points, parameter)?;
        Ok(self.cost(&samples, &frames(map, &samples)?))
    }

    fn cost<const D: usize>(&self, samples: &SortedPoints<D>, frames: &[Frame<D>]) -> f64 {
        let cost = |(at, frame): (usize, &Frame<D>)| dot(&frame.residual, &self.force(samples, at, &frame.residual));
        0.5 * frames.iter().enumerate().map(cost).sum::<f64>()
    }

    /// `W r` at a sample.
    fn force<const D: usize>(&self, samples: &SortedPoints<D>, at: usize, residual: &Vector) -> Vector {
        let normal = &self.normals[samples.order()[at] as usize];
        let height = (1.0 - ALONG) * dot(residual, normal);
        std::array::from_fn(|k| self.weight * (ALONG * residual[k] + height * normal[k]))
    }

    /// The energy of a map at the present parameters, and the equations of a step from it.
    pub(crate) fn equations<const D: usize>(
        &self,
        map: &SplineMap<D>,
        pattern: &SymmetricPattern,
        points: &SortedPoints<D>,
    ) -> Result<(f64, BlockEquations), Error> {
        let samples = self.samples(map.space(), points, |at| points.parameter(at))?;
        let frames = frames(map, &samples)?;
        let n = samples.dim();
        let part = |vectors: &[Vector], k: usize| -> Vec<f64> { vectors.iter().map(|v| v[k]).collect() };
        let mut weights = Vec::with_capacity(n * (n + 1) / 2);
        for a in 0..n {
            let axis = std::array::from_fn(|k| f64::from(u8::from(k == a)));
            let column: Vec<Vector> = (0..samples.len()).map(|at| self.force(&samples, at, &axis)).collect();
            weights.extend((a..n).map(|b| part(&column, b)));
        }
        let pull = |(at, frame): (usize, &Frame<D>)| self.force(&samples, at, &frame.residual).map(|x| -x);
        let pulls: Vec<Vector> = frames.iter().enumerate().map(pull).collect();
        let right: Vec<Vec<f64>> = (0..n).map(|k| part(&pulls, k)).collect();
        let equations = BlockEquations::new(map.space().as_ref(), pattern, &samples, &weights, &right)?;
        Ok((self.cost(&samples, &frames), equations))
    }
}

/// The mean of the corners, moved half way to the mean of its projections to their tangent planes: for a surface of second
/// order that is its point over the centre.
fn curved_centre(corners: [Vector; 3], normals: Option<[Vector; 3]>) -> Vector {
    let mut centre: Vector = std::array::from_fn(|k| corners.iter().map(|c| c[k]).sum::<f64>() / 3.0);
    let Some(normals) = normals else { return centre };
    let heights: [f64; 3] = std::array::from_fn(|i| dot(&difference(&corners[i], &centre), &normals[i]));
    for (normal, height) in normals.iter().zip(heights) {
        (0..3).for_each(|k| centre[k] += 0.5 * height * normal[k] / 3.0);
    }
    centre
}

/// Unit normals at the points: those of the triangles around them, by area; zero where there are none.
fn vertex_normals(triangles: &[[u32; 3]], points: usize, point: impl Fn(u32) -> Vector) -> Vec<Vector> {
    let mut normals = vec![[0.0; 4]; points];
    for &triangle in triangles {
        let [a, b, c] = triangle.map(&point);
        let area = cross(&difference(&b, &a), &difference(&c, &a));
        triangle.iter().for_each(|&i| (0..3).for_each(|k| normals[i as usize][k] += area[k]));
    }
    normals.into_iter().map(unit).collect()
}

/// The centre of a triangle's parameters, which may lie across a seam.
fn centre<const D: usize>(
    space: &HierarchicalSpace<D>,
    parameter: impl Fn(usize) -> [f64; D],
    at_of: &[usize],
    triangle: [u32; 3],
) -> [f64; D] {
    let [a, b, c] = triangle.map(|i| parameter(at_of[i as usize]));
    let (to_b, to_c) = (space.way(a, b), space.way(a, c));
    space.to_domain(std::array::from_fn(|d| a[d] + (to_b[d] + to_c[d]) / 3.0))
}
