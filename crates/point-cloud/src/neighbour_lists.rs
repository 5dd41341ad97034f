//! The neighbours of the points of a cloud.

/// A neighbour: its distance and its row.
pub type Neighbour = (f64, u32);

/// The order of neighbours: by distance and then by row.
pub(crate) fn order(a: &Neighbour, b: &Neighbour) -> std::cmp::Ordering {
    a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
}

/// The neighbours of each point of a cloud, itself left out, sorted by distance and then by index.
///
/// Stored row after row: the neighbours of point `i` are the entries `offsets[i]..offsets[i + 1]` of the other two.
#[derive(Clone, Debug, PartialEq)]
pub struct Neighbours {
    /// Where the row of each point begins, shape `(m + 1,)`.
    pub offsets: Vec<usize>,
    /// Rows of the neighbours.
    pub indices: Vec<u32>,
    /// Their distances, in the units of the points.
    pub distances: Vec<f64>,
}

impl Neighbours {
    /// The neighbours of point `i`, nearest first.
    pub fn of(&self, i: usize) -> &[u32] {
        &self.indices[self.offsets[i]..self.offsets[i + 1]]
    }

    /// The distances of the neighbours of point `i`, in the order of [`Neighbours::of`].
    pub fn distances_of(&self, i: usize) -> &[f64] {
        &self.distances[self.offsets[i]..self.offsets[i + 1]]
    }

    /// Number of points.
    pub fn count(&self) -> usize {
        self.offsets.len() - 1
    }

    /// The smallest symmetric graph that holds this one: `j` is a neighbour of `i` whenever `i` is one of `j`.
    pub fn symmetric(&self) -> Self {
        let mut lists: Vec<Vec<(f64, u32)>> = vec![Vec::new(); self.count()];
        for i in 0..self.count() {
            for (&j, &d) in self.of(i).iter().zip(self.distances_of(i)) {
                lists[i].push((d, j));
                lists[j as usize].push((d, i as u32));
            }
        }
        for list in &mut lists {
            list.sort_unstable_by(order);
            list.dedup_by_key(|entry| entry.1);
        }
        Self::from_lists(&lists)
    }

    pub(crate) fn from_lists(lists: &[Vec<(f64, u32)>]) -> Self {
        let mut offsets = Vec::with_capacity(lists.len() + 1);
        offsets.push(0);
        offsets.extend(lists.iter().scan(0, |end, list| {
            *end += list.len();
            Some(*end)
        }));
        let entries = || lists.iter().flatten();
        Self { offsets, indices: entries().map(|e| e.1).collect(), distances: entries().map(|e| e.0).collect() }
    }
}
