//! What shortens or refuses a step after it is known.

pub(crate) mod flipping_triangles;
