//! The list of scans.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::ValueEnum as _;

use crate::generate::surface::Kind;
use crate::generate::{Noise, Sample};

/// Noise of generated scans, in percent of the diagonal.
const NOISE: f64 = 0.01;

/// A scan and the tolerances that it is fitted with.
pub(super) struct Scan {
    pub(super) name: String,
    /// In percent of the diagonal.
    pub(super) percents: Vec<f64>,
}

/// The scans of a file: a name and tolerances in each line, remarks after `#`.
pub(super) fn read(path: &Path) -> Result<Vec<Scan>> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let mut scans = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let mut words = line.split('#').next().unwrap_or_default().split_whitespace();
        let Some(name) = words.next() else { continue };
        let percents = words.map(|word| Ok(word.parse()?)).collect::<Result<Vec<f64>>>();
        let percents = percents.with_context(|| format!("{}:{}", path.display(), number + 1))?;
        scans.push(Scan { name: name.to_owned(), percents });
    }
    Ok(scans)
}

impl Scan {
    /// Where the scan is; nothing if it is in a folder that is not given, or not there. A generated one is written to `target/corpus`.
    pub(super) fn path(&self, root: &Path, data: Option<&Path>) -> Result<Option<PathBuf>> {
        if self.name.starts_with("fixtures/") {
            return Ok(Some(root.join(&self.name)));
        }
        let Some(recipe) = self.name.strip_prefix("generated/") else {
            return Ok(data.map(|data| data.join(&self.name)).filter(|path| path.is_file()));
        };
        let [kind, points, seed] = recipe.split('-').collect::<Vec<_>>()[..] else {
            bail!("{}: expected generated/KIND-POINTS-SEED", self.name);
        };
        let path = root.join("target/corpus").join(format!("{recipe}.xyz"));
        if !path.is_file() {
            let kind = Kind::from_str(kind, false).map_err(|reason| anyhow::anyhow!("{}: {reason}", self.name))?;
            std::fs::create_dir_all(root.join("target/corpus")).context("cannot create target/corpus")?;
            let noise = Noise::Percent(NOISE);
            Sample { kind, layout: kind.layout(), points: points.parse()?, noise, seed: seed.parse()? }.write(&path)?;
        }
        Ok(Some(path))
    }
}
