//! Vectors of space as plain arrays.

/// `a + b`.
#[inline]
pub fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] + b[k])
}

/// `a − b`.
#[inline]
pub fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

/// `factor · a`.
#[inline]
pub fn scale(factor: f64, a: [f64; 3]) -> [f64; 3] {
    a.map(|x| factor * x)
}

/// Scalar product.
#[inline]
pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
#[inline]
pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Length. Its square must neither under- nor overflow; [`unit()`] has no such limit.
#[inline]
pub fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

/// `a` with length one; zero stays zero.
pub fn unit(a: [f64; 3]) -> [f64; 3] {
    // Divided by the largest entry first, so that no square under- or overflows.
    let size = a.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    if size == 0.0 {
        return a;
    }
    let a = a.map(|x| x / size);
    let length = norm(a);
    a.map(|x| x / length)
}

/// Lower and upper corner of the box around points; infinite, and turned over, without any.
pub fn box_of(points: impl IntoIterator<Item = [f64; 3]>) -> [[f64; 3]; 2] {
    points.into_iter().fold([[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]], |[lower, upper], p| {
        [std::array::from_fn(|k| lower[k].min(p[k])), std::array::from_fn(|k| upper[k].max(p[k]))]
    })
}

/// The diagonal of that box; 0 without points.
pub fn diagonal(points: &[[f64; 3]]) -> f64 {
    if points.is_empty() {
        return 0.0;
    }
    let [lower, upper] = box_of(points.iter().copied());
    norm(sub(upper, lower))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_vector_product_is_orthogonal_and_as_long_as_the_area() {
        let (a, b) = ([1.0, -2.0, 0.5], [3.0, 0.25, -1.0]);
        let c = cross(a, b);
        assert!(dot(c, a).abs() < 1e-14 && dot(c, b).abs() < 1e-14);
        // Lagrange's identity.
        assert!((dot(c, c) - (dot(a, a) * dot(b, b) - dot(a, b).powi(2))).abs() < 1e-12);
        assert_eq!(add(sub(a, b), b), a);
    }

    #[test]
    fn unit_vectors_exist_at_any_size() {
        for size in [1e-300, 1.0, 1e300] {
            let u = unit(scale(size, [2.0, -3.0, 6.0]));
            assert!((u[0] - 2.0 / 7.0).abs() < 1e-15 && (norm(u) - 1.0).abs() < 1e-15);
        }
        assert_eq!(unit([0.0; 3]), [0.0; 3]);
    }
}
