//! Triangles over the parameter square.

use anyhow::{Context, Result, ensure};
use spade::{DelaunayTriangulation, Point2, Triangulation};

/// The Delaunay triangles of parameters, counter-clockwise, in a fixed order.
pub(super) fn triangles(parameters: &[[f64; 2]]) -> Result<Vec<[usize; 3]>> {
    let places = parameters.iter().map(|&[u, v]| Point2::new(u, v)).collect();
    let mesh = DelaunayTriangulation::<Point2<f64>>::bulk_load_stable(places).context("cannot triangulate")?;
    ensure!(mesh.num_vertices() == parameters.len(), "two points have equal parameters");
    let mut triangles: Vec<[usize; 3]> = mesh
        .inner_faces()
        .map(|face| {
            let mut corners = face.vertices().map(|vertex| vertex.index());
            let smallest = (0..3).min_by_key(|&i| corners[i]).unwrap_or(0);
            corners.rotate_left(smallest);
            corners
        })
        .collect();
    triangles.sort_unstable();
    Ok(triangles)
}

#[cfg(test)]
mod tests {
    use super::super::surface::{Kind, Layout};
    use super::super::{Noise, Sample};
    use super::*;

    #[test]
    fn triangles_tile_the_square() {
        let sample =
            Sample { kind: Kind::Bonnet, layout: Layout::Scattered, points: 400, noise: Noise::Absolute(0.0), seed: 9 };
        let parameters = sample.cloud().unwrap().parameters;
        let triangles = triangles(&parameters).unwrap();
        // Euler: 2 m − 2 − b triangles for m points with b on the boundary.
        assert_eq!(triangles.len(), 2 * 400 - 2 - 4 * 19);
        let area: f64 = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| parameters[i]);
                let twice = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
                assert!(twice > 0.0, "{t:?} is not counter-clockwise");
                0.5 * twice
            })
            .sum();
        assert!((area - 1.0).abs() < 1e-12, "area {area}");
    }
}
