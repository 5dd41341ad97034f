//! Which sides of which patches are one arc.

use thiserror::Error;

/// One side of a patch: the arc it lies on, and whether the side runs against it.
///
/// Patches are unit squares. Side `s` runs from corner `s` to corner `s + 1` (mod 4), counter-clockwise in (u, v):
/// corners 0 to 3 are (0, 0), (1, 0), (1, 1), (0, 1), so side 0 is v = 0, side 1 u = 1, side 2 v = 1 and side 3 u = 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PatchSide {
    /// The arc.
    pub arc: u32,
    /// Whether the side ends where the arc starts.
    pub reversed: bool,
}

/// A side that lies on an arc.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArcUse {
    /// The patch.
    pub patch: u32,
    /// Its side, 0 to 3.
    pub side: u8,
    /// Whether the side runs against the arc.
    pub reversed: bool,
}

/// What lies across a side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crossing {
    /// The arc that is crossed.
    pub arc: u32,
    /// The patch behind it.
    pub patch: u32,
    /// Its side.
    pub side: u8,
    /// Whether the two sides run in opposite directions, as they do where both patches are oriented alike.
    pub opposite: bool,
}

/// Patches of four sides, glued along arcs.
///
/// Every arc is a side of one patch (then it lies on the boundary) or of two, in any relative orientation; around every vertex the
/// patches form one fan or one closed ring.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PatchTopology {
    n_vertices: usize,
    arcs: Vec<[u32; 2]>,
    patches: Vec<[PatchSide; 4]>,
    /// Of each arc the sides on it, by patch and side.
    uses: Vec<Vec<ArcUse>>,
}

/// Why patches cannot be glued.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum TopologyError {
    /// There is nothing to glue.
    #[error("there is no patch")]
    NoPatch,
    /// An arc ends at a vertex that does not exist.
    #[error("arc {arc} ends at vertex {vertex}, but there are only {vertices}")]
    NoSuchVertex {
        /// The arc.
        arc: usize,
        /// The vertex.
        vertex: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// A side names an arc that does not exist.
    #[error("side {side} of patch {patch} lies on arc {arc}, but there are only {arcs}")]
    NoSuchArc {
        /// The patch.
        patch: usize,
        /// The side.
        side: usize,
        /// The arc.
        arc: usize,
        /// Number of arcs.
        arcs: usize,
    },
    /// The sides of a patch do not form a closed loop.
    #[error("side {side} of patch {patch} ends at vertex {end}, but the next side starts at vertex {start}")]
    OpenLoop {
        /// The patch.
        patch: usize,
        /// The side.
        side: usize,
        /// Where it ends.
        end: usize,
        /// Where the next one starts.
        start: usize,
    },
    /// Two sides of a patch lie on one arc, or two of its corners at one vertex: split the patch.
    #[error("patch {patch} meets itself at {what} {number}: split it")]
    MeetsItself {
        /// The patch.
        patch: usize,
        /// "arc" or "vertex".
        what: &'static str,
        /// Number of the arc or vertex.
        number: usize,
    },
    /// An arc has more than two patches.
    #[error("arc {arc} is a side of {uses} patches: at most two can meet there")]
    TooManyPatches {
        /// The arc.
        arc: usize,
        /// Number of sides on it.
        uses: usize,
    },
    /// No patch has the arc.
    #[error("arc {arc} is a side of no patch")]
    UnusedArc {
        /// The arc.
        arc: usize,
    },
    /// The patches around a vertex form no single fan or ring.
    #[error("the patches around vertex {vertex} form {fans} fans: at most one is a surface")]
    NonManifoldVertex {
        /// The vertex.
        vertex: usize,
        /// Number of fans; 0 for a vertex without patches.
        fans: usize,
    },
    /// Opposite sides of a patch have different numbers of elements.
    #[error("opposite sides of patch {patch} lie on arcs of {first} and {second} elements: they must have as many")]
    UnequalElements {
        /// The patch.
        patch: usize,
        /// Elements of the one side.
        first: usize,
        /// Of the other.
        second: usize,
    },
}

/// The point of side `side` at `t`, 0 at its start and 1 at its end.
pub fn side_point(side: u8, t: f64) -> [f64; 2] {
    match side {
        0 => [t, 0.0],
        1 => [1.0, t],
        2 => [1.0 - t, 1.0],
        _ => [0.0, 1.0 - t],
    }
}

impl PatchTopology {
    /// Glues patches: `arcs` gives the two end vertices of each arc, `patches` the four sides of each patch.
    ///
    /// # Errors
    /// [`TopologyError`].
    pub fn new(n_vertices: usize, arcs: Vec<[u32; 2]>, patches: Vec<[PatchSide; 4]>) -> Result<Self, TopologyError> {
        if patches.is_empty() {
            return Err(TopologyError::NoPatch);
        }
        for (arc, ends) in arcs.iter().enumerate() {
            if let Some(&vertex) = ends.iter().find(|&&v| v as usize >= n_vertices) {
                return Err(TopologyError::NoSuchVertex { arc, vertex: vertex as usize, vertices: n_vertices });
            }
        }
        let mut uses = vec![Vec::new(); arcs.len()];
        for (patch, sides) in patches.iter().enumerate() {
            for (side, &PatchSide { arc, reversed }) in sides.iter().enumerate() {
                let Some(uses) = uses.get_mut(arc as usize) else {
                    return Err(TopologyError::NoSuchArc { patch, side, arc: arc as usize, arcs: arcs.len() });
                };
                uses.push(ArcUse { patch: patch as u32, side: side as u8, reversed });
            }
        }
        let topology = Self { n_vertices, arcs, patches, uses };
        topology.check_patches()?;
        for (arc, uses) in topology.uses.iter().enumerate() {
            match uses.len() {
                0 => return Err(TopologyError::UnusedArc { arc }),
                1 | 2 => {}
                uses => return Err(TopologyError::TooManyPatches { arc, uses }),
            }
        }
        topology.check_vertices()?;
        Ok(topology)
    }

    fn check_patches(&self) -> Result<(), TopologyError> {
        for (patch, sides) in self.patches.iter().enumerate() {
            for side in 0..4 {
                let (end, start) = (self.side_ends(sides[side])[1], self.side_ends(sides[(side + 1) % 4])[0]);
                if end != start {
                    return Err(TopologyError::OpenLoop { patch, side, end: end as usize, start: start as usize });
                }
            }
            for (a, b) in (0..4).flat_map(|a| (a + 1..4).map(move |b| (a, b))) {
                if sides[a].arc == sides[b].arc {
                    return Err(TopologyError::MeetsItself { patch, what: "arc", number: sides[a].arc as usize });
                }
                let [v, w] = [a, b].map(|corner| self.corner(patch, corner));
                if v == w {
                    return Err(TopologyError::MeetsItself { patch, what: "vertex", number: v as usize });
                }
            }
        }
        Ok(())
    }

    /// Around every vertex, corners that share an arc are joined; one group must remain.
    fn check_vertices(&self) -> Result<(), TopologyError> {
        let mut corners: Vec<Vec<(u32, u8)>> = vec![Vec::new(); self.n_vertices];
        for patch in 0..self.patches.len() {
            for corner in 0..4 {
                corners[self.corner(patch, corner) as usize].push((patch as u32, corner as u8));
            }
        }
        for (vertex, corners) in corners.iter().enumerate() {
            let mut group: Vec<usize> = (0..corners.len()).collect();
            for (i, j) in (0..corners.len()).flat_map(|i| (i + 1..corners.len()).map(move |j| (i, j))) {
                let arcs = [i, j].map(|k| self.arcs_at_corner(corners[k].0 as usize, corners[k].1 as usize));
                if group[i] != group[j] && arcs[0].iter().any(|arc| arcs[1].contains(arc)) {
                    let (from, to) = (group[j], group[i]);
                    group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
                }
            }
            group.sort_unstable();
            group.dedup();
            if group.len() != 1 {
                return Err(TopologyError::NonManifoldVertex { vertex, fans: group.len() });
            }
        }
        Ok(())
    }

    fn arcs_at_corner(&self, patch: usize, corner: usize) -> [u32; 2] {
        let sides = &self.patches[patch];
        [sides[corner].arc, sides[(corner + 3) % 4].arc]
    }

    /// Start and end of a side.
    fn side_ends(&self, side: PatchSide) -> [u32; 2] {
        let [start, end] = self.arcs[side.arc as usize];
        if side.reversed { [end, start] } else { [start, end] }
    }

    /// Number of vertices.
    pub fn n_vertices(&self) -> usize {
        self.n_vertices
    }

    /// The ends of each arc.
    pub fn arcs(&self) -> &[[u32; 2]] {
        &self.arcs
    }

    /// The sides of each patch.
    pub fn patches(&self) -> &[[PatchSide; 4]] {
        &self.patches
    }

    /// The sides that lie on an arc, one or two.
    pub fn uses(&self, arc: usize) -> &[ArcUse] {
        &self.uses[arc]
    }

    /// The vertex at a corner of a patch.
    pub fn corner(&self, patch: usize, corner: usize) -> u32 {
        self.side_ends(self.patches[patch][corner])[0]
    }

    /// What lies across a side; nothing on the boundary.
    pub fn across(&self, patch: usize, side: usize) -> Option<Crossing> {
        let PatchSide { arc, reversed } = self.patches[patch][side];
        let other = self.uses(arc as usize).iter().find(|other| other.patch as usize != patch)?;
        Some(Crossing { arc, patch: other.patch, side: other.side, opposite: other.reversed != reversed })
    }

    /// Whether no arc lies on the boundary.
    pub fn is_closed(&self) -> bool {
        self.uses.iter().all(|uses| uses.len() == 2)
    }

    /// The first arc that both its patches follow in the same direction, so that their orientations disagree.
    pub fn misoriented_arc(&self) -> Option<usize> {
        self.uses.iter().position(|uses| matches!(uses[..], [a, b] if a.reversed == b.reversed))
    }

    /// Euler number, V − E + F: 2 − 2 g for a closed surface of genus g.
    pub fn euler_number(&self) -> isize {
        self.n_vertices as isize - self.arcs.len() as isize + self.patches.len() as isize
    }

    /// Number of arcs that end at each vertex.
    pub fn valences(&self) -> Vec<usize> {
        let mut valences = vec![0; self.n_vertices];
        self.arcs.iter().flatten().for_each(|&vertex| valences[vertex as usize] += 1);
        valences
    }

    /// The strip of each arc, numbered from 0: arcs on opposite sides of a patch belong to one strip, and must have the same number
    /// of elements.
    pub fn strips(&self) -> Vec<usize> {
        let mut strip: Vec<usize> = vec![usize::MAX; self.arcs.len()];
        let mut count = 0;
        for first in 0..self.arcs.len() {
            if strip[first] != usize::MAX {
                continue;
            }
            let mut stack = vec![first];
            while let Some(arc) = stack.pop() {
                if strip[arc] == usize::MAX {
                    strip[arc] = count;
                    stack.extend(self.uses[arc].iter().map(|on| {
                        let sides = &self.patches[on.patch as usize];
                        sides[(usize::from(on.side) + 2) % 4].arc as usize
                    }));
                }
            }
            count += 1;
        }
        strip
    }
}
