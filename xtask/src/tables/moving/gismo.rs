//! G+Smo on the clouds that ours is compared on: figures of its run beside ours, or those measured before.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use super::run::{Cloud, Settings};

/// Where G+Smo's figures come from.
pub(super) enum Gismo<'a> {
    /// From `tests/peers/gismo_fitting.cpp`, built, run in turn with ours: a change of the machine's speed meets both.
    Run(&'a Path),
    /// From G+Smo of October 2024 on another day.
    Stored,
}

/// A fit of G+Smo.
#[derive(Clone, Copy, Debug)]
pub(super) struct Peer {
    pub(super) dofs: usize,
    pub(super) max: f64,
    /// User time.
    pub(super) seconds: f64,
    pub(super) reached: bool,
}

impl Gismo<'_> {
    /// Its fit of a cloud with so many corrections after each refinement, boundary points free; `stored` if it is not run.
    pub(super) fn fit(&self, cloud: &Cloud, settings: &Settings, corrections: usize, stored: Peer) -> Result<Peer> {
        let program = match self {
            Self::Run(program) => program,
            Self::Stored => return Ok(stored),
        };
        let file = written(cloud)?;
        let Settings { degree, elements: [elements, _], lambda, tolerance, max_iterations, max_dofs, .. } = settings;
        let output = Command::new(program)
            .arg(&file.0)
            .args([tolerance.to_string(), elements.to_string(), corrections.to_string(), degree.to_string()])
            .args([lambda.to_string(), EXTENSION.to_string(), max_iterations.to_string(), max_dofs.to_string()])
            .output()
            .with_context(|| format!("cannot run {}", program.display()))?;
        if !output.status.success() {
            bail!("{} failed: {}", program.display(), String::from_utf8_lossy(&output.stderr));
        }
        let text = String::from_utf8_lossy(&output.stdout);
        let last = text.lines().last().with_context(|| format!("{} printed nothing", program.display()))?;
        let [dofs, max, seconds] = last.split_whitespace().collect::<Vec<_>>()[..] else {
            bail!("{} printed `{last}` instead of three numbers", program.display());
        };
        let (dofs, max, seconds): (usize, f64, f64) = (dofs.parse()?, max.parse()?, seconds.parse()?);
        Ok(Peer { dofs, max, seconds, reached: max <= *tolerance })
    }

    /// What the page says about the source of the figures.
    pub(super) fn source(&self) -> &'static str {
        match self {
            Self::Run(_) => "G+Smo 26.9, run in turn with ours",
            Self::Stored => {
                "G+Smo of October 2024, measured by us on another day, when the machine may have been faster or slower"
            }
        }
    }
}

/// Cells of the next level by which G+Smo refines around a point, as in its own examples.
pub(super) const EXTENSION: usize = 2;

/// A file that goes with its owner.
struct Temporary(PathBuf);

impl Drop for Temporary {
    fn drop(&mut self) {
        // Left behind it does no harm.
        let _ = std::fs::remove_file(&self.0);
    }
}

/// The cloud as CSV, every number to the last bit.
fn written(cloud: &Cloud) -> Result<Temporary> {
    let mut text = String::from("u,v,x,y,z\n");
    for (u, x) in cloud.parameters.outer_iter().zip(cloud.points.outer_iter()) {
        writeln!(text, "{:e},{:e},{:e},{:e},{:e}", u[0], u[1], x[0], x[1], x[2])?;
    }
    let path = std::env::temp_dir().join(format!("thb-tables-{}.csv", std::process::id()));
    std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    Ok(Temporary(path))
}
