//! HB- and THB-spline spaces: active functions and the extraction of each leaf cell.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::level::Level;
use crate::tensor::{ravel, spans_at, unravel};
use crate::{Cell, CellSpace, Error, Extraction, HierarchicalMesh, KnotVector, MAX_LEVELS, NodeId, ParameterBox};

/// Which basis spans the hierarchical space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Hierarchical B-splines, Imperatore 2024, (2.9): linearly independent, but without partition of unity.
    Hb,
    /// Truncated hierarchical B-splines, (2.13): the same space, partition of unity, smaller supports.
    Thb,
}

/// Status of a B-spline whose support lies in Ω^ℓ; B-splines that are absent from the maps reach out of it.
const PASSIVE: u32 = u32::MAX;

/// The pattern number of cells whose functions are the local B-splines themselves.
const IDENTITY: u32 = u32::MAX;

/// One direction of all levels that exist so far; shared by a space and its refinements.
type Levels<const D: usize> = Vec<Arc<[Level; D]>>;

/// A hierarchical spline space. Functions are numbered by level, then by tensor index with the first direction fastest;
/// cells depth first ([`HierarchicalMesh::leaves`]).
#[derive(Clone, Debug)]
pub struct HierarchicalSpace<const D: usize> {
    kind: Kind,
    levels: Levels<D>,
    mesh: HierarchicalMesh<D>,
    /// Tensor indices of the active functions of each level, increasing.
    active: Vec<Vec<u64>>,
    /// Leaf cells, with the cell number of each node that is a leaf.
    cells: Vec<NodeId>,
    cell_of_node: Vec<u32>,
    /// Functions of cell `c`: `functions[offsets[c]..offsets[c + 1]]`.
    offsets: Vec<usize>,
    functions: Vec<u32>,
    /// Extraction of each cell: `IDENTITY` or a number into `patterns`. Equal matrices are stored once.
    pattern: Vec<u32>,
    patterns: Vec<Box<[f64]>>,
}

impl<const D: usize> HierarchicalSpace<D> {
    /// The unrefined space: tensor-product B-splines of the given knots.
    ///
    /// # Errors
    /// [`Error::Elements`] if there are too many cells.
    pub fn new(kind: Kind, knots: [KnotVector; D]) -> Result<Self, Error> {
        let mesh = HierarchicalMesh::new(std::array::from_fn(|d| knots[d].n_spans()))?;
        Self::build(kind, vec![Arc::new(knots.map(Level::new))], mesh)
    }

    /// The space of this space's knots and kind on another mesh.
    ///
    /// # Errors
    /// [`Error::NotNested`] if level 0 of the mesh has another number of cells.
    pub fn with_mesh(&self, mesh: HierarchicalMesh<D>) -> Result<Self, Error> {
        if mesh.grid(0) != self.mesh.grid(0) {
            return Err(Error::NotNested { reason: "the grids of level 0 differ" });
        }
        Self::build(self.kind, self.levels.clone(), mesh)
    }

    fn build(kind: Kind, mut levels: Levels<D>, mesh: HierarchicalMesh<D>) -> Result<Self, Error> {
        if mesh.n_levels() > MAX_LEVELS {
            return Err(Error::TooManyLevels { given: mesh.n_levels() - 1, limit: MAX_LEVELS - 1 });
        }
        while levels.len() < mesh.n_levels() {
            let coarse = &levels[levels.len() - 1];
            let fine = std::array::from_fn(|d| coarse[d].knots.refined());
            let grid = mesh.grid(levels.len());
            let is_short = |d: usize| fine[d].n_spans() != grid[d] || fine[d].vanishing_span().is_some();
            if let Some(direction) = (0..D).find(|&d| is_short(d)) {
                return Err(Error::SpanTooNarrow { direction, level: levels.len() });
            }
            levels.push(Arc::new(fine.map(Level::new)));
        }
        let mut space = Self {
            kind,
            levels,
            cells: mesh.leaves(),
            cell_of_node: vec![u32::MAX; mesh.n_nodes()],
            mesh,
            active: Vec::new(),
            offsets: vec![0],
            functions: Vec::new(),
            pattern: Vec::new(),
            patterns: Vec::new(),
        };
        for (cell, node) in space.cells.iter().enumerate() {
            space.cell_of_node[node.index()] = cell as u32;
        }
        let status = space.select_functions()?;
        space.extract_cells(&status);
        Ok(space)
    }

    /// Selects the active functions, (2.10): support in Ω^ℓ but not in Ω^{ℓ+1}. Returns for each level the number of
    /// each B-spline with support in Ω^ℓ, `PASSIVE` where it is not active.
    fn select_functions(&mut self) -> Result<Vec<FxHashMap<u64, u32>>, Error> {
        let mut n_functions = 0_usize;
        let mut all_status = Vec::with_capacity(self.n_levels());
        // Cells of Ω^ℓ in the support of each B-spline, and whether one of them is a leaf.
        let mut seen: Vec<FxHashMap<u64, (u32, bool)>> = vec![FxHashMap::default(); self.n_levels()];
        for node in self.mesh.nodes() {
            let leaf = self.mesh.is_leaf(node);
            let level_seen = &mut seen[self.mesh.level(node)];
            self.for_each_local(node, |_, function| {
                let entry = level_seen.entry(function).or_insert((0, false));
                entry.0 += 1;
                entry.1 |= leaf;
            });
        }
        for (level, level_seen) in seen.into_iter().enumerate() {
            let counts = self.function_counts(level);
            let mut status = FxHashMap::default();
            let mut active = Vec::new();
            for (function, (cells, has_leaf)) in level_seen {
                let index = unravel(function as usize, counts);
                let support: usize = (0..D).map(|d| self.levels[level][d].knots.support(index[d]).len()).product();
                if cells as usize == support {
                    status.insert(function, PASSIVE);
                    if has_leaf {
                        active.push(function);
                    }
                }
            }
            active.sort_unstable();
            for (i, &function) in active.iter().enumerate() {
                status.insert(function, (n_functions + i) as u32);
            }
            n_functions += active.len();
            if n_functions >= PASSIVE as usize {
                return Err(Error::Elements { given: n_functions, limit: PASSIVE as usize - 1 });
            }
            self.active.push(active);
            all_status.push(status);
        }
        Ok(all_status)
    }

    /// Fills functions and extraction of all leaf cells.
    fn extract_cells(&mut self, status: &[FxHashMap<u64, u32>]) {
        let n_local = self.n_local();
        let mut known: FxHashMap<Vec<u64>, u32> = FxHashMap::default();
        let mut path: Vec<(NodeId, LocalRows)> = Vec::new();
        for root in self.mesh.roots() {
            path.push((root, self.own_rows(root, LocalRows::default(), status)));
            while let Some((node, rows)) = path.pop() {
                if !self.mesh.is_leaf(node) {
                    let children: Vec<_> = self.mesh.children(node).collect();
                    for &child in children.iter().rev() {
                        let below = self.subdivided(child, &rows);
                        path.push((child, self.own_rows(child, below, status)));
                    }
                    continue;
                }
                let identity = rows.functions.len() == n_local && rows.is_identity(n_local);
                self.functions.extend_from_slice(&rows.functions);
                self.offsets.push(self.functions.len());
                self.pattern.push(if identity {
                    IDENTITY
                } else {
                    let next = self.patterns.len() as u32;
                    let key = rows.weights.iter().map(|w| w.to_bits()).collect();
                    *known.entry(key).or_insert_with(|| {
                        self.patterns.push(rows.weights.clone().into_boxed_slice());
                        next
                    })
                });
            }
        }
    }

    /// The rows of a coarser cell, expressed in the B-splines of one of its children.
    fn subdivided(&self, child: NodeId, rows: &LocalRows) -> LocalRows {
        let mut weights = rows.weights.clone();
        for row in weights.chunks_exact_mut(self.n_local().max(1)) {
            self.subdivide(child, row, 1);
        }
        LocalRows { functions: rows.functions.clone(), weights }
    }

    /// Subdivides local B-spline coefficients, `(n_local, n)`, from the parent of a cell to the cell.
    pub(crate) fn subdivide(&self, child: NodeId, coefficients: &mut [f64], n: usize) {
        let (level, index) = (self.mesh.level(child), self.mesh.cell_index(child));
        for d in 0..D {
            let matrix = self.levels[level - 1][d].subdivision(index[d] as usize);
            apply_along(&self.degree(), n, d, matrix, coefficients);
        }
    }

    /// Truncates the rows of coarser functions with respect to the cell's level, (2.11), drops those that vanish, and
    /// appends the active functions of the level.
    fn own_rows(&self, node: NodeId, coarse: LocalRows, status: &[FxHashMap<u64, u32>]) -> LocalRows {
        let n_local = self.n_local();
        let mut own = vec![None; n_local];
        let level_status = &status[self.mesh.level(node)];
        self.for_each_local(node, |local, function| own[local] = level_status.get(&function).copied());
        let mut rows = LocalRows::default();
        for (mut row, function) in coarse.weights.chunks_exact(n_local).map(<[f64]>::to_vec).zip(coarse.functions) {
            if self.kind == Kind::Thb {
                for (weight, inside) in row.iter_mut().zip(&own) {
                    if inside.is_some() {
                        *weight = 0.0;
                    }
                }
            }
            // Weights of knot insertion are non-negative with exact zeros, so this is no question of tolerance.
            if row.iter().any(|&weight| weight != 0.0) {
                rows.functions.push(function);
                rows.weights.extend(row);
            }
        }
        let numbered = |(local, function): (usize, Option<u32>)| Some((function.filter(|&f| f != PASSIVE)?, local));
        let mut active: Vec<(u32, usize)> = own.into_iter().enumerate().filter_map(numbered).collect();
        // Functions across a seam come first in number but not in place: the extraction is a permutation there.
        active.sort_unstable();
        for (function, local) in active {
            rows.functions.push(function);
            rows.weights.extend((0..n_local).map(|j| f64::from(u8::from(j == local))));
        }
        rows
    }

    /// Calls `each(local index, tensor index)` for the B-splines of a cell's level that do not vanish on it.
    fn for_each_local(&self, node: NodeId, mut each: impl FnMut(usize, u64)) {
        let level = self.mesh.level(node);
        let index = self.mesh.cell_index(node);
        let counts = self.function_counts(level);
        let orders = self.degree().map(|p| p + 1);
        let directions = &self.levels[level];
        for local in 0..self.n_local() {
            let offset = unravel(local, orders);
            let function = |d: usize| directions[d].knots.function(index[d] as usize, offset[d]);
            each(local, ravel(std::array::from_fn(function), counts) as u64);
        }
    }

    /// Changes local B-spline coefficients, `(n_local, n)`, of a cell into those of a space with opened knots.
    pub(crate) fn open_local(&self, opened: &Self, node: NodeId, coefficients: &mut [f64], n: usize) {
        let (level, index) = (self.mesh.level(node), self.mesh.cell_index(node));
        for d in 0..D {
            let (own, target) = (&self.levels[level][d], &opened.levels[level][d].knots);
            if own.knots.is_periodic() && !target.is_periodic() {
                apply_along(&self.degree(), n, d, &own.opening(target, index[d] as usize), coefficients);
            }
        }
    }

    /// The space on open knots with the same mesh: it holds all functions of this space, cut at the seams of its periodic
    /// directions. [`crate::transfer`] carries maps over.
    ///
    /// # Errors
    /// [`Error::Elements`] if the functions cannot be counted in 32 bits.
    pub fn opened(&self) -> Result<Self, Error> {
        let knots = std::array::from_fn(|d| self.levels[0][d].knots.opened());
        Self::build(self.kind, vec![Arc::new(knots.map(Level::new))], self.mesh.clone())
    }

    /// Whether the basis is truncated.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// The mesh.
    pub fn mesh(&self) -> &HierarchicalMesh<D> {
        &self.mesh
    }

    /// Number of levels that have cells.
    pub fn n_levels(&self) -> usize {
        self.mesh.n_levels()
    }

    /// The knots of a level in a direction.
    ///
    /// # Errors
    /// [`Error::TooManyLevels`] for a level that the mesh does not have.
    pub fn knots(&self, level: usize, direction: usize) -> Result<&KnotVector, Error> {
        let limit = self.n_levels() - 1;
        match self.levels.get(level) {
            Some(directions) if level <= limit => Ok(&directions[direction].knots),
            _ => Err(Error::TooManyLevels { given: level, limit }),
        }
    }

    /// Active functions of a level as tensor indices (first direction fastest), increasing.
    pub fn active_functions(&self, level: usize) -> &[u64] {
        self.active.get(level).map_or(&[], Vec::as_slice)
    }

    /// Number of active functions of each level.
    pub fn functions_per_level(&self) -> Vec<usize> {
        self.active.iter().map(Vec::len).collect()
    }

    /// The number of the first active function of a level.
    pub fn first_of_level(&self, level: usize) -> usize {
        self.active[..level.min(self.active.len())].iter().map(Vec::len).sum()
    }

    /// Number of B-splines of a level per direction.
    pub fn function_counts(&self, level: usize) -> [usize; D] {
        std::array::from_fn(|d| self.levels[level][d].knots.n_functions())
    }

    /// The node of a cell.
    pub fn node(&self, cell: usize) -> NodeId {
        self.cells[cell]
    }

    /// The cell of a node, if it is a leaf.
    pub fn cell_of_node(&self, node: NodeId) -> Option<usize> {
        self.cell_of_node.get(node.index()).filter(|&&cell| cell != u32::MAX).map(|&cell| cell as usize)
    }

    /// Number of different extraction matrices, the identity not counted.
    pub fn n_patterns(&self) -> usize {
        self.patterns.len()
    }

    pub(crate) fn n_local(&self) -> usize {
        self.degree().iter().map(|p| p + 1).product()
    }

    /// Checks the mesh and the defining properties of the basis on it. For tests and fuzzing.
    ///
    /// # Errors
    /// A sentence that names the first property found violated.
    pub fn check_invariants(&self) -> Result<(), String> {
        self.mesh.check_invariants()?;
        let mut met = vec![false; self.n_functions()];
        for number in 0..self.n_cells() {
            let cell = self.cell(number);
            let n_local = cell.n_local();
            if !cell.functions.is_sorted_by(|a, b| a < b) {
                return Err(format!("the functions of cell {number} are not increasing"));
            }
            cell.functions.iter().for_each(|&f| met[f as usize] = true);
            if let Extraction::Matrix(matrix) = cell.extraction {
                if matrix.len() != cell.functions.len() * n_local {
                    return Err(format!("the extraction of cell {number} has a wrong size"));
                }
                if matrix.iter().any(|w| w.is_nan() || *w < 0.0) {
                    return Err(format!("the extraction of cell {number} has a negative entry"));
                }
                for j in 0..n_local {
                    let sum: f64 = (0..cell.functions.len()).map(|i| matrix[i * n_local + j]).sum();
                    if self.kind == Kind::Thb && (sum - 1.0).abs() > 1e-13 {
                        return Err(format!("column {j} of the extraction of cell {number} sums to {sum}"));
                    }
                }
            }
        }
        match met.iter().position(|m| !m) {
            Some(function) => Err(format!("function {function} is met on no cell")),
            None => Ok(()),
        }
    }
}

impl<const D: usize> HierarchicalSpace<D> {
    /// Lower and upper corner of the domain.
    pub fn domain(&self) -> ([f64; D], [f64; D]) {
        let ends: [(f64, f64); D] = std::array::from_fn(|d| self.levels[0][d].knots.domain());
        (ends.map(|e| e.0), ends.map(|e| e.1))
    }

    /// The directions in which functions go on across the ends of the domain.
    pub fn periodic(&self) -> [bool; D] {
        std::array::from_fn(|d| self.levels[0][d].knots.is_periodic())
    }

    /// The cell that holds a parameter; cells are half-open, the last one in each direction closed.
    ///
    /// # Errors
    /// [`Error::OutsideDomain`], also for NaN.
    pub fn locate_cell(&self, u: [f64; D]) -> Result<usize, Error> {
        let finest = self.n_levels() - 1;
        let spans = spans_at(std::array::from_fn(|d| &self.levels[finest][d].knots), u)?;
        let leaf = self.mesh.covering(finest, spans.map(|s| s as u32));
        Ok(self.cell_of_node[leaf.index()] as usize)
    }
}

impl<const D: usize> CellSpace<D> for HierarchicalSpace<D> {
    fn n_functions(&self) -> usize {
        self.active.iter().map(Vec::len).sum()
    }

    fn degree(&self) -> [usize; D] {
        std::array::from_fn(|d| self.levels[0][d].knots.degree())
    }

    fn n_cells(&self) -> usize {
        self.cells.len()
    }

    fn cell(&self, cell: usize) -> Cell<'_, D> {
        let node = self.cells[cell];
        let level = &self.levels[self.mesh.level(node)];
        let index = self.mesh.cell_index(node).map(|i| i as usize);
        Cell {
            lower: std::array::from_fn(|d| level[d].knots.breaks()[index[d]]),
            upper: std::array::from_fn(|d| level[d].knots.breaks()[index[d] + 1]),
            functions: &self.functions[self.offsets[cell]..self.offsets[cell + 1]],
            extraction: match self.pattern[cell] {
                IDENTITY => Extraction::Identity,
                pattern => Extraction::Matrix(&self.patterns[pattern as usize]),
            },
            bezier: std::array::from_fn(|d| level[d].bezier(index[d])),
            degree: self.degree(),
        }
    }
}

impl<const D: usize> ParameterBox<D> for HierarchicalSpace<D> {
    fn domain(&self) -> ([f64; D], [f64; D]) {
        self.domain()
    }

    fn periodic(&self) -> [bool; D] {
        self.periodic()
    }

    fn locate_cell(&self, u: [f64; D]) -> Result<usize, Error> {
        self.locate_cell(u)
    }
}

/// Multiplies each line along direction `d` of an array `(n_local, n)` with a matrix: entry `(i, j)` is the weight of the
/// line's `i`-th number in its new `j`-th one.
fn apply_along<const D: usize>(degree: &[usize; D], n: usize, d: usize, matrix: &[f64], coefficients: &mut [f64]) {
    let mut line = [0.0; crate::MAX_DEGREE + 1];
    crate::space::for_each_line(degree, n, d, |start, stride, order| {
        for j in 0..order {
            line[j] = (0..order).map(|i| matrix[i * order + j] * coefficients[start + i * stride]).sum();
        }
        for j in 0..order {
            coefficients[start + j * stride] = line[j];
        }
    });
}

/// Functions on a cell as combinations of the B-splines of the cell's level.
#[derive(Default)]
struct LocalRows {
    functions: Vec<u32>,
    /// Row-major, one row per function.
    weights: Vec<f64>,
}

impl LocalRows {
    fn is_identity(&self, n_local: usize) -> bool {
        self.weights.iter().enumerate().all(|(k, &w)| w == f64::from(u8::from(k / n_local == k % n_local)))
    }
}
