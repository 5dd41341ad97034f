//! Quad layouts in JSON files, which may be compressed: how a surface is cut into patches of four sides.
//!
//! One object with
//! - `vertices`: points `[x, y, z]` on the surface;
//! - `corners`: the vertices at which patches meet;
//! - `quads`: of each patch its four `corners` (numbers into the list of corners, round the patch), four `paths` of vertices from
//!   corner to corner, its triangles `tri`, and for each of its vertices `vid` the parameters `uv`.
//!
//! Anything else in the file, such as where it came from, is not looked at.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{ModelError, ModelErrorKind};
use crate::read::read_unpacked;

/// A quad layout as it stands in a file. Nothing is checked but that it is complete.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LayoutFile {
    /// Points on the surface.
    pub vertices: Vec<[f64; 3]>,
    /// The vertices at which patches meet.
    pub corners: Vec<u32>,
    /// The patches.
    pub quads: Vec<LayoutQuad>,
}

/// A patch of a quad layout, as it stands in a file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LayoutQuad {
    /// Its corners, numbers into [`LayoutFile::corners`], counter-clockwise seen from outside.
    pub corners: [u32; 4],
    /// Vertices along its sides, from each corner to the next.
    pub paths: [Vec<u32>; 4],
    /// Its triangles, counter-clockwise seen from outside.
    #[serde(rename = "tri")]
    pub triangles: Vec<[u32; 3]>,
    /// Its vertices.
    #[serde(rename = "vid")]
    pub vertices: Vec<u32>,
    /// The parameters of each of its vertices.
    pub uv: Vec<[f64; 2]>,
}

/// Reads a quad layout.
///
/// # Errors
/// [`ModelError`] with the file, and what the system says or what is missing.
pub fn read_layout(path: &Path) -> Result<LayoutFile, ModelError> {
    let read = || parse_layout(&read_unpacked(path)?);
    read().map_err(|kind| ModelError { path: path.to_owned(), kind })
}

/// Parses a quad layout.
///
/// # Errors
/// [`ModelErrorKind::Json`].
pub fn parse_layout(bytes: &[u8]) -> Result<LayoutFile, ModelErrorKind> {
    let parse = |bytes: &[u8]| serde_json::from_slice(bytes);
    let parsed = parse(bytes).or_else(|error| {
        // Python writes numbers that are none as NaN, which JSON does not know; where numbers count they are still missed.
        let text = String::from_utf8_lossy(bytes);
        if text.contains("NaN") { parse(text.replace("NaN", "null").as_bytes()) } else { Err(error) }
    });
    parsed.map_err(|error| ModelErrorKind::Json {
        line: error.line(),
        column: error.column(),
        reason: error.to_string(),
    })
}
