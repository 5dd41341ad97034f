//! Planted surfaces, and triangles over them.

use std::collections::HashMap;
use std::sync::Arc;

use ndarray::Array2;
use point_cloud::TriangleTree;
use proptest::prelude::*;
use thb_core::{CellSpace, ClosestPoints, HierarchicalSpace, Kind, KnotVector, Refinement};

use super::*;
use crate::testing::Random;

/// A space with `elements` per direction, refined at random places some times.
fn random_space(
    degree: [usize; 2],
    elements: [usize; 2],
    periodic: [bool; 2],
    refinements: usize,
    random: &mut Random,
) -> Arc<HierarchicalSpace<2>> {
    let knots = std::array::from_fn(|d| match periodic[d] {
        true => KnotVector::uniform_periodic(degree[d], elements[d].max(degree[d] + 1)).unwrap(),
        false => KnotVector::uniform(degree[d], elements[d]).unwrap(),
    });
    let mut space = HierarchicalSpace::new(Kind::Thb, knots).unwrap();
    for _ in 0..refinements {
        let marked: Vec<usize> = (0..1 + space.n_cells() / 6).map(|_| random.below(space.n_cells())).collect();
        space = space.refine(&marked, &Refinement::default()).unwrap();
    }
    Arc::new(space)
}

/// A map with the Greville sites' directions disturbed: curved, and different in each cell.
fn random_map(space: Arc<HierarchicalSpace<2>>, random: &mut Random) -> SplineMap<2> {
    let n = space.n_functions();
    let coefficients = Array2::from_shape_fn((n, 3), |_| random.between(-1.0, 1.0));
    SplineMap::new(space, coefficients).unwrap()
}

fn area([a, b, c]: [[f64; 2]; 3]) -> f64 {
    0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
}

/// Every triangle is counter-clockwise, inside its cell, and the areas of a cell's triangles add up to its own; every edge
/// has a twin, but on the rim.
fn check(map: &SplineMap<2>, tessellation: &Tessellation) {
    let (lower, upper) = map.space().domain();
    let bezier = map.bezier();
    let mut areas = vec![0.0; bezier.n_cells()];
    let mut edges: HashMap<(u32, u32), usize> = HashMap::new();
    for (t, &triangle) in tessellation.triangles.iter().enumerate() {
        let corners = tessellation.corner_parameters(t);
        let cell = tessellation.cells[t] as usize;
        assert!(area(corners) > 0.0, "{corners:?}");
        areas[cell] += area(corners);
        let (low, high) = bezier.cell_box(cell);
        for u in corners {
            assert!((0..2).all(|d| u[d] >= low[d] - 1e-12 && u[d] <= high[d] + 1e-12), "{u:?} {low:?} {high:?}");
        }
        for k in 0..3 {
            *edges.entry((triangle[k], triangle[(k + 1) % 3])).or_default() += 1;
        }
    }
    for (cell, &area) in areas.iter().enumerate() {
        let (low, high) = bezier.cell_box(cell);
        let of_cell = (high[0] - low[0]) * (high[1] - low[1]);
        assert!((area - of_cell).abs() < 1e-12 * of_cell.max(1.0), "{area} {of_cell}");
    }
    for (&(a, b), &count) in &edges {
        assert_eq!(count, 1, "edge {a} {b} twice the same way round");
        if !edges.contains_key(&(b, a)) {
            let [p, q] = [a, b].map(|v| tessellation.parameters[v as usize]);
            let on_rim =
                (0..2).any(|d| !tessellation.periodic[d] && p[d] == q[d] && (p[d] == lower[d] || p[d] == upper[d]));
            assert!(on_rim, "the edge from {p:?} to {q:?} has no twin");
        }
    }
    let used: std::collections::HashSet<u32> = tessellation.triangles.iter().flatten().copied().collect();
    assert_eq!(used.len(), tessellation.vertices.len());
    for (point, &u) in tessellation.vertices.iter().zip(&tessellation.parameters) {
        let there = map.eval(u).unwrap();
        assert!((0..3).all(|k| (there[k] - point[k]).abs() < 1e-10), "{u:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn triangles_fill_the_domain_without_gaps_and_stay_within_the_chord_error(
        degree in prop::array::uniform2(1..5_usize), elements in prop::array::uniform2(1..5_usize),
        periodic in prop::array::uniform2(any::<bool>()), refinements in 0..4_usize, seed in any::<u64>(),
        chord in 0.02..0.5_f64,
    ) {
        let mut random = Random::new(seed);
        let map = random_map(random_space(degree, elements, periodic, refinements, &mut random), &mut random);
        let tessellation = Tessellation::new(&map, chord, 400_000).unwrap();
        check(&map, &tessellation);
        prop_assert!(tessellation.chord <= chord);
        // Distances both ways, from random places of the triangles and of the surface.
        let closest = ClosestPoints::new(map.bezier().clone()).unwrap();
        let corners: Vec<_> = (0..tessellation.triangles.len()).map(|t| tessellation.corners(t)).collect();
        let tree = TriangleTree::new(&corners);
        for _ in 0..300 {
            let t = random.below(corners.len());
            let mut weights: [f64; 3] = std::array::from_fn(|_| random.between(0.0, 1.0));
            let sum: f64 = weights.iter().sum();
            weights.iter_mut().for_each(|w| *w /= sum);
            let u = tessellation.parameters_at(t, weights);
            let flat: [f64; 3] = std::array::from_fn(|x| (0..3).map(|k| weights[k] * corners[t][k][x]).sum());
            let from_triangle = closest.closest_from(&flat, tessellation.cells[t] as usize, u).distance;
            let point = map.eval(u).unwrap();
            let from_surface = tree.nearest([point[0], point[1], point[2]]).squared_distance.sqrt();
            let chord = tessellation.chords[tessellation.cells[t] as usize];
            prop_assert!(from_triangle <= chord + 1e-12, "{from_triangle} {chord}");
            prop_assert!(from_surface <= tessellation.chord + 1e-12, "{from_surface} {}", tessellation.chord);
        }
    }

    #[test]
    fn a_small_budget_makes_coarser_triangles_as_far_as_the_cells_allow(
        degree in 2..4_usize, refinements in 0..4_usize, seed in any::<u64>(), budget in 200..2000_usize,
    ) {
        let mut random = Random::new(seed);
        let map = random_map(random_space([degree; 2], [4, 4], [false, true], refinements, &mut random), &mut random);
        let tessellation = Tessellation::new(&map, 1e-9, budget).unwrap();
        check(&map, &tessellation);
        let fewest = Tessellation::new(&map, 1e9, usize::MAX).unwrap();
        prop_assert!(tessellation.vertices.len() <= budget.max(fewest.vertices.len()));
        prop_assert!(tessellation.chord > 1e-9 && tessellation.chord <= fewest.chord);
        let again = Tessellation::new(&map, tessellation.chord, usize::MAX).unwrap();
        prop_assert_eq!(again.vertices, tessellation.vertices);
    }
}

#[test]
fn a_bilinear_patch_needs_two_triangles_and_a_bump_more_where_it_bends() {
    let knots = KnotVector::uniform(1, 1).unwrap();
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
    let flat = Array2::from_shape_fn((4, 3), |(i, k)| [(i % 2) as f64, (i / 2) as f64, 0.0][k]);
    let tessellation = Tessellation::new(&SplineMap::new(space, flat).unwrap(), 1e-9, 1000).unwrap();
    assert_eq!((tessellation.triangles.len(), tessellation.chord), (2, 0.0));

    // Eight elements per direction; the surface bends in one corner.
    let knots = KnotVector::uniform(2, 8).unwrap();
    let at = knots.greville();
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
    let height = |i: usize| if i == 11 { 0.4 } else { 0.0 };
    let bump = Array2::from_shape_fn((100, 3), |(i, k)| [at[i % 10], at[i / 10], height(i)][k]);
    let tessellation = Tessellation::new(&SplineMap::new(space, bump).unwrap(), 1e-3, 100_000).unwrap();
    let inside =
        |low: f64, high: f64| tessellation.parameters.iter().filter(|u| u.iter().all(|&x| x > low && x < high)).count();
    assert!(inside(0.0, 0.375) > 10 * inside(0.625, 1.0));
}

#[test]
fn what_cannot_be_divided_is_refused() {
    let knots = KnotVector::uniform(1, 1).unwrap();
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
    let plane = SplineMap::new(space.clone(), Array2::zeros((4, 2))).unwrap();
    assert_eq!(Tessellation::new(&plane, 1.0, 100).unwrap_err(), Error::Dimension { given: 2 });
    let sheet = SplineMap::new(space, Array2::zeros((4, 3))).unwrap();
    for chord in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(Tessellation::new(&sheet, chord, 100), Err(Error::Length { .. })));
    }
}
