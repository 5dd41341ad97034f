//! Readers of point clouds and meshes, writers of meshes.
//!
//! One module a format. Readers take the whole file into memory and parse bytes; writers go through
//! [`write_atomically`], so that a file of the given name is either complete or untouched.
//! This crate does not compute: no scaling, no cleaning of what was read, no parameters but those of
//! a height field, which are its x and y.
//!
//! ```
//! use geom_io::{Format, ReadOptions, parse_scan};
//!
//! let scan = parse_scan(b"# a corner\n0 0 0\n1 0 0\n0 1 0.5\n", Format::Xyz, &ReadOptions::default())?;
//! assert_eq!(scan.cloud.points.dim(), (3, 3));
//! # Ok::<(), geom_io::ReadErrorKind>(())
//! ```

mod error;
pub mod model;
mod read;
mod write;

pub use error::{Location, ReadError, ReadErrorKind, WriteError};
pub use model::{
    GRAPH, Geometry, LayoutFile, LayoutQuad, LengthUnit, Model, ModelError, ModelErrorKind, ModelFormat, StepOptions,
    StepSchema, StepSize, StepSurface, SvgOptions, WriteOptions, parse_layout, read_layout, read_model, write_model,
    write_solid, write_step,
};
pub use read::{Decimal, Format, ReadOptions, Scan, TakenColumn, parse_scan, read_scan, read_text};
pub use write::{
    ColourMap, MeshFormat, MeshStyle, MeshWithScalars, Scalars, check_writable, remove_unfinished, target_of,
    write_atomically, write_mesh,
};
