//! Lines that are straight in the map of a disk, without cutting it.

use std::collections::BTreeMap;

use point_cloud::vec3::{add, scale, sub};

use super::disk::{Disk, minus, turn};

/// Follows straight lines of the map without cutting.
pub(super) struct Tracer<'a> {
    disk: &'a Disk,
    /// Half-edges, increasing, each with the third vertex of the face to its left.
    left: Vec<([u32; 2], u32)>,
    /// The other two vertices of the faces at each vertex of the rim, counter-clockwise.
    at: BTreeMap<u32, Vec<[u32; 2]>>,
}

impl<'a> Tracer<'a> {
    pub(super) fn new(disk: &'a Disk) -> Self {
        let mut left = Vec::with_capacity(3 * disk.faces.len());
        let mut at: BTreeMap<u32, Vec<[u32; 2]>> = BTreeMap::new();
        for &face in &disk.faces {
            for k in 0..3 {
                let [a, b, c] = [0, 1, 2].map(|i| face[(k + i) % 3]);
                left.push(([a, b], c));
                if disk.is_blocked(a) {
                    at.entry(a).or_default().push([b, c]);
                }
            }
        }
        left.sort_unstable();
        Self { disk, left, at }
    }

    /// The line between two vertices of the rim, in space.
    pub(super) fn line(&self, from: u32, to: u32) -> Option<Vec<[f64; 3]>> {
        let (uv, points) = (&self.disk.uv, &self.disk.points);
        let start = uv[from as usize];
        let way = minus(uv[to as usize], start);
        let off = |v: u32| turn(way, minus(uv[v as usize], start));
        let ends = [points[from as usize], points[to as usize]];
        let beside = self.at.get(&from)?;
        if beside.iter().any(|pair| pair.contains(&to)) {
            return Some(ends.to_vec());
        }
        let clear = |pair: &[u32; 2]| (-off(pair[0])).min(off(pair[1]));
        let ahead = |pair: &&[u32; 2]| off(pair[1]) > off(pair[0]);
        let &[mut right, mut left] = beside.iter().filter(ahead).max_by(|a, b| clear(a).total_cmp(&clear(b)))?;
        let mut line = vec![ends[0]];
        for _ in 0..self.disk.faces.len() {
            let (r, l) = (off(right).abs(), off(left).abs());
            let [p, q] = [right, left].map(|v| points[v as usize]);
            line.push(add(p, scale(r / (r + l).max(f64::MIN_POSITIVE), sub(q, p))));
            let third =
                self.left.binary_search_by_key(&[left, right], |(edge, _)| *edge).ok().map(|i| self.left[i].1)?;
            if third == to {
                line.push(ends[1]);
                return Some(line);
            }
            *(if off(third) > 0.0 { &mut left } else { &mut right }) = third;
        }
        None
    }
}
