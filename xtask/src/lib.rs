//! Chores of this repository: synthetic data, tables and checks. A user who only fits needs none of it.

pub mod chart;
pub mod claims;
pub mod corpus;
pub mod fuzz;
pub mod generate;
mod process;
pub mod tables;
pub mod tidy;
mod timed_fit;
pub mod train;

use std::path::{Path, PathBuf};

/// The folder of the workspace.
pub fn workspace_root() -> PathBuf {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    own.parent().unwrap_or(own).to_owned()
}
