//! Where regions begin: seeds are added until each region is a disk with three sides at least.

use std::collections::BTreeSet;

use super::choose::MOST_SIDES;
use super::lines::{Lines, Seeds};
use super::mesh::{Neighbours, WorkMesh};
use super::patchwork::{Patchwork, Side};
use super::refine::part_from_creases;
use super::regions::{Ground, Regions};
use super::rungs;
use crate::LayoutError;
use crate::edge::edge;

/// Spacing of crossings along creases, in radii of regions.
const SPACING: f64 = 1.5;

/// Edges of a crease between two crossings, at least.
const EDGES: usize = 4;

/// Rounds in which seeds are added, and in which triangles along creases are split.
///
/// Limit: where regions do not become disks by then, smaller ones are tried.
const ROUNDS: usize = 20;
const SPLITS: usize = 5;

/// Rounds of averaging normals.
const SMOOTHING: usize = 15;

/// An interval of a crease is halved, rather than a seed put in the inside, if it is longer than this times the way inside.
const LONG: f64 = 2.5;

/// A mesh with creases, and the seeds so far.
pub(super) struct Plan {
    mesh: WorkMesh,
    neighbours: Neighbours,
    /// Smoothed normals of its faces.
    normals: Vec<[f64; 3]>,
    lines: Lines,
    crossings: BTreeSet<u32>,
    /// Nodes on creases at which no arc need end.
    nodes: BTreeSet<u32>,
    spacing: f64,
    /// Whether regions reach across narrow faces from crease to crease.
    spans_narrow: bool,
    single: Vec<u32>,
    /// The regions at the last attempt.
    regions: Option<Regions>,
}

impl Plan {
    pub(super) fn new(mut mesh: WorkMesh, radius: f64, spans_narrow: bool) -> Self {
        part_from_creases(&mut mesh);
        let neighbours = mesh.neighbours();
        let lines = Lines::trace(&mesh);
        let spacing = SPACING * radius;
        let crossings = rungs::crossings(&mesh, &neighbours, &lines, spacing);
        let mut plan = Self {
            mesh,
            neighbours,
            normals: Vec::new(),
            lines,
            crossings,
            nodes: BTreeSet::new(),
            spacing,
            spans_narrow,
            single: Vec::new(),
            regions: None,
        };
        plan.split();
        let ground = Ground::new(&plan.mesh, &plan.neighbours, &plan.normals);
        let seeds = plan.lines.seeds(&plan.mesh, &plan.neighbours);
        plan.single = ground.spread(&seeds.faces, radius);
        plan
    }

    /// Splits triangles along creases until there is room; seeds lose their places.
    fn split(&mut self) {
        for round in 0..=SPLITS {
            self.neighbours = self.mesh.neighbours();
            let fewer = std::mem::take(&mut self.lines.fewer);
            self.lines = Lines { fewer, ..Lines::trace(&self.mesh) };
            for line in &mut self.lines.lines {
                let end = line.path.len() - 1;
                let is_inner = |at: &usize| (line.is_closed || *at > 0) && *at < end;
                line.crossings =
                    (0..=end).filter(is_inner).filter(|&at| self.crossings.contains(&line.path[at])).collect();
            }
            if self.spans_narrow {
                self.lines.joined = rungs::joined(&self.mesh, &self.neighbours, &self.lines, self.spacing);
            }
            let mut halved: BTreeSet<[u32; 2]> = BTreeSet::new();
            for line in &self.lines.lines {
                for pair in line.ends().windows(2).filter(|pair| pair[1] - pair[0] < EDGES) {
                    halved.extend((pair[0]..pair[1]).map(|i| edge(line.path[i], line.path[i + 1])));
                }
            }
            for vertex in self.lines.seeds(&self.mesh, &self.neighbours).crowded {
                for (face, k) in self.mesh.fan(&self.neighbours, vertex) {
                    let corners = self.mesh.faces[face as usize];
                    halved.insert(edge(corners[(k + 1) % 3], corners[(k + 2) % 3]));
                }
            }
            if halved.is_empty() || round == SPLITS {
                break;
            }
            self.mesh.halve(&halved);
            part_from_creases(&mut self.mesh);
        }
        self.normals = self.mesh.smooth_normals(&self.neighbours, SMOOTHING);
    }

    /// Regions that are all disks of three sides at least, as polygons.
    ///
    /// # Errors
    /// [`LayoutError::NotCut`].
    pub(super) fn patchwork(&mut self) -> Result<Patchwork, LayoutError> {
        let mut left = 0;
        for _ in 0..ROUNDS {
            let seeds = self.lines.seeds(&self.mesh, &self.neighbours);
            let ground = Ground::new(&self.mesh, &self.neighbours, &self.normals);
            let mut regions = ground.grow(&seeds.faces, &self.single);
            ground.clean(&mut regions);
            let empty = Ground::empty(&regions);
            if let Some(&region) = empty.iter().rev().find(|&&region| region >= seeds.faces.len()) {
                // Its face became that of a region from a crease, or it was less than a face wide.
                self.single.remove(region - seeds.faces.len());
                continue;
            }
            let mut unfit = ground.unfit(&regions);
            let mut at_borders = Vec::new();
            if unfit.is_empty() {
                match Patchwork::new(&ground, &regions, &(&self.lines.corners | &self.nodes)) {
                    Ok(work) => {
                        at_borders = few_sided(&work);
                        let many = |region: &u32| work.polygons[*region as usize].len() > MOST_SIDES;
                        unfit = (0..regions.count as u32).filter(many).collect();
                        if at_borders.is_empty() && unfit.is_empty() {
                            self.regions = Some(regions);
                            return Ok(work);
                        }
                    }
                    Err(bare) => unfit = bare,
                }
            }
            left = unfit.len() + at_borders.len();
            tracing::debug!(regions = regions.count, ?unfit, ?at_borders, "regions are added");
            let additions: Vec<Addition> =
                unfit.iter().filter_map(|&region| self.within(&ground, &seeds, &regions, region)).collect();
            let borders: Vec<Addition> = at_borders.iter().filter_map(|few| self.beside(&regions, few)).collect();
            let before = self.size();
            self.add_all(additions.into_iter().chain(borders));
            if before == self.size() {
                break;
            }
        }
        Err(LayoutError::NotCut { regions: left.max(1), reason: "they become no disks of three sides" })
    }

    /// Parts regions of the last patchwork.
    ///
    /// # Errors
    /// [`LayoutError::NotCut`] where there is no room.
    pub(super) fn part(&mut self, of: &[u32]) -> Result<(), LayoutError> {
        let Some(regions) = self.regions.take() else { return Ok(()) };
        let seeds = self.lines.seeds(&self.mesh, &self.neighbours);
        let ground = Ground::new(&self.mesh, &self.neighbours, &self.normals);
        let additions: Vec<Addition> =
            of.iter().filter_map(|&region| self.across(&ground, &seeds, &regions, region)).collect();
        let before = self.size();
        self.add_all(additions.into_iter());
        if before == self.size() {
            return Err(LayoutError::NotCut { regions: of.len(), reason: "there is no room for smaller ones" });
        }
        Ok(())
    }

    /// Edges of sharp borders, halved as they are there.
    pub(super) fn sharp_edges(work: &Patchwork) -> BTreeSet<[u32; 2]> {
        let sharp = work.borders.iter().filter(|border| border.is_sharp);
        sharp.flat_map(|border| border.path.windows(2).map(|pair| edge(pair[0], pair[1]))).collect()
    }

    fn size(&self) -> [usize; 4] {
        [self.single.len(), self.crossings.len(), self.nodes.len(), self.lines.fewer.len()]
    }

    /// The longest interval along a region: its length, and a vertex in its middle if there is one.
    fn longest_interval(&self, seeds: &Seeds, region: usize) -> Option<(f64, Option<u32>)> {
        let mut best: Option<(f64, Option<u32>)> = None;
        for line in &self.lines.lines {
            let lengths = line.lengths(&self.mesh);
            for pair in line.ends().windows(2) {
                let step = (line.path[pair[0]], line.path[pair[0] + 1]);
                let is_beside = [step, (step.1, step.0)].iter().any(|s| seeds.of_half_edge.get(s) == Some(&region));
                let length = lengths[pair[1]] - lengths[pair[0]];
                if is_beside && best.is_none_or(|(longest, _)| length > longest) {
                    let middle = line.middle(&lengths, [pair[0], pair[1]]);
                    best = Some((length, middle.map(|at| line.path[at])));
                }
            }
        }
        best
    }

    /// What parts a region.
    fn within(&self, ground: &Ground<'_>, seeds: &Seeds, regions: &Regions, region: u32) -> Option<Addition> {
        let far = ground.farthest(regions, Some(region));
        let interval = self.longest_interval(seeds, region as usize).filter(|_| (region as usize) < seeds.faces.len());
        match (far, interval) {
            (Some((_, far)), Some((length, Some(vertex)))) if length > LONG * far => Some(Addition::Crossing(vertex)),
            (Some((face, far)), _) if far > 0.0 => Some(Addition::Seed(face)),
            (_, Some((_, Some(vertex)))) => Some(Addition::Crossing(vertex)),
            _ => None,
        }
    }

    /// What parts a region from side to side: a second crossing if arcs end on its crease from beyond.
    fn across(&self, ground: &Ground<'_>, seeds: &Seeds, regions: &Regions, region: u32) -> Option<Addition> {
        let is_of = |side: (u32, u32)| seeds.of_half_edge.get(&side) == Some(&(region as usize));
        let is_met = |line: &super::lines::Line| {
            line.crossings.iter().any(|&at| {
                let before = if at == 0 { line.path.len() - 2 } else { at - 1 };
                let [a, v, b] = [before, at, at + 1].map(|i| line.path[i]);
                (is_of((a, v)) && is_of((v, b))) || (is_of((v, a)) && is_of((b, v)))
            })
        };
        match self.longest_interval(seeds, region as usize) {
            Some((_, Some(vertex))) if self.lines.lines.iter().any(is_met) => Some(Addition::Crossing(vertex)),
            _ => self.within(ground, seeds, regions, region),
        }
    }

    /// What gives a region with few sides another one, or takes it away: a seed at the middle of a smooth border, a node in that of a
    /// crease; one region fewer round the corner of creases that one without a crease began at.
    fn beside(&self, regions: &Regions, few: &FewSided) -> Option<Addition> {
        let path = &few.longest;
        let Lines { corners, fewer, .. } = &self.lines;
        let is_corner = |v: &&u32| corners.contains(v) && !fewer.contains(v);
        if let Some(&corner) = few.ends_of_two_smooth.iter().find(is_corner) {
            return Some(Addition::Fewer(corner));
        }
        // Vertices beyond those of the mesh halve edges of short borders.
        let known: Vec<u32> = path.iter().copied().filter(|&v| (v as usize) < self.mesh.points.len()).collect();
        let middle = known[known.len() / 2];
        if self.mesh.sharp.contains(&edge(known[0], known[1])) {
            return (known.len() > 2).then_some(Addition::Node(middle));
        }
        let fan = self.mesh.fan(&self.neighbours, middle);
        let far = |face: &u32| regions.distance[*face as usize];
        let face = fan.iter().map(|(face, _)| *face).max_by(|a, b| far(a).total_cmp(&far(b)).then(b.cmp(a)))?;
        Some(Addition::Seed(face))
    }

    fn add_all(&mut self, additions: impl Iterator<Item = Addition>) {
        let before = self.crossings.len();
        additions.for_each(|addition| self.add(addition));
        if self.crossings.len() > before {
            self.split_keeping_seeds();
        }
    }

    fn add(&mut self, addition: Addition) {
        match addition {
            Addition::Seed(face) if !self.single.contains(&face) => self.single.push(face),
            Addition::Seed(_) => {}
            Addition::Node(vertex) => {
                self.nodes.insert(vertex);
            }
            Addition::Crossing(vertex) => {
                self.crossings.insert(vertex);
            }
            Addition::Fewer(corner) => {
                self.lines.fewer.insert(corner);
            }
        }
    }

    /// Splits triangles; single seeds go to the faces nearest to where they were.
    fn split_keeping_seeds(&mut self) {
        let places: Vec<[f64; 3]> = self.single.iter().map(|&face| self.mesh.centre(face as usize)).collect();
        let before = self.mesh.faces.len();
        self.split();
        if self.mesh.faces.len() == before {
            return;
        }
        let corners: Vec<[[f64; 3]; 3]> = (0..self.mesh.faces.len()).map(|face| self.mesh.corners(face)).collect();
        let tree = point_cloud::TriangleTree::new(&corners);
        self.single = places.into_iter().map(|place| tree.nearest(place).triangle).collect();
    }
}

/// What parts a region.
#[derive(Clone, Copy, Debug)]
enum Addition {
    Seed(u32),
    Crossing(u32),
    Node(u32),
    Fewer(u32),
}

/// A region of fewer than three sides, or one on both sides of a border.
#[derive(Debug)]
struct FewSided {
    /// Its longest border; the longest smooth one, where it has some.
    longest: Vec<u32>,
    /// Where its sides meet, if it has two and neither is along a crease.
    ends_of_two_smooth: Vec<u32>,
}

/// The regions of fewer than three sides, and those that are on both sides of a border.
fn few_sided(work: &Patchwork) -> Vec<FewSided> {
    let mut found = Vec::new();
    for polygon in &work.polygons {
        let meets_itself = polygon.iter().any(|side| {
            let [a, b] = work.borders[side.border].sides;
            a == b
        });
        if polygon.len() < 3 || meets_itself {
            let is_smooth = |side: &&Side| !work.borders[side.border].is_sharp;
            let longest = |sides: &mut dyn Iterator<Item = &Side>| {
                sides.map(|&side| work.path(side)).max_by(|a, b| work.length(a).total_cmp(&work.length(b)))
            };
            let Some(longest) = longest(&mut polygon.iter().filter(is_smooth)).or_else(|| longest(&mut polygon.iter()))
            else {
                continue;
            };
            let has_two_smooth = polygon.len() == 2 && polygon.iter().all(|side| is_smooth(&side));
            let ends_of_two_smooth =
                if has_two_smooth { polygon.iter().map(|&side| work.path(side)[0]).collect() } else { Vec::new() };
            found.push(FewSided { longest, ends_of_two_smooth });
        }
    }
    found
}
