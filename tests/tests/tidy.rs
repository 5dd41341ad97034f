//! The repository keeps the promises of its design; the same checks as `cargo xtask tidy`.

use anyhow::Result;
use xtask::generate::fixtures;
use xtask::{tidy, workspace_root};

#[test]
fn the_repository_is_tidy() -> Result<()> {
    let findings = tidy::check(&workspace_root())?;
    assert!(findings.is_empty(), "{} finding(s):\n{}", findings.len(), findings.join("\n"));
    Ok(())
}

#[test]
fn synthetic_fixtures_are_as_generated() -> Result<()> {
    let differing = fixtures::differing(&workspace_root().join(fixtures::FOLDER))?;
    assert!(differing.is_empty(), "run `{}`: {}", fixtures::COMMAND, differing.join(", "));
    Ok(())
}
