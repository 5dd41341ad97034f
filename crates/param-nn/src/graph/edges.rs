//! Edges of a graph.

/// Edges from sources to targets, grouped by target.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Graph {
    /// The edges of target i are `starts[i]..starts[i + 1]`.
    pub(crate) starts: Vec<u32>,
    /// Source of each edge.
    pub(crate) sources: Vec<u32>,
}

impl Graph {
    pub(crate) fn targets(&self) -> usize {
        self.starts.len() - 1
    }

    pub(crate) fn edges(&self) -> usize {
        self.sources.len()
    }

    #[inline(always)]
    pub(crate) fn of(&self, target: usize) -> &[u32] {
        &self.sources[self.starts[target] as usize..self.starts[target + 1] as usize]
    }

    /// The same edges turned round: to each of `sources` points the targets that it is a source of.
    pub(crate) fn reversed(&self, sources: usize) -> Self {
        let mut starts = vec![0u32; sources + 1];
        self.sources.iter().for_each(|&s| starts[s as usize + 1] += 1);
        for s in 0..sources {
            starts[s + 1] += starts[s];
        }
        let mut next = starts.clone();
        let mut reversed = vec![0; self.edges()];
        for target in 0..self.targets() {
            for &source in self.of(target) {
                let place = &mut next[source as usize];
                reversed[*place as usize] = target as u32;
                *place += 1;
            }
        }
        Self { starts, sources: reversed }
    }
}
