//! Closest points of a spline curve or surface.

use std::sync::Arc;

use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};

use crate::{BezierMap, Error};

/// A point of the map that is closest to a query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoint<const D: usize> {
    /// Its parameter.
    pub u: [f64; D],
    /// Its cell.
    pub cell: usize,
    /// Its distance to the query.
    pub distance: f64,
}

/// Closest-point queries on one map into R^N, N ≤ 3.
///
/// Cells are searched in the order of the distance to the boxes around their control points, which bound the distance
/// from below, until no box is nearer than the best point. Within a cell Newton's method, with a trust in decreasing
/// distance only, starts from the nearest of a few samples: the result is a stationary point, and the global minimum
/// unless one cell holds several minima that the samples cannot tell apart.
#[derive(Clone, Debug)]
pub struct ClosestPoints<const D: usize> {
    map: Arc<BezierMap<D>>,
    boxes: RTree<GeomWithData<Rectangle<[f64; 3]>, usize>>,
}

/// Newton steps per start; convergence is quadratic, and damped steps halve the distance to the minimum at worst.
const MAX_STEPS: usize = 30;

/// A step below this share of the cell ends the iteration: the distance then changes by its square only.
const STEP_TOLERANCE: f64 = 1e-12;

impl<const D: usize> ClosestPoints<D> {
    /// Prepares queries on a map.
    ///
    /// # Errors
    /// [`Error::Shape`] if the image has more than three dimensions.
    pub fn new(map: Arc<BezierMap<D>>) -> Result<Self, Error> {
        if map.dim() > 3 {
            return Err(Error::Shape { what: "dimension of the image", given: map.dim(), expected: 3 });
        }
        let boxes = (0..map.n_cells())
            .map(|cell| {
                let (mut lower, mut upper) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
                for point in map.cell_coefficients(cell).chunks_exact(map.dim()) {
                    let point = padded(point);
                    for k in 0..3 {
                        lower[k] = lower[k].min(point[k]);
                        upper[k] = upper[k].max(point[k]);
                    }
                }
                GeomWithData::new(Rectangle::from_aabb(AABB::from_corners(lower, upper)), cell)
            })
            .collect();
        Ok(Self { boxes: RTree::bulk_load(boxes), map })
    }

    /// The closest point to `query`, `N` numbers.
    pub fn closest(&self, query: &[f64]) -> ClosestPoint<D> {
        self.search(query, ClosestPoint { u: self.map.cell_box(0).0, cell: 0, distance: f64::INFINITY })
    }

    /// The closest point to `query`, given a parameter near it and its cell: cells that cannot hold a nearer point than
    /// the one reached from there are not visited.
    pub fn closest_from(&self, query: &[f64], cell: usize, u: [f64; D]) -> ClosestPoint<D> {
        let (lower, upper) = self.map.cell_box(cell);
        let start = std::array::from_fn(|d| ((u[d] - lower[d]) / (upper[d] - lower[d])).clamp(0.0, 1.0));
        self.search(query, self.descend(query, cell, start))
    }

    fn search(&self, query: &[f64], mut best: ClosestPoint<D>) -> ClosestPoint<D> {
        for (near, bound) in self.boxes.nearest_neighbor_iter_with_distance_2(padded(query)) {
            if bound >= best.distance * best.distance {
                break;
            }
            let found = self.in_cell(query, near.data);
            if found.distance < best.distance {
                best = found;
            }
        }
        best
    }

    fn in_cell(&self, query: &[f64], cell: usize) -> ClosestPoint<D> {
        // One sample more than the degree tells the minima of a polynomial of that degree apart in all usual cases.
        let samples = self.map.degree().map(|p| p + 2);
        let mut start = ([0.5; D], f64::INFINITY);
        let mut point = vec![0.0; self.map.dim()];
        for linear in 0..samples.iter().product() {
            let index = crate::tensor::unravel(linear, samples);
            let t = std::array::from_fn(|d| index[d] as f64 / (samples[d] - 1) as f64);
            let (lower, upper) = self.map.cell_box(cell);
            let u = std::array::from_fn(|d| lower[d] + t[d] * (upper[d] - lower[d]));
            self.map.derivative(cell, u, [0; D], &mut point);
            let squared = distance_squared(&point, query);
            if squared < start.1 {
                start = (t, squared);
            }
        }
        self.descend(query, cell, start.0)
    }

    /// Newton's method for half the squared distance on one cell, in local coordinates, clamped to the cell.
    fn descend(&self, query: &[f64], cell: usize, start: [f64; D]) -> ClosestPoint<D> {
        let (lower, upper) = self.map.cell_box(cell);
        let global = |t: [f64; D]| -> [f64; D] {
            std::array::from_fn(|d| if t[d] == 1.0 { upper[d] } else { lower[d] + t[d] * (upper[d] - lower[d]) })
        };
        let mut t = start;
        let mut local = Local::at(&self.map, cell, global(t), query);
        let mut damping = 0.0;
        for _ in 0..MAX_STEPS {
            let Some(step) = local.step(t, damping) else { break };
            let candidate: [f64; D] = std::array::from_fn(|d| (t[d] + step[d]).clamp(0.0, 1.0));
            let moved = (0..D).map(|d| (candidate[d] - t[d]).abs()).fold(0.0, f64::max);
            if moved < STEP_TOLERANCE {
                break;
            }
            let next = Local::at(&self.map, cell, global(candidate), query);
            if next.half_squared < local.half_squared {
                (t, local) = (candidate, next);
                damping *= 0.1;
            } else {
                damping = if damping == 0.0 { local.curvature_scale() } else { damping * 10.0 };
            }
        }
        ClosestPoint { u: global(t), cell, distance: (2.0 * local.half_squared).sqrt() }
    }
}

/// Half the squared distance at a parameter, with gradient and Hessian in local coordinates of the cell.
struct Local<const D: usize> {
    half_squared: f64,
    gradient: [f64; D],
    hessian: [[f64; D]; D],
    /// The part of the Hessian without second derivatives: never indefinite.
    metric: [[f64; D]; D],
}

impl<const D: usize> Local<D> {
    fn at(map: &BezierMap<D>, cell: usize, u: [f64; D], query: &[f64]) -> Self {
        let n = map.dim();
        let (lower, upper) = map.cell_box(cell);
        let size: [f64; D] = std::array::from_fn(|d| upper[d] - lower[d]);
        let mut residual = [0.0; 3];
        map.derivative(cell, u, [0; D], &mut residual[..n]);
        for k in 0..n {
            residual[k] -= query[k];
        }
        let mut first = [[0.0; 3]; D];
        for a in 0..D {
            map.derivative(cell, u, std::array::from_fn(|d| usize::from(d == a)), &mut first[a][..n]);
            first[a].iter_mut().for_each(|x| *x *= size[a]);
        }
        let mut local = Self {
            half_squared: 0.5 * dot(&residual, &residual),
            gradient: std::array::from_fn(|a| dot(&first[a], &residual)),
            hessian: [[0.0; D]; D],
            metric: [[0.0; D]; D],
        };
        for a in 0..D {
            for b in a..D {
                let order = std::array::from_fn(|d| usize::from(d == a) + usize::from(d == b));
                let mut second = [0.0; 3];
                map.derivative(cell, u, order, &mut second[..n]);
                let metric = dot(&first[a], &first[b]);
                let full = metric + size[a] * size[b] * dot(&second, &residual);
                (local.metric[a][b], local.metric[b][a]) = (metric, metric);
                (local.hessian[a][b], local.hessian[b][a]) = (full, full);
            }
        }
        local
    }

    fn curvature_scale(&self) -> f64 {
        (0..D).map(|d| self.metric[d][d]).fold(0.0, f64::max)
    }

    /// The Newton step in the directions that are free to move, with the metric in place of an indefinite Hessian.
    fn step(&self, t: [f64; D], damping: f64) -> Option<[f64; D]> {
        let free: [bool; D] = std::array::from_fn(|d| {
            !(t[d] <= 0.0 && self.gradient[d] >= 0.0 || t[d] >= 1.0 && self.gradient[d] <= 0.0)
        });
        solve_positive(&self.hessian, &self.gradient, free, damping)
            .or_else(|| solve_positive(&self.metric, &self.gradient, free, damping))
            .or_else(|| solve_positive(&self.metric, &self.gradient, free, damping + self.curvature_scale()))
    }
}

/// Solves `(M + damping I) x = −g` in the free directions by Cholesky factorization; `None` unless positive definite.
fn solve_positive<const D: usize>(
    matrix: &[[f64; D]; D],
    gradient: &[f64; D],
    free: [bool; D],
    damping: f64,
) -> Option<[f64; D]> {
    let mut factor = [[0.0; D]; D];
    let mut x = [0.0; D];
    for i in 0..D {
        for j in 0..=i {
            let entry = match (i == j, free[i] && free[j]) {
                (true, true) => matrix[i][i] + damping,
                (true, false) => 1.0,
                (false, true) => matrix[i][j],
                (false, false) => 0.0,
            };
            let rest = entry - (0..j).map(|k| factor[i][k] * factor[j][k]).sum::<f64>();
            if i == j {
                // Below round-off of the entry the pivot says nothing.
                if rest <= f64::EPSILON * entry.abs() || rest.is_nan() {
                    return None;
                }
                factor[i][i] = rest.sqrt();
            } else {
                factor[i][j] = rest / factor[j][j];
            }
        }
        let right = if free[i] { -gradient[i] } else { 0.0 };
        x[i] = (right - (0..i).map(|k| factor[i][k] * x[k]).sum::<f64>()) / factor[i][i];
    }
    for i in (0..D).rev() {
        x[i] = (x[i] - (i + 1..D).map(|k| factor[k][i] * x[k]).sum::<f64>()) / factor[i][i];
    }
    Some(x)
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn distance_squared(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum()
}

fn padded(point: &[f64]) -> [f64; 3] {
    std::array::from_fn(|k| point.get(k).copied().unwrap_or(0.0))
}
