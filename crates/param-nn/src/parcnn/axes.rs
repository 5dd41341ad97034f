//! Axes that move with a grid: what a network reads in them does not depend on rotations and reflections.

use super::grid::{Grid, distance, dot, length};

/// Where the mean edge along a direction is shorter than this share of the mean length of the edges, the lines close up,
/// and the principal axes of the points take over.
const CLOSED: f64 = 0.05;

/// Sweeps of Jacobi's method; it converges quadratically, five do for 3 × 3.
const SWEEPS: usize = 8;

/// Orthonormal axes of a grid seen along a direction.
pub(crate) fn axes(grid: &Grid, direction: usize) -> [[f64; 3]; 3] {
    if grid.directions() == 2
        && let Some(axes) = surface_axes(grid, direction)
    {
        return axes;
    }
    let mut axes = principal_axes(grid);
    // Signs: later points lie on the positive side.
    for axis in &mut axes {
        let [lines, places] = grid.lines(direction);
        let mut sum = 0.0;
        for line in 0..lines {
            for place in 0..places {
                let weight = 2.0 * place as f64 - (places - 1) as f64;
                sum += weight * dot(*axis, grid.xyz[grid.index(direction, line, place)]);
            }
        }
        if sum < 0.0 {
            *axis = axis.map(|x| -x);
        }
    }
    axes
}

/// The mean edge along the direction, the mean edge across it, and the normal of both.
fn surface_axes(grid: &Grid, direction: usize) -> Option<[[f64; 3]; 3]> {
    let mean = |direction: usize| {
        let [lines, places] = grid.lines(direction);
        let (mut sum, mut sum_of_lengths) = ([0.0; 3], 0.0);
        for line in 0..lines {
            for place in 1..places {
                let [a, b] = [place - 1, place].map(|p| grid.xyz[grid.index(direction, line, p)]);
                (0..3).for_each(|k| sum[k] += b[k] - a[k]);
                sum_of_lengths += distance(a, b);
            }
        }
        (length(sum) > CLOSED * sum_of_lengths).then_some((sum, sum_of_lengths))
    };
    let (first, _) = mean(direction)?;
    let (second, size) = mean(1 - direction)?;
    let first = first.map(|x| x / length(first));
    let along = dot(first, second);
    let rest: [f64; 3] = std::array::from_fn(|k| second[k] - along * first[k]);
    let second = (length(rest) > CLOSED * size).then(|| rest.map(|x| x / length(rest)))?;
    Some([first, second, cross(first, second)])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Eigenvectors of the covariance of the points, the largest eigenvalue first; axes beyond the dimension last.
fn principal_axes(grid: &Grid) -> [[f64; 3]; 3] {
    let centre = grid.extent().0;
    let mut a = [[0.0; 3]; 3];
    for p in &grid.xyz {
        let q: [f64; 3] = std::array::from_fn(|k| p[k] - centre[k]);
        (0..3).for_each(|i| (0..3).for_each(|j| a[i][j] += q[i] * q[j]));
    }
    let mut axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..SWEEPS {
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            if a[i][j] == 0.0 {
                continue;
            }
            let theta = (a[j][j] - a[i][i]) / (2.0 * a[i][j]);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let cosine = 1.0 / (t * t + 1.0).sqrt();
            let sine = t * cosine;
            for k in 0..3 {
                (a[k][i], a[k][j]) = (cosine * a[k][i] - sine * a[k][j], sine * a[k][i] + cosine * a[k][j]);
            }
            for k in 0..3 {
                (a[i][k], a[j][k]) = (cosine * a[i][k] - sine * a[j][k], sine * a[i][k] + cosine * a[j][k]);
                (axes[i][k], axes[j][k]) =
                    (cosine * axes[i][k] - sine * axes[j][k], sine * axes[i][k] + cosine * axes[j][k]);
            }
        }
    }
    let mut order = [0, 1, 2];
    order[..grid.dimension].sort_by(|&i, &j| a[j][j].total_cmp(&a[i][i]));
    order.map(|i| axes[i])
}
