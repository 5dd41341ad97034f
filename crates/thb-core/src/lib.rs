//! Truncated hierarchical B-spline (THB) spaces and maps on boxes, of parameter dimension 1, 2 or 3.
//!
//! Every space of this crate is made of *cells*: boxes on which each function is a polynomial. A cell knows its
//! functions through two small matrices, its [`Extraction`] (functions → tensor-product B-splines of the cell's level)
//! and its Bézier matrices (B-splines → Bernstein polynomials of the cell). Fitting, evaluation and energies are
//! written against [`CellSpace`] and so work for polynomials, B-splines, HB- and THB-splines alike.
//!
//! ```
//! use std::sync::Arc;
//! use ndarray::Array2;
//! use thb_core::{HierarchicalSpace, KnotVector, Kind, Refinement, SplineMap};
//!
//! // Biquadratic THB-splines on 4×4 elements, refined once in the lower left corner.
//! let knots = KnotVector::uniform(2, 4)?;
//! let coarse = HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots])?;
//! let corner = coarse.locate_cell([0.1, 0.1])?;
//! let space = coarse.refine(&[corner], &Refinement { extension: [2, 2], ..Refinement::default() })?;
//! assert_eq!(space.n_levels(), 2);
//!
//! // The functions sum to one, so equal coefficients give a constant map.
//! let map = SplineMap::new(Arc::new(space.clone()), Array2::from_elem((space.n_functions(), 3), 2.0))?;
//! assert!((map.eval([0.3, 0.7])?[1] - 2.0).abs() < 1e-14);
//! # use thb_core::CellSpace;
//! # Ok::<(), thb_core::Error>(())
//! ```
//!
//! The crate reads no file, knows no point cloud, and logs nothing.

pub mod bernstein;
mod box_spline;
mod closest;
mod energy;
mod error;
mod hierarchical;
mod knots;
mod level;
mod map;
mod mesh;
mod multi_patch;
mod patch;
mod refine;
mod small_cholesky;
mod space;
mod sparse;
mod tensor;
mod transfer;

pub use box_spline::BoxSplineSpace;
pub use closest::{ClosestPoint, ClosestPoints, descend};
pub use energy::{Quadrature, ThinPlate};
pub use error::Error;
pub use hierarchical::{HierarchicalSpace, Kind};
pub use knots::KnotVector;
pub use map::{BezierMap, Jet, SplineMap};
pub use mesh::{HierarchicalMesh, NodeId};
pub use multi_patch::{
    ArcUse, Crossing, MultiPatchSpace, PatchPlace, PatchSide, PatchTopology, TopologyError, side_point,
};
pub use refine::{Mark, Refinement};
pub use small_cholesky::SmallCholesky;
pub use space::{Cell, CellSpace, Extraction, ParameterBox};
pub use sparse::{SymmetricMatrix, SymmetricPattern};
pub use tensor::{TensorSpace, unravel};
pub use transfer::transfer;

/// Largest polynomial degree per direction, so that basis values fit on the stack.
pub const MAX_DEGREE: usize = 8;

/// Largest number of levels, level 0 included. The univariate two-scale relations of all levels are stored, which
/// doubles with each level; the finest cell is then 2⁻¹⁵ of an element of level 0.
pub const MAX_LEVELS: usize = 16;
