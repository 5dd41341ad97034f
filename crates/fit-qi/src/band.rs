//! Elimination of all unknowns but one from a symmetric banded system.

/// A symmetric banded matrix with right-hand sides.
#[derive(Debug, Default)]
pub(crate) struct Band {
    n: usize,
    /// Number of subdiagonals.
    reach: usize,
    /// Lower band by columns: entry `(j + k, j)` at `j (reach + 1) + k`.
    matrix: Vec<f64>,
    /// Right-hand sides, one array of `n` numbers each; before them the row of the wanted unknown.
    rows: Vec<f64>,
    diagonal: Vec<f64>,
}

/// A pivot below this share of its diagonal entry is round-off: the unknown is a combination of those before it.
const SINGULAR: f64 = 1e-11;

impl Band {
    /// A zero system of `n` unknowns with `reach` subdiagonals and `columns` right-hand sides.
    pub(crate) fn reset(&mut self, n: usize, reach: usize, columns: usize) {
        (self.n, self.reach) = (n, reach);
        self.matrix.clear();
        self.matrix.resize(n * (reach + 1), 0.0);
        self.rows.clear();
        self.rows.resize((columns + 1) * n, 0.0);
    }

    /// The lower band of a column and of all after it.
    #[inline(always)]
    pub(crate) fn column_mut(&mut self, j: usize) -> &mut [f64] {
        &mut self.matrix[j * (self.reach + 1)..]
    }

    /// A right-hand side.
    #[inline(always)]
    pub(crate) fn right_mut(&mut self, k: usize) -> &mut [f64] {
        &mut self.rows[(k + 1) * self.n..(k + 2) * self.n]
    }

    /// Sums of the rows.
    pub(crate) fn row_sums(&self, out: &mut Vec<f64>) {
        out.clear();
        out.resize(self.n, 0.0);
        for (j, column) in self.matrix.chunks_exact(self.reach + 1).enumerate() {
            let below = self.reach.min(self.n - 1 - j);
            let mut sum = column[0];
            for (entry, target) in column[1..=below].iter().zip(&mut out[j + 1..]) {
                sum += entry;
                *target += entry;
            }
            out[j] += sum;
        }
    }

    /// Values of one unknown, one per right-hand side, to `out`. Returns the share of its diagonal entry that is left when
    /// all others are eliminated: zero if the system does not determine it. Unknowns that are combinations of others are
    /// left out, which changes nothing for the wanted one as long as it is determined.
    pub(crate) fn solve_for(&mut self, wanted: usize, out: &mut [f64]) -> f64 {
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || self.eliminate(wanted, out),
        )
    }

    #[inline(always)]
    fn eliminate(&mut self, wanted: usize, out: &mut [f64]) -> f64 {
        let (n, reach, width) = (self.n, self.reach, self.reach + 1);
        let mut own = self.matrix[wanted * width];
        let whole = own;
        for (k, value) in out.iter_mut().enumerate() {
            *value = self.rows[(k + 1) * n + wanted];
        }
        // The wanted unknown leaves the band; its row is eliminated like a right-hand side.
        self.rows[..n].fill(0.0);
        for k in 1..=reach {
            if wanted + k < n {
                self.rows[wanted + k] = std::mem::take(&mut self.matrix[wanted * width + k]);
            }
            if k <= wanted {
                self.rows[wanted - k] = std::mem::take(&mut self.matrix[(wanted - k) * width + k]);
            }
        }
        self.diagonal.clear();
        self.diagonal.extend(self.matrix.chunks_exact(width).map(|column| column[0]));
        for j in 0..n {
            let (head, tail) = self.matrix.split_at_mut((j + 1) * width);
            let below = reach.min(n - 1 - j);
            let column = &head[j * width..=j * width + below];
            let pivot = column[0];
            if j == wanted || pivot <= SINGULAR * self.diagonal[j] {
                continue;
            }
            let inverse = 1.0 / pivot;
            for (i, target) in (1..=below).zip(tail.chunks_exact_mut(width)) {
                let factor = column[i] * inverse;
                if factor != 0.0 {
                    target.iter_mut().zip(&column[i..]).for_each(|(t, c)| *t -= factor * c);
                }
            }
            let share = self.rows[j] * inverse;
            own -= share * self.rows[j];
            for (value, row) in out.iter_mut().zip(self.rows.chunks_exact(n).skip(1)) {
                *value -= share * row[j];
            }
            for row in self.rows.chunks_exact_mut(n) {
                let factor = row[j] * inverse;
                row[j + 1..].iter_mut().zip(&column[1..]).for_each(|(t, c)| *t -= factor * c);
            }
        }
        out.iter_mut().for_each(|value| *value /= own);
        let left = own / whole;
        if left > SINGULAR { left } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A band of the matrix `BᵀB` of rows with three neighbouring numbers.
    fn system(rows: &[(usize, [f64; 3])], n: usize) -> Band {
        let mut band = Band::default();
        band.reset(n, 2, 1);
        for &(first, values) in rows {
            for a in 0..3 {
                for b in 0..=a {
                    band.column_mut(first + b)[a - b] += values[a] * values[b];
                }
                // The solution is x_i = i + 1.
                let image: f64 = (0..3).map(|k| values[k] * (first + k + 1) as f64).sum();
                band.right_mut(0)[first + a] += values[a] * image;
            }
        }
        band
    }

    #[test]
    fn every_unknown_of_a_regular_system_is_found() {
        let rows: Vec<_> =
            (0..4).flat_map(|i| [(i, [1.0, 0.5, 0.2]), (i, [0.3, 1.0, 0.4]), (i, [0.1, 0.2, 1.0])]).collect();
        for wanted in 0..6 {
            let mut value = [0.0];
            assert!(system(&rows, 6).solve_for(wanted, &mut value) > 1e-3);
            assert!((value[0] - (wanted + 1) as f64).abs() < 1e-12, "{wanted}: {value:?}");
        }
    }

    #[test]
    fn a_singular_system_determines_some_unknowns_and_says_which() {
        // One row for unknowns 3 and 4 together, none for 5.
        let mut rows: Vec<_> =
            (0..1).flat_map(|i| [(i, [1.0, 0.5, 0.2]), (i, [0.3, 1.0, 0.4]), (i, [0.1, 0.2, 1.0])]).collect();
        rows.push((2, [0.0, 1.0, 1.0]));
        for wanted in 0..6 {
            let mut value = [0.0];
            let left = system(&rows, 6).solve_for(wanted, &mut value);
            assert_eq!(left > 0.0, wanted < 3, "{wanted}");
            assert!(wanted >= 3 || (value[0] - (wanted + 1) as f64).abs() < 1e-12, "{wanted}: {value:?}");
        }
    }
}
