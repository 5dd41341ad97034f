//! Search for the points within a radius, among features of many dimensions.

use rayon::prelude::*;

use super::distinct::{Groups, reduced};
use super::edges::Graph;
use super::nearest::Nearest;
use super::tree::{Balls, LEAF, Rows, dot, order, squared_distance};
use crate::real::{matrix, product, vectorized};

/// Queries that share their candidates: two leaves.
const BLOCK: usize = 2 * LEAF;

/// So many rows are compared with all: putting them in order would take as long.
const FEW: usize = 512;

/// Bound of the round-off of a squared distance formed from squares, relative to the largest square. Leaves are left out
/// only where they are farther by more, so that leaving them out changes nothing.
const ROUND_OFF: f32 = 1e-5;

/// The points within `radius` of each query, the nearest `cap` of them; equally far ones by index. Queries and points
/// are rows of `width` numbers; an infinite radius leaves all to the cap. With `own`, the queries are the points, and the
/// distance between equal ones is exactly 0.
///
/// Features are functions on a surface, so they fill few of their dimensions: points near each other are put into balls,
/// and queries near each other are compared with those balls only that come within the radius, or within a distance
/// in which there surely are `cap` points.
pub(crate) fn radius_graph(queries: &[f32], points: &[f32], width: usize, radius: f32, cap: usize, own: bool) -> Graph {
    let (queries, points) = reduced(if own { &[] } else { queries }, points, width);
    let groups = Groups::equal(&points);
    let points = Sorted::new(groups.representatives(points));
    let weights: Vec<u32> = points.ids.iter().map(|&id| groups.members(id).len().min(cap) as u32).collect();
    let others = (!own).then(|| ((0..queries.count() as u32).collect::<Vec<_>>(), Sorted::new(queries)));
    let (asked, of) = others.as_ref().map_or((&points, &groups.of), |(of, asked)| (asked, of));
    let search = Search {
        balls: Balls::new(&points.rows, LEAF),
        ball_weights: weights.chunks(LEAF).map(|run| run.iter().sum()).collect(),
        weights,
        largest: points.squares.iter().chain(&asked.squares).fold(0.0, |largest, square| largest.max(*square)),
        groups: &groups,
        points: &points,
        radius,
        cap,
        own,
    };
    let around = Balls::new(&asked.rows, BLOCK);
    let found: Vec<(Vec<u32>, Vec<u32>)> = (0..around.radii.len())
        .into_par_iter()
        .map_init(Scratch::default, |scratch, block| search.block(asked, &around, block, scratch))
        .collect();
    // Where the sources of each query are, in the order of the search.
    let mut places = vec![(0, 0..0); asked.ids.len()];
    for (block, (counts, _)) in found.iter().enumerate() {
        let mut start = 0;
        for (&count, &id) in counts.iter().zip(&asked.ids[block * BLOCK..]) {
            places[id as usize] = (block, start..start + count as usize);
            start += count as usize;
        }
    }
    let mut starts = Vec::with_capacity(of.len() + 1);
    let mut sources = Vec::with_capacity(of.iter().map(|&id| places[id as usize].1.len()).sum());
    starts.push(0);
    for &id in of {
        let (block, range) = &places[id as usize];
        sources.extend_from_slice(&found[*block].1[range.clone()]);
        starts.push(sources.len() as u32);
    }
    Graph { starts, sources }
}

/// Rows with neighbours standing together.
struct Sorted {
    rows: Rows,
    squares: Vec<f32>,
    /// Which row each was.
    ids: Vec<u32>,
}

impl Sorted {
    fn new(rows: Rows) -> Self {
        let (ids, rows) = match rows.count() > FEW {
            true => {
                let ids = order(&rows);
                let rows = rows.select(ids.iter().copied());
                (ids, rows)
            }
            false => ((0..rows.count() as u32).collect(), rows),
        };
        let squares = rows.values.chunks_exact(rows.width).map(|row| dot(row, row)).collect();
        Self { rows, squares, ids }
    }
}

struct Search<'a> {
    points: &'a Sorted,
    groups: &'a Groups,
    /// How many points each row stands for, at most the cap.
    weights: Vec<u32>,
    balls: Balls,
    ball_weights: Vec<u32>,
    largest: f32,
    radius: f32,
    cap: usize,
    own: bool,
}

/// Memory that is used again for every block.
#[derive(Default)]
struct Scratch {
    /// Distances between the center of the queries and those of the balls.
    gaps: Vec<f32>,
    /// The farthest that a point of each ball may be from a query, and its weight.
    reaches: Vec<(f32, u32)>,
    candidates: Vec<u32>,
    rows: Vec<f32>,
    squares: Vec<f32>,
    weights: Vec<u32>,
    products: Vec<f32>,
    nearest: Nearest,
}

impl Search<'_> {
    /// Numbers of sources of the queries of a block, and the sources.
    fn block(&self, asked: &Sorted, around: &Balls, block: usize, scratch: &mut Scratch) -> (Vec<u32>, Vec<u32>) {
        self.candidates(around.centers.row(block), around.radii[block], scratch);
        let Scratch { candidates, rows, squares, weights, products, nearest, .. } = scratch;
        let (rows, squares, weights) = match candidates.len() == self.weights.len() {
            true => (&self.points.rows.values, &self.points.squares, &self.weights),
            false => (&*rows, &*squares, &*weights),
        };
        let width = asked.rows.width;
        let range = block * BLOCK..((block + 1) * BLOCK).min(asked.ids.len());
        if candidates.is_empty() {
            return (vec![0; range.len()], Vec::new());
        }
        products.resize(range.len() * candidates.len(), 0.0);
        let queries = matrix(asked.rows.run(range.clone()), width);
        product(products, queries, matrix(rows, width).transpose());
        let (mut counts, mut sources) = (Vec::with_capacity(BLOCK), Vec::with_capacity(BLOCK * self.cap.min(BLOCK)));
        nearest.distances.resize(candidates.len(), 0.0);
        for (query, products) in range.zip(products.chunks_exact(candidates.len())) {
            let square = asked.squares[query];
            vectorized(
                #[inline(always)]
                || {
                    let all = products.iter().zip(squares);
                    nearest.distances.iter_mut().zip(all).for_each(|(d, (p, s))| *d = square + s - 2.0 * p);
                },
            );
            if self.own
                && let Ok(itself) = candidates.binary_search(&(query as u32))
            {
                nearest.distances[itself] = 0.0;
            }
            let members = |k: usize| self.groups.members(self.points.ids[candidates[k] as usize]);
            counts.push(nearest.search(weights, self.radius * self.radius, self.cap, members, &mut sources) as u32);
        }
        (counts, sources)
    }

    /// Gathers the points of all balls that may hold a neighbour of a query in the given ball.
    fn candidates(&self, center: &[f32], radius: f32, scratch: &mut Scratch) {
        let Scratch { gaps, reaches, candidates, rows, squares, weights, .. } = scratch;
        let Balls { centers, radii } = &self.balls;
        gaps.resize(radii.len(), 0.0);
        vectorized(
            #[inline(always)]
            || {
                for (gap, other) in gaps.iter_mut().zip(centers.values.chunks_exact(centers.width)) {
                    *gap = squared_distance(center, other).sqrt();
                }
            },
        );
        reaches.clear();
        reaches.extend(gaps.iter().zip(radii).map(|(gap, r)| gap + r + radius).zip(self.ball_weights.iter().copied()));
        // All leaves but the last are full.
        let enough = self.cap.div_ceil(LEAF) + 1;
        if reaches.len() > enough {
            reaches.select_nth_unstable_by(enough - 1, |a, b| a.0.total_cmp(&b.0));
            reaches.truncate(enough);
        }
        reaches.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut weight = 0;
        let surely = reaches.iter().find(|(_, w)| {
            weight += *w as usize;
            weight >= self.cap
        });
        let bound = surely.map_or(self.radius, |(reach, _)| reach.min(self.radius));
        let limit = bound * bound + ROUND_OFF * self.largest;
        candidates.clear();
        for (leaf, (gap, r)) in gaps.iter().zip(radii).enumerate() {
            let least = (gap - r - radius).max(0.0);
            // Features that are not finite are in no order, and are compared with all.
            let far = least * least > limit;
            if !far {
                candidates.extend((leaf * LEAF) as u32..((leaf + 1) * LEAF).min(self.weights.len()) as u32);
            }
        }
        // All together stand in a row already.
        if candidates.len() == self.weights.len() {
            return;
        }
        rows.clear();
        squares.clear();
        weights.clear();
        for leaf in candidates.chunk_by(|a, b| a + 1 == *b) {
            let run = leaf[0] as usize..leaf[0] as usize + leaf.len();
            rows.extend_from_slice(self.points.rows.run(run.clone()));
            squares.extend_from_slice(&self.points.squares[run.clone()]);
            weights.extend_from_slice(&self.weights[run]);
        }
    }
}
