//! The space of continuous splines on glued patches.

use std::collections::hash_map::Entry;
use std::sync::Arc;

use ndarray::{Array2, ArrayView2};
use rustc_hash::FxHashMap;

use super::numbering::Numbering;
use super::{PatchTopology, TopologyError};
use crate::{Cell, CellSpace, Error, Extraction, HierarchicalSpace, Kind, KnotVector, SplineMap};

/// A parameter of a surface of several patches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchPlace {
    /// The patch.
    pub patch: u32,
    /// The place in its unit square.
    pub u: [f64; 2],
}

/// Pattern number of cells whose functions are the local B-splines themselves.
const IDENTITY: u32 = u32::MAX;

/// Splines on glued patches, continuous across arcs: on each patch the B-splines of one degree on open uniform knots, and functions that
/// have the same trace on an arc, or the same value at a vertex, made one.
///
/// Each patch is a [`HierarchicalSpace`] of its own, for now of one level; cells are numbered patch by patch, each as in its space.
#[derive(Clone, Debug)]
pub struct MultiPatchSpace {
    topology: Arc<PatchTopology>,
    degree: usize,
    elements: Vec<usize>,
    patches: Vec<Arc<HierarchicalSpace<2>>>,
    numbering: Numbering,
    /// Of each patch the number of each of its functions.
    numbers: Vec<Vec<u32>>,
    /// The first cell of each patch, and the number of all cells.
    first_cell: Vec<usize>,
    patch_of_cell: Vec<u32>,
    /// Functions of cell `c`: `functions[offsets[c]..offsets[c + 1]]`.
    offsets: Vec<usize>,
    functions: Vec<u32>,
    /// Extraction of each cell: `IDENTITY` or a number into `patterns`. Equal matrices are stored once.
    pattern: Vec<u32>,
    patterns: Vec<Box<[f64]>>,
}

impl MultiPatchSpace {
    /// The space of a degree with a number of elements along each arc, one knot of multiplicity 1 between two of them.
    ///
    /// # Errors
    /// [`Error::Topology`] if opposite sides of a patch have different numbers of elements; [`Error::Degree`],
    /// [`Error::Elements`]; [`Error::Shape`] for a wrong number of arcs.
    pub fn new(topology: Arc<PatchTopology>, degree: usize, elements: Vec<usize>) -> Result<Self, Error> {
        let (given, expected) = (elements.len(), topology.arcs().len());
        if given != expected {
            return Err(Error::Shape { what: "arcs with a number of elements", given, expected });
        }
        let mut known: FxHashMap<[usize; 2], Arc<HierarchicalSpace<2>>> = FxHashMap::default();
        let mut patches = Vec::with_capacity(topology.patches().len());
        for (patch, sides) in topology.patches().iter().enumerate() {
            let of = sides.map(|side| elements[side.arc as usize]);
            if let Some(side) = [0, 1].into_iter().find(|&side| of[side] != of[side + 2]) {
                let (first, second) = (of[side], of[side + 2]);
                return Err(TopologyError::UnequalElements { patch, first, second }.into());
            }
            patches.push(match known.entry([of[0], of[1]]) {
                Entry::Occupied(same) => Arc::clone(same.get()),
                Entry::Vacant(free) => {
                    let knots = [KnotVector::uniform(degree, of[0])?, KnotVector::uniform(degree, of[1])?];
                    Arc::clone(free.insert(Arc::new(HierarchicalSpace::new(Kind::Thb, knots)?)))
                }
            });
        }
        let numbering = Numbering::new(&topology, elements.iter().map(|n| n + degree).collect());
        if numbering.total() >= IDENTITY as usize {
            return Err(Error::Elements { given: numbering.total(), limit: IDENTITY as usize - 1 });
        }
        let numbers = (0..patches.len()).map(|patch| numbering.of_patch(&topology, patch)).collect();
        let mut space = Self {
            topology,
            degree,
            elements,
            patches,
            numbering,
            numbers,
            first_cell: vec![0],
            patch_of_cell: Vec::new(),
            offsets: vec![0],
            functions: Vec::new(),
            pattern: Vec::new(),
            patterns: Vec::new(),
        };
        space.glue_cells();
        Ok(space)
    }

    /// The same with `elements` along every arc.
    ///
    /// # Errors
    /// Those of [`MultiPatchSpace::new`].
    pub fn uniform(topology: Arc<PatchTopology>, degree: usize, elements: usize) -> Result<Self, Error> {
        let arcs = topology.arcs().len();
        Self::new(topology, degree, vec![elements; arcs])
    }

    /// Carries the functions of each cell over to their common numbers: increasing, with the rows of the extraction in that order.
    fn glue_cells(&mut self) {
        let mut known: FxHashMap<Vec<u64>, u32> = FxHashMap::default();
        for (patch, space) in self.patches.iter().enumerate() {
            for number in 0..space.n_cells() {
                let cell = space.cell(number);
                let n_local = cell.n_local();
                let mut order: Vec<(u32, usize)> =
                    cell.functions.iter().zip(0..).map(|(&f, row)| (self.numbers[patch][f as usize], row)).collect();
                order.sort_unstable();
                let entry = |row: usize, column: usize| match cell.extraction {
                    Extraction::Identity => f64::from(u8::from(row == column)),
                    Extraction::Matrix(matrix) => matrix[row * n_local + column],
                };
                self.functions.extend(order.iter().map(|(function, _)| function));
                self.offsets.push(self.functions.len());
                self.patch_of_cell.push(patch as u32);
                let is_in_place = order.iter().enumerate().all(|(place, (_, row))| place == *row);
                if is_in_place && matches!(cell.extraction, Extraction::Identity) {
                    self.pattern.push(IDENTITY);
                    continue;
                }
                let entry = &entry;
                let rows = order.iter().flat_map(|&(_, row)| (0..n_local).map(move |column| entry(row, column)));
                let matrix: Vec<f64> = rows.collect();
                let key = matrix.iter().map(|x| x.to_bits()).collect();
                let patterns = &mut self.patterns;
                self.pattern.push(*known.entry(key).or_insert_with(|| {
                    patterns.push(matrix.into_boxed_slice());
                    patterns.len() as u32 - 1
                }));
            }
            self.first_cell.push(self.patch_of_cell.len());
        }
    }

    /// The patches and how they are glued.
    pub fn topology(&self) -> &Arc<PatchTopology> {
        &self.topology
    }

    /// Number of patches.
    pub fn n_patches(&self) -> usize {
        self.patches.len()
    }

    /// The space of a patch by itself, on the unit square.
    pub fn patch(&self, patch: usize) -> &Arc<HierarchicalSpace<2>> {
        &self.patches[patch]
    }

    /// The number of each function of a patch's own space.
    pub fn numbers(&self, patch: usize) -> &[u32] {
        &self.numbers[patch]
    }

    /// Number of elements along an arc.
    pub fn elements(&self, arc: usize) -> usize {
        self.elements[arc]
    }

    /// The functions that do not vanish on an arc, from its start to its end: on it they are the B-splines of [`Self::arc_knots`].
    pub fn arc_functions(&self, arc: usize) -> Vec<u32> {
        self.numbering.on_arc(&self.topology, arc)
    }

    /// The knots along an arc, from 0 at its start to 1 at its end.
    ///
    /// # Errors
    /// None that [`Self::new`] has not met.
    pub fn arc_knots(&self, arc: usize) -> Result<KnotVector, Error> {
        KnotVector::uniform(self.degree, self.elements[arc])
    }

    /// The patch of a cell.
    pub fn patch_of_cell(&self, cell: usize) -> usize {
        self.patch_of_cell[cell] as usize
    }

    /// The cells of a patch.
    pub fn cells_of_patch(&self, patch: usize) -> std::ops::Range<usize> {
        self.first_cell[patch]..self.first_cell[patch + 1]
    }

    /// The cell that holds a place.
    ///
    /// # Errors
    /// [`Error::OutsideDomain`], also for NaN; [`Error::NoSuchPatch`].
    pub fn locate(&self, place: PatchPlace) -> Result<usize, Error> {
        let patch = place.patch as usize;
        let Some(space) = self.patches.get(patch) else {
            return Err(Error::NoSuchPatch { patch, patches: self.patches.len() });
        };
        Ok(self.first_cell[patch] + space.locate_cell(place.u)?)
    }

    /// A patch of the map with the given coefficients, `(n_functions, N)`, as a map of its own.
    ///
    /// # Errors
    /// Those of [`SplineMap::new`].
    pub fn patch_map(&self, patch: usize, coefficients: ArrayView2<'_, f64>) -> Result<SplineMap<2>, Error> {
        let (given, expected) = (coefficients.nrows(), self.n_functions());
        if given != expected {
            return Err(Error::Shape { what: "rows of coefficients", given, expected });
        }
        let numbers = &self.numbers[patch];
        let own = Array2::from_shape_fn((numbers.len(), coefficients.ncols()), |(i, k)| {
            coefficients[[numbers[i] as usize, k]]
        });
        SplineMap::new(Arc::clone(&self.patches[patch]), own)
    }

    /// Checks that every function is met, that functions of cells are increasing and sum to one, and that the numbers of functions
    /// are those of the formula V + Σ_arcs (m − 2) + Σ_patches (m − 2) (n − 2). For tests.
    ///
    /// # Errors
    /// A sentence that names the first property found violated.
    pub fn check_invariants(&self) -> Result<(), String> {
        let mut met = vec![false; self.n_functions()];
        for number in 0..self.n_cells() {
            let cell = self.cell(number);
            if !cell.functions.is_sorted_by(|a, b| a < b) {
                return Err(format!("the functions of cell {number} are not increasing"));
            }
            cell.functions.iter().for_each(|&f| met[f as usize] = true);
            if let Extraction::Matrix(matrix) = cell.extraction {
                let n_local = cell.n_local();
                if matrix.len() != cell.functions.len() * n_local {
                    return Err(format!("the extraction of cell {number} has a wrong size"));
                }
                for j in 0..n_local {
                    let sum: f64 = matrix.iter().skip(j).step_by(n_local).sum();
                    if (sum - 1.0).abs() > 1e-13 {
                        return Err(format!("column {j} of the extraction of cell {number} sums to {sum}"));
                    }
                }
            }
        }
        if let Some(function) = met.iter().position(|met| !met) {
            return Err(format!("function {function} is met on no cell"));
        }
        let inside = |arc: u32| self.elements[arc as usize] + self.degree - 2;
        let on_arcs: usize = (0..self.elements.len()).map(|arc| inside(arc as u32)).sum();
        let in_patches: usize = self.topology.patches().iter().map(|s| inside(s[0].arc) * inside(s[1].arc)).sum();
        let expected = self.topology.n_vertices() + on_arcs + in_patches;
        if self.n_functions() != expected {
            return Err(format!("{} functions, not {expected}", self.n_functions()));
        }
        Ok(())
    }
}

impl CellSpace<2> for MultiPatchSpace {
    fn n_functions(&self) -> usize {
        self.numbering.total()
    }

    fn degree(&self) -> [usize; 2] {
        [self.degree; 2]
    }

    fn n_cells(&self) -> usize {
        self.patch_of_cell.len()
    }

    fn cell(&self, cell: usize) -> Cell<'_, 2> {
        let patch = self.patch_of_cell[cell] as usize;
        let own = self.patches[patch].cell(cell - self.first_cell[patch]);
        Cell {
            functions: &self.functions[self.offsets[cell]..self.offsets[cell + 1]],
            extraction: match self.pattern[cell] {
                IDENTITY => Extraction::Identity,
                pattern => Extraction::Matrix(&self.patterns[pattern as usize]),
            },
            ..own
        }
    }
}
