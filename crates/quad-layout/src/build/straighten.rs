//! Borders drawn anew: regions grown over faces have jagged borders, and nodes where they happened to meet.

use std::collections::BTreeSet;

use super::disk::{Disk, SNAPS};
use super::patchwork::{Patchwork, Side};
use super::patterns::{BROKEN, cost};

/// How often every node is drawn anew.
const SWEEPS: usize = 3;

/// Steps towards the place between others.
const STEPS: usize = 10;

/// A node with what meets there, counter-clockwise.
struct Star {
    /// Borders, as sides that leave the node.
    spokes: Vec<Side>,
    /// The region between each and the next.
    regions: Vec<usize>,
}

impl Patchwork {
    /// Moves smooth nodes to the middles of those around, in a map of the regions round each, with straight borders to them; and
    /// borders between two nodes on creases to straight ones.
    pub(super) fn straighten(&mut self) {
        let on_crease = self.on_crease();
        let is_cut = self.polygons.iter().all(|polygon| polygon.len() == 4);
        for _ in 0..SWEEPS {
            self.lengthen_borders();
            let nodes: BTreeSet<u32> = self.polygons.iter().flatten().map(|&side| self.start(side)).collect();
            for node in nodes.difference(&on_crease) {
                if let Some(star) = self.star(*node) {
                    self.improve(is_cut, &star.regions, |work| {
                        SNAPS.iter().any(|&snap| work.redraw_star(&star, snap).is_some());
                    });
                }
            }
            for border in 0..self.borders.len() {
                let path = &self.borders[border].path;
                let ends = [path[0], path[path.len() - 1]];
                if !self.borders[border].is_sharp && ends.iter().all(|end| on_crease.contains(end)) {
                    let sides = self.borders[border].sides;
                    self.improve(is_cut, &sides, |work| {
                        SNAPS.iter().any(|&snap| work.redraw_border(border, snap).is_some());
                    });
                }
            }
            self.tidy_up();
        }
        self.lengthen_borders();
    }

    /// Changes regions and the borders between them; patches only where that does not make them dearer. Polygons that are yet to be cut have
    /// jagged borders, whose angles tell nothing.
    fn improve(&mut self, is_cut: bool, regions: &[usize], change: impl FnOnce(&mut Self)) {
        if !is_cut {
            return change(self);
        }
        let cost = |work: &Self| regions.iter().map(|&region| work.patch_cost(region)).sum::<f64>();
        let (before, points) = (cost(self), self.points.len());
        let faces: Vec<Vec<[u32; 3]>> = regions.iter().map(|&region| self.faces[region].clone()).collect();
        let borders: BTreeSet<usize> =
            regions.iter().flat_map(|&region| self.polygons[region].iter().map(|side| side.border)).collect();
        let paths: Vec<Vec<u32>> = borders.iter().map(|&border| self.borders[border].path.clone()).collect();
        change(self);
        if cost(self) > before {
            self.points.truncate(points);
            regions.iter().zip(faces).for_each(|(&region, faces)| self.faces[region] = faces);
            borders.iter().zip(paths).for_each(|(&border, path)| self.borders[border].path = path);
        }
    }

    /// Number of patches that break a rule.
    pub(super) fn broken(&self) -> usize {
        (0..self.polygons.len()).filter(|&number| self.patch_cost(number) >= BROKEN).count()
    }

    /// What the shape of a patch costs.
    fn patch_cost(&self, number: usize) -> f64 {
        let (angles, lengths) = self.corners_and_sides(&self.sides_of(number), &self.faces[number]);
        cost(angles, lengths)
    }

    /// Nodes on creases.
    pub(super) fn on_crease(&self) -> BTreeSet<u32> {
        let sharp = self.borders.iter().filter(|border| border.is_sharp);
        sharp.flat_map(|border| [border.path[0], border.path[border.path.len() - 1]]).collect()
    }

    /// What meets at a node; none if a region or a border meets it twice.
    fn star(&self, node: u32) -> Option<Star> {
        // In each region one side leaves the node, and the one before it arrives.
        let mut at: Vec<(usize, Side, Side)> = Vec::new();
        for (region, polygon) in self.polygons.iter().enumerate() {
            for (i, &side) in polygon.iter().enumerate() {
                if self.start(side) == node {
                    at.push((region, side, polygon[(i + polygon.len() - 1) % polygon.len()]));
                }
            }
        }
        let mut star = Star { spokes: Vec::new(), regions: Vec::new() };
        let mut now = 0;
        for _ in 0..at.len() {
            let (region, leaves, arrives) = *at.get(now)?;
            star.spokes.push(leaves);
            star.regions.push(region);
            now = at.iter().position(|(_, other, _)| other.border == arrives.border)?;
        }
        let distinct: BTreeSet<usize> = star.regions.iter().copied().collect();
        let borders: BTreeSet<usize> = star.spokes.iter().map(|side| side.border).collect();
        (now == 0 && distinct.len() == at.len() && borders.len() == at.len()).then_some(star)
    }

    fn redraw_star(&mut self, star: &Star, snap: f64) -> Option<()> {
        let n = star.regions.len();
        let (mut rim, mut ends, mut seams) = (Vec::new(), Vec::new(), Vec::new());
        for (part, (&region, &spoke)) in star.regions.iter().zip(&star.spokes).enumerate() {
            let polygon = &self.polygons[region];
            let first = polygon.iter().position(|&side| side == spoke)?;
            let spoke = self.path(spoke);
            ends.push(spoke[spoke.len() - 1]);
            seams.push(([(part + n - 1) % n, part], spoke));
            rim.extend((1..polygon.len() - 1).map(|i| (part, self.path(polygon[(first + i) % polygon.len()]))));
        }
        let parts: Vec<&[[u32; 3]]> = star.regions.iter().map(|&region| self.faces[region].as_slice()).collect();
        let mut disk = Disk::glued(&self.points, &parts, &seams, &rim)?;
        let ends: Vec<u32> =
            ends.iter().enumerate().map(|(part, &end)| disk.local(part, end)).collect::<Option<_>>()?;
        let places: Vec<[f64; 2]> = ends.iter().map(|&end| disk.uv[end as usize]).collect();
        let centre = disk.vertex_at(between(&places))?;
        let spokes: Vec<Vec<u32>> = ends.iter().map(|&end| disk.cut(centre, end, snap)).collect::<Option<_>>()?;
        let (group, count) = disk.groups();
        if count != spokes.len() {
            return None;
        }
        let mut parted = vec![Vec::new(); count];
        (0..group.len()).for_each(|face| parted[group[face]].push(disk.triangle(face)));
        // The region between a spoke and the next lies to the left of the spoke.
        let mut of_region = Vec::new();
        for spoke in &spokes {
            of_region.push(group[disk.left_of(spoke[0], spoke[1])?]);
        }
        self.points.extend_from_slice(disk.new_points());
        for (i, (&region, &side)) in star.regions.iter().zip(&star.spokes).enumerate() {
            self.faces[region] = std::mem::take(&mut parted[of_region[i]]);
            let mut path = disk.whole(&spokes[i]);
            if side.reversed {
                path.reverse();
            }
            self.borders[side.border].path = path;
        }
        Some(())
    }

    /// Draws a border straight in a map of the regions on both sides.
    fn redraw_border(&mut self, border: usize, snap: f64) -> Option<()> {
        let sides = self.borders[border].sides;
        if sides[0] == sides[1] {
            return None;
        }
        let mut rim = Vec::new();
        for (part, region) in sides.into_iter().enumerate() {
            let polygon = &self.polygons[region];
            let first = polygon.iter().position(|side| side.border == border)?;
            rim.extend((1..polygon.len()).map(|i| (part, self.path(polygon[(first + i) % polygon.len()]))));
        }
        let path = &self.borders[border].path;
        let seams = [([0, 1], path.clone())];
        let mut disk = Disk::glued(&self.points, &sides.map(|region| self.faces[region].as_slice()), &seams, &rim)?;
        let (from, to) = (disk.local(0, path[0])?, disk.local(0, path[path.len() - 1])?);
        let path = disk.cut(from, to, snap)?;
        let (group, count) = disk.groups();
        if count != 2 {
            return None;
        }
        let left = group[disk.left_of(path[0], path[1])?];
        for (i, region) in sides.into_iter().enumerate() {
            let of = (0..group.len()).filter(|&face| (group[face] == left) == (i == 0));
            self.faces[region] = of.map(|face| disk.triangle(face)).collect();
        }
        self.points.extend_from_slice(disk.new_points());
        self.borders[border].path = disk.whole(&path);
        Some(())
    }
}

/// A place between others: nearer ones count more, by the square root of how near. Their mean leaves flat angles between those that
/// lie close together, the place of the shortest way to all pulls nodes together.
fn between(places: &[[f64; 2]]) -> [f64; 2] {
    let mut at = [0.0; 2];
    for _ in 0..STEPS {
        let (mut sum, mut all) = ([0.0; 2], 0.0);
        for place in places {
            let far = (place[0] - at[0]).hypot(place[1] - at[1]);
            let weight = 1.0 / far.max(1e-3).sqrt();
            (0..2).for_each(|d| sum[d] += weight * place[d]);
            all += weight;
        }
        at = sum.map(|x| x / all);
    }
    at
}
