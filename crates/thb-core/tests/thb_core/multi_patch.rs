//! Patches that are glued: the theorems about the common space, over degrees, numbers of elements and random gluings.

use std::collections::BTreeMap;
use std::sync::Arc;

use ndarray::Array2;
use proptest::prelude::*;
use thb_core::{
    CellSpace, Error, Extraction, MultiPatchSpace, PatchPlace, PatchSide, PatchTopology, SplineMap, TopologyError,
    side_point,
};

/// Random numbers from a seed.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % n
    }

    fn unit(&mut self) -> f64 {
        self.below(1 << 20) as f64 / f64::from(1 << 20)
    }
}

/// Glues quads, given by the vertices at their corners, edge to edge: arcs in random directions; each patch starts at a random corner
/// and is turned over if `mirrors` and chance say so.
fn glue(quads: &[[u32; 4]], mirrors: bool, random: &mut Random) -> Result<PatchTopology, TopologyError> {
    let mut arcs: Vec<[u32; 2]> = Vec::new();
    let mut known: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    let mut patches = Vec::new();
    for quad in quads {
        let mut corners = *quad;
        corners.rotate_left(random.below(4));
        if mirrors && random.below(2) == 0 {
            corners.reverse();
        }
        patches.push(std::array::from_fn(|side| {
            let [start, end] = [corners[side], corners[(side + 1) % 4]];
            let arc = *known.entry([start.min(end), start.max(end)]).or_insert_with(|| {
                arcs.push(if random.below(2) == 0 { [start, end] } else { [end, start] });
                arcs.len() as u32 - 1
            });
            PatchSide { arc, reversed: arcs[arc as usize][0] != start }
        }));
    }
    let n_vertices = quads.iter().flatten().max().map_or(0, |&v| v as usize + 1);
    PatchTopology::new(n_vertices, arcs, patches)
}

/// The quads of a cube whose faces are cut into `n` × `n`: valences 3 and 4, Euler number 2.
fn cube(n: u32) -> Vec<[u32; 4]> {
    let mut number: BTreeMap<[u32; 3], u32> = BTreeMap::new();
    let mut quads = Vec::new();
    for axis in 0..3 {
        for end in [0, n] {
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let mut corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]].map(|[a, b]| {
                    let mut at = [end; 3];
                    (at[(axis + 1) % 3], at[(axis + 2) % 3]) = (a, b);
                    let next = number.len() as u32;
                    *number.entry(at).or_insert(next)
                });
                if end == 0 {
                    corners.reverse();
                }
                quads.push(corners);
            }
        }
    }
    quads
}

/// The quads of a torus of `m` × `n`, at least 3 each: Euler number 0.
fn torus(m: u32, n: u32) -> Vec<[u32; 4]> {
    let at = |i: u32, j: u32| (i % m) + m * (j % n);
    (0..n)
        .flat_map(|j| (0..m).map(move |i| (i, j)))
        .map(|(i, j)| [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)])
        .collect()
}

/// `k` quads around a vertex, in a ring.
fn star(k: u32) -> Vec<[u32; 4]> {
    (0..k).map(|i| [0, 1 + 2 * i, 2 + 2 * i, 1 + 2 * ((i + 1) % k)]).collect()
}

/// Grown from one quad, of the quads of a surface: an open part of it. Vertices are renumbered.
fn part(quads: &[[u32; 4]], keep: usize, random: &mut Random) -> Vec<[u32; 4]> {
    let mut kept = vec![quads[random.below(quads.len())]];
    while kept.len() < keep.min(quads.len()) {
        let next = quads[random.below(quads.len())];
        let shared = |a: &[u32; 4]| a.iter().filter(|v| next.contains(v)).count();
        if !kept.contains(&next) && kept.iter().any(|a| shared(a) == 2) {
            kept.push(next);
        }
    }
    let mut number: BTreeMap<u32, u32> = BTreeMap::new();
    for quad in &mut kept {
        for v in quad {
            let next = number.len() as u32;
            *v = *number.entry(*v).or_insert(next);
        }
    }
    kept
}

/// A random gluing: a closed surface, an open part of one, or a star of valence 3, 5 to 8.
fn random_topology(random: &mut Random) -> PatchTopology {
    loop {
        let whole = match random.below(3) {
            0 => cube(1 + random.below(2) as u32),
            1 => torus(3 + random.below(2) as u32, 3),
            _ => star([3, 5, 6, 8][random.below(4)]),
        };
        let quads = match random.below(2) {
            0 => whole,
            _ => part(&whole, 1 + random.below(whole.len()), random),
        };
        // Parts that pinch at a vertex are no surfaces.
        match glue(&quads, true, random) {
            Ok(topology) => return topology,
            Err(error) => assert!(matches!(error, TopologyError::NonManifoldVertex { .. }), "{error}"),
        }
    }
}

/// A space on it, with a number of elements for each strip.
fn random_space(degree: usize, random: &mut Random) -> MultiPatchSpace {
    let topology = Arc::new(random_topology(random));
    let strips = topology.strips();
    let per_strip: Vec<usize> = (0..strips.len()).map(|_| 1 + random.below(4)).collect();
    let elements = strips.iter().map(|&strip| per_strip[strip]).collect();
    MultiPatchSpace::new(topology, degree, elements).unwrap()
}

/// Values of all functions at a place.
fn values(space: &MultiPatchSpace, place: PatchPlace) -> Vec<f64> {
    let cell = space.cell(space.locate(place).unwrap());
    let (mut out, mut scratch, mut all) = (Vec::new(), Vec::new(), vec![0.0; space.n_functions()]);
    cell.derivatives(place.u, [0, 0], &mut out, &mut scratch);
    cell.functions.iter().zip(&out).for_each(|(&f, value)| all[f as usize] = *value);
    all
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Rank by elimination with pivots above 1e-9.
fn rank(mut rows: Vec<Vec<f64>>) -> usize {
    let mut rank = 0;
    for column in 0..rows[0].len() {
        let pivot = (rank..rows.len()).max_by(|&a, &b| rows[a][column].abs().total_cmp(&rows[b][column].abs()));
        let Some(pivot) = pivot.filter(|&pivot| rows[pivot][column].abs() > 1e-9) else { continue };
        rows.swap(rank, pivot);
        let (done, rest) = rows.split_at_mut(rank + 1);
        for row in rest {
            let factor = row[column] / done[rank][column];
            row.iter_mut().zip(&done[rank]).for_each(|(a, b)| *a -= factor * b);
        }
        rank += 1;
    }
    rank
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn functions_sum_to_one_and_are_counted(degree in 1_usize..5, seed: u64) {
        let random = &mut Random(seed | 1);
        let space = random_space(degree, random);
        space.check_invariants().unwrap();
        for patch in 0..space.n_patches() as u32 {
            let sum: f64 = values(&space, PatchPlace { patch, u: [random.unit(), random.unit()] }).iter().sum();
            prop_assert!((sum - 1.0).abs() < 6e-15, "{sum}");
        }
    }

    #[test]
    fn both_patches_of_an_arc_have_the_same_traces(degree in 1_usize..5, seed: u64) {
        let random = &mut Random(seed | 1);
        let space = random_space(degree, random);
        let topology = space.topology();
        let mut pairs = 0;
        for patch in 0..space.n_patches() {
            for side in 0..4 {
                let Some(over) = topology.across(patch, side) else { continue };
                pairs += 1;
                for t in [0.0, random.unit(), random.unit(), 1.0] {
                    let here = PatchPlace { patch: patch as u32, u: side_point(side as u8, t) };
                    let s = if over.opposite { 1.0 - t } else { t };
                    let there = PatchPlace { patch: over.patch, u: side_point(over.side, s) };
                    let off = difference(&values(&space, here), &values(&space, there));
                    prop_assert!(off < 3e-14, "{off}");
                }
            }
        }
        let inner = (0..topology.arcs().len()).filter(|&arc| topology.uses(arc).len() == 2).count();
        prop_assert_eq!(pairs, 2 * inner);
    }

    #[test]
    fn all_patches_at_a_vertex_have_its_function(degree in 1_usize..5, seed: u64) {
        let random = &mut Random(seed | 1);
        let space = random_space(degree, random);
        for patch in 0..space.n_patches() {
            for corner in 0..4 {
                let u = side_point(corner as u8, 0.0);
                let found = values(&space, PatchPlace { patch: patch as u32, u });
                let vertex = space.topology().corner(patch, corner) as usize;
                for (function, value) in found.into_iter().enumerate() {
                    prop_assert_eq!(value, f64::from(u8::from(function == vertex)));
                }
            }
        }
    }

    #[test]
    fn on_an_arc_functions_are_its_own_splines(degree in 1_usize..5, seed: u64) {
        let random = &mut Random(seed | 1);
        let space = random_space(degree, random);
        for arc in 0..space.topology().arcs().len() {
            let (functions, knots) = (space.arc_functions(arc), space.arc_knots(arc).unwrap());
            let t = random.unit();
            let (first, basis) = knots.basis(t).unwrap();
            let mut expected = vec![0.0; space.n_functions()];
            basis.iter().enumerate().for_each(|(k, b)| expected[functions[first + k] as usize] = *b);
            for on in space.topology().uses(arc) {
                let s = if on.reversed { 1.0 - t } else { t };
                let found = values(&space, PatchPlace { patch: on.patch, u: side_point(on.side, s) });
                prop_assert!(difference(&found, &expected) < 3e-14);
            }
        }
    }

    #[test]
    fn functions_are_independent(degree in 1_usize..4, seed: u64) {
        let random = &mut Random(seed | 1);
        let space = random_space(degree, random);
        let mut rows = Vec::new();
        for patch in 0..space.n_patches() {
            let own = space.patch(patch);
            let greville = [0, 1].map(|d| own.knots(0, d).unwrap().greville());
            for v in &greville[1] {
                rows.extend(greville[0].iter().map(|u| values(&space, PatchPlace { patch: patch as u32, u: [*u, *v] })));
            }
        }
        prop_assert_eq!(rank(rows), space.n_functions());
    }

    #[test]
    fn a_patch_of_a_map_is_a_map_of_its_own(degree in 1_usize..5, seed: u64) {
        let random = &mut Random(seed | 1);
        let space = Arc::new(random_space(degree, random));
        let coefficients = Array2::from_shape_simple_fn((space.n_functions(), 3), || random.unit());
        let map = SplineMap::new(Arc::clone(&space), coefficients).unwrap();
        for patch in 0..space.n_patches() {
            let u = [random.unit(), random.unit()];
            let alone = space.patch_map(patch, map.coefficients()).unwrap().eval(u).unwrap();
            let cell = space.locate(PatchPlace { patch: patch as u32, u }).unwrap();
            prop_assert_eq!(space.patch_of_cell(cell), patch);
            let together = map.bezier().jet(cell, u).value;
            prop_assert!(difference(&alone, &together) < 1e-14);
        }
    }
}

#[test]
fn closed_surfaces_have_their_numbers() {
    let random = &mut Random(7);
    for (quads, euler, closed) in [(cube(1), 2, true), (cube(3), 2, true), (torus(4, 3), 0, true), (star(5), 1, false)]
    {
        let topology = glue(&quads, false, random).unwrap();
        assert_eq!((topology.euler_number(), topology.is_closed()), (euler, closed));
        assert_eq!(topology.misoriented_arc(), None);
        let (v, e, f) = (topology.n_vertices(), topology.arcs().len(), quads.len());
        for (degree, n) in [(2, 1), (3, 4), (4, 2)] {
            let space = MultiPatchSpace::uniform(Arc::new(topology.clone()), degree, n).unwrap();
            let m = n + degree - 2;
            assert_eq!(space.n_functions(), v + e * m + f * m * m);
        }
    }
}

#[test]
fn patches_inside_need_no_matrix() {
    let topology = Arc::new(glue(&cube(1), false, &mut Random(1)).unwrap());
    let space = MultiPatchSpace::uniform(topology, 2, 6).unwrap();
    let plain = (0..space.n_cells()).filter(|&c| matches!(space.cell(c).extraction, Extraction::Identity)).count();
    assert!(plain >= 6 * 16, "{plain}");
}

#[test]
fn what_is_no_surface_is_refused() {
    let random = &mut Random(3);
    let error = |quads: &[[u32; 4]], random: &mut Random| glue(quads, false, random).unwrap_err();
    // Three quads at the arc from 0 to 1.
    let book = [[0, 1, 2, 3], [0, 1, 4, 5], [0, 1, 6, 7]];
    assert!(matches!(error(&book, random), TopologyError::TooManyPatches { uses: 3, .. }));
    // Two quads that touch at vertex 0 only.
    let touching = [[0, 1, 2, 3], [0, 4, 5, 6]];
    assert_eq!(error(&touching, random), TopologyError::NonManifoldVertex { vertex: 0, fans: 2 });
    // A corner met twice, as on a torus of one quad round.
    assert!(matches!(error(&[[0, 1, 0, 2]], random), TopologyError::MeetsItself { patch: 0, .. }));
    assert_eq!(PatchTopology::new(0, vec![], vec![]), Err(TopologyError::NoPatch));

    let side = |arc, reversed| PatchSide { arc, reversed };
    let square = vec![[0, 1], [1, 2], [2, 3], [3, 0]];
    let sides = [side(0, false), side(1, false), side(2, false), side(3, false)];
    assert!(PatchTopology::new(4, square.clone(), vec![sides]).is_ok());
    let turned = [side(0, false), side(1, true), side(2, false), side(3, false)];
    let open = PatchTopology::new(4, square.clone(), vec![turned]);
    assert_eq!(open, Err(TopologyError::OpenLoop { patch: 0, side: 0, end: 1, start: 2 }));
    let missing = PatchTopology::new(3, square.clone(), vec![sides]);
    assert_eq!(missing, Err(TopologyError::NoSuchVertex { arc: 2, vertex: 3, vertices: 3 }));
    let unused = PatchTopology::new(4, [square.clone(), vec![[0, 2]]].concat(), vec![sides]);
    assert_eq!(unused, Err(TopologyError::UnusedArc { arc: 4 }));
    let beyond = [side(0, false), side(1, false), side(2, false), side(9, false)];
    let beyond = PatchTopology::new(4, square.clone(), vec![beyond]);
    assert_eq!(beyond, Err(TopologyError::NoSuchArc { patch: 0, side: 3, arc: 9, arcs: 4 }));
    let alone = PatchTopology::new(5, square.clone(), vec![sides]);
    assert_eq!(alone, Err(TopologyError::NonManifoldVertex { vertex: 4, fans: 0 }));

    let topology = Arc::new(PatchTopology::new(4, square, vec![sides]).unwrap());
    let unequal = MultiPatchSpace::new(topology, 2, vec![2, 3, 4, 3]).unwrap_err();
    assert_eq!(unequal, Error::Topology(TopologyError::UnequalElements { patch: 0, first: 2, second: 4 }));
}
