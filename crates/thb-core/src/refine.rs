//! Refinement of marked cells, with surrounding cells, and meshes that stay admissible.

use std::ops::Range;

use crate::tensor::unravel;
use crate::{CellSpace, Error, HierarchicalMesh, HierarchicalSpace, Kind, KnotVector, MAX_LEVELS};

/// How marked cells are refined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refinement<const D: usize> {
    /// Cells of the *next* level by which the region of a marked cell is extended on each side, per direction; the result
    /// is rounded outward to whole cells. 2 is one ring of the marked cell's own level, 4 two rings. In periodic directions
    /// the region goes on across the seam.
    pub extension: [usize; D],
    /// Keep the mesh admissible of this class (at least 2): on each cell, at most that many successive levels of
    /// functions do not vanish (Buffa & Giannelli 2016).
    pub admissible: Option<usize>,
    /// Largest number of levels; cells of the finest level are not split.
    pub max_levels: usize,
}

impl<const D: usize> Default for Refinement<D> {
    fn default() -> Self {
        Self { extension: [0; D], admissible: None, max_levels: MAX_LEVELS }
    }
}

impl<const D: usize> HierarchicalSpace<D> {
    /// The space on the mesh with the marked cells (by cell number) refined. Cells that `max_levels` forbids to split
    /// are left as they are.
    ///
    /// # Errors
    /// [`Error::Shape`] for a cell that does not exist or an admissibility class below 2.
    pub fn refine(&self, marked: &[usize], refinement: &Refinement<D>) -> Result<Self, Error> {
        if let Some(class) = refinement.admissible.filter(|&m| m < 2) {
            return Err(Error::Shape { what: "class of admissibility", given: class, expected: 2 });
        }
        let mut mesh = self.mesh().clone();
        for &cell in marked {
            if cell >= self.n_cells() {
                return Err(Error::Shape { what: "marked cell", given: cell, expected: self.n_cells() });
            }
            let node = self.node(cell);
            let level = self.mesh().level(node);
            if level + 1 >= refinement.max_levels.min(MAX_LEVELS) {
                continue;
            }
            let index = self.mesh().cell_index(node);
            let rings = refinement.extension.map(|cells| cells.div_ceil(2));
            let neighbours =
                self.ranges(level, |d, knots: &KnotVector| knots.neighbourhood(index[d] as usize, rings[d]))?;
            let grid = self.mesh().grid(level);
            for_each_in_box(neighbours, grid, |cell| self.split(&mut mesh, level, cell, refinement.admissible))?;
        }
        self.with_mesh(mesh)
    }

    /// Splits a cell, and before it the cells that must not stay coarser next to it (Buffa & Giannelli 2016,
    /// Algorithm 3): those of level ℓ−m+1 under the support extension at level ℓ−m+2, or at level ℓ−m+1 for HB-splines.
    fn split(
        &self,
        mesh: &mut HierarchicalMesh<D>,
        level: usize,
        index: [u32; D],
        admissible: Option<usize>,
    ) -> Result<(), Error> {
        let Some(class) = admissible else {
            return mesh.split(level, index);
        };
        match mesh.find(level, index) {
            Some(node) if !mesh.is_leaf(node) => return Ok(()),
            Some(_) => {}
            None => self.split(mesh, level - 1, index.map(|i| i >> 1), admissible)?,
        }
        if let Some(coarse) = (level + 1).checked_sub(class) {
            let extension_level = if self.kind() == Kind::Thb { coarse + 1 } else { coarse };
            let around = index.map(|i| i >> (level - extension_level));
            let extension =
                self.ranges(extension_level, |d, knots: &KnotVector| knots.support_extension(around[d] as usize))?;
            let (grid, shift) = (mesh.grid(extension_level), extension_level - coarse);
            for_each_in_box(extension, grid, |cell| self.split(mesh, coarse, cell.map(|i| i >> shift), admissible))?;
        }
        mesh.split(level, index)
    }

    /// A range of spans of a level per direction.
    fn ranges(
        &self,
        level: usize,
        of: impl Fn(usize, &KnotVector) -> Range<usize>,
    ) -> Result<[Range<usize>; D], Error> {
        let mut ranges = std::array::from_fn(|_| 0..0);
        for (d, range) in ranges.iter_mut().enumerate() {
            *range = of(d, self.knots(level, d)?);
        }
        Ok(ranges)
    }
}

/// Calls `each` for the cells of a box. Indices beyond the grid are those of periodic directions and wrap.
fn for_each_in_box<const D: usize>(
    ranges: [Range<usize>; D],
    grid: [usize; D],
    mut each: impl FnMut([u32; D]) -> Result<(), Error>,
) -> Result<(), Error> {
    let counts: [usize; D] = std::array::from_fn(|d| ranges[d].len());
    for linear in 0..counts.iter().product() {
        let offset = unravel(linear, counts);
        each(std::array::from_fn(|d| ((ranges[d].start + offset[d]) % grid[d]) as u32))?;
    }
    Ok(())
}
