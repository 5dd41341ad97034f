//! Rows of features without what they have in common: columns that never change, rows that occur again.

use std::hash::Hasher;

use rustc_hash::{FxBuildHasher, FxHashMap, FxHasher};

use super::tree::{LANES, Rows};
use crate::real::vectorized;

/// Equal rows in one group. Networks whose layers cut off negative features have many: a hidden layer of the embedded
/// network gives nine of ten points of a cloud the same row.
pub(super) struct Groups {
    /// Members of all groups in turn, ascending within each.
    members: Vec<u32>,
    /// The members of group g are `starts[g]..starts[g + 1]`.
    starts: Vec<u32>,
    /// Group of each row.
    pub(super) of: Vec<u32>,
}

impl Groups {
    /// Groups in the order of their first members.
    pub(super) fn equal(rows: &Rows) -> Self {
        let mut known = FxHashMap::with_capacity_and_hasher(rows.count(), FxBuildHasher);
        let mut counts = Vec::with_capacity(rows.count());
        let group = |index: usize| {
            let row = rows.row(index);
            let new = counts.len() as u32;
            let (group, first) = *known.entry(fingerprint(row)).or_insert((new, index as u32));
            // Different rows with one fingerprint, should they ever occur, stay alone: that costs time only.
            let group = if rows.row(first as usize) == row { group } else { new };
            match counts.get_mut(group as usize) {
                Some(count) => *count += 1,
                None => counts.push(1u32),
            }
            group
        };
        let of: Vec<u32> = (0..rows.count()).map(group).collect();
        let mut starts = vec![0];
        counts.iter().for_each(|count| starts.push(starts.last().copied().unwrap_or(0) + count));
        let mut next = starts.clone();
        let mut members = vec![0; of.len()];
        for (row, &group) in of.iter().enumerate() {
            let place = &mut next[group as usize];
            members[*place as usize] = row as u32;
            *place += 1;
        }
        Self { members, starts, of }
    }

    pub(super) fn count(&self) -> usize {
        self.starts.len() - 1
    }

    pub(super) fn members(&self, group: u32) -> &[u32] {
        &self.members[self.starts[group as usize] as usize..self.starts[group as usize + 1] as usize]
    }

    /// One row of each group.
    pub(super) fn representatives(&self, rows: Rows) -> Rows {
        if self.count() == rows.count() {
            return rows;
        }
        let first = self.starts[..self.count()].iter().map(|&start| self.members[start as usize]);
        rows.select(first)
    }
}

fn fingerprint(row: &[f32]) -> u64 {
    let mut hasher = FxHasher::default();
    row.as_chunks::<2>()
        .0
        .iter()
        .for_each(|[a, b]| hasher.write_u64(u64::from(a.to_bits()) << 32 | u64::from(b.to_bits())));
    hasher.finish()
}

/// Queries and points about the middle of the points, without the columns that are the same in all of them, filled up
/// with zeros to whole vectors.
///
/// Distances from squares cancel where points are far from the origin, so it is moved.
pub(super) fn reduced(queries: &[f32], points: &[f32], width: usize) -> (Rows, Rows) {
    let count = (points.len() / width) as f32;
    let first: Vec<f32> = points.iter().chain(queries).take(width).copied().collect();
    let mut center = vec![0.0; width];
    let mut changes = vec![0; width];
    vectorized(
        #[inline(always)]
        || {
            for row in points.chunks_exact(width) {
                center.iter_mut().zip(row).for_each(|(c, x)| *c += *x / count);
            }
            for row in points.chunks_exact(width).chain(queries.chunks_exact(width)) {
                changes.iter_mut().zip(row.iter().zip(&first)).for_each(|(c, (x, f))| *c |= x.to_bits() ^ f.to_bits());
            }
        },
    );
    let columns: Vec<usize> = (0..width).filter(|&k| changes[k] != 0).collect();
    let padded = columns.len().max(1).next_multiple_of(LANES);
    let reduce = |rows: &[f32]| {
        let mut values = vec![0.0; rows.len() / width * padded];
        vectorized(
            #[inline(always)]
            || {
                for (row, out) in rows.chunks_exact(width).zip(values.chunks_exact_mut(padded)) {
                    if padded == width {
                        out.iter_mut().zip(row.iter().zip(&center)).for_each(|(y, (x, c))| *y = x - c);
                    } else {
                        out.iter_mut().zip(&columns).for_each(|(x, &k)| *x = row[k] - center[k]);
                    }
                }
            },
        );
        Rows { values, width: padded }
    };
    (reduce(queries), reduce(points))
}
