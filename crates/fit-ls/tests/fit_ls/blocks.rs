//! Equations with coupled coordinates against the plain sums.

use fit_ls::{BlockEquations, Cholesky, SortedPoints};
use ndarray::Array2;
use thb_core::{
    CellSpace, HierarchicalSpace, Kind, KnotVector, Refinement, SplineMap, SymmetricMatrix, SymmetricPattern,
};

#[test]
fn block_equations_are_the_sums_over_the_points() {
    const N: usize = 3;
    let knots = KnotVector::uniform(2, 3).unwrap();
    let space = HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap();
    let space = space.refine(&[0], &Refinement { extension: [2; 2], ..Refinement::default() }).unwrap();
    let space = std::sync::Arc::new(space);
    let mut state = 1_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let m = 300;
    let parameters = Array2::from_shape_simple_fn((m, 2), &mut random);
    let mut points = SortedPoints::<2>::new(parameters.view(), Array2::zeros((m, N)).view(), None).unwrap();
    points.sort_refined(&space, None).unwrap();
    // Positive definite weights `I + v vᵀ`, and right-hand sides, in the order of the sorted points.
    let vectors: Vec<[f64; N]> = (0..m).map(|_| std::array::from_fn(|_| random() - 0.5)).collect();
    let weight = |i: usize, a: usize, b: usize| f64::from(u8::from(a == b)) + vectors[i][a] * vectors[i][b];
    let pairs: Vec<(usize, usize)> = (0..N).flat_map(|a| (a..N).map(move |b| (a, b))).collect();
    let weights: Vec<Vec<f64>> = pairs.iter().map(|&(a, b)| (0..m).map(|i| weight(i, a, b)).collect()).collect();
    let right: Vec<Vec<f64>> = (0..N).map(|_| (0..m).map(|_| random()).collect()).collect();
    let pattern = SymmetricPattern::new(space.as_ref());
    let equations = BlockEquations::new(space.as_ref(), &pattern, &points, &weights, &right).unwrap();

    // Values of all functions at all points, from maps that are one function each.
    let n = space.n_functions();
    let sorted = Array2::from_shape_fn((m, 2), |(i, d)| points.parameters(d)[i]);
    let identity = SplineMap::new(space.clone(), Array2::eye(n)).unwrap();
    let values = identity.eval_batch(sorted.view()).unwrap();
    let blocked = pattern.blocked(N);
    let matrix = SymmetricMatrix::from_blocks(&blocked, &equations.matrices, N).unwrap();
    for (column, ends) in blocked.columns().windows(2).enumerate() {
        for at in ends[0]..ends[1] {
            let row = blocked.rows()[at];
            let sum: f64 =
                (0..m).map(|i| values[[i, row / N]] * values[[i, column / N]] * weight(i, row % N, column % N)).sum();
            assert!((matrix.values()[at] - sum).abs() < 1e-12, "entry ({row}, {column})");
        }
    }
    for j in 0..n {
        for k in 0..N {
            let sum: f64 = (0..m).map(|i| values[[i, j]] * right[k][i]).sum();
            assert!((equations.right[[j, k]] - sum).abs() < 1e-12);
        }
    }
    // The factorization takes the blocked pattern as any other.
    let mut solver = Cholesky::new(&blocked).unwrap();
    solver.factorize(&matrix).unwrap();
    let flat = Array2::from_shape_fn((N * n, 1), |(i, _)| equations.right[[i / N, i % N]]);
    let solution = solver.solve(&flat).unwrap();
    let product = matrix.multiply(&solution.column(0).to_vec());
    assert!(product.iter().zip(&flat).all(|(a, b)| (a - b).abs() < 1e-9));
}

#[test]
fn moved_points_are_sorted_anew() {
    let knots = KnotVector::uniform(2, 4).unwrap();
    let space = HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap();
    let parameters = Array2::from_shape_fn((50, 2), |(i, d)| ((i * (3 + 4 * d)) % 50) as f64 / 49.0);
    let points = Array2::from_shape_fn((50, 1), |(i, _)| i as f64);
    let mut sorted = SortedPoints::<2>::new(parameters.view(), points.view(), None).unwrap();
    sorted.sort_refined(&space, None).unwrap();
    let moved: Vec<[f64; 2]> = (0..50).map(|at| sorted.parameter(at).map(|u| 1.0 - u)).collect();
    let cells: Vec<u32> = moved.iter().map(|&u| space.locate_cell(u).unwrap() as u32).collect();
    sorted.relocate(&moved, &cells).unwrap();
    for cell in 0..space.n_cells() {
        for at in sorted.offsets()[cell]..sorted.offsets()[cell + 1] {
            let index = sorted.order()[at] as usize;
            assert_eq!(space.locate_cell(sorted.parameter(at)).unwrap(), cell);
            assert_eq!(sorted.coordinates(0)[at], index as f64);
            assert_eq!(sorted.parameter(at), [1.0 - parameters[[index, 0]], 1.0 - parameters[[index, 1]]]);
        }
    }
    assert!(sorted.relocate(&moved, &cells[1..]).is_err());
    assert!(sorted.relocate(&moved, &[16; 50]).is_err());
}
