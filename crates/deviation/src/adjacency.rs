//! Which triangles share an edge.

/// Stands for no triangle, beyond the rim.
pub(crate) const NONE: u32 = u32::MAX;

/// For each triangle the ones beyond its edges, the edge from corner `k` to the next at place `k`; [`NONE`] on the rim. Of
/// several triangles at an edge the first with the opposite direction.
pub(crate) fn neighbours(triangles: &[[u32; 3]], n_vertices: usize) -> Vec<[u32; 3]> {
    // Edges sorted by their first vertex.
    let mut begin = vec![0_u32; n_vertices + 1];
    for &v in triangles.iter().flatten() {
        begin[v as usize + 1] += 1;
    }
    for v in 0..n_vertices {
        begin[v + 1] += begin[v];
    }
    let mut place = begin.clone();
    let mut edges = vec![(0_u32, 0_u32); 3 * triangles.len()];
    for (t, corners) in triangles.iter().enumerate() {
        for k in 0..3 {
            let at = &mut place[corners[k] as usize];
            edges[*at as usize] = (corners[(k + 1) % 3], t as u32);
            *at += 1;
        }
    }
    let twin = |from: u32, to: u32| {
        let of_vertex = &edges[begin[from as usize] as usize..begin[from as usize + 1] as usize];
        of_vertex.iter().find(|edge| edge.0 == to).map_or(NONE, |edge| edge.1)
    };
    triangles.iter().map(|corners| std::array::from_fn(|k| twin(corners[(k + 1) % 3], corners[k]))).collect()
}

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
    fn neighbours_share_an_edge() {
        let triangles = [[0, 1, 2], [2, 1, 3], [3, 1, 4]];
        assert_eq!(neighbours(&triangles, 5), [[NONE, 1, NONE], [0, 2, NONE], [1, NONE, NONE]]);
    }

    #[test]
    fn joined_sets_have_one_representative() {
        let mut sets = Sets::new(6);
        for (a, b) in [(4, 5), (1, 4), (0, 2)] {
            sets.join(a, b);
        }
        assert_eq!([0, 1, 2, 3, 4, 5].map(|k| sets.root(k)), [0, 1, 0, 3, 1, 1]);
    }
}
