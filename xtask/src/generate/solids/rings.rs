//! Rings of vertices round an axis, and strips of triangles between them, which need not have as many.

use std::f64::consts::TAU;

use super::outline::Section;
use super::part::{Part, Point, ROUND};

/// Vertices in order; the last one is the first again.
#[derive(Clone, Debug)]
pub(super) struct Ring {
    /// Increasing places; what is at one place in two rings lies opposite each other.
    keys: Vec<f64>,
    vertices: Vec<usize>,
}

impl Ring {
    /// A circle round the z axis, counter-clockwise from above, with edges of about that length, at most `ROUND` radii; a point, of radius 0. Every
    /// second ring (`odd`) is turned by half an edge.
    pub(super) fn circle(part: &mut Part, radius: f64, z: f64, edge: f64, odd: bool) -> Self {
        if radius == 0.0 {
            let pole = part.add([0.0, 0.0, z]);
            return Self { keys: vec![0.0, 1.0], vertices: vec![pole; 2] };
        }
        let count = (TAU * radius / edge.min(ROUND * radius)).round();
        let phase = if odd { 0.5 / count } else { 0.0 };
        let keys: Vec<f64> = (0..=count as usize).map(|k| phase + k as f64 / count).collect();
        let mut vertices: Vec<usize> = keys[1..]
            .iter()
            .map(|key| {
                let (sin, cos) = (TAU * key).sin_cos();
                part.add([radius * cos, radius * sin, z])
            })
            .collect();
        vertices.rotate_right(1);
        vertices.push(vertices[0]);
        Self { keys, vertices }
    }

    /// An outline at a height, with edges of about those lengths on straight and round sections. Every second ring (`odd`) has its
    /// vertices in the middles of the others' edges.
    pub(super) fn outline(part: &mut Part, outline: &[Section], z: f64, edges: [f64; 2], odd: bool) -> Self {
        let (mut keys, mut vertices) = (Vec::new(), Vec::new());
        for (number, section) in outline.iter().enumerate() {
            let first = match vertices.last() {
                // A section that is a point ends where it begins.
                Some(&last) if number > 0 && outline[number - 1].length() == 0.0 => last,
                _ => part.add(lifted(section.at(0.0), z)),
            };
            keys.push(number as f64);
            vertices.push(first);
            if section.length() > 0.0 {
                for t in section.inner(edges, odd) {
                    keys.push(number as f64 + t);
                    vertices.push(part.add(lifted(section.at(t), z)));
                }
            }
        }
        keys.push(outline.len() as f64);
        vertices.push(vertices[0]);
        Self { keys, vertices }
    }

    /// The vertices, each once, in order.
    pub(super) fn corners(&self) -> Vec<usize> {
        let mut corners = self.vertices[..self.vertices.len() - 1].to_vec();
        corners.dedup();
        corners
    }

    /// Makes the edges of the ring creases.
    pub(super) fn sharpen(&self, part: &mut Part) {
        self.vertices.windows(2).for_each(|edge| part.crease(edge[0], edge[1]));
    }

    /// Makes edges to the next ring creases where sections that meet at a corner begin.
    pub(super) fn sharpen_corners(&self, above: &Self, outline: &[Section], part: &mut Part) {
        for (number, section) in outline.iter().enumerate() {
            let before = &outline[(number + outline.len() - 1) % outline.len()];
            if section.starts_sharp(before) {
                let here = |ring: &Self| ring.vertices[ring.keys.partition_point(|&key| key < number as f64)];
                part.crease(here(self), here(above));
            }
        }
    }

    /// Triangles between this ring and the one above it (from outside, where rings run counter-clockwise): each edge gets the vertex
    /// of the other ring that lies opposite its middle.
    pub(super) fn strip(&self, above: &Self, part: &mut Part) {
        let (mut i, mut j) = (0, 0);
        let middle = |keys: &[f64], k: usize| if k + 1 < keys.len() { keys[k] + keys[k + 1] } else { f64::INFINITY };
        while i + 1 < self.keys.len() || j + 1 < above.keys.len() {
            if middle(&self.keys, i) < middle(&above.keys, j) {
                part.triangle([self.vertices[i], self.vertices[i + 1], above.vertices[j]]);
                i += 1;
            } else {
                part.triangle([self.vertices[i], above.vertices[j + 1], above.vertices[j]]);
                j += 1;
            }
        }
    }
}

fn lifted([x, y]: [f64; 2], z: f64) -> Point {
    [x, y, z]
}
