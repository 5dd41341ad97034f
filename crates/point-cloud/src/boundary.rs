//! The boundary of an open surface given by unordered points.

use ndarray::{ArrayView2, Axis};

use crate::cloud_mesh::{CloudMesh, STAR_NEIGHBOURS};
use crate::edges::DisjointSets;
use crate::local_frame::{Frames, median};
use crate::neighbours::rows;
use crate::sampling::Sampling;
use crate::search::CloudTree;
use crate::{
    BoundingBox, CloudError, DiskMesh, Duplicates, Normalization, SubMesh, TriangleMesh, check_surface_cloud,
    drop_unreferenced,
};

/// Fewest points with a boundary worth the name.
const FEWEST_POINTS: usize = 16;

/// Noise beyond this share of the median spacing disturbs the triangles, so they are spanned over smoothed points.
const SMOOTHED_FROM: f64 = 0.15;

/// Smoothing rounds at such noise: the second works with neighbours and normals of the first.
const SMOOTHING_ROUNDS: usize = 2;

/// Factors on the reach that are tried while too few points are joined: rows of a scanner may be several times as far apart as
/// the points in a row.
const REACH_STEPS: [f64; 3] = [1.5, 2.25, 3.4];

/// Options of [`find_boundary`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundaryParams {
    /// Largest circumradius of a triangle, in local spacings (at least 1). Smaller values follow narrower bays and report
    /// smaller holes; too small ones tear the surface where points are few.
    pub reach: f64,
    /// Share of the points that has to be joined to one surface, in (0, 1].
    pub coverage: f64,
    /// Pieces beyond this share of the points are an error; smaller ones are stray and left out. In \[0, 1).
    pub stray: f64,
}

impl Default for BoundaryParams {
    /// Reach 2: random points of even density rarely leave larger empty circles, and small gaps are closed. Coverage 0.9, stray pieces
    /// up to 2 % of the points.
    fn default() -> Self {
        Self { reach: 2.0, coverage: 0.9, stray: 0.02 }
    }
}

impl BoundaryParams {
    fn check(&self) -> Result<(), CloudError> {
        let bad = |name, value, range| Err(CloudError::BadOption { name, value, range });
        if !(self.reach >= 1.0 && self.reach.is_finite()) {
            return bad("reach", self.reach, "finite and at least 1");
        }
        if !(self.coverage > 0.0 && self.coverage <= 1.0) {
            return bad("coverage", self.coverage, "in (0, 1]");
        }
        if !(self.stray >= 0.0 && self.stray < 1.0) {
            return bad("stray", self.stray, "in [0, 1)");
        }
        Ok(())
    }
}

/// The boundary of a cloud and the mesh that was spanned over it.
///
/// Points are named by their row. Which side of the surface is outside cannot be known; loops and triangles share one
/// orientation, that of [`crate::LocalFrames`].
#[derive(Clone, Debug, PartialEq)]
pub struct CloudBoundary {
    /// The outer boundary, closed and in order, the surface on its left: the longest loop.
    pub outer: Vec<u32>,
    /// The other loops, longest first: the rims of holes and voids.
    pub holes: Vec<Vec<u32>>,
    /// Triangles over the points, without those `left_out`: a disk, possibly with holes, as [`DiskMesh`] checks. `None` where the
    /// triangles found have handles; the loops hold then nevertheless.
    pub triangles: Option<Vec<[u32; 3]>>,
    /// Points that belong to no triangle, increasing: equal to another point, stray, or off the surface.
    pub left_out: Vec<u32>,
    /// Median distance to the six nearest points, in the units of the points.
    pub spacing: f64,
    /// Standard deviation of the noise along the normals, in the units of the points.
    pub noise: f64,
    /// Largest circumradius of the triangles in local spacings that was needed.
    pub reach: f64,
}

impl CloudBoundary {
    /// The mesh over `points`, shape `(m, 3)`, those of [`find_boundary`], and for each of its vertices the row of its point.
    ///
    /// # Errors
    /// [`CloudError::NoTriangles`] where no mesh was found; those of [`DiskMesh::new`].
    pub fn disk_mesh(&self, points: ArrayView2<'_, f64>) -> Result<(DiskMesh, Vec<usize>), CloudError> {
        let triangles = self.triangles.clone().ok_or(CloudError::NoTriangles)?;
        let SubMesh { mesh, kept } = drop_unreferenced(&TriangleMesh { vertices: points.to_owned(), triangles })?;
        Ok((DiskMesh::new(mesh)?, kept))
    }
}

/// Finds the boundary of the surface that unordered `points`, shape `(m, 3)`, were taken from.
///
/// A triangle mesh is spanned over the cloud: every point proposes its Delaunay star in the tangent plane of
/// [`crate::LocalFrames`], bounded by `reach`; proposals enter the mesh in the order of their votes, where they fit, and small gaps are
/// closed. At noise above 15 % of the spacing this happens over smoothed points; the result refers to the given ones.
/// O(m log m).
///
/// # Errors
/// [`CloudError::ClosedCloud`], [`CloudError::CloudPieces`], [`CloudError::NoSurface`], [`CloudError::AlongCurve`] (each says what to do),
/// [`CloudError::BadOption`], [`CloudError::WrongDimension`], those of [`check_surface_cloud`] for 16 points.
pub fn find_boundary(points: ArrayView2<'_, f64>, params: &BoundaryParams) -> Result<CloudBoundary, CloudError> {
    params.check()?;
    rows(points)?;
    check_surface_cloud(points, FEWEST_POINTS)?;
    let duplicates = Duplicates::find(points);
    // In the unit cube no product of lengths under- or overflows.
    let normalization = Normalization::of(points)?;
    let distinct = rows(normalization.apply(points.select(Axis(0), &duplicates.kept).view())?.view())?;
    let m = distinct.len();
    if m < FEWEST_POINTS {
        return Err(CloudError::TooFewPoints { given: m, required: FEWEST_POINTS });
    }
    let tree = CloudTree::new(&distinct)?;
    let frames = Frames::unoriented(&tree);
    let (raw_spacing, noise, scale) = (median(frames.spacing.clone()), frames.noise, normalization.scale());
    let Spanned { mesh, joined, reach } = if noise > SMOOTHED_FROM * raw_spacing {
        drop(tree);
        let mut smoothed = frames.smoothed;
        for _ in 1..SMOOTHING_ROUNDS {
            smoothed = Frames::unoriented(&CloudTree::new(&smoothed)?).smoothed;
        }
        let tree = CloudTree::new(&smoothed)?.with_known(STAR_NEIGHBOURS);
        Spanned::over(&tree, Frames::unoriented(&tree), params)
    } else {
        Spanned::over(&tree.with_known(STAR_NEIGHBOURS), frames, params)
    };
    let no_surface =
        |connected| CloudError::NoSurface { connected, points: m, noise: noise * scale, spacing: raw_spacing * scale };
    let sizes: Vec<usize> = mesh.pieces.iter().copied().filter(|&s| s as f64 > params.stray * m as f64).collect();
    if sizes.len() > 1 {
        let reach = params.reach * REACH_STEPS.into_iter().fold(1.0, f64::max);
        return Err(CloudError::CloudPieces { sizes, reach });
    }
    if (joined as f64) < params.coverage * m as f64 {
        if is_path(&CloudTree::new(&distinct)?) {
            return Err(CloudError::AlongCurve { points: m });
        }
        return Err(no_surface(joined));
    }
    if mesh.loops.is_empty() {
        return Err(CloudError::ClosedCloud { points: m });
    }
    let row = |v: u32| duplicates.kept[v as usize] as u32;
    let mut loops: Vec<Vec<u32>> = mesh.loops.iter().map(|l| l.iter().map(|&v| row(v)).collect()).collect();
    // A stable sort: of equally long loops the one with the smallest vertex stays first.
    let unit = BoundingBox::of(points)?.longest_side();
    loops.sort_by(|a, b| length(points, b, unit).total_cmp(&length(points, a, unit)));
    let outer = loops.remove(0);
    let triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(row)).collect();
    let mut used = vec![false; points.nrows()];
    triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
    let left_out: Vec<u32> = (0..used.len() as u32).filter(|&v| !used[v as usize]).collect();
    tracing::info!(
        points = m,
        boundary = outer.len(),
        holes = loops.len(),
        left_out = left_out.len(),
        "spanned a mesh"
    );
    let mut result = CloudBoundary {
        outer,
        holes: loops,
        triangles: Some(triangles),
        left_out,
        spacing: raw_spacing * scale,
        noise: noise * scale,
        reach,
    };
    if let Err(reason) = result.disk_mesh(points) {
        tracing::warn!(%reason, "the triangles over the cloud are not a disk; only its loops are used");
        result.triangles = None;
    }
    Ok(result)
}

/// Neighbours among which the shortest edges of a tree over all points are looked for.
const PATH_NEIGHBOURS: usize = 8;

/// Whether the minimum spanning tree of the points has no branch: they follow one curve.
fn is_path(tree: &CloudTree<'_>) -> bool {
    let m = tree.points.len();
    let near = tree.all_nearest(PATH_NEIGHBOURS);
    let mut edges: Vec<(f64, u32, u32)> = (0..m)
        .flat_map(|i| near.of(i).iter().zip(near.distances_of(i)).map(move |(&j, &d)| (d, i as u32, j)))
        .collect();
    edges.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut sets = DisjointSets::new(m);
    let (mut degree, mut joined) = (vec![0u8; m], 1);
    for (_, a, b) in edges {
        if sets.root(a) != sets.root(b) {
            sets.join(a, b);
            joined += 1;
            for end in [a, b] {
                degree[end as usize] += 1;
                if degree[end as usize] > 2 {
                    return false;
                }
            }
        }
    }
    joined == m
}

/// A mesh over a cloud.
struct Spanned {
    mesh: CloudMesh,
    /// Number of points of its largest piece.
    joined: usize,
    reach: f64,
}

impl Spanned {
    /// The mesh with the smallest reach that joins enough of the points, or else the one that joins most.
    fn over(tree: &CloudTree<'_>, frames: Frames, params: &BoundaryParams) -> Self {
        let m = tree.points.len();
        let frames = frames.oriented(tree);
        let sampling = Sampling::of(tree, &frames);

        let attempt = |step: f64| {
            let reach = params.reach * step;
            let mesh = CloudMesh::span(tree, &frames.normals, &sampling, reach);
            Self { joined: mesh.pieces.first().copied().unwrap_or(0), mesh, reach }
        };
        let mut best = attempt(1.0);
        for step in REACH_STEPS {
            if best.joined as f64 >= params.coverage * m as f64 {
                break;
            }
            let wider = attempt(step);
            if wider.joined > best.joined {
                best = wider;
            }
        }
        best
    }
}

/// Length of a closed loop in units of `unit`.
fn length(points: ArrayView2<'_, f64>, vertices: &[u32], unit: f64) -> f64 {
    (0..vertices.len())
        .map(|k| {
            let (a, b) = (vertices[k] as usize, vertices[(k + 1) % vertices.len()] as usize);
            (0..3).map(|c| ((points[[a, c]] - points[[b, c]]) / unit).powi(2)).sum::<f64>().sqrt()
        })
        .sum()
}

#[cfg(test)]
#[path = "boundary_tests.rs"]
mod tests;
