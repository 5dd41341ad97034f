//! The symmetric Dirichlet energy of a piecewise linear map, and its local quadratic model.

use point_cloud::vec3::{cross, dot, norm, sub};

/// A triangle with area, laid flat.
pub(crate) struct FlatTriangle {
    pub(crate) vertices: [u32; 3],
    /// Share of the whole area.
    pub(crate) area: f64,
    /// Gradients of the three hat functions, in a frame of the triangle; lengths such that the whole area is 1.
    pub(crate) gradients: [[f64; 2]; 3],
}

impl FlatTriangle {
    /// Lays the triangle flat; `None` if it has no area. Area and gradients are in the units of the points.
    pub(crate) fn new(vertices: [u32; 3], [p, q, r]: [[f64; 3]; 3]) -> Option<Self> {
        let (e, f) = (sub(q, p), sub(r, p));
        let (length, twice_area) = (norm(e), norm(cross(e, f)));
        // The corners are (0, 0), (length, 0) and (x, y).
        let (x, y) = (dot(e, f) / length, twice_area / length);
        let at_q = [length.recip(), -x / (length * y)];
        let at_r = [0.0, y.recip()];
        let gradients = [[-at_q[0], -at_q[1] - at_r[1]], at_q, at_r];
        let usable = twice_area > 0.0 && gradients.iter().flatten().all(|g| g.is_finite());
        usable.then_some(Self { vertices, area: 0.5 * twice_area, gradients })
    }

    /// Scales the whole mesh, of area `total`, to area 1.
    pub(crate) fn normalize(&mut self, total: f64) {
        self.area /= total;
        let root = total.sqrt();
        self.gradients.iter_mut().flatten().for_each(|g| *g *= root);
    }

    /// Jacobian of the map that takes the vertices to `uv`; rows belong to u and v.
    pub(crate) fn jacobian(&self, uv: &[[f64; 2]]) -> [[f64; 2]; 2] {
        let mut jacobian = [[0.0; 2]; 2];
        for (gradient, &vertex) in self.gradients.iter().zip(&self.vertices) {
            for k in 0..2 {
                for l in 0..2 {
                    jacobian[k][l] += uv[vertex as usize][k] * gradient[l];
                }
            }
        }
        jacobian
    }
}

/// The symmetric Dirichlet energy `Σ area (‖J‖² + ‖J⁻¹‖²)` of the map onto the rectangle `[0, a] × [0, 1/a]`, at least
/// 4; infinite where a triangle is not positively oriented (Smith and Schaefer, Bijective parameterization with free
/// boundaries, ACM TOG 34, 2015).
pub(crate) fn energy(triangles: &[FlatTriangle], uv: &[[f64; 2]], stretch: f64) -> f64 {
    let [p, q] = parts(triangles, uv);
    stretch * stretch * p + q / (stretch * stretch)
}

/// The factor `a` with the least energy.
pub(crate) fn best_stretch(triangles: &[FlatTriangle], uv: &[[f64; 2]]) -> f64 {
    let [p, q] = parts(triangles, uv);
    (q / p).sqrt().sqrt()
}

/// `P` and `Q` of the energy `a² P + Q/a²`: with `det J` free of `a`, `‖J⁻¹‖ = ‖J‖/det J` leaves these two.
fn parts(triangles: &[FlatTriangle], uv: &[[f64; 2]]) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for triangle in triangles {
        let [[a, b], [c, d]] = triangle.jacobian(uv);
        let determinant = a * d - b * c;
        if determinant <= 0.0 {
            return [f64::INFINITY; 2];
        }
        let factor = triangle.area * (1.0 + (determinant * determinant).recip());
        sums[0] += factor * (a * a + b * b);
        sums[1] += factor * (c * c + d * d);
    }
    sums
}

/// The quadratic model `area · tr((J − R)ᵀ M (J − R))` of the energy of one triangle, with the same gradient at `J`:
/// returns `M` and `M (J − R)`. `R` is the rotation nearest to `J`, `M` weighs its left singular directions by
/// `1 + 1/σ + 1/σ² + 1/σ³` (Rabinovich et al., Scalable locally injective mappings, ACM TOG 36, 2017, Table 1).
pub(crate) fn quadratic_model([[a, b], [c, d]]: [[f64; 2]; 2]) -> ([[f64; 2]; 2], [[f64; 2]; 2]) {
    // J is the sum of a scaled rotation and a scaled reflection; their lengths give the singular values.
    let (e, f, g, h) = (0.5 * (a + d), 0.5 * (a - d), 0.5 * (c + b), 0.5 * (c - b));
    let (rotation, reflection) = (e.hypot(h), f.hypot(g));
    let first = rotation + reflection;
    let second = (a * d - b * c) / first;
    let weight = |s: f64| 1.0 + (1.0 + (1.0 + s.recip()) / s) / s;
    let (mean, half) = (0.5 * (weight(first) + weight(second)), 0.5 * (weight(first) - weight(second)));
    // Cosine and sine of twice the angle of the left singular vectors.
    let (cosine, sine) = if reflection > 0.0 {
        ((f * e - g * h) / (reflection * rotation), (g * e + f * h) / (reflection * rotation))
    } else {
        (1.0, 0.0)
    };
    let m = [[mean + half * cosine, half * sine], [half * sine, mean - half * cosine]];
    let difference = [[a - e / rotation, b + h / rotation], [c - h / rotation, d - e / rotation]];
    let product =
        std::array::from_fn(|k| std::array::from_fn(|l| m[k][0] * difference[0][l] + m[k][1] * difference[1][l]));
    (m, product)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn energy_of([[a, b], [c, d]]: [[f64; 2]; 2]) -> f64 {
        let determinant = a * d - b * c;
        (a * a + b * b + c * c + d * d) * (1.0 + determinant.powi(-2))
    }

    proptest! {
        /// Twice the product is the derivative of the energy, by central differences.
        #[test]
        fn the_model_has_the_gradient_of_the_energy(
            entries in prop::collection::vec(-2.0..2.0f64, 4),
        ) {
            let mut jacobian = [[entries[0], entries[1]], [entries[2], entries[3]]];
            let determinant = jacobian[0][0] * jacobian[1][1] - jacobian[0][1] * jacobian[1][0];
            prop_assume!(determinant.abs() > 0.3);
            if determinant < 0.0 {
                jacobian.swap(0, 1);
            }
            let (m, product) = quadratic_model(jacobian);
            prop_assert!(m[0][0] > 0.0 && m[0][0] * m[1][1] - m[0][1] * m[1][0] > 0.0);
            for (k, l) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let at = |step: f64| {
                    let mut moved = jacobian;
                    moved[k][l] += step;
                    energy_of(moved)
                };
                let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
                prop_assert!((slope - 2.0 * product[k][l]).abs() < 1e-4 * (1.0 + slope.abs()), "{slope} {product:?}");
            }
        }
    }

    #[test]
    fn an_isometry_has_energy_four_and_a_rectangle_its_stretch() {
        let triangles = [[0u32, 1, 2], [0, 2, 3]];
        let at = [[0.0, 0.0, 1.0], [8.0, 0.0, 1.0], [8.0, 2.0, 1.0], [0.0, 2.0, 1.0]];
        let mut flat: Vec<FlatTriangle> =
            triangles.iter().map(|t| FlatTriangle::new(*t, t.map(|v| at[v as usize])).unwrap()).collect();
        flat.iter_mut().for_each(|t| t.normalize(16.0));
        let uv = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let stretch = best_stretch(&flat, &uv);
        assert!((stretch - 2.0).abs() < 1e-14 && (energy(&flat, &uv, stretch) - 4.0).abs() < 1e-14);
        assert_eq!(energy(&flat, &[uv[0], uv[1], [0.5, -0.1], uv[3]], 1.0), f64::INFINITY);
        assert!(FlatTriangle::new([0, 1, 2], [at[0], at[1], at[1]]).is_none());
    }
}
