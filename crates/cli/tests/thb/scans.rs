//! Small scans as texts and bytes.

/// Number of points per direction of the larger scans.
const SIDE: usize = 13;

/// A smooth surface over the unit square.
fn surface(x: f64, y: f64) -> [f64; 3] {
    [x, y, 0.2 * (3.0 * x + 0.5).sin() * (2.0 * y).cos()]
}

fn at(i: usize) -> f64 {
    i as f64 / (SIDE - 1) as f64
}

fn grid() -> impl Iterator<Item = (usize, usize)> {
    (0..SIDE).flat_map(|j| (0..SIDE).map(move |i| (i, j)))
}

/// Vertices and triangles of a regular mesh with `side` vertices per direction.
fn patch(side: usize) -> (Vec<[f64; 3]>, Vec<[usize; 3]>) {
    let at = |i: usize| i as f64 / (side - 1) as f64;
    let vertices = (0..side * side).map(|k| surface(at(k % side), at(k / side))).collect();
    let triangles = (0..(side - 1) * (side - 1))
        .flat_map(|k| {
            let a = k / (side - 1) * side + k % (side - 1);
            [[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]
        })
        .collect();
    (vertices, triangles)
}

fn off((vertices, triangles): (Vec<[f64; 3]>, Vec<[usize; 3]>)) -> String {
    let mut text = format!("OFF\n{} {} 0\n", vertices.len(), triangles.len());
    vertices.iter().for_each(|[x, y, z]| text += &format!("{x} {y} {z}\n"));
    triangles.iter().for_each(|[a, b, c]| text += &format!("3 {a} {b} {c}\n"));
    text
}

/// A mesh of a smooth surface.
pub(crate) fn mesh() -> String {
    off(patch(SIDE))
}

/// The same mesh, where each triangle has vertices of its own.
pub(crate) fn triangle_soup() -> String {
    let (vertices, triangles) = patch(SIDE);
    let own = triangles.iter().flatten().map(|&k| vertices[k]).collect();
    let count = triangles.len();
    off((own, (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect()))
}

/// A mesh that falls into two pieces.
pub(crate) fn two_pieces() -> String {
    let (mut vertices, mut triangles) = patch(4);
    let (further, same) = patch(3);
    triangles.extend(same.iter().map(|t| t.map(|k| k + vertices.len())));
    vertices.extend(further.iter().map(|[x, y, z]| [x + 5.0, *y, *z]));
    off((vertices, triangles))
}

/// A tetrahedron.
pub(crate) fn closed_mesh() -> String {
    let vertices = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    off((vertices, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]))
}

/// A binary PLY file with a mesh of four vertices, of which `vertices` are there.
pub(crate) fn binary_ply(vertices: usize) -> Vec<u8> {
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
        .to_vec();
    let corners = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    for corner in &corners[..vertices] {
        corner.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
    }
    if vertices == corners.len() {
        for face in [[0_i32, 1, 2], [0, 2, 3]] {
            bytes.push(3);
            face.iter().for_each(|k| bytes.extend(k.to_le_bytes()));
        }
    }
    bytes
}

/// A cloud with parameters, which are those of the surface times `scale`.
pub(crate) fn cloud(scale: f64) -> String {
    let mut text = String::from("x,y,z,u,v\n");
    for (i, j) in grid() {
        let [x, y, z] = surface(at(i), at(j));
        text += &format!("{x},{y},{z},{},{}\n", scale * at(i), scale * at(j));
    }
    text
}

/// A gridded cloud.
pub(crate) fn gridded() -> String {
    let mut text = String::from("i,j,x,y,z\n");
    for (i, j) in grid() {
        let [x, y, z] = surface(at(i), at(j));
        text += &format!("{i},{j},{x},{y},{z}\n");
    }
    text
}

/// A cloud with parameters from rows `x, y, z`.
pub(crate) fn cloud_of(points: &[[f64; 3]]) -> String {
    let mut text = String::from("x,y,z,u,v\n");
    for (k, [x, y, z]) in points.iter().enumerate() {
        let s = k as f64 / points.len() as f64;
        text += &format!("{x},{y},{z},{s},{}\n", (7.0 * s).fract());
    }
    text
}

/// Places in the unit square: the outline in steps of `1/side`, then `inside` evenly spread ones, all in shuffled order.
/// Also tells which are on the outline.
pub(crate) fn scattered(side: usize, inside: usize) -> Vec<([f64; 2], bool)> {
    let step = |i: usize| i as f64 / side as f64;
    let outline = (0..side).flat_map(|i| [[step(i), 0.0], [1.0, step(i)], [1.0 - step(i), 1.0], [0.0, 1.0 - step(i)]]);
    // A lattice by the golden ratio, a little away from the outline.
    let spread = |i: usize| [(i as f64 * 0.618_033_988_749_895).fract(), (i as f64 + 0.5) / inside as f64];
    let inner = (0..inside).map(spread).map(|p| p.map(|x| 0.02 + 0.96 * x));
    let all: Vec<_> = outline.map(|p| (p, true)).chain(inner.map(|p| (p, false))).collect();
    // A stride that has no factor in common with the number of points visits each once.
    let stride = (all.len() / 3..).find(|&s| (2..=s).all(|f| s % f != 0 || all.len() % f != 0)).unwrap();
    (0..all.len()).map(|i| all[i * stride % all.len()]).collect()
}

/// Rows `x y z` of points of the surface.
pub(crate) fn rows(places: &[([f64; 2], bool)]) -> String {
    places.iter().map(|([x, y], _)| surface(*x, *y).map(|c| c.to_string()).join(" ") + "\n").collect()
}
