//! Chores of this repository: synthetic data, tables and checks. A user who only fits needs none of it.

pub mod chart;
pub mod claims;
pub mod corpus;
pub mod fuzz;
pub mod generate;
pub mod manual;
mod process;
pub mod tables;
pub mod tidy;
mod timed_fit;
pub mod train;

/// The arguments of `thb`, of which only the names and the help count here.
#[path = "../../crates/cli/src/args.rs"]
#[allow(dead_code, reason = "nothing is made of what is typed")]
mod args;
#[path = "../../crates/cli/src/fit_args.rs"]
#[allow(dead_code, reason = "as above")]
mod fit_args;
#[path = "../../crates/cli/src/scan_args.rs"]
#[allow(dead_code, reason = "as above")]
mod scan_args;
#[path = "../../crates/cli/src/solid_args.rs"]
#[allow(dead_code, reason = "as above")]
mod solid_args;

use std::path::{Path, PathBuf};

/// The folder of the workspace.
pub fn workspace_root() -> PathBuf {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    own.parent().unwrap_or(own).to_owned()
}
