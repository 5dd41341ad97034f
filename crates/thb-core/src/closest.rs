//! Closest points of a spline curve or surface.

use std::sync::Arc;

use rayon::prelude::*;
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};

use crate::small_cholesky::SmallCholesky;
use crate::space::for_each_line;
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
/// The cells are cut into pieces small enough to hold one minimum each in all usual cases. Pieces are searched in the
/// order of the distance to the boxes around their control points, which bound the distance from below, until no box is
/// nearer than the best point. From the middle of a piece Newton's method descends within it, in decreasing distance only.
#[derive(Clone, Debug)]
pub struct ClosestPoints<const D: usize> {
    map: Arc<BezierMap<D>>,
    boxes: RTree<GeomWithData<Rectangle<[f64; 3]>, Piece<D>>>,
}

/// A part of a cell, in local coordinates of the cell (0 to 1).
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece<const D: usize> {
    cell: usize,
    middle: [f64; D],
    half_edge: [f64; D],
}

/// Shortest half edge of a piece, 1/32 of a cell: folds are cut into at most 256 pieces a cell.
const SHORTEST_HALF_EDGE: f64 = 1.0 / 32.0;

/// Pieces are cut while legs of the control net along a direction turn by more than 30° from their mean: below that
/// the tangents of a piece span less than a right angle.
const COS_TURN: f64 = 0.866;

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
        let boxes: Vec<_> = (0..map.n_cells())
            .into_par_iter()
            .flat_map_iter(|cell| {
                let mut boxed = Vec::new();
                let whole = Piece { cell, middle: [0.5; D], half_edge: [0.5; D] };
                let mut stack = vec![(map.cell_coefficients(cell).to_vec(), whole)];
                while let Some((points, piece)) = stack.pop() {
                    let bent = |d: &usize| piece.half_edge[*d] > SHORTEST_HALF_EDGE && turns(&map, &points, *d);
                    match (0..D).find(bent) {
                        Some(d) => stack.extend(halves(&map, points, piece, d)),
                        None => boxed.push(GeomWithData::new(bounding_box(&points, map.dim()), piece)),
                    }
                }
                boxed
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
        self.search(query, descend(&self.map, query, cell, u, STEP_TOLERANCE))
    }

    fn search(&self, query: &[f64], mut best: ClosestPoint<D>) -> ClosestPoint<D> {
        for (near, bound) in self.boxes.nearest_neighbor_iter_with_distance_2(padded(query)) {
            if bound >= best.distance * best.distance {
                break;
            }
            let Piece { cell, middle, half_edge } = near.data;
            let range = std::array::from_fn(|d| (middle[d] - half_edge[d], middle[d] + half_edge[d]));
            let found = descend_within(&self.map, query, cell, middle, range, STEP_TOLERANCE);
            if found.distance < best.distance {
                best = found;
            }
        }
        best
    }
}

/// The nearest point to `query` that Newton's method finds in a cell from the parameter `u`, in decreasing distance only: a
/// local minimum, or a point of the cell's border. It ends with a step shorter than `step_tolerance`, a share of the cell: the
/// distance then changes by its square only.
pub fn descend<const D: usize>(
    map: &BezierMap<D>,
    query: &[f64],
    cell: usize,
    u: [f64; D],
    step_tolerance: f64,
) -> ClosestPoint<D> {
    let (lower, upper) = map.cell_box(cell);
    let start = std::array::from_fn(|d| ((u[d] - lower[d]) / (upper[d] - lower[d])).clamp(0.0, 1.0));
    descend_within(map, query, cell, start, [(0.0, 1.0); D], step_tolerance)
}

/// Newton's method for half the squared distance on one cell, in local coordinates, within a range per
/// direction, until a step is shorter than `step_tolerance`.
fn descend_within<const D: usize>(
    map: &BezierMap<D>,
    query: &[f64],
    cell: usize,
    start: [f64; D],
    range: [(f64, f64); D],
    step_tolerance: f64,
) -> ClosestPoint<D> {
    let (lower, upper) = map.cell_box(cell);
    let global = |t: [f64; D]| -> [f64; D] {
        std::array::from_fn(|d| if t[d] == 1.0 { upper[d] } else { lower[d] + t[d] * (upper[d] - lower[d]) })
    };
    let mut t = start;
    let mut local = Local::at(map, cell, global(t), query);
    let mut damping = 0.0;
    for _ in 0..MAX_STEPS {
        let Some(step) = local.step(t, range, damping) else { break };
        let candidate: [f64; D] = std::array::from_fn(|d| (t[d] + step[d]).clamp(range[d].0, range[d].1));
        let moved = (0..D).map(|d| (candidate[d] - t[d]).abs()).fold(0.0, f64::max);
        if moved < step_tolerance {
            break;
        }
        let next = Local::at(map, cell, global(candidate), query);
        if next.half_squared < local.half_squared {
            (t, local) = (candidate, next);
            damping *= 0.1;
        } else {
            damping = if damping == 0.0 { local.curvature_scale() } else { damping * 10.0 };
        }
    }
    ClosestPoint { u: global(t), cell, distance: (2.0 * local.half_squared).sqrt() }
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
        let (lower, upper) = map.cell_box(cell);
        let size: [f64; D] = std::array::from_fn(|d| upper[d] - lower[d]);
        let jet = map.jet(cell, u);
        let mut residual = jet.value;
        residual.iter_mut().zip(query).for_each(|(r, q)| *r -= q);
        let first: [[f64; 3]; D] = std::array::from_fn(|a| jet.first[a].map(|x| x * size[a]));
        let mut local = Self {
            half_squared: 0.5 * dot(&residual, &residual),
            gradient: std::array::from_fn(|a| dot(&first[a], &residual)),
            hessian: [[0.0; D]; D],
            metric: [[0.0; D]; D],
        };
        for a in 0..D {
            for b in a..D {
                let metric = dot(&first[a], &first[b]);
                let full = metric + size[a] * size[b] * dot(&jet.second[a][b], &residual);
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
    fn step(&self, t: [f64; D], range: [(f64, f64); D], damping: f64) -> Option<[f64; D]> {
        let free: [bool; D] = std::array::from_fn(|d| {
            !(t[d] <= range[d].0 && self.gradient[d] >= 0.0 || t[d] >= range[d].1 && self.gradient[d] <= 0.0)
        });
        let solved = |matrix: &[[f64; D]; D], damping: f64| {
            SmallCholesky::new(matrix, &[damping; D], free).map(|factor| factor.step(&self.gradient))
        };
        solved(&self.hessian, damping)
            .or_else(|| solved(&self.metric, damping))
            .or_else(|| solved(&self.metric, damping + self.curvature_scale()))
    }
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Whether the legs of the control net along direction `d` turn by more than `COS_TURN` allows.
fn turns<const D: usize>(map: &BezierMap<D>, points: &[f64], d: usize) -> bool {
    let n = map.dim();
    let stride = n * map.degree()[..d].iter().map(|p| p + 1).product::<usize>();
    let order = map.degree()[d] + 1;
    let along = |at: usize| at / stride % order;
    let starts = (0..points.len()).step_by(n).filter(|&at| along(at) + 1 < order);
    let legs: Vec<[f64; 3]> = starts
        .map(|at| std::array::from_fn(|k| if k < n { points[at + stride + k] - points[at + k] } else { 0.0 }))
        .collect();
    let mean = legs.iter().fold([0.0; 3], |sum, leg| std::array::from_fn(|k| sum[k] + leg[k]));
    let length = dot(&mean, &mean).sqrt();
    legs.iter().any(|leg| dot(leg, &mean) < COS_TURN * length * dot(leg, leg).sqrt())
}

/// Cuts a piece in two along direction `d`, by de Casteljau's algorithm at its middle.
fn halves<const D: usize>(
    map: &BezierMap<D>,
    points: Vec<f64>,
    piece: Piece<D>,
    d: usize,
) -> [(Vec<f64>, Piece<D>); 2] {
    let (mut left, mut right) = (points.clone(), points);
    for_each_line(&map.degree(), map.dim(), d, |start, stride, order| {
        for step in 1..order {
            // Ends that are final: `right` shrinks towards its last point, `left` takes the first of each round.
            for i in 0..order - step {
                let at = start + i * stride;
                right[at] = 0.5 * (right[at] + right[at + stride]);
            }
            left[start + step * stride] = right[start];
        }
    });
    let half = |sign: f64| {
        let mut half = piece;
        half.half_edge[d] *= 0.5;
        half.middle[d] += sign * half.half_edge[d];
        half
    };
    [(left, half(-1.0)), (right, half(1.0))]
}

fn bounding_box(points: &[f64], n: usize) -> Rectangle<[f64; 3]> {
    let (mut lower, mut upper) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for point in points.chunks_exact(n).map(padded) {
        for k in 0..3 {
            lower[k] = lower[k].min(point[k]);
            upper[k] = upper[k].max(point[k]);
        }
    }
    Rectangle::from_aabb(AABB::from_corners(lower, upper))
}

fn padded(point: &[f64]) -> [f64; 3] {
    std::array::from_fn(|k| point.get(k).copied().unwrap_or(0.0))
}
