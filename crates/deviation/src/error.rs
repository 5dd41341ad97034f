//! What can go wrong.

/// Errors of measuring.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A surface has no triangles to measure on.
    #[error("the surface has no triangles to measure on")]
    NoTriangles,
}
