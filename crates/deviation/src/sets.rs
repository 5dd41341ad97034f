//! Which things belong together.

/// Sets of triangles or vertices that belong together.
pub(crate) struct Sets {
    parent: Vec<u32>,
}

impl Sets {
    /// Everything on its own.
    pub(crate) fn new(n: usize) -> Self {
        Self { parent: (0..n as u32).collect() }
    }

    /// The representative of the set that holds an item. Paths are halved on the way.
    pub(crate) fn root(&mut self, mut of: u32) -> u32 {
        while self.parent[of as usize] != of {
            let above = self.parent[self.parent[of as usize] as usize];
            self.parent[of as usize] = above;
            of = above;
        }
        of
    }

    /// Joins the sets of two items.
    pub(crate) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        // The lower number represents the set, whatever the order of joining.
        self.parent[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_sets_have_one_representative() {
        let mut sets = Sets::new(6);
        for (a, b) in [(4, 5), (1, 4), (0, 2)] {
            sets.join(a, b);
        }
        assert_eq!([0, 1, 2, 3, 4, 5].map(|k| sets.root(k)), [0, 1, 0, 3, 1, 1]);
    }
}
