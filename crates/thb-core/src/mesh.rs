//! Hierarchical meshes: nested domains Ω⁰ ⊇ Ω¹ ⊇ …, kept as a tree of dyadically split cells.

use crate::{Error, MAX_LEVELS};

/// Index of a node of the tree. A node keeps its index when the mesh is refined further.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(pub(crate) u32);

impl NodeId {
    /// The index as a number below [`HierarchicalMesh::n_nodes`].
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Marks a node without children.
const NO_CHILD: u32 = u32::MAX;

#[derive(Clone, Debug, PartialEq)]
struct Node<const D: usize> {
    index: [u32; D],
    level: u8,
    first_child: u32,
}

/// The cells of all levels that were ever created: those of level ℓ make up Ω^ℓ, those without children are the leaf
/// cells of the mesh (Imperatore 2024, §2.1.3). Splitting a cell splits it in all directions, so Ω^{ℓ+1} is always a
/// union of whole cells of level ℓ.
#[derive(Clone, Debug, PartialEq)]
pub struct HierarchicalMesh<const D: usize> {
    roots: [u32; D],
    nodes: Vec<Node<D>>,
    n_levels: usize,
}

impl<const D: usize> HierarchicalMesh<D> {
    /// The unrefined mesh with the given number of cells per direction.
    ///
    /// # Errors
    /// [`Error::Elements`] if there are none, or more than can be indexed.
    pub fn new(cells: [usize; D]) -> Result<Self, Error> {
        let limit = (NO_CHILD as usize) >> (D + 1);
        let total = cells.iter().try_fold(1_usize, |product, &n| product.checked_mul(n)).unwrap_or(usize::MAX);
        if total == 0 || total > limit {
            return Err(Error::Elements { given: total, limit });
        }
        let roots = cells.map(|n| n as u32);
        let nodes = (0..total)
            .map(|mut linear| {
                let index = cells.map(|n| {
                    let i = linear % n;
                    linear /= n;
                    i as u32
                });
                Node { index, level: 0, first_child: NO_CHILD }
            })
            .collect();
        Ok(Self { roots, nodes, n_levels: 1 })
    }

    /// Number of levels that have cells.
    pub fn n_levels(&self) -> usize {
        self.n_levels
    }

    /// Number of cells of all levels, split ones included.
    pub fn n_nodes(&self) -> usize {
        self.nodes.len()
    }

    /// Number of cells of a level per direction, if it were refined everywhere.
    pub fn grid(&self, level: usize) -> [usize; D] {
        self.roots.map(|n| (n as usize) << level)
    }

    /// The level of a cell.
    pub fn level(&self, node: NodeId) -> usize {
        usize::from(self.nodes[node.index()].level)
    }

    /// The index of a cell in the grid of its level.
    pub fn cell_index(&self, node: NodeId) -> [u32; D] {
        self.nodes[node.index()].index
    }

    /// Whether a cell is a leaf.
    pub fn is_leaf(&self, node: NodeId) -> bool {
        self.nodes[node.index()].first_child == NO_CHILD
    }

    /// The `2^D` children of a split cell, first direction fastest; empty for a leaf.
    pub fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId> + use<D> {
        let first = self.nodes[node.index()].first_child;
        let count = if first == NO_CHILD { 0 } else { 1 << D };
        (0..count).map(move |i| NodeId(first + i))
    }

    /// All cells, in order of creation.
    pub fn nodes(&self) -> impl Iterator<Item = NodeId> + use<D> {
        (0..self.nodes.len() as u32).map(NodeId)
    }

    /// The cells of level 0.
    pub fn roots(&self) -> impl Iterator<Item = NodeId> + use<D> {
        (0..self.roots.iter().product()).map(NodeId)
    }

    /// The cell that exists at `(level, index)`, or the leaf that covers it.
    pub fn covering(&self, level: usize, index: [u32; D]) -> NodeId {
        let mut linear = 0;
        for d in (0..D).rev() {
            linear = linear * self.roots[d] + (index[d] >> level);
        }
        let mut node = NodeId(linear);
        for below in (0..level).rev() {
            let first = self.nodes[node.index()].first_child;
            if first == NO_CHILD {
                break;
            }
            let child = (0..D).fold(0, |bits, d| bits | (((index[d] >> below) & 1) << d));
            node = NodeId(first + child);
        }
        node
    }

    /// The cell at `(level, index)`, if Ω^level contains it.
    pub fn find(&self, level: usize, index: [u32; D]) -> Option<NodeId> {
        let node = self.covering(level, index);
        (self.level(node) == level).then_some(node)
    }

    /// The leaf cells, depth first: neighbours in the list are neighbours in space (Morton order within a root cell).
    pub fn leaves(&self) -> Vec<NodeId> {
        let mut leaves = Vec::new();
        let mut stack: Vec<NodeId> = Vec::new();
        for root in self.roots() {
            stack.push(root);
            while let Some(node) = stack.pop() {
                if self.is_leaf(node) {
                    leaves.push(node);
                } else {
                    let first = self.nodes[node.index()].first_child;
                    stack.extend((0..1 << D).rev().map(|i| NodeId(first + i)));
                }
            }
        }
        leaves
    }

    /// Splits the cell at `(level, index)`, after the cells that cover it. Does nothing where it is split already.
    ///
    /// # Errors
    /// [`Error::TooManyLevels`], [`Error::NoSuchCell`].
    pub fn split(&mut self, level: usize, index: [u32; D]) -> Result<(), Error> {
        if level + 1 >= MAX_LEVELS {
            return Err(Error::TooManyLevels { given: level + 1, limit: MAX_LEVELS - 1 });
        }
        for (direction, &cells) in self.grid(level).iter().enumerate() {
            if index[direction] as usize >= cells {
                return Err(Error::NoSuchCell { level, direction, index: index[direction] as usize, cells });
            }
        }
        loop {
            let node = self.covering(level, index);
            if !self.is_leaf(node) {
                return Ok(());
            }
            let reached = self.level(node) == level;
            self.split_leaf(node)?;
            if reached {
                return Ok(());
            }
        }
    }

    fn split_leaf(&mut self, node: NodeId) -> Result<(), Error> {
        let limit = NO_CHILD as usize;
        if self.nodes.len() + (1 << D) >= limit {
            return Err(Error::Elements { given: self.nodes.len() + (1 << D), limit });
        }
        let parent = self.nodes[node.index()].clone();
        self.nodes[node.index()].first_child = self.nodes.len() as u32;
        for child in 0..1_u32 << D {
            let index = std::array::from_fn(|d| 2 * parent.index[d] + ((child >> d) & 1));
            self.nodes.push(Node { index, level: parent.level + 1, first_child: NO_CHILD });
        }
        self.n_levels = self.n_levels.max(usize::from(parent.level) + 2);
        Ok(())
    }

    /// Checks that children lie where their parents are, that the leaves tile the domain, and that every cell is found
    /// at its own index. For tests and fuzzing.
    ///
    /// # Errors
    /// A sentence that names the first cell found wrong.
    pub fn check_invariants(&self) -> Result<(), String> {
        let mut covered = 0.0;
        for node in self.nodes() {
            let (level, index) = (self.level(node), self.cell_index(node));
            if self.find(level, index) != Some(node) {
                return Err(format!("cell {index:?} of level {level} is not found at its own index"));
            }
            if self.is_leaf(node) {
                covered += 0.5_f64.powi((D * level) as i32);
            }
            for child in self.children(node) {
                let below = self.cell_index(child);
                if self.level(child) != level + 1 || (0..D).any(|d| below[d] >> 1 != index[d]) {
                    return Err(format!("child {below:?} does not lie in cell {index:?} of level {level}"));
                }
            }
        }
        let area = f64::from(self.roots.iter().product::<u32>());
        if covered != area {
            return Err(format!("the leaves cover {covered} of {area} cells of level 0"));
        }
        Ok(())
    }
}
