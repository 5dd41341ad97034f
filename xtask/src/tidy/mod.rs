//! Checks of the repository itself: what the compiler does not check, but the design promises.
//!
//! Every check returns findings, sentences that name file or crate and what to do; no findings, no complaint.

mod bundle;
mod circles;
mod dependencies;
mod edges;
mod files;
mod fixtures;
mod licences;

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};
use cargo_metadata::{Metadata, MetadataCommand};

/// All findings.
///
/// # Errors
/// What reading the repository and asking cargo meets.
pub fn check(root: &Path) -> Result<Vec<String>> {
    let metadata = metadata(root)?;
    let mut findings = edges::check(&metadata);
    findings.extend(dependencies::check(root, &metadata)?);
    findings.extend(licences::check(&metadata)?);
    findings.extend(files::check(root)?);
    findings.extend(fixtures::check(root)?);
    findings.extend(circles::check(root)?);
    findings.extend(bundle::check(root)?);
    Ok(findings)
}

/// The workspace and its dependencies as the lock file has them, without the network. Packages for other platforms are
/// left out: cargo has not fetched them.
fn metadata(root: &Path) -> Result<Metadata> {
    let version = Command::new("rustc").arg("-vV").output().context("cannot run rustc")?;
    let version = String::from_utf8(version.stdout)?;
    let host = version.lines().find_map(|line| line.strip_prefix("host: ")).context("rustc names no host")?;
    let options = ["--locked", "--offline", "--filter-platform", host].map(str::to_owned);
    MetadataCommand::new()
        .manifest_path(root.join("Cargo.toml"))
        .other_options(options)
        .exec()
        .context("cargo metadata failed")
}
