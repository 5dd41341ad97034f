//! Radius graphs in spaces of any dimension.

mod distinct;
mod edges;
mod nearest;
mod search;
mod tree;

pub(crate) use edges::Graph;
pub(crate) use search::radius_graph;

/// Which points are neighbours, in space and among features.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Neighbours {
    /// Those within the radius 0.1, the nearest 32 of them, as published.
    #[default]
    WithinRadius,
    /// So many nearest ones, however far; a point counts as its own.
    Nearest(u16),
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
