//! Which borders are halved: a choice for all at once, so that every polygon has an even number of sides and a good cut.
//!
//! The number of halved borders of a polygon is even or odd as its number of sides is. Two choices differ by closed walks from region to
//! region, and walks round nodes together with one for each handle and each loop make all of them. So a search that changes one walk
//! at a time keeps every polygon even, beginning with all borders halved; it is annealed, with numbers that are the same on each run.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use rayon::prelude::*;

use super::disk::Disk;
use super::patchwork::{Patchwork, Side};
use super::patterns::{Cut, Polygon};

/// Steps of the search for each walk.
///
/// Limit: time; not calibrated yet.
const STEPS: usize = 800;

/// Temperatures at its begin and end, in costs of patterns.
const TEMPERATURES: [f64; 2] = [20.0, 0.05];

/// Borders of a polygon beyond which only the choice of halving all is known.
///
/// Limit: 2¹⁰ patterns.
pub(super) const MOST_SIDES: usize = 10;

/// What a region costs that is no disk, and cannot be cut.
const NO_DISK: f64 = 1e6;

/// How each polygon is cut; its vertices are numbered with the middles of all its borders.
#[derive(Debug)]
pub(super) struct Choice {
    pub(super) cuts: Vec<Cut>,
}

struct Search<'a> {
    work: &'a Patchwork,
    /// Of each region that is a disk, with the middles of all its borders.
    polygons: Vec<Option<Polygon>>,
    known: Vec<BTreeMap<u64, (f64, Cut)>>,
}

/// Chooses.
pub(super) fn choose(work: &Patchwork) -> Choice {
    let angles = work.angles();
    let polygons =
        (0..work.polygons.len()).into_par_iter().map(|region| polygon(work, region, &angles[region])).collect();
    let mut search = Search { work, polygons, known: vec![BTreeMap::new(); work.polygons.len()] };
    let walks = walks(work);
    let regions_of = |walk: &Vec<usize>| -> Vec<usize> {
        let regions: BTreeSet<usize> = walk.iter().flat_map(|&border| work.borders[border].sides).collect();
        regions.into_iter().collect()
    };
    let beside: Vec<Vec<usize>> = walks.iter().map(regions_of).collect();
    let mut halved = vec![true; work.borders.len()];
    let mut costs: Vec<f64> = (0..work.polygons.len()).map(|region| search.cost(region, &halved)).collect();
    let mut best = (costs.iter().sum::<f64>(), halved.clone());
    let mut total = best.0;
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let steps = STEPS * walks.len();
    for step in 0..steps {
        let temperature = TEMPERATURES[0] * (TEMPERATURES[1] / TEMPERATURES[0]).powf(step as f64 / steps as f64);
        let which = (random.next() * walks.len() as f64) as usize;
        walks[which].iter().for_each(|&border| halved[border] = !halved[border]);
        let before: f64 = beside[which].iter().map(|&region| costs[region]).sum();
        let after: Vec<f64> = beside[which].iter().map(|&region| search.cost(region, &halved)).collect();
        let change = after.iter().sum::<f64>() - before;
        if change <= 0.0 || random.next() < (-change / temperature).exp() {
            beside[which].iter().zip(after).for_each(|(&region, cost)| costs[region] = cost);
            total += change;
            if total < best.0 - 1e-9 {
                best = (total, halved.clone());
            }
        } else {
            walks[which].iter().for_each(|&border| halved[border] = !halved[border]);
        }
    }
    let halved = best.1;
    let cuts = (0..work.polygons.len()).map(|region| search.pattern(region, &halved).1).collect();
    Choice { cuts }
}

impl Search<'_> {
    fn cost(&mut self, region: usize, halved: &[bool]) -> f64 {
        self.pattern(region, halved).0
    }

    fn pattern(&mut self, region: usize, halved: &[bool]) -> (f64, Cut) {
        let polygon = &self.work.polygons[region];
        let mask = polygon.iter().rev().fold(0u64, |mask, side| mask << 1 | u64::from(halved[side.border]));
        if let Some(found) = self.known[region].get(&mask) {
            return found.clone();
        }
        let middle = |i: usize| halved[polygon[i].border].then_some(2 * i + 1);
        let kept: Vec<usize> = (0..polygon.len()).flat_map(|i| [Some(2 * i), middle(i)]).flatten().collect();
        let found = match &self.polygons[region] {
            Some(whole) => whole.best_of(&kept),
            None => (NO_DISK, Cut::default()),
        };
        self.known[region].insert(mask, found.clone());
        found
    }
}

/// The vertex of a path next to its middle, as a place in it.
pub(super) fn middle(work: &Patchwork, path: &[u32]) -> usize {
    let half = 0.5 * work.length(path);
    let (mut before, mut best) = (0.0, (f64::INFINITY, 1));
    for i in 1..path.len().saturating_sub(1) {
        before += work.length(&path[i - 1..=i]);
        if (before - half).abs() < best.0 {
            best = ((before - half).abs(), i);
        }
    }
    best.1
}

/// The sides of a region, each as two halves.
pub(super) fn all_halved(work: &Patchwork, polygon: &[Side]) -> Vec<Vec<u32>> {
    let mut sides = Vec::new();
    for &side in polygon {
        let path = &work.borders[side.border].path;
        let at = middle(work, path);
        let mut parts = vec![path[..=at].to_vec(), path[at..].to_vec()];
        if side.reversed {
            parts.reverse();
            parts.iter_mut().for_each(|part| part.reverse());
        }
        sides.append(&mut parts);
    }
    sides
}

/// A region with the middles of its borders; none if it is no disk.
fn polygon(work: &Patchwork, region: usize, angles: &[f64]) -> Option<Polygon> {
    let sides = all_halved(work, &work.polygons[region]);
    let angles: Vec<f64> = angles.iter().flat_map(|&angle| [angle, std::f64::consts::PI]).collect();
    Polygon::new(&Disk::new(&work.points, &work.faces[region], &sides)?, &sides, &angles)
}

/// Closed walks from region to region, as the borders they cross: round each node, and with each border beside a tree of regions.
fn walks(work: &Patchwork) -> Vec<Vec<usize>> {
    let mut round: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (number, border) in work.borders.iter().enumerate() {
        for end in [border.path[0], border.path[border.path.len() - 1]] {
            round.entry(end).or_default().push(number);
        }
    }
    let mut walks: Vec<Vec<usize>> = round.into_values().collect();
    let mut beside = vec![Vec::new(); work.polygons.len()];
    for (number, border) in work.borders.iter().enumerate() {
        border.sides.iter().for_each(|&region| beside[region].push(number));
    }
    // By which border, from which region each is reached.
    let mut parent: Vec<Option<(usize, usize)>> = vec![None; work.polygons.len()];
    let mut depth = vec![usize::MAX; work.polygons.len()];
    let mut queue = VecDeque::from([0]);
    depth[0] = 0;
    let mut in_tree = BTreeSet::new();
    while let Some(region) = queue.pop_front() {
        for &border in &beside[region] {
            let [a, b] = work.borders[border].sides;
            let other = if a == region { b } else { a };
            if depth[other] == usize::MAX {
                depth[other] = depth[region] + 1;
                parent[other] = Some((border, region));
                in_tree.insert(border);
                queue.push_back(other);
            }
        }
    }
    for (number, border) in work.borders.iter().enumerate().filter(|(number, _)| !in_tree.contains(number)) {
        let [mut a, mut b] = border.sides;
        let mut walk = vec![number];
        while a != b {
            let deeper = if depth[a] >= depth[b] { &mut a } else { &mut b };
            let Some((border, region)) = parent[*deeper] else { break };
            walk.push(border);
            *deeper = region;
        }
        walks.push(walk);
    }
    // A border that both ends of lie in a node is crossed twice, that is not at all.
    for walk in &mut walks {
        walk.sort_unstable();
        let crossed: Vec<usize> =
            walk.chunk_by(|a, b| a == b).filter(|run| run.len() % 2 == 1).map(|run| run[0]).collect();
        *walk = crossed;
    }
    walks.retain(|walk| !walk.is_empty());
    walks
}

/// Numbers from 0 to 1 by xorshift (Marsaglia 2003).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}
