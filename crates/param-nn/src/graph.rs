//! Radius graphs in spaces of any dimension.

use rayon::prelude::*;

use crate::real::{matrix, product, vectorized};

/// Rows whose products with all points are formed at once: a block of 64 rows by 10⁴ points takes 2.5 MB.
const BLOCK: usize = 64;

/// Which points are neighbours, in space and among features.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Neighbours {
    /// Those within the radius 0.1, the nearest 32 of them, as published.
    #[default]
    WithinRadius,
    /// So many nearest ones, however far; a point counts as its own.
    Nearest(u16),
}

/// Edges from sources to targets, grouped by target.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Graph {
    /// The edges of target i are `starts[i]..starts[i + 1]`.
    pub(crate) starts: Vec<u32>,
    /// Source of each edge.
    pub(crate) sources: Vec<u32>,
}

impl Graph {
    pub(crate) fn targets(&self) -> usize {
        self.starts.len() - 1
    }

    pub(crate) fn edges(&self) -> usize {
        self.sources.len()
    }

    #[inline(always)]
    pub(crate) fn of(&self, target: usize) -> &[u32] {
        &self.sources[self.starts[target] as usize..self.starts[target + 1] as usize]
    }

    /// The same edges turned round: to each of `sources` points the targets that it is a source of.
    pub(crate) fn reversed(&self, sources: usize) -> Self {
        let mut starts = vec![0u32; sources + 1];
        self.sources.iter().for_each(|&s| starts[s as usize + 1] += 1);
        for s in 0..sources {
            starts[s + 1] += starts[s];
        }
        let mut next = starts.clone();
        let mut reversed = vec![0; self.edges()];
        for target in 0..self.targets() {
            for &source in self.of(target) {
                let place = &mut next[source as usize];
                reversed[*place as usize] = target as u32;
                *place += 1;
            }
        }
        Self { starts, sources: reversed }
    }
}

/// The points within `radius` of each query, the nearest `cap` of them; equally far ones by index. Queries and points
/// are rows of `width` numbers; an infinite radius leaves all to the cap. With `own`, query i is point i, and its distance to itself is exactly 0.
pub(crate) fn radius_graph(queries: &[f32], points: &[f32], width: usize, radius: f32, cap: usize, own: bool) -> Graph {
    let n = points.len() / width;
    // Distances from squares cancel where points are far from the origin: move it into their middle.
    let mut center = vec![0.0; width];
    for row in points.chunks_exact(width) {
        center.iter_mut().zip(row).for_each(|(c, x)| *c += x / n as f32);
    }
    let centered = |rows: &[f32]| -> Vec<f32> {
        rows.chunks_exact(width).flat_map(|row| row.iter().zip(&center).map(|(x, c)| x - c)).collect()
    };
    let (queries, points) = (centered(queries), centered(points));
    let squares: Vec<f32> = points.chunks_exact(width).map(|row| row.iter().map(|x| x * x).sum()).collect();
    let blocks: Vec<(Vec<u32>, Vec<u32>)> = queries
        .par_chunks(BLOCK * width)
        .enumerate()
        .map(|(block, rows)| {
            let count = rows.len() / width;
            let mut products = vec![0.0; count * n];
            product(&mut products, matrix(rows, width), matrix(&points, width).transpose());
            let (mut counts, mut sources) = (Vec::with_capacity(count), Vec::with_capacity(count * cap));
            let mut nearest = Nearest::new(cap, n);
            for (i, (row, products)) in rows.chunks_exact(width).zip(products.chunks_exact_mut(n)).enumerate() {
                let square: f32 = row.iter().map(|x| x * x).sum();
                if own {
                    let index = block * BLOCK + i;
                    products[index] = 0.5 * (square + squares[index]);
                }
                nearest.search(square, products, &squares, radius * radius);
                counts.push(nearest.found as u32);
                sources.extend(nearest.indices());
            }
            (counts, sources)
        })
        .collect();
    let mut starts = vec![0];
    let mut sources = Vec::new();
    for (counts, block) in blocks {
        for count in counts {
            starts.push(starts.last().copied().unwrap_or(0) + count);
        }
        sources.extend(block);
    }
    Graph { starts, sources }
}

/// The nearest points of one query.
struct Nearest {
    cap: usize,
    distances: Vec<f32>,
    /// Squared distances in the upper half (the bits of positive floats are ordered as they are), indices in the lower.
    keys: Vec<u64>,
    found: usize,
}

/// Halvings of the bound before those within it are sorted out; the result does not depend on it.
const HALVINGS: usize = 12;

impl Nearest {
    fn new(cap: usize, points: usize) -> Self {
        Self { cap, distances: vec![0.0; points], keys: vec![0; points + 1], found: 0 }
    }

    fn search(&mut self, square: f32, products: &[f32], squares: &[f32], bound: f32) {
        vectorized(
            #[inline(always)]
            || self.collect(square, products, squares, bound),
        );
        if self.found > self.cap {
            self.keys[..self.found].select_nth_unstable(self.cap - 1);
            self.found = self.cap;
        }
    }

    fn indices(&self) -> impl Iterator<Item = u32> {
        self.keys[..self.found].iter().map(|key| *key as u32)
    }

    /// All points within a bound that holds at least `cap` points, if that many are within the given one.
    #[inline(always)]
    fn collect(&mut self, square: f32, products: &[f32], squares: &[f32], bound: f32) {
        for (d, (p, s)) in self.distances.iter_mut().zip(products.iter().zip(squares)) {
            *d = square + s - 2.0 * p;
        }
        let distances = &self.distances;
        // An infinite bound has no middle.
        let bound = if bound.is_finite() { bound } else { distances.iter().fold(0.0, |far: f32, d| far.max(*d)) };
        // PERF: counting is a vector loop, sorting out is not; the bound is first brought near the cap-th distance.
        let count = |bound: f32| distances.iter().map(|d| u32::from(*d <= bound)).sum::<u32>() as usize;
        let (mut low, mut high) = (0.0, bound);
        let mut inside = count(bound);
        for _ in 0..HALVINGS {
            if inside <= 2 * self.cap {
                break;
            }
            let middle = 0.5 * (low + high);
            match count(middle) {
                fewer if fewer < self.cap => low = middle,
                enough => (high, inside) = (middle, enough),
            }
        }
        let mut found = 0;
        for (index, d) in distances.iter().enumerate() {
            self.keys[found] = u64::from(d.max(0.0).to_bits()) << 32 | index as u64;
            found += usize::from(*d <= high);
        }
        self.found = found;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::stream;
    use rand::RngExt;

    fn brute_force(queries: &[f32], points: &[f32], width: usize, radius: f32, cap: usize) -> Vec<Vec<u32>> {
        let search = |q: &[f32]| {
            let mut all: Vec<(f32, u32)> = (0u32..)
                .zip(points.chunks_exact(width))
                .map(|(j, p)| (q.iter().zip(p).map(|(a, b)| (a - b) * (a - b)).sum(), j))
                .filter(|(d, _): &(f32, u32)| *d <= radius * radius)
                .collect();
            all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let mut rows: Vec<u32> = all.into_iter().take(cap).map(|(_, j)| j).collect();
            rows.sort_unstable();
            rows
        };
        queries.chunks_exact(width).map(search).collect()
    }

    fn sorted_rows(graph: &Graph) -> Vec<Vec<u32>> {
        (0..graph.targets())
            .map(|i| {
                let mut row = graph.of(i).to_vec();
                row.sort_unstable();
                row
            })
            .collect()
    }

    #[test]
    fn the_graph_holds_the_nearest_points_within_the_radius() {
        let mut random = stream(5, 0);
        for (n, width, radius, cap) in [(300, 3, 0.3, 32), (500, 3, 0.05, 32), (200, 64, 2.9, 8), (5, 2, 1.0, 3)] {
            let points: Vec<f32> = (0..n * width).map(|_| random.random::<f32>() + 3.0).collect();
            let graph = radius_graph(&points, &points, width, radius, cap, true);
            assert_eq!(sorted_rows(&graph), brute_force(&points, &points, width, radius, cap));
            let queries = &points[..n / 3 * width];
            let graph = radius_graph(queries, &points, width, radius, cap, false);
            assert_eq!(sorted_rows(&graph), brute_force(queries, &points, width, radius, cap));
        }
    }

    #[test]
    fn without_a_radius_every_point_has_the_same_number_of_neighbours() {
        let mut random = stream(5, 1);
        let points: Vec<f32> = (0..200 * 3).map(|_| random.random::<f32>().powi(4)).collect();
        let graph = radius_graph(&points, &points, 3, f32::INFINITY, 7, true);
        assert_eq!(sorted_rows(&graph), brute_force(&points, &points, 3, f32::INFINITY, 7));
        assert!((0..200).all(|i| graph.of(i).len() == 7));
    }

    #[test]
    fn equal_points_are_taken_by_index() {
        let points = [0.5f32; 3 * 100];
        let graph = radius_graph(&points, &points, 3, 0.1, 4, true);
        assert!(sorted_rows(&graph).iter().all(|row| row == &[0, 1, 2, 3]));
    }

    #[test]
    fn reversing_twice_brings_the_edges_back() {
        let points: Vec<f32> = (0..90).map(|k| (0.7 * k as f32).sin()).collect();
        let graph = radius_graph(&points[..30], &points, 3, 0.5, 6, false);
        let reversed = graph.reversed(30);
        assert_eq!(sorted_rows(&reversed.reversed(10)), sorted_rows(&graph));
    }
}
