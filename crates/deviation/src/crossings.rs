//! Places where a surface, of one patch or of several, passes through itself.

use point_cloud::DisjointSets;
use point_cloud::vec3::{add, cross, dot, norm, scale, sub, unit};
use serde::Serialize;
use thb_core::{ParameterBox, SplineMap};

use crate::parts::point_at;
use crate::{Error, Tessellation};

/// Triangles of a leaf of the tree of boxes.
///
/// Limit: bounds the number of boxes; no result depends on it.
const LEAF: usize = 4;

/// Depth that counts as none, as a share of the largest coordinate.
///
/// Limit: distances from a plane are known up to some 10⁻¹⁵ of the coordinates; needle-shaped triangles lose further digits.
const ROUND_OFF: f64 = 1e-12;

/// Pairs of crossing triangles after which the search ends.
///
/// Limit: a surface that is crumpled into a heap has as many pairs as triangles, squared.
const MAX_PAIRS: usize = 20_000;

/// Tests of pairs of triangles after which the search ends.
///
/// Limit: bounds the time for a surface that is crumpled into a heap without crossing pairs.
const MAX_TESTS: usize = 200_000_000;

/// A connected place where a surface passes through itself.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Crossing {
    /// A point of the crossing, where it is deepest.
    pub place: [f64; 3],
    /// The patches of the two sheets that meet there.
    pub patches: [usize; 2],
    /// The parameters of that point on either.
    pub parameters: [[f64; 2]; 2],
    /// The triangles of either that meet there.
    pub triangles: [u32; 2],
    /// How far corners of one triangle lie beyond the sheet of the other one, on the side where that is less.
    pub depth: f64,
    /// Number of pairs of triangles that pass through one another here.
    pub pairs: usize,
    /// Diagonal of the box round the crossing.
    pub extent: f64,
}

/// The crossings of a surface.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Crossings {
    /// Connected places, the largest first.
    pub places: Vec<Crossing>,
    /// Number of pairs of triangles of all places.
    pub pairs: usize,
    /// Whether the search went to its end. It stops early in a surface that is crumpled into a heap.
    pub complete: bool,
}

/// A patch of a surface with its triangles.
#[derive(Clone, Copy, Debug)]
pub struct TessellatedPatch<'a> {
    /// The patch.
    pub map: &'a SplineMap<2>,
    /// Triangles over it.
    pub tessellation: &'a Tessellation,
}

/// Finds the places where a surface passes through itself by more than `least_depth`.
///
/// **Candidates** are pairs of triangles that pass through one another. Pairs with a side in common are none: where they lie on
/// one another, the surface is folded over.
///
/// **Judgement.** Triangles may pass through one another where the surface only comes near itself or touches itself: the sides
/// of a thin blade, the sides of a sheet that meet along a seam, patches along an arc that their triangles divide differently,
/// triangles round a pole. So the surface decides: from the corners
/// of one triangle, which lie on the surface, the feet on the sheet of the other triangle are found by Newton's method. A pair
/// counts if corners lie on both sides of that sheet, farther than `least_depth`; those whose foot is on the rim of the other's patch
/// or is the corner itself tell nothing. The [`Crossing::depth`] is thus one of the surface; crossings deeper than the chord errors of
/// two triangles together are found, shallower ones by chance.
///
/// Plain arithmetic will do to find candidates: where it errs, depths are round-off, and the surface decides.
///
/// # Errors
/// [`Error::Space`].
pub fn self_crossings(patches: &[TessellatedPatch<'_>], least_depth: f64) -> Result<Crossings, Error> {
    let all = Triangles::new(patches);
    let mut search = Search::new(&all, least_depth);
    let complete = search.run();
    let judge = Judge { all: &all, least_depth: search.least_depth };
    let mut pairs = search.pairs;
    let mut failure = None;
    pairs.retain_mut(|pair| match judge.depth(pair.triangles) {
        Ok(depth) => {
            pair.depth = depth;
            depth > judge.least_depth
        }
        Err(error) => {
            failure.get_or_insert(error);
            false
        }
    });
    match failure {
        Some(error) => Err(error),
        None => Ok(Crossings { places: judge.gathered(&pairs)?, pairs: pairs.len(), complete }),
    }
}

/// The triangles of all patches, one list after the other.
struct Triangles<'a> {
    patches: &'a [TessellatedPatch<'a>],
    /// The patch of each triangle, and its number there.
    owners: Vec<(u32, u32)>,
    /// The number of vertices of the patches before each patch.
    first_vertex: Vec<u32>,
}

impl<'a> Triangles<'a> {
    fn new(patches: &'a [TessellatedPatch<'a>]) -> Self {
        let triangles_of = |(patch, of): (usize, &TessellatedPatch<'_>)| {
            (0..of.tessellation.triangles.len()).map(move |triangle| (patch as u32, triangle as u32))
        };
        let owners = patches.iter().enumerate().flat_map(triangles_of).collect();
        let mut vertices = 0;
        let first_vertex = patches.iter().map(|patch| {
            let first = vertices;
            vertices += patch.tessellation.vertices.len() as u32;
            first
        });
        Self { patches, owners, first_vertex: first_vertex.collect() }
    }

    /// The patch of a triangle, and its number there.
    fn owner(&self, triangle: u32) -> (TessellatedPatch<'a>, usize) {
        let (patch, triangle) = self.owners[triangle as usize];
        (self.patches[patch as usize], triangle as usize)
    }

    fn corners(&self, triangle: u32) -> [[f64; 3]; 3] {
        let (patch, triangle) = self.owner(triangle);
        patch.tessellation.corners(triangle)
    }

    /// Numbers of its corners among the vertices of all patches.
    fn numbers(&self, triangle: u32) -> [u32; 3] {
        let (patch, triangle) = self.owners[triangle as usize];
        self.patches[patch as usize].tessellation.triangles[triangle as usize]
            .map(|v| self.first_vertex[patch as usize] + v)
    }

    fn vertices(&self) -> impl Iterator<Item = &[f64; 3]> {
        self.patches.iter().flat_map(|patch| &patch.tessellation.vertices)
    }
}

/// Two triangles that pass through one another.
struct Pair {
    triangles: [u32; 2],
    /// [`Crossing::depth`], once the surface was asked.
    depth: f64,
    /// The ends of the common segment, as barycentric coordinates in both triangles.
    ends: [[[f64; 3]; 2]; 2],
}

#[derive(Clone, Copy)]
struct Extent {
    lower: [f64; 3],
    upper: [f64; 3],
}

impl Extent {
    const NOTHING: Self = Self { lower: [f64::INFINITY; 3], upper: [f64::NEG_INFINITY; 3] };

    fn of(points: &[[f64; 3]]) -> Self {
        points.iter().fold(Self::NOTHING, |all, &p| all.joined(Self { lower: p, upper: p }))
    }

    fn joined(self, other: Self) -> Self {
        Self {
            lower: std::array::from_fn(|k| self.lower[k].min(other.lower[k])),
            upper: std::array::from_fn(|k| self.upper[k].max(other.upper[k])),
        }
    }

    fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|k| self.lower[k] <= other.upper[k] && other.lower[k] <= self.upper[k])
    }

    fn diagonal(&self) -> f64 {
        norm(sub(self.upper, self.lower))
    }
}

/// A triangle with what tests of many pairs need.
struct Face {
    corners: [[f64; 3]; 3],
    extent: Extent,
    /// Unit normal; zero without area.
    normal: [f64; 3],
}

impl Face {
    fn new(corners: [[f64; 3]; 3]) -> Self {
        let normal = unit(cross(sub(corners[1], corners[0]), sub(corners[2], corners[0])));
        Self { corners, extent: Extent::of(&corners), normal }
    }

    /// Distances of the corners of another triangle from the plane of this one, if they lie on both sides of it.
    fn heights_astride(&self, other: &Self, round_off: f64) -> Option<[f64; 3]> {
        let heights = other.corners.map(|x| {
            let height = dot(self.normal, sub(x, self.corners[0]));
            if height.abs() > round_off { height } else { 0.0 }
        });
        let astride = heights.iter().any(|&h| h > 0.0) && heights.iter().any(|&h| h < 0.0);
        astride.then_some(heights)
    }
}

/// Where a triangle meets a line: from one place along it to another, with barycentric coordinates.
struct Stretch {
    along: [f64; 2],
    barycentric: [[f64; 3]; 2],
}

impl Stretch {
    /// The stretch of a triangle on the plane from which its corners have the given heights.
    fn of(face: &Face, heights: [f64; 3], direction: [f64; 3]) -> Option<Self> {
        let along = face.corners.map(|x| dot(direction, x));
        let mut ends = [(0.0, [0.0; 3]); 2];
        let mut n = 0;
        for k in 0..3 {
            let next = (k + 1) % 3;
            let t = match (heights[k], heights[next]) {
                (0.0, _) => 0.0,
                (a, b) if a * b < 0.0 => a / (a - b),
                _ => continue,
            };
            let mut barycentric = [0.0; 3];
            barycentric[next] = t;
            barycentric[k] = 1.0 - t;
            *ends.get_mut(n)? = (along[k] + t * (along[next] - along[k]), barycentric);
            n += 1;
        }
        let [mut first, mut last] = ends;
        if first.0 > last.0 {
            std::mem::swap(&mut first, &mut last);
        }
        (n == 2).then_some(Self { along: [first.0, last.0], barycentric: [first.1, last.1] })
    }

    /// Barycentric coordinates at a place along the line.
    fn at(&self, along: f64) -> [f64; 3] {
        let t = (along - self.along[0]) / (self.along[1] - self.along[0]);
        std::array::from_fn(|k| self.barycentric[0][k] + t * (self.barycentric[1][k] - self.barycentric[0][k]))
    }
}

/// The ends of the segment that two triangles have in common, as barycentric coordinates in both: the line where their planes
/// meet, and on it the stretch that lies in both (Möller 1997).
fn common_segment(a: &Face, b: &Face, round_off: f64) -> Option<[[[f64; 3]; 2]; 2]> {
    let of_b = a.heights_astride(b, round_off)?;
    let of_a = b.heights_astride(a, round_off)?;
    let direction = unit(cross(a.normal, b.normal));
    let stretches = [Stretch::of(a, of_a, direction)?, Stretch::of(b, of_b, direction)?];
    let from = stretches[0].along[0].max(stretches[1].along[0]);
    let to = stretches[0].along[1].min(stretches[1].along[1]);
    (to - from > round_off).then(|| [from, to].map(|along| [stretches[0].at(along), stretches[1].at(along)]))
}

/// The search for pairs, by boxes round runs of triangles: `levels[0]` holds boxes round [`LEAF`] triangles each, in the order
/// of the list, every further level boxes round two of the one before. The triangles follow a space-filling curve already, so
/// nothing need be sorted.
struct Search<'a> {
    all: &'a Triangles<'a>,
    faces: Vec<Face>,
    levels: Vec<Vec<Extent>>,
    round_off: f64,
    least_depth: f64,
    pairs: Vec<Pair>,
}

impl<'a> Search<'a> {
    fn new(all: &'a Triangles<'a>, least_depth: f64) -> Self {
        let faces: Vec<Face> = (0..all.owners.len()).map(|t| Face::new(all.corners(t as u32))).collect();
        let joined = |boxes: &[Extent]| boxes.iter().fold(Extent::NOTHING, |all, &b| all.joined(b));
        let mut levels: Vec<Vec<Extent>> = vec![
            faces.chunks(LEAF).map(|run| run.iter().fold(Extent::NOTHING, |all, f| all.joined(f.extent))).collect(),
        ];
        while let Some(last) = levels.last().filter(|last| last.len() > 1) {
            let next = last.chunks(2).map(joined).collect();
            levels.push(next);
        }
        let largest = all.vertices().flatten().fold(0.0_f64, |most, x| most.max(x.abs()));
        let round_off = ROUND_OFF * largest;
        Self { all, faces, levels, round_off, least_depth: least_depth.max(round_off), pairs: Vec::new() }
    }

    /// Finds the pairs; whether it went to its end.
    fn run(&mut self) -> bool {
        let top = self.levels.len() - 1;
        let mut stack = vec![(top, 0, 0)];
        let mut tests = 0;
        while let Some((level, i, j)) = stack.pop() {
            let (a, b) = match self.levels[level].get(i).zip(self.levels[level].get(j)) {
                Some(boxes) => boxes,
                None => continue,
            };
            // What is smaller than the least depth cannot reach that far.
            if (i != j && !a.overlaps(b)) || a.joined(*b).diagonal() <= self.least_depth {
                continue;
            }
            if level == 0 {
                tests += LEAF * LEAF;
                self.compare(i, j);
                if tests > MAX_TESTS || self.pairs.len() > MAX_PAIRS {
                    return false;
                }
                continue;
            }
            let below = level - 1;
            stack.push((below, 2 * i, 2 * j));
            stack.push((below, 2 * i, 2 * j + 1));
            stack.push((below, 2 * i + 1, 2 * j + 1));
            if i != j {
                stack.push((below, 2 * i + 1, 2 * j));
            }
        }
        true
    }

    /// Compares the triangles of two leaves.
    fn compare(&mut self, i: usize, j: usize) {
        let run = |leaf: usize| leaf * LEAF..(leaf * LEAF + LEAF).min(self.faces.len());
        for first in run(i) {
            for second in run(j) {
                if i == j && second <= first {
                    continue;
                }
                if let Some(pair) = self.pair(first, second) {
                    self.pairs.push(pair);
                }
            }
        }
    }

    fn pair(&self, first: usize, second: usize) -> Option<Pair> {
        let (a, b) = (&self.faces[first], &self.faces[second]);
        if !a.extent.overlaps(&b.extent) {
            return None;
        }
        let corners = [first, second].map(|t| self.all.numbers(t as u32));
        if corners[0].iter().filter(|v| corners[1].contains(v)).count() > 1 {
            return None;
        }
        let ends = common_segment(a, b, self.round_off)?;
        Some(Pair { triangles: [first as u32, second as u32], depth: 0.0, ends })
    }
}

/// Steps of Newton's method to a foot, or to a point of the crossing.
///
/// Limit: it starts within a triangle of the result and doubles its digits.
const MAX_STEPS: usize = 12;

/// A foot is found when the point lies above the surface: sine of the angle between the way to it and the normal.
///
/// Derived: the height then is right to half the square of it.
const FOOT_SINE: f64 = 1e-3;

/// A place on the surface with its tangents.
struct Frame {
    point: [f64; 3],
    tangents: [[f64; 3]; 2],
}

fn frame(map: &SplineMap<2>, u: [f64; 2]) -> Result<Frame, Error> {
    let cell = map.space().locate_cell(u)?;
    let mut frame = Frame { point: [0.0; 3], tangents: [[0.0; 3]; 2] };
    let bezier = map.bezier();
    bezier.derivative(cell, u, [0, 0], &mut frame.point);
    bezier.derivative(cell, u, [1, 0], &mut frame.tangents[0]);
    bezier.derivative(cell, u, [0, 1], &mut frame.tangents[1]);
    Ok(frame)
}

/// Asks the surface itself.
struct Judge<'a> {
    all: &'a Triangles<'a>,
    least_depth: f64,
}

impl Judge<'_> {
    /// How far the corners of either triangle lie on both sides of the sheet of the other one.
    fn depth(&self, triangles: [u32; 2]) -> Result<f64, Error> {
        let mut depth = 0.0_f64;
        for [of, from] in [triangles, [triangles[1], triangles[0]]] {
            let [mut low, mut high] = [0.0_f64; 2];
            for corner in self.all.corners(from) {
                let height = self.height(corner, of)?;
                (low, high) = (low.min(height), high.max(height));
            }
            depth = depth.max(high.min(-low));
        }
        Ok(depth)
    }

    /// The height of a point above the sheet of a triangle; 0 where it has no foot there.
    fn height(&self, x: [f64; 3], triangle: u32) -> Result<f64, Error> {
        let (TessellatedPatch { map, tessellation }, triangle) = self.all.owner(triangle);
        let space = map.space();
        let corners = tessellation.corners(triangle);
        let barycentric = point_cloud::barycentric_in_plane(x, corners).unwrap_or([1.0, 0.0, 0.0]).map(|b| b.max(0.0));
        let sum: f64 = barycentric.iter().sum();
        let mut u = tessellation.parameters_at(triangle, barycentric.map(|b| b / sum));
        for _ in 0..MAX_STEPS {
            let Frame { point, tangents } = frame(map, u)?;
            let way = sub(x, point);
            let area_vector = cross(tangents[0], tangents[1]);
            let area = norm(area_vector);
            if area <= 0.0 {
                return Ok(0.0);
            }
            let height = dot(way, area_vector) / area;
            let aside = norm(sub(way, scale(height / area, area_vector)));
            if aside <= FOOT_SINE * height.abs() {
                return Ok(height);
            }
            if norm(way) <= self.least_depth {
                return Ok(0.0);
            }
            // The step to the foot on the tangent plane.
            let [uu, uv, vv] = [(0, 0), (0, 1), (1, 1)].map(|(a, b)| dot(tangents[a], tangents[b]));
            let [along_u, along_v] = tangents.map(|t| dot(t, way));
            let step = [(vv * along_u - uv * along_v) / (area * area), (uu * along_v - uv * along_u) / (area * area)];
            let next = space.to_domain([u[0] + step[0], u[1] + step[1]]);
            if next == u || next.iter().any(|x| !x.is_finite()) {
                return Ok(0.0);
            }
            u = next;
        }
        Ok(0.0)
    }

    /// A common point of two sheets near the given parameters: Newton's method with the smallest step, from the given ones if
    /// it does not lead to one within a few triangles.
    fn common_point(
        &self,
        maps: [&SplineMap<2>; 2],
        parameters: [[f64; 2]; 2],
        size: f64,
    ) -> Result<([[f64; 2]; 2], [f64; 3]), Error> {
        let start = frame(maps[0], parameters[0])?.point;
        let mut at = parameters;
        for _ in 0..MAX_STEPS {
            let frames = [frame(maps[0], at[0])?, frame(maps[1], at[1])?];
            let way = sub(frames[1].point, frames[0].point);
            if norm(sub(frames[0].point, start)) > size {
                break;
            }
            if norm(way) <= self.least_depth {
                return Ok((at, scale(0.5, add(frames[0].point, frames[1].point))));
            }
            // Rows of the derivative of S(at[0]) − S(at[1]); the smallest step is a combination of them, with lengths in
            // space, so tangents of unit length.
            let columns: [[f64; 3]; 4] = std::array::from_fn(|k| frames[k / 2].tangents[k % 2]);
            let lengths = columns.map(norm);
            if lengths.iter().any(|&l| l <= 0.0) {
                break;
            }
            let units: [[f64; 3]; 4] = std::array::from_fn(|k| scale(lengths[k].recip(), columns[k]));
            let gram: [[f64; 3]; 3] =
                std::array::from_fn(|i| std::array::from_fn(|j| units.iter().map(|t| t[i] * t[j]).sum()));
            let Some(multipliers) = solved(gram, way) else { break };
            for side in 0..2 {
                let sign = [1.0, -1.0][side];
                let next = std::array::from_fn(|d| {
                    let k = 2 * side + d;
                    at[side][d] + sign * dot(units[k], multipliers) / lengths[k]
                });
                at[side] = maps[side].space().to_domain(next);
            }
            if at.iter().flatten().any(|x| !x.is_finite()) {
                break;
            }
        }
        Ok((parameters, start))
    }

    /// Gathers pairs into connected places: pairs with a vertex in common belong together.
    fn gathered(&self, pairs: &[Pair]) -> Result<Vec<Crossing>, Error> {
        let mut sets = DisjointSets::new(self.all.vertices().count());
        let first_vertex = |pair: &Pair| self.all.numbers(pair.triangles[0])[0];
        for pair in pairs {
            for v in pair.triangles.into_iter().flat_map(|t| self.all.numbers(t)) {
                sets.join(first_vertex(pair), v);
            }
        }
        let mut members: Vec<(u32, usize)> =
            pairs.iter().enumerate().map(|(k, pair)| (sets.root(first_vertex(pair)), k)).collect();
        members.sort_unstable();
        let point = |t: u32, barycentric: [f64; 3]| point_at(self.all.corners(t), barycentric);
        let mut places = Vec::new();
        for group in members.chunk_by(|a, b| a.0 == b.0) {
            let of_group = || group.iter().map(|&(_, k)| &pairs[k]);
            let extent = of_group()
                .map(|pair| Extent::of(&pair.ends.map(|end| point(pair.triangles[0], end[0]))))
                .fold(Extent::NOTHING, Extent::joined)
                .diagonal();
            let by_depth = |a: &&Pair, b: &&Pair| a.depth.total_cmp(&b.depth).then(b.triangles.cmp(&a.triangles));
            let Some(deepest) = of_group().max_by(by_depth) else { continue };
            let size = deepest.triangles.map(|t| Extent::of(&self.all.corners(t)).diagonal());
            let owners = deepest.triangles.map(|t| self.all.owner(t));
            let middle = std::array::from_fn(|side| {
                let barycentric = scale(0.5, add(deepest.ends[0][side], deepest.ends[1][side]));
                let (patch, triangle) = owners[side];
                patch.tessellation.parameters_at(triangle, barycentric)
            });
            let (parameters, place) =
                self.common_point(owners.map(|(patch, _)| patch.map), middle, 2.0 * size[0].max(size[1]))?;
            places.push(Crossing {
                place,
                patches: deepest.triangles.map(|t| self.all.owners[t as usize].0 as usize),
                parameters,
                triangles: owners.map(|(_, triangle)| triangle as u32),
                depth: deepest.depth,
                pairs: group.len(),
                extent,
            });
        }
        places.sort_by(|a, b| {
            b.extent.total_cmp(&a.extent).then((a.patches, a.triangles).cmp(&(b.patches, b.triangles)))
        });
        Ok(places)
    }
}

/// The solution of three equations by Cramer's rule; `None` if they are singular.
fn solved(rows: [[f64; 3]; 3], right: [f64; 3]) -> Option<[f64; 3]> {
    // The matrix is symmetric: rows are columns.
    let [a, b, c] = rows;
    let determinant = dot(a, cross(b, c));
    let solution = [dot(right, cross(b, c)), dot(a, cross(right, c)), dot(a, cross(b, right))].map(|x| x / determinant);
    solution.iter().all(|x| x.is_finite()).then_some(solution)
}

#[cfg(test)]
mod tests;

/// Distance, in tolerances, of a crossing of the scan from one of the surface that it explains, besides half the size of that one.
///
/// Derived: both sheets of the surface are within one tolerance of those of the scan.
const EXPLAINED_NEAR: f64 = 3.0;

/// Places that a report lists.
const LISTED: usize = 10;

impl Crossings {
    /// With the largest places only.
    #[must_use]
    pub fn for_report(mut self) -> Self {
        self.places.truncate(LISTED);
        self
    }

    /// Leaves out the places where the scan passes through itself, too: its `triangles`, which name `points`.
    pub fn forgive(&mut self, points: &[[f64; 3]], triangles: &[[u32; 3]], tolerance: f64) {
        let is_in_scan = |crossing: &Crossing| {
            let radius = EXPLAINED_NEAR * tolerance + 0.5 * crossing.extent;
            scan_crosses_near(points, triangles, crossing.place, radius)
        };
        self.places.retain(|crossing| !is_in_scan(crossing));
        self.pairs = self.places.iter().map(|crossing| crossing.pairs).sum();
    }
}

/// Whether triangles of a scan within `radius` and their own size of a place pass through one another: then a surface that lies on the
/// scan does, too; where it does so is known up to the spacing of the points. `triangles` name `points`; those that name points that are
/// not there are left out.
fn scan_crosses_near(points: &[[f64; 3]], triangles: &[[u32; 3]], place: [f64; 3], radius: f64) -> bool {
    let near = |t: &&[u32; 3]| {
        t.iter().all(|&v| (v as usize) < points.len()) && {
            let extent = Extent::of(&t.map(|v| points[v as usize]));
            let radius = radius + extent.diagonal();
            extent.overlaps(&Extent { lower: place.map(|x| x - radius), upper: place.map(|x| x + radius) })
        }
    };
    let near: Vec<&[u32; 3]> = triangles.iter().filter(near).take(MAX_NEAR).collect();
    let faces: Vec<Face> = near.iter().map(|t| Face::new(t.map(|v| points[v as usize]))).collect();
    let round_off = ROUND_OFF * points.iter().flatten().fold(0.0_f64, |most, x| most.max(x.abs()));
    (0..faces.len()).any(|i| {
        (0..i).any(|j| {
            let apart = !near[i].iter().any(|v| near[j].contains(v));
            apart
                && faces[i].extent.overlaps(&faces[j].extent)
                && common_segment(&faces[i], &faces[j], round_off).is_some()
        })
    })
}

/// Triangles round a place that are compared with one another.
///
/// Limit: their pairs are compared, 2 · 10⁶ at most.
const MAX_NEAR: usize = 2000;
