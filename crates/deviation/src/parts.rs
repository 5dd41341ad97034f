//! Triangles cut into parts: where their parts are judged, and the farthest place of all.

use std::array;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

use point_cloud::vec3::{add, norm, scale, sub};
use rayon::prelude::*;

/// Places at which distances are taken, beyond those known, in search of the farthest one; a place for which much is looked at counts as
/// several.
///
/// Limit: time.
const MOST_SEARCHED: usize = 200_000;

/// Pieces that are cut at a time.
///
/// Limit: more of them are cut that a better place would have ruled out; fewer leave threads idle.
const CUT_AT_ONCE: usize = 64;

/// Error of the largest distance, as a share of it and of the tolerance.
///
/// Derived: a fifth of that up to which reported and measured largest distances agree (docs, "Reported and measured").
const LARGEST_ERROR: f64 = 0.01;

/// Parts of a side that a piece is cut into.
///
/// Limit: the smallest number; more would cut where half the size rules the piece out.
const CUT: usize = 2;

/// Fractional parts of the multiples of these two numbers fill the unit square evenly (Roberts 2018, the sequence R₂): the inverse
/// of the root of x³ = x + 1, and its square.
const EVENLY: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];

/// Calls `visit` with the barycentric coordinates of the middle of each of the `n²` parts of a triangle.
pub(crate) fn for_each_part(n: usize, mut visit: impl FnMut([f64; 3])) {
    for_each_part_at(n, |_| [1.0 / 3.0; 2], &mut |weights, _| visit(weights));
}

/// The `n²` parts of a triangle as pieces, in the order of [`for_each_part`], of which `judged` tells the distances at their middles.
pub(crate) fn pieces(triangle: u32, n: usize, mut judged: impl FnMut(usize) -> Judged) -> Vec<Piece> {
    let mut pieces = Vec::with_capacity(n * n);
    for_each_part_at(n, |_| [1.0 / 3.0; 2], &mut |middle, sign| {
        pieces.push(Piece { triangle, middle, size: sign / n as f64, judged: judged(pieces.len()) });
    });
    pieces
}

/// Calls `visit` with the barycentric coordinates of a place in each of the `n²` parts of a triangle. Where that is in the part differs
/// from part to part: what lies along the sides of triangles, where flat and curved ones meet, gets its share, which the middles of
/// parts never see. `first` numbers the parts of the triangle among all.
pub(crate) fn for_each_place(n: usize, first: usize, mut visit: impl FnMut([f64; 3])) {
    let place = |k: usize| {
        let [a, b] = EVENLY.map(|x| ((first + k) as f64 * x).fract());
        if a + b > 1.0 { [1.0 - a, 1.0 - b] } else { [a, b] }
    };
    for_each_part_at(n, place, &mut |weights, _| visit(weights));
}

/// Calls `visit` for each of the `n²` parts of a triangle with the barycentric coordinates of a place of it: `place` gives those in the
/// part by its number. A part is as the triangle (1) or turned by half a turn (-1).
fn for_each_part_at(n: usize, place: impl Fn(usize) -> [f64; 2], visit: &mut impl FnMut([f64; 3], f64)) {
    let (size, mut number) = (n as f64, 0);
    let mut at = |corner: [usize; 2], sign: f64| {
        let [u, v] = place(number);
        let (u, v) = ((corner[0] as f64 + sign * u) / size, (corner[1] as f64 + sign * v) / size);
        number += 1;
        visit([(1.0 - u - v).max(0.0), u, v], sign);
    };
    for j in 0..n {
        for i in 0..n - j {
            at([i, j], 1.0);
            if i + j + 1 < n {
                at([i + 1, j + 1], -1.0);
            }
        }
    }
}

/// The point of a triangle with the given barycentric coordinates.
pub(crate) fn point_at(corners: [[f64; 3]; 3], weights: [f64; 3]) -> [f64; 3] {
    (0..3).fold([0.0; 3], |sum, k| add(sum, scale(weights[k], corners[k])))
}

/// Distance from the middle of a triangle to its farthest corner.
pub(crate) fn radius(corners: [[f64; 3]; 3]) -> f64 {
    let middle = point_at(corners, [1.0 / 3.0; 3]);
    corners.iter().map(|&corner| norm(sub(corner, middle))).fold(0.0, f64::max)
}

/// A distance at a place, and what it is at most at places as far from there as was asked.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Judged {
    pub(crate) distance: f64,
    pub(crate) most: f64,
    /// How many places of the usual cost this one counts for.
    pub(crate) cost: usize,
}

impl Judged {
    /// One of the usual cost.
    pub(crate) fn new(distance: f64, most: f64) -> Self {
        Self { distance, most, cost: 1 }
    }
}

/// A part of a triangle that is similar to it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    triangle: u32,
    /// Barycentric coordinates of its middle.
    middle: [f64; 3],
    /// Its size in triangles, negative where it is turned by half a turn.
    size: f64,
    /// The distance at its middle, and what no place of it exceeds.
    pub(crate) judged: Judged,
}

impl Piece {
    /// The largest distance that is to be expected in it: most distances grow by half of what they may. A middle that does not count, beyond
    /// an outline, tells nothing.
    fn promise(&self) -> f64 {
        let Judged { distance, most, .. } = self.judged;
        if distance.is_finite() { 0.5 * (distance + most) } else { most }
    }

    /// The middles of the parts of an even cut, and their sizes.
    fn parts(&self) -> [([f64; 3], f64); CUT * CUT] {
        let mut parts = [([0.0; 3], 0.0); CUT * CUT];
        let (size, mut number) = (self.size / CUT as f64, 0);
        for_each_part_at(CUT, |_| [1.0 / 3.0; 2], &mut |w, sign| {
            let middle = array::from_fn(|k| (self.middle[k] + self.size * (w[k] - 1.0 / 3.0)).max(0.0));
            parts[number] = (middle, sign * size);
            number += 1;
        });
        parts
    }
}

impl PartialEq for Piece {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Piece {}

impl PartialOrd for Piece {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Piece {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_middle =
            || (0..3).map(|k| other.middle[k].total_cmp(&self.middle[k])).fold(Ordering::Equal, Ordering::then);
        self.promise().total_cmp(&other.promise()).then(other.triangle.cmp(&self.triangle)).then_with(by_middle)
    }
}

/// What a piece has to promise to be cut, where a place at the distance `known` is known.
pub(crate) fn worth_cutting(known: f64, tolerance: f64) -> f64 {
    known + LARGEST_ERROR * known.max(tolerance)
}

/// The farthest place in `pieces`, if that is farther than is `known`, by branch and bound (Piyavskii and Shubert's search for the
/// largest value of a function that does not change faster than its argument): the piece that promises most is cut, and pieces that cannot
/// have a larger distance than is known, up to a hundredth of it or of the tolerance, or are that small, are left out.
/// `judge` gives the distance at a place of a triangle and what it is at most within a reach of it, `radius` the reach that takes in all
/// of a triangle from its middle. The result is certain unless `judge` is asked 2·10⁵ times, when the best place so far is taken.
pub(crate) fn farthest(
    pieces: Vec<Piece>,
    known: f64,
    tolerance: f64,
    radius: &(dyn Fn(u32) -> f64 + Sync),
    judge: &(dyn Fn(u32, [f64; 3], f64) -> Judged + Sync),
) -> Option<(u32, [f64; 3])> {
    let mut open = BinaryHeap::from(pieces);
    let (mut best, mut known, mut asked) = (None, known, 0);
    while asked < MOST_SEARCHED {
        let is_worth = |piece: &Piece| piece.judged.most > worth_cutting(known, tolerance);
        let popped = std::iter::from_fn(|| open.pop());
        let cut: Vec<Piece> = popped.filter(is_worth).take(CUT_AT_ONCE).collect();
        if cut.is_empty() {
            break;
        }
        let of_piece = |piece: &Piece| {
            let radius = radius(piece.triangle);
            piece.parts().map(|(middle, size)| {
                let found = judge(piece.triangle, middle, size.abs() * radius);
                let judged = Judged { most: found.most.min(piece.judged.most), ..found };
                Piece { middle, size, judged, ..*piece }
            })
        };
        let parts: Vec<[Piece; CUT * CUT]> = cut.par_iter().map(of_piece).collect();
        for part in parts.into_iter().flatten() {
            asked += part.judged.cost;
            if part.judged.distance > known {
                (best, known) = (Some((part.triangle, part.middle)), part.judged.distance);
            }
            let is_large = part.size.abs() * radius(part.triangle) > LARGEST_ERROR * tolerance;
            if is_large && part.judged.most > worth_cutting(known, tolerance) {
                open.push(part);
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_share_the_triangle_evenly() {
        for n in 1..9 {
            let (mut middles, mut places, mut mean) = (0, Vec::new(), [0.0; 3]);
            for_each_part(n, |w| {
                assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-12 && w.iter().all(|&x| x > 0.0));
                mean = add(mean, w);
                middles += 1;
            });
            assert!(middles == n * n && mean.iter().all(|x| (x / (n * n) as f64 - 1.0 / 3.0).abs() < 1e-12));
            for_each_place(n, 17 * n, |w| places.push(w));
            assert!(places.len() == n * n);
            assert!(places.iter().flatten().all(|&x| x >= 0.0));
            // Each in its own part: the cells of the three coordinates tell which.
            let part = |w: &[f64; 3]| w.map(|x| (x * n as f64).floor() as usize);
            let mut parts: Vec<[usize; 3]> = places.iter().map(part).collect();
            parts.sort_unstable();
            parts.dedup();
            assert_eq!(parts.len(), n * n);
        }
    }

    #[test]
    fn strips_along_the_sides_get_their_share() {
        // 400 triangles of 16 parts. A strip of one hundredth of the height along a side has 2 % of the area; the middles of the
        // parts lie a twelfth of the height from it at least.
        let (mut inside, mut all) = (0, 0);
        for t in 0..400 {
            for_each_place(4, 16 * t, |w| {
                inside += usize::from(w[0] < 0.01);
                all += 1;
            });
        }
        let share = f64::from(inside as u32) / f64::from(all as u32);
        assert!((share - 0.0199).abs() < 0.003, "{share}");
    }

    #[test]
    fn the_farthest_place_is_found_between_the_known_ones() {
        // One peak in each of 100 triangles, at places that differ; the highest is asked for.
        let peak = |t: u32| {
            let [a, b] = EVENLY.map(|x| (f64::from(t) * x).fract());
            [0.2 + 0.3 * a, 0.2 + 0.3 * b]
        };
        let height = |t: u32, w: [f64; 3]| {
            let [u, v] = peak(t);
            1.0 + 0.001 * f64::from(t) - ((w[1] - u).powi(2) + (w[2] - v).powi(2)).sqrt()
        };
        let judge = |t: u32, w: [f64; 3], reach: f64| {
            let distance = height(t, w);
            Judged::new(distance, distance + reach)
        };
        let whole = |t: u32| pieces(t, 1, |_| judge(t, [1.0 / 3.0; 3], 0.75));
        let all: Vec<Piece> = (0..100).flat_map(whole).collect();
        let (triangle, weights) = farthest(all.clone(), 0.0, 0.1, &|_| 0.75, &judge).unwrap();
        assert!(height(triangle, weights) > 1.099 * 0.99, "{triangle} {weights:?}");
        assert!(farthest(all, 1.1, 0.1, &|_| 0.75, &judge).is_none());
    }

    #[test]
    fn a_piece_is_cut_into_parts_that_cover_it() {
        let mut pieces = pieces(0, 3, |_| Judged::new(0.0, 0.0));
        for _ in 0..2 {
            let parts = |piece: Piece| piece.parts().map(|(middle, size)| Piece { middle, size, ..piece });
            pieces = pieces.into_iter().flat_map(parts).collect();
        }
        assert!(pieces.len() == 144 && pieces.iter().all(|piece| (piece.size.abs() - 1.0 / 12.0).abs() < 1e-12));
        let mut middles = Vec::new();
        for_each_part(12, |w| middles.push(w));
        let nearest = |piece: &Piece| {
            let off = |w: &[f64; 3]| (0..3).map(|k| (w[k] - piece.middle[k]).abs()).fold(0.0, f64::max);
            middles.iter().map(off).fold(f64::INFINITY, f64::min)
        };
        assert!(pieces.iter().all(|piece| nearest(piece) < 1e-12));
        let mut found: Vec<[u64; 2]> =
            pieces.iter().map(|p| [p.middle[0], p.middle[1]].map(|x| (x * 1e6) as u64)).collect();
        found.sort_unstable();
        found.dedup();
        assert_eq!(found.len(), 144);
    }
}
