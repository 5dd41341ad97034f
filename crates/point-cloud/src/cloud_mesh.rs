//! A triangle mesh over an unordered cloud, from the Delaunay stars of its points.
//!
//! Each point proposes the triangles of its Delaunay star in its tangent plane (the idea of Gopi, Krishnan & Silva 2000).
//! The triangles on which most of their vertices agree enter a mesh first, the others where they still fit; small
//! gaps are closed ear by ear. What remains open is the boundary of the cloud.

use rayon::prelude::*;

use crate::edges::DisjointSets;
use crate::fans::Fans;
use crate::handles::handle_triangles;
use crate::local_frame::median;
use crate::sampling::Sampling;
use crate::search::CloudTree;
use crate::star::{TangentPlane, VoronoiCell};
use crate::vec3::{cross, dot, sub};

/// Neighbours of the first attempt at a star; more are fetched where the star is open.
pub(crate) const STAR_NEIGHBOURS: usize = 24;

/// Most neighbours of a star. A point that needs more lies at the rim of a much denser region.
const MOST_STAR_NEIGHBOURS: usize = 384;

/// Neighbours whose normals differ by more than 75° are taken for another sheet.
const SAME_SHEET_COSINE: f64 = 0.26;

/// Gaps up to this perimeter, in local spacings, are closed: about five spacings across, beyond what chance leaves open in
/// a cloud of even density.
const CLOSED_GAP: f64 = 16.0;

/// Gaps of more edges stay open, which bounds the work of closing them.
const MOST_GAP_EDGES: usize = 64;

/// In clouds of fewer points the longest loop is never closed: all of the boundary may be shorter than [`CLOSED_GAP`].
const SMALL_CLOUD: usize = 64;

/// Rounds of removing fans that only touch; each removes whole fans, few clouds need a second.
const PINCH_ROUNDS: usize = 16;

/// The mesh of a cloud.
pub(crate) struct CloudMesh {
    /// Triangles of the largest piece, oriented along the normals, no vertex pinched.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Its boundary loops, the surface on the left.
    pub(crate) loops: Vec<Vec<u32>>,
    /// Number of points of each piece before all but the largest were dropped, largest first.
    pub(crate) pieces: Vec<usize>,
}

impl CloudMesh {
    /// Spans a mesh over the points of `tree` with triangles of a circumradius of at most `reach` spacings of `sampling`.
    pub(crate) fn span(tree: &CloudTree<'_>, normals: &[[f64; 3]], sampling: &Sampling, reach: f64) -> Self {
        let points = tree.points;
        let spacing = &sampling.spacing;
        let planes: Vec<TangentPlane> = points.iter().zip(normals).map(|(p, n)| TangentPlane::new(*p, *n)).collect();
        let mut fans = Fans::new(points, &planes);
        for triangle in proposals(tree, normals, &planes, sampling, reach) {
            fans.try_add(triangle);
        }
        close_gaps(&mut fans, points, spacing, false);
        let pieces = keep_one_surface(&mut fans);
        let triangles = fans.triangles();
        let handles = handle_triangles(points, &triangles);
        if !handles.is_empty() {
            tracing::debug!(triangles = handles.len(), "cut handles");
            handles.iter().for_each(|&t| fans.remove(triangles[t as usize]));
            keep_one_surface(&mut fans);
        }
        // Over a sharp ridge the tangent planes of the vertices disagree, so no triangle fits. Without pinched vertices the
        // loops are unambiguous, and a gap can be closed whatever the planes say.
        close_gaps(&mut fans, points, spacing, true);
        keep_one_surface(&mut fans);
        Self { triangles: fans.triangles(), loops: fans.boundary_loops(), pieces }
    }
}

/// The triangles of all stars, those with most votes first, then small ones.
fn proposals(
    tree: &CloudTree<'_>,
    normals: &[[f64; 3]],
    planes: &[TangentPlane],
    sampling: &Sampling,
    reach: f64,
) -> Vec<[u32; 3]> {
    let points = tree.points;
    // A triangle over points of lines only, as in a bay of a densely sampled rim, must be small for them, not for the surface.
    let small_on_lines = |triangle: [u32; 3]| {
        let along_line = triangle.iter().map(|&v| sampling.along_line[v as usize]).fold(0.0, f64::max);
        circumradius(triangle.map(|v| points[v as usize])) <= reach * along_line
    };
    let stars: Vec<Vec<[u32; 3]>> = (0..points.len())
        .into_par_iter()
        .map(|i| {
            let radius = reach * sampling.spacing[i];
            let mut count = STAR_NEIGHBOURS;
            let mut seen = 0;
            let mut cell = VoronoiCell::new(radius);
            loop {
                let near = tree.nearest(i, count);
                for &(distance, j) in &near[seen..] {
                    if distance > 2.0 * cell.reach() {
                        break;
                    }
                    if dot(normals[i], normals[j as usize]) > SAME_SHEET_COSINE {
                        cell.cut(planes[i].unroll(points[j as usize]), j as usize);
                    }
                }
                seen = near.len();
                let safe = near.last().is_none_or(|n| n.0 >= 2.0 * cell.reach().min(radius));
                if safe || seen < count || count >= MOST_STAR_NEIGHBOURS {
                    break;
                }
                count *= 2;
            }
            cell.star(radius)
                .map(|[a, b]| smallest_first([i as u32, a as u32, b as u32]))
                .filter(|&triangle| small_on_lines(triangle))
                .collect()
        })
        .collect();
    let mut all: Vec<[u32; 3]> = stars.into_iter().flatten().collect();
    all.par_sort_unstable();
    let mut ranked: Vec<(usize, f64, [u32; 3])> = all
        .chunk_by(|a, b| a == b)
        .map(|same| (same.len(), circumradius(same[0].map(|v| points[v as usize])), same[0]))
        .collect();
    ranked.par_sort_unstable_by(|a, b| b.0.cmp(&a.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
    ranked.into_iter().map(|r| r.2).collect()
}

/// Closes the gaps of at most [`CLOSED_GAP`] spacings of perimeter, with triangles that fit their tangent planes or, `folded`, with
/// any that keep the mesh manifold.
fn close_gaps(fans: &mut Fans<'_>, points: &[[f64; 3]], spacing: &[f64], folded: bool) {
    let mut gaps: Vec<(f64, Vec<u32>)> =
        fans.boundary_loops().into_iter().map(|l| (perimeter(points, &l), l)).collect();
    gaps.sort_by(|a, b| a.0.total_cmp(&b.0));
    if points.len() < SMALL_CLOUD {
        gaps.pop();
    }
    for (length, gap) in gaps {
        let local = median(gap.iter().map(|&v| spacing[v as usize]).collect());
        if length <= CLOSED_GAP * local && gap.len() <= MOST_GAP_EDGES {
            close_gap(fans, points, gap, folded);
        }
    }
}

/// Cuts ears off a gap, that with the smallest circumradius first, as long as one is allowed.
fn close_gap(fans: &mut Fans<'_>, points: &[[f64; 3]], mut gap: Vec<u32>, folded: bool) {
    while gap.len() >= 3 {
        let n = gap.len();
        // The surface lies left of the loop, so the gap is passed clockwise: its ears run backwards.
        let ear = |k: usize| [gap[(k + 1) % n], gap[k], gap[(k + n - 1) % n]];
        let mut ears: Vec<(f64, usize)> =
            (0..n).map(|k| (circumradius(ear(k).map(|v| points[v as usize])), k)).collect();
        ears.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let cut = ears.into_iter().map(|e| e.1).find(|&k| {
            let [a, b, c] = ear(k);
            // A loop through a pinched vertex may pass it twice.
            let distinct = a != b && b != c && c != a;
            // A chord that is an edge already would tie two parts of the surface into a handle.
            distinct
                && (n == 3 || !fans.has_edge(a, c))
                && if folded { fans.try_add_folded([a, b, c]) } else { fans.try_add([a, b, c]) }
        });
        match cut {
            Some(k) if n > 3 => drop(gap.remove(k)),
            _ => return,
        }
    }
}

fn perimeter(points: &[[f64; 3]], vertices: &[u32]) -> f64 {
    let edge = |k: usize| {
        let d = sub(points[vertices[k] as usize], points[vertices[(k + 1) % vertices.len()] as usize]);
        dot(d, d).sqrt()
    };
    (0..vertices.len()).map(edge).sum()
}

/// Removes all but the largest fan at each vertex and all but the largest piece, and returns the points of each piece.
fn keep_one_surface(fans: &mut Fans<'_>) -> Vec<usize> {
    let mut pieces = Vec::new();
    for round in 0..PINCH_ROUNDS {
        let found = keep_largest_piece(fans);
        if round == 0 {
            pieces = found;
        }
        let mut pinched = false;
        for v in 0..fans.wedges.len() as u32 {
            let mut chains = fans.chains(v);
            if chains.len() < 2 {
                continue;
            }
            pinched = true;
            // A stable sort: of equal fans the first stays.
            chains.sort_by_key(|c| std::cmp::Reverse(c.len()));
            for wedge in chains.iter().skip(1).flatten() {
                fans.remove([v, wedge.from, wedge.to]);
            }
        }
        if !pinched {
            break;
        }
    }
    pieces
}

/// Pieces are joined by edges, not by single vertices.
fn keep_largest_piece(fans: &mut Fans<'_>) -> Vec<usize> {
    let triangles = fans.triangles();
    let mut sides: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * triangles.len());
    for (t, &[a, b, c]) in triangles.iter().enumerate() {
        sides.extend([[a, b], [b, c], [c, a]].map(|[p, q]| ([p.min(q), p.max(q)], t as u32)));
    }
    sides.sort_unstable();
    let mut sets = DisjointSets::new(triangles.len());
    for pair in sides.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        sets.join(pair[0].1, pair[1].1);
    }
    let mut members: Vec<(u32, u32)> =
        triangles.iter().enumerate().flat_map(|(t, v)| v.map(|v| (sets.root(t as u32), v))).collect();
    members.sort_unstable();
    members.dedup();
    let mut pieces: Vec<(usize, u32)> = members.chunk_by(|a, b| a.0 == b.0).map(|c| (c.len(), c[0].0)).collect();
    pieces.sort_by_key(|p| std::cmp::Reverse(p.0));
    if let Some(&(_, largest)) = pieces.first() {
        for (t, triangle) in triangles.iter().enumerate() {
            if sets.root(t as u32) != largest {
                fans.remove(*triangle);
            }
        }
    }
    pieces.into_iter().map(|p| p.0).collect()
}

fn smallest_first(t: [u32; 3]) -> [u32; 3] {
    let k = (0..3).min_by_key(|&k| t[k]).unwrap_or(0);
    [t[k], t[(k + 1) % 3], t[(k + 2) % 3]]
}

/// Circumradius of a triangle; infinite where it has no area.
fn circumradius([p, q, r]: [[f64; 3]; 3]) -> f64 {
    let (a, b, c) = (sub(q, p), sub(r, q), sub(p, r));
    let double_area = cross(a, b);
    let radius = (dot(a, a) * dot(b, b) * dot(c, c)).sqrt() / (2.0 * dot(double_area, double_area).sqrt());
    if radius.is_finite() { radius } else { f64::INFINITY }
}
