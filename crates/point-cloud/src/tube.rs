//! The two ends of a tube, and a short way from one to the other.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::vec3::{add, cross, dot, norm, scale, sub};
use crate::{BoundaryLoop, CloudError, DiskMesh};

/// The ends of a mesh that is taken as a tube, which may have further holes.
#[derive(Clone, Debug, PartialEq)]
pub struct TubeEnds<'a> {
    /// The end that is longest round, then the loop that is farthest from it along edges. The surface lies on their left.
    pub ends: [&'a BoundaryLoop; 2],
    /// All other loops.
    pub holes: Vec<&'a BoundaryLoop>,
    /// Vertices of the shortest way along edges from the first end to the second.
    pub path: Vec<u32>,
    /// Its length, in the units of the mesh.
    pub length: f64,
}

/// What tells a tube from a sheet with a hole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TubeShape {
    /// Length of the shorter end over that of the longer one.
    pub rim_ratio: f64,
    /// Length of the longest other loop over that of the shorter end; 0 without one.
    pub hole_ratio: f64,
    /// Length of the sum of all areas as vectors over the area: 0 on a cylinder, the sine of half the opening angle on a cone, 1 on a
    /// plate.
    pub facing: f64,
    /// Distance of the centres of the ends over the way between the ends along the surface: 1 on a cylinder, 0 on a plate.
    pub apart: f64,
    /// The way between the ends over the length of the longer one.
    pub slenderness: f64,
}

/// Least length of the shorter end over the longer one, and of the holes of a sheet over its outline where both may be ends of a tube.
///
/// Calibrated: cones to half their radius and tubes cut aslant have 0.5 and more; windows and lamps of a car shell, eyes and mouths of
/// faces 0.02 to 0.3 of the outline. Sheets with a larger hole fail by the next two.
const LEAST_RIM_RATIO: f64 = 0.5;

/// Longest hole over the shorter end.
///
/// Calibrated: beside a hole about as long as an end it isn't clear which loops are the ends.
const MOST_HOLE_RATIO: f64 = 0.5;

/// Largest sum of areas over the area.
///
/// Derived: a cone of an opening angle of 60° has 0.5, half a cylinder 2/π = 0.64, whatever was cut out of it.
const MOST_FACING: f64 = 0.5;

/// Least distance of the centres over the way between the ends, as a share of that of a tube bent as far as its length lets it.
///
/// Derived: a tube no thicker than its bend is wide, of a slenderness s, bends by an angle 2πs at most, and an arc of that angle has
/// a chord of sin(πs)/(πs) of its length. A cone of 60° has 0.87, and a way along edges is up to 8 % longer than the shortest one. A frame,
/// whose hole lies within its outline, is narrow and has far less, on three quarters of a cylinder 0.76.
const LEAST_APART: f64 = 0.8;

impl TubeShape {
    /// Whether the shape is that of a tube, so that nothing else fits as well.
    pub fn is_tube(&self) -> bool {
        self.rim_ratio >= LEAST_RIM_RATIO
            && self.hole_ratio <= MOST_HOLE_RATIO
            && self.facing <= MOST_FACING
            && self.apart >= LEAST_APART * self.chord_of_a_bend()
    }

    /// Chord over arc of a tube of this slenderness that is bent as far as it can be; 0 from a whole circle on.
    fn chord_of_a_bend(&self) -> f64 {
        let half = std::f64::consts::PI * self.slenderness.min(1.0);
        if half > 0.0 { half.sin() / half } else { 1.0 }
    }
}

impl DiskMesh {
    /// What tells whether the mesh is a tube; `None` with one boundary loop only. O(n log n).
    pub fn tube_shape(&self) -> Option<TubeShape> {
        let TubeEnds { ends, holes, length, .. } = self.tube_ends().ok()?;
        let hole = holes.iter().map(|rim| rim.length).fold(0.0, f64::max);
        let origin = self.vertex(0);
        let at = |v: u32| sub(self.vertex(v), origin);
        let (mut sum, mut area) = ([0.0; 3], 0.0);
        for t in self.triangles() {
            let [a, b, c] = t.map(at);
            let twice = cross(sub(b, a), sub(c, a));
            (sum, area) = (add(sum, twice), area + norm(twice));
        }
        // Of the rim as a curve, whatever the spacing of its vertices.
        let centre = |rim: &BoundaryLoop| {
            let n = rim.vertices.len();
            let (mut sum, mut total) = ([0.0; 3], 0.0);
            for k in 0..n {
                let (a, b) = (at(rim.vertices[k]), at(rim.vertices[(k + 1) % n]));
                let edge = norm(sub(b, a));
                (sum, total) = (add(sum, scale(0.5 * edge, add(a, b))), total + edge);
            }
            scale(total.recip(), sum)
        };
        let [longer, shorter] = [ends[0].length.max(ends[1].length), ends[0].length.min(ends[1].length)];
        Some(TubeShape {
            rim_ratio: shorter / longer,
            hole_ratio: hole / shorter,
            facing: norm(sum) / area,
            apart: norm(sub(centre(ends[0]), centre(ends[1]))) / length,
            slenderness: length / longer,
        })
    }

    /// The ends of the mesh, taken as a tube. A mesh of one piece without handles that has two boundary loops is one; of
    /// further loops those nearer to the first end are holes. O(n log n).
    ///
    /// # Errors
    /// [`CloudError::NoTube`] with one boundary loop only.
    pub fn tube_ends(&self) -> Result<TubeEnds<'_>, CloudError> {
        let (first, others) = (self.outer_loop(), self.holes());
        if others.is_empty() {
            return Err(CloudError::NoTube { loops: 1, length: first.length });
        }
        let Ways { distance, before } = Ways::from(self, &first.vertices);
        let away = |rim: &BoundaryLoop, pick: fn(f64, f64) -> f64, start: f64| {
            rim.vertices.iter().map(|&v| distance[v as usize]).fold(start, pick)
        };
        // Of equally far loops the longest, which comes first.
        let mut far = 0;
        for k in 1..others.len() {
            if away(&others[k], f64::max, 0.0) > away(&others[far], f64::max, 0.0) {
                far = k;
            }
        }
        let length = away(&others[far], f64::min, f64::INFINITY);
        let nearest = others[far].vertices.iter().copied().find(|&v| distance[v as usize] <= length);
        let mut path: Vec<u32> = nearest.into_iter().collect();
        while let Some(previous) = path.last().and_then(|&v| before[v as usize]) {
            path.push(previous);
        }
        path.reverse();
        let holes = others.iter().enumerate().filter(|(k, _)| *k != far).map(|(_, rim)| rim).collect();
        Ok(TubeEnds { ends: [first, &others[far]], holes, path, length })
    }

    /// The volume inside, all boundary loops closed by fans: positive if the triangles are counter-clockwise seen from
    /// outside.
    pub fn enclosed_volume(&self) -> f64 {
        let origin = self.vertex(0);
        let at = |v: u32| sub(self.vertex(v), origin);
        let spanned = |[a, b, c]: [[f64; 3]; 3]| dot(a, cross(b, c)) / 6.0;
        let inner: f64 = self.triangles().iter().map(|t| spanned(t.map(at))).sum();
        let caps = std::iter::once(self.outer_loop()).chain(self.holes()).map(|rim| {
            let n = rim.vertices.len();
            let centre = scale(1.0 / n as f64, rim.vertices.iter().fold([0.0; 3], |sum, &v| add(sum, at(v))));
            // The surface lies on the left of the loop, so its cap is passed backwards.
            (0..n).map(|i| spanned([at(rim.vertices[(i + 1) % n]), at(rim.vertices[i]), centre])).sum::<f64>()
        });
        inner + caps.sum::<f64>()
    }

    fn vertex(&self, v: u32) -> [f64; 3] {
        std::array::from_fn(|k| self.vertices()[[v as usize, k]])
    }
}

/// Shortest ways along edges.
struct Ways {
    /// Length of the way to each vertex.
    distance: Vec<f64>,
    /// The vertex before it on its way; none for starts.
    before: Vec<Option<u32>>,
}

impl Ways {
    /// From several starts (Dijkstra 1959). Of equally long ways the one found first from the smaller vertex stays.
    fn from(disk: &DiskMesh, starts: &[u32]) -> Self {
        let n = disk.vertices().nrows();
        let mut neighbours: Vec<[u32; 2]> =
            disk.triangles().iter().flat_map(|&[a, b, c]| [[a, b], [b, a], [b, c], [c, b], [c, a], [a, c]]).collect();
        neighbours.sort_unstable();
        neighbours.dedup();
        let mut first = vec![0; n + 1];
        neighbours.iter().for_each(|[a, _]| first[*a as usize + 1] += 1);
        (0..n).for_each(|v| first[v + 1] += first[v]);
        let mut ways = Self { distance: vec![f64::INFINITY; n], before: vec![None; n] };
        let mut open = BinaryHeap::new();
        for &start in starts {
            ways.distance[start as usize] = 0.0;
            open.push(Reverse((Length(0.0), start)));
        }
        while let Some(Reverse((Length(length), v))) = open.pop() {
            if length > ways.distance[v as usize] {
                continue;
            }
            for &[_, to] in &neighbours[first[v as usize]..first[v as usize + 1]] {
                let further = length + norm(sub(disk.vertex(v), disk.vertex(to)));
                if further < ways.distance[to as usize] {
                    (ways.distance[to as usize], ways.before[to as usize]) = (further, Some(v));
                    open.push(Reverse((Length(further), to)));
                }
            }
        }
        ways
    }
}

/// A finite length, ordered.
#[derive(Clone, Copy, PartialEq)]
struct Length(f64);

impl Eq for Length {}

impl PartialOrd for Length {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Length {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use super::*;
    use crate::{TriangleMesh, drop_unreferenced};
    use ndarray::Array2;

    const AROUND: u32 = 24;
    const ALONG: u32 = 9;

    /// A cone of height 3 whose radius falls from 1 to a half, normals outward, without the cells that `open` names.
    fn cone(open: impl Fn(u32, u32) -> bool) -> TriangleMesh {
        let at = |i: u32, j: u32| (i % AROUND) * (ALONG + 1) + j;
        let cells = (0..AROUND * ALONG).map(|c| (c / ALONG, c % ALONG)).filter(|&(i, j)| !open(i, j));
        let triangles = cells
            .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
            .collect();
        let vertices = Array2::from_shape_fn(((AROUND * (ALONG + 1)) as usize, 3), |(row, k)| {
            let (angle, v) =
                (TAU * f64::from(row as u32 / (ALONG + 1)) / 24.0, f64::from(row as u32 % (ALONG + 1)) / 9.0);
            let radius = 1.0 - 0.5 * v;
            [radius * angle.cos(), radius * angle.sin(), 3.0 * v][k]
        });
        TriangleMesh { vertices, triangles }
    }

    #[test]
    fn the_way_from_end_to_end_is_a_straight_line_of_a_cone() {
        let disk = DiskMesh::new(cone(|_, _| false)).unwrap();
        let tube = disk.tube_ends().unwrap();
        assert!(tube.ends[0].length > tube.ends[1].length && tube.holes.is_empty());
        assert_eq!(tube.path.len(), ALONG as usize + 1);
        assert!((tube.length - 0.5f64.hypot(3.0)).abs() < 1e-12);
        assert!(tube.path.windows(2).all(|pair| pair[1] == pair[0] + 1));
        // The volume of a frustum, less what 24 corners cut off.
        let smooth = PI * 3.0 * (1.0 + 0.5 + 0.25) / 3.0;
        assert!((disk.enclosed_volume() / smooth - 24.0 / TAU * (TAU / 24.0).sin()).abs() < 1e-2);
    }

    #[test]
    fn a_hole_larger_than_the_far_end_stays_a_hole() {
        let open = cone(|i, j| (3..9).contains(&i) && (2..6).contains(&j));
        let mesh = drop_unreferenced(&open).unwrap().mesh;
        let disk = DiskMesh::new(mesh.clone()).unwrap();
        let tube = disk.tube_ends().unwrap();
        let height = |end: usize| mesh.vertices[[tube.ends[end].vertices[0] as usize, 2]];
        assert_eq!((height(0), height(1)), (0.0, 3.0));
        assert!(tube.holes.len() == 1 && tube.holes[0].length > tube.ends[1].length);
    }

    #[test]
    fn triangles_the_other_way_round_enclose_a_negative_volume() {
        let mut mesh = cone(|i, j| (i, j) == (5, 5));
        let outward = DiskMesh::new(mesh.clone()).unwrap().enclosed_volume();
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        assert!((DiskMesh::new(mesh).unwrap().enclosed_volume() + outward).abs() < 1e-12 && outward > 0.0);
    }

    /// A ring of cells, as the rows of `at(i, j)` with i round it.
    fn ring(around: u32, along: u32, at: impl Fn(f64, f64) -> [f64; 3]) -> DiskMesh {
        let number = |i: u32, j: u32| (i % around) * (along + 1) + j;
        let cells = (0..around * along).map(|c| (c / along, c % along));
        let triangles = cells
            .flat_map(|(i, j)| {
                let [a, b, c, d] = [number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect();
        let vertices = Array2::from_shape_fn(((around * (along + 1)) as usize, 3), |(row, k)| {
            let (i, j) = (row as u32 / (along + 1), row as u32 % (along + 1));
            at(f64::from(i) / f64::from(around), f64::from(j) / f64::from(along))[k]
        });
        DiskMesh::new(TriangleMesh { vertices, triangles }).unwrap()
    }

    #[test]
    fn tubes_are_told_from_sheets_with_a_hole() {
        // Of any length, cones, bent ones up to a whole circle, with a twist of the section, cut aslant.
        for length in [0.2, 1.0, 5.0, 40.0] {
            let straight = ring(32, 8, |u, v| [(TAU * u).cos(), (TAU * u).sin(), length * v]);
            let shape = straight.tube_shape().unwrap();
            assert!(shape.is_tube() && (shape.apart - 1.0).abs() < 1e-9 && shape.facing < 1e-9, "{length} {shape:?}");
            let aslant =
                ring(32, 8, |u, v| [(TAU * u).cos(), (TAU * u).sin(), v * (length + 0.8 * (1.0 + (TAU * u).cos()))]);
            assert!(aslant.tube_shape().unwrap().is_tube(), "{length} {:?}", aslant.tube_shape());
        }
        for turn in [0.25, 0.5, 0.95] {
            let elbow = ring(24, 60, |u, v| {
                let (r, a) = (4.0 + (TAU * u).cos(), TAU * turn * v);
                [r * a.cos(), r * a.sin(), (TAU * u).sin()]
            });
            assert!(elbow.tube_shape().unwrap().is_tube(), "{turn} {:?}", elbow.tube_shape());
        }
        // Rings of a plate and of a dome with holes of every size; frames cut out of half and more of a cylinder.
        for hole in [0.05, 0.3, 0.5, 0.8, 0.95] {
            for bulge in [0.0, 0.3, 0.6] {
                let plate = ring(48, 8, |u, v| {
                    let r = hole + (1.0 - hole) * v;
                    [r * (TAU * u).cos(), r * (TAU * u).sin(), bulge * (1.0 - r * r)]
                });
                let shape = plate.tube_shape().unwrap();
                assert!(!shape.is_tube() || bulge == 0.6 && hole > 0.9, "{hole} {bulge} {shape:?}");
            }
            for wrap in [0.3, 0.5, 0.75] {
                let frame = ring(48, 8, |u, v| {
                    let (s, c) = (TAU * u).sin_cos();
                    let size = s.abs().max(c.abs()).recip() * (hole + (1.0 - hole) * v);
                    let angle = 0.5 * TAU * wrap * c * size;
                    [angle.cos(), angle.sin(), 2.0 * s * size]
                });
                assert!(!frame.tube_shape().unwrap().is_tube(), "{hole} {wrap} {:?}", frame.tube_shape());
            }
        }
    }

    #[test]
    fn one_loop_is_no_tube() {
        assert!(DiskMesh::new(cone(|i, _| i == 0)).unwrap().tube_shape().is_none());
        let disk = DiskMesh::new(cone(|i, _| i == 0)).unwrap();
        assert!(matches!(disk.tube_ends(), Err(CloudError::NoTube { loops: 1, .. })));
    }
}
