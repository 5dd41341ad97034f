//! How well one smooth patch follows triangles.

use std::sync::Arc;

use fit_ls::{Lambda, LeastSquares};
use ndarray::{Array1, Array2};
use point_cloud::vec3::{add, cross, norm, scale, sub};
use thb_core::{HierarchicalSpace, Kind, KnotVector};

use super::disk::Disk;

/// Degree of the patch, and elements along each side.
///
/// Derived: what whole parts are fitted with unasked.
const DEGREE: usize = 3;
const ELEMENTS: usize = 4;

/// Weight of the thin-plate energy, in units in which the part's diagonal and the patch's domain are 1.
///
/// Derived: what whole parts are fitted with unasked.
const PLATES: f64 = 1e-6;

/// Fits patches one by one.
#[derive(Debug)]
pub(super) struct PatchFit {
    space: Arc<HierarchicalSpace<2>>,
}

impl PatchFit {
    pub(super) fn new() -> Result<Self, thb_core::Error> {
        let knots = KnotVector::uniform(DEGREE, ELEMENTS)?;
        Ok(Self { space: Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots])?) })
    }

    /// The root of the mean square by area of distances of triangles from a patch fitted to them, at their places in a map onto the
    /// square; none if they are no disk with these sides.
    pub(super) fn error(&self, points: &[[f64; 3]], faces: &[[u32; 3]], sides: &[Vec<u32>; 4]) -> Option<f64> {
        let disk = Disk::on_square(points, faces, sides)?;
        let (mut at, mut places, mut weights) = (Vec::new(), Vec::new(), Vec::new());
        for face in &disk.faces {
            let [p, q, r] = face.map(|v| disk.points[v as usize]);
            at.push(scale(1.0 / 3.0, add(add(p, q), r)));
            let uv = face.map(|v| disk.uv[v as usize]);
            places.push([0, 1].map(|d| (uv[0][d] + uv[1][d] + uv[2][d]) / 3.0));
            weights.push(norm(cross(sub(q, p), sub(r, p))).max(f64::MIN_POSITIVE));
        }
        let all: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= all);
        let (places, at) = (Array2::from(places), Array2::from(at));
        let options = fit_ls::Options { lambda: Lambda::Fixed(PLATES), ..fit_ls::Options::default() };
        let weights = Array1::from(weights);
        let mut fit = LeastSquares::new(places.view(), at.view(), Some(weights.view()), options).ok()?;
        let map = fit.fit(&self.space).ok()?;
        let distances = fit.distances(&map).ok()?.to_vec();
        let order = fit.points().order();
        let sum: f64 =
            distances.iter().zip(order).map(|(distance, &i)| weights[i as usize] * distance * distance).sum();
        Some(sum.sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Sheet = (Vec<[f64; 3]>, Vec<[u32; 3]>, [Vec<u32>; 4]);

    /// A square sheet of `n` × `n` quads cut in two, and its sides.
    fn sheet(n: u32, height: impl Fn(f64, f64) -> f64) -> Sheet {
        let at = |i: u32, j: u32| j * (n + 1) + i;
        let points = (0..(n + 1).pow(2)).map(|k| {
            let [x, y] = [k % (n + 1), k / (n + 1)].map(|i| f64::from(i) / f64::from(n));
            [0.1 * x, 0.1 * y, 0.1 * height(x, y)]
        });
        let quads = (0..n * n).map(|k| [k % n, k / n]);
        let faces = quads.flat_map(|[i, j]| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        });
        let side = |of: &dyn Fn(u32) -> u32| (0..=n).map(of).collect();
        let sides = [side(&|k| at(k, 0)), side(&|k| at(n, k)), side(&|k| at(n - k, n)), side(&|k| at(0, n - k))];
        (points.collect(), faces.collect(), sides)
    }

    #[test]
    fn a_plane_is_met_and_a_ridge_is_not() {
        let fit = PatchFit::new().unwrap();
        let error = |height: &dyn Fn(f64, f64) -> f64| {
            let (points, faces, sides) = sheet(20, height);
            fit.error(&points, &faces, &sides).unwrap()
        };
        assert!(error(&|x, y| 0.3 * x - 0.2 * y) < 1e-12);
        // A roof of 45°: a spline of four elements rounds the ridge by some percent of an element.
        let ridge = error(&|x, _| (x - 0.4).abs());
        assert!((1e-4..1e-2).contains(&ridge), "{ridge}");
        assert!(error(&|x, y| 0.1 * (x * x + y * y)) < 0.1 * ridge);
    }

    #[test]
    fn what_is_no_disk_has_no_error() {
        let (points, mut faces, sides) = sheet(4, |_, _| 0.0);
        faces.remove(10);
        assert_eq!(PatchFit::new().unwrap().error(&points, &faces, &sides), None);
    }
}
