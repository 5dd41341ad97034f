//! An order of points that neither depends on the order in which they are listed nor on how the part lies and is turned.

use ndarray::ArrayView2;

/// The places of points `(m, N)` by their distance from their mean, the nearest first.
///
/// What breaks ties by the order of the points, such as a triangulation or a choice among corners that are alike, then makes the same of
/// the same part, however its file lists it. Of points at the same distance the one with the lesser coordinates comes first, of equal
/// points the one that was listed first.
pub fn canonical_order(points: ArrayView2<'_, f64>) -> Vec<usize> {
    // Sorted values have the same sum up to the last bit, whatever the order.
    let mean: Vec<f64> = points
        .columns()
        .into_iter()
        .map(|column| {
            let mut sorted = column.to_vec();
            sorted.sort_unstable_by(f64::total_cmp);
            sorted.iter().sum::<f64>() / sorted.len().max(1) as f64
        })
        .collect();
    let distance = |i: usize| points.row(i).iter().zip(&mean).map(|(x, m)| (x - m) * (x - m)).sum::<f64>();
    let by_coordinates = |a: usize, b: usize| {
        points.row(a).iter().zip(points.row(b)).map(|(x, y)| x.total_cmp(y)).find(|order| order.is_ne())
    };
    let mut order: Vec<(f64, usize)> = (0..points.nrows()).map(|i| (distance(i), i)).collect();
    order.sort_unstable_by(|(near, a), (far, b)| {
        let same_distance = || by_coordinates(*a, *b).unwrap_or_else(|| a.cmp(b));
        near.total_cmp(far).then_with(same_distance)
    });
    order.into_iter().map(|(_, i)| i).collect()
}

/// Triangles in an order that depends on the indices of their corners alone: each begins with the least of its corners.
pub fn canonical_triangles(triangles: &mut [[u32; 3]]) {
    for t in triangles.iter_mut() {
        let least = (0..3).min_by_key(|&k| t[k]).unwrap_or_default();
        t.rotate_left(least);
    }
    triangles.sort_unstable();
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, Axis};
    use proptest::prelude::*;

    proptest! {
        /// Points on a lattice have many at the same distance.
        #[test]
        fn the_order_of_a_list_does_not_matter(
            points in proptest::collection::vec(prop::array::uniform3(-3_i8..=3), 1..60),
            seed in 0_usize..1000,
        ) {
            let all = Array2::from_shape_fn((points.len(), 3), |(i, k)| f64::from(points[i][k]) / 7.0);
            let mut other: Vec<usize> = (0..points.len()).collect();
            for i in (1..other.len()).rev() {
                other.swap(i, (seed.wrapping_mul(2_654_435_761) >> 3).wrapping_add(i * i) % (i + 1));
            }
            let shuffled = all.select(Axis(0), &other);
            let in_order = |points: &Array2<f64>| points.select(Axis(0), &canonical_order(points.view()));
            prop_assert_eq!(in_order(&all), in_order(&shuffled));
        }
    }

    #[test]
    fn triangles_keep_their_orientation() {
        let mut triangles = [[5, 3, 4], [2, 0, 1], [3, 1, 0]];
        canonical_triangles(&mut triangles);
        assert_eq!(triangles, [[0, 1, 2], [0, 3, 1], [3, 4, 5]]);
    }
}
