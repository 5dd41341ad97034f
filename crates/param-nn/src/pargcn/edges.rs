//! The radius graph of a cloud by its edges. They are the vertices of the line graph, which is never stored.

use param_classic::ParamError;
use point_cloud::{CloudTree, Neighbour};

use crate::error::NnError;
use crate::graph::Graph;
use crate::real::{Real, vectorized};

/// Points closer than this, in the unit cube, count as equal and are not neighbours.
const COINCIDENT: f64 = 1e-12;

/// Factor by which a radius grows that leaves points without a path to the boundary.
const GROWTH: f64 = 1.25;

/// Size of the unit cube: a larger radius finds no further neighbours.
const ACROSS: f64 = 1.732_050_807_568_877_2;

/// Cut-off points that an error names.
const CUT_OFF_NAMED: usize = 5;

/// Edges (i, j) from each interior point to its neighbours, nearest first (Imperatore 2024, (4.10)).
///
/// In the line graph, edge (i, j) leads to every edge (j, l): it has |N_j| successors, none if j is on the boundary. Its
/// Chebyshev argument L̂ = −D^(−½) W D^(−½), with D the number of successors, is −B A: A gathers, for each interior point j,
/// `|N_j|^(−½)` times the sum over the edges with head j; B gives edge (j, l) `|N_l|^(−½)` times the value of its tail.
#[derive(Clone, Debug)]
pub(crate) struct EdgeGraph {
    /// Interior points; they come first.
    pub(crate) interior: usize,
    /// Radius of the neighbourhoods, in the unit cube.
    pub(crate) radius: f64,
    /// The heads of the edges of each interior point.
    pub(crate) leaving: Graph,
    /// The edges that end in each interior point.
    arriving: Graph,
    /// `|N_j|^(−½)` of every point, 0 on the boundary.
    roots: Vec<f64>,
}

/// The nearest points of each interior point, in order.
fn nearest(points: &[[f64; 3]], interior: usize, limit: usize) -> Result<Vec<Vec<Neighbour>>, NnError> {
    Ok(CloudTree::new(points)?.map_nearest(limit, |i, near| {
        let mut row: Vec<Neighbour> = near.iter().copied().filter(|n| i < interior && n.0 > COINCIDENT).collect();
        row.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        row
    }))
}

fn error(cut_off: Vec<u32>, interior: usize, radius: f64) -> NnError {
    let (count, first) = (cut_off.len(), cut_off.into_iter().take(CUT_OFF_NAMED).collect());
    ParamError::CutOffPoints { count, interior, radius, first }.into()
}

impl EdgeGraph {
    /// Of points in the unit cube, the interior ones first; at most `limit` neighbours, the nearest ones. The radius grows
    /// until each interior point has a path to the boundary.
    ///
    /// # Errors
    /// [`ParamError::CutOffPoints`] where no radius is large enough.
    pub(crate) fn new(points: &[[f64; 3]], interior: usize, mut radius: f64, limit: usize) -> Result<Self, NnError> {
        let nearest = nearest(points, interior, limit)?;
        loop {
            let graph = Self::within(&nearest[..interior], points.len(), radius);
            let cut_off = graph.cut_off();
            if cut_off.is_empty() {
                return Ok(graph);
            }
            if radius >= ACROSS {
                return Err(error(cut_off, interior, radius));
            }
            radius *= GROWTH;
        }
    }

    /// The same with `limit` nearest points however far; `radius` is kept as a unit.
    ///
    /// # Errors
    /// [`ParamError::CutOffPoints`] where points have no path to the boundary.
    pub(crate) fn nearest(points: &[[f64; 3]], interior: usize, radius: f64, limit: usize) -> Result<Self, NnError> {
        let graph = Self::within(&nearest(points, interior, limit)?[..interior], points.len(), f64::INFINITY);
        let cut_off = graph.cut_off();
        if cut_off.is_empty() { Ok(Self { radius, ..graph }) } else { Err(error(cut_off, interior, ACROSS)) }
    }

    fn within(nearest: &[Vec<Neighbour>], points: usize, radius: f64) -> Self {
        let interior = nearest.len();
        let (mut starts, mut heads) = (vec![0], Vec::new());
        for row in nearest {
            heads.extend(row.iter().take_while(|n| n.0 < radius).map(|n| n.1));
            starts.push(heads.len() as u32);
        }
        let mut arriving = vec![0u32; interior + 1];
        heads.iter().filter(|&&j| (j as usize) < interior).for_each(|&j| arriving[j as usize + 1] += 1);
        for j in 0..interior {
            arriving[j + 1] += arriving[j];
        }
        let mut next = arriving.clone();
        let mut edges = vec![0; arriving[interior] as usize];
        for (edge, &head) in (0u32..).zip(&heads) {
            if let Some(place) = next.get_mut(head as usize).filter(|_| (head as usize) < interior) {
                edges[*place as usize] = edge;
                *place += 1;
            }
        }
        let count = |i: usize| f64::from(starts[i + 1] - starts[i]);
        let root = |i: usize| if i < interior && count(i) > 0.0 { count(i).sqrt().recip() } else { 0.0 };
        let roots = (0..points).map(root).collect();
        let leaving = Graph { starts, sources: heads };
        Self { interior, radius, leaving, arriving: Graph { starts: arriving, sources: edges }, roots }
    }

    /// Number of edges.
    pub(crate) fn edges(&self) -> usize {
        self.leaving.edges()
    }

    /// The edges that leave an interior point.
    pub(crate) fn edges_of(&self, i: usize) -> std::ops::Range<usize> {
        self.leaving.starts[i] as usize..self.leaving.starts[i + 1] as usize
    }

    /// The tail of an edge.
    pub(crate) fn tail(&self, edge: usize) -> usize {
        self.leaving.starts.partition_point(|&start| start as usize <= edge) - 1
    }

    /// The tail of each edge.
    fn tails(&self) -> Vec<u32> {
        (0..self.interior).flat_map(|i| self.edges_of(i).map(move |_| i as u32)).collect()
    }

    /// Interior points without a path to the boundary, increasing.
    fn cut_off(&self) -> Vec<u32> {
        let tails = self.tails();
        let mut reached = vec![false; self.interior];
        let mut stack = Vec::new();
        let mut reach = |point: u32, stack: &mut Vec<u32>| {
            if !std::mem::replace(&mut reached[point as usize], true) {
                stack.push(point);
            }
        };
        for (&tail, &head) in tails.iter().zip(&self.leaving.sources) {
            if head as usize >= self.interior {
                reach(tail, &mut stack);
            }
        }
        while let Some(point) = stack.pop() {
            for &edge in self.arriving.of(point as usize) {
                reach(tails[edge as usize], &mut stack);
            }
        }
        (0..self.interior as u32).filter(|&i| !reached[i as usize]).collect()
    }

    /// `A x`: rows of the edges to rows of the interior points.
    pub(super) fn gather<T: Real>(&self, x: &[T], width: usize) -> Vec<T> {
        let mut sums = vec![T::from_f64(0.0); self.interior * width];
        vectorized(
            #[inline(always)]
            || {
                for (j, sum) in sums.chunks_exact_mut(width).enumerate() {
                    for &edge in self.arriving.of(j) {
                        let row = &x[edge as usize * width..][..width];
                        sum.iter_mut().zip(row).for_each(|(s, x)| *s += *x);
                    }
                    let root = T::from_f64(self.roots[j]);
                    sum.iter_mut().for_each(|s| *s *= root);
                }
            },
        );
        sums
    }

    /// `x += Aᵀ y`.
    pub(super) fn add_gather_adjoint<T: Real>(&self, x: &mut [T], y: &[T], width: usize) {
        vectorized(
            #[inline(always)]
            || {
                for (row, &head) in x.chunks_exact_mut(width).zip(&self.leaving.sources) {
                    if let Some(given) = y.get(head as usize * width..(head as usize + 1) * width) {
                        let root = T::from_f64(self.roots[head as usize]);
                        row.iter_mut().zip(given).for_each(|(x, y)| *x += root * *y);
                    }
                }
            },
        );
    }

    /// `y += B z`: rows of the interior points to rows of the edges.
    pub(super) fn add_spread<T: Real>(&self, y: &mut [T], z: &[T], width: usize) {
        vectorized(
            #[inline(always)]
            || {
                for (i, given) in z.chunks_exact(width).enumerate() {
                    for edge in self.edges_of(i) {
                        let root = T::from_f64(self.roots[self.leaving.sources[edge] as usize]);
                        let row = &mut y[edge * width..][..width];
                        row.iter_mut().zip(given).for_each(|(y, z)| *y += root * *z);
                    }
                }
            },
        );
    }

    /// `Bᵀ y`.
    pub(super) fn spread_adjoint<T: Real>(&self, y: &[T], width: usize) -> Vec<T> {
        let mut z = vec![T::from_f64(0.0); self.interior * width];
        vectorized(
            #[inline(always)]
            || {
                for (i, sum) in z.chunks_exact_mut(width).enumerate() {
                    for edge in self.edges_of(i) {
                        let root = T::from_f64(self.roots[self.leaving.sources[edge] as usize]);
                        let row = &y[edge * width..][..width];
                        sum.iter_mut().zip(row).for_each(|(s, y)| *s += root * *y);
                    }
                }
            },
        );
        z
    }

    /// `A B y`: for each interior point j, the sum over the tails of the edges that end in it, divided by `|N_j|`.
    pub(super) fn step<T: Real>(&self, y: &[T], width: usize) -> Vec<T> {
        let mut sums = vec![T::from_f64(0.0); self.interior * width];
        vectorized(
            #[inline(always)]
            || {
                for (i, given) in y.chunks_exact(width).enumerate() {
                    for &head in self.leaving.of(i) {
                        if let Some(sum) = sums.get_mut(head as usize * width..(head as usize + 1) * width) {
                            sum.iter_mut().zip(given).for_each(|(s, y)| *s += *y);
                        }
                    }
                }
                for (j, sum) in sums.chunks_exact_mut(width).enumerate() {
                    let share = T::from_f64(self.roots[j] * self.roots[j]);
                    sum.iter_mut().for_each(|s| *s *= share);
                }
            },
        );
        sums
    }

    /// `(A B)ᵀ y`.
    pub(super) fn step_adjoint<T: Real>(&self, y: &[T], width: usize) -> Vec<T> {
        let mut sums = vec![T::from_f64(0.0); self.interior * width];
        vectorized(
            #[inline(always)]
            || {
                for (i, sum) in sums.chunks_exact_mut(width).enumerate() {
                    for &head in self.leaving.of(i) {
                        if let Some(given) = y.get(head as usize * width..(head as usize + 1) * width) {
                            let share = T::from_f64(self.roots[head as usize] * self.roots[head as usize]);
                            sum.iter_mut().zip(given).for_each(|(s, y)| *s += share * *y);
                        }
                    }
                }
            },
        );
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::stream;
    use rand::RngExt;

    #[test]
    fn edges_lead_from_interior_points_to_the_nearest_others_within_the_radius() {
        let mut random = stream(4, 0);
        let points: Vec<[f64; 3]> = (0..150).map(|_| random.random()).collect();
        let (interior, limit) = (100, 7);
        let graph = EdgeGraph::new(&points, interior, 0.5, limit).unwrap();
        for (i, p) in points[..interior].iter().enumerate() {
            let distance = |j: u32| (0..3).map(|k| (points[j as usize][k] - p[k]).powi(2)).sum::<f64>().sqrt();
            let mut others: Vec<u32> = (0..150).filter(|&j| j as usize != i && distance(j) < graph.radius).collect();
            others.sort_by(|&a, &b| distance(a).total_cmp(&distance(b)));
            others.truncate(limit);
            assert_eq!(graph.leaving.of(i), others);
        }
    }

    #[test]
    fn without_a_radius_every_point_has_as_many_neighbours() {
        let mut random = stream(4, 1);
        let points: Vec<[f64; 3]> = (0..150).map(|_| random.random()).collect();
        let (graph, wide) =
            (EdgeGraph::nearest(&points, 100, 0.2, 7).unwrap(), EdgeGraph::new(&points, 100, 2.0, 7).unwrap());
        assert_eq!((graph.radius, graph.edges()), (0.2, 700));
        // A radius wider than the cube leaves the choice to the limit too.
        assert_eq!(graph.leaving, wide.leaving);
    }

    #[test]
    fn a_radius_that_is_too_small_grows() {
        let points: Vec<[f64; 3]> = (0..20).map(|k| [f64::from(k) / 19.0, 0.0, 0.0]).collect();
        let graph = EdgeGraph::new(&points, 19, 0.01, 3).unwrap();
        assert!(graph.radius > 1.0 / 19.0 && graph.radius < 2.0 / 19.0, "{}", graph.radius);
        // Four equal points see each other only.
        let far = [[0.0; 3], [0.0; 3], [0.0; 3], [0.0; 3], [1.0; 3]];
        assert!(matches!(EdgeGraph::new(&far, 4, 0.1, 3), Err(NnError::Classical(ParamError::CutOffPoints { .. }))));
    }
}
