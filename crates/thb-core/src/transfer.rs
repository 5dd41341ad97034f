//! Exact transfer of coefficients to a refined space.

use std::sync::Arc;

use ndarray::Array2;

use crate::{CellSpace, Error, Extraction, HierarchicalSpace, NodeId, SplineMap};

/// The same map with coefficients in a refinement of its space, or in that of the opened knots
/// ([`HierarchicalSpace::opened`]) of a periodic space.
///
/// On a leaf cell of level ℓ of the finer space the map is a combination of B-splines of level ℓ. There, functions of
/// coarser levels do not touch the coefficients of B-splines with support in Ω^ℓ if they are truncated (preservation of
/// coefficients, Giannelli, Jüttler & Speleers 2012); their share is subtracted otherwise.
///
/// # Errors
/// [`Error::NotNested`] if `finer` has other knots, another kind, or a coarser cell somewhere.
pub fn transfer<const D: usize>(map: &SplineMap<D>, finer: &HierarchicalSpace<D>) -> Result<Array2<f64>, Error> {
    let coarse = map.space();
    if coarse.kind() != finer.kind() {
        return Err(Error::NotNested { reason: "one basis is truncated, the other is not" });
    }
    for d in 0..D {
        let (from, to) = (coarse.knots(0, d)?, finer.knots(0, d)?);
        if from != to && from.opened() != *to {
            return Err(Error::NotNested { reason: "the knots of level 0 differ" });
        }
    }
    let n = map.dim();
    let source: Vec<f64> = map.coefficients().iter().copied().collect();
    let mut target = vec![f64::NAN; finer.n_functions() * n];
    // Coarse levels first: HB-splines need the coefficients of all coarser functions of a cell.
    let mut cells: Vec<usize> = (0..finer.n_cells()).collect();
    cells.sort_by_key(|&cell| finer.mesh().level(finer.node(cell)));
    let mut local = Vec::new();
    for number in cells {
        let cell = finer.cell(number);
        let node = finer.node(number);
        let first_own = finer.first_of_level(finer.mesh().level(node)) as u32;
        let n_coarser = cell.functions.partition_point(|&f| f < first_own);
        if cell.functions[n_coarser..].iter().all(|&f| !target[f as usize * n].is_nan()) {
            continue;
        }
        local_coefficients(map, finer, node, &source, &mut local)?;
        let Extraction::Matrix(weights) = cell.extraction else {
            for (row, &function) in local.chunks_exact(n).zip(cell.functions) {
                target[function as usize * n..][..n].copy_from_slice(row);
            }
            continue;
        };
        let n_local = cell.n_local();
        for (own, &function) in cell.functions.iter().enumerate().skip(n_coarser) {
            let column = (0..n_local).find(|&j| weights[own * n_local + j] == 1.0);
            let column = column.ok_or(Error::NotNested { reason: "a function has no B-spline of its own level" })?;
            for k in 0..n {
                let coarser: f64 = (0..n_coarser)
                    .map(|i| weights[i * n_local + column] * target[cell.functions[i] as usize * n + k])
                    .sum();
                target[function as usize * n + k] = local[column * n + k] - coarser;
            }
        }
    }
    Array2::from_shape_vec((finer.n_functions(), n), target)
        .map_err(|_| Error::NotNested { reason: "the coefficients do not fill the space" })
}

impl<const D: usize> SplineMap<D> {
    /// The same map on open knots: in periodic directions cut at the seam, exactly, by knot insertion. A map without
    /// periodic directions is returned as it is.
    ///
    /// # Errors
    /// [`Error::Elements`] if the functions cannot be counted in 32 bits.
    pub fn opened(&self) -> Result<Self, Error> {
        if self.space().periodic() == [false; D] {
            return Ok(self.clone());
        }
        let space = self.space().opened()?;
        let coefficients = transfer(self, &space)?;
        Self::new(Arc::new(space), coefficients)
    }
}

/// The map's coefficients in the B-splines of the level of a cell of the finer space.
fn local_coefficients<const D: usize>(
    map: &SplineMap<D>,
    finer: &HierarchicalSpace<D>,
    node: NodeId,
    source: &[f64],
    local: &mut Vec<f64>,
) -> Result<(), Error> {
    let (level, index) = (finer.mesh().level(node), finer.mesh().cell_index(node));
    let coarse = map.space();
    let covering = coarse.mesh().covering(level, index);
    let cell = coarse
        .cell_of_node(covering)
        .ok_or(Error::NotNested { reason: "a cell is coarser than in the space of the map" })?;
    coarse.cell(cell).local_coefficients(source, map.dim(), local);
    coarse.open_local(finer, covering, local, map.dim());
    for below in coarse.mesh().level(covering) + 1..=level {
        let step = finer.mesh().find(below, index.map(|i| i >> (level - below)));
        let step = step.ok_or(Error::NotNested { reason: "the mesh has a gap between levels" })?;
        finer.subdivide(step, local, map.dim());
    }
    Ok(())
}
