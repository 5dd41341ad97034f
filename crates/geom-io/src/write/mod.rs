//! Writers.

mod atomic;
mod colour;
mod mesh;

pub use atomic::{check_writable, write_atomically};
pub use colour::ColourMap;
pub use mesh::{MeshFormat, MeshStyle, MeshWithScalars, Scalars, write_mesh};
