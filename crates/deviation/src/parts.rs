//! Triangles cut into parts: where their parts are judged, and the farthest place of all.

use std::array;
use std::f64::consts::TAU;

use point_cloud::vec3::{add, scale};
use rayon::prelude::*;

/// Triangles in which the farthest place is looked for.
///
/// Limit: time; some 80 distances each.
const SEARCHED: usize = 64;

/// Halvings of the step with which it is looked for, from the size of a part.
///
/// Derived: the place is then known to 1/32 of a part, where a distance differs by less than that from the largest.
const HALVINGS: usize = 5;

/// Steps at most from one place, and directions of each.
///
/// Limit: a triangle has some 10⁴ parts at most, 100 a side.
const MAX_STEPS: usize = 200;
const DIRECTIONS: usize = 8;

const SQRT_3: f64 = 1.732_050_807_568_877_2;

/// Fractional parts of the multiples of these two numbers fill the unit square evenly (Roberts 2018, the sequence R₂): the inverse
/// of the root of x³ = x + 1, and its square.
const EVENLY: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];

/// Calls `visit` with the barycentric coordinates of the middle of each of the `n²` parts of a triangle.
pub(crate) fn for_each_part(n: usize, mut visit: impl FnMut([f64; 3])) {
    for_each_part_at(n, |_| [1.0 / 3.0; 2], &mut visit);
}

/// Calls `visit` with the barycentric coordinates of a place in each of the `n²` parts of a triangle. Where that is in the part differs
/// from part to part: what lies along the sides of triangles, where flat and curved ones meet, gets its share, which the middles of
/// parts never see. `first` numbers the parts of the triangle among all.
pub(crate) fn for_each_place(n: usize, first: usize, mut visit: impl FnMut([f64; 3])) {
    let place = |k: usize| {
        let [a, b] = EVENLY.map(|x| ((first + k) as f64 * x).fract());
        if a + b > 1.0 { [1.0 - a, 1.0 - b] } else { [a, b] }
    };
    for_each_part_at(n, place, &mut visit);
}

/// Calls `visit` for each of the `n²` parts of a triangle with the barycentric coordinates of a place of it: `place` gives those in the
/// part by its number.
fn for_each_part_at(n: usize, place: impl Fn(usize) -> [f64; 2], visit: &mut impl FnMut([f64; 3])) {
    let (size, mut number) = (n as f64, 0);
    let mut at = |corner: [usize; 2], sign: f64| {
        let [u, v] = place(number);
        let (u, v) = ((corner[0] as f64 + sign * u) / size, (corner[1] as f64 + sign * v) / size);
        number += 1;
        visit([(1.0 - u - v).max(0.0), u, v]);
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

/// A place of a triangle where a distance is known.
#[derive(Clone, Copy, Debug)]
pub(crate) struct At {
    pub(crate) triangle: u32,
    /// Barycentric coordinates.
    pub(crate) weights: [f64; 3],
    pub(crate) distance: f64,
    /// Size of the part that it stands for, in triangles.
    pub(crate) size: f64,
}

/// The farthest place that is found by going uphill, with ever shorter steps within their triangles, from the farthest of `known`, one in
/// each triangle, and from the farthest of each of the farthest `groups` of triangles: the places at which parts are judged alone miss
/// what is highest between them. Triangles of a group follow one another.
pub(crate) fn farthest(
    known: &[At],
    group: &dyn Fn(u32) -> u32,
    distance: &(dyn Fn(u32, [f64; 3]) -> f64 + Sync),
) -> Option<At> {
    let by_distance = |a: &At, b: &At| b.distance.total_cmp(&a.distance).then(a.triangle.cmp(&b.triangle));
    let foremost = |mut known: Vec<At>| {
        if known.len() > SEARCHED {
            known.select_nth_unstable_by(SEARCHED, by_distance);
            known.truncate(SEARCHED);
        }
        known
    };
    let of_groups = known.chunk_by(|a, b| group(a.triangle) == group(b.triangle));
    let mut starts = foremost(of_groups.filter_map(|of_one| of_one.iter().copied().min_by(by_distance)).collect());
    starts.extend(foremost(known.to_vec()));
    starts.sort_unstable_by_key(|start| start.triangle);
    starts.dedup_by_key(|start| start.triangle);
    let found: Vec<At> = starts.into_par_iter().map(|start| uphill(start, &|w| distance(start.triangle, w))).collect();
    found.into_iter().max_by(|a, b| a.distance.total_cmp(&b.distance).then(b.triangle.cmp(&a.triangle)))
}

fn uphill(start: At, distance: &dyn Fn([f64; 3]) -> f64) -> At {
    let (mut best, mut step, mut steps) = (start, start.size, 0);
    for level in 0..HALVINGS {
        loop {
            let before = best.distance;
            for k in 0..DIRECTIONS {
                // Other directions each time: distances have ridges, along which few lead upwards.
                let turn = (k as f64 + EVENLY[0] * (level + steps) as f64) / DIRECTIONS as f64;
                let (sin, cos) = (TAU * turn).sin_cos();
                let along = [cos, -0.5 * cos + SQRT_3 / 2.0 * sin, -0.5 * cos - SQRT_3 / 2.0 * sin];
                // As far as the side of the triangle at most.
                let room = |j: usize| if along[j] < 0.0 { best.weights[j] / -along[j] } else { f64::INFINITY };
                let length = step.min(room(0)).min(room(1)).min(room(2));
                if length <= 0.0 {
                    continue;
                }
                let weights = array::from_fn(|j| (best.weights[j] + length * along[j]).max(0.0));
                let found = distance(weights);
                if found > best.distance {
                    best = At { weights, distance: found, ..best };
                }
            }
            steps += 1;
            if best.distance <= before || steps >= MAX_STEPS {
                break;
            }
        }
        step *= 0.5;
    }
    for corner in 0..3 {
        let weights = array::from_fn(|j| if j == corner { 1.0 } else { 0.0 });
        let found = distance(weights);
        if found > best.distance {
            best = At { weights, distance: found, ..best };
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
        let known: Vec<At> = (0..100)
            .map(|triangle| {
                let weights = [1.0 / 3.0; 3];
                At { triangle, weights, distance: height(triangle, weights), size: 0.5 }
            })
            .collect();
        let found = farthest(&known, &|t| t / 10, &height).unwrap();
        assert!(found.triangle >= 90 && found.distance > 1.099 - 0.03, "{found:?}");
        assert!(farthest(&[], &|t| t, &height).is_none());
    }
}
