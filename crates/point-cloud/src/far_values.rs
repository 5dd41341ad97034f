//! Values far beyond the rest of a scan: fill values of cells that were not measured, single coordinates that went wrong.

use ndarray::ArrayView2;

use crate::{BoundingBox, CloudError, TriangleMesh, check_finite};

/// Share of the points at each end of an axis that may be far values, and so don't count for the box the search starts with.
///
/// Derived: far values beyond it are no few; three even columns of points (a third each) are still spanned whole.
const MOST_EQUAL: f64 = 0.3;

/// Share of the points up to which different values beyond a gap are far values.
///
/// Calibrated: sheets of 9 to 10⁵ points with up to 13 fill values (4.3 % of 300) are cleaned; at 0.1 the smaller part of scans that
/// consist of two parts would be taken for far values.
const MOST_DIFFERENT: f64 = 0.05;

/// Share of the points up to which values beyond a gap shorter than the diagonal of the rest are far values.
///
/// Calibrated: parts with a boss whose walls were not seen (2 % to 5 % of the points, a quarter of the diagonal high) stay whole.
const MOST_BEYOND_SHORT_GAP: f64 = 0.02;

/// A gap longer than this many diagonals of the rest is one, whatever the axis.
///
/// Calibrated: no gap on any axis of the real scans tried (heads, hulls, blades, terrain, lidar with trees) exceeds 0.15 diagonals.
const GAP_PER_DIAGONAL: f64 = 1.0;

/// A gap longer than this many diagonals of the rest, and than [`GAP_PER_EXTENT`] extents of the rest along its axis, is one too.
///
/// Calibrated: -9999 below a tile of terrain is 0.63 diagonals off at 14 km and 0.24 at 30 km; at 0.1 a boss on a plate would be cut off.
const SHORT_GAP_PER_DIAGONAL: f64 = 0.2;

/// See [`SHORT_GAP_PER_DIAGONAL`].
///
/// Calibrated: heights of 2 km over a tile with -9999 give 5; at 1 a part in two steps would be cut.
const GAP_PER_EXTENT: f64 = 2.0;

/// Gaps to far vertices of a mesh, in diagonals of the rest: its triangles reach over distances that a cloud would have points in.
///
/// Calibrated: the apex of a cone over its ring of vertices is some heights off; at 1 corners of coarse facets beside a
/// finely meshed hole are candidates that only the triangles tell from far values.
const MESH_GAP_PER_DIAGONAL: f64 = 3.0;

/// Share of the triangles that far vertices of a mesh may take along, and their number that is always allowed.
///
/// Derived: a vertex has six triangles on average, so 2 % of the vertices take 12 % of the triangles at most.
const MOST_TRIANGLES: f64 = 0.12;

/// See [`MOST_TRIANGLES`]: a vertex of a fan has that many in nearly every mesh.
///
/// Limit: in meshes of a few dozen triangles no share of them holds a whole fan.
const ALWAYS_TRIANGLES: usize = 12;

/// Fewest points among which one can be told to be far.
///
/// Limit: of fewer the box of the rest is that of a handful of points.
const FEWEST: usize = 9;

/// Values that lie far beyond the rest of a cloud or mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct FarValues {
    /// Rows of the points with such a value, increasing.
    pub rows: Vec<u32>,
    /// How many of them share such a value with others, as cells do that hold a value for "no data".
    pub fills: usize,
    /// The box of the other points.
    pub bounds: BoundingBox,
}

impl FarValues {
    /// Finds the far values among `points`, shape `(m, N)`: few of them on the far side of a gap, along an axis, that is long
    /// compared with all the rest. They may stand in clumps, and those on one far side may all have the same value.
    ///
    /// Along each axis the search goes outwards from the middle of the sorted coordinates and ends at a gap longer than the diagonal
    /// of all it has passed, or than a fifth of it and twice the extent along the axis, if few points (5 %, and 2 % beyond the
    /// shorter gap; of equal values 30 %) lie beyond; gaps with more points beyond are crossed. O(m log m).
    ///
    /// # Errors
    /// [`CloudError::TooFewPoints`] without a point, those of [`check_finite`].
    pub fn of_cloud(points: ArrayView2<'_, f64>) -> Result<Self, CloudError> {
        Self::beyond_gaps(points, [GAP_PER_DIAGONAL, SHORT_GAP_PER_DIAGONAL])
    }

    /// Finds the far vertices of a mesh as [`FarValues::of_cloud`] does, with longer gaps. There are none if their triangles are many or join two of them over more than half of the gap: then they are corners of large facets.
    ///
    /// # Errors
    /// Those of [`FarValues::of_cloud`].
    pub fn of_mesh(mesh: &TriangleMesh) -> Result<Self, CloudError> {
        let points = mesh.vertices.view();
        let mut found = Self::beyond_gaps(points, [MESH_GAP_PER_DIAGONAL; 2])?;
        if found.rows.is_empty() {
            return Ok(found);
        }
        let is_far = |v: u32| found.rows.binary_search(&v).is_ok();
        let gap = MESH_GAP_PER_DIAGONAL * found.bounds.diagonal();
        let length = |a: u32, b: u32| {
            let pairs = points.row(a as usize).into_iter().zip(points.row(b as usize));
            pairs.map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
        };
        let in_range = |t: &&[u32; 3]| t.iter().all(|&v| (v as usize) < points.nrows());
        let mut lost = 0;
        for &[a, b, c] in mesh.triangles.iter().filter(in_range) {
            let sides = [[a, b], [b, c], [c, a]];
            lost += usize::from([a, b, c].into_iter().any(is_far));
            if sides.iter().any(|&[p, q]| is_far(p) && is_far(q) && length(p, q) > 0.5 * gap) {
                return Self::none(points);
            }
        }
        let allowed = (MOST_TRIANGLES * mesh.triangles.len() as f64).max(ALWAYS_TRIANGLES as f64);
        if lost as f64 > allowed || lost == mesh.triangles.len() {
            return Self::none(points);
        }
        let mut is_used = vec![false; points.nrows()];
        mesh.triangles.iter().filter(in_range).flatten().for_each(|&v| is_used[v as usize] = true);
        found.rows.retain(|&v| is_used[v as usize]);
        found.fills = found.fills.min(found.rows.len());
        Ok(found)
    }

    fn none(points: ArrayView2<'_, f64>) -> Result<Self, CloudError> {
        Ok(Self { rows: Vec::new(), fills: 0, bounds: BoundingBox::of(points)? })
    }

    fn beyond_gaps(points: ArrayView2<'_, f64>, gaps: [f64; 2]) -> Result<Self, CloudError> {
        check_finite(points)?;
        let m = points.nrows();
        if m < FEWEST {
            return Self::none(points);
        }
        let sorted: Vec<Vec<f64>> = points
            .columns()
            .into_iter()
            .map(|column| {
                let mut values = column.to_vec();
                values.sort_unstable_by(f64::total_cmp);
                values
            })
            .collect();
        let cut = (MOST_EQUAL * m as f64) as usize;
        let mut axes: Vec<AxisSearch<'_>> =
            sorted.iter().map(|values| AxisSearch { values, first: cut, last: m - 1 - cut }).collect();
        // A longer diagonal lets the search pass longer gaps, until none is passed any more.
        while axes.iter().any(|axis| axis.first > 0 || axis.last + 1 < m) {
            let diagonal = diagonal_of(axes.iter().map(AxisSearch::extent));
            // All axes try, whether or not the first one went on.
            let went_on = axes.iter_mut().filter_map(|axis| axis.go_on(diagonal, gaps).then_some(())).count();
            if went_on == 0 {
                break;
            }
        }
        let limits: Vec<[f64; 2]> = axes.iter().map(|axis| [axis.values[axis.first], axis.values[axis.last]]).collect();
        drop(sorted);
        let is_far = |i: &u32| {
            points.row(*i as usize).iter().zip(&limits).any(|(x, [lower, upper])| !(*lower..=*upper).contains(x))
        };
        let rows: Vec<u32> = (0..m as u32).filter(is_far).collect();
        if rows.len() as f64 > MOST_EQUAL * m as f64 {
            return Self::none(points);
        }
        if !rows.is_empty() {
            tracing::info!(count = rows.len(), "found values far beyond the rest");
        }
        let mut values: Vec<(usize, u64, u32)> = Vec::new();
        for &i in &rows {
            let far = points.row(i as usize).into_iter().zip(&limits).enumerate();
            let far = far.filter(|(_, (x, [lower, upper]))| !(*lower..=*upper).contains(x));
            values.extend(far.map(|(axis, (x, _))| (axis, x.to_bits(), i)));
        }
        values.sort_unstable();
        let shared = values.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).filter(|same| same.len() > 1);
        let mut fills: Vec<u32> = shared.flatten().map(|value| value.2).collect();
        fills.sort_unstable();
        fills.dedup();
        let mut next = rows.iter().peekable();
        let others = (0..m as u32).filter(|i| next.next_if_eq(&i).is_none()).map(|i| points.row(i as usize));
        Ok(Self { fills: fills.len(), bounds: BoundingBox::of_rows(others)?, rows })
    }
}

/// The diagonal of the box of `points`, shape `(m, N)`, without far values ([`FarValues::of_cloud`]): that of all where there are none.
///
/// # Errors
/// Those of [`FarValues::of_cloud`].
pub fn robust_diagonal(points: ArrayView2<'_, f64>) -> Result<f64, CloudError> {
    Ok(FarValues::of_cloud(points)?.bounds.diagonal())
}

/// How far the search along an axis has come among its sorted coordinates.
struct AxisSearch<'a> {
    values: &'a [f64],
    first: usize,
    last: usize,
}

impl AxisSearch<'_> {
    fn extent(&self) -> f64 {
        self.values[self.last] - self.values[self.first]
    }

    /// Goes on outwards up to a gap on each side; whether it went anywhere.
    fn go_on(&mut self, diagonal: f64, gaps: [f64; 2]) -> bool {
        let (m, start) = (self.values.len(), (self.first, self.last));
        while self.first > 0 {
            let beyond = &self.values[..self.first];
            let gap = self.values[self.first] - beyond[self.first - 1];
            if is_end(gap, beyond, self.extent(), diagonal, m, gaps) {
                break;
            }
            self.first -= 1;
        }
        while self.last + 1 < m {
            let beyond = &self.values[self.last + 1..];
            let gap = beyond[0] - self.values[self.last];
            if is_end(gap, beyond, self.extent(), diagonal, m, gaps) {
                break;
            }
            self.last += 1;
        }
        (self.first, self.last) != start
    }
}

/// Whether few values lie beyond a gap that is long.
fn is_end(gap: f64, beyond: &[f64], extent: f64, diagonal: f64, m: usize, [long, short]: [f64; 2]) -> bool {
    let is_long = gap > long * diagonal;
    let is_short = gap > short * diagonal && gap > GAP_PER_EXTENT * extent;
    if gap == 0.0 || !(is_long || is_short) {
        return false;
    }
    let most = |share: f64| ((share * m as f64) as usize).max(1);
    // Sorted values are equal if the ends are.
    let equal = beyond[0] == beyond[beyond.len() - 1];
    let allowed = match (is_long, equal) {
        (true, true) => most(MOST_EQUAL),
        (true, false) => most(MOST_DIFFERENT),
        (false, _) => most(MOST_BEYOND_SHORT_GAP),
    };
    beyond.len() <= allowed
}

/// The diagonal of a box with these sides; no square over- or underflows.
fn diagonal_of(sides: impl Iterator<Item = f64> + Clone) -> f64 {
    let longest = sides.clone().fold(0.0, f64::max);
    if longest > 0.0 { longest * sides.map(|side| (side / longest).powi(2)).sum::<f64>().sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, Axis, array};

    /// An `n` by `n` lattice over the square of side `side`, bent by `relief`.
    fn terrain(n: usize, side: f64, relief: f64) -> Array2<f64> {
        Array2::from_shape_fn((n * n, 3), |(i, k)| {
            let (x, y) = ((i / n) as f64 / (n - 1) as f64, (i % n) as f64 / (n - 1) as f64);
            [side * x, side * y, relief * ((7.0 * x).sin() * (5.0 * y).cos() + 0.1 * (90.0 * x * y).sin())][k]
        })
    }

    /// Rows at which values are changed: some alone, the others in one clump.
    fn rows(n: usize, count: usize, seed: usize) -> Vec<usize> {
        let mut rows: Vec<usize> =
            (0..count).map(|k| if k < 3 { (k * 37 + seed * 101) % (n * n) } else { n * n / 2 + k }).collect();
        rows.sort_unstable();
        rows.dedup();
        rows
    }

    #[test]
    fn fill_values_are_found_alone_and_in_clumps() {
        for (n, side, relief) in
            [(4, 1.0, 0.2), (10, 50.0, 3.0), (18, 3000.0, 400.0), (60, 14_000.0, 1000.0), (120, 30_000.0, 900.0)]
        {
            let good = terrain(n, side, relief);
            let diagonal = BoundingBox::of(good.view()).unwrap().diagonal();
            assert_eq!(FarValues::of_cloud(good.view()).unwrap().rows, [0; 0]);
            assert_eq!(robust_diagonal(good.view()).unwrap(), diagonal);
            for fill in [-9999.0, -32_768.0, 1e6, -3.4e38, 1e80] {
                for (count, seed) in [(1, 0), (2, 1), (n * n / 50, 2), (n * n / 25, 3)] {
                    // Beyond a gap shorter than the diagonal fewer are few.
                    let is_long = f64::abs(fill) > 1.2 * diagonal;
                    let bad = rows(n, count.clamp(1, if n < 10 { 1 } else { 60 }), seed);
                    if !is_long && (bad.len() * 60 > n * n || fill.abs() < 0.3 * diagonal) {
                        continue;
                    }
                    let mut points = good.clone();
                    bad.iter().for_each(|&i| points[[i, 2]] = fill);
                    let found = FarValues::of_cloud(points.view()).unwrap();
                    let expected: Vec<u32> = bad.iter().map(|&i| i as u32).collect();
                    assert_eq!(found.rows, expected, "{n} {side} {fill} {count}");
                    assert!(found.bounds.diagonal() > 0.8 * diagonal && found.bounds.diagonal() <= diagonal);
                }
            }
        }
    }

    #[test]
    fn far_values_of_several_kinds_and_axes_are_found_together() {
        let mut points = terrain(20, 50.0, 4.0);
        points[[7, 0]] = 1e6;
        points[[31, 1]] = -1e4;
        points[[32, 2]] = -9999.0;
        points[[33, 2]] = 1e30;
        (0..3).for_each(|k| points[[390, k]] = -9999.0);
        let found = FarValues::of_cloud(points.view()).unwrap();
        assert_eq!((&found.rows[..], found.fills), (&[7, 31, 32, 33, 390][..], 2));
        // Random spikes of all lengths.
        for k in 0..12 {
            points[[100 + k, 2]] = 1e4 + 8e4 * k as f64;
        }
        assert_eq!(FarValues::of_cloud(points.view()).unwrap().rows.len(), 17);
        // As many equal values as a grid may have cells without data.
        let mut points = terrain(20, 50.0, 4.0);
        (0..100).for_each(|i| points[[i, 2]] = -9999.0);
        let found = FarValues::of_cloud(points.view()).unwrap();
        assert_eq!((found.rows.len(), found.fills), (100, 100));
    }

    #[test]
    fn what_was_scanned_is_not_far() {
        // Two parts, a boss whose walls were not seen, columns of points far apart, a dense patch in a sparse plane, three points.
        let mut boss = terrain(30, 100.0, 0.0);
        boss.rows_mut().into_iter().filter(|p| p[0] > 80.0 && p[1] > 80.0).for_each(|mut p| p[2] = 30.0);
        let two = ndarray::concatenate![Axis(0), terrain(20, 1.0, 0.1), terrain(8, 1.0, 0.1) + 5.0];
        let columns = Array2::from_shape_fn((90, 3), |(i, k)| [(i % 3) as f64 * 50.0, (i / 3) as f64, 0.0][k]);
        let patch = ndarray::concatenate![Axis(0), terrain(40, 1.0, 0.0), terrain(12, 20.0, 0.0)];
        let few = array![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1e9, 0.0]];
        for (name, points) in [("boss", boss), ("two", two), ("columns", columns), ("patch", patch), ("few", few)] {
            assert_eq!(FarValues::of_cloud(points.view()).unwrap().rows, [0; 0], "{name}");
        }
        assert!(matches!(robust_diagonal(Array2::zeros((0, 3)).view()), Err(CloudError::TooFewPoints { .. })));
        assert!(matches!(robust_diagonal(array![[f64::NAN]].view()), Err(CloudError::NonFinite { .. })));
    }

    fn lattice_mesh(n: usize) -> TriangleMesh {
        let at = |i: usize, j: usize| (i * n + j) as u32;
        let cells = (0..(n - 1) * (n - 1)).map(|c| (c / (n - 1), c % (n - 1)));
        let triangles = cells
            .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
            .collect();
        TriangleMesh { vertices: terrain(n, n as f64, 0.3), triangles }
    }

    #[test]
    fn far_vertices_of_a_mesh_are_told_from_corners_of_large_facets() {
        for n in [5, 12, 20] {
            for far in [1e3, 1e6, -3.4e38] {
                let mut mesh = lattice_mesh(n);
                assert_eq!(FarValues::of_mesh(&mesh).unwrap().rows, [0; 0]);
                mesh.vertices[[n + 1, 1]] = far;
                assert_eq!(FarValues::of_mesh(&mesh).unwrap().rows, [n as u32 + 1], "{n} {far}");
            }
        }
        // A vertex of no triangle is not told, and does not count for the box.
        let mut mesh = lattice_mesh(9);
        let diagonal = BoundingBox::of(mesh.vertices.view()).unwrap().diagonal();
        mesh.vertices = ndarray::concatenate![Axis(0), mesh.vertices, array![[1e5, 0.0, 0.0]]];
        let found = FarValues::of_mesh(&mesh).unwrap();
        assert_eq!((found.rows, found.bounds.diagonal()), (vec![], diagonal));
        // A finely meshed hole in a plate whose four corners are far away.
        let ring = 200;
        let mut vertices = Array2::from_shape_fn((ring + 4, 3), |(i, k)| {
            let angle = std::f64::consts::TAU * i as f64 / ring as f64;
            [angle.cos(), angle.sin(), 0.0][k]
        });
        for (corner, place) in [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].iter().enumerate() {
            (0..2).for_each(|k| vertices[[ring + corner, k]] = 500.0 * place[k]);
        }
        let quarter = ring / 4;
        let mut triangles: Vec<[u32; 3]> =
            (0..ring).map(|i| [i as u32, (ring + i / quarter) as u32, ((i + 1) % ring) as u32]).collect();
        triangles.extend((0..4).map(|c| [(c * quarter) as u32, (ring + (c + 3) % 4) as u32, (ring + c) as u32]));
        assert_eq!(FarValues::of_mesh(&TriangleMesh { vertices, triangles }).unwrap().rows, [0; 0]);
        // The apex of a cone.
        let mut vertices = Array2::from_shape_fn((65, 3), |(i, k)| {
            let angle = std::f64::consts::TAU * i as f64 / 64.0;
            [angle.cos(), angle.sin(), 0.0][k]
        });
        vertices.row_mut(64).assign(&array![0.0, 0.0, 40.0]);
        let triangles = (0..64).map(|i| [i, (i + 1) % 64, 64]).collect();
        assert_eq!(FarValues::of_mesh(&TriangleMesh { vertices, triangles }).unwrap().rows, [0; 0]);
    }
}
