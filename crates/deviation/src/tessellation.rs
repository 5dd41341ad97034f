//! Triangles over a spline surface, as close to it as asked.

use std::cmp::Ordering;

use point_cloud::vec3::{cross, dot, norm, scale, sub};
use rustc_hash::FxHashMap;
use thb_core::{BezierMap, MAX_DEGREE, SplineMap, bernstein};

use crate::Error;

/// Most halvings of a cell per direction.
///
/// Limit: keeps the count of the finest lines within 64 bits (2¹⁶ elements of level 0, 15 levels, 12 halvings: 2⁴³).
const MAX_HALVINGS: u8 = 12;

/// Fewest segments once round a periodic direction.
///
/// Derived: from three segments on, two triangles have at most one edge in common, and the shortest way between two corners
/// of a triangle does not lead round the back.
const MIN_SEGMENTS_OF_PERIOD: f64 = 3.0;

/// Factor by which the chord error that is aimed at grows while there are too many vertices.
///
/// Derived: the count is inversely proportional to the chord error, so a step drops less than a third of the vertices.
const COARSER: f64 = std::f64::consts::SQRT_2;

/// Sine of the angle between tangents below which they are taken as parallel.
///
/// Limit: tangents are known up to some 10⁻¹⁵ of the coordinates.
pub(crate) const PARALLEL: f64 = 1e-9;

/// Share of the chord error by which halving one direction must gain more than halving the other, to be preferred though it is
/// the shorter one.
///
/// Derived: a halving of either direction halves the part of the twist, and round-off is less than this.
const SAME_GAIN: f64 = 1e-3;

/// Triangles over a spline surface. Neighbouring cells share their vertices, so the triangles have no gaps; in periodic
/// directions the last ones end at the first vertices.
///
/// Each cell is divided into `2^a × 2^b` equal parts, with `a` and `b` chosen so that its triangles are near enough; parts
/// along the cell's sides also take in the vertices that finer neighbours have there. Triangles of a cell are next to one
/// another in the list, and cells follow one another along a space-filling curve, so that runs of triangles are compact.
///
/// Where inner knots of multiplicity `degree + 1` break the surface apart, the triangles bridge the gap.
#[derive(Clone, Debug)]
pub struct Tessellation {
    /// Vertices in space.
    pub vertices: Vec<[f64; 3]>,
    /// Their parameters `(u, v)`. A vertex at the seam of a periodic direction has the lower end of the domain there;
    /// [`Tessellation::corner_parameters`] knows on which side of the seam a triangle lies.
    pub parameters: Vec<[f64; 2]>,
    /// Triangles, counter-clockwise in the parameter plane.
    pub triangles: Vec<[u32; 3]>,
    /// The cell of the space that each triangle lies in.
    pub cells: Vec<u32>,
    /// Estimate of the largest distance between the surface and the triangles of each cell of the space.
    pub chords: Vec<f64>,
    /// The largest of them.
    pub chord: f64,
    /// Lower and upper corner of the domain.
    pub domain: ([f64; 2], [f64; 2]),
    /// The directions in which both ends of the domain are one place, the seam.
    pub periodic: [bool; 2],
}

impl Tessellation {
    /// Divides a surface in space into triangles within the distance `chord` of it, as far as `max_vertices` allows; what was
    /// reached is in [`Tessellation::chord`]. Corners of cells are always vertices, however many.
    ///
    /// For a triangle in a part of size `h × k`, with `|S_uu| ≤ a`, `|S_uv| ≤ b` and `|S_vv| ≤ c` there, the distance between
    /// the surface and the triangle at the same parameters is at most `E = (a h² + 2 b h k + c k²) / 8`: Taylor's formula about
    /// the parameters, averaged over the corners with their barycentric weights λ, where `Σ λ (u − ū)² ≤ h²/4`. The bounds of
    /// the derivatives are those of their Bernstein coefficients. `E` also has the way along the surface that an uneven speed
    /// of the parameters makes; the distance from the nearest point has not. So where the normal `N` turns by τ across the part
    /// it is estimated by the smaller of `E` and `(|S_uu · N| h² + 2 |S_uv · N| h k + |S_vv · N| k²) / 8 + τ E`, the second
    /// fundamental form at samples. On the rim the surface has no point to either side: there the part of `S_uu` across the rim
    /// counts.
    ///
    /// # Errors
    /// [`Error::Dimension`]; [`Error::Length`] for a chord that is not positive and finite.
    pub fn new(map: &SplineMap<2>, chord: f64, max_vertices: usize) -> Result<Self, Error> {
        if map.dim() != 3 {
            return Err(Error::Dimension { given: map.dim() });
        }
        if !(chord > 0.0 && chord.is_finite()) {
            return Err(Error::Length { what: "the chord error", given: chord });
        }
        let degree = map.bezier().degree();
        let tables = [SAMPLES, SAMPLES_OF_FOLDS].map(|count| SampleTables::new(degree, count));
        let bends: Vec<Bend> = (0..map.bezier().n_cells()).map(|cell| Bend::of(map, cell, &tables)).collect();
        let mut target = chord;
        loop {
            let halvings: Vec<[u8; 2]> = bends.iter().map(|bend| bend.halvings(target)).collect();
            let parts: usize = halvings.iter().map(|[a, b]| 1 << (a + b)).sum();
            let coarsest = bends.iter().zip(&halvings).all(|(bend, &halvings)| halvings == bend.least);
            // There is about a vertex per part; more along the sides of the surface and of cells.
            if parts <= max_vertices || coarsest {
                let tessellation = Builder::new(map, &bends, &halvings).build();
                if tessellation.vertices.len() <= max_vertices || coarsest {
                    return Ok(tessellation);
                }
            }
            target *= COARSER;
        }
    }

    /// Corners of a triangle.
    pub fn corners(&self, triangle: usize) -> [[f64; 3]; 3] {
        self.triangles[triangle].map(|v| self.vertices[v as usize])
    }

    /// Parameters of the corners of a triangle, next to one another: beyond the upper end of the domain where the triangle
    /// ends at the seam.
    pub fn corner_parameters(&self, triangle: usize) -> [[f64; 2]; 3] {
        let mut corners = self.triangles[triangle].map(|v| self.parameters[v as usize]);
        for d in 0..2 {
            if !self.periodic[d] {
                continue;
            }
            let period = self.domain.1[d] - self.domain.0[d];
            let highest = corners.iter().map(|u| u[d]).fold(f64::NEG_INFINITY, f64::max);
            for u in &mut corners {
                if highest - u[d] > 0.5 * period {
                    u[d] += period;
                }
            }
        }
        corners
    }

    /// The parameters of a point of a triangle, in the domain.
    pub fn parameters_at(&self, triangle: usize, barycentric: [f64; 3]) -> [f64; 2] {
        let corners = self.corner_parameters(triangle);
        std::array::from_fn(|d| {
            let u: f64 = (0..3).map(|k| barycentric[k] * corners[k][d]).sum();
            let (lower, upper) = (self.domain.0[d], self.domain.1[d]);
            if self.periodic[d] && u >= upper { u - (upper - lower) } else { u.clamp(lower, upper) }
        })
    }

    /// Half the vector product of two sides: normal to the triangle, as long as its area, on the side of `S_u × S_v`.
    pub fn area_vector(&self, triangle: usize) -> [f64; 3] {
        let [p, q, r] = self.corners(triangle);
        scale(0.5, cross(sub(q, p), sub(r, p)))
    }
}

/// Samples per direction of the derivatives in a cell.
///
/// Derived: its ends and its middle, where the second derivatives of quadratic and cubic polynomials are largest.
const SAMPLES: usize = 3;

/// Samples per direction of a cell that may be folded.
///
/// Limit: folds narrower than an eighth of a cell may be passed over. Three samples passed over a fold of 8 · 10⁻⁵ of the area
/// of a plane bicubic sheet of 6 × 6 elements, whose distance from the triangles is none.
const SAMPLES_OF_FOLDS: usize = 9;

/// How a cell bends, in units of the cell: bounds of derivatives from Bernstein coefficients, and largest values at samples.
struct Bend {
    /// Bounds of `|S_uu| h²`, `|S_uv| h k` and `|S_vv| k²`.
    second: [f64; 3],
    /// The same of `S_uu · N`, `S_uv · N` and `S_vv · N` with the unit normal `N`, at the samples.
    normal: [f64; 3],
    /// By how much the unit normal changes across the cell per direction, at most 2.
    turn: [f64; 2],
    /// Part of `S_uu h²` across the rim on sides along the first direction, if they are on the rim; likewise of the second.
    rim: [f64; 2],
    /// Length in space per direction.
    length: [f64; 2],
    /// Fewest halvings per direction.
    least: [u8; 2],
}

impl Bend {
    fn of(map: &SplineMap<2>, cell: usize, [few, many]: &[SampleTables; 2]) -> Self {
        let bezier = map.bezier();
        let mut bend = Self { least: least_halvings(map, cell), ..Self::bounds(bezier, cell) };
        bend.sample(map, cell, if may_fold(bezier, cell) { many } else { few });
        bend
    }

    /// Takes in the derivatives at samples.
    fn sample(&mut self, map: &SplineMap<2>, cell: usize, tables: &SampleTables) {
        let bezier = map.bezier();
        let coefficients = bezier.cell_coefficients(cell);
        let order = bezier.degree().map(|p| p + 1);
        let rim = rim_sides(map, cell);
        let last = tables.count - 1;
        let mut normals = vec![None; tables.count * tables.count];
        for (place, kept) in normals.iter_mut().enumerate() {
            let at = [place % tables.count, place / tables.count];
            let derivative = |derivatives: [usize; 2]| {
                let row = |d: usize| &tables.rows[d][derivatives[d]][at[d] * order[d]..][..order[d]];
                combine(coefficients, row(0), row(1))
            };
            let tangents = [derivative([1, 0]), derivative([0, 1])];
            let second = [derivative([2, 0]), derivative([1, 1]), derivative([0, 2])];
            let area_vector = cross(tangents[0], tangents[1]);
            let area = norm(area_vector);
            if area > PARALLEL * (norm(tangents[0]) * norm(tangents[1])) {
                let normal = scale(area.recip(), area_vector);
                *kept = Some(normal);
                for k in 0..3 {
                    self.normal[k] = self.normal[k].max(dot(normal, second[k]).abs());
                }
            }
            for d in 0..2 {
                let [low, high] = rim[1 - d];
                if (low && at[1 - d] == 0) || (high && at[1 - d] == last) {
                    let (along, length) = (second[2 * d], norm(tangents[d]));
                    let part = if length > 0.0 { norm(cross(along, tangents[d])) / length } else { norm(along) };
                    self.rim[d] = self.rim[d].max(part);
                }
            }
        }
        self.turn = turn(&normals, tables.count);
    }

    /// Bounds from Bernstein coefficients.
    fn bounds(bezier: &BezierMap<2>, cell: usize) -> Self {
        let coefficients = bezier.cell_coefficients(cell);
        let [p, q] = bezier.degree();
        let at = |i: usize, j: usize| {
            let row = 3 * (j * (p + 1) + i);
            [coefficients[row], coefficients[row + 1], coefficients[row + 2]]
        };
        let mut squared = [0.0_f64; 3];
        let mut squared_length = [0.0_f64; 2];
        let largest = |bound: &mut f64, difference: [f64; 3]| *bound = bound.max(dot(difference, difference));
        let second = |a: [f64; 3], b: [f64; 3], c: [f64; 3]| std::array::from_fn(|k| a[k] - 2.0 * b[k] + c[k]);
        for j in 0..=q {
            for i in 0..=p {
                if i + 2 <= p {
                    largest(&mut squared[0], second(at(i, j), at(i + 1, j), at(i + 2, j)));
                }
                if i < p && j < q {
                    largest(&mut squared[1], sub(sub(at(i + 1, j + 1), at(i, j + 1)), sub(at(i + 1, j), at(i, j))));
                }
                if j + 2 <= q {
                    largest(&mut squared[2], second(at(i, j), at(i, j + 1), at(i, j + 2)));
                }
            }
        }
        for j in 0..=q {
            largest(&mut squared_length[0], sub(at(p, j), at(0, j)));
        }
        for i in 0..=p {
            largest(&mut squared_length[1], sub(at(i, q), at(i, 0)));
        }
        let factors = [p * p.saturating_sub(1), p * q, q * q.saturating_sub(1)];
        Self {
            second: std::array::from_fn(|k| factors[k] as f64 * squared[k].sqrt()),
            length: squared_length.map(f64::sqrt),
            normal: [0.0; 3],
            turn: [0.0; 2],
            rim: [0.0; 2],
            least: [0; 2],
        }
    }

    /// Estimate of the distance between the surface and triangles, [`Tessellation::new`].
    fn chord(&self, [a, b]: [u8; 2]) -> f64 {
        let [h, k] = [a, b].map(|n| 0.5_f64.powi(i32::from(n)));
        let taylor = |[uu, uv, vv]: [f64; 3]| 0.125 * (uu * h * h + 2.0 * uv * h * k + vv * k * k);
        let all = taylor(self.second);
        let turn = self.turn[0] * h + self.turn[1] * k;
        let rim = 0.125 * (self.rim[0] * h * h).max(self.rim[1] * k * k);
        all.min((taylor(self.normal) + turn * all).max(rim))
    }

    /// Halvings per direction for a chord error of at most `target`, as far as possible.
    fn halvings(&self, target: f64) -> [u8; 2] {
        let mut halvings = self.least;
        let mut chord = self.chord(halvings);
        while chord > target {
            let halved = [0, 1].map(|d| {
                let mut finer = halvings;
                finer[d] += 1;
                (finer, self.chord(finer))
            });
            let length = [0, 1].map(|d| self.length[d] * 0.5_f64.powi(i32::from(halvings[d])));
            // The direction that gains more; where both gain alike, the longer one.
            let gain = halved.map(|(_, finer)| chord - finer);
            let alike = (gain[0] - gain[1]).abs() < SAME_GAIN * chord;
            let first = if alike { length[0] >= length[1] } else { gain[0] >= gain[1] };
            let direction = match (first, halvings.map(|n| n < MAX_HALVINGS)) {
                (_, [false, false]) => break,
                (true, [true, _]) | (false, [true, false]) => 0,
                _ => 1,
            };
            (halvings, chord) = halved[direction];
        }
        halvings
    }
}

/// Fewest halvings of a cell: several segments once round a periodic direction.
fn least_halvings(map: &SplineMap<2>, cell: usize) -> [u8; 2] {
    let (space, (lower, upper)) = (map.space(), map.bezier().cell_box(cell));
    let (domain, periodic) = (space.domain(), space.periodic());
    std::array::from_fn(|d| {
        let segment = (domain.1[d] - domain.0[d]) / MIN_SEGMENTS_OF_PERIOD;
        let halvings = if periodic[d] { ((upper[d] - lower[d]) / segment).log2().ceil() } else { 0.0 };
        halvings.clamp(0.0, f64::from(MAX_HALVINGS)) as u8
    })
}

/// Whether the lower and the upper side of a cell across each direction lie on the rim.
fn rim_sides(map: &SplineMap<2>, cell: usize) -> [[bool; 2]; 2] {
    let (space, (lower, upper)) = (map.space(), map.bezier().cell_box(cell));
    let (domain, periodic) = (space.domain(), space.periodic());
    std::array::from_fn(|d| [lower[d] == domain.0[d], upper[d] == domain.1[d]].map(|at_end| at_end && !periodic[d]))
}

/// Whether the normals of a cell may span more than a right angle from that of its middle, as far as its Bernstein coefficients
/// tell: `S_u × S_v` is a mean of the vector products of legs of the control net in both directions.
fn may_fold(bezier: &BezierMap<2>, cell: usize) -> bool {
    let coefficients = bezier.cell_coefficients(cell);
    let columns = bezier.degree()[0] + 1;
    let points = coefficients.chunks_exact(3).map(|c| [c[0], c[1], c[2]]);
    let mut net = [[0.0; 3]; (MAX_DEGREE + 1) * (MAX_DEGREE + 1)];
    let mut count = 0;
    for (target, point) in net.iter_mut().zip(points) {
        *target = point;
        count += 1;
    }
    let net = &net[..count];
    let [first, last] = [net[0], net[count - 1]];
    let [second, third] = [net[columns - 1], net[count - columns]];
    let normal = cross(sub(last, first), sub(third, second));
    // Legs along v, turned so that their product with legs along u is that with the normal.
    let mut turned = [[0.0; 3]; (MAX_DEGREE + 1) * MAX_DEGREE];
    let mut n = 0;
    for (leg, pair) in turned.iter_mut().zip(net[columns..].iter().zip(net)) {
        *leg = cross(sub(*pair.0, *pair.1), normal);
        n += 1;
    }
    net.chunks_exact(columns)
        .flat_map(|line| line.windows(2))
        .any(|ends| turned[..n].iter().any(|leg| dot(sub(ends[1], ends[0]), *leg) <= 0.0))
}

/// The change of unit normals per direction, as if the largest one between neighbouring samples went on all across.
fn turn(normals: &[Option<[f64; 3]>], count: usize) -> [f64; 2] {
    let mut turn = [0.0_f64; 2];
    let between = |a: Option<[f64; 3]>, b: Option<[f64; 3]>| a.zip(b).map_or(2.0, |(a, b)| norm(sub(a, b)));
    for j in 0..count {
        for i in 0..count - 1 {
            turn[0] = turn[0].max(between(normals[j * count + i], normals[j * count + i + 1]));
            turn[1] = turn[1].max(between(normals[i * count + j], normals[(i + 1) * count + j]));
        }
    }
    turn.map(|t| t * (count - 1) as f64)
}

/// Derivatives of the Bernstein polynomials at equidistant samples of a cell, its ends among them.
struct SampleTables {
    /// Samples per direction.
    count: usize,
    /// Per direction and order of derivative, 0 to 2, `(count, degree + 1)`.
    rows: [Vec<Vec<f64>>; 2],
}

impl SampleTables {
    fn new(degree: [usize; 2], count: usize) -> Self {
        let table = |degree: usize, order: usize| {
            let mut out = vec![0.0; count * (degree + 1)];
            for (k, row) in out.chunks_exact_mut(degree + 1).enumerate() {
                bernstein::derivatives(degree, order, k as f64 / (count - 1) as f64, row);
            }
            out
        };
        Self { count, rows: degree.map(|degree| (0..=2).map(|order| table(degree, order)).collect()) }
    }
}

/// A place among the lines that would divide the whole domain as finely as its finest part.
type Place = [u64; 2];

/// Builds the vertices and triangles for given halvings of the cells.
struct Builder<'a> {
    map: &'a SplineMap<2>,
    bezier: &'a BezierMap<2>,
    halvings: &'a [[u8; 2]],
    /// Bernstein polynomials at the ends of `2^n` equal parts, `(2^n + 1, degree + 1)`, per direction and number of halvings.
    tables: [Vec<Vec<f64>>; 2],
    /// Lower corner and size of each cell among the finest lines.
    boxes: Vec<(Place, Place)>,
    /// Number of finest lines of the domain in periodic directions.
    modulus: [Option<u64>; 2],
    /// Vertices on the sides of cells.
    on_sides: FxHashMap<Place, u32>,
    result: Tessellation,
}

impl<'a> Builder<'a> {
    fn new(map: &'a SplineMap<2>, bends: &[Bend], halvings: &'a [[u8; 2]]) -> Self {
        let (space, bezier) = (map.space(), map.bezier().as_ref());
        let (mesh, periodic) = (space.mesh(), space.periodic());
        let level = |cell: usize| mesh.level(space.node(cell));
        let finest: [usize; 2] = std::array::from_fn(|d| {
            (0..halvings.len()).map(|c| level(c) + usize::from(halvings[c][d])).max().unwrap_or(0)
        });
        let boxes = (0..halvings.len()).map(|cell| {
            let shift = finest.map(|l| l - level(cell));
            let index = mesh.cell_index(space.node(cell));
            (std::array::from_fn(|d| u64::from(index[d]) << shift[d]), shift.map(|s| 1 << s))
        });
        let tables = std::array::from_fn(|d| {
            let most = halvings.iter().map(|h| h[d]).max().unwrap_or(0);
            (0..=most).map(|n| table(bezier.degree()[d], 1 << n)).collect()
        });
        let chords: Vec<f64> = bends.iter().zip(halvings).map(|(bend, &halvings)| bend.chord(halvings)).collect();
        let result = Tessellation {
            vertices: Vec::new(),
            parameters: Vec::new(),
            triangles: Vec::new(),
            cells: Vec::new(),
            chord: chords.iter().fold(0.0, |most, &chord| most.max(chord)),
            chords,
            domain: space.domain(),
            periodic,
        };
        Self {
            map,
            bezier,
            halvings,
            tables,
            boxes: boxes.collect(),
            modulus: std::array::from_fn(|d| periodic[d].then(|| (mesh.grid(0)[d] as u64) << finest[d])),
            on_sides: FxHashMap::default(),
            result,
        }
    }

    fn build(mut self) -> Tessellation {
        let mut order: Vec<u32> = (0..self.halvings.len() as u32).collect();
        order.sort_by(|&a, &b| along_curve(self.boxes[a as usize].0, self.boxes[b as usize].0));
        // Inner vertices of a cell are numbered in a row, from here on.
        let mut first_inner = vec![0; self.halvings.len()];
        for &cell in &order {
            first_inner[cell as usize] = self.add_vertices(cell as usize);
        }
        let mut numbers = Vec::new();
        for &cell in &order {
            self.add_triangles(cell as usize, first_inner[cell as usize], &mut numbers);
        }
        self.result
    }

    /// The place of a corner of the parts of a cell.
    fn place(&self, cell: usize, at: [usize; 2]) -> Place {
        let (lower, size) = self.boxes[cell];
        self.wrapped(std::array::from_fn(|d| lower[d] + at[d] as u64 * (size[d] >> self.halvings[cell][d])))
    }

    fn wrapped(&self, place: Place) -> Place {
        std::array::from_fn(|d| if self.modulus[d] == Some(place[d]) { 0 } else { place[d] })
    }

    /// Adds the vertices of a cell that are not there yet; returns the number of the first inner one.
    fn add_vertices(&mut self, cell: usize) -> u32 {
        let parts = self.halvings[cell].map(|n| 1_usize << n);
        let mut on_side = |at: [usize; 2]| {
            let place = self.place(cell, at);
            let next = self.result.vertices.len() as u32;
            if *self.on_sides.entry(place).or_insert(next) == next {
                self.add_vertex(cell, at);
            }
        };
        for i in 0..=parts[0] {
            on_side([i, 0]);
            on_side([i, parts[1]]);
        }
        for j in 1..parts[1] {
            on_side([0, j]);
            on_side([parts[0], j]);
        }
        let first = self.result.vertices.len() as u32;
        for j in 1..parts[1] {
            for i in 1..parts[0] {
                self.add_vertex(cell, [i, j]);
            }
        }
        first
    }

    fn add_vertex(&mut self, cell: usize, at: [usize; 2]) {
        let halvings = self.halvings[cell];
        let row = |d: usize| {
            let order = self.bezier.degree()[d] + 1;
            &self.tables[d][usize::from(halvings[d])][at[d] * order..][..order]
        };
        let point = combine(self.bezier.cell_coefficients(cell), row(0), row(1));
        let t = std::array::from_fn(|d| at[d] as f64 / (1_u32 << halvings[d]) as f64);
        self.push(cell, t, point);
    }

    fn push(&mut self, cell: usize, t: [f64; 2], point: [f64; 3]) {
        let (lower, upper) = self.bezier.cell_box(cell);
        let domain = self.map.space().domain();
        let parameters = std::array::from_fn(|d| {
            let u = if t[d] == 1.0 { upper[d] } else { lower[d] + t[d] * (upper[d] - lower[d]) };
            if self.modulus[d].is_some() && u == domain.1[d] { domain.0[d] } else { u }
        });
        self.result.vertices.push(point);
        self.result.parameters.push(parameters);
    }

    /// Adds the triangles of a cell. `numbers` is scratch.
    fn add_triangles(&mut self, cell: usize, first_inner: u32, numbers: &mut Vec<u32>) {
        let halvings = self.halvings[cell];
        let parts = halvings.map(|n| 1_usize << n);
        let columns = parts[0] + 1;
        numbers.clear();
        let mut inner = first_inner;
        for j in 0..=parts[1] {
            for i in 0..=parts[0] {
                if i == 0 || j == 0 || i == parts[0] || j == parts[1] {
                    // Every place on a side was given a vertex before.
                    numbers.push(self.on_sides.get(&self.place(cell, [i, j])).copied().unwrap_or_default());
                } else {
                    numbers.push(inner);
                    inner += 1;
                }
            }
        }
        let mut sides: [Vec<u32>; 4] = Default::default();
        for code in 0..parts[0] * parts[1] {
            let [i, j] = decoded(code, halvings);
            let number = |i: usize, j: usize| numbers[j * columns + i];
            let corners = [number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)];
            let at = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
            let outer = [j == 0, i + 1 == parts[0], j + 1 == parts[1], i == 0];
            for side in 0..4 {
                let (from, to) = ([side, (side + 1) % 4], &mut sides[side]);
                to.clear();
                to.push(corners[from[0]]);
                if outer[side] {
                    let (lower, size) = self.boxes[cell];
                    let place =
                        |k: usize| std::array::from_fn(|d| lower[d] + at[from[k]][d] as u64 * (size[d] >> halvings[d]));
                    self.between(place(0), place(1), to);
                }
                to.push(corners[from[1]]);
            }
            self.fill(cell, [i, j], &mut sides);
            self.result.cells.resize(self.result.triangles.len(), cell as u32);
        }
    }

    /// Appends the vertices that lie between two places of a side, in order. Sides are halved only, so where there is no
    /// vertex in the middle, there is none.
    fn between(&self, from: Place, to: Place, out: &mut Vec<u32>) {
        if from.iter().zip(&to).all(|(&a, &b)| a.abs_diff(b) < 2) {
            return;
        }
        let middle = std::array::from_fn(|d| u64::midpoint(from[d], to[d]));
        if let Some(&vertex) = self.on_sides.get(&self.wrapped(middle)) {
            self.between(from, middle, out);
            out.push(vertex);
            self.between(middle, to, out);
        }
    }

    /// Fills a part with triangles, given the vertices of its four sides counter-clockwise.
    fn fill(&mut self, cell: usize, at: [usize; 2], sides: &mut [Vec<u32>; 4]) {
        let straight = |side: usize| sides[side].len() == 2;
        if straight(1) && straight(3) {
            sides[2].reverse();
            self.strip(&sides[0], &sides[2]);
        } else if straight(0) && straight(2) {
            sides[3].reverse();
            self.strip(&sides[1], &sides[3]);
        } else {
            let halvings = self.halvings[cell];
            let t: [f64; 2] = std::array::from_fn(|d| (at[d] as f64 + 0.5) / (1_u32 << halvings[d]) as f64);
            let mut rows = [[0.0; MAX_DEGREE + 1]; 2];
            let degree = self.bezier.degree();
            for d in 0..2 {
                bernstein::values(degree[d], t[d], &mut rows[d]);
            }
            let coefficients = self.bezier.cell_coefficients(cell);
            let center = self.result.vertices.len() as u32;
            self.push(cell, t, combine(coefficients, &rows[0][..=degree[0]], &rows[1][..=degree[1]]));
            for edge in sides.iter().flat_map(|side| side.windows(2)) {
                self.result.triangles.push([edge[0], edge[1], center]);
            }
        }
    }

    /// Triangles between two opposite sides that run the same way, the first on the right; each time the shorter diagonal.
    fn strip(&mut self, right: &[u32], left: &[u32]) {
        let vertices = &self.result.vertices;
        let squared_distance = |a: u32, b: u32| {
            let way = sub(vertices[a as usize], vertices[b as usize]);
            dot(way, way)
        };
        let (mut i, mut j) = (0, 0);
        while i + 1 < right.len() || j + 1 < left.len() {
            let on_right = j + 1 == left.len()
                || (i + 1 < right.len()
                    && squared_distance(right[i + 1], left[j]) <= squared_distance(right[i], left[j + 1]));
            if on_right {
                self.result.triangles.push([right[i], right[i + 1], left[j]]);
                i += 1;
            } else {
                self.result.triangles.push([right[i], left[j + 1], left[j]]);
                j += 1;
            }
        }
    }
}

/// Bernstein polynomials at the ends of equal parts of the unit interval, `(parts + 1, degree + 1)`.
fn table(degree: usize, parts: usize) -> Vec<f64> {
    let mut out = vec![0.0; (parts + 1) * (degree + 1)];
    for (i, row) in out.chunks_exact_mut(degree + 1).enumerate() {
        bernstein::values(degree, i as f64 / parts as f64, row);
    }
    out
}

/// The point of a cell from its Bernstein coefficients and the values of the polynomials per direction.
pub(crate) fn combine(coefficients: &[f64], at_u: &[f64], at_v: &[f64]) -> [f64; 3] {
    let mut point = [0.0; 3];
    for (line, b) in coefficients.chunks_exact(3 * at_u.len()).zip(at_v) {
        let mut sum = [0.0; 3];
        for (c, a) in line.chunks_exact(3).zip(at_u) {
            for k in 0..3 {
                sum[k] += a * c[k];
            }
        }
        for k in 0..3 {
            point[k] += b * sum[k];
        }
    }
    point
}

/// Order along the curve of Morton: by the bits of both numbers in turn, the second's first.
fn along_curve(a: Place, b: Place) -> Ordering {
    let [x, y] = [a[0] ^ b[0], a[1] ^ b[1]];
    // Whether the highest bit of x is above that of y.
    let first_differs_higher = y < x && y < (x ^ y);
    if !first_differs_higher { a[1].cmp(&b[1]).then(a[0].cmp(&b[0])) } else { a[0].cmp(&b[0]) }
}

/// The part of a cell at a place of the same curve: the longer direction's first bits, then both in turn.
fn decoded(code: usize, halvings: [u8; 2]) -> [usize; 2] {
    let mut part = [0; 2];
    let shared = halvings[0].min(halvings[1]);
    for bit in 0..shared {
        part[0] |= (code >> (2 * bit) & 1) << bit;
        part[1] |= (code >> (2 * bit + 1) & 1) << bit;
    }
    let longer = usize::from(halvings[1] > halvings[0]);
    part[longer] |= (code >> (2 * shared)) << shared;
    part
}

#[cfg(test)]
mod tests;
