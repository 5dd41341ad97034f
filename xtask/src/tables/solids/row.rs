//! One whole part: fitted by the program as its user does, and measured from the STEP file that it wrote.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::super::finished::Finished;
use crate::process::watch;

/// Which edges of a mesh are its creases.
#[derive(Clone, Debug)]
pub(super) enum Creases {
    /// None.
    Smooth,
    /// Those sharper than the limit of the script.
    ByAngle,
    /// Those that a file lists.
    Listed(PathBuf),
}

/// A mesh, and how it is fitted and measured.
pub(super) struct Part {
    /// The row's name.
    pub(super) name: String,
    /// The mesh.
    pub(super) mesh: PathBuf,
    /// Its creases.
    pub(super) creases: Creases,
    /// Further options of `thb fit`.
    pub(super) options: Vec<String>,
}

/// What was found.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Row {
    pub(super) name: String,
    /// Exit code of the program; nothing if it was killed.
    pub(super) exit: Option<i32>,
    /// The last line on standard error, where the program did not end with 0.
    pub(super) reason: String,
    pub(super) seconds: Option<f64>,
    pub(super) memory: Option<f64>,
    /// The report, and what the script printed; null if there is none.
    pub(super) report: Value,
    pub(super) found: Value,
}

/// Largest share of the diagonal, in percent, by which 99 % of the area and any place may be off.
const MOST_P99: f64 = 0.3;
const MOST_LARGEST: f64 = 1.0;
/// Triangles a face at least, for parts of more than `FEW_FACES` faces.
const TRIANGLES_A_FACE: f64 = 4.0;
const FEW_FACES: f64 = 12.0;
/// Largest angles, in degrees, of what counts as smooth: of 99 %, of all, at vertices.
const SMOOTH: [(&str, f64); 3] = [("angle_p99", 0.15), ("angle_max", 0.5), ("angle_at_vertices", 0.2)];

impl Finished for Row {
    fn to_json(&self, commit: &str) -> Value {
        serde_json::json!({ "commit": commit, "row": self })
    }

    fn from_json(line: &str, commit: &str) -> Option<Self> {
        let mut value: Value = serde_json::from_str(line).ok()?;
        (value["commit"].as_str()? == commit).then_some(())?;
        serde_json::from_value(value["row"].take()).ok()
    }
}

impl Row {
    /// Fits and measures a part. Files are written to `folder`.
    pub(super) fn new(part: &Part, thb: &Path, python: &Path, script: &Path, folder: &Path) -> Result<Self> {
        let file = |extension: &str| folder.join(format!("{}.{extension}", part.name));
        let (step, report, log) = (file("step"), file("json"), file("log"));
        for old in [&step, &report] {
            if old.exists() {
                fs::remove_file(old).with_context(|| format!("cannot remove {}", old.display()))?;
            }
        }
        let errors = File::create(&log).with_context(|| format!("cannot write {}", log.display()))?;
        let mut child = Command::new(thb)
            .arg("fit")
            .args([&part.mesh, Path::new("-o"), &step, Path::new("--report"), &report])
            .args(&part.options)
            .env("RAYON_NUM_THREADS", "1")
            .stdout(std::process::Stdio::null())
            .stderr(errors)
            .spawn()
            .with_context(|| format!("cannot run {}", thb.display()))?;
        let ended = watch(&mut child)?;
        let text = fs::read_to_string(&log).unwrap_or_default();
        let report =
            fs::read(&report).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or(Value::Null);
        let found = if step.is_file() { measured(part, &step, python, script)? } else { Value::Null };
        Ok(Self {
            name: part.name.clone(),
            exit: ended.code,
            reason: if ended.code == Some(0) { String::new() } else { reason(&text) },
            seconds: ended.seconds,
            memory: ended.memory,
            report,
            found,
        })
    }

    /// A figure of the script.
    pub(super) fn figure(&self, path: &str) -> Option<f64> {
        self.found.pointer(path).and_then(Value::as_f64)
    }

    /// What is not as it should be, of what makes a good solid.
    pub(super) fn faults(&self) -> Vec<&'static str> {
        if self.found.is_null() {
            return vec!["no solid"];
        }
        let is = |key: &str, value: u64| self.found[key].as_u64() == Some(value);
        let at_most = |path: &str, most: f64| self.figure(path).is_some_and(|x| x <= most);
        let triangles = self.report["triangles"].as_f64().unwrap_or(0.0);
        let checks = [
            ("invalid", self.found["valid"] == true),
            ("not one solid", is("solids", 1)),
            ("free edges", is("free_edges", 0) && is("edges_of_many", 0)),
            ("genus", self.found["genus"] == self.found["mesh_genus"]),
            ("p99", at_most("/mesh_to_surface_%/p99", MOST_P99) && at_most("/surface_to_mesh_%/p99", MOST_P99)),
            (
                "largest",
                at_most("/mesh_to_surface_%/max", MOST_LARGEST) && at_most("/surface_to_mesh_%/max", MOST_LARGEST),
            ),
            ("volume", self.found["volume_fits"] == true),
            ("folds", is("folds", 0)),
            ("crossings", is("crossings", 0)),
            ("faces", at_most("/faces", FEW_FACES.max(triangles / TRIANGLES_A_FACE))),
        ];
        checks.into_iter().filter(|(_, holds)| !holds).map(|(name, _)| name).collect()
    }

    /// Whether faces that should meet smoothly do.
    pub(super) fn is_smooth(&self) -> bool {
        SMOOTH.iter().all(|(key, most)| self.figure(&format!("/{key}")).is_some_and(|angle| angle <= *most))
    }
}

/// The figures of the script. It ends with 1 where a solid is not good, but prints them all the same.
fn measured(part: &Part, step: &Path, python: &Path, script: &Path) -> Result<Value> {
    let mut command = Command::new(python);
    command.arg(script).args([step, &part.mesh]);
    match &part.creases {
        Creases::Smooth => command.arg("--smooth"),
        Creases::ByAngle => &mut command,
        Creases::Listed(file) => command.arg("--creases").arg(file),
    };
    let output = command.output().with_context(|| format!("cannot run {}", python.display()))?;
    serde_json::from_slice(&output.stdout).with_context(|| {
        let text = String::from_utf8_lossy(&output.stderr);
        format!("{}: {}", step.display(), text.lines().last().unwrap_or("nothing was printed"))
    })
}

/// The last line, without what stands before its reason: the program and the file.
fn reason(text: &str) -> String {
    let line = text.lines().last().unwrap_or_default();
    line.splitn(3, ": ").last().unwrap_or_default().to_owned()
}
