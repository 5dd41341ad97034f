//! Whole parts, on layouts of our own and on given ones: every figure comes from the written STEP file, by tests/peers/check_solid.py.

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result};
use reconstruct::{Smoothness, SolidOptions};
use serde_json::Value;

use super::markdown::table;
use crate::process::Clock;

/// What the table is made of.
pub struct Solids<'a> {
    /// A folder with meshes, `solids/NAME.off`, and layouts, `layouts/NAME_KIND.json.gz`.
    pub data: &'a Path,
    /// A Python interpreter with the packages of tests/peers/requirements.txt.
    pub python: &'a Path,
    /// The root of the workspace.
    pub root: &'a Path,
    /// Elements along each side of a patch.
    pub elements: usize,
    /// ω.
    pub smoothness: f64,
    /// A folder for the STEP files.
    pub out: &'a Path,
}

const HEADER: [&str; 20] = [
    "layout",
    "faces",
    "functions",
    "sharp arcs",
    "valence 2",
    "valid",
    "solids",
    "free edges",
    "genus right",
    "folds",
    "RMS %",
    "p99 %",
    "largest %",
    "angle max °",
    "p99 °",
    "at vertices °",
    "volume %",
    "largest tolerance %",
    "CPU s",
    "ends with",
];

/// The page: a row for each mesh and one for each layout there is, failures included.
pub fn document(solids: &Solids<'_>, progress: &mut dyn FnMut(&str)) -> Result<String> {
    std::fs::create_dir_all(solids.out)?;
    let mut rows = |folder: &str, ending: &str, row: &dyn Fn(&Path) -> Result<Vec<String>>| -> Result<_> {
        let mut rows = Vec::new();
        for path in listed(&solids.data.join(folder), ending)? {
            let row = row(&path)?;
            progress(&row.join(" "));
            rows.push(row);
        }
        Ok(rows)
    };
    let own = rows("solids", ".off", &|mesh| on_own_layout(solids, mesh))?;
    let given = rows("layouts", ".json.gz", &|layout| on_given_layout(solids, layout))?;
    let mut text = String::new();
    let (elements, smoothness) = (solids.elements, solids.smoothness);
    writeln!(
        text,
        "# Whole parts\n\nWritten by `cargo xtask tables solids`. Lengths are percentages of the diagonal, those of the mesh from the faces by \
         area; its facets count as they are, so that a coarse mesh of something round is off by their heights. A fold is a place of 25 in each \
         element where the face looks the wrong way. ω = {smoothness}.\n\n## On layouts of our own\n\nAs `thb fit MESH -o PART.step`.\n"
    )?;
    text += &table(&HEADER, &own);
    writeln!(text, "\n## On given layouts\n\nDegree 3, {elements} × {elements} elements a patch.\n")?;
    text += &table(&HEADER, &given);
    Ok(text)
}

/// The files of a folder whose names end so, by name.
fn listed(folder: &Path, ending: &str) -> Result<Vec<PathBuf>> {
    let listed = std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut paths: Vec<PathBuf> = listed.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.retain(|path| path.to_string_lossy().ends_with(ending));
    paths.sort();
    Ok(paths)
}

fn on_own_layout(solids: &Solids<'_>, mesh: &Path) -> Result<Vec<String>> {
    let options = SolidOptions { smoothness: Smoothness::Weight(solids.smoothness), ..SolidOptions::default() };
    let name = mesh.file_stem().unwrap_or_default().to_string_lossy();
    row(solids, &name, mesh, &options)
}

fn on_given_layout(solids: &Solids<'_>, layout: &Path) -> Result<Vec<String>> {
    let file = layout.file_name().unwrap_or_default().to_string_lossy();
    let name = file.trim_end_matches(".json.gz");
    let mesh = mesh_of(&solids.data.join("solids"), name.rsplit_once('_').map_or(name, |(mesh, _)| mesh))?;
    let options = SolidOptions {
        elements: Some(solids.elements),
        smoothness: Smoothness::Weight(solids.smoothness),
        ..SolidOptions::of_layout(layout.to_owned())
    };
    row(solids, name, &mesh, &options)
}

fn row(solids: &Solids<'_>, name: &str, mesh: &Path, options: &SolidOptions) -> Result<Vec<String>> {
    let step = solids.out.join(format!("{name}.step"));
    let clock = Clock::start();
    let fitted = reconstruct::fit_solid_file(mesh, options, &mut |_| ControlFlow::Continue(()));
    let written = fitted.and_then(|fit| {
        reconstruct::write_solid_outputs(&fit, std::slice::from_ref(&step), &[])?;
        Ok(fit)
    });
    let seconds = clock.seconds();
    let mut row = vec![name.to_owned()];
    let fit = match written {
        Ok(fit) => fit,
        Err(error) => {
            row.resize(HEADER.len() - 1, String::new());
            row.push(error.to_string());
            return Ok(row);
        }
    };
    let found = check(solids, &step, mesh)?;
    let figure = |value: &Value, digits: usize| value.as_f64().map_or("?".to_owned(), |x| format!("{x:.digits$}"));
    let plain = |key: &str| found[key].to_string();
    let distances = &found["mesh_to_surface_%"];
    row.extend([plain("faces"), fit.report.functions.to_string(), fit.report.layout.sharp_arcs.to_string()]);
    row.push(fit.report.layout.valences.get(&2).copied().unwrap_or(0).to_string());
    row.extend(["valid", "solids", "free_edges"].map(plain));
    row.push((found["genus"] == found["mesh_genus"]).to_string());
    row.push(plain("folds"));
    row.extend(["rms", "p99", "max"].map(|key| figure(&distances[key], 4)));
    row.extend(["angle_max", "angle_p99", "angle_at_vertices", "volume_error_%"].map(|key| figure(&found[key], 3)));
    row.push(found["largest_tolerance_%"].as_f64().map_or("?".to_owned(), |x| format!("{x:.1e}")));
    row.push(format!("{seconds:.1}"));
    row.push(fit.report.reasons.first().map_or("reached".to_owned(), ToString::to_string));
    Ok(row)
}

/// The mesh of a name, `NAME.off`, or the first one that is called `NAME_…`.
fn mesh_of(folder: &Path, name: &str) -> Result<PathBuf> {
    let exact = folder.join(format!("{name}.off"));
    if exact.is_file() {
        return Ok(exact);
    }
    let prefix = format!("{name}_");
    let is_like = |path: &PathBuf| path.file_name().is_some_and(|file| file.to_string_lossy().starts_with(&prefix));
    listed(folder, "")?.into_iter().find(is_like).with_context(|| format!("no mesh {name} in {}", folder.display()))
}

/// The figures of the script. It ends with 1 where a solid is not good, but prints them all the same.
fn check(solids: &Solids<'_>, step: &Path, mesh: &Path) -> Result<Value> {
    let script = solids.root.join("tests/peers/check_solid.py");
    let output = Command::new(solids.python).arg(script).args([step, mesh]).output().context("python")?;
    let text = String::from_utf8_lossy(&output.stdout);
    serde_json::from_str(&text)
        .with_context(|| format!("{}: {}", step.display(), String::from_utf8_lossy(&output.stderr)))
}
