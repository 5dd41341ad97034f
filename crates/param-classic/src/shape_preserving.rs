//! Shape-preserving weights of a point from the ring of its neighbours.

use std::f64::consts::{PI, TAU};

use point_cloud::vec3::{cross, dot, norm, sub};

/// Weights of `ring`, the neighbours of `center` in cyclic order, in either sense: positive, with sum 1. The centre of
/// a plane ring comes back exactly (Floater, Parametrization and smooth approximation of surface triangulations, CAGD
/// 14, 1997, §6; Imperatore 2024, §4.2.1).
///
/// The ring is laid into the plane with its lengths and the ratios of its angles kept; the weights are the mean, over
/// the ring, of the barycentric coordinates of the centre in the triangle of a neighbour and the two opposite to it.
///
/// `None` if there are fewer than three neighbours, one of them is equal to the centre, or all angles vanish.
pub(crate) fn shape_preserving_weights(center: [f64; 3], ring: &[[f64; 3]]) -> Option<Vec<f64>> {
    let n = ring.len();
    let spokes: Vec<[f64; 3]> = ring.iter().map(|&p| sub(p, center)).collect();
    let lengths: Vec<f64> = spokes.iter().map(|&s| norm(s)).collect();
    if n < 3 || lengths.contains(&0.0) {
        return None;
    }
    let mut directions = Vec::with_capacity(n);
    let mut turned = 0.0;
    for k in 0..n {
        directions.push(turned);
        let (a, b) = (spokes[k], spokes[(k + 1) % n]);
        turned += norm(cross(a, b)).atan2(dot(a, b));
    }
    if turned <= 0.0 {
        return None;
    }
    directions.iter_mut().for_each(|d| *d *= TAU / turned);

    let mut weights = vec![0.0; n];
    // The place r such that the ray opposite to l leaves between r and r + 1; it runs once round the ring with l.
    let mut r = 0;
    for l in 0..n {
        let opposite = directions[l] + PI;
        let unrolled = |k: usize| directions[k % n] + if k < n { 0.0 } else { TAU };
        r = r.max(l);
        while r + 1 < l + n && unrolled(r + 1) <= opposite {
            r += 1;
        }
        let (p, q) = (r % n, (r + 1) % n);
        // Twice the areas of the three triangles at the centre; negative ones are round-off in a flat ring.
        let area = |a: usize, b: usize, angle: f64| (lengths[a] * lengths[b] * angle.sin()).max(0.0);
        let at_l = area(p, q, unrolled(r + 1) - unrolled(r));
        let at_p = area(q, l, directions[l] + TAU - unrolled(r + 1));
        let at_q = area(l, p, unrolled(r) - directions[l]);
        let total = at_l + at_p + at_q;
        if total > 0.0 {
            for (k, share) in [(l, at_l), (p, at_p), (q, at_q)] {
                weights[k] += share / total;
            }
        }
    }
    let total: f64 = weights.iter().sum();
    (total > 0.0).then(|| weights.iter().map(|w| w / total).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Linear precision: a plane ring in general position, in space, in either sense.
        #[test]
        fn the_center_of_a_plane_ring_comes_back(
            gaps in prop::collection::vec(0.3..1.0f64, 3..12), radii in prop::collection::vec(0.05..3.0f64, 12),
            tilt in -2.0..2.0f64, reversed: bool,
        ) {
            // No gap of half a turn: the centre is inside.
            let total: f64 = gaps.iter().sum();
            prop_assume!(gaps.iter().all(|g| g / total < 0.49));
            let mut angle = 0.0;
            let mut ring: Vec<[f64; 3]> = gaps.iter().zip(&radii).map(|(gap, r)| {
                angle += TAU * gap / total;
                let (x, y) = (r * angle.cos(), r * angle.sin());
                [1.0 + x, y - 2.0, tilt * x - y]
            }).collect();
            if reversed {
                ring.reverse();
            }
            let center = [1.0, -2.0, 0.0];
            let weights = shape_preserving_weights(center, &ring).unwrap();
            prop_assert!(weights.iter().all(|&w| w > 0.0));
            for k in 0..3 {
                let mean: f64 = ring.iter().zip(&weights).map(|(p, w)| w * p[k]).sum();
                prop_assert!((mean - center[k]).abs() < 1e-11, "{weights:?}");
            }
        }
    }

    #[test]
    fn a_cone_is_flattened_by_ratios_of_angles() {
        // The apex of a regular pyramid: equal weights.
        let ring: Vec<[f64; 3]> =
            (0..5).map(|k| [(TAU * k as f64 / 5.0).cos(), (TAU * k as f64 / 5.0).sin(), -2.0]).collect();
        let weights = shape_preserving_weights([0.0; 3], &ring).unwrap();
        assert!(weights.iter().all(|w| (w - 0.2).abs() < 1e-14), "{weights:?}");
    }

    #[test]
    fn rings_without_a_plane_have_no_weights() {
        let line = [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]];
        assert_eq!(shape_preserving_weights([0.0; 3], &line), None);
        assert_eq!(shape_preserving_weights([1.0, 0.0, 0.0], &line), None);
        assert_eq!(shape_preserving_weights([0.0; 3], &line[..2]), None);
    }
}
