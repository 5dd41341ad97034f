//! Tests of the maps of tubes.

use std::f64::consts::TAU;

use super::*;
use point_cloud::TriangleMesh;
use proptest::prelude::*;

/// Pseudo-random in [0, 1), from an index.
fn scatter(index: usize) -> f64 {
    (index as f64 * 0.618_033_988_749_895).fract()
}

/// `around` columns of `along + 1` vertices; `point` places the vertices, by angle share, height and number.
fn tube(
    around: usize,
    along: usize,
    keep: impl Fn(usize, usize) -> bool,
    point: impl Fn(f64, f64, usize) -> [f64; 3],
) -> DiskMesh {
    let at = |i: usize, j: usize| ((i % around) * (along + 1) + j) as u32;
    let mut triangles = Vec::new();
    for (i, j) in (0..around * along).map(|c| (c / along, c % along)).filter(|&(i, j)| keep(i, j)) {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        triangles.extend(if scatter(i * along + j) < 0.5 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
    }
    let n = around * (along + 1);
    let places: Vec<[f64; 3]> = (0..n)
        .map(|v| point((v / (along + 1)) as f64 / around as f64, (v % (along + 1)) as f64 / along as f64, v))
        .collect();
    let vertices = Array2::from_shape_fn((n, 3), |(v, k)| places[v][k]);
    DiskMesh::new(TriangleMesh { vertices, triangles }).unwrap()
}

fn map(disk: &DiskMesh, rounds: usize) -> TubeMap {
    let params = TubeMapParams { rounds, ..TubeMapParams::default() };
    map_tube(disk, &disk.tube_ends().unwrap(), &params).unwrap()
}

/// A difference of u, less whole turns.
fn turn(a: f64, b: f64) -> f64 {
    (a - b) - (a - b).round()
}

#[test]
fn a_prism_unrolls_to_a_plane() {
    // Flat inside, whatever the heights on its edges; mean-value weights see no more than that.
    let (around, along) = (11, 6);
    let height = |v: f64, number: usize| if v * (1.0 - v) > 0.0 { v + 0.08 * (scatter(number) - 0.5) } else { v };
    let disk = tube(
        around,
        along,
        |_, _| true,
        |u, v, number| {
            let angle = TAU * u;
            [angle.cos(), angle.sin(), 2.5 * height(v, number)]
        },
    );
    let map = map(&disk, 0);
    let flip = map.parameters[[0, 1]];
    for (number, uv) in map.parameters.outer_iter().enumerate() {
        let (u, v) = ((number / (along + 1)) as f64 / around as f64, (number % (along + 1)) as f64 / along as f64);
        let (u, v) = (if flip > 0.5 { -u } else { u }, (height(v, number) - flip).abs());
        assert!((uv[1] - v).abs() < 1e-12, "{uv} {v}");
        let shift = turn(map.parameters[[0, 0]], 0.0);
        assert!(turn(uv[0], u + shift).abs() < 1e-12, "{uv} {u}");
    }
    assert!(map.report.residual < 1e-12 && map.report.quality.folded.is_empty());
    // The seam is a straight line that ends near vertices of both ends.
    let off = map.seam.map(|v| turn(map.parameters[[v as usize, 0]], 0.0).abs());
    assert!(off.iter().all(|off| *off <= 0.5 / around as f64 + 1e-12), "{off:?}");
}

#[test]
fn a_thin_cone_is_stretched_less() {
    let disk = tube(
        40,
        60,
        |_, _| true,
        |u, v, _| {
            let (angle, radius) = (TAU * u, 1.0 - 0.95 * v);
            [radius * angle.cos(), radius * angle.sin(), 8.0 * v]
        },
    );
    // Means crowd the thin end.
    let even = map(&disk, 10);
    // A map without distortion has stretch 1.
    let [before, after] = even.report.stretch.map(|stretch| stretch - 1.0);
    assert!(even.report.rounds > 0 && after < 0.25 * before, "{:?}", even.report);
    assert!(even.report.quality.folded.is_empty());
}

#[test]
fn an_end_without_length_is_told() {
    let disk = tube(
        8,
        3,
        |_, _| true,
        |u, v, _| {
            let (angle, radius) = (TAU * u, if v == 1.0 { 0.0 } else { 1.0 });
            [radius * angle.cos(), radius * angle.sin(), v]
        },
    );
    let ends = disk.tube_ends().unwrap();
    let told = map_tube(&disk, &ends, &TubeMapParams { weights: Weights::Uniform, ..TubeMapParams::default() });
    assert!(matches!(told, Err(ParamError::NoLength { what: "an end of the tube", .. })), "{told:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Bent, bumpy and pierced tubes: never a fold, all parameters in place, v rises from the one end to the other.
    #[test]
    fn no_triangle_folds(
        around in 5usize..20,
        along in 3usize..12,
        bumps in 0.0..0.4,
        bend in 0.0..2.0,
        seed in 0usize..1000,
        hole in (0usize..20, 1usize..10),
        uniform: bool,
    ) {
        let hole = (hole.0 % around, 1 + hole.1 % along.saturating_sub(2).max(1));
        let disk = tube(
            around,
            along,
            |i, j| (i, j) != hole || along < 3,
            |u, v, number| {
                let angle = TAU * (u + 0.3 / around as f64 * (scatter(number + seed) - 0.5));
                let radius = 1.0 + bumps * (scatter(7 * number + seed) - 0.5) + 0.5 * v;
                let height = 4.0 * (v + 0.3 / along as f64 * (scatter(3 * number + seed) - 0.5));
                [radius * angle.cos() + bend * height.sin(), radius * angle.sin() - bend * height.cos(), height]
            },
        );
        let ends = disk.tube_ends().unwrap();
        let weights = if uniform { Weights::Uniform } else { Weights::MeanValue };
        let found = map_tube(&disk, &ends, &TubeMapParams { weights, ..TubeMapParams::default() }).unwrap();
        prop_assert_eq!(found.report.quality.folded.len() + found.report.quality.collapsed, 0);
        prop_assert_eq!(found.report.holes, ends.holes.len());
        prop_assert!(found.report.stretch[1] <= found.report.stretch[0]);
        prop_assert!(found.parameters.column(0).iter().all(|u| (0.0..1.0).contains(u)));
        for (side, rim) in ends.ends.into_iter().enumerate() {
            prop_assert!(rim.vertices.iter().all(|&v| found.parameters[[v as usize, 1]] == side as f64));
        }
    }
}
