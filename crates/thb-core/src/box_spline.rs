//! Hierarchical box splines on the three-directional mesh.

use crate::bernstein::binomial;
use crate::{Cell, CellSpace, Error, Extraction, HierarchicalMesh, NodeId, ParameterBox};

/// Degree of the box spline.
const DEGREE: usize = 4;
/// Coefficients of a polynomial of degree 4 in each direction, and of total degree 4.
const TENSOR: usize = (DEGREE + 1) * (DEGREE + 1);
const TOTAL: usize = (DEGREE + 1) * (DEGREE + 2) / 2;
/// Squares that the support of a box spline reaches on each side of its centre.
const REACH: i64 = 2;

/// Hierarchical C² quartic box splines on a square grid with diagonals (Imperatore 2024, §3.1.6; Kang, Chen and Deng 2014).
///
/// The box spline has the directions (1,0), (0,1) and (1,1), each twice: it is twice continuously differentiable, of total
/// degree 4 on each triangle, and lives on a hexagon of 24 triangles. Its integer shifts are linearly independent and sum to
/// one. On level ℓ they are shifted by vertices of a grid of 2^ℓ times as many squares; of each level those are active whose
/// support, cut by the domain, lies in the squares of this or finer levels, but not of finer levels alone (Kraft's selection,
/// without truncation).
///
/// **Cells are triangles.** Two cells share the box of a square: the lower triangle, under the diagonal from the lower to the
/// upper corner, and the upper one. Extraction and Bézier matrices give the polynomials of a triangle, which hold there
/// only. So collocation, least squares and evaluation work as for all spaces, and what takes a cell for its whole box, as
/// [`crate::ThinPlate`] and [`crate::ClosestPoints`] do, does not.
#[derive(Clone, Debug)]
pub struct BoxSplineSpace {
    mesh: HierarchicalMesh<2>,
    lower: [f64; 2],
    upper: [f64; 2],
    leaves: Vec<NodeId>,
    /// For each node its place among the leaves.
    leaf_of_node: Vec<usize>,
    /// Per level the active vertices, increasing, and the number of the first.
    active: Vec<(usize, Vec<[i64; 2]>)>,
    n_functions: usize,
    triangles: Vec<Triangle>,
    identity: Vec<f64>,
}

#[derive(Clone, Debug)]
struct Triangle {
    functions: Vec<u32>,
    /// `(n_active, 25)`.
    extraction: Vec<f64>,
}

impl BoxSplineSpace {
    /// The box splines of one level that do not vanish on a box of `cells` squares per direction.
    ///
    /// # Errors
    /// [`Error::Elements`] for no squares or too many, [`Error::KnotOrder`] for an empty box or one that is not finite.
    pub fn new(cells: [usize; 2], lower: [f64; 2], upper: [f64; 2]) -> Result<Self, Error> {
        for d in 0..2 {
            if !(upper[d] > lower[d] && lower[d].is_finite() && upper[d].is_finite()) {
                return Err(Error::KnotOrder { index: 1, value: upper[d] });
            }
        }
        Ok(Self::on(HierarchicalMesh::new(cells)?, lower, upper))
    }

    /// The space with some squares split in four, and squares around them: `rings` of their own level on each side. A square
    /// is named by one of its cells.
    ///
    /// # Errors
    /// [`Error::Shape`] for a cell that does not exist, [`Error::TooManyLevels`].
    pub fn refine(&self, cells: &[usize], rings: usize) -> Result<Self, Error> {
        let mut mesh = self.mesh.clone();
        for &cell in cells {
            let (given, expected) = (cell, self.n_cells());
            let node = *self.leaves.get(cell / 2).ok_or(Error::Shape { what: "marked cell", given, expected })?;
            let (level, [i, j]) = (self.mesh.level(node), self.mesh.cell_index(node));
            let [nx, ny] = self.mesh.grid(level);
            let around = |k: u32, n: usize| (k as usize).saturating_sub(rings)..(k as usize + rings + 1).min(n);
            for y in around(j, ny) {
                for x in around(i, nx) {
                    mesh.split(level, [x as u32, y as u32])?;
                }
            }
        }
        Ok(Self::on(mesh, self.lower, self.upper))
    }

    /// Number of levels.
    pub fn n_levels(&self) -> usize {
        self.mesh.n_levels()
    }

    /// The mesh of squares.
    pub fn mesh(&self) -> &HierarchicalMesh<2> {
        &self.mesh
    }

    /// Active functions of each level.
    pub fn functions_per_level(&self) -> Vec<usize> {
        self.active.iter().map(|(_, vertices)| vertices.len()).collect()
    }

    fn on(mesh: HierarchicalMesh<2>, lower: [f64; 2], upper: [f64; 2]) -> Self {
        let leaves = mesh.leaves();
        let mut leaf_of_node = vec![usize::MAX; mesh.n_nodes()];
        leaves.iter().enumerate().for_each(|(leaf, node)| leaf_of_node[node.index()] = leaf);
        let mut active = Vec::new();
        let mut n_functions = 0;
        for level in 0..mesh.n_levels() {
            let vertices = active_vertices(&mesh, level);
            let first = n_functions;
            n_functions += vertices.len();
            active.push((first, vertices));
        }
        let identity = (0..TENSOR).map(|k| f64::from(u8::from(k % (DEGREE + 2) == 0))).collect();
        let maps = [false, true].map(to_tensor_bernstein);
        let mut triangles = Vec::with_capacity(2 * leaves.len());
        for &node in &leaves {
            for upper in [false, true] {
                triangles.push(triangle(&mesh, &active, node, upper, &maps[usize::from(upper)]));
            }
        }
        Self { mesh, lower, upper, leaves, leaf_of_node, active, n_functions, triangles, identity }
    }

    fn square(&self, leaf: usize) -> ([f64; 2], [f64; 2]) {
        let node = self.leaves[leaf];
        let (grid, index) = (self.mesh.grid(self.mesh.level(node)), self.mesh.cell_index(node));
        let place = |d: usize, k: u32| self.lower[d] + (self.upper[d] - self.lower[d]) * f64::from(k) / grid[d] as f64;
        ([0, 1].map(|d| place(d, index[d])), [0, 1].map(|d| place(d, index[d] + 1)))
    }
}

impl BoxSplineSpace {
    /// Lower and upper corner of the domain.
    pub fn domain(&self) -> ([f64; 2], [f64; 2]) {
        (self.lower, self.upper)
    }

    /// The cell that holds a parameter; cells are half-open, the last one in each direction closed.
    ///
    /// # Errors
    /// [`Error::OutsideDomain`], also for NaN.
    pub fn locate_cell(&self, u: [f64; 2]) -> Result<usize, Error> {
        let finest = self.mesh.n_levels() - 1;
        let grid = self.mesh.grid(finest);
        let mut index = [0; 2];
        for d in 0..2 {
            let (value, lower, upper) = (u[d], self.lower[d], self.upper[d]);
            if !(lower..=upper).contains(&value) {
                return Err(Error::OutsideDomain { value, direction: d, lower, upper });
            }
            index[d] = (((value - lower) / (upper - lower) * grid[d] as f64) as usize).min(grid[d] - 1) as u32;
        }
        let leaf = self.leaf_of_node[self.mesh.covering(finest, index).index()];
        let (lower, upper) = self.square(leaf);
        let [x, y] = [0, 1].map(|d| (u[d] - lower[d]) / (upper[d] - lower[d]));
        Ok(2 * leaf + usize::from(y > x))
    }
}

impl CellSpace<2> for BoxSplineSpace {
    fn n_functions(&self) -> usize {
        self.n_functions
    }

    fn degree(&self) -> [usize; 2] {
        [DEGREE; 2]
    }

    fn n_cells(&self) -> usize {
        self.triangles.len()
    }

    fn cell(&self, cell: usize) -> Cell<'_, 2> {
        let (lower, upper) = self.square(cell / 2);
        let Triangle { functions, extraction } = &self.triangles[cell];
        let extraction = Extraction::Matrix(extraction);
        Cell { lower, upper, functions, extraction, bezier: [&self.identity; 2], degree: [DEGREE; 2] }
    }
}

impl ParameterBox<2> for BoxSplineSpace {
    fn domain(&self) -> ([f64; 2], [f64; 2]) {
        self.domain()
    }

    fn locate_cell(&self, u: [f64; 2]) -> Result<usize, Error> {
        self.locate_cell(u)
    }
}

/// The box spline with support from (0, 0) to (4, 4), by differences of its truncated power
/// `∫ t (x − t)(y − t) dt` from 0 to the smaller of x and y.
fn box_spline(x: f64, y: f64) -> f64 {
    let truncated = |x: f64, y: f64| {
        let m = x.min(y).max(0.0);
        m * m * (0.5 * x * y - m * (x + y) / 3.0 + 0.25 * m * m)
    };
    const SECOND: [f64; 3] = [1.0, -2.0, 1.0];
    let mut sum = 0.0;
    for (a, first) in SECOND.iter().enumerate() {
        for (b, second) in SECOND.iter().enumerate() {
            for (c, third) in SECOND.iter().enumerate() {
                sum += first * second * third * truncated(x - (a + c) as f64, y - (b + c) as f64);
            }
        }
    }
    sum
}

/// Whether the squares at an offset from the centre of a box spline meet its support.
fn meets(c: i64, d: i64) -> bool {
    (-REACH..REACH).contains(&c) && (-REACH..REACH).contains(&d) && (c - d).abs() <= REACH
}

/// Squares of a level in the support of the box spline at a vertex, as far as they exist.
fn support(vertex: [i64; 2], grid: [usize; 2]) -> impl Iterator<Item = [u32; 2]> {
    let inside = move |k: i64, d: usize| (0..grid[d] as i64).contains(&k);
    (-REACH..REACH)
        .flat_map(|d| (-REACH..REACH).map(move |c| (c, d)))
        .filter(|&(c, d)| meets(c, d))
        .map(move |(c, d)| [vertex[0] + c, vertex[1] + d])
        .filter(move |&[x, y]| inside(x, 0) && inside(y, 1))
        .map(|[x, y]| [x as u32, y as u32])
}

/// Kraft's selection.
fn active_vertices(mesh: &HierarchicalMesh<2>, level: usize) -> Vec<[i64; 2]> {
    let grid = mesh.grid(level);
    let mut vertices = Vec::new();
    for j in 1 - REACH..grid[1] as i64 + REACH {
        for i in 1 - REACH..grid[0] as i64 + REACH {
            let (mut any, mut within, mut finer) = (false, true, true);
            for square in support([i, j], grid) {
                let node = mesh.find(level, square);
                any = true;
                within &= node.is_some();
                finer &= node.is_some_and(|node| !mesh.is_leaf(node));
            }
            if any && within && !finer {
                vertices.push([j, i]);
            }
        }
    }
    vertices
}

/// The functions of a triangle of a leaf square. `active` holds vertices as row and column, so that they are sorted.
fn triangle(
    mesh: &HierarchicalMesh<2>,
    active: &[(usize, Vec<[i64; 2]>)],
    node: NodeId,
    upper: bool,
    to_tensor: &[f64],
) -> Triangle {
    let (level, [column, row]) = (mesh.level(node), mesh.cell_index(node).map(i64::from));
    let (mut functions, mut extraction) = (Vec::new(), Vec::new());
    let (centre_x, centre_y) = if upper { (1.0 / 3.0, 2.0 / 3.0) } else { (2.0 / 3.0, 1.0 / 3.0) };
    for (k, (first, vertices)) in active.iter().enumerate().take(level + 1) {
        let shift = level - k;
        let scale = (1_u64 << shift) as f64;
        // From the unit square of the leaf to the coordinates of the box spline at a vertex.
        let place = |x: f64, y: f64, vertex: [i64; 2]| {
            let centred = |k: i64, t: f64, at: i64| (k as f64 + t) / scale - at as f64 + REACH as f64;
            (centred(column, x, vertex[1]), centred(row, y, vertex[0]))
        };
        for j in (row >> shift) + 1 - REACH..=(row >> shift) + REACH {
            for i in (column >> shift) + 1 - REACH..=(column >> shift) + REACH {
                let Ok(number) = vertices.binary_search(&[j, i]) else { continue };
                let (x, y) = place(centre_x, centre_y, [j, i]);
                if (x - y).abs() >= REACH as f64 {
                    continue;
                }
                functions.push((first + number) as u32);
                let values: Vec<f64> = lattice(upper)
                    .map(|[s, t]| {
                        let (x, y) = place(s, t, [j, i]);
                        box_spline(x, y)
                    })
                    .collect();
                extraction.extend(
                    to_tensor
                        .chunks_exact(TOTAL)
                        .map(|row| -> f64 { row.iter().zip(&values).map(|(a, b)| a * b).sum() }),
                );
            }
        }
    }
    Triangle { functions, extraction }
}

/// The points with coordinates in quarters of a triangle of the unit square.
fn lattice(upper: bool) -> impl Iterator<Item = [f64; 2]> {
    (0..=DEGREE).flat_map(move |a| {
        (0..=a).map(move |b| {
            let (long, short) = (a as f64 / DEGREE as f64, b as f64 / DEGREE as f64);
            if upper { [short, long] } else { [long, short] }
        })
    })
}

/// `(25, 15)`: from the values of a polynomial of total degree 4 at the lattice of a triangle to its coefficients in
/// Bernstein polynomials of the square, first direction fastest.
fn to_tensor_bernstein(upper: bool) -> Vec<f64> {
    let exponents: Vec<[usize; 2]> = (0..=DEGREE).flat_map(|a| (0..=DEGREE - a).map(move |b| [a, b])).collect();
    // Rows of values of all monomials, beside the unit matrix; elimination turns that into the inverse.
    let width = 2 * TOTAL;
    let mut matrix = vec![0.0; TOTAL * width];
    for (row, point) in lattice(upper).enumerate() {
        for (column, [a, b]) in exponents.iter().enumerate() {
            matrix[row * width + column] = point[0].powi(*a as i32) * point[1].powi(*b as i32);
        }
        matrix[row * width + TOTAL + row] = 1.0;
    }
    for column in 0..TOTAL {
        let size = |row: &usize| matrix[row * width + column].abs();
        let pivot = (column..TOTAL).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(column);
        (0..width).for_each(|k| matrix.swap(column * width + k, pivot * width + k));
        let value = matrix[column * width + column];
        (0..width).for_each(|k| matrix[column * width + k] /= value);
        for row in (0..TOTAL).filter(|&row| row != column) {
            let factor = matrix[row * width + column];
            (0..width).for_each(|k| matrix[row * width + k] -= factor * matrix[column * width + k]);
        }
    }
    // Coefficient i of x^a is C(i, a) / C(4, a).
    let power = |i: usize, a: usize| binomial(i, a) / binomial(DEGREE, a);
    let mut map = Vec::with_capacity(TENSOR * TOTAL);
    for k in 0..TENSOR {
        let (i, j) = (k % (DEGREE + 1), k / (DEGREE + 1));
        map.extend((0..TOTAL).map(|value| -> f64 {
            let of = |(monomial, [a, b]): (usize, &[usize; 2])| {
                let weight = if *a <= i && *b <= j { power(i, *a) * power(j, *b) } else { 0.0 };
                weight * matrix[monomial * width + TOTAL + value]
            };
            exponents.iter().enumerate().map(of).sum()
        }));
    }
    map
}
