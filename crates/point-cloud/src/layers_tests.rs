//! Tests of the search for two layers, on layers that were planted and on surfaces of one.

use super::*;

/// Random numbers of a fixed seed.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 += 1;
        (hash(self.0) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// By Box and Muller.
    fn normal(&mut self) -> f64 {
        let (r, angle) = ((-2.0 * (1.0 - self.unit()).ln()).sqrt(), std::f64::consts::TAU * self.unit());
        r * angle.cos()
    }
}

/// A surface over [0, 1]² and its unit normal.
type Surface = fn(f64, f64) -> ([f64; 3], [f64; 3]);

fn graph(x: f64, y: f64, height: impl Fn(f64, f64) -> f64) -> ([f64; 3], [f64; 3]) {
    let (e, sides) = (1e-5, [80.0, 60.0]);
    let slope = [
        (height(x + e, y) - height(x - e, y)) / (2.0 * e * sides[0]),
        (height(x, y + e) - height(x, y - e)) / (2.0 * e * sides[1]),
    ];
    let normal = crate::vec3::unit([-slope[0], -slope[1], 1.0]);
    ([sides[0] * x, sides[1] * y, height(x, y)], normal)
}

const SURFACES: [Surface; 4] = [
    |x, y| graph(x, y, |x, y| 6.0 * (2.5 * x).sin() * (2.0 * y).cos()),
    |x, y| graph(x, y, |x, y| 8.0 * x * x - 5.0 * y * y),
    |x, y| graph(x, y, |x, y| 4.0 * (6.0 * x).sin() * (5.0 * y).cos()),
    // Half a cylinder of radius 25.
    |x, y| {
        let (s, c) = (std::f64::consts::PI * x).sin_cos();
        ([25.0 * c, 60.0 * y, 25.0 * s], [c, 0.0, s])
    },
];

/// Two scans of a surface, shifted by half of `distance` to either side, with noise σ; both have `overlap` of their union. Rows of the
/// first come first.
fn two_scans(surface: Surface, m: usize, distance: f64, sigma: f64, overlap: f64, seed: u64) -> Array2<f64> {
    let mut random = Random(seed << 32);
    let width = 0.5 * (1.0 + overlap);
    let mut points = Array2::zeros((m, 3));
    for (i, mut row) in points.rows_mut().into_iter().enumerate() {
        let first = i < m / 2;
        let x = width * random.unit() + if first { 0.0 } else { 1.0 - width };
        let (place, normal) = surface(x, random.unit());
        let offset = sigma * random.normal() + if first { -0.5 * distance } else { 0.5 * distance };
        (0..3).for_each(|k| row[k] = place[k] + offset * normal[k]);
    }
    points
}

/// Distances from the middle, by a search for the foot point in parameters.
fn off_middle(surface: Surface, point: [f64; 3]) -> f64 {
    let distance = |x: f64, y: f64| {
        let (place, normal) = surface(x, y);
        (norm_of(sub(point, place)), dot(sub(point, place), normal))
    };
    let (mut best, mut step) = ([0.5, 0.5], 0.25);
    while step > 1e-7 {
        let tries = (-2..=2).flat_map(|i| (-2..=2).map(move |j| [i, j]));
        let tries = tries.map(|[i, j]| [best[0] + step * f64::from(i), best[1] + step * f64::from(j)]);
        best = tries.min_by(|a, b| distance(a[0], a[1]).0.total_cmp(&distance(b[0], b[1]).0)).unwrap();
        step *= 0.6;
    }
    distance(best[0], best[1]).1
}

fn norm_of(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

#[test]
fn planted_layers_are_found_with_their_distance_and_the_points_go_to_the_middle() {
    let mut seed = 0;
    for surface in SURFACES {
        for (m, sigma) in [(1500, 0.1), (3000, 0.1), (4500, 0.05)] {
            for overlap in [0.3, 0.6, 1.0] {
                for separation in [4.0, 6.0, 12.0] {
                    seed += 1;
                    let distance = separation * sigma;
                    let points = two_scans(surface, m, distance, sigma, overlap, seed);
                    let case = format!("{m} points, σ {sigma}, overlap {overlap}, {separation} σ, seed {seed}");
                    let found = find_layers(points.view()).unwrap().unwrap_or_else(|| panic!("none found: {case}"));
                    assert!((found.distance / distance - 1.0).abs() < 0.15, "{} {case}", found.distance / distance);
                    let both = 2.0 * overlap / (1.0 + overlap);
                    assert!((found.share - both).abs() < 0.2, "share {} of {both}: {case}", found.share);
                    // A sample of the points moved is near the middle; those of single layers may stay.
                    let step = m / 37;
                    let moved = (0..m).step_by(step).filter(|&i| found.middle.row(i) != points.row(i));
                    let off: Vec<f64> =
                        moved.map(|i| off_middle(surface, std::array::from_fn(|k| found.middle[[i, k]]))).collect();
                    let square = (off.iter().map(|d| d * d).sum::<f64>() / off.len() as f64).sqrt();
                    assert!(off.len() > 8 && square < 1.3 * sigma + 0.2 * distance, "{square} {case}");
                }
            }
        }
    }
}

#[test]
fn a_single_layer_is_none() {
    let mut seed = 1000;
    let none = |points: Array2<f64>, what: &str| {
        assert_eq!(find_layers(points.view()).unwrap(), None, "{what}");
    };
    for surface in SURFACES {
        for m in [300, 1500, 6000] {
            for sigma in [0.0, 0.02, 0.1, 0.4] {
                seed += 1;
                none(two_scans(surface, m, 0.0, sigma, 1.0, seed), &format!("{m} points, σ {sigma}, seed {seed}"));
            }
        }
        // Rounded heights are two and more layers in every neighbourhood.
        for step in [0.02, 0.1, 0.5] {
            seed += 1;
            let mut points = two_scans(surface, 3000, 0.0, 0.1 * step, 1.0, seed);
            points.column_mut(2).mapv_inplace(|z| (z / step).round() * step);
            none(points, &format!("rounded to {step}"));
        }
    }
    // A plane rounded in a tilted frame, evenly distributed noise, and a share of points far off.
    for (sigma, outliers) in [(0.05, 0.1), (0.05, 0.3)] {
        let mut points = two_scans(SURFACES[0], 3000, 0.0, sigma, 1.0, 7);
        let mut random = Random(5);
        for mut row in points.rows_mut() {
            // As trees over terrain.
            if random.unit() < outliers {
                row[2] += 3.0 * random.unit();
            }
        }
        none(points, "trees");
        let mut points = two_scans(SURFACES[1], 3000, 0.0, 0.0, 1.0, 8);
        points.column_mut(2).mapv_inplace(|z| z + 0.4 * random.unit());
        none(points, "even noise");
        let mut random = Random(6 + (10.0 * outliers) as u64);
        let mut points = two_scans(SURFACES[2], 3000, 0.0, 0.0, 1.0, 11);
        points.column_mut(2).mapv_inplace(|z| z + 0.4 * random.unit());
        none(points, "even noise");
    }
}

/// A wing of which both sides are sampled; its thickness falls to `tip` at the trailing edge.
fn wing(m: usize, thickness: f64, tip: f64) -> Array2<f64> {
    let mut random = Random(77);
    Array2::from_shape_fn((m, 3), {
        let places: Vec<[f64; 3]> = (0..m)
            .map(|i| {
                let (x, y) = (random.unit(), random.unit());
                let half = 0.5 * tip + 0.5 * thickness * (x.sqrt() * (1.0 - x)) / 0.385;
                [40.0 * x, 60.0 * y, if i % 2 == 0 { half } else { -half }]
            })
            .collect();
        move |(i, k)| places[i][k]
    })
}

#[test]
fn walls_and_folded_sheets_are_none() {
    for (thickness, tip) in [(2.0, 0.02), (3.0, 0.0), (6.0, 0.1), (12.0, 0.5)] {
        assert_eq!(find_layers(wing(6000, thickness, tip).view()).unwrap(), None, "{thickness} {tip}");
    }
    for gap in [1.5, 2.0, 4.0] {
        let mut random = Random(3);
        let flat = std::f64::consts::FRAC_PI_2 * gap;
        let places: Vec<[f64; 3]> = (0..5000)
            .map(|_| {
                // Along a sheet that is bent back over itself.
                let (s, y) = (60.0 * random.unit() - 30.0, 40.0 * random.unit());
                match s {
                    s if s > 0.5 * flat => [s - 0.5 * flat, y, 0.5 * gap],
                    s if s < -0.5 * flat => [-s - 0.5 * flat, y, -0.5 * gap],
                    s => [-0.5 * gap * (2.0 * s / gap).cos(), y, 0.5 * gap * (2.0 * s / gap).sin()],
                }
            })
            .collect();
        let points = Array2::from_shape_fn((places.len(), 3), |(i, k)| places[i][k]);
        assert_eq!(find_layers(points.view()).unwrap(), None, "{gap}");
    }
}

#[test]
fn evidence_that_lacks_one_thing_is_not_clear() {
    let clear = Evidence { share: 0.4, valley: 0.3, separation: 4.2, spread: 0.1, spacings: 0.3, contrast: 0.4 };
    assert!(clear.is_clear());
    assert!(Evidence { separation: 4.6, spread: 0.5, contrast: 1.0, ..clear }.is_clear());
    for doubtful in [
        Evidence { share: 0.15, ..clear },
        Evidence { contrast: 1.0, ..clear },
        Evidence { valley: 0.7, ..clear },
        Evidence { separation: 3.7, ..clear },
        Evidence { separation: 4.0, spread: 0.5, ..clear },
        Evidence { separation: 9.0, spread: 1.5, ..clear },
        Evidence { spacings: 1.5, ..clear },
        Evidence { separation: f64::NAN, ..clear },
    ] {
        assert!(!doubtful.is_clear(), "{doubtful:?}");
    }
}

#[test]
fn large_clouds_and_large_coordinates_are_searched_through_a_part() {
    let sigma = 0.02;
    let points = two_scans(SURFACES[0], 30_000, 8.0 * sigma, sigma, 1.0, 9);
    let found = find_layers(points.view()).unwrap().unwrap();
    assert!((found.distance / (8.0 * sigma) - 1.0).abs() < 0.1 && found.share > 0.95, "{found:?}");
    let place = |points: &Array2<f64>, i: usize| std::array::from_fn(|k| points[[i, k]]);
    let off = |i: usize| off_middle(SURFACES[0], place(&found.middle, i)).abs();
    assert!((0..30_000).step_by(1501).all(|i| off(i) < 6.0 * sigma));
    let scaled = find_layers((&points * 1e60).view()).unwrap().unwrap();
    assert!((scaled.distance / found.distance / 1e60 - 1.0).abs() < 1e-6);
    assert!(matches!(find_layers(Array2::from_elem((500, 3), 1.0).view()), Err(CloudError::AllEqual { .. })));
    assert_eq!(find_layers(Array2::zeros((10, 3)).view()).unwrap(), None);
    let mut bad = points;
    bad[[7, 1]] = f64::NAN;
    assert!(find_layers(bad.view()).is_err());
}
