//! Bernstein polynomials on the unit interval: values, derivatives, inner products, and the blocks that fast kernels share.
//!
//! `B_k(t) = C(p,k) t^k (1−t)^{p−k}`; tensor products are numbered with the first direction fastest.

use crate::MAX_DEGREE;

/// Points that a kernel handles at a time: a block of values for both directions stays in the first-level cache.
pub const BLOCK: usize = 64;

/// Partial sums of a dot product. Fixed, so that sums do not depend on the width of the machine's vectors.
pub const LANES: usize = 8;

/// One number for each point of a block.
pub type Block = [f64; BLOCK];

/// The binomial coefficient `C(n, k)`, exact for the degrees of this crate.
pub fn binomial(n: usize, k: usize) -> f64 {
    (0..k).fold(1.0, |value, i| value * (n - i) as f64 / (i + 1) as f64).round()
}

/// Values of the `degree + 1` Bernstein polynomials at `t`, written to the front of `out`.
#[inline]
pub fn values(degree: usize, t: f64, out: &mut [f64]) {
    out[0] = 1.0;
    for q in 1..=degree {
        let mut carried = 0.0;
        for value in &mut out[..q] {
            let share = *value;
            *value = carried + (1.0 - t) * share;
            carried = t * share;
        }
        out[q] = carried;
    }
}

/// Derivatives of order `order` of the Bernstein polynomials at `t`, written to the front of `out`.
pub fn derivatives(degree: usize, order: usize, t: f64, out: &mut [f64]) {
    if order > degree {
        out[..=degree].fill(0.0);
        return;
    }
    values(degree - order, t, out);
    for q in degree - order + 1..=degree {
        // B'_k of degree q is q (B_{k−1} − B_k) of degree q − 1.
        let factor = q as f64;
        let mut previous = 0.0;
        for value in &mut out[..q] {
            let current = *value;
            *value = factor * (previous - current);
            previous = current;
        }
        out[q] = factor * previous;
    }
}

/// The total of partial sums, in a fixed order.
pub fn total(sums: &[f64; LANES]) -> f64 {
    ((sums[0] + sums[4]) + (sums[2] + sums[6])) + ((sums[1] + sums[5]) + (sums[3] + sums[7]))
}

/// Matrix of inner products on `[0, 1]` of the derivatives of the given orders, `(degree + 1)²` row-major; exact.
pub fn inner_products(degree: usize, row_order: usize, column_order: usize) -> Vec<f64> {
    let product = |i: usize, j: usize, p: usize, q: usize| {
        binomial(p, i) * binomial(q, j) / (binomial(p + q, i + j) * (p + q + 1) as f64)
    };
    let rows = derivative_coefficients(degree, row_order);
    let columns = derivative_coefficients(degree, column_order);
    let (p, q) = (degree.saturating_sub(row_order), degree.saturating_sub(column_order));
    gram(&rows, &columns, |i, j| product(i, j, p, q))
}

/// The same by a Gauss–Legendre rule with `nodes` nodes, exact up to degree `2 nodes − 1` only.
pub fn inner_products_gauss(degree: usize, row_order: usize, column_order: usize, nodes: usize) -> Vec<f64> {
    let mut matrix = vec![0.0; (degree + 1) * (degree + 1)];
    let (mut row, mut column) = ([0.0; MAX_DEGREE + 1], [0.0; MAX_DEGREE + 1]);
    for (node, weight) in gauss_legendre(nodes) {
        derivatives(degree, row_order, node, &mut row);
        derivatives(degree, column_order, node, &mut column);
        for i in 0..=degree {
            for j in 0..=degree {
                matrix[i * (degree + 1) + j] += weight * row[i] * column[j];
            }
        }
    }
    matrix
}

/// Nodes and weights of the Gauss–Legendre rule on `[0, 1]`.
pub fn gauss_legendre(nodes: usize) -> Vec<(f64, f64)> {
    // Newton's iteration from the usual cosine guess doubles its digits; six steps reach round-off for all rules here.
    const NEWTON_STEPS: usize = 6;
    (0..nodes)
        .map(|k| {
            let mut x = -(std::f64::consts::PI * (k as f64 + 0.75) / (nodes as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..NEWTON_STEPS {
                let (mut previous, mut current) = (0.0, 1.0);
                for n in 0..nodes {
                    let next = ((2 * n + 1) as f64 * x * current - n as f64 * previous) / (n + 1) as f64;
                    previous = current;
                    current = next;
                }
                slope = nodes as f64 * (x * current - previous) / (x * x - 1.0);
                x -= current / slope;
            }
            (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// Coefficients of the derivatives in the Bernstein basis of the lower degree: one row per polynomial.
fn derivative_coefficients(degree: usize, order: usize) -> Vec<Vec<f64>> {
    (0..=degree)
        .map(|i| {
            let mut row: Vec<f64> = (0..=degree).map(|k| f64::from(u8::from(k == i))).collect();
            for q in (degree.saturating_sub(order) + 1..=degree).rev() {
                row = row.windows(2).map(|pair| q as f64 * (pair[1] - pair[0])).collect();
            }
            if order > degree { vec![0.0] } else { row }
        })
        .collect()
}

fn gram(rows: &[Vec<f64>], columns: &[Vec<f64>], product: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    let mut matrix = Vec::with_capacity(rows.len() * columns.len());
    for row in rows {
        for column in columns {
            let mut sum = 0.0;
            for (i, a) in row.iter().enumerate() {
                for (j, c) in column.iter().enumerate() {
                    sum += a * c * product(i, j);
                }
            }
            matrix.push(sum);
        }
    }
    matrix
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_those_of_the_power_form() {
        // d²/dt² of C(p,k) t^k (1−t)^{p−k} at t = 0 and the sum rule Σ B'' = 0.
        for degree in 2..=MAX_DEGREE {
            let mut row = [0.0; MAX_DEGREE + 1];
            derivatives(degree, 2, 0.0, &mut row);
            let p = degree as f64;
            assert_eq!(row[0], p * (p - 1.0));
            assert_eq!(row[1], -2.0 * p * (p - 1.0));
            derivatives(degree, 2, 0.37, &mut row);
            assert!(row[..=degree].iter().sum::<f64>().abs() < 1e-12);
        }
    }

    #[test]
    fn gauss_agrees_with_exact_products_where_it_is_exact() {
        for degree in 1..=MAX_DEGREE {
            for order in 0..=2.min(degree) {
                let exact = inner_products(degree, order, order);
                let gauss = inner_products_gauss(degree, order, order, degree - order + 1);
                let scale = exact.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
                for (a, b) in exact.iter().zip(&gauss) {
                    assert!((a - b).abs() < 1e-13 * scale, "degree {degree}, order {order}: {a} {b}");
                }
            }
        }
    }
}
