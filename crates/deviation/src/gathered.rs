//! Misses that gather: connected patches of a scan that lie beyond the tolerance.
//!
//! A share of the scan within the tolerance doesn't tell whether the rest is spread evenly or is the mouth of a bust.

use point_cloud::DisjointSets;
use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use serde::Serialize;

/// Nodes that a patch has at least; fewer are single stray values.
///
/// Derived: the definition of gathered misses (docs, "What counts").
const FEWEST_NODES: usize = 5;

/// Nodes that one is joined to at most.
///
/// Derived: the definition of gathered misses (docs, "What counts").
const NEIGHBOURS: usize = 12;

/// Patches that a report lists.
const LISTED: usize = 10;

/// Patches of a scan beyond the tolerance, largest first.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Gathered {
    /// Share of the scan's area in the largest patch.
    pub largest: f64,
    /// Share of the scan's area in all patches above 0.1 %.
    pub total: f64,
    /// The largest ones.
    pub patches: Vec<Patch>,
}

/// A connected patch of a scan beyond the tolerance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Patch {
    /// Its share of the scan's area.
    pub share: f64,
    /// Largest distance in it.
    pub distance: f64,
    /// Where that is, on the scan.
    pub place: [f64; 3],
}

/// A part of a scan beyond the tolerance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    pub(crate) place: [f64; 3],
    pub(crate) distance: f64,
    pub(crate) weight: f64,
    /// Two nodes touch where they are no farther from each other than the sum of their reaches.
    pub(crate) reach: f64,
}

impl Gathered {
    /// The patches of nodes, and for each node the share of its patch; `total` is the weight of the whole scan, `many` the share from
    /// which a patch adds to the total.
    pub(crate) fn of(nodes: &[Node], total: f64, many: f64) -> (Self, Vec<f64>) {
        let none = || (Self::default(), vec![0.0; nodes.len()]);
        if nodes.len() < FEWEST_NODES || total <= 0.0 {
            return none();
        }
        let places: Vec<[f64; 3]> = nodes.iter().map(|node| node.place).collect();
        let Ok(tree) = ImmutableKdTree::<f64, 3>::new_from_slice(&places) else { return none() };
        let count = NonZero::new(nodes.len().min(NEIGHBOURS + 1)).unwrap_or(NonZero::<usize>::MIN);
        let touching: Vec<Vec<u32>> = nodes
            .par_iter()
            .map(|node| {
                let near = tree.query(&node.place).nearest_n::<SquaredEuclidean<f64>>(count).execute();
                let touches = |item: u32, squared: f64| squared.sqrt() <= node.reach + nodes[item as usize].reach;
                near.iter().filter(|n| touches(n.item, n.distance)).map(|n| n.item).collect()
            })
            .collect();
        let mut groups = DisjointSets::new(nodes.len());
        for (i, others) in touching.iter().enumerate() {
            others.iter().for_each(|&j| groups.join(i as u32, j));
        }
        let mut patches = vec![(0usize, Patch { share: 0.0, distance: 0.0, place: [0.0; 3] }); nodes.len()];
        for (i, node) in nodes.iter().enumerate() {
            let (count, patch) = &mut patches[groups.root(i as u32) as usize];
            *count += 1;
            patch.share += node.weight / total;
            if node.distance > patch.distance {
                (patch.distance, patch.place) = (node.distance, node.place);
            }
        }
        let enough = |(count, patch): &(usize, Patch)| if *count >= FEWEST_NODES { patch.share } else { 0.0 };
        let shares = (0..nodes.len()).map(|i| enough(&patches[groups.root(i as u32) as usize])).collect();
        let mut patches: Vec<Patch> =
            patches.into_iter().filter(|(count, _)| *count >= FEWEST_NODES).map(|(_, patch)| patch).collect();
        patches.sort_by(|a, b| b.share.total_cmp(&a.share));
        let found = Self {
            largest: patches.first().map_or(0.0, |patch| patch.share),
            // A sum of nothing would be −0.
            total: patches.iter().map(|patch| patch.share).filter(|&share| share > many).fold(0.0, |sum, x| sum + x),
            patches: Vec::new(),
        };
        patches.truncate(LISTED);
        (Self { patches, ..found }, shares)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_are_those_of_touching_nodes() {
        // On a grid of width 1 a patch of 4 × 4, one of 3 × 2, and four single nodes.
        let at = |x: usize, y: usize| Node {
            place: [x as f64, y as f64, 0.0],
            distance: 2.0 + x as f64,
            weight: 1.0,
            reach: 0.6,
        };
        let mut nodes: Vec<Node> = (0..16).map(|k| at(k % 4, k / 4)).collect();
        nodes.extend((0..6).map(|k| at(10 + k % 3, k / 3)));
        nodes.extend([at(20, 0), at(20, 5), at(20, 10), at(20, 15)]);
        let (found, shares) = Gathered::of(&nodes, 1000.0, 0.01);
        assert!((shares[0] - 0.016).abs() < 1e-15 && (shares[16] - 0.006).abs() < 1e-15 && shares[22] == 0.0);
        assert!((found.largest - 0.016).abs() < 1e-15 && (found.total - 0.016).abs() < 1e-15);
        assert_eq!(found.patches.len(), 2);
        assert_eq!((found.patches[0].place[0], found.patches[1].distance), (3.0, 14.0));
        assert_eq!(Gathered::of(&nodes[..4], 1000.0, 0.01), (Gathered::default(), vec![0.0; 4]));
    }
}
