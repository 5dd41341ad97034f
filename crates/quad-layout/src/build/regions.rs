//! Regions: faces nearest to a seed, in place and direction, that no crease crosses.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

use point_cloud::vec3::{add, dot, norm, scale, sub, unit};

use super::mesh::{Neighbours, WorkMesh};
use crate::edge::edge;

/// A difference of normals counts as much as this share of the diagonal: regions turn little.
///
/// Limit: the middle of the range of an earlier prototype, 0.1 to 0.15; not calibrated yet.
const TURN_COUNTS: f64 = 0.12;

/// Rounds in which seeds move to the middles of their regions.
const ROUNDS: usize = 12;

/// Share of a region's area that may face away from its mean by more than an angle, and its cosine.
const MAY_TURN: f64 = 0.05;
const TURNED: f64 = 0.0;

/// Passes over vertices at which a region touches itself.
const CLEANINGS: usize = 8;

/// A mesh with what distances are measured by.
pub(super) struct Ground<'a> {
    pub(super) mesh: &'a WorkMesh,
    pub(super) neighbours: &'a Neighbours,
    centres: Vec<[f64; 3]>,
    normals: &'a [[f64; 3]],
    areas: Vec<f64>,
    /// Sides of faces that are sharp.
    is_sharp: Vec<[bool; 3]>,
    on_crease: Vec<bool>,
}

/// Which region each face belongs to. Regions from creases come first, in the order of their seeds, then those of single faces.
#[derive(Clone, Debug)]
pub(super) struct Regions {
    pub(super) label: Vec<u32>,
    pub(super) distance: Vec<f64>,
    pub(super) count: usize,
}

impl<'a> Ground<'a> {
    pub(super) fn new(mesh: &'a WorkMesh, neighbours: &'a Neighbours, normals: &'a [[f64; 3]]) -> Self {
        let faces = 0..mesh.faces.len();
        let sharp_sides = |face: usize| {
            let corners = mesh.faces[face];
            std::array::from_fn(|k| mesh.sharp.contains(&edge(corners[k], corners[(k + 1) % 3])))
        };
        let mut on_crease = vec![false; mesh.points.len()];
        mesh.sharp.iter().flatten().for_each(|&v| on_crease[v as usize] = true);
        Self {
            mesh,
            neighbours,
            centres: faces.clone().map(|face| mesh.centre(face)).collect(),
            normals,
            areas: faces.clone().map(|face| mesh.area(face)).collect(),
            is_sharp: faces.map(sharp_sides).collect(),
            on_crease,
        }
    }

    fn apart(&self, a: usize, b: usize) -> f64 {
        let along = sub(self.centres[a], self.centres[b]);
        let turn = sub(self.normals[a], self.normals[b]);
        (dot(along, along) + TURN_COUNTS * TURN_COUNTS * dot(turn, turn)).sqrt()
    }

    /// The nearest seed of each face: regions of several faces from creases, whose faces stay theirs, and single faces.
    pub(super) fn grow(&self, from_creases: &[Vec<u32>], single: &[u32]) -> Regions {
        let n = self.mesh.faces.len();
        let mut label = vec![u32::MAX; n];
        let mut distance = vec![f64::INFINITY; n];
        let mut heap = BinaryHeap::new();
        let mut number = 0;
        for faces in from_creases.iter().map(Vec::as_slice).chain(single.iter().map(std::slice::from_ref)) {
            for &face in faces {
                if label[face as usize] == u32::MAX {
                    (label[face as usize], distance[face as usize]) = (number, 0.0);
                    heap.push(Reverse((0u64, face)));
                }
            }
            number += 1;
        }
        while let Some(Reverse((bits, face))) = heap.pop() {
            let (face, far) = (face as usize, f64::from_bits(bits));
            if far > distance[face] {
                continue;
            }
            for k in 0..3 {
                let next = self.neighbours.across[face][k] as usize;
                if self.is_sharp[face][k] || next >= n {
                    continue;
                }
                let reached = far + self.apart(face, next);
                if reached < distance[next] {
                    distance[next] = reached;
                    label[next] = label[face];
                    // Distances are not negative, so their bits are ordered as they are.
                    heap.push(Reverse((reached.to_bits(), next as u32)));
                }
            }
        }
        Regions { label, distance, count: number as usize }
    }

    /// The face farthest from all seeds, in a region or anywhere; faces without any first.
    pub(super) fn farthest(&self, regions: &Regions, within: Option<u32>) -> Option<(u32, f64)> {
        let of = |face: &usize| within.is_none_or(|region| regions.label[*face] == region);
        let far = (0..regions.label.len())
            .filter(of)
            .max_by(|&a, &b| regions.distance[a].total_cmp(&regions.distance[b]).then(b.cmp(&a)))?;
        Some((far as u32, regions.distance[far]))
    }

    /// Single seeds until none is farther than `radius` from all, then moved to the middles of their regions.
    pub(super) fn spread(&self, from_creases: &[Vec<u32>], radius: f64) -> Vec<u32> {
        let mut single: Vec<u32> = Vec::new();
        if from_creases.is_empty() {
            single.push(self.farthest_from_centre());
        }
        loop {
            let regions = self.grow(from_creases, &single);
            match self.farthest(&regions, None) {
                Some((face, far)) if far > radius && single.len() < self.mesh.faces.len() => single.push(face),
                _ => break,
            }
        }
        self.settle(from_creases, single, ROUNDS)
    }

    fn farthest_from_centre(&self) -> u32 {
        let sum = self.centres.iter().fold([0.0; 3], |sum, c| add(sum, *c));
        let middle = scale(1.0 / self.centres.len() as f64, sum);
        let far = |f: &usize| norm(sub(self.centres[*f], middle));
        (0..self.centres.len()).max_by(|a, b| far(a).total_cmp(&far(b)).then(b.cmp(a))).unwrap_or(0) as u32
    }

    /// Moves single seeds to the middles of their regions.
    fn settle(&self, from_creases: &[Vec<u32>], mut single: Vec<u32>, rounds: usize) -> Vec<u32> {
        for _ in 0..rounds {
            let regions = self.grow(from_creases, &single);
            let mut sums = vec![([0.0; 3], [0.0; 3], 0.0); regions.count];
            for (face, &label) in regions.label.iter().enumerate().filter(|(_, label)| **label != u32::MAX) {
                let (place, normal, all) = &mut sums[label as usize];
                *place = add(*place, scale(self.areas[face], self.centres[face]));
                *normal = add(*normal, scale(self.areas[face], self.normals[face]));
                *all += self.areas[face];
            }
            let mut best = vec![(f64::INFINITY, u32::MAX); regions.count];
            for (face, &label) in regions.label.iter().enumerate().filter(|(_, label)| **label != u32::MAX) {
                let (place, normal, all) = sums[label as usize];
                let (along, turn) = (
                    sub(self.centres[face], scale(1.0 / all, place)),
                    sub(self.normals[face], scale(1.0 / all, normal)),
                );
                let far = dot(along, along) + TURN_COUNTS * TURN_COUNTS * dot(turn, turn);
                let best = &mut best[label as usize];
                if far < best.0 {
                    *best = (far, face as u32);
                }
            }
            let moved: Vec<u32> = best[from_creases.len()..].iter().map(|(_, face)| *face).collect();
            let stays = moved == single || moved.contains(&u32::MAX);
            if stays {
                break;
            }
            single = moved;
        }
        single
    }

    /// Takes faces out of regions that touch themselves in a vertex: the smaller part at the vertex goes to the region beside it.
    pub(super) fn clean(&self, regions: &mut Regions) {
        for _ in 0..CLEANINGS {
            let mut changed = false;
            for vertex in 0..self.mesh.points.len() as u32 {
                if self.on_crease[vertex as usize] {
                    continue;
                }
                let fan = self.mesh.fan(self.neighbours, vertex);
                let runs = runs(&fan, &regions.label);
                for (i, run) in runs.iter().enumerate() {
                    let same = |j: &usize| *j != i && runs[*j].0 == run.0;
                    let Some(other) = (0..runs.len()).find(same) else { continue };
                    if (runs[other].1.len(), other) > (run.1.len(), i) {
                        let to = runs[(i + 1) % runs.len()].0;
                        run.1.iter().for_each(|&face| regions.label[face as usize] = to);
                        changed = true;
                        break;
                    }
                }
            }
            if !changed {
                return;
            }
        }
    }

    /// Regions that are no disks, or turn too far.
    pub(super) fn unfit(&self, regions: &Regions) -> Vec<u32> {
        let mut edges: Vec<BTreeMap<[u32; 2], usize>> = vec![BTreeMap::new(); regions.count];
        let mut vertices: Vec<BTreeSet<u32>> = vec![BTreeSet::new(); regions.count];
        let mut faces: Vec<Vec<usize>> = vec![Vec::new(); regions.count];
        for (face, &label) in regions.label.iter().enumerate().filter(|(_, label)| **label != u32::MAX) {
            let corners = self.mesh.faces[face];
            for k in 0..3 {
                *edges[label as usize].entry(edge(corners[k], corners[(k + 1) % 3])).or_default() += 1;
            }
            vertices[label as usize].extend(corners);
            faces[label as usize].push(face);
        }
        let is_unfit = |&region: &u32| {
            let (edges, faces) = (&edges[region as usize], &faces[region as usize]);
            let euler = vertices[region as usize].len() as isize - edges.len() as isize + faces.len() as isize;
            let rim: Vec<&[u32; 2]> = edges.iter().filter(|(_, uses)| **uses == 1).map(|(side, _)| side).collect();
            let on_rim: BTreeSet<u32> = rim.iter().flat_map(|side| side.iter().copied()).collect();
            let has_slit = edges.iter().any(|(side, uses)| *uses == 2 && self.mesh.sharp.contains(side));
            euler != 1 || rim.len() != on_rim.len() || has_slit || self.turns(faces)
        };
        (0..regions.count as u32).filter(is_unfit).collect()
    }

    /// Regions without faces.
    pub(super) fn empty(regions: &Regions) -> Vec<usize> {
        let mut has = vec![false; regions.count];
        regions.label.iter().filter(|label| **label != u32::MAX).for_each(|&label| has[label as usize] = true);
        (0..regions.count).filter(|&region| !has[region]).collect()
    }

    fn turns(&self, faces: &[usize]) -> bool {
        let mean = unit(faces.iter().fold([0.0; 3], |sum, &f| add(sum, scale(self.areas[f], self.normals[f]))));
        let all: f64 = faces.iter().map(|&f| self.areas[f]).sum();
        let turned: f64 = faces.iter().filter(|f| dot(self.normals[**f], mean) < TURNED).map(|&f| self.areas[f]).sum();
        turned > MAY_TURN * all
    }
}

/// Runs of faces of one label in a fan, cyclic.
pub(super) fn runs(fan: &[(u32, usize)], label: &[u32]) -> Vec<(u32, Vec<u32>)> {
    let mut runs: Vec<(u32, Vec<u32>)> = Vec::new();
    for &(face, _) in fan {
        let of = label[face as usize];
        match runs.last_mut() {
            Some((last, faces)) if *last == of => faces.push(face),
            _ => runs.push((of, vec![face])),
        }
    }
    let closes = runs.len() > 1 && runs[0].0 == runs[runs.len() - 1].0;
    if let Some((_, mut last)) = runs.pop_if(|_| closes) {
        last.append(&mut runs[0].1);
        runs[0].1 = last;
    }
    runs
}
