//! Rows in an order in which neighbours stand together, and balls around runs of them.

use std::ops::Range;

use crate::real::vectorized;

/// Widths are multiples of it: loops over rows are then loops over whole vectors.
pub(super) const LANES: usize = 8;

/// Rows of a leaf. Smaller leaves have smaller balls, and more of them have to be asked.
pub(super) const LEAF: usize = 16;

/// Rows of equal width, a multiple of [`LANES`].
pub(super) struct Rows {
    pub(super) values: Vec<f32>,
    pub(super) width: usize,
}

impl Rows {
    pub(super) fn count(&self) -> usize {
        self.values.len() / self.width
    }

    pub(super) fn row(&self, index: usize) -> &[f32] {
        &self.values[index * self.width..][..self.width]
    }

    pub(super) fn run(&self, range: Range<usize>) -> &[f32] {
        &self.values[range.start * self.width..range.end * self.width]
    }

    pub(super) fn select(&self, indices: impl Iterator<Item = u32>) -> Self {
        let mut values = Vec::with_capacity(self.values.len());
        indices.for_each(|index| values.extend_from_slice(self.row(index as usize)));
        Self { values, width: self.width }
    }
}

/// `Σ f(aₖ, bₖ)` in lanes, whatever the machine.
#[inline(always)]
fn lane_sum(a: &[f32], b: &[f32], f: impl Fn(f32, f32) -> f32) -> f32 {
    let mut sums = [0.0f32; LANES];
    for (a, b) in a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0) {
        for k in 0..LANES {
            sums[k] += f(a[k], b[k]);
        }
    }
    let [a, b, c, d, e, f, g, h] = sums;
    ((a + b) + (c + d)) + ((e + f) + (g + h))
}

#[inline(always)]
pub(super) fn squared_distance(a: &[f32], b: &[f32]) -> f32 {
    lane_sum(a, b, |a, b| (a - b) * (a - b))
}

#[inline(always)]
pub(super) fn dot(a: &[f32], b: &[f32]) -> f32 {
    lane_sum(a, b, |a, b| a * b)
}

/// An order of the rows in which each leaf and each pair of leaves, fours and so on lie together: halves are split across
/// the line through two rows far from each other.
pub(super) fn order(rows: &Rows) -> Vec<u32> {
    let mut order: Vec<u32> = (0..rows.count() as u32).collect();
    let mut keys = vec![(0.0, 0); order.len()];
    let mut open: Vec<Range<usize>> = std::iter::once(0..order.len()).collect();
    while let Some(range) = open.pop() {
        let leaves = range.len().div_ceil(LEAF);
        if leaves < 2 {
            continue;
        }
        // The largest power of two below the number of leaves: all runs of a power of two of them are subtrees.
        let half = LEAF << (leaves - 1).ilog2();
        let (part, keys) = (&mut order[range.clone()], &mut keys[..range.len()]);
        project(rows, part, keys);
        keys.select_nth_unstable_by(half, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        part.iter_mut().zip(keys.iter()).for_each(|(place, key)| *place = key.1);
        open.extend([range.start..range.start + half, range.start + half..range.end]);
    }
    order
}

/// The row farthest from a given one.
#[inline(always)]
fn farthest<'a>(rows: &'a Rows, indices: &[u32], from: &[f32]) -> &'a [f32] {
    let mut far = (0.0, indices[0]);
    for &index in indices {
        let distance = squared_distance(rows.row(index as usize), from);
        if distance > far.0 {
            far = (distance, index);
        }
    }
    rows.row(far.1 as usize)
}

/// Places along the line from the row farthest from the first one to the row farthest from that.
fn project(rows: &Rows, indices: &[u32], keys: &mut [(f32, u32)]) {
    vectorized(
        #[inline(always)]
        || {
            let one = farthest(rows, indices, rows.row(indices[0] as usize));
            let other = farthest(rows, indices, one);
            let mut line = [0.0; MOST];
            for (line, (a, b)) in line.iter_mut().zip(other.iter().zip(one)) {
                *line = a - b;
            }
            let line = &line[..one.len().min(MOST)];
            for (key, &index) in keys.iter_mut().zip(indices) {
                *key = (dot(&rows.row(index as usize)[..line.len()], line), index);
            }
        },
    );
}

/// Columns that are looked at for the order; what it is changes no result.
const MOST: usize = 64;

/// Balls around runs of rows.
pub(super) struct Balls {
    pub(super) centers: Rows,
    pub(super) radii: Vec<f32>,
}

impl Balls {
    /// Around each run of `length` rows.
    pub(super) fn new(rows: &Rows, length: usize) -> Self {
        let width = rows.width;
        let count = rows.count().div_ceil(length);
        let (mut centers, mut radii) = (vec![0.0; count * width], vec![0.0; count]);
        vectorized(
            #[inline(always)]
            || {
                let runs = rows.values.chunks(length * width);
                for ((run, center), radius) in runs.zip(centers.chunks_exact_mut(width)).zip(&mut radii) {
                    let share = width as f32 / run.len() as f32;
                    for row in run.chunks_exact(width) {
                        center.iter_mut().zip(row).for_each(|(c, x)| *c += *x * share);
                    }
                    let mut far = 0.0f32;
                    for row in run.chunks_exact(width) {
                        far = far.max(squared_distance(row, center));
                    }
                    *radius = far.sqrt();
                }
            },
        );
        Self { centers: Rows { values: centers, width }, radii }
    }
}
