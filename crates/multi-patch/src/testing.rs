//! What several tests need: a cube's faces on a sphere or an ellipsoid.

use std::sync::Arc;

use point_cloud::vec3::{cross, dot, unit};
use thb_core::{MultiPatchSpace, PatchPlace, PatchSide, PatchTopology};

use crate::{Error, Fitted, Options, Problem, Sample, fit};

/// The six faces of a cube, seen from outside, glued along its twelve edges: corners are numbered by the bits of their coordinates.
pub(crate) fn cube() -> Arc<PatchTopology> {
    let mut arcs: Vec<[u32; 2]> = Vec::new();
    let mut patches = Vec::new();
    for face in 0..6 {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|u| {
            let p = on_cube(face, u);
            (0..3).map(|k| if p[k] > 0.0 { 1 << k } else { 0 }).sum::<u32>()
        });
        patches.push(std::array::from_fn(|side| {
            let ends = [corners[side], corners[(side + 1) % 4]];
            let known = arcs.iter().position(|arc| *arc == ends || *arc == [ends[1], ends[0]]);
            let arc = known.unwrap_or_else(|| {
                arcs.push(ends);
                arcs.len() - 1
            });
            PatchSide { arc: arc as u32, reversed: arcs[arc] != ends }
        }));
    }
    Arc::new(PatchTopology::new(8, arcs, patches).unwrap())
}

/// A point of a face of the cube from −1 to 1: `u × v` points outward.
pub(crate) fn on_cube(face: usize, u: [f64; 2]) -> [f64; 3] {
    let (axis, sign) = (face % 3, if face < 3 { 1.0 } else { -1.0 });
    let [s, t] = u.map(|x| 2.0 * x - 1.0);
    let mut p = [0.0; 3];
    p[axis] = sign;
    (p[(axis + 1) % 3], p[(axis + 2) % 3]) = if face < 3 { (s, t) } else { (t, s) };
    p
}

/// `n` × `n` samples of each face on an ellipsoid with these half axes.
pub(crate) fn ellipsoid(n: usize, axes: [f64; 3]) -> Vec<Sample> {
    let mut samples = Vec::new();
    for face in 0..6 {
        for k in 0..n * n {
            let u = [k % n, k / n].map(|i| (i as f64 + 0.5) / n as f64);
            // Equal angles, so that samples are about as dense everywhere.
            let bent = u.map(|x| 0.5 + 0.5 * (std::f64::consts::FRAC_PI_4 * (2.0 * x - 1.0)).tan());
            let direction = unit(on_cube(face, bent));
            let point = [0, 1, 2].map(|k| axes[k] * direction[k]);
            let normal = unit([0, 1, 2].map(|k| direction[k] / axes[k]));
            let place = PatchPlace { patch: face as u32, u };
            samples.push(Sample { point, normal, weight: 1.0, place, arc: None });
        }
    }
    samples
}

/// A space on the cube.
pub(crate) fn space(degree: usize, elements: usize) -> Arc<MultiPatchSpace> {
    Arc::new(MultiPatchSpace::uniform(cube(), degree, elements).unwrap())
}

/// Fits samples on a cube's faces; the surface faces away from the origin.
pub(crate) fn fit_cube(
    space: &Arc<MultiPatchSpace>,
    sharp: &[bool],
    samples: Vec<Sample>,
    options: &Options,
) -> Result<Fitted, Error> {
    let problem = Problem { space, sharp, sizes: &[[1.0; 2]; 6], samples, outward: &|point, _| unit(point) };
    fit(problem, options)
}

/// Random numbers between −1 and 1, from a seed.
pub(crate) fn random(seed: u64, count: usize) -> Vec<f64> {
    let mut state = seed | 1;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1_u32 << 30) - 1.0
    };
    (0..count).map(|_| next()).collect()
}

#[test]
fn faces_of_the_cube_face_outward() {
    let topology = cube();
    assert_eq!((topology.euler_number(), topology.is_closed(), topology.misoriented_arc()), (2, true, None));
    for face in 0..6 {
        let [p, q, r] = [[0.5, 0.5], [0.6, 0.5], [0.5, 0.6]].map(|u| on_cube(face, u));
        let [a, b] = [q, r].map(|x| [0, 1, 2].map(|k| x[k] - p[k]));
        assert!(dot(cross(a, b), p) > 0.0);
    }
}
