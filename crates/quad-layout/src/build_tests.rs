//! What every layout of a closed mesh has: patches of four sides, each arc shared by two, the mesh's Euler number, creases on arcs.

use crate::{BuildOptions, LayoutError, QuadLayout};

type Mesh = (Vec<[f64; 3]>, Vec<[u32; 3]>);

/// A grid of `n` × `m` points, closed in both directions, as a torus of radii 1 and `r`.
fn torus(n: u32, m: u32, r: f64) -> Mesh {
    let turn = |i: u32, n: u32| (std::f64::consts::TAU * f64::from(i) / f64::from(n)).sin_cos();
    let point = |k: u32| {
        let ((s, c), (t, d)) = (turn(k / m, n), turn(k % m, m));
        [(1.0 + r * d) * c, (1.0 + r * d) * s, r * t]
    };
    let at = |i: u32, j: u32| (i % n) * m + j % m;
    let quads = (0..n * m).map(|k| (k / m, k % m));
    let faces = quads.flat_map(|(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    ((0..n * m).map(point).collect(), faces.collect())
}

/// The faces of a cube of `n` × `n` squares each, under a map of space.
fn cube(n: i32, place: impl Fn([f64; 3]) -> [f64; 3]) -> Mesh {
    let mut known = std::collections::BTreeMap::new();
    let (mut points, mut faces) = (Vec::new(), Vec::new());
    for face in 0..6 {
        let mut at = |s: i32, t: i32| {
            let mut key = [0; 3];
            key[face % 3] = if face < 3 { n } else { -n };
            (key[(face + 1) % 3], key[(face + 2) % 3]) =
                if face < 3 { (2 * s - n, 2 * t - n) } else { (2 * t - n, 2 * s - n) };
            *known.entry(key).or_insert_with(|| {
                points.push(place(key.map(|x| f64::from(x) / f64::from(n))));
                points.len() as u32 - 1
            })
        };
        for (i, j) in (0..n * n).map(|k| (k / n, k % n)) {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    (points, faces)
}

fn round(p: [f64; 3]) -> [f64; 3] {
    let length = p.iter().map(|x| x * x).sum::<f64>().sqrt();
    p.map(|x| x / length)
}

fn checked((points, faces): &Mesh, euler: isize) -> QuadLayout {
    let layout = QuadLayout::of_mesh(points, faces, &BuildOptions::default()).unwrap();
    let topology = layout.topology();
    assert!(topology.is_closed() && topology.misoriented_arc().is_none());
    assert_eq!(topology.euler_number(), euler);
    let creases = layout.creases().unwrap();
    let mut is_smooth = vec![true; topology.n_vertices()];
    for (ends, _) in topology.arcs().iter().zip(creases).filter(|(_, sharp)| **sharp) {
        ends.iter().for_each(|&end| is_smooth[end as usize] = false);
    }
    let valences = topology.valences();
    assert!((0..valences.len()).all(|v| !is_smooth[v] || valences[v] > 2), "a smooth vertex has two patches");
    // Every patch is mapped one to one.
    assert!(layout.patches().iter().all(|patch| crate::injective::folded(patch) == 0));
    layout
}

#[test]
fn a_sphere_and_a_torus_are_cut_without_creases() {
    for (mesh, euler) in [(cube(8, round), 2), (torus(24, 12, 0.4), 0)] {
        let layout = checked(&mesh, euler);
        assert!(layout.creases().unwrap().iter().all(|sharp| !sharp));
    }
}

/// The edges of a box, all of them and nothing else, are creases.
#[test]
fn the_edges_of_a_box_lie_on_arcs() {
    let layout = checked(&cube(6, |p| [p[0], 0.8 * p[1], 0.6 * p[2]]), 2);
    let mut length = 0.0;
    for (arc, _) in layout.creases().unwrap().iter().enumerate().filter(|(_, sharp)| **sharp) {
        for pair in layout.path(arc).windows(2) {
            let [p, q] = [pair[0], pair[1]].map(|v| layout.vertices()[v as usize]);
            length += (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt();
        }
    }
    assert!((length - 8.0 * 2.4).abs() < 1e-9, "{length}");
}

#[test]
fn the_result_is_the_same_for_one_thread_and_two() {
    let mesh = cube(6, round);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| QuadLayout::of_mesh(&mesh.0, &mesh.1, &BuildOptions::default())).unwrap()
    };
    let (one, two) = (run(1), run(2));
    assert_eq!((one.vertices(), one.patches()), (two.vertices(), two.patches()));
}

#[test]
fn what_is_no_closed_surface_is_refused() {
    let (points, faces) = cube(2, |p| p);
    let of = |faces: &[[u32; 3]]| QuadLayout::of_mesh(&points, faces, &BuildOptions::default()).unwrap_err();
    assert_eq!(of(&faces[1..]), LayoutError::OpenMesh { edges: 3 });
    assert_eq!(of(&[]), LayoutError::NoMesh);
    let mut turned = faces.clone();
    turned[0].swap(0, 1);
    assert_eq!(of(&turned), LayoutError::MixedOrientation { edges: 3 });
    let two: Vec<[u32; 3]> = faces.iter().copied().chain(faces.iter().map(|t| t.map(|v| v + 26))).collect();
    let mut far = points.clone();
    far.extend(points.iter().map(|p| [p[0] + 5.0, p[1], p[2]]));
    let error = QuadLayout::of_mesh(&far, &two, &BuildOptions::default()).unwrap_err();
    assert_eq!(error, LayoutError::Pieces { pieces: 2 });
}
