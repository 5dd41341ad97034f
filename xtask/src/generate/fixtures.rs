//! The synthetic files among the fixtures.

use std::path::Path;

use anyhow::{Context, Result};

use super::surface::{Kind, Layout};
use super::{Noise, Sample};

/// The folder of the fixtures in the workspace.
pub const FOLDER: &str = "fixtures";

/// The command that writes them.
pub const COMMAND: &str = "cargo xtask generate fixtures";

/// Names and contents.
pub const FIXTURES: [(&str, Sample); 7] = [
    ("wigley_grid.csv", sample(Kind::Wigley, Layout::Grid, 961, 0.0)),
    ("wigley_900.off", sample(Kind::Wigley, Layout::Scattered, 900, 0.0)),
    ("bonnet_1600.ply", sample(Kind::Bonnet, Layout::Scattered, 1600, 0.0)),
    ("bonnet_1600_noise.ply", sample(Kind::Bonnet, Layout::Scattered, 1600, 0.1)),
    ("blade_1600.ply", sample(Kind::Blade, Layout::Scattered, 1600, 0.0)),
    ("peaks_4k.csv", sample(Kind::Peaks, Layout::Random, 4000, 0.0)),
    ("peaks_grid.csv", sample(Kind::Rwls, Layout::Grid, 4096, 0.0)),
];

const fn sample(kind: Kind, layout: Layout, points: usize, percent: f64) -> Sample {
    Sample { kind, layout, points, noise: Noise::Percent(percent), seed: 1 }
}

/// Writes them all.
///
/// # Errors
/// What writing meets.
pub fn write(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    FIXTURES.iter().try_for_each(|(name, sample)| sample.write(&folder.join(name)))
}

/// The files that are missing or not as they would be written, by name.
///
/// # Errors
/// What generating meets.
pub fn differing(folder: &Path) -> Result<Vec<&'static str>> {
    let mut names = Vec::new();
    for (name, sample) in &FIXTURES {
        let expected = sample.bytes(Path::new(name))?;
        if std::fs::read(folder.join(name)).ok() != Some(expected) {
            names.push(*name);
        }
    }
    Ok(names)
}
