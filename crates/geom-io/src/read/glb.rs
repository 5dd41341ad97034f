//! Binary glTF 2.0: the triangles of the scene's meshes, where its nodes put them.
//!
//! Only what the file itself holds is read: no buffers in other files, no compressed meshes, no skins or morph targets.

use gltf::buffer::Source;
use gltf::mesh::Mode;
use gltf::{Buffer, Gltf, Node, Primitive};

use super::decoder::{malformed, shielded};
use super::faces::{Faces, vertex_index};
use super::source::Budget;
use super::{Format, Scan, rows};
use crate::error::{Location, ReadErrorKind};

const NAME: &str = "GLB";

/// Limit: objects of the JSON part. The decoder reserves up to a kilobyte for each, however short it is: so many always, and
/// one for as many bytes of the file.
const FEW_OBJECTS: usize = 20_000;
const BYTES_PER_OBJECT: usize = 24;

/// Bytes of a vertex and of a triangle in memory.
const VERTEX: usize = 24;
const TRIANGLE: usize = 12;

pub(super) fn read(bytes: &[u8], budget: &mut Budget) -> Result<Scan, ReadErrorKind> {
    shielded(NAME, || {
        let objects = bytes.iter().filter(|&&byte| byte == b'{').count();
        if objects > FEW_OBJECTS + bytes.len() / BYTES_PER_OBJECT {
            return Err(malformed(
                NAME,
                format!("the description has up to {objects} objects, more than a file of this size needs"),
            ));
        }
        let file = Gltf::from_slice(bytes).map_err(|error| malformed(NAME, error))?;
        let mut meshes = Meshes::new(file.blob.as_deref().unwrap_or_default(), budget);
        let scene = file.default_scene().or_else(|| file.scenes().next());
        match scene {
            Some(scene) => {
                let mut is_reached = vec![false; file.nodes().count()];
                let mut open: Vec<(Node<'_>, Frame)> = scene.nodes().map(|node| (node, Frame::default())).collect();
                while let Some((node, outer)) = open.pop() {
                    if std::mem::replace(&mut is_reached[node.index()], true) {
                        return Err(malformed(
                            NAME,
                            format!("node {} (counted from 0) stands in two places", node.index()),
                        ));
                    }
                    let frame = outer.then(&node);
                    for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
                        meshes.add(&primitive, &frame)?;
                    }
                    open.extend(node.children().map(|child| (child, frame)));
                }
            }
            None => {
                for primitive in file.meshes().flat_map(|mesh| mesh.primitives()) {
                    meshes.add(&primitive, &Frame::default())?;
                }
            }
        }
        Ok(meshes.finish())
    })
}

/// Where the coordinates of a node stand in the scene: a matrix by columns.
#[derive(Clone, Copy)]
struct Frame([[f64; 4]; 4]);

impl Default for Frame {
    fn default() -> Self {
        Self(std::array::from_fn(|j| std::array::from_fn(|i| f64::from(u8::from(i == j)))))
    }
}

impl Frame {
    /// The frame of a node within this one.
    fn then(&self, node: &Node<'_>) -> Self {
        let inner = node.transform().matrix().map(|column| column.map(f64::from));
        Self(std::array::from_fn(|j| std::array::from_fn(|i| (0..4).map(|k| self.0[k][i] * inner[j][k]).sum())))
    }

    fn place(&self, point: [f64; 3]) -> [f64; 3] {
        let [x, y, z, origin] = &self.0;
        std::array::from_fn(|i| x[i] * point[0] + y[i] * point[1] + z[i] * point[2] + origin[i])
    }

    /// Whether left becomes right.
    fn mirrors(&self) -> bool {
        let [a, b, c, _] = &self.0;
        let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
        (0..3).map(|k| a[k] * cross[k]).sum::<f64>() < 0.0
    }
}

/// Vertices and triangles so far.
struct Meshes<'a> {
    blob: &'a [u8],
    budget: &'a mut Budget,
    coordinates: Vec<f64>,
    faces: Faces,
    lines: usize,
}

impl<'a> Meshes<'a> {
    fn new(blob: &'a [u8], budget: &'a mut Budget) -> Self {
        Self { blob, budget, coordinates: Vec::new(), faces: Faces::default(), lines: 0 }
    }

    fn add(&mut self, primitive: &Primitive<'_>, frame: &Frame) -> Result<(), ReadErrorKind> {
        let first = self.coordinates.len() / 3;
        let beyond = || malformed(NAME, "vertices or indices lie outside of the file; write one file with all in it");
        let Some(positions) = primitive.get(&gltf::Semantic::Positions) else { return Ok(()) };
        self.budget.spend(positions.count().saturating_mul(VERTEX))?;
        let blob = self.blob;
        let reader = primitive.reader(move |buffer: Buffer<'_>| matches!(buffer.source(), Source::Bin).then_some(blob));
        for position in reader.read_positions().ok_or_else(beyond)? {
            self.coordinates.extend(frame.place(position.map(f64::from)));
        }
        let added = self.coordinates.len() / 3 - first;
        let location = || Location::Record { element: "point".to_owned(), index: first };
        let listed = match primitive.indices() {
            Some(indices) => {
                self.budget.spend(indices.count().saturating_mul(TRIANGLE))?;
                let indices = reader.read_indices().ok_or_else(beyond)?.into_u32();
                let found = indices.map(|index| vertex_index(index.into(), added, location));
                found.collect::<Result<Vec<u32>, _>>()?
            }
            None => {
                let last = added.saturating_sub(1) as i64;
                vertex_index(last, added.max(1), location)?;
                self.budget.spend(added.saturating_mul(TRIANGLE))?;
                (0..added as u32).collect()
            }
        };
        // Vertices of all meshes are numbered together.
        vertex_index((first + added) as i64, usize::MAX, location)?;
        let mut corners: Vec<u32> = listed.into_iter().map(|index| index + first as u32).collect();
        let is_mirrored = frame.mirrors();
        match primitive.mode() {
            Mode::Triangles => {
                for triangle in corners.chunks_exact_mut(3) {
                    if is_mirrored {
                        triangle.swap(0, 1);
                    }
                    self.faces.push(triangle);
                }
            }
            Mode::TriangleStrip => {
                // A corner twice turns the strip about.
                if let (true, Some(&corner)) = (is_mirrored, corners.first()) {
                    corners.insert(0, corner);
                }
                self.faces.push_strip(&corners);
            }
            Mode::TriangleFan => {
                if let (true, Some(others)) = (is_mirrored, corners.get_mut(1..)) {
                    others.reverse();
                }
                for pair in corners.get(1..).unwrap_or_default().windows(2) {
                    self.faces.push(&[corners[0], pair[0], pair[1]]);
                }
            }
            Mode::Points => {}
            Mode::Lines | Mode::LineLoop | Mode::LineStrip => self.lines += 1,
        }
        Ok(())
    }

    fn finish(self) -> Scan {
        let mut scan = Scan::new(Format::Glb, rows(self.coordinates, 3));
        scan.triangles = self.faces.finish(&mut scan.notes);
        if self.lines > 0 {
            scan.notes.push(format!("{} meshes of lines were ignored; their points were read", self.lines));
        }
        scan
    }
}
