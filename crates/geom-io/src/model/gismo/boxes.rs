//! The mesh as boxes of leaf cells.

use std::collections::{BTreeMap, HashSet};

use thb_core::{HierarchicalMesh, NodeId};

use crate::model::ModelErrorKind;

/// A box of cells of one level: lower corner, and upper corner exclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct LevelBox<const D: usize> {
    pub(super) level: usize,
    pub(super) lower: [u32; D],
    pub(super) upper: [u32; D],
}

/// Cells in boxes per coefficient of a map, beyond which the boxes are taken for damaged. Refined regions that are too
/// small to hold functions of their own have cells without adding coefficients, but never that many.
const CELLS_PER_COEFFICIENT: u64 = 64;

/// Cells that are possible with any number of coefficients: those of a small mesh refined to the last level at one spot.
const FREE_CELLS: u64 = 4096;

impl<const D: usize> LevelBox<D> {
    fn n_cells(&self) -> u64 {
        (0..D).fold(1, |product: u64, d| product.saturating_mul(u64::from(self.upper[d] - self.lower[d])))
    }

    fn cells(self) -> impl Iterator<Item = [u32; D]> {
        (0..self.n_cells()).map(move |mut linear| {
            std::array::from_fn(|d| {
                let width = u64::from(self.upper[d] - self.lower[d]);
                let i = (linear % width) as u32;
                linear /= width;
                self.lower[d] + i
            })
        })
    }
}

/// The leaf cells above level 0 as few boxes: runs along the first direction, equal runs joined along the others.
pub(super) fn boxes_of_mesh<const D: usize>(mesh: &HierarchicalMesh<D>) -> Vec<LevelBox<D>> {
    let mut boxes: Vec<LevelBox<D>> = mesh
        .leaves()
        .into_iter()
        .map(|node: NodeId| (mesh.level(node), mesh.cell_index(node)))
        .filter(|(level, _)| *level > 0)
        .map(|(level, lower)| LevelBox { level, lower, upper: lower.map(|i| i + 1) })
        .collect();
    for d in 0..D {
        // By everything but the extent in direction d, then by its start: what can be joined is then adjacent.
        let key = |b: &LevelBox<D>| {
            let (mut lower, mut upper) = (b.lower, b.upper);
            (lower[d], upper[d]) = (0, 0);
            (b.level, lower, upper, b.lower[d])
        };
        boxes.sort_unstable_by_key(key);
        let mut joined: Vec<LevelBox<D>> = Vec::with_capacity(boxes.len());
        for next in boxes {
            let same =
                |k: usize, a: &LevelBox<D>| k == d || (a.lower[k] == next.lower[k] && a.upper[k] == next.upper[k]);
            match joined.last_mut() {
                Some(a) if a.level == next.level && a.upper[d] == next.lower[d] && (0..D).all(|k| same(k, a)) => {
                    a.upper[d] = next.upper[d];
                }
                _ => joined.push(next),
            }
        }
        boxes = joined;
    }
    boxes.sort_unstable_by_key(|b| {
        let (mut lower, mut upper) = (b.lower, b.upper);
        lower.reverse();
        upper.reverse();
        (b.level, lower, upper)
    });
    boxes
}

/// Refines a mesh so that the cells of each box exist. Boxes may overlap; the finer one counts.
///
/// # Errors
/// [`ModelErrorKind::BoxAlignment`], [`ModelErrorKind::TooLarge`], and what the mesh says.
pub(super) fn refine_to_boxes<const D: usize>(
    mesh: &mut HierarchicalMesh<D>,
    boxes: &[LevelBox<D>],
    n_coefficients: usize,
) -> Result<(), ModelErrorKind> {
    let given = boxes.iter().fold(0_u64, |sum, b| sum.saturating_add(b.n_cells()));
    let limit = FREE_CELLS + CELLS_PER_COEFFICIENT * n_coefficients as u64;
    if given > limit {
        return Err(ModelErrorKind::TooLarge { what: "number of cells in all boxes", given, limit });
    }
    let mut covered: BTreeMap<usize, HashSet<[u32; D]>> = BTreeMap::new();
    for b in boxes.iter().filter(|b| b.level > 0) {
        for cell in b.cells() {
            if covered.entry(b.level).or_default().insert(cell) {
                mesh.split(b.level - 1, cell.map(|i| i >> 1))?;
            }
        }
    }
    // A leaf that no box of its level covers was made by its siblings: their parent is covered in part only.
    for leaf in mesh.leaves() {
        let (level, cell) = (mesh.level(leaf), mesh.cell_index(leaf));
        if level > 0 && !covered.get(&level).is_some_and(|cells| cells.contains(&cell)) {
            return Err(ModelErrorKind::BoxAlignment { level, cell: cell.map(|i| i >> 1).to_vec() });
        }
    }
    Ok(())
}
