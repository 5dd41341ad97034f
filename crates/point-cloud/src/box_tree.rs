//! The nearest point of a triangle mesh, and of points whatever their coordinates are.

use crate::vec3::{add, cross, dot, norm, scale, sub};

/// The nearest point of a mesh to a given one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// Index of the triangle; of equally near ones, which one is fixed by the tree.
    pub triangle: u32,
    /// Barycentric coordinates of the foot: not negative, sum 1.
    pub barycentric: [f64; 3],
    /// Square of the distance.
    pub squared_distance: f64,
}

/// Most shapes of a leaf; a test of a triangle costs as much as two or three of a box.
const LEAF: usize = 4;

/// What a tree of boxes holds.
trait Shape: Copy {
    /// Lower and upper corner of its box.
    fn bounds(&self) -> [[f64; 3]; 2];
    /// Its centre, or a multiple of it that is the same for all shapes.
    fn center(&self) -> [f64; 3];
}

impl Shape for [[f64; 3]; 3] {
    fn bounds(&self) -> [[f64; 3]; 2] {
        let [p, q, r] = *self;
        [std::array::from_fn(|k| p[k].min(q[k]).min(r[k])), std::array::from_fn(|k| p[k].max(q[k]).max(r[k]))]
    }

    fn center(&self) -> [f64; 3] {
        let [p, q, r] = *self;
        add(add(p, q), r)
    }
}

impl Shape for [f64; 3] {
    fn bounds(&self) -> [[f64; 3]; 2] {
        [*self; 2]
    }

    fn center(&self) -> [f64; 3] {
        *self
    }
}

/// Boxes round shapes, halved along their longest side at the median of the centres.
struct BoxTree<S> {
    nodes: Vec<Node>,
    /// The shapes, leaf after leaf, and their indices.
    shapes: Vec<S>,
    items: Vec<u32>,
}

struct Node {
    lower: [f64; 3],
    upper: [f64; 3],
    /// Its part of the shapes.
    begin: u32,
    end: u32,
    /// The second child, zero for a leaf; the first child is the next node.
    second: u32,
}

impl<S: Shape> BoxTree<S> {
    fn new(shapes: &[S]) -> Self {
        let mut order: Vec<u32> = (0..shapes.len() as u32).collect();
        let mut nodes = Vec::with_capacity(shapes.len());
        split(shapes, &mut order, 0, &mut nodes);
        Self { nodes, shapes: order.iter().map(|&t| shapes[t as usize]).collect(), items: order }
    }

    /// Visits shapes until none can be nearer: `visit` has the place of one among the shapes and the smallest squared distance so far, and
    /// returns the smaller one of that and its own.
    fn nearest(&self, point: [f64; 3], mut visit: impl FnMut(usize, f64) -> f64) {
        let mut best = f64::INFINITY;
        // Depth first, the nearer child first. The depth is at most 32: each level halves the number of shapes.
        let mut stack = [(0u32, 0.0f64); 40];
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let (at, bound) = stack[top];
            if bound >= best {
                continue;
            }
            let node = &self.nodes[at as usize];
            if node.second == 0 {
                best = (node.begin as usize..node.end as usize).fold(best, |best, k| visit(k, best));
                continue;
            }
            let mut children = [at + 1, node.second].map(|c| (c, self.nodes[c as usize].squared_distance(point)));
            if children[0].1 < children[1].1 {
                children.swap(0, 1);
            }
            stack[top..top + 2].copy_from_slice(&children);
            top += 2;
        }
    }

    /// Calls `visit` with the index of each shape whose squared distance is at most that of `radius`, in the order of the tree.
    fn for_each_within(&self, point: [f64; 3], radius: f64, squared: impl Fn(&S) -> f64, visit: &mut impl FnMut(u32)) {
        let most = radius * radius;
        let mut stack = vec![0u32];
        while let Some(at) = stack.pop() {
            let node = &self.nodes[at as usize];
            if node.squared_distance(point) > most {
                continue;
            }
            if node.second != 0 {
                stack.extend([node.second, at + 1]);
                continue;
            }
            (node.begin as usize..node.end as usize)
                .filter(|&k| squared(&self.shapes[k]) <= most)
                .for_each(|k| visit(self.items[k]));
        }
    }
}

/// Points for queries of the nearest one, whatever their coordinates are: where one extends over thousands of times as much as
/// another, as heights in metres over degrees do, boxes are halved along that one alone.
pub struct PointTree(BoxTree<[f64; 3]>);

impl PointTree {
    /// Indexes points, one at least. O(n log n).
    pub fn new(points: &[[f64; 3]]) -> Self {
        Self(BoxTree::new(points))
    }

    /// The distance of the point nearest to a place and its index; of equally near ones, which one is fixed by the tree.
    pub fn nearest(&self, place: [f64; 3]) -> (f64, u32) {
        let (mut nearest, mut squared) = (0, f64::INFINITY);
        self.0.nearest(place, |k, best| {
            let offset = sub(place, self.0.shapes[k]);
            let found = dot(offset, offset);
            if found < best {
                (nearest, squared) = (k, found);
            }
            best.min(found)
        });
        (squared.sqrt(), self.0.items[nearest])
    }

    /// Calls `visit` with the index of each point at a distance of at most `radius` from `place`, in the order of the tree.
    pub fn for_each_within(&self, place: [f64; 3], radius: f64, mut visit: impl FnMut(u32)) {
        let squared = |point: &[f64; 3]| {
            let offset = sub(place, *point);
            dot(offset, offset)
        };
        self.0.for_each_within(place, radius, squared, &mut visit);
    }
}

/// Triangles for queries of the nearest point.
pub struct TriangleTree(BoxTree<[[f64; 3]; 3]>);

impl TriangleTree {
    /// Indexes triangles, one at least, given by their corners. O(n log n).
    pub fn new(corners: &[[[f64; 3]; 3]]) -> Self {
        Self(BoxTree::new(corners))
    }

    /// The point of the mesh nearest to `point`.
    pub fn nearest(&self, point: [f64; 3]) -> Foot {
        let mut found = Foot { triangle: 0, barycentric: [1.0, 0.0, 0.0], squared_distance: f64::INFINITY };
        self.0.nearest(point, |k, best| {
            let (barycentric, squared_distance) = foot_on_triangle(point, &self.0.shapes[k]);
            if squared_distance >= best {
                return best;
            }
            found = Foot { triangle: self.0.items[k], barycentric, squared_distance };
            squared_distance
        });
        found
    }

    /// Calls `visit` with the index of each triangle at a distance of at most `radius` from `point`, in the order of the tree.
    pub fn for_each_within(&self, point: [f64; 3], radius: f64, mut visit: impl FnMut(u32)) {
        self.0.for_each_within(point, radius, |corners| foot_on_triangle(point, corners).1, &mut visit);
    }

    /// The smallest distance along a ray, positive multiples of `direction` from `origin` in its units, at which it meets a triangle for
    /// which `counts` of the triangle's index and the distance holds.
    pub fn first_hit(
        &self,
        origin: [f64; 3],
        direction: [f64; 3],
        mut counts: impl FnMut(u32, f64) -> bool,
    ) -> Option<f64> {
        let inverse = direction.map(f64::recip);
        let mut best = f64::INFINITY;
        let mut stack = vec![0_u32];
        while let Some(at) = stack.pop() {
            let node = &self.0.nodes[at as usize];
            if node.entry(origin, inverse) >= best {
                continue;
            }
            if node.second != 0 {
                stack.extend([at + 1, node.second]);
                continue;
            }
            for k in node.begin as usize..node.end as usize {
                if let Some(t) = hit(origin, direction, &self.0.shapes[k])
                    && t < best
                    && counts(self.0.items[k], t)
                {
                    best = t;
                }
            }
        }
        best.is_finite().then_some(best)
    }
}

/// Where a ray meets a triangle, if it does (Möller and Trumbore 1997).
fn hit(origin: [f64; 3], direction: [f64; 3], &[p, q, r]: &[[f64; 3]; 3]) -> Option<f64> {
    let (e, f) = (sub(q, p), sub(r, p));
    let across = cross(direction, f);
    let determinant = dot(e, across);
    let from = sub(origin, p);
    let u = dot(from, across) / determinant;
    let turned = cross(from, e);
    let v = dot(direction, turned) / determinant;
    let t = dot(f, turned) / determinant;
    // A ray in the plane of the triangle has no determinant, and meets it nowhere.
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t.is_finite()).then_some(t)
}

impl Node {
    /// Distance at which a ray enters the box; infinite if it does not.
    fn entry(&self, origin: [f64; 3], inverse: [f64; 3]) -> f64 {
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for k in 0..3 {
            let (a, b) = ((self.lower[k] - origin[k]) * inverse[k], (self.upper[k] - origin[k]) * inverse[k]);
            // A ray parallel to a side that begins on it gives NaN, which minimum and maximum pass over.
            (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
        }
        if enter <= leave { enter } else { f64::INFINITY }
    }

    fn squared_distance(&self, p: [f64; 3]) -> f64 {
        (0..3).map(|k| (self.lower[k] - p[k]).max(p[k] - self.upper[k]).max(0.0).powi(2)).sum()
    }
}

/// Adds the node of `order`, which begins at `begin` in the whole, and those below it.
fn split<S: Shape>(shapes: &[S], order: &mut [u32], begin: u32, nodes: &mut Vec<Node>) {
    let bounds = |value: &dyn Fn(&S) -> [[f64; 3]; 2], order: &[u32]| {
        order.iter().fold([[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]], |[lower, upper], &t| {
            let [low, high] = value(&shapes[t as usize]);
            [std::array::from_fn(|k| lower[k].min(low[k])), std::array::from_fn(|k| upper[k].max(high[k]))]
        })
    };
    let [lower, upper] = bounds(&S::bounds, order);
    let index = nodes.len();
    nodes.push(Node { lower, upper, begin, end: begin + order.len() as u32, second: 0 });
    if order.len() <= LEAF {
        return;
    }
    let [low, high] = bounds(&|shape| [shape.center(); 2], order);
    let extent = sub(high, low);
    let axis = (0..3).max_by(|&i, &j| extent[i].total_cmp(&extent[j])).unwrap_or(0);
    let middle = order.len() / 2;
    let at = |t: u32| shapes[t as usize].center()[axis];
    order.select_nth_unstable_by(middle, |&a, &b| at(a).total_cmp(&at(b)).then(a.cmp(&b)));
    let (first, second) = order.split_at_mut(middle);
    split(shapes, first, begin, nodes);
    nodes[index].second = nodes.len() as u32;
    split(shapes, second, begin + middle as u32, nodes);
}

/// Triangles with an angle of a smaller squared sine count as their sides: the areas would be round-off.
const FLAT: f64 = 1e-14;

/// Barycentric coordinates of the point of a triangle nearest to `x`, and its squared distance (Ericson, Real-Time
/// Collision Detection, 2005, §5.1.5: the regions of the corners, then of the edges, then the inside).
fn foot_on_triangle(x: [f64; 3], &[p, q, r]: &[[f64; 3]; 3]) -> ([f64; 3], f64) {
    let (e, f, d) = (sub(q, p), sub(r, p), sub(x, p));
    let (along_e, along_f) = (dot(e, d), dot(f, d));
    let (from_q, from_r) = (sub(x, q), sub(x, r));
    let (e_q, f_q) = (dot(e, from_q), dot(f, from_q));
    let (e_r, f_r) = (dot(e, from_r), dot(f, from_r));
    // The areas of x with the three edges, seen along the normal.
    let at_r = along_e * f_q - e_q * along_f;
    let at_q = e_r * along_f - along_e * f_r;
    let at_p = e_q * f_r - e_r * f_q;
    let total = at_p + at_q + at_r;
    if total <= FLAT * dot(e, e) * dot(f, f) {
        return foot_on_sides(x, [p, q, r]);
    }
    let share = |a: f64, b: f64| a / (a + b);
    let barycentric = if along_e <= 0.0 && along_f <= 0.0 {
        [1.0, 0.0, 0.0]
    } else if e_q >= 0.0 && f_q <= e_q {
        [0.0, 1.0, 0.0]
    } else if f_r >= 0.0 && e_r <= f_r {
        [0.0, 0.0, 1.0]
    } else if at_r <= 0.0 && along_e >= 0.0 && e_q <= 0.0 {
        let t = share(along_e, -e_q);
        [1.0 - t, t, 0.0]
    } else if at_q <= 0.0 && along_f >= 0.0 && f_r <= 0.0 {
        let t = share(along_f, -f_r);
        [1.0 - t, 0.0, t]
    } else if at_p <= 0.0 && f_q >= e_q && e_r >= f_r {
        let t = share(f_q - e_q, e_r - f_r);
        [0.0, 1.0 - t, t]
    } else {
        [1.0 - (at_q + at_r) / total, at_q / total, at_r / total]
    };
    let offset = sub(d, add(scale(barycentric[1], e), scale(barycentric[2], f)));
    (barycentric, dot(offset, offset))
}

/// As [`foot_on_triangle`] for the three sides alone.
fn foot_on_sides(x: [f64; 3], corners: [[f64; 3]; 3]) -> ([f64; 3], f64) {
    let mut best = ([1.0, 0.0, 0.0], f64::INFINITY);
    for (a, b) in [(0, 1), (1, 2), (2, 0)] {
        let (side, d) = (sub(corners[b], corners[a]), sub(x, corners[a]));
        let squared_length = dot(side, side);
        let t = if squared_length > 0.0 { (dot(side, d) / squared_length).clamp(0.0, 1.0) } else { 0.0 };
        let offset = sub(d, scale(t, side));
        if dot(offset, offset) < best.1 {
            best.0 = [0.0; 3];
            (best.0[a], best.0[b]) = (1.0 - t, t);
            best.1 = dot(offset, offset);
        }
    }
    best
}

/// Barycentric coordinates of the foot of `x` on the plane of a triangle, wherever it lies; `None` without area.
pub fn barycentric_in_plane(x: [f64; 3], [p, q, r]: [[f64; 3]; 3]) -> Option<[f64; 3]> {
    let (e, f, d) = (sub(q, p), sub(r, p), sub(x, p));
    let normal = cross(e, f);
    let length = norm(normal);
    let unit = scale(length.recip(), normal);
    let (at_q, at_r) = (dot(cross(d, f), unit) / length, dot(cross(e, d), unit) / length);
    (at_q.is_finite() && at_r.is_finite()).then_some([1.0 - at_q - at_r, at_q, at_r])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Golden-section search over an edge, nested over the triangle: slow, and blind to regions.
    fn distance_by_search(x: [f64; 3], [p, q, r]: [[f64; 3]; 3]) -> f64 {
        let minimum = |f: &dyn Fn(f64) -> f64| {
            let ratio = 0.5 * (5f64.sqrt() - 1.0);
            let (mut a, mut b) = (0.0, 1.0);
            for _ in 0..60 {
                let (c, d) = (b - ratio * (b - a), a + ratio * (b - a));
                if f(c) < f(d) { b = d } else { a = c }
            }
            f(0.5 * (a + b))
        };
        let between = |a, b, t| add(scale(1.0 - t, a), scale(t, b));
        minimum(&|s| {
            let (a, b) = (between(p, q, s), between(p, r, s));
            minimum(&|t| norm(sub(x, between(a, b, t))))
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn the_foot_is_the_nearest_point_of_a_triangle(
            corners in prop::array::uniform3(prop::array::uniform3(-1.0..1.0f64)), x in prop::array::uniform3(-2.0..2.0f64),
        ) {
            let (barycentric, squared) = foot_on_triangle(x, &corners);
            prop_assert!(barycentric.iter().all(|b| *b >= -1e-12) && (barycentric.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            prop_assert!((squared.sqrt() - distance_by_search(x, corners)).abs() < 1e-7);
            let foot = (0..3).fold([0.0; 3], |sum, k| add(sum, scale(barycentric[k], corners[k])));
            prop_assert!((norm(sub(x, foot)) - squared.sqrt()).abs() < 1e-12);
        }

        #[test]
        fn the_tree_finds_what_a_search_of_all_triangles_finds(
            corners in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-1.0..1.0f64)), 1..60),
            x in prop::array::uniform3(-2.0..2.0f64),
        ) {
            let nearest = corners.iter().map(|c| foot_on_triangle(x, c).1).fold(f64::INFINITY, f64::min);
            let foot = TriangleTree::new(&corners).nearest(x);
            prop_assert_eq!(foot.squared_distance, nearest);
            prop_assert_eq!(foot_on_triangle(x, &corners[foot.triangle as usize]), (foot.barycentric, nearest));
            let (radius, mut within) = (nearest.sqrt() + 0.5, Vec::new());
            TriangleTree::new(&corners).for_each_within(x, radius, |t| within.push(t as usize));
            within.sort_unstable();
            let near = |&t: &usize| foot_on_triangle(x, &corners[t]).1 <= radius * radius;
            prop_assert_eq!(within, (0..corners.len()).filter(near).collect::<Vec<_>>());
        }
    }

    #[test]
    fn the_nearest_point_is_found_whatever_the_coordinates_are() {
        // Heights over degrees: whole numbers up to 1000 over a square of a tenth; and many equal ones.
        let hash = |k: u64| (k.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as f64 / 16_777_216.0;
        for scale in [[1.0, 1.0, 1.0], [0.1, 0.1, 1000.0], [0.0, 1e-6, 3.0], [0.0; 3]] {
            let point =
                |k: u64| [hash(3 * k) * scale[0], hash(3 * k + 1) * scale[1], (hash(3 * k + 2) * scale[2]).round()];
            let points: Vec<[f64; 3]> = (0..500).map(point).collect();
            let tree = PointTree::new(&points);
            for k in 1000..1100 {
                let place = [hash(k), hash(k + 1), 1000.0 * hash(k + 2)];
                let distance = |p: &[f64; 3]| norm(sub(place, *p));
                let nearest = points.iter().map(distance).fold(f64::INFINITY, f64::min);
                let (found, item) = tree.nearest(place);
                assert!(found == nearest && distance(&points[item as usize]) == nearest);
                let (radius, mut within) = (1.2 * nearest, Vec::new());
                tree.for_each_within(place, radius, |k| within.push(k as usize));
                within.sort_unstable();
                let is_near = |&k: &usize| {
                    let offset = sub(place, points[k]);
                    dot(offset, offset) <= radius * radius
                };
                assert_eq!(within, (0..points.len()).filter(is_near).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn triangles_without_area_have_feet_too() {
        let (p, q) = ([0.0; 3], [2.0, 0.0, 0.0]);
        for corners in [[p, q, q], [p, p, q], [q, p, q], [p, q, [1.0, 0.0, 0.0]]] {
            let (barycentric, squared) = foot_on_triangle([1.5, 1.0, 0.0], &corners);
            assert!((squared - 1.0).abs() < 1e-15, "{barycentric:?} {squared}");
            assert_eq!(barycentric_in_plane(q, corners), None);
        }
        assert_eq!(foot_on_triangle(q, &[p, p, p]), ([1.0, 0.0, 0.0], 4.0));
    }
}
