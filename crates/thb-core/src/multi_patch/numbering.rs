//! The numbers of functions: those of one vertex or arc are the same for all patches that meet there.

use super::PatchTopology;

/// Numbers functions of level 0: first those at vertices, then those inside arcs from their starts to their ends, then those inside
/// patches, first direction fastest. With `m` functions along each side of each of F patches these are V + E (m − 2) + F (m − 2)².
#[derive(Clone, Debug)]
pub(super) struct Numbering {
    /// Functions along each arc, ends included.
    along: Vec<usize>,
    /// Number of the first function inside each arc.
    first_on_arc: Vec<usize>,
    /// Number of the first function inside each patch.
    first_in_patch: Vec<usize>,
    total: usize,
}

impl Numbering {
    /// For `along` functions on each arc, at least two, as many on opposite sides of a patch.
    pub(super) fn new(topology: &PatchTopology, along: Vec<usize>) -> Self {
        let mut total = topology.n_vertices();
        let mut next = |count: usize| {
            total += count;
            total - count
        };
        let first_on_arc = along.iter().map(|m| next(m - 2)).collect();
        let inside = |sides: &[super::PatchSide; 4]| {
            [0, 1].iter().map(|&side| along[sides[side].arc as usize] - 2).product::<usize>()
        };
        let first_in_patch = topology.patches().iter().map(|sides| next(inside(sides))).collect();
        Self { along, first_on_arc, first_in_patch, total }
    }

    pub(super) fn total(&self) -> usize {
        self.total
    }

    /// The functions along an arc, from its start to its end.
    pub(super) fn on_arc(&self, topology: &PatchTopology, arc: usize) -> Vec<u32> {
        let [start, end] = topology.arcs()[arc];
        let inside = (0..self.along[arc] - 2).map(|k| (self.first_on_arc[arc] + k) as u32);
        std::iter::once(start).chain(inside).chain(std::iter::once(end)).collect()
    }

    /// The number of each function of a patch, first direction fastest.
    pub(super) fn of_patch(&self, topology: &PatchTopology, patch: usize) -> Vec<u32> {
        let sides = &topology.patches()[patch];
        let [m, n] = [0, 1].map(|side| self.along[sides[side].arc as usize]);
        let mut numbers = vec![0; m * n];
        for j in 1..n - 1 {
            for i in 1..m - 1 {
                numbers[j * m + i] = (self.first_in_patch[patch] + (j - 1) * (m - 2) + i - 1) as u32;
            }
        }
        for (side, on) in sides.iter().enumerate() {
            let mut on_side = self.on_arc(topology, on.arc as usize);
            if on.reversed {
                on_side.reverse();
            }
            for (k, &number) in on_side.iter().enumerate() {
                let [i, j] = match side {
                    0 => [k, 0],
                    1 => [m - 1, k],
                    2 => [m - 1 - k, n - 1],
                    _ => [0, n - 1 - k],
                };
                numbers[j * m + i] = number;
            }
        }
        numbers
    }
}
