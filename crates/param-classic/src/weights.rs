//! Weights of convex-combination maps.

use point_cloud::vec3::{cross, dot, norm, sub};

/// How an interior vertex is averaged from its neighbours.
///
/// All weights are positive, so the map of a disk onto the square is one-to-one but for triangles squeezed into one
/// side (Tutte, How to draw a graph, 1963; Floater, One-to-one piecewise linear mappings over triangulations,
/// Math. Comp. 72, 2003, Theorem 4.1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Weights {
    /// The plain mean of the neighbours (Tutte). Sees the connectivity only.
    Uniform,
    /// Mean value coordinates: `w_ij = (tan(α/2) + tan(β/2)) / |p_i p_j|` with the angles α, β at `p_i` on both
    /// sides of the edge (Floater, Mean value coordinates, CAGD 20, 2003, eq. 2.1). Reproduces plane meshes.
    #[default]
    MeanValue,
}

/// Largest `tan(α/2)` in a mean-value weight, and the inverse of the smallest. It is met by angles within 2e-5 of 0 or
/// π, in triangles that are lines to five digits; without it their weights would be zero, infinite or undefined. The
/// map stays one-to-one whatever the value; larger ones tie such vertices closer but cost digits in the solution.
pub const HALF_TANGENT_LIMIT: f64 = 1e5;

/// What the triangle `(p, q, r)` adds to the weights of `q` and `r` in the mean at `p`. Edges count as at least `floor`
/// long.
pub(crate) fn corner_weights(weights: Weights, [p, q, r]: [[f64; 3]; 3], floor: f64) -> [f64; 2] {
    match weights {
        // Each edge at an interior vertex has two triangles.
        Weights::Uniform => [0.5; 2],
        Weights::MeanValue => {
            let (a, b) = (sub(q, p), sub(r, p));
            let (length_a, length_b) = (norm(a), norm(b));
            let (sine, cosine) = (norm(cross(a, b)), dot(a, b));
            // Both forms equal tan(α/2); each is used where it does not cancel.
            let half_tangent = if cosine > 0.0 {
                sine / (length_a * length_b + cosine)
            } else if sine > 0.0 {
                (length_a * length_b - cosine) / sine
            } else {
                HALF_TANGENT_LIMIT
            };
            let half_tangent = half_tangent.clamp(HALF_TANGENT_LIMIT.recip(), HALF_TANGENT_LIMIT);
            [half_tangent / length_a.max(floor), half_tangent / length_b.max(floor)]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_value_weights_agree_with_the_formula() {
        for alpha in [1e-3, 0.4, 1.5, 2.0, 3.1] {
            let (s, c) = f64::sin_cos(alpha);
            let triangle = [[1.0, 2.0, 3.0], [3.0, 2.0, 3.0], [1.0 + 0.5 * c, 2.0 + 0.5 * s, 3.0]];
            let [to_q, to_r] = corner_weights(Weights::MeanValue, triangle, 0.0);
            let half = (alpha / 2.0).tan();
            assert!((to_q / (half / 2.0) - 1.0).abs() < 1e-11 && (to_r / (half / 0.5) - 1.0).abs() < 1e-11);
        }
    }

    #[test]
    fn flat_triangles_have_positive_finite_weights() {
        for x in [0.5, -0.5, 1.0] {
            let triangle = [[0.0; 3], [1.0, 0.0, 0.0], [x, 0.0, 0.0]];
            assert!(corner_weights(Weights::MeanValue, triangle, 0.0).iter().all(|w| *w > 0.0 && w.is_finite()));
        }
    }
}
