//! The neighbours of a point in the Delaunay triangulation of its surroundings, laid into their tangent plane.

use robust::{Coord, orient2d};

use point_cloud::vec3::{dot, sub};

/// A neighbour whose projection is nearer than this share of its distance lies above the centre rather than beside it;
/// its direction in the tangent plane would be noise.
const STEEPEST: f64 = 1e-6;

/// The Delaunay neighbours of `center` among `surroundings`, counter-clockwise in the plane that fits them best, as
/// places in `surroundings`. `None` if the centre is on the rim of the triangulation, so that no ring closes round it.
///
/// The Voronoi cell of the origin is `{x : x·q ≤ |q|²/2 for all q}`, the polar dual of the convex hull of the inverted
/// points `q/|q|²`: the Delaunay neighbours of the origin are the corners of this hull, and the ring closes if the
/// origin is inside. That costs one sort, where a triangulation of all the surroundings would be thrown away.
pub(crate) fn delaunay_star(center: [f64; 3], surroundings: &[[f64; 3]]) -> Option<Vec<u32>> {
    let [e, f] = tangent_plane(center, surroundings);
    let mut inverted: Vec<(Coord<f64>, u32)> = Vec::with_capacity(surroundings.len());
    for (k, &p) in surroundings.iter().enumerate() {
        let spoke = sub(p, center);
        let (x, y) = (dot(spoke, e), dot(spoke, f));
        let squared = x * x + y * y;
        if squared > STEEPEST * STEEPEST * dot(spoke, spoke) {
            inverted.push((Coord { x: x / squared, y: y / squared }, k as u32));
        }
    }
    inverted.sort_by(|(a, i), (b, j)| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(i.cmp(j)));
    let hull = convex_hull(&inverted);
    let origin = Coord { x: 0.0, y: 0.0 };
    let closed =
        hull.len() >= 3 && (0..hull.len()).all(|k| orient2d(hull[k].0, hull[(k + 1) % hull.len()].0, origin) > 0.0);
    closed.then(|| hull.into_iter().map(|(_, k)| k).collect())
}

/// The corners of the convex hull of sorted points, counter-clockwise (Andrew's monotone chain, exact predicates).
fn convex_hull(sorted: &[(Coord<f64>, u32)]) -> Vec<(Coord<f64>, u32)> {
    let mut hull: Vec<(Coord<f64>, u32)> = Vec::with_capacity(16);
    let mut chain = |points: &mut dyn Iterator<Item = &(Coord<f64>, u32)>| {
        let begin = hull.len();
        for &point in points {
            while hull.len() >= begin + 2 && orient2d(hull[hull.len() - 2].0, hull[hull.len() - 1].0, point.0) <= 0.0 {
                hull.pop();
            }
            hull.push(point);
        }
        // The end of a chain is the beginning of the next.
        hull.pop();
    };
    chain(&mut sorted.iter());
    chain(&mut sorted.iter().rev());
    hull
}

/// Two orthogonal unit vectors that span the plane of best fit (least squares of the distances).
fn tangent_plane(center: [f64; 3], surroundings: &[[f64; 3]]) -> [[f64; 3]; 2] {
    let count = (surroundings.len() + 1) as f64;
    let mut mean = [0.0; 3];
    for &p in surroundings {
        let d = sub(p, center);
        mean = std::array::from_fn(|k| mean[k] + d[k] / count);
    }
    let mut covariance = [[0.0; 3]; 3];
    for p in surroundings.iter().copied().chain([center]) {
        let d = sub(sub(p, center), mean);
        for (row, x) in covariance.iter_mut().zip(d) {
            for (entry, y) in row.iter_mut().zip(d) {
                *entry += x * y;
            }
        }
    }
    let (values, vectors) = symmetric_eigen(covariance);
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| values[j].total_cmp(&values[i]).then(i.cmp(&j)));
    [vectors[order[0]], vectors[order[1]]]
}

/// Sweeps of Jacobi's method; it converges quadratically, and five sweeps reach round-off for 3 by 3 matrices.
const JACOBI_SWEEPS: usize = 8;

/// Eigenvalues and orthonormal eigenvectors of a symmetric matrix, by Jacobi rotations (Golub and Van Loan, Matrix
/// Computations, §8.5).
fn symmetric_eigen(mut a: [[f64; 3]; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
    let mut vectors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..JACOBI_SWEEPS {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = (t * t + 1.0).sqrt().recip();
            let s = t * c;
            for row in &mut a {
                (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
            }
            for k in 0..3 {
                (a[p][k], a[q][k]) = (c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]);
                (vectors[p][k], vectors[q][k]) =
                    (c * vectors[p][k] - s * vectors[q][k], s * vectors[p][k] + c * vectors[q][k]);
            }
            (a[p][q], a[q][p]) = (0.0, 0.0);
        }
    }
    ([a[0][0], a[1][1], a[2][2]], vectors)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use spade::{DelaunayTriangulation, Point2, Triangulation};

    proptest! {
        /// The star agrees with the ring in a Delaunay triangulation of all points.
        #[test]
        fn the_star_is_the_ring_of_a_full_triangulation(
            points in prop::collection::vec((-1.0..1.0f64, -1.0..1.0f64), 8..40), tilt in -3.0..3.0f64,
        ) {
            // Angles survive only if the plane is met without distortion: an orthonormal frame.
            let length = tilt.hypot(1.0);
            let in_space = |x: f64, y: f64| [x / length, y, x * tilt / length];
            let surroundings: Vec<[f64; 3]> = points.iter().map(|&(x, y)| in_space(x, y)).collect();
            let mut all: Vec<Point2<f64>> = points.iter().map(|&(x, y)| Point2::new(x, y)).collect();
            all.push(Point2::new(0.0, 0.0));
            let triangulation = DelaunayTriangulation::<Point2<f64>>::bulk_load_stable(all).unwrap();
            let center = triangulation.vertex(spade::handles::FixedVertexHandle::from_index(points.len()));
            let open = center.out_edges().any(|e| e.is_outer_edge() || e.rev().is_outer_edge());
            let mut ring: Vec<u32> = center.out_edges().map(|e| e.to().index() as u32).collect();
            let star = delaunay_star([0.0; 3], &surroundings);
            prop_assert_eq!(star.is_none(), open);
            if let Some(mut star) = star {
                ring.sort_unstable();
                star.sort_unstable();
                prop_assert_eq!(star, ring);
            }
        }
    }

    #[test]
    fn the_eigenvectors_diagonalize() {
        let a = [[4.0, 1.0, -2.0], [1.0, 2.0, 0.5], [-2.0, 0.5, 3.0]];
        let (values, vectors) = symmetric_eigen(a);
        for (value, v) in values.into_iter().zip(vectors) {
            for k in 0..3 {
                assert!((dot(a[k], v) - value * v[k]).abs() < 1e-14, "{values:?} {vectors:?}");
            }
        }
        assert!((values.iter().sum::<f64>() - 9.0).abs() < 1e-13);
    }

    #[test]
    fn a_point_at_the_rim_has_no_star() {
        let half: Vec<[f64; 3]> = (0..5).map(|k| [(k as f64).cos(), k as f64, 0.0]).collect();
        assert_eq!(delaunay_star([-3.0, 0.0, 0.0], &half), None);
        assert_eq!(delaunay_star([0.0; 3], &[]), None);
    }
}
