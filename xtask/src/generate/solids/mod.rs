//! Closed shapes as meshes, of six kinds, with what is known of each: genus, creases, volume.

mod boxes;
mod draw;
mod drilled;
mod genus;
mod implicit;
mod nets;
mod outline;
mod part;
mod planar;
mod relax;
mod rings;
mod round;
mod torus;
mod turned;

#[cfg(test)]
mod tests;

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context as _, Result};
use clap::ValueEnum;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::format::Format;
use super::rounded;

pub use part::Part;

/// Random numbers of one kind begin that many streams after those of the kind before.
const STREAMS: u64 = 1 << 20;

/// Kinds of shapes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Spheres and ellipsoids.
    Round,
    /// Tori: plain, flat, wavy.
    Torus,
    /// Genus 2 to 5: blended tori and rods.
    Genus,
    /// Boxes with rounded edges.
    Box,
    /// Revolved parts.
    Turned,
    /// Plates and blocks with round holes.
    Drilled,
}

impl Kind {
    /// All of them, in order.
    pub const ALL: [Self; 6] = [Self::Round, Self::Torus, Self::Genus, Self::Box, Self::Turned, Self::Drilled];

    /// As it is typed, and as names of its shapes begin.
    pub fn name(self) -> &'static str {
        match self {
            Self::Round => "round",
            Self::Torus => "torus",
            Self::Genus => "genus",
            Self::Box => "box",
            Self::Turned => "turned",
            Self::Drilled => "drilled",
        }
    }

    /// The name of the number-th shape, numbered from 0.
    pub fn shape_name(self, number: usize) -> String {
        format!("{}-{:02}", self.name(), number + 1)
    }

    /// What heads a section.
    pub fn heading(self) -> &'static str {
        match self {
            Self::Round => "Spheres and ellipsoids",
            Self::Torus => "Tori",
            Self::Genus => "Genus 2 to 5",
            Self::Box => "Boxes with rounded edges",
            Self::Turned => "Turned parts",
            Self::Drilled => "Drilled plates and blocks",
        }
    }

    /// Whether a shape of this kind may have creases.
    pub fn is_sharp(self) -> bool {
        matches!(self, Self::Box | Self::Turned | Self::Drilled)
    }
}

/// A shape that was generated.
#[derive(Clone, Debug)]
pub struct Solid {
    /// The mesh, with creases.
    pub part: Part,
    /// What is known of the exact shape.
    pub known: Known,
}

/// What is known of a shape.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Known {
    /// Name of its files, without an extension.
    pub name: String,
    /// The kind.
    pub kind: Kind,
    /// Number of triangles.
    pub triangles: usize,
    /// The genus.
    pub genus: usize,
    /// Number of sharp edges of the mesh.
    pub creases: usize,
    /// The volume inside the exact shape, where there is a formula.
    pub volume: Option<f64>,
}

impl Solid {
    /// The number-th shape of a kind. The same arguments give the same shape.
    ///
    /// # Errors
    /// A mesh that is not closed, not of one piece, or not of the genus that it should have.
    pub fn new(kind: Kind, number: usize, seed: u64) -> Result<Self> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(kind as u64 * STREAMS + number as u64);
        let make = match kind {
            Kind::Round => round::make,
            Kind::Torus => torus::make,
            Kind::Genus => genus::make,
            Kind::Box => boxes::make,
            Kind::Turned => turned::make,
            Kind::Drilled => drilled::make,
        };
        let name = kind.shape_name(number);
        let made = make(number, &mut random).and_then(|made| {
            let mut part = made.part;
            part.points.iter_mut().flatten().for_each(|x| *x = rounded(*x));
            Ok((part.checked(made.genus)?, made.genus, made.volume))
        });
        let (part, genus, volume) = made.with_context(|| format!("cannot generate {name}"))?;
        let (triangles, creases) = (part.triangles.len(), part.creases.len());
        Ok(Self { part, known: Known { name, kind, triangles, genus, creases, volume } })
    }

    /// Writes `NAME.off` and, of kinds that may have creases, `NAME.creases`: the two vertices of a sharp edge a line, numbered from 0.
    ///
    /// # Errors
    /// What writing meets.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let mut creases = String::new();
        for [a, b] in &self.part.creases {
            writeln!(creases, "{a} {b}")?;
        }
        let mesh = Format::Off.mesh_bytes(&self.part.points, &self.part.triangles)?;
        let mut files = vec![("off", mesh)];
        if self.known.kind.is_sharp() {
            files.push(("creases", creases.into_bytes()));
        }
        for (extension, bytes) in files {
            let path = folder.join(format!("{}.{extension}", self.known.name));
            std::fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
        }
        Ok(())
    }
}

/// Writes so many shapes of each of the kinds, and `solids.json`, what is known of them. `log` is told of each.
///
/// # Errors
/// As [`Solid::new`] and [`Solid::write`].
pub fn write(folder: &Path, kinds: &[Kind], count: usize, seed: u64, log: &mut dyn FnMut(&str)) -> Result<Vec<Known>> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    let mut all = Vec::new();
    for &kind in kinds {
        for number in 0..count {
            let solid = Solid::new(kind, number, seed)?;
            solid.write(folder)?;
            let Known { name, triangles, genus, creases, .. } = &solid.known;
            log(&format!("{name}: {triangles} triangles, genus {genus}, {creases} sharp edges"));
            all.push(solid.known);
        }
    }
    let path = folder.join("solids.json");
    let text = serde_json::to_string_pretty(&all)? + "\n";
    std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    Ok(all)
}
