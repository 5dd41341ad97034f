//! Refinement of marked cells, with surrounding cells, and meshes that stay admissible.

use std::ops::Range;

use crate::tensor::unravel;
use crate::{CellSpace, Error, HierarchicalMesh, HierarchicalSpace, Kind, KnotVector, MAX_LEVELS};

/// A place to refine: a cell, or one of the `2^D` equal parts that it is split into.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mark {
    /// Number of the cell.
    pub cell: usize,
    /// The part: bit d is set in the upper half of direction d. `None` for the cell as a whole.
    pub child: Option<u8>,
}

impl Mark {
    /// The cell as a whole.
    pub fn whole(cell: usize) -> Self {
        Self { cell, child: None }
    }

    /// Whether the marked part holds the lower and the upper half of a direction.
    fn halves(self, direction: usize) -> [bool; 2] {
        self.child.map_or([true; 2], |child| {
            let upper = (child >> direction) & 1 == 1;
            [!upper, upper]
        })
    }
}

/// How marked cells are refined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refinement<const D: usize> {
    /// Cells of the *next* level by which the marked region is extended on each side, per direction; the result is rounded
    /// outward to whole cells. Around a marked child 1 is the neighbour on the side of that child, 2 one ring of the cell's
    /// own level. In periodic directions the region goes on across the seam.
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
    /// The space on the mesh with the marked cells (by cell number) refined: [`HierarchicalSpace::refine_at`] for whole cells.
    ///
    /// # Errors
    /// As there.
    pub fn refine(&self, marked: &[usize], refinement: &Refinement<D>) -> Result<Self, Error> {
        let marks: Vec<Mark> = marked.iter().map(|&cell| Mark::whole(cell)).collect();
        self.refine_at(&marks, refinement)
    }

    /// The space on the mesh with the marked places refined. Cells that `max_levels` forbids to split are left as they are.
    ///
    /// # Errors
    /// [`Error::Shape`] for a cell that does not exist or an admissibility class below 2.
    pub fn refine_at(&self, marked: &[Mark], refinement: &Refinement<D>) -> Result<Self, Error> {
        if let Some(class) = refinement.admissible.filter(|&m| m < 2) {
            return Err(Error::Shape { what: "class of admissibility", given: class, expected: 2 });
        }
        let mut mesh = self.mesh().clone();
        for &mark in marked {
            let cell = mark.cell;
            if cell >= self.n_cells() {
                return Err(Error::Shape { what: "marked cell", given: cell, expected: self.n_cells() });
            }
            let node = self.node(cell);
            let level = self.mesh().level(node);
            if level + 1 >= refinement.max_levels.min(MAX_LEVELS) {
                continue;
            }
            let index = self.mesh().cell_index(node);
            // On the side where a child lies within its cell one cell of the next level is covered before the end.
            let reach = |d: usize| {
                let extension = refinement.extension[d];
                mark.halves(d).map(|near| if near { extension.div_ceil(2) } else { extension / 2 })
            };
            let neighbours =
                self.ranges(level, |d, knots: &KnotVector| knots.neighbourhood(index[d] as usize, reach(d)))?;
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

#[cfg(test)]
mod tests {
    use super::*;

    fn space(degree: usize) -> HierarchicalSpace<2> {
        let knots = KnotVector::uniform(degree, 8).unwrap();
        HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap()
    }

    /// The cells of level 0, by column and row, that refining around a child of the cell in column 3 and row 3 splits.
    fn split(child: Option<u8>, extension: usize) -> Vec<[u32; 2]> {
        let coarse = space(2);
        let cell = coarse.locate_cell([3.5 / 8.0; 2]).unwrap();
        let refinement = Refinement { extension: [extension; 2], ..Refinement::default() };
        let fine = coarse.refine_at(&[Mark { cell, child }], &refinement).unwrap();
        let places = (0..64).map(|i| [i % 8, i / 8]);
        places.filter(|&index| fine.mesh().find(0, index).is_some_and(|node| !fine.mesh().is_leaf(node))).collect()
    }

    #[test]
    fn a_region_goes_as_far_as_the_extension_of_the_child() {
        assert_eq!(split(Some(0), 0), [[3, 3]]);
        assert_eq!(split(Some(0), 1), [[2, 2], [3, 2], [2, 3], [3, 3]]);
        assert_eq!(split(Some(1), 1), [[3, 2], [4, 2], [3, 3], [4, 3]]);
        assert_eq!(split(Some(3), 1), [[3, 3], [4, 3], [3, 4], [4, 4]]);
        // Even extensions are those of the cell.
        for child in 0..4 {
            assert_eq!(split(Some(child), 2), split(None, 2));
        }
        assert_eq!(split(None, 1), split(None, 2));
        assert_eq!(split(Some(2), 3).len(), 16);
    }

    #[test]
    fn half_the_degree_is_the_least_extension_with_which_functions_fit_in() {
        for degree in 1..=6 {
            let coarse = space(degree);
            let mark = Mark { cell: coarse.locate_cell([3.5 / 8.0; 2]).unwrap(), child: Some(2) };
            let functions = |extension: usize| {
                let refinement = Refinement { extension: [extension; 2], ..Refinement::default() };
                coarse.refine_at(&[mark], &refinement).unwrap().n_functions()
            };
            assert!(functions(degree / 2) > coarse.n_functions(), "degree {degree}");
            assert!(degree < 2 || functions(degree / 2 - 1) == coarse.n_functions(), "degree {degree}");
        }
    }
}
