//! Meshes with a scalar at each vertex, for viewers.

use std::io::{self, Write};
use std::path::Path;

use ndarray::{ArrayView1, ArrayView2};

use super::colour::{ColourMap, Colours};
use super::write_atomically;
use crate::error::WriteError;

/// A mesh to be written.
#[derive(Clone, Debug)]
pub struct MeshWithScalars<'a> {
    /// Vertices, shape `(m, 3)`.
    pub vertices: ArrayView2<'a, f64>,
    /// Vertex indices of each triangle, from 0.
    pub triangles: &'a [[u32; 3]],
    /// A value at each vertex, such as the deviation of a scan from its surface.
    pub scalars: Option<Scalars<'a>>,
}

/// Named values, one a vertex.
#[derive(Clone, Debug)]
pub struct Scalars<'a> {
    /// Name of the property in the file, such as `deviation`; what is no ASCII letter, digit or `_` is
    /// written as `_`.
    pub name: &'a str,
    /// Values, length `m`.
    pub values: ArrayView1<'a, f64>,
}

/// Colours of the written mesh. Only PLY holds colours.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeshStyle {
    /// The colour map.
    pub colour_map: ColourMap,
    /// Values at the ends of the map; `None` takes those of the scalars. A fixed range makes the colours of two
    /// files comparable.
    pub range: Option<(f64, f64)>,
}

/// A format to write meshes in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum MeshFormat {
    /// Wavefront OBJ: shape only, scalars are left out.
    Obj,
    /// Binary little-endian PLY: coordinates in double precision, scalars as `float`, colours.
    Ply,
    /// Legacy VTK, binary: coordinates and scalars in double precision.
    Vtk,
}

impl MeshFormat {
    /// All formats and their extensions, in lower case and without the dot.
    pub const ALL: [(Self, &'static str); 3] = [(Self::Obj, "obj"), (Self::Ply, "ply"), (Self::Vtk, "vtk")];

    /// The format that the extension of a path, in upper or lower case, stands for.
    ///
    /// # Errors
    /// [`WriteError::UnknownExtension`].
    pub fn from_path(path: &Path) -> Result<Self, WriteError> {
        let extension = path.extension().unwrap_or_default();
        let known = Self::ALL.into_iter().find(|(_, known)| extension.eq_ignore_ascii_case(known));
        known.map(|(format, _)| format).ok_or_else(|| WriteError::UnknownExtension {
            path: path.to_owned(),
            supported: Self::ALL.map(|(_, extension)| format!(".{extension}")).join(", "),
        })
    }
}

/// Writes a mesh in the format of the path's extension, whole or not at all (see [`write_atomically`]).
///
/// # Errors
/// [`WriteError`], if the extension is unknown, the mesh is not consistent or finite, or the file cannot be written.
pub fn write_mesh(path: &Path, mesh: &MeshWithScalars<'_>, style: &MeshStyle) -> Result<(), WriteError> {
    let format = MeshFormat::from_path(path)?;
    check(mesh)?;
    write_atomically(path, |out| match format {
        MeshFormat::Obj => write_obj(out, mesh),
        MeshFormat::Ply => write_ply(out, mesh, style),
        MeshFormat::Vtk => write_vtk(out, mesh),
    })
}

fn check(mesh: &MeshWithScalars<'_>) -> Result<(), WriteError> {
    let (count, columns) = mesh.vertices.dim();
    if columns != 3 {
        return Err(WriteError::NotSpatial { columns });
    }
    // PLY readers take signed indices, VTK's counters are signed and count 4 numbers a triangle.
    let limit = i32::MAX as usize;
    let largest = count.max(mesh.triangles.len().saturating_mul(4));
    if largest > limit {
        return Err(WriteError::TooLarge { count: largest, limit });
    }
    for (vertex, row) in mesh.vertices.rows().into_iter().enumerate() {
        if let Some(&value) = row.iter().find(|value| !value.is_finite()) {
            return Err(WriteError::NonFinite { vertex, quantity: "coordinate".to_owned(), value });
        }
    }
    if let Some(scalars) = &mesh.scalars {
        let (name, values) = (scalars.name.to_owned(), scalars.values.len());
        if values != count {
            return Err(WriteError::ScalarCount { name, values, vertices: count });
        }
        if let Some((vertex, &value)) = scalars.values.iter().enumerate().find(|(_, value)| !value.is_finite()) {
            return Err(WriteError::NonFinite { vertex, quantity: name, value });
        }
    }
    for (triangle, corners) in mesh.triangles.iter().enumerate() {
        if let Some(&index) = corners.iter().find(|&&index| index as usize >= count) {
            return Err(WriteError::IndexOutOfRange { triangle, index, count });
        }
    }
    Ok(())
}

/// A name that all formats accept.
fn identifier(name: &str) -> String {
    let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if plain.is_empty() { "scalars".to_owned() } else { plain }
}

fn write_obj(out: &mut dyn Write, mesh: &MeshWithScalars<'_>) -> io::Result<()> {
    for p in mesh.vertices.rows() {
        writeln!(out, "v {:?} {:?} {:?}", p[0], p[1], p[2])?;
    }
    for [a, b, c] in mesh.triangles {
        writeln!(out, "f {} {} {}", u64::from(*a) + 1, u64::from(*b) + 1, u64::from(*c) + 1)?;
    }
    Ok(())
}

fn write_ply(out: &mut dyn Write, mesh: &MeshWithScalars<'_>, style: &MeshStyle) -> io::Result<()> {
    writeln!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}", mesh.vertices.nrows())?;
    // Single precision would round projected coordinates (7 digits before the point) to half metres.
    writeln!(out, "property double x\nproperty double y\nproperty double z")?;
    if let Some(scalars) = &mesh.scalars {
        writeln!(out, "property float {}", identifier(scalars.name))?;
        writeln!(out, "property uchar red\nproperty uchar green\nproperty uchar blue")?;
    }
    writeln!(out, "element face {}\nproperty list uchar int vertex_indices\nend_header", mesh.triangles.len())?;

    let colours =
        mesh.scalars.as_ref().map(|s| (s, Colours::new(style.colour_map, style.range, s.values.iter().copied())));
    for (vertex, row) in mesh.vertices.rows().into_iter().enumerate() {
        for coordinate in row {
            out.write_all(&coordinate.to_le_bytes())?;
        }
        if let Some((scalars, colours)) = &colours {
            let value = scalars.values[vertex];
            out.write_all(&(value as f32).clamp(f32::MIN, f32::MAX).to_le_bytes())?;
            out.write_all(&colours.rgb(value))?;
        }
    }
    for corners in mesh.triangles {
        out.write_all(&[3])?;
        for index in corners {
            out.write_all(&index.to_le_bytes())?;
        }
    }
    Ok(())
}

/// VTK file formats, legacy version 3.0; binary values are big-endian.
fn write_vtk(out: &mut dyn Write, mesh: &MeshWithScalars<'_>) -> io::Result<()> {
    let (vertices, triangles) = (mesh.vertices.nrows(), mesh.triangles.len());
    writeln!(out, "# vtk DataFile Version 3.0\ntriangle mesh\nBINARY\nDATASET POLYDATA")?;
    writeln!(out, "POINTS {vertices} double")?;
    for coordinate in mesh.vertices {
        out.write_all(&coordinate.to_be_bytes())?;
    }
    writeln!(out, "\nPOLYGONS {triangles} {}", 4 * triangles)?;
    for corners in mesh.triangles {
        out.write_all(&3_u32.to_be_bytes())?;
        for index in corners {
            out.write_all(&index.to_be_bytes())?;
        }
    }
    if let Some(scalars) = &mesh.scalars {
        writeln!(out, "\nPOINT_DATA {vertices}\nSCALARS {} double 1\nLOOKUP_TABLE default", identifier(scalars.name))?;
        for value in scalars.values {
            out.write_all(&value.to_be_bytes())?;
        }
    }
    writeln!(out)
}
