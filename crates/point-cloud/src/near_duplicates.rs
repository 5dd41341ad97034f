//! Points and vertices that are equal but for rounding.

use std::collections::HashMap;

use ndarray::{ArrayView2, Axis};
use rayon::prelude::*;

use crate::neighbours::rows;
use crate::search::CloudTree;
use crate::vec3::{norm, scale, sub};
use crate::{BoundingBox, CloudError, Duplicates, Neighbours, Pieces, TriangleMesh, check_finite, robust_diagonal};

/// Neighbours among which copies are looked for: up to half a dozen scans of one surface in one file leave other points among them.
///
/// Calibrated: 2 to 8 copies of random sheets of 300 points or more end as one.
const NEIGHBOURS: usize = 12;

/// Neighbours nearer than this share of the distance to the next one are copies.
///
/// Derived: on a random sheet the nearest of two neighbours is nearer than the share x of the other with probability x², here
/// once in 10⁴ points, and leaving out such a point does no harm.
const NEAR: f64 = 0.01;

/// The same where [`COPIED`] of the points have copies that near.
///
/// Derived: with it a point of a random sheet has a copy by chance once in fifty, of a random line once in six.
const NEAR_AMONG_COPIES: f64 = 0.15;

/// Share of the points with copies from which on the cloud holds a surface twice, in parts at least.
///
/// Calibrated: a random sheet has 2 %, random points along rows 18 %, a sheet of which a fifth is there twice 33 %.
const COPIED: f64 = 0.25;

/// Quantile of the distances of copies that counts as the distance of all.
///
/// Calibrated: by 0.5 the pairs that rounding moved farthest apart stay, by 1 one pair that is near by chance decides.
const QUANTILE: f64 = 0.95;

/// Fewest copies whose distances tell the distance of all.
///
/// Limit: a quantile of fewer is one of the largest two.
const FEWEST_COPIES: usize = 20;

/// Farthest copies, as a share of the spacing around: the distance to the twelfth neighbour over √(12/π).
///
/// Derived: two points of a random sheet are that near once in thirty, and at such a distance still span well-shaped triangles.
const MOST_PER_SPACING: f64 = 0.1;

/// Rounds of merging: more copies than neighbours are merged in several.
///
/// Limit: each round divides the number of copies by up to [`NEIGHBOURS`].
const ROUNDS: usize = 4;

/// Distances over which vertices are welded, as shares of the diagonal, the next one only where the mesh is in pieces.
///
/// Calibrated: six decimals of a part of 60 (jitter in the last one) and five digits as in text files are welded.
const WELDS: [f64; 3] = [1e-6, 1e-5, 1e-4];

/// Longest weld, as a share of the edges that all but the shortest [`SHORT_EDGES`] exceed.
///
/// Limit: no ordinary edge collapses.
const WELD_PER_EDGE: f64 = 0.05;

/// See [`WELD_PER_EDGE`].
///
/// Limit: slivers with shorter edges may be a twentieth of all.
const SHORT_EDGES: f64 = 0.05;

/// Share of the triangles that may lie off the largest piece of a mesh that is welded well enough.
///
/// Calibrated: stray pieces of raw scans are below 1 %.
const STRAY: f64 = 0.02;

impl Duplicates {
    /// Finds the points among `points`, shape `(m, 3)`, that are equal to others or nearly so, as where a surface is there twice with
    /// other rounding: far nearer to each other than to the next point around, and than the spacing. `keeps` tells of points that
    /// stay though an earlier one is equal.
    ///
    /// Copies are neighbours within 1 % of the distance to the first neighbour that is none; where a quarter of the points has copies within
    /// 15 %, these too, and all pairs within the distances of nearly all copies and a tenth of the spacing. O(m log m).
    ///
    /// # Errors
    /// [`CloudError::WrongDimension`], [`CloudError::TooFewPoints`] without a point, those of [`check_finite`].
    pub fn find_near(points: ArrayView2<'_, f64>, keeps: impl Fn(usize) -> bool) -> Result<Self, CloudError> {
        rows(points)?;
        let mut all = Self::find(points).keeping(&keeps);
        // In the unit cube no square under- or overflows.
        let bounds = BoundingBox::of(points)?;
        let unit = bounds.longest_side();
        if unit == 0.0 {
            return Ok(all);
        }
        let lower = [bounds.lower[0], bounds.lower[1], bounds.lower[2]];
        for _ in 0..ROUNDS {
            let distinct = rows(points.select(Axis(0), &all.kept).view())?;
            let distinct: Vec<[f64; 3]> = distinct.into_iter().map(|p| scale(unit.recip(), sub(p, lower))).collect();
            if distinct.len() <= NEIGHBOURS + 1 {
                break;
            }
            let near = CloudTree::new(&distinct)?.all_nearest(NEIGHBOURS + 1);
            let kept: Vec<bool> = all.kept.iter().map(|&row| keeps(row)).collect();
            let merged = Self::of_copies(&near, &kept);
            if merged.count() == 0 {
                break;
            }
            all = all.then(&merged);
        }
        Ok(all)
    }

    /// Merges copies among points with these neighbours.
    fn of_copies(near: &Neighbours, keeps: &[bool]) -> Self {
        let m = near.count();
        let reach_at = |i: usize, share: f64| copies_within(near.distances_of(i), share);
        let spacing =
            |i: usize| near.distances_of(i)[NEIGHBOURS - 1] / (NEIGHBOURS as f64 / std::f64::consts::PI).sqrt();
        let reaches = |share: f64| -> Vec<f64> { (0..m).into_par_iter().map(|i| reach_at(i, share)).collect() };
        let count = |reaches: &[f64]| reaches.iter().filter(|&&reach| reach > 0.0).count();
        let wider = reaches(NEAR_AMONG_COPIES);
        let mut own = if count(&wider) as f64 >= COPIED * m as f64 { wider } else { reaches(NEAR) };
        let mut distances: Vec<f64> = own.iter().copied().filter(|&reach| reach > 0.0).collect();
        let common = if distances.len() >= FEWEST_COPIES {
            let place = (QUANTILE * (distances.len() - 1) as f64) as usize;
            *distances.select_nth_unstable_by(place, f64::total_cmp).1
        } else {
            0.0
        };
        own.iter_mut().enumerate().for_each(|(i, reach)| *reach = reach.max(common).min(MOST_PER_SPACING * spacing(i)));
        Self::greedy(
            m,
            |i, j, distance| distance <= own[i].max(own[j]) && !keeps[i],
            |i| near.of(i).iter().copied().zip(near.distances_of(i).iter().copied()).collect(),
        )
    }

    /// Each point in turn stays, or goes to the first earlier one that stays and is near enough: `is_copy(i, j, distance)`.
    fn greedy(
        m: usize,
        is_copy: impl Fn(usize, usize, f64) -> bool,
        neighbours: impl Fn(usize) -> Vec<(u32, f64)>,
    ) -> Self {
        let mut first_of: Vec<usize> = (0..m).collect();
        for i in 0..m {
            let earlier = neighbours(i).into_iter().filter(|&(j, _)| (j as usize) < i);
            let staying =
                earlier.filter(|&(j, distance)| first_of[j as usize] == j as usize && is_copy(i, j as usize, distance));
            first_of[i] = staying.map(|(j, _)| j as usize).min().unwrap_or(i);
        }
        Self::from_first(&first_of)
    }

    /// Each point in turn stays, or goes to the first earlier one that stays at a distance of at most `distance`, which is above 0. O(m),
    /// also where nearly all points are that near each other: only points that stay are compared with, and few of these fit into a cube.
    fn within(points: &[[f64; 3]], distance: f64) -> Self {
        // The cubes of a lattice with sides as long as the distance. Huge numbers are cubes of their own; -0 is 0.
        let cube = |place: [f64; 3], step: [f64; 3]| -> [u64; 3] {
            std::array::from_fn(|k| {
                let cell = (place[k] / distance).floor() + step[k];
                if cell.is_finite() { (cell + 0.0).to_bits() } else { place[k].to_bits() }
            })
        };
        let steps = || [-1.0, 0.0, 1.0].into_iter();
        let neighbours: Vec<[f64; 3]> =
            steps().flat_map(|x| steps().flat_map(move |y| steps().map(move |z| [x, y, z]))).collect();
        let mut staying: HashMap<[u64; 3], Vec<usize>> = HashMap::new();
        let mut first_of: Vec<usize> = (0..points.len()).collect();
        for (i, &place) in points.iter().enumerate() {
            let around = neighbours.iter().filter_map(|&step| staying.get(&cube(place, step))).flatten();
            let near = around.copied().filter(|&j| norm(sub(place, points[j])) <= distance);
            match near.min() {
                Some(first) => first_of[i] = first,
                None => staying.entry(cube(place, [0.0; 3])).or_default().push(i),
            }
        }
        Self::from_first(&first_of)
    }

    /// From the first of the group of each point.
    pub(crate) fn from_first(first_of: &[usize]) -> Self {
        let mut kept = Vec::new();
        let mut map = vec![0; first_of.len()];
        for (i, &first) in first_of.iter().enumerate() {
            // The first of a group has a smaller row, so its place is already known.
            map[i] = if first == i { kept.len() } else { map[first] };
            if first == i {
                kept.push(i);
            }
        }
        Self { kept, map }
    }

    /// The same, but for points that are to stay.
    fn keeping(self, keeps: &impl Fn(usize) -> bool) -> Self {
        let first_of = |i: usize| if keeps(i) { i } else { self.kept[self.map[i]] };
        Self::from_first(&(0..self.map.len()).map(first_of).collect::<Vec<_>>())
    }

    /// These groups and then groups of the points that stayed.
    fn then(&self, next: &Self) -> Self {
        Self {
            kept: next.kept.iter().map(|&at| self.kept[at]).collect(),
            map: self.map.iter().map(|&at| next.map[at]).collect(),
        }
    }
}

/// Distance of the neighbour, among those at these increasing distances, that is nearest as a share of the next one's distance; 0 if
/// the share is not below `most`.
fn copies_within(distances: &[f64], most: f64) -> f64 {
    let share = |pair: &[f64]| if pair[1] > 0.0 { pair[0] / pair[1] } else { 1.0 };
    let nearest = distances.windows(2).min_by(|a, b| share(a).total_cmp(&share(b)));
    nearest.filter(|pair| share(pair) < most).map_or(0.0, |pair| pair[0])
}

/// A mesh whose nearly equal vertices were made one.
#[derive(Clone, Debug, PartialEq)]
pub struct Welded {
    /// The mesh with the first of each group of vertices.
    pub mesh: TriangleMesh,
    /// The groups.
    pub duplicates: Duplicates,
    /// Triangles that were dropped because two of their vertices became one.
    pub dropped: usize,
    /// Distance over which vertices were made one, in the units of the mesh.
    pub distance: f64,
}

/// Makes vertices one that are nearer than 10⁻⁶ of the diagonal (that without far values); where the mesh is in pieces then, than 10⁻⁵ or
/// 10⁻⁴, as long as nearly all edges are twenty times as long. Corners of triangles that were written one by one and differ in
/// their last digits are joined so. O(n log n).
///
/// # Errors
/// [`CloudError::WrongDimension`], those of [`check_finite`] and of [`crate::EdgeMap::new`].
pub fn weld(mesh: &TriangleMesh) -> Result<Welded, CloudError> {
    check_finite(mesh.vertices.view())?;
    let (exact, duplicates, dropped) = crate::merge_duplicate_vertices(mesh);
    let unwelded = Welded { mesh: exact, duplicates, dropped, distance: 0.0 };
    if unwelded.mesh.triangles.is_empty() {
        return Ok(unwelded);
    }
    let points = rows(unwelded.mesh.vertices.view())?;
    let diagonal = robust_diagonal(unwelded.mesh.vertices.view())?;
    let most = WELD_PER_EDGE * short_edge(&points, &unwelded.mesh.triangles)?;
    let mut first = None;
    for distance in WELDS.map(|share| share * diagonal) {
        if !(distance > 0.0 && distance <= most) {
            break;
        }
        let groups = Duplicates::within(&points, distance);
        let welded = unwelded.renamed(mesh, &groups, distance);
        let sizes = Pieces::find(&welded.mesh)?.sizes;
        let stray: usize = sizes.iter().skip(1).sum();
        if stray as f64 <= STRAY * welded.mesh.triangles.len() as f64 {
            return Ok(welded);
        }
        first.get_or_insert(welded);
    }
    Ok(first.unwrap_or(unwelded))
}

impl Welded {
    /// With groups of the vertices that stayed made one.
    fn renamed(&self, mesh: &TriangleMesh, groups: &Duplicates, distance: f64) -> Self {
        let duplicates = self.duplicates.then(groups);
        let renamed = |t: &[u32; 3]| t.map(|v| groups.map.get(v as usize).map_or(v, |&new| new as u32));
        let is_triangle = |[a, b, c]: &[u32; 3]| a != b && b != c && c != a;
        let triangles: Vec<[u32; 3]> = self.mesh.triangles.iter().map(renamed).filter(is_triangle).collect();
        let dropped = mesh.triangles.len() - triangles.len();
        let vertices = self.mesh.vertices.select(Axis(0), &groups.kept);
        // Exactly equal vertices need no distance.
        let distance = if groups.count() > 0 { distance } else { 0.0 };
        Self { mesh: TriangleMesh { vertices, triangles }, duplicates, dropped, distance }
    }
}

/// The length that all but [`SHORT_EDGES`] of the edges exceed.
fn short_edge(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Result<f64, CloudError> {
    let mut lengths = Vec::with_capacity(3 * triangles.len());
    for (triangle, t) in triangles.iter().enumerate() {
        for k in 0..3 {
            let [a, b] = [t[k], t[(k + 1) % 3]].map(|v| points.get(v as usize).ok_or(v));
            let out_of_range = |vertex| CloudError::VertexOutOfRange { triangle, vertex, count: points.len() };
            lengths.push(norm(sub(*a.map_err(out_of_range)?, *b.map_err(out_of_range)?)));
        }
    }
    let place = (SHORT_EDGES * (lengths.len() - 1) as f64) as usize;
    Ok(*lengths.select_nth_unstable_by(place, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::isolated::tests::{random, sheet};
    use ndarray::{Array2, concatenate};

    fn shifted(points: &Array2<f64>, most: f64, seed: u64) -> Array2<f64> {
        let mut random = random(seed);
        points.mapv(|x| x + most * (2.0 * random() - 1.0))
    }

    #[test]
    fn copies_go_and_the_first_row_stays() {
        for (kind, m, seed) in [(0, 300, 1), (1, 600, 2), (2, 3000, 3)] {
            let once = sheet(kind, m, seed);
            let spacing = 1.0 / (m as f64).sqrt();
            let alone = Duplicates::find_near(once.view(), |_| false).unwrap().count();
            assert!(alone * 200 <= m, "{kind} {m}: {alone} by chance");
            for most in [0.0, 1e-9, 1e-5, 1e-3, 0.01, 0.02] {
                for copies in [1, 2, 6] {
                    if (copies > 2 || kind == 2) && most > 1e-3 {
                        continue;
                    }
                    let mut all = once.clone();
                    for copy in 0..copies {
                        let other = shifted(&once, most * spacing, seed + copy);
                        all = concatenate![Axis(0), all, other];
                    }
                    let found = Duplicates::find_near(all.view(), |_| false).unwrap();
                    let left = found.kept.iter().filter(|&&row| row >= m).count();
                    assert!(
                        left * 50 <= m && found.kept.len() * 25 >= m * 24,
                        "{kind} {m} {most} {copies}: {left} left of {}",
                        found.kept.len()
                    );
                }
                if kind == 2 && most > 1e-3 {
                    // That is a fifth of the spacing where the sheet is densest.
                    continue;
                }
                // A fifth of the part twice.
                let part = shifted(&once, most * spacing, seed + 9);
                let all = concatenate![Axis(0), once, part.select(Axis(0), &(0..m / 5).collect::<Vec<_>>())];
                let found = Duplicates::find_near(all.view(), |row| row == m + 3).unwrap();
                let left = found.kept.iter().filter(|&&row| row >= m).count();
                assert!(left * 50 <= m && found.kept.contains(&(m + 3)), "{kind} {m} {most}: {left} left");
            }
        }
    }

    #[test]
    fn lattices_rows_and_noise_keep_their_points() {
        let mut random = random(5);
        let lattice = Array2::from_shape_fn((900, 3), |(i, k)| [(i / 30) as f64, (i % 30) as f64, 0.0][k]);
        let rows = Array2::from_shape_fn((900, 3), |(i, k)| [(i / 90) as f64, 0.02 * (i % 90) as f64, 0.0][k]);
        let noisy = concatenate![Axis(0), sheet(0, 500, 1), shifted(&sheet(0, 500, 1), 0.02, 4)];
        for (name, points, most) in [("lattice", lattice, 0), ("rows", rows, 0), ("noise", noisy, 20)] {
            assert!(Duplicates::find_near(points.view(), |_| false).unwrap().count() <= most, "{name}");
        }
        // Random places along rows: those that meet by chance.
        let places = Array2::from_shape_fn((1000, 3), |(i, k)| [(i % 10) as f64, 2.0 * random(), 0.0][k]);
        assert!(Duplicates::find_near(places.view(), |_| false).unwrap().count() < 60);
    }

    #[test]
    fn soups_are_welded_and_edges_stay() {
        for (scale, jitter) in [(1.0, 1e-8), (60.0, 4e-7), (1e-6, 3e-6), (1e6, 3e-5)] {
            let n = 8;
            let mut random = random(3);
            let corner = |i: usize, j: usize| [i as f64, j as f64, (i as f64 * 0.5).sin()];
            let mut corners = Vec::new();
            for (i, j) in (0..n * n).map(|c| (c / n, c % n)) {
                corners.extend([corner(i, j), corner(i + 1, j), corner(i + 1, j + 1)]);
                corners.extend([corner(i, j), corner(i + 1, j + 1), corner(i, j + 1)]);
            }
            let vertices = Array2::from_shape_fn((corners.len(), 3), |(v, k)| {
                scale * (corners[v][k] + jitter * (2.0 * random() - 1.0) * n as f64)
            });
            let triangles: Vec<[u32; 3]> =
                (0..corners.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
            let welded = weld(&TriangleMesh { vertices, triangles }).unwrap();
            assert_eq!((welded.mesh.vertices.nrows(), welded.dropped), ((n + 1) * (n + 1), 0), "{scale} {jitter}");
            assert_eq!(Pieces::find(&welded.mesh).unwrap().sizes, [2 * n * n]);
            let again = weld(&welded.mesh).unwrap();
            assert_eq!((again.mesh, again.duplicates.count()), (welded.mesh, 0));
        }
    }

    #[test]
    fn points_within_a_distance_go_to_the_first_that_stays() {
        for (seed, scale, distance) in
            [(1, 1.0, 0.05), (2, 1e-100, 3e-102), (3, 1e90, 1e89), (4, 1.0, 10.0), (5, 1.0, 1e-9)]
        {
            let mut random = random(seed);
            let mut points: Vec<[f64; 3]> =
                (0..400).map(|_| std::array::from_fn(|_| scale * (2.0 * random() - 1.0))).collect();
            points.extend([[1e100; 3], [-1e100, 0.0, -0.0], [-1e100, 0.0, 0.0], [1e100; 3]]);
            let mut first_of: Vec<usize> = (0..points.len()).collect();
            for i in 0..points.len() {
                let mut stay = (0..i).filter(|&j| first_of[j] == j);
                first_of[i] = stay.find(|&j| norm(sub(points[i], points[j])) <= distance).unwrap_or(i);
            }
            assert_eq!(Duplicates::within(&points, distance), Duplicates::from_first(&first_of), "{scale} {distance}");
        }
    }

    #[test]
    fn a_heap_of_vertices_is_welded_as_fast_as_a_sheet() {
        // 60 000 vertices within the distance: all pairs would take minutes in a debug build.
        let mut random = random(1);
        let m = 20_000;
        let vertices = Array2::from_shape_fn((3 * m, 3), |(v, k)| f64::from(v % 3 == k) + 1e-8 * random());
        let triangles: Vec<[u32; 3]> = (0..m as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        assert_eq!(weld(&TriangleMesh { vertices, triangles }).unwrap().mesh.vertices.nrows(), 3);
    }

    #[test]
    fn triangles_without_vertices_are_named() {
        let mesh = TriangleMesh { vertices: Array2::eye(3), triangles: vec![[0, 1, 2], [0, 1, 7]] };
        assert!(matches!(weld(&mesh), Err(CloudError::VertexOutOfRange { triangle: 1, vertex: 7, count: 3 })));
    }
}
