//! Vertices of glued parts, numbered anew.

use point_cloud::DisjointSets;

/// Which number a vertex of a part has in the whole that parts are glued to.
#[derive(Clone, Debug)]
pub(super) struct Numbers {
    /// Parts with their vertices, increasing.
    keys: Vec<(usize, u32)>,
    /// The number of each.
    number: Vec<u32>,
    /// How many there are.
    count: usize,
}

impl Numbers {
    /// Numbers vertices below `n` of faces, and the faces with these numbers. Parts are glued along seams between two of them; none if a
    /// seam has vertices that its parts have not.
    pub(super) fn new(
        n: usize,
        parts: &[&[[u32; 3]]],
        seams: &[([usize; 2], Vec<u32>)],
    ) -> Option<(Self, Vec<[u32; 3]>)> {
        let mut keys: Vec<(usize, u32)> = Vec::new();
        // The place of each vertex of the present part among the keys.
        let mut place = vec![u32::MAX; n];
        let mut faces: Vec<[u32; 3]> = Vec::with_capacity(parts.iter().map(|faces| faces.len()).sum());
        for (part, of_part) in parts.iter().enumerate() {
            let first = keys.len();
            for &vertex in of_part.iter().flatten() {
                if std::mem::replace(&mut place[vertex as usize], 0) == u32::MAX {
                    keys.push((part, vertex));
                }
            }
            keys[first..].sort_unstable();
            (first..keys.len()).for_each(|i| place[keys[i].1 as usize] = i as u32);
            faces.extend(of_part.iter().map(|face| face.map(|vertex| place[vertex as usize])));
            keys[first..].iter().for_each(|(_, vertex)| place[*vertex as usize] = u32::MAX);
        }
        let mut sets = DisjointSets::new(keys.len());
        for ([a, b], seam) in seams {
            for &vertex in seam {
                let [p, q] = [a, b].map(|part| keys.binary_search(&(*part, vertex)).ok());
                sets.join(p? as u32, q? as u32);
            }
        }
        let mut number = vec![0; keys.len()];
        let mut count = 0;
        for i in 0..keys.len() as u32 {
            // A set is known by the first of its members.
            let root = sets.root(i);
            number[i as usize] = if root == i { count } else { number[root as usize] };
            count += u32::from(root == i);
        }
        faces.iter_mut().for_each(|face| *face = face.map(|i| number[i as usize]));
        Some((Self { keys, number, count: count as usize }, faces))
    }

    /// The number of a vertex of a part.
    pub(super) fn of(&self, part: usize, vertex: u32) -> Option<u32> {
        self.keys.binary_search(&(part, vertex)).ok().map(|i| self.number[i])
    }

    /// The vertex that each number stands for, in the first of the parts that have it.
    pub(super) fn ids(&self) -> Vec<u32> {
        let mut ids = vec![u32::MAX; self.count];
        for (&(_, vertex), &number) in self.keys.iter().zip(&self.number).rev() {
            ids[number as usize] = vertex;
        }
        ids
    }
}
