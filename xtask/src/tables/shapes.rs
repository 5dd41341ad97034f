//! Sequences of points with corners, and abscissae that are denser at some places.

use std::f64::consts::PI;

use ndarray::Array2;

/// A sequence with its corners.
pub(super) struct Shape {
    pub(super) name: &'static str,
    /// `(m, 2)`.
    pub(super) points: Array2<f64>,
    /// Rows of the corners.
    pub(super) markers: Vec<usize>,
    /// Inner knots of its fit.
    pub(super) inner_knots: usize,
}

/// Four sequences in a box of about 1.
pub(super) fn with_corners() -> [Shape; 4] {
    let star: Vec<[f64; 2]> = (0..10)
        .map(|i| {
            let (angle, radius) = (PI * f64::from(i) / 5.0, if i % 2 == 0 { 0.5 } else { 0.22 });
            [0.5 + radius * angle.sin(), 0.5 + radius * angle.cos()]
        })
        .collect();
    let bracket = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.25], [0.3, 0.3], [0.25, 1.0], [0.0, 1.0]];
    // Two arcs that meet at a tip.
    let leaf = |t: f64| {
        let s = if t <= 0.5 { 2.0 * t } else { 2.0 - 2.0 * t };
        let height = if t <= 0.5 { 0.35 * (1.0 - 0.3 * s) } else { -0.25 };
        [s, height * (PI * s).sin()]
    };
    let arches = |t: f64| [t, 0.4 * (3.5 * PI * t).sin().abs()];
    [
        polygon("star", &star, 160, 50),
        polygon("bracket", &bracket, 150, 60),
        sampled("leaf", leaf, 120, vec![60], 20),
        sampled("arches", arches, 140, vec![40, 80, 120], 30),
    ]
}

fn sampled(
    name: &'static str,
    curve: impl Fn(f64) -> [f64; 2],
    steps: usize,
    markers: Vec<usize>,
    inner_knots: usize,
) -> Shape {
    let points = Array2::from_shape_fn((steps + 1, 2), |(i, k)| curve(i as f64 / steps as f64)[k]);
    Shape { name, points, markers, inner_knots }
}

/// A closed polygon, about equally spaced; its first vertex, where the sequence starts and ends, is no marker.
fn polygon(name: &'static str, vertices: &[[f64; 2]], steps: usize, inner_knots: usize) -> Shape {
    let next = |i: usize| vertices[(i + 1) % vertices.len()];
    let length = |i: usize| (next(i)[0] - vertices[i][0]).hypot(next(i)[1] - vertices[i][1]);
    let total: f64 = (0..vertices.len()).map(length).sum();
    let (mut rows, mut markers): (Vec<[f64; 2]>, Vec<usize>) = (Vec::new(), Vec::new());
    for (i, &[x, y]) in vertices.iter().enumerate() {
        let count = (steps as f64 * length(i) / total).round().max(2.0) as usize;
        if i > 0 {
            markers.push(rows.len());
        }
        rows.extend((0..count).map(|j| {
            let t = j as f64 / count as f64;
            [x + t * (next(i)[0] - x), y + t * (next(i)[1] - y)]
        }));
    }
    rows.push(vertices[0]);
    let points = Array2::from_shape_fn((rows.len(), 2), |(i, k)| rows[i][k]);
    Shape { name, points, markers, inner_knots }
}

/// Steps of the integral of a density.
const STEPS: usize = 20_000;

/// Sites in [0, 1], a share of them gathered about some places with exponential tails of a width; each place is a site.
pub(super) fn denser_at(count: usize, places: &[f64], width: f64, share: f64) -> Vec<f64> {
    let density = |x: f64| {
        let bump = |c: &f64| (-(x - c).abs() / width).exp() / (2.0 * width);
        1.0 - share + share * places.iter().map(bump).sum::<f64>() / places.len() as f64
    };
    let grid = |k: usize| k as f64 / STEPS as f64;
    let mut integral = vec![0.0];
    for k in 1..=STEPS {
        integral.push(integral[k - 1] + 0.5 * (density(grid(k - 1)) + density(grid(k))));
    }
    let mut sites: Vec<f64> = (0..count)
        .map(|i| {
            let wanted = integral[STEPS] * i as f64 / (count - 1) as f64;
            let after = integral.partition_point(|&s| s < wanted).clamp(1, STEPS);
            let (low, high) = (integral[after - 1], integral[after]);
            grid(after - 1) + (wanted - low) / (high - low) / STEPS as f64
        })
        .collect();
    for &place in places {
        let distance = |i: &usize| (sites[*i] - place).abs();
        if let Some(nearest) = (1..count - 1).min_by(|a, b| distance(a).total_cmp(&distance(b))) {
            sites[nearest] = place;
        }
    }
    sites
}
