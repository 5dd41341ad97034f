//! Spline maps in G+Smo's XML (Jüttler, Langer, Mantzaflaris, Moore & Zulehner 2014).
//!
//! Written are `THBSpline1/2` and `HBSpline1/2`; read are these and `BSpline`, `TensorBSpline2`. A `<box>` of level ℓ
//! holds lower and upper corner, in cells of level ℓ, of a part of the mesh with leaf cells of that level; cells in no box
//! are of level 0. Coefficients stand by level, then by tensor index with the first direction fastest, as in this crate.
//!
//! G+Smo's hierarchical splines have open knots. A map with periodic directions is written in the space of the opened knots on
//! the same mesh, which holds it exactly: at the ends of a direction it gets further coefficients, and is read back with
//! two sides that coincide.
//!
//! G+Smo knows no length unit. We keep it in an attribute `unit` of the geometry, which G+Smo skips; without it
//! coordinates are taken as millimetres. Numbers are written so that reading them gives the same bits.

mod boxes;
mod read;
mod write;

pub use read::parse_gismo;
pub use write::write_gismo;
