//! Layouts made from a mesh alone.
//!
//! 1. Triangles are split until there are enough (`refine`), creases found (`features`) and made lines with places where arcs cross them
//!    (`lines`).
//! 2. Faces go to the nearest seed, in place and direction (`regions`); seeds are added until each region is a disk (`plan`).
//! 3. Regions become polygons (`patchwork`), whose borders are drawn anew (`straighten`).
//! 4. Borders are halved, or not, so that each polygon has an even number of sides and a good cut into patches (`patterns`, `choose`).
//! 5. Polygons are cut (`disk`, `patches`).

mod choose;
mod disk;
mod features;
mod flips;
mod lines;
mod mesh;
mod numbers;
mod patch_fit;
mod patches;
mod patchwork;
mod patterns;
mod plan;
mod recut;
mod refine;
mod regions;
mod rungs;
mod straighten;
mod tidy_up;
mod trace;

use std::collections::BTreeSet;

use point_cloud::vec3::{add, scale};

use crate::edge::edge;
use crate::{LayoutError, QuadLayout, RawPatch};
pub use features::CreaseRule;
use mesh::WorkMesh;
use patchwork::Patchwork;
use plan::Plan;

/// How a layout is made.
#[derive(Clone, Debug, PartialEq)]
pub struct BuildOptions {
    /// Largest distance of a place from the seed of its region, as a share of the diagonal: fewer and larger patches with more.
    pub radius: f64,
    /// Which edges are creases.
    pub creases: CreaseRule,
    /// Whether neighbouring patches are cut anew where that makes fewer or better ones. Patches are smaller and follow a part more
    /// closely without.
    pub cut_anew: bool,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self { radius: 0.25, creases: CreaseRule::Auto, cut_anew: true }
    }
}

/// Rounds in which regions that cannot be cut are parted.
///
/// Limit: each takes as long as the first.
const ROUNDS: usize = 4;

/// Rounds in which patches are cut anew, and their borders drawn straight.
///
/// Limit: a third takes as long as the second; on `homer` it lowers the costs by 0.3 %, the second by 4 %.
const RECUTS: usize = 2;

/// Longest side of a patch, in radii of regions.
const LONGEST: f64 = 1.6;

impl QuadLayout {
    /// Cuts a closed mesh into patches of four sides: creases lie on arcs, and no smooth vertex has two patches. Vertices in one place
    /// must be one. The result does not depend on the number of threads.
    ///
    /// # Errors
    /// [`LayoutError`]: for meshes that are open, of several pieces, or not the surface of anything; [`LayoutError::NotCut`] where
    /// no layout was found.
    pub fn of_mesh(points: &[[f64; 3]], triangles: &[[u32; 3]], options: &BuildOptions) -> Result<Self, LayoutError> {
        let (mut mesh, centre, diagonal) = WorkMesh::of_diagonal_1(points, triangles)?;
        mesh.sharp = features::creases(&mesh, options.creases);
        refine::refine(&mut mesh);
        let tries = [true, false].map(|spans_narrow| (spans_narrow, mesh.clone()));
        let mut failure = LayoutError::NoMesh;
        for (spans_narrow, mesh) in tries {
            match cut(Plan::new(mesh, options.radius, spans_narrow), options) {
                Ok(work) => return Ok(finished(work)?.moved(|p| add(centre, scale(diagonal, p)))),
                Err(error) => failure = error,
            }
        }
        Err(failure)
    }
}

/// The edges of a mesh that are creases by a rule, the smaller vertex first. Vertices in one place must be one.
///
/// # Errors
/// [`LayoutError`]: for what is not the closed surface of anything.
pub fn creases(
    points: &[[f64; 3]],
    triangles: &[[u32; 3]],
    rule: CreaseRule,
) -> Result<BTreeSet<[u32; 2]>, LayoutError> {
    let (mesh, ..) = WorkMesh::of_diagonal_1(points, triangles)?;
    Ok(features::creases(&mesh, rule))
}

/// The patches of a plan. Regions that cannot be cut are parted.
fn cut(mut plan: Plan, options: &BuildOptions) -> Result<Patchwork, LayoutError> {
    let mut left = Vec::new();
    for _ in 0..ROUNDS {
        let mut work = plan.patchwork()?;
        work.straighten();
        let choice = choose::choose(&work);
        match patches::patches(&mut work, &choice) {
            Ok(patches) => {
                let work = improved(work, patches, options);
                tracing::info!(
                    regions = choice.cuts.len(),
                    patches = work.polygons.len(),
                    broken = work.broken(),
                    "layout"
                );
                return Ok(work);
            }
            Err(failed) => left = failed,
        }
        plan.part(&left)?;
    }
    Err(LayoutError::NotCut { regions: left.len(), reason: "their parts are no disks" })
}

/// Patches drawn anew as regions are, and cut anew if that is asked for.
fn improved(work: Patchwork, patches: Vec<RawPatch>, options: &BuildOptions) -> Patchwork {
    let sharp = Plan::sharp_edges(&work);
    let mut work = Patchwork::of_patches(work.points, work.given, patches, &sharp);
    work.straighten();
    for _ in 0..if options.cut_anew { RECUTS } else { 0 } {
        work = work.recut(LONGEST * options.radius);
        work.straighten();
    }
    work
}

/// The layout of patches.
fn finished(mut work: Patchwork) -> Result<QuadLayout, LayoutError> {
    let patches: Vec<RawPatch> = (0..work.polygons.len())
        .map(|number| patches::patch(work.sides_of(number), std::mem::take(&mut work.faces[number])))
        .collect();
    let sharp = Plan::sharp_edges(&work);
    let mut layout = QuadLayout::new(work.points, patches)?;
    let is_sharp = |path: &Vec<u32>| sharp.contains(&edge(path[0], path[1]));
    layout.creases = Some(layout.paths.iter().map(is_sharp).collect());
    layout.mapped_anew.clear();
    Ok(layout)
}
