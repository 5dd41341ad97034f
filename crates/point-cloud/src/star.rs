//! The Delaunay star of a point in its tangent plane.

use crate::vec3::{cross, dot, sub, unit};

/// A point with its neighbourhood unrolled into its tangent plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TangentPlane {
    origin: [f64; 3],
    first: [f64; 3],
    second: [f64; 3],
}

impl TangentPlane {
    pub(crate) fn new(origin: [f64; 3], normal: [f64; 3]) -> Self {
        // The axis farthest from the normal gives the best conditioned tangent.
        let least = (0..3).min_by(|&i, &j| normal[i].abs().total_cmp(&normal[j].abs())).unwrap_or(0);
        let axis: [f64; 3] = std::array::from_fn(|k| if k == least { 1.0 } else { 0.0 });
        let first = unit(cross(axis, normal));
        Self { origin, first, second: cross(normal, first) }
    }

    /// The foot of `point` on the plane.
    pub(crate) fn project(&self, point: [f64; 3]) -> [f64; 2] {
        let d = sub(point, self.origin);
        [dot(d, self.first), dot(d, self.second)]
    }

    /// Direction and distance of `point` kept, height dropped: its place in the unrolled neighbourhood.
    pub(crate) fn unroll(&self, point: [f64; 3]) -> [f64; 2] {
        let (foot, d) = (self.project(point), sub(point, self.origin));
        let flat = square(foot);
        let stretch = if flat > 0.0 { (dot(d, d) / flat).sqrt() } else { 0.0 };
        foot.map(|x| x * stretch)
    }
}

/// No neighbour: a side of the box the cell starts with.
const BOX: usize = usize::MAX;

/// A point's Voronoi cell in the plane, the point at the origin, cut down neighbour by neighbour.
///
/// Its vertices are the circumcentres of the Delaunay triangles at the point.
pub(crate) struct VoronoiCell {
    /// Vertices counter-clockwise, each with the neighbour behind the side that follows it.
    corners: Vec<([f64; 2], usize)>,
    spare: Vec<([f64; 2], usize)>,
    /// Largest distance of a vertex from the point.
    reach: f64,
}

impl VoronoiCell {
    /// A square cell that holds all circumcentres within `radius`.
    pub(crate) fn new(radius: f64) -> Self {
        let r = 2.0 * radius;
        let corners = vec![([-r, -r], BOX), ([r, -r], BOX), ([r, r], BOX), ([-r, r], BOX)];
        Self { corners, spare: Vec::new(), reach: r * std::f64::consts::SQRT_2 }
    }

    /// Cuts away what is closer to the neighbour `index` at `at` than to the origin.
    pub(crate) fn cut(&mut self, at: [f64; 2], index: usize) {
        let limit = 0.5 * square(at);
        let excess = |p: [f64; 2]| p[0] * at[0] + p[1] * at[1] - limit;
        if limit == 0.0 || self.corners.iter().all(|c| excess(c.0) <= 0.0) {
            return;
        }
        self.spare.clear();
        let n = self.corners.len();
        for k in 0..n {
            let (p, behind) = self.corners[k];
            let (q, _) = self.corners[(k + 1) % n];
            let (a, b) = (excess(p), excess(q));
            let crossing = || {
                let t = a / (a - b);
                [p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]
            };
            if a <= 0.0 {
                self.spare.push((p, behind));
                if b > 0.0 {
                    self.spare.push((crossing(), index));
                }
            } else if b <= 0.0 {
                self.spare.push((crossing(), behind));
            }
        }
        std::mem::swap(&mut self.corners, &mut self.spare);
        self.reach = self.corners.iter().map(|c| square(c.0)).fold(0.0, f64::max).sqrt();
    }

    /// Largest distance of a vertex from the point; no neighbour beyond twice this distance can cut the cell.
    pub(crate) fn reach(&self) -> f64 {
        self.reach
    }

    /// The Delaunay triangles at the point with a circumradius of at most `radius`, each as its two other vertices in
    /// counter-clockwise order.
    pub(crate) fn star(&self, radius: f64) -> impl Iterator<Item = [usize; 2]> {
        let n = self.corners.len();
        (0..n).filter_map(move |k| {
            let (p, next) = self.corners[k];
            let previous = self.corners[(k + n - 1) % n].1;
            (previous != BOX && next != BOX && previous != next && square(p) <= radius * radius)
                .then_some([previous, next])
        })
    }
}

fn square([x, y]: [f64; 2]) -> f64 {
    x * x + y * y
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_star_of_a_lattice_point_has_its_neighbours_in_order() {
        let mut cell = VoronoiCell::new(10.0);
        let at = |k: usize| {
            let t = std::f64::consts::FRAC_PI_3 * k as f64;
            [t.cos(), t.sin()]
        };
        for k in [3, 0, 4, 1, 5, 2] {
            cell.cut(at(k), k);
            let far = at(k).map(|x| 1.8 * x);
            cell.cut(far, 10 + k);
        }
        let mut star: Vec<_> = cell.star(1.0).collect();
        star.sort_unstable();
        assert_eq!(star, [[0, 1], [1, 2], [2, 3], [3, 4], [4, 5], [5, 0]]);
        assert!((cell.reach() - 1.0 / 3f64.sqrt()).abs() < 1e-14);
        assert_eq!(cell.star(0.5).count(), 0);
    }

    #[test]
    fn unrolling_keeps_direction_and_distance() {
        let plane = TangentPlane::new([1.0, 2.0, 3.0], [0.0, 0.0, 1.0]);
        let [x, y] = plane.unroll([4.0, 2.0, 7.0]);
        assert!((x.hypot(y) - 5.0).abs() < 1e-14);
        let [u, v] = plane.unroll([1.0, 5.0, 3.0]);
        // A right angle, counter-clockwise seen along the normal.
        assert!((x * u + y * v).abs() < 1e-14 && x * v - y * u > 0.0);
    }
}
