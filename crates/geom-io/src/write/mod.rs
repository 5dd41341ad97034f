//! Writers.

mod atomic;
mod colour;
mod mesh;

pub use atomic::{check_writable, remove_unfinished, target_of, write_atomically};
pub use colour::ColourMap;
pub use mesh::{MeshFormat, MeshStyle, MeshWithScalars, Scalars, write_mesh};
