//! The frame of the boundary: a cloud turned by what its boundary parameters say.

/// Where the boundary spans the plane of its parameters by less than this, relative to its longer direction (a closed or
/// folded outline), the cloud is not turned: the frame would be made of noise.
const FLATTEST: f64 = 1e-3;

/// Turns points so that the least-squares affine map from boundary parameters to boundary points has its directions along
/// the first two axes, by the polar decomposition `J (Jᵀ J)^(−½)`. A network that reads points in this frame gives the
/// same parameters whatever the rotation of the cloud.
pub(crate) fn turned(points: &[[f64; 3]], boundary: &[[f64; 3]], uv: &[[f64; 2]]) -> Option<Vec<[f64; 3]>> {
    let axes = axes(boundary, uv)?;
    Some(points.iter().map(|p| axes.map(|axis| dot(axis, *p))).collect())
}

fn axes(boundary: &[[f64; 3]], uv: &[[f64; 2]]) -> Option<[[f64; 3]; 3]> {
    let count = boundary.len() as f64;
    let mean_uv: [f64; 2] = std::array::from_fn(|k| uv.iter().map(|u| u[k]).sum::<f64>() / count);
    let mean: [f64; 3] = std::array::from_fn(|k| boundary.iter().map(|p| p[k]).sum::<f64>() / count);
    let mut gram = [[0.0; 2]; 2];
    let mut mixed = [[0.0; 3]; 2];
    for (p, u) in boundary.iter().zip(uv) {
        for a in 0..2 {
            let du = u[a] - mean_uv[a];
            (0..2).for_each(|b| gram[a][b] += du * (u[b] - mean_uv[b]));
            (0..3).for_each(|k| mixed[a][k] += du * (p[k] - mean[k]));
        }
    }
    let slopes = solve_two(gram, mixed)?;
    let metric = [[dot(slopes[0], slopes[0]), dot(slopes[0], slopes[1])], [0.0, dot(slopes[1], slopes[1])]];
    let (trace, determinant) = (metric[0][0] + metric[1][1], metric[0][0] * metric[1][1] - metric[0][1].powi(2));
    // The larger eigenvalue is at most the trace and at least half of it.
    if !(determinant > (FLATTEST * trace).powi(2) && trace.is_finite()) {
        return None;
    }
    // √M = (M + √det I) / √(tr + 2 √det) for symmetric 2 × 2 matrices.
    let root = determinant.sqrt();
    let scale = (trace + 2.0 * root).sqrt();
    let square_root =
        [[(metric[0][0] + root) / scale, metric[0][1] / scale], [metric[0][1] / scale, (metric[1][1] + root) / scale]];
    let [first, second] = solve_two(square_root, slopes)?;
    let third = [
        first[1] * second[2] - first[2] * second[1],
        first[2] * second[0] - first[0] * second[2],
        first[0] * second[1] - first[1] * second[0],
    ];
    Some([first, second, third])
}

/// Solves a symmetric 2 × 2 system with three right-hand sides; `None` if it is singular.
fn solve_two(a: [[f64; 2]; 2], b: [[f64; 3]; 2]) -> Option<[[f64; 3]; 2]> {
    let determinant = a[0][0] * a[1][1] - a[0][1] * a[1][0];
    let row = |x: f64, y: f64| std::array::from_fn(|k| (x * b[0][k] + y * b[1][k]) / determinant);
    (determinant != 0.0).then(|| [row(a[1][1], -a[0][1]), row(-a[1][0], a[0][0])])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::{ControlPoints, ScatteredSpec, stream, uniform_rotation};

    #[test]
    fn the_frame_does_not_see_a_rotation() {
        let spec = ScatteredSpec { control_points: ControlPoints::Jittered, degree: 2, interior: 50, noise: 0.0 };
        let cloud = spec.sample(&mut stream(1, 1)).unwrap();
        let rotation = uniform_rotation(&mut stream(2, 0));
        let split = |points: &ndarray::Array2<f64>| {
            let all: Vec<[f64; 3]> = points.rows().into_iter().map(|p| [p[0], p[1], p[2]]).collect();
            let uv: Vec<[f64; 2]> = cloud.parameters.rows().into_iter().map(|u| [u[0], u[1]]).collect();
            turned(&all, &all[50..], &uv[50..]).unwrap()
        };
        let (first, second) = (split(&cloud.points), split(&cloud.points.dot(&rotation.t())));
        for (a, b) in first.iter().zip(&second) {
            assert!((0..3).all(|k| (a[k] - b[k]).abs() < 1e-12), "{a:?} {b:?}");
        }
        // A rotation keeps distances.
        let original = cloud.points.row(3).to_owned() - cloud.points.row(7);
        let length: f64 = (0..3).map(|k| (first[3][k] - first[7][k]).powi(2)).sum();
        assert!((length - original.dot(&original)).abs() < 1e-12);
    }

    #[test]
    fn an_upright_rectangle_stays_as_it_is() {
        let corners = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let uv = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let turned = turned(&[[1.0, 2.0, 3.0]], &corners, &uv).unwrap();
        assert!((0..3).all(|k| (turned[0][k] - (k + 1) as f64).abs() < 1e-14), "{turned:?}");
    }

    #[test]
    fn outlines_without_area_have_no_frame() {
        let uv = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        // Folded along the diagonal: opposite sides coincide.
        let folded = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
        assert_eq!(turned(&folded, &folded, &uv), None);
        assert_eq!(turned(&folded, &[[1.0; 3]; 4], &uv), None);
    }
}
