//! Moving parameters: the comparisons of Imperatore 2024, chapter 5, on its own clouds; G+Smo; foot points; noise.

mod foot_points;
mod noise;
mod peers;
mod run;
mod thesis;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

/// A page and its figures.
pub struct Page {
    /// Markdown.
    pub text: String,
    /// File names and SVG.
    pub figures: Vec<(&'static str, String)>,
}

/// The page; `data` is a folder with the clouds, without which only generated ones are used. `log` is told what begins.
///
/// # Errors
/// What reading and fitting meet.
pub fn page(data: Option<&Path>, log: &mut dyn FnMut(&str)) -> Result<Page> {
    let mut page = Page { text: String::from(INTRODUCTION), figures: Vec::new() };
    if let Some(data) = data {
        let study = thesis::Study::run(data, log)?;
        page.text += &study.text();
        page.text += thesis::AFTER;
        page.figures = study.figures();
        page.text += &peers::against_gismo(data, log)?;
        page.text += &peers::stand_ins(data, log)?;
    } else {
        page.text += "\nThe thesis's clouds, G+Smo's and the stand-ins are left out: `--data DIR` was not given.\n";
    }
    page.text += &foot_points::section(data, log)?;
    page.text += &noise::section(log)?;
    Ok(page)
}

/// The figures alone.
///
/// # Errors
/// What reading and fitting meet.
pub fn figures(data: &Path, log: &mut dyn FnMut(&str)) -> Result<Vec<(&'static str, String)>> {
    Ok(thesis::Study::run(data, log)?.figures())
}

/// Writes figures to a folder; their paths.
///
/// # Errors
/// What writing meets.
pub fn write_figures(figures: &[(&str, String)], folder: &Path) -> Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    let write = |(name, picture): &(&str, String)| {
        let path = folder.join(name);
        std::fs::write(&path, picture).with_context(|| format!("cannot write {}", path.display()))?;
        Ok(path)
    };
    figures.iter().map(write).collect()
}

const INTRODUCTION: &str = "\
# Moving parameters

    RAYON_NUM_THREADS=1 cargo xtask tables moving --data DIR
    RAYON_NUM_THREADS=1 cargo xtask figures --data DIR

The first command computes this page and its figures anew, the second the figures alone. DIR has the clouds by the names below;
without it only generated ones are used. MAX and MSE are the largest and the mean squared distance of the points to the surface at
their parameters, in the units of the cloud; DOFs are control points. CPU-s is user time, in hundredths.
*printed* are the figures of Imperatore 2024 where its text has them.
";
