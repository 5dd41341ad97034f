//! Points between points: a sparse cloud made dense enough for its graphs.

use super::cloud::{BOUNDARY_TOLERANCE, Cloud};

/// Nearest points among which the edges of a point are looked for: longer ones are as good as never empty, and searching all
/// pairs would take a hundred times as long.
const NEAREST: usize = 16;

/// The cloud with the midpoints of its Gabriel graph, the pairs of points whose ball of diameter `|p − q|` holds no
/// further point (Gabriel & Sokal 1969): about two more points for each. Midpoints lie off a surface by an eighth of its
/// curvature times the squared length only, and where nothing was. Between two boundary points on one side of the
/// square they are boundary points too, with the mean of the parameters.
///
/// Interior points come first, those of the cloud before the new ones; so do boundary points. A midpoint has the row of one
/// of its ends, and the mean of their parameters.
pub(crate) fn with_midpoints(cloud: &Cloud) -> Cloud {
    let mut inside: Vec<([f64; 3], [f64; 2], usize)> = Vec::new();
    let mut around = inside.clone();
    for (i, j) in gabriel_edges(&cloud.xyz) {
        let xyz = std::array::from_fn(|k| 0.5 * (cloud.xyz[i][k] + cloud.xyz[j][k]));
        let uv: [f64; 2] = std::array::from_fn(|k| 0.5 * (cloud.uv[i][k] + cloud.uv[j][k]));
        let midpoint = (xyz, uv, cloud.rows[i]);
        if i.min(j) < cloud.interior {
            inside.push(midpoint);
        } else if uv.iter().any(|x| x.min(1.0 - x) <= BOUNDARY_TOLERANCE) {
            around.push(midpoint);
        }
    }
    let mut dense = Cloud { interior: cloud.interior + inside.len(), ..Cloud::default() };
    let (interior, rest) = (0..cloud.interior, cloud.interior..cloud.xyz.len());
    for (own, midpoints) in [(interior, inside), (rest, around)] {
        dense.xyz.extend_from_slice(&cloud.xyz[own.clone()]);
        dense.uv.extend_from_slice(&cloud.uv[own.clone()]);
        dense.rows.extend_from_slice(&cloud.rows[own]);
        for (xyz, uv, row) in midpoints {
            dense.xyz.push(xyz);
            dense.uv.push(uv);
            dense.rows.push(row);
        }
    }
    dense
}

/// Edges `(i, j)`, `i < j`, of the Gabriel graph, in ascending order.
fn gabriel_edges(points: &[[f64; 3]]) -> Vec<(usize, usize)> {
    let squared = |p: &[f64; 3], q: &[f64; 3]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>();
    let mut edges = Vec::new();
    for (i, p) in points.iter().enumerate() {
        let mut near: Vec<(f64, usize)> =
            points.iter().map(|q| squared(p, q)).zip(0..).filter(|&(_, j)| j != i).collect();
        let order = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if near.len() > NEAREST {
            near.select_nth_unstable_by(NEAREST - 1, order);
            near.truncate(NEAREST);
        }
        near.sort_unstable_by(order);
        for (rank, &(distance, j)) in near.iter().enumerate() {
            let middle = std::array::from_fn(|k| 0.5 * (p[k] + points[j][k]));
            // A point in the ball is nearer to p than its other end.
            let empty = near[..rank].iter().all(|&(_, l)| squared(&points[l], &middle) >= 0.25 * distance);
            if empty && distance > 0.0 {
                edges.push((i.min(j), i.max(j)));
            }
        }
    }
    edges.sort_unstable();
    edges.dedup();
    edges
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::{ControlPoints, ScatteredSpec, stream};

    #[test]
    fn edges_are_those_whose_ball_is_empty() {
        let spec = ScatteredSpec { control_points: ControlPoints::Jittered, degree: 2, interior: 60, noise: 0.0 };
        let points = Cloud::of_sample(&spec.sample(&mut stream(8, 0)).unwrap()).xyz;
        let squared = |p: [f64; 3], q: [f64; 3]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>();
        let mut expected = Vec::new();
        for i in 0..points.len() {
            for j in i + 1..points.len() {
                let middle = std::array::from_fn(|k| 0.5 * (points[i][k] + points[j][k]));
                let radius = 0.25 * squared(points[i], points[j]);
                if (0..points.len()).all(|l| l == i || l == j || squared(points[l], middle) >= radius) {
                    expected.push((i, j));
                }
            }
        }
        let found = gabriel_edges(&points);
        assert!(found.iter().all(|edge| expected.contains(edge)));
        // Only edges longer than sixteen others from both ends are missed.
        assert!(found.len() * 50 >= expected.len() * 49, "{} of {}", found.len(), expected.len());
    }

    #[test]
    fn midpoints_lie_near_the_surface_and_points_keep_their_places() {
        let spec = ScatteredSpec { control_points: ControlPoints::Jittered, degree: 1, interior: 150, noise: 0.0 };
        let cloud = Cloud::of_sample(&spec.sample(&mut stream(8, 1)).unwrap());
        let dense = with_midpoints(&cloud);
        assert!(dense.xyz.len() > 2 * cloud.xyz.len(), "{} of {}", dense.xyz.len(), cloud.xyz.len());
        assert_eq!(dense.xyz[..cloud.interior], cloud.xyz[..cloud.interior]);
        let boundary = cloud.xyz.len() - cloud.interior;
        assert_eq!(dense.xyz[dense.interior..][..boundary], cloud.xyz[cloud.interior..]);
        assert!(dense.boundary_uv().iter().all(|uv| uv.iter().any(|&x| x == 0.0 || x == 1.0)));
        let fit = crate::bezier::BezierFit::solve(&dense.uv, &dense.xyz, 1);
        assert!(fit.mse < 1e-5, "{}", fit.mse);
    }

    #[test]
    fn equal_points_have_no_midpoint() {
        let cloud = Cloud { xyz: vec![[0.5; 3]; 40], uv: vec![[0.0; 2]; 40], interior: 40, rows: (0..40).collect() };
        assert_eq!(with_midpoints(&cloud).xyz, cloud.xyz);
    }
}
