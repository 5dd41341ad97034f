//! Layouts of a cube and of a sphere in six patches: gluing, creases, places, and maps that fold.

use std::collections::BTreeMap;

use quad_layout::{LayoutError, QuadLayout, RawPatch};

/// Vertices along a side of a face, less one.
const N: u32 = 6;

/// A point of a face of the cube from −1 to 1; `u × v` points outward.
fn on_cube(face: usize, u: [f64; 2]) -> [f64; 3] {
    let (axis, sign) = (face % 3, if face < 3 { 1.0 } else { -1.0 });
    let [s, t] = u.map(|x| 2.0 * x - 1.0);
    let mut p = [0.0; 3];
    p[axis] = sign;
    (p[(axis + 1) % 3], p[(axis + 2) % 3]) = if face < 3 { (s, t) } else { (t, s) };
    p
}

fn cube() -> (Vec<[f64; 3]>, Vec<RawPatch>) {
    let (mut vertices, mut number) = (Vec::new(), BTreeMap::new());
    let mut patches = Vec::new();
    for face in 0..6 {
        let mut at = |i: u32, j: u32| {
            let p = on_cube(face, [i, j].map(|k| f64::from(k) / f64::from(N)));
            *number.entry(p.map(|x| (x * 1e6).round() as i64)).or_insert_with(|| {
                vertices.push(p);
                vertices.len() as u32 - 1
            })
        };
        let mut raw = RawPatch::default();
        for j in 0..=N {
            for i in 0..=N {
                raw.vertices.push(at(i, j));
                raw.uv.push([i, j].map(|k| f64::from(k) / f64::from(N)));
            }
        }
        for (i, j) in (0..N).flat_map(|j| (0..N).map(move |i| (i, j))) {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            raw.triangles.extend([[a, b, c], [a, c, d]]);
        }
        raw.corners = [at(0, 0), at(N, 0), at(N, N), at(0, N)];
        let along = 0..=N;
        raw.paths = [
            along.clone().map(|k| at(k, 0)).collect(),
            along.clone().map(|k| at(N, k)).collect(),
            along.clone().map(|k| at(N - k, N)).collect(),
            along.map(|k| at(0, N - k)).collect(),
        ];
        patches.push(raw);
    }
    (vertices, patches)
}

fn round(vertices: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
    let unit = |p: [f64; 3]| {
        let length = p.iter().map(|x| x * x).sum::<f64>().sqrt();
        p.map(|x| x / length)
    };
    vertices.into_iter().map(unit).collect()
}

fn folded(layout: &QuadLayout) -> usize {
    let of_patch = |patch: &quad_layout::LayoutPatch| {
        let area = |t: &[u32; 3]| {
            let [p, q, r] = t.map(|v| patch.uv[v as usize]);
            (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        };
        patch.triangles.iter().filter(|t| area(t) <= 0.0).count()
    };
    layout.patches().iter().map(of_patch).sum()
}

#[test]
fn paths_of_the_same_vertices_are_one_arc() {
    let (vertices, patches) = cube();
    let layout = QuadLayout::new(vertices, patches).unwrap();
    let topology = layout.topology();
    assert_eq!((topology.n_vertices(), topology.arcs().len(), topology.patches().len()), (8, 12, 6));
    assert!(topology.is_closed() && topology.misoriented_arc().is_none());
    assert_eq!(layout.mapped_anew(), [0; 0]);
    for arc in 0..12 {
        let on = topology.uses(arc)[0];
        let patch = &layout.patches()[on.patch as usize];
        for (k, vertex) in layout.path(arc).iter().enumerate() {
            let t = k as f64 / f64::from(N);
            let place = patch.vertices.iter().position(|v| v == vertex).unwrap();
            let expected = thb_core::side_point(on.side, if on.reversed { 1.0 - t } else { t });
            assert!((0..2).all(|d| (patch.uv[place][d] - expected[d]).abs() < 1e-12));
        }
    }
}

#[test]
fn a_cube_is_sharp_along_its_edges_and_a_sphere_is_not() {
    let (vertices, patches) = cube();
    let layout = QuadLayout::new(vertices.clone(), patches.clone()).unwrap();
    assert_eq!(layout.sharp_arcs(40.0), [true; 12]);
    assert_eq!(layout.sharp_arcs(100.0), [false; 12]);
    let sphere = QuadLayout::new(round(vertices), patches).unwrap();
    assert_eq!(sphere.sharp_arcs(40.0), [false; 12]);
}

#[test]
fn sizes_are_mean_lengths_of_opposite_sides() {
    let (vertices, patches) = cube();
    let layout = QuadLayout::new(vertices, patches).unwrap().moved(|p| [p[0], p[1], 0.25 * p[2]]);
    let expected = [[2.0, 0.5], [0.5, 2.0], [2.0, 2.0], [0.5, 2.0], [2.0, 0.5], [2.0, 2.0]];
    for (size, expected) in layout.sizes().into_iter().zip(expected) {
        assert!((0..2).all(|d| (size[d] - expected[d]).abs() < 1e-12), "{:?}", layout.sizes());
    }
}

#[test]
fn patches_that_fold_are_mapped_anew() {
    let (vertices, mut patches) = cube();
    // A vertex of patch 1 beyond its neighbours, and all of patch 3 on one line.
    let inner = patches[1].uv.iter().position(|u| (u[0] - 0.5).abs() < 1e-9 && (u[1] - 0.5).abs() < 1e-9).unwrap();
    patches[1].uv[inner] = [0.9, 0.9];
    patches[3].uv.iter_mut().for_each(|u| u[0] = u[1]);
    let layout = QuadLayout::new(round(vertices), patches).unwrap();
    assert_eq!(layout.mapped_anew(), [1, 3]);
    assert_eq!(folded(&layout), 0);
}

#[test]
fn what_is_no_layout_is_refused() {
    type Parts<'a> = (&'a mut Vec<[f64; 3]>, &'a mut Vec<RawPatch>);
    let refused = |change: &dyn Fn(Parts<'_>)| {
        let (mut vertices, mut patches) = cube();
        change((&mut vertices, &mut patches));
        QuadLayout::new(vertices, patches).unwrap_err()
    };
    let error = refused(&|(vertices, _)| vertices[4][1] = f64::INFINITY);
    assert_eq!(error, LayoutError::NotFinite { what: "vertex", index: 4 });
    let error = refused(&|(_, patches)| patches[2].uv[3][0] = f64::NAN);
    assert!(matches!(error, LayoutError::NotFinite { index: 2, .. }));
    let error = refused(&|(_, patches)| patches[2].triangles[0][1] = 9999);
    assert!(matches!(error, LayoutError::NoSuchVertex { patch: 2, vertex: 9999, .. }));
    let error = refused(&|(_, patches)| patches[5].corners.swap(0, 1));
    assert!(matches!(error, LayoutError::BrokenPath { patch: 5, side: 0, .. }));
    let error = refused(&|(_, patches)| {
        patches[0].vertices.pop();
        patches[0].uv.pop();
    });
    assert!(matches!(error, LayoutError::NoParameters { patch: 0, .. }));
    let error = refused(&|(_, patches)| {
        let first = patches[0].clone();
        patches.push(first);
    });
    assert!(matches!(error, LayoutError::Topology(thb_core::TopologyError::TooManyPatches { .. })));
    // A patch seen from inside.
    let error = refused(&|(_, patches)| {
        let patch = &mut patches[0];
        patch.corners = [0, 3, 2, 1].map(|k: usize| patch.corners[k]);
        patch.paths.reverse();
        patch.paths.iter_mut().for_each(|path| path.reverse());
        patch.triangles.iter_mut().for_each(|t| t.reverse());
        patch.uv.iter_mut().for_each(|u| u.swap(0, 1));
    });
    assert!(matches!(error, LayoutError::Misoriented { .. }));
    // Two triangles less: a patch with a notch is a disk still, but its paths are not its rim.
    let error = refused(&|(_, patches)| {
        patches[1].triangles.truncate(2);
        patches[1].uv[0] = [0.5, 0.5];
    });
    assert!(matches!(error, LayoutError::NotADisk { patch: 1, .. }));
}
