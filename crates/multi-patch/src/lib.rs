//! Smooth surfaces of several glued patches, fitted to samples of a surface.
//!
//! All patches are fitted at once, in one least-squares problem over the control points of a [`thb_core::MultiPatchSpace`]:
//!
//! ```text
//! (1/W) Σ_m w_m |S(u_m) − x_m|²  +  (μ/P) Σ_patches ∫ |S_uu|²/r² + 2 |S_uv|² + r² |S_vv|²  +  (ω h)² (1/n_E) Σ_smooth arcs Σ_k w_k θ_k²
//! ```
//!
//! with W = Σ w_m, P patches, r the ratio of a patch's length to its width, n_E smooth arcs, θ the angle between the tangent planes on both sides of an arc, and h
//! three times the size of an element. Each sum is a term with a file of its own in `terms/`. Patches meet without gaps by the numbering of their
//! functions; the last sum makes them meet without a kink, but for arcs that are told to be sharp.
//!
//! [`fit`] runs the two stages: first data and plates while μ falls and parameters follow the surface; then Gauss–Newton steps with the
//! angles, of which only what lies across the tangent planes counts, so that arcs stay free to move in flat faces. Where the surface is
//! turned over after that, plates are made stiffer. If places are left the fit is repeated with a form of the angles that also holds what
//! lies in the planes, and the better one counts: it folds less, but may draw arcs to creases at angles of 0°. The crate does not know where
//! samples and patches come from.

mod arc_points;
mod equations;
mod error;
mod feet;
mod fit;
#[cfg(test)]
mod fit_tests;
mod measure;
mod options;
mod problem;
mod samples;
mod surface;
mod term;
mod terms;
#[cfg(test)]
mod testing;
mod unfold;

pub use error::Error;
pub use fit::{Fitted, Step, fit};
pub use measure::{AngleReport, Integrals, TURNED_OVER, angles, folds, integrals};
pub use options::Options;
pub use problem::Problem;
pub use samples::{Sample, Samples};
pub use surface::Surface;
