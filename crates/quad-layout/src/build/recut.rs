//! Patches cut anew: where the best cut of a few neighbours costs less than what they are, corners get better or patches fewer.
//!
//! A group of neighbours is a polygon whose vertices are the nodes on its rim. It is cut as regions are (`patterns`), by the angles that
//! its nodes have now; the new patches are drawn, measured, and kept if they cost less than the old ones.

use std::collections::{BTreeMap, BTreeSet};

use point_cloud::DisjointSets;
use point_cloud::vec3::{add, cross, dot, norm, scale, sub};
use rayon::prelude::*;

use super::disk::Disk;
use super::patch_fit::PatchFit;
use super::patches::{drawn, patch};
use super::patchwork::{Patchwork, Side};
use super::patterns::{BROKEN, Cut, Polygon, cost, cost_at_least};
use crate::RawPatch;

/// Most patches of a group, and most sides of its rim.
///
/// Limit: the best cut of a rim takes time as the fourth power of its sides.
const MOST_PATCHES: usize = 14;
const MOST_SIDES: usize = 20;

/// Least gain, in costs of patterns, for which patches are cut anew.
///
/// Limit: each cut splits triangles.
const LEAST_GAIN: f64 = 0.6;

/// Passes over all groups.
const PASSES: usize = 12;

/// What a patch costs whose sides are too long, for each time that they are, or whose normals turn too far, by the share that does.
const TOO_LARGE: f64 = 50.0;

/// Distance of a patch from its triangles, in diagonals, beyond which it is too large to follow them.
const FAR: f64 = 6e-4;

/// Cosine of the angle from the mean normal of a patch beyond which a normal turns too far.
const TURNED: f64 = 0.5;

/// Neighbours, and the rim that they have together, counter-clockwise.
struct Group {
    patches: Vec<usize>,
    rim: Vec<Side>,
}

/// A group, how it is to be cut, and what that is expected to gain.
struct Proposal {
    gain: f64,
    group: Group,
    cut: Cut,
}

/// Patches that are being cut anew. Numbers of patches that were stay unused, without sides.
struct Recut {
    work: Patchwork,
    /// Angles of each patch at the starts of its sides.
    angles: Vec<[f64; 4]>,
    costs: Vec<f64>,
    /// Longest side of a patch.
    longest: f64,
    fit: Option<PatchFit>,
    /// Groups that gain nothing.
    refused: BTreeSet<Vec<usize>>,
}

impl Patchwork {
    /// Cuts groups of patches anew as long as that gains; no side gets longer than `longest` unless all are.
    pub(super) fn recut(self, longest: f64) -> Self {
        let n = self.polygons.len();
        let mut recut = Recut {
            work: self,
            angles: Vec::new(),
            costs: Vec::new(),
            longest,
            fit: PatchFit::new().ok(),
            refused: BTreeSet::new(),
        };
        for number in 0..n {
            recut.measure(number);
        }
        for _ in 0..PASSES {
            if !recut.pass() {
                break;
            }
        }
        recut.work.without_gone()
    }

    /// Without patches and borders that are no more.
    fn without_gone(mut self) -> Self {
        let sharp = super::Plan::sharp_edges(&self);
        let there: Vec<usize> = (0..self.polygons.len()).filter(|&number| !self.polygons[number].is_empty()).collect();
        let mut faces = std::mem::take(&mut self.faces);
        let raw = |number: usize| patch(self.sides_of(number), std::mem::take(&mut faces[number]));
        let patches: Vec<RawPatch> = there.into_iter().map(raw).collect();
        Self::of_patches(std::mem::take(&mut self.points), self.given, patches, &sharp)
    }
}

impl Recut {
    /// Measures the last patch.
    fn measure(&mut self, number: usize) {
        let sides = self.work.sides_of(number);
        let (angles, cost) = self.judged(&sides, &self.work.faces[number]);
        self.angles.push(angles);
        self.costs.push(cost);
    }

    /// The angles of a patch, and what it costs.
    fn judged(&self, sides: &[Vec<u32>; 4], faces: &[[u32; 3]]) -> ([f64; 4], f64) {
        let (angles, lengths) = self.work.corners_and_sides(sides, faces);
        let longest = lengths.iter().copied().fold(0.0, f64::max);
        let far = self.fit.as_ref().and_then(|fit| fit.error(&self.work.points, faces, sides)).unwrap_or(0.0);
        let beyond = |ratio: f64| (ratio - 1.0).max(0.0);
        let too_large = beyond(longest / self.longest) + beyond(far / FAR) + self.turned(faces);
        (angles, cost(angles, lengths) + TOO_LARGE * too_large)
    }

    /// The share of the area of faces whose normals turn too far from their mean.
    fn turned(&self, faces: &[[u32; 3]]) -> f64 {
        let area = |face: &[u32; 3]| {
            let [p, q, r] = face.map(|v| self.work.points[v as usize]);
            cross(sub(q, p), sub(r, p))
        };
        let areas: Vec<[f64; 3]> = faces.iter().map(area).collect();
        let sum = areas.iter().fold([0.0; 3], |sum, a| add(sum, *a));
        let mean = scale(1.0 / norm(sum).max(f64::MIN_POSITIVE), sum);
        let all: f64 = areas.iter().map(|a| norm(*a)).sum();
        let beyond = areas.iter().filter(|a| dot(**a, mean) < TURNED * norm(**a));
        beyond.map(|a| norm(*a)).sum::<f64>() / all.max(f64::MIN_POSITIVE)
    }

    /// Cuts groups that do not touch anew, those that gain most first. Whether any was.
    fn pass(&mut self) -> bool {
        let groups: Vec<Vec<usize>> =
            self.groups().into_iter().filter(|patches| !self.refused.contains(patches)).collect();
        let weighed: Vec<Result<Proposal, Vec<usize>>> =
            groups.into_par_iter().map(|patches| self.proposal(self.group(patches)?)).collect();
        let mut proposals = Vec::new();
        for proposal in weighed {
            match proposal {
                Ok(proposal) => proposals.push(proposal),
                Err(patches) => {
                    self.refused.insert(patches);
                }
            }
        }
        proposals.sort_by(|a, b| b.gain.total_cmp(&a.gain).then_with(|| a.group.patches.cmp(&b.group.patches)));
        let mut touched: BTreeSet<usize> = BTreeSet::new();
        for proposal in proposals {
            if proposal.group.patches.iter().all(|number| !touched.contains(number)) {
                let patches = proposal.group.patches.clone();
                if self.replace(proposal) {
                    touched.extend(patches);
                } else {
                    self.refused.insert(patches);
                }
            }
        }
        self.work.tidy_up();
        !touched.is_empty()
    }

    /// Neighbours: those beside a smooth border, those round its ends, those round a node between creases, each with those beside it,
    /// and as many as there may be round one that breaks a rule.
    fn groups(&self) -> BTreeSet<Vec<usize>> {
        let work = &self.work;
        let mut smooth: Vec<usize> = Vec::new();
        let mut beside: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); work.polygons.len()];
        let mut at: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        let mut seen: BTreeSet<usize> = BTreeSet::new();
        for (number, polygon) in work.polygons.iter().enumerate() {
            for &side in polygon {
                at.entry(work.start(side)).or_default().push(number);
                let border = &work.borders[side.border];
                if !border.is_sharp && border.sides[0] != border.sides[1] && seen.insert(side.border) {
                    smooth.push(side.border);
                    beside[border.sides[0]].insert(border.sides[1]);
                    beside[border.sides[1]].insert(border.sides[0]);
                }
            }
        }
        // What is joined by smooth borders round each node, by the node and a patch.
        let mut round: BTreeMap<(u32, usize), BTreeSet<usize>> = BTreeMap::new();
        let mut ending: BTreeMap<u32, Vec<[usize; 2]>> = BTreeMap::new();
        for &border in &smooth {
            let border = &work.borders[border];
            for end in [border.path[0], border.path[border.path.len() - 1]] {
                ending.entry(end).or_default().push(border.sides);
            }
        }
        for (&node, patches) in &at {
            let mut sets = DisjointSets::new(patches.len());
            let place = |number: usize| patches.iter().position(|&other| other == number);
            for [a, b] in ending.get(&node).into_iter().flatten() {
                if let (Some(a), Some(b)) = (place(*a), place(*b)) {
                    sets.join(a as u32, b as u32);
                }
            }
            let mut members: BTreeMap<u32, BTreeSet<usize>> = BTreeMap::new();
            for (i, &number) in patches.iter().enumerate() {
                members.entry(sets.root(i as u32)).or_default().insert(number);
            }
            for (i, &number) in patches.iter().enumerate() {
                round.insert((node, number), members[&sets.root(i as u32)].clone());
            }
        }
        let mut groups: BTreeSet<Vec<usize>> = BTreeSet::new();
        let mut add = |set: BTreeSet<usize>| {
            if (2..=MOST_PATCHES).contains(&set.len()) {
                groups.insert(set.into_iter().collect());
            }
        };
        round.values().for_each(|set| add(set.clone()));
        for &border in &smooth {
            let border = &work.borders[border];
            add(BTreeSet::from(border.sides));
            let ends = [border.path[0], border.path[border.path.len() - 1]];
            add(ends.iter().flat_map(|&end| &round[&(end, border.sides[0])]).copied().collect());
        }
        for (number, others) in beside.iter().enumerate() {
            add(others.iter().copied().chain([number]).collect());
            if self.costs[number] > BROKEN {
                // One more at a time, from near to far.
                let mut near = vec![number];
                let mut next = 0;
                while next < near.len() && near.len() < MOST_PATCHES {
                    for &other in &beside[near[next]] {
                        if !near.contains(&other) && near.len() < MOST_PATCHES {
                            near.push(other);
                            add(near.iter().copied().collect());
                        }
                    }
                    next += 1;
                }
            }
        }
        groups
    }

    /// Patches with their rim; the patches if a crease runs between them, or the rim is not one line round them.
    fn group(&self, patches: Vec<usize>) -> Result<Group, Vec<usize>> {
        let mut next: BTreeMap<u32, Side> = BTreeMap::new();
        let mut count = 0;
        for &number in &patches {
            for &side in &self.work.polygons[number] {
                let border = &self.work.borders[side.border];
                if border.sides.iter().all(|number| patches.contains(number)) {
                    if border.is_sharp {
                        return Err(patches);
                    }
                    continue;
                }
                count += 1;
                if next.insert(self.work.start(side), side).is_some() {
                    return Err(patches);
                }
            }
        }
        let Some((&first, _)) = next.first_key_value() else { return Err(patches) };
        let (mut rim, mut now) = (Vec::new(), first);
        while let Some(&side) = next.get(&now).filter(|_| rim.len() < count) {
            rim.push(side);
            now = self.work.end(side);
            if now == first {
                break;
            }
        }
        let is_one = rim.len() == count && now == first && count <= MOST_SIDES;
        if is_one { Ok(Group { patches, rim }) } else { Err(patches) }
    }

    /// The best cut of a group, if it is expected to gain.
    fn proposal(&self, group: Group) -> Result<Proposal, Vec<usize>> {
        let mut angle: BTreeMap<u32, f64> = BTreeMap::new();
        for &number in &group.patches {
            for (&side, of) in self.work.polygons[number].iter().zip(&self.angles[number]) {
                *angle.entry(self.work.start(side)).or_default() += of;
            }
        }
        let angles: Vec<f64> = group.rim.iter().map(|&side| angle[&self.work.start(side)]).collect();
        let now = self.cost_of(&group);
        let best = || {
            let faces = self.faces_of(&group);
            let sides: Vec<Vec<u32>> = group.rim.iter().map(|&side| self.work.path(side)).collect();
            let polygon = Polygon::new(&Disk::new(&self.work.points, &faces, &sides)?, &sides, &angles)?;
            let (cost, cut) = polygon.best();
            Some((now - cost, cut))
        };
        let gain_at_most = now - cost_at_least(&angles);
        match (gain_at_most > 2.0 * LEAST_GAIN).then(best).flatten() {
            Some((gain, cut)) if gain > LEAST_GAIN => Ok(Proposal { gain, group, cut }),
            _ => Err(group.patches),
        }
    }

    fn faces_of(&self, group: &Group) -> Vec<[u32; 3]> {
        group.patches.iter().flat_map(|&number| self.work.faces[number].iter().copied()).collect()
    }

    fn cost_of(&self, group: &Group) -> f64 {
        group.patches.iter().map(|&number| self.costs[number]).sum()
    }

    /// Draws a proposal, and keeps it if it gains.
    fn replace(&mut self, Proposal { group, cut, .. }: Proposal) -> bool {
        let before = self.work.points.len();
        let sides: Vec<Vec<u32>> = group.rim.iter().map(|&side| self.work.path(side)).collect();
        let faces = self.faces_of(&group);
        let Some(patches) = drawn(&mut self.work.points, &faces, &sides, &cut) else { return false };
        let judged = |patch: &RawPatch| self.judged(&patch.paths, &patch.triangles).1;
        let gain = self.cost_of(&group) - patches.iter().map(judged).sum::<f64>();
        if gain < LEAST_GAIN {
            self.work.points.truncate(before);
            return false;
        }
        let mut known: BTreeMap<(u32, u32), Side> = BTreeMap::new();
        for &side in &group.rim {
            let path = self.work.path(side);
            known.insert((path[0], path[1]), side);
        }
        for &number in &group.patches {
            self.work.polygons[number].clear();
            self.work.faces[number].clear();
        }
        for RawPatch { paths, triangles, .. } in patches {
            let number = self.work.polygons.len();
            let sides = paths.into_iter().map(|path| self.work.side(&mut known, path, number, &BTreeSet::new()));
            let sides = sides.collect();
            self.work.polygons.push(sides);
            self.work.faces.push(triangles);
            self.measure(number);
        }
        true
    }
}
