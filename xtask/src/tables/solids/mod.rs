//! Whole parts: meshes of the data folder, generated ones, and given layouts. Every figure comes from the written STEP file, by
//! tests/peers/check_solid.py.

mod row;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};

use super::finished::Cache;
use super::markdown::table;
use crate::generate::solids::{self as generated, Kind};
use row::{Creases, Part, Row};

/// What the table is made of.
pub struct Solids<'a> {
    /// A folder with meshes, `solids/NAME.off`, and layouts, `layouts/NAME_KIND.json.gz`.
    pub data: &'a Path,
    /// A Python interpreter with the packages of tests/peers/requirements.txt.
    pub python: &'a Path,
    /// The program.
    pub thb: &'a Path,
    /// The root of the workspace.
    pub root: &'a Path,
    /// Elements along each side of a patch of a given layout.
    pub elements: usize,
    /// Generated shapes of each kind, and their seed.
    pub count: usize,
    /// Seed of the generated shapes.
    pub seed: u64,
    /// Parts whose names contain one of these are fitted, and no others, unless there is none.
    pub only: &'a [String],
    /// Whether rows of this commit that are finished are taken from the folder.
    pub resume: bool,
    /// A folder for meshes, STEP files and finished rows.
    pub out: &'a Path,
}

/// Meshes without creases, and those whose creases are the edges above the limit of the script.
const SMOOTH: [&str; 6] = ["blobby", "bear", "knot", "eight", "ellipsoid", "sphere966"];
const SHARP: [&str; 10] =
    ["cube-meshed", "joint", "anchor_dense", "rotor_small", "pipe", "oblong", "u", "part", "spool", "dragknob"];
/// Open meshes, and those of several pieces.
const OPEN: [&str; 3] = ["blob", "mech-holes-shark", "patch-01"];
const PIECES: [&str; 1] = ["bones"];

/// What results depend on, below the root of the workspace.
const CODE: [&str; 4] = ["crates", "Cargo.lock", "tests/peers", "xtask/src/generate/solids"];

/// Recall and precision from which creases are found.
const FOUND: f64 = 0.98;

/// A part of the page.
struct Section {
    heading: &'static str,
    text: String,
    parts: Vec<Part>,
}

/// The page: a row for each mesh and one for each layout there is, failures included.
///
/// # Errors
/// What programs and files meet; not those of a fit, which are part of the table.
pub fn document(solids: &Solids<'_>, progress: &mut dyn FnMut(&str)) -> Result<String> {
    let commit = crate::process::commit(solids.root, &CODE);
    let mut cache = Cache::open(&solids.out.join("rows.jsonl"), solids.resume, &commit)?;
    let script = solids.root.join("tests/peers/check_solid.py");
    let mut tables = String::new();
    let mut summaries = Vec::new();
    for Section { heading, text, parts } in sections(solids)? {
        let mut rows = Vec::new();
        for part in parts {
            let row = match cache.take(|row: &Row| row.name == part.name) {
                Some(row) => row,
                None => {
                    let row = Row::new(&part, solids.thb, solids.python, &script, solids.out)?;
                    cache.add(&row)?;
                    row
                }
            };
            progress(&line(&row).join(" "));
            rows.push((row, part.creases));
        }
        if rows.is_empty() {
            continue;
        }
        summaries.push(summary(heading, &rows));
        write!(tables, "\n## {heading}\n\n{text}\n\n")?;
        tables += &table(&HEADER, &rows.iter().map(|(row, _)| line(row)).collect::<Vec<_>>());
    }
    let (count, seed) = (solids.count, solids.seed);
    let only = if solids.only.is_empty() {
        String::new()
    } else {
        format!(" Only parts whose names contain one of these: {}.", solids.only.join(", "))
    };
    Ok(format!(
        "{INTRODUCTION}\nCommit {commit}; generated shapes: {count} of each kind, seed {seed}.{only}\n\n{}{tables}",
        table(&SUMMARY, &summaries)
    ))
}

const INTRODUCTION: &str = "# Whole parts

Written by `cargo xtask tables solids --data DIR`, as `thb fit MESH -o PART.step` with one thread. All figures but time and memory come
from the STEP file, by [`check_solid.py`](../../tests/peers/check_solid.py) with Open CASCADE. Lengths are percentages of the diagonal;
p99 and largest are distances by area, from the mesh to the faces and from the faces to the mesh, as far as they leave the band between
flat facets and the curved triangles over them. Angles are between normals of two faces along their smooth edges, in degrees. `meets`
is empty where the part is one valid solid without free edges, of the mesh's genus, p99 within 0.3 %, largest within 1 %, its volume
between the mesh's and that of the curved triangles (both widened by 0.3 %), without folds and crossings, of no more than
max(12, triangles / 4) faces; else it names what is not so.
";

/// The files of `data`, the generated shapes, and the layouts.
fn sections(solids: &Solids<'_>) -> Result<Vec<Section>> {
    let meshes: Vec<(String, PathBuf)> = listed(&solids.data.join("solids"), ".off")?
        .into_iter()
        .map(|path| (path.file_stem().unwrap_or_default().to_string_lossy().into_owned(), path))
        .collect();
    let creases = |name: &str| if SMOOTH.contains(&name) { Creases::Smooth } else { Creases::ByAngle };
    let own = |wanted: &dyn Fn(&str) -> bool, options: &[&str]| -> Vec<Part> {
        let wanted = meshes.iter().filter(|(name, _)| wanted(name));
        let options: Vec<String> = options.iter().map(ToString::to_string).collect();
        wanted
            .map(|(name, mesh)| Part {
                name: name.clone(),
                mesh: mesh.clone(),
                creases: creases(name),
                options: options.clone(),
            })
            .collect()
    };
    let given = listed(&solids.data.join("layouts"), ".json.gz")?
        .into_iter()
        .map(|layout| {
            let file = layout.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let name = file.trim_end_matches(".json.gz");
            let shape = name.rsplit_once('_').map_or(name, |(shape, _)| shape);
            let prefix = format!("{shape}_");
            let (shape, mesh) = (meshes.iter().find(|(name, _)| name == shape))
                .or_else(|| meshes.iter().find(|(name, _)| name.starts_with(&prefix)))
                .with_context(|| format!("no mesh of {}", layout.display()))?;
            let elements = solids.elements.to_string();
            let options = ["--layout", &layout.to_string_lossy(), "--mesh", &elements].map(str::to_owned).to_vec();
            Ok(Part { name: name.to_owned(), mesh: mesh.clone(), creases: creases(shape), options })
        })
        .collect::<Result<Vec<_>>>()?;
    let section = |heading, text: &str, parts| Section { heading, text: text.to_owned(), parts };
    let is_wanted = |name: &str| solids.only.is_empty() || solids.only.iter().any(|only| name.contains(only));
    let mut sections = vec![
        section("Smooth meshes", "No edge is a crease.", own(&|name| SMOOTH.contains(&name), &[])),
        section("Meshes with creases", "Edges above 40° are the creases.", own(&|name| SHARP.contains(&name), &[])),
        section(
            "Other closed meshes",
            "Edges above 40° are taken for creases, though some of these are smooth.",
            own(
                &|name| {
                    !SMOOTH.contains(&name)
                        && !SHARP.contains(&name)
                        && !OPEN.contains(&name)
                        && !PIECES.contains(&name)
                },
                &[],
            ),
        ),
        section("Open meshes", "With `--layout patches`.", own(&|name| OPEN.contains(&name), &["--layout", "patches"])),
        section("Several pieces", "", own(&|name| PIECES.contains(&name), &[])),
    ];
    let folder = solids.out.join("meshes");
    let names = |kind: Kind| (0..solids.count).map(move |number| kind.shape_name(number));
    let kinds: Vec<Kind> = Kind::ALL.into_iter().filter(|&kind| names(kind).any(|name| is_wanted(&name))).collect();
    generated::write(&folder, &kinds, solids.count, solids.seed, &mut |_| {})?;
    for kind in kinds {
        let part = |name: String| {
            let file = |extension: &str| folder.join(format!("{name}.{extension}"));
            let creases = if kind.is_sharp() { Creases::Listed(file("creases")) } else { Creases::Smooth };
            Part { mesh: file("off"), creases, options: Vec::new(), name }
        };
        let text = "Generated; the creases are the generator's.";
        sections.push(section(kind.heading(), text, names(kind).map(part).collect()));
    }
    let text = format!("Degree 3, {0} × {0} elements a patch.", solids.elements);
    sections.push(section("Given layouts", &text, given));
    sections.iter_mut().for_each(|section| section.parts.retain(|part| is_wanted(&part.name)));
    Ok(sections)
}

/// The files of a folder whose names end so, by name.
fn listed(folder: &Path, ending: &str) -> Result<Vec<PathBuf>> {
    let listed = fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut paths: Vec<PathBuf> = listed.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.retain(|path| path.to_string_lossy().ends_with(ending));
    paths.sort();
    Ok(paths)
}

const HEADER: [&str; 20] = [
    "part",
    "exit",
    "triangles",
    "faces",
    "poles",
    "control points",
    "corners °",
    "smooth of 2",
    "p99 %",
    "largest %",
    "volume %",
    "angle p99 °",
    "max °",
    "at vertices °",
    "creases found",
    "folds",
    "crossings",
    "CPU s",
    "MiB",
    "meets",
];

fn line(row: &Row) -> Vec<String> {
    let digits = |x: Option<f64>, digits: usize| x.map_or(String::new(), |x| format!("{x:.digits$}"));
    let figure = |path: &str, places: usize| digits(row.figure(path), places);
    let both = |key: &str, places: usize| {
        let to = figure(&format!("/mesh_to_surface_%/{key}"), places);
        if to.is_empty() { to } else { format!("{to} / {}", figure(&format!("/surface_to_mesh_%/{key}"), places)) }
    };
    let mut faults = row.faults().join(", ");
    if !row.reason.is_empty() {
        write!(faults, ": {}", row.reason.replace('|', "\\|")).unwrap_or_default();
    }
    let pair = |a: &str, b: &str, places: usize| match (row.figure(a), row.figure(b)) {
        (Some(a), Some(b)) => format!("{a:.places$} – {b:.places$}"),
        _ => String::new(),
    };
    vec![
        row.name.clone(),
        row.exit.map_or("killed".to_owned(), |code| code.to_string()),
        digits(row.report["triangles"].as_f64(), 0),
        figure("/faces", 0),
        figure("/poles", 0),
        digits(row.report["functions"].as_f64(), 0),
        pair("/corner_min", "/corner_max", 0),
        figure("/smooth_of_two", 0),
        both("p99", 3),
        both("max", 2),
        figure("/volume_error_%", 3),
        figure("/angle_p99", 3),
        figure("/angle_max", 2),
        figure("/angle_at_vertices", 2),
        pair("/crease_recall", "/crease_precision", 3),
        figure("/folds", 0),
        figure("/crossings", 0),
        digits(row.seconds, 1),
        digits(row.memory, 0),
        faults,
    ]
}

const SUMMARY: [&str; 9] = [
    "section",
    "parts",
    "exit 0",
    "meet",
    "exit 0 that do not",
    "smooth",
    "creases found",
    "faces, median",
    "control points, median",
];

/// A line of the first table: how many parts meet the list, and how many end with 0 and do not.
fn summary(heading: &str, rows: &[(Row, Creases)]) -> Vec<String> {
    let count = |holds: &dyn Fn(&(Row, Creases)) -> bool| rows.iter().filter(|&row| holds(row)).count();
    let reached = |row: &Row| row.exit == Some(0);
    let meets = |row: &Row| row.faults().is_empty();
    let found = |row: &Row, creases: &Creases| match creases {
        Creases::Smooth => row.figure("/sharp_length_%") == Some(0.0),
        _ => ["/crease_recall", "/crease_precision"].iter().all(|key| row.figure(key).is_some_and(|x| x >= FOUND)),
    };
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).map_or(String::new(), |x| format!("{x:.0}"))
    };
    vec![
        heading.to_owned(),
        rows.len().to_string(),
        count(&|(row, _)| reached(row)).to_string(),
        count(&|(row, _)| meets(row)).to_string(),
        count(&|(row, _)| reached(row) && !meets(row)).to_string(),
        count(&|(row, _)| row.is_smooth()).to_string(),
        count(&|(row, creases)| found(row, creases)).to_string(),
        median(rows.iter().filter_map(|(row, _)| row.figure("/faces")).collect()),
        median(rows.iter().filter_map(|(row, _)| row.report["functions"].as_f64()).collect()),
    ]
}
