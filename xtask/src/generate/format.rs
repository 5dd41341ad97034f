//! The text formats. Written here and not by `geom-io`, whose readers are tested on these files.

use std::fmt::Write;
use std::path::Path;

use anyhow::{Context, Result, bail};

use super::mesh::triangles;
use super::{Cloud, Kind};

/// Formats by extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    /// `i,j,x,y,z` for a grid on a surface in space, otherwise `u,v,x,y,z`.
    Csv,
    Xyz,
    Off,
    Obj,
    Ply,
}

impl Format {
    pub(super) fn from_path(path: &Path) -> Result<Self> {
        let extension = path.extension().and_then(|e| e.to_str()).context("the file name has no extension")?;
        Ok(match extension {
            "csv" => Self::Csv,
            "xyz" => Self::Xyz,
            "off" => Self::Off,
            "obj" => Self::Obj,
            "ply" => Self::Ply,
            other => bail!("no format for .{other}; known are .csv .xyz .off .obj .ply"),
        })
    }

    pub(super) fn bytes(self, cloud: &Cloud, kind: Kind) -> Result<Vec<u8>> {
        let mut text = String::new();
        match self {
            Self::Csv => csv(&mut text, cloud, kind)?,
            Self::Xyz => lines(&mut text, "", &cloud.points)?,
            Self::Off | Self::Obj | Self::Ply => {
                self.mesh(&mut text, &cloud.points, &triangles(&cloud.parameters)?)?;
            }
        }
        Ok(text.into_bytes())
    }

    /// A file with points and triangles, of a format that has both.
    pub(super) fn mesh_bytes(self, points: &[[f64; 3]], triangles: &[[usize; 3]]) -> Result<Vec<u8>> {
        let mut text = String::new();
        self.mesh(&mut text, points, triangles)?;
        Ok(text.into_bytes())
    }

    fn mesh(self, out: &mut String, points: &[[f64; 3]], triangles: &[[usize; 3]]) -> Result<()> {
        let (vertices, faces) = (points.len(), triangles.len());
        let (vertex, face, base) = if self == Self::Obj { ("v ", "f ", 1) } else { ("", "3 ", 0) };
        match self {
            Self::Off => writeln!(out, "OFF\n{vertices} {faces} 0")?,
            Self::Ply => {
                writeln!(out, "ply\nformat ascii 1.0\nelement vertex {vertices}")?;
                writeln!(out, "property double x\nproperty double y\nproperty double z")?;
                writeln!(out, "element face {faces}\nproperty list uchar int vertex_indices\nend_header")?;
            }
            _ => {}
        }
        lines(out, vertex, points)?;
        let corners: Vec<[usize; 3]> = triangles.iter().map(|t| t.map(|i| i + base)).collect();
        lines(out, face, &corners)
    }
}

fn csv(out: &mut String, cloud: &Cloud, kind: Kind) -> Result<()> {
    match cloud.grid {
        Some([_, n_v]) if !kind.is_height_field() => {
            writeln!(out, "i,j,x,y,z")?;
            for (k, [x, y, z]) in cloud.points.iter().enumerate() {
                writeln!(out, "{},{},{x},{y},{z}", k / n_v, k % n_v)?;
            }
        }
        _ => {
            writeln!(out, "u,v,x,y,z")?;
            for ([u, v], [x, y, z]) in cloud.parameters.iter().zip(&cloud.points) {
                writeln!(out, "{u},{v},{x},{y},{z}")?;
            }
        }
    }
    Ok(())
}

fn lines<T: std::fmt::Display>(out: &mut String, prefix: &str, rows: &[[T; 3]]) -> Result<()> {
    for [a, b, c] in rows {
        writeln!(out, "{prefix}{a} {b} {c}")?;
    }
    Ok(())
}
