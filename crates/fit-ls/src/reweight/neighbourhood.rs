//! What the neighbours of a point say of its residual.

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use ndarray::ArrayView2;
use rayon::prelude::*;

use super::loss::median_scale;
use crate::Error;

/// The nearest points of each point in the parameter domain, itself left out, the same number for each.
#[derive(Clone, Debug)]
pub(super) struct Neighbourhoods {
    count: usize,
    /// Row after row; indices of points.
    indices: Vec<u32>,
}

/// One neighbour in so many must remain for the others to be left out.
const FEWEST: usize = 5;

/// Points of one parallel task.
const CHUNK: usize = 1 << 12;

impl Neighbourhoods {
    /// The `count` nearest of the points with `speaks` for each point; fewer where there are not as many.
    pub(super) fn new<const D: usize>(
        parameters: ArrayView2<'_, f64>,
        speaks: &[bool],
        count: usize,
    ) -> Result<Self, Error> {
        let row = |i: usize| std::array::from_fn::<f64, D, _>(|d| parameters[[i, d]]);
        let speakers: Vec<usize> = (0..speaks.len()).filter(|&i| speaks[i]).collect();
        let sites: Vec<[f64; D]> = speakers.iter().map(|&i| row(i)).collect();
        let count = count.min(sites.len().saturating_sub(1));
        // One more than asked for: a point may find itself.
        let Some(asked) = NonZero::new(count + 1).filter(|_| count > 0) else {
            return Ok(Self { count: 0, indices: Vec::new() });
        };
        let tree: ImmutableKdTree<f64, D> = ImmutableKdTree::new_from_slice(&sites).map_err(|_| Error::NoPoints)?;
        let nearest = |i: usize| {
            let found = tree.query(&row(i)).nearest_n::<SquaredEuclidean<f64>>(asked).execute();
            let mut found: Vec<(f64, usize)> =
                found.iter().map(|n| (n.distance, speakers[n.item as usize])).filter(|&(_, j)| j != i).collect();
            found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            // Many points at one parameter may hide the point from itself; then there is one too many.
            found.into_iter().take(count).map(|(_, j)| j as u32).collect::<Vec<_>>()
        };
        let indices = (0..speaks.len()).into_par_iter().with_min_len(CHUNK).flat_map_iter(nearest).collect();
        Ok(Self { count, indices })
    }

    /// The neighbours of a point that are not left out; all of them where few would remain.
    fn of<'a>(&'a self, i: usize, left_out: &'a [bool]) -> impl Iterator<Item = usize> + Clone + 'a {
        let all = &self.indices[i * self.count..(i + 1) * self.count];
        let remaining = all.iter().filter(|&&j| !left_out[j as usize]).count();
        let every = FEWEST * remaining < self.count;
        all.iter().map(|&j| j as usize).filter(move |&j| every || !left_out[j])
    }

    /// How far the residual of each point lies from the median, coordinate by coordinate, of its neighbours' residuals.
    ///
    /// `residuals` holds one array per coordinate. Where a space is too coarse for the shape the residuals of neighbours
    /// agree, however large they are; an outlier's does not.
    ///
    /// Neighbours that are left out, because they deviate themselves, have no say: where outliers lie close together they are
    /// found from the edge of the cluster inwards.
    pub(super) fn deviations(&self, residuals: &[Vec<f64>], left_out: &[bool]) -> Vec<f64> {
        let points = residuals.first().map_or(0, Vec::len);
        let deviation = |values: &mut Vec<f64>, i: usize| {
            let squares = residuals.iter().map(|column| {
                values.clear();
                values.extend(self.of(i, left_out).map(|j| column[j]));
                (column[i] - median(values)).powi(2)
            });
            squares.sum::<f64>().sqrt()
        };
        (0..points).into_par_iter().with_min_len(CHUNK).map_init(Vec::new, deviation).collect()
    }

    /// The scale of the neighbours' deviations: large where residuals vary for want of resolution.
    pub(super) fn scales(&self, deviations: &[f64], left_out: &[bool]) -> Vec<f64> {
        let scale = |values: &mut Vec<f64>, i: usize| {
            values.clear();
            values.extend(self.of(i, left_out).map(|j| deviations[j]));
            median_scale(values)
        };
        (0..deviations.len()).into_par_iter().with_min_len(CHUNK).map_init(Vec::new, scale).collect()
    }
}

/// The median; the upper one of an even number, 0 of none.
fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    #[test]
    fn an_outlier_deviates_and_a_coarse_fit_does_not() {
        // Residuals of a fit that is too coarse: large, but alike among neighbours. Every fifth point is an outlier.
        let m = 400;
        let parameters = Array2::from_shape_fn((m, 2), |(i, d)| [(i % 20) as f64 / 19.0, (i / 20) as f64 / 19.0][d]);
        let smooth = |i: usize| (3.0 * parameters[[i, 0]]).sin() + parameters[[i, 1]];
        let outlier = |i: usize| i % 5 == 2;
        let residuals = vec![(0..m).map(|i| smooth(i) + if outlier(i) { 5.0 } else { 0.0 }).collect::<Vec<_>>()];
        let neighbourhoods = Neighbourhoods::new::<2>(parameters.view(), &vec![true; m], 20).unwrap();
        let deviations = neighbourhoods.deviations(&residuals, &vec![false; m]);
        let scales = neighbourhoods.scales(&deviations, &vec![false; m]);
        for i in 0..m {
            assert_eq!(deviations[i] > 4.685 * scales[i].max(0.1), outlier(i), "{i}: {} {}", deviations[i], scales[i]);
        }
    }

    #[test]
    fn points_that_do_not_speak_are_no_neighbours() {
        let parameters = Array2::from_shape_fn((10, 1), |(i, _)| i as f64);
        let speaks: Vec<bool> = (0..10).map(|i| i != 4).collect();
        let neighbourhoods = Neighbourhoods::new::<1>(parameters.view(), &speaks, 2).unwrap();
        let of = |i| neighbourhoods.of(i, &[false; 10]).collect::<Vec<_>>();
        assert_eq!((of(5), of(4)), (vec![6, 3], vec![3, 5]));
        let none = Neighbourhoods::new::<1>(parameters.view(), &[false; 10], 2).unwrap();
        assert_eq!(none.deviations(&[vec![1.0; 10]], &[false; 10]), [1.0; 10]);
        assert_eq!(none.scales(&[1.0; 10], &[false; 10]), [0.0; 10]);
    }
}
