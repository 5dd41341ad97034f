//! Moving parameters: the comparisons of Imperatore 2024, chapter 5, on its own clouds; G+Smo; foot points; noise.

mod asked;
mod foot_points;
mod gismo;
mod noise;
mod peers;
mod printed;
mod run;
mod thesis;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use asked::Asked;
use gismo::Gismo;

/// A page and its figures.
pub struct Page {
    /// Markdown.
    pub text: String,
    /// File names and SVG.
    pub figures: Vec<(&'static str, String)>,
}

/// The page; `data` is a folder with the clouds, without which only generated ones are used; `gismo` a program built by
/// `tests/peers/build_gismo_fitting.sh`, without which G+Smo's figures are those of another day. `log` is told what begins.
///
/// # Errors
/// What reading and fitting meet.
pub fn page(data: Option<&Path>, gismo: Option<&Path>, log: &mut dyn FnMut(&str)) -> Result<Page> {
    let mut asked = Asked::default();
    let (mut text, mut figures) = (String::new(), Vec::new());
    if let Some(data) = data {
        let study = thesis::Study::run(data, log)?;
        text += &study.text();
        text += thesis::AFTER;
        study.ask(&mut asked);
        figures = study.figures();
        text += &peers::against_gismo(data, &gismo.map_or(Gismo::Stored, Gismo::Run), &mut asked, log)?;
        text += &peers::stand_ins(data, &mut asked, log)?;
    } else {
        text += "\nThe thesis's clouds, G+Smo's and the stand-ins are left out: `--data DIR` was not given.\n";
    }
    text += &foot_points::section(data, &mut asked, log)?;
    text += &noise::section(log)?;
    Ok(Page { text: format!("{INTRODUCTION}{}{text}", asked.text()), figures })
}

/// The page of what the thesis's own settings give.
///
/// # Errors
/// What reading and fitting meet.
pub fn printed_settings(data: &Path, log: &mut dyn FnMut(&str)) -> Result<String> {
    printed::page(data, log)
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

    RAYON_NUM_THREADS=1 cargo xtask tables moving --data DIR --gismo PROGRAM
    RAYON_NUM_THREADS=1 cargo xtask figures --data DIR

The first command computes this page and its figures anew, the second the figures alone. DIR has the clouds by the names below;
without it only generated ones are used. MAX and MSE are the largest and the mean squared distance of the points to the surface at
their parameters, in the units of the cloud; DOFs are control points. CPU-s is user time, in hundredths.
*printed* are the figures of Imperatore 2024 where its text has them.
";
