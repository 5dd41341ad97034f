//! A closed polygon by arc length, with exact averages over any stretch of it.

use ndarray::ArrayView2;

use crate::vec3::{cross, dot, sub, unit};
use crate::{CloudError, check_finite};

/// A closed polygon in R³ (a plane one has z = 0), relative to its first point.
pub(crate) struct LoopCurve {
    points: Vec<[f64; 3]>,
    /// Arc length at each vertex, and the perimeter at the end.
    arc_lengths: Vec<f64>,
    origin: [f64; 3],
}

impl LoopCurve {
    /// The polygon through `points`, shape `(n, 2)` or `(n, 3)`.
    pub(crate) fn new(points: ArrayView2<'_, f64>) -> Result<Self, CloudError> {
        if !matches!(points.ncols(), 2 | 3) {
            return Err(CloudError::WrongDimension { given: points.ncols(), required: 3 });
        }
        if points.nrows() < 4 {
            return Err(CloudError::LoopTooShort { given: points.nrows() });
        }
        check_finite(points)?;
        let at = |i: usize| std::array::from_fn(|k| points.row(i).get(k).copied().unwrap_or(0.0));
        let origin = at(0);
        let points: Vec<[f64; 3]> = (0..points.nrows()).map(|i| sub(at(i), origin)).collect();
        let mut arc_lengths = vec![0.0];
        let mut s = 0.0;
        for (i, &p) in points.iter().enumerate() {
            let edge = sub(points[(i + 1) % points.len()], p);
            s += dot(edge, edge).sqrt();
            arc_lengths.push(s);
        }
        if s == 0.0 {
            return Err(CloudError::LoopWithoutLength { count: points.len() });
        }
        Ok(Self { points, arc_lengths, origin })
    }

    pub(crate) fn len(&self) -> usize {
        self.points.len()
    }

    pub(crate) fn perimeter(&self) -> f64 {
        self.arc_lengths[self.len()]
    }

    pub(crate) fn arc_length(&self, i: usize) -> f64 {
        self.arc_lengths[i]
    }

    /// Length from vertex `i` forward to vertex `j`.
    pub(crate) fn arc(&self, i: usize, j: usize) -> f64 {
        let length = self.arc_lengths[j] - self.arc_lengths[i];
        if j > i { length } else { length + self.perimeter() }
    }

    pub(crate) fn point(&self, i: usize) -> [f64; 3] {
        std::array::from_fn(|k| self.origin[k] + self.points[i][k])
    }

    /// Twice the vector area: normal to the plane that sees most of the loop, which runs counter-clockwise round it.
    pub(crate) fn vector_area(&self) -> [f64; 3] {
        let mut area = [0.0; 3];
        for (i, &p) in self.points.iter().enumerate() {
            let part = cross(p, self.points[(i + 1) % self.len()]);
            area = std::array::from_fn(|k| area[k] + part[k]);
        }
        area
    }

    pub(crate) fn integral_of_positions(&self) -> LoopIntegral<'_> {
        self.integral_of(&self.points)
    }

    /// The integral along the loop of values at the vertices, linear between them.
    pub(crate) fn integral_of<'a>(&self, values: &'a [[f64; 3]]) -> LoopIntegral<'a> {
        let mut sums = vec![[0.0; 3]];
        let mut sum = [0.0; 3];
        for (i, &p) in values.iter().enumerate() {
            let q = values[(i + 1) % values.len()];
            let length = self.arc_lengths[i + 1] - self.arc_lengths[i];
            sum = std::array::from_fn(|k| sum[k] + 0.5 * length * (p[k] + q[k]));
            sums.push(sum);
        }
        LoopIntegral { values, sums }
    }

    /// The mean over the arc lengths from `from` to `to > from`; both may pass the ends of the loop by one turn.
    pub(crate) fn mean(&self, integral: &LoopIntegral<'_>, from: f64, to: f64) -> [f64; 3] {
        let (a, b) = (self.up_to(integral, from), self.up_to(integral, to));
        std::array::from_fn(|k| (b[k] - a[k]) / (to - from))
    }

    fn up_to(&self, integral: &LoopIntegral<'_>, s: f64) -> [f64; 3] {
        let (n, perimeter) = (self.len(), self.perimeter());
        let turns = (s / perimeter).floor();
        let s = (s - turns * perimeter).clamp(0.0, perimeter);
        // The edge that holds s: the last whose start does not lie beyond it.
        let i = self.arc_lengths[..n].partition_point(|&start| start <= s) - 1;
        let length = self.arc_lengths[i + 1] - self.arc_lengths[i];
        let t = s - self.arc_lengths[i];
        let share = if length > 0.0 { t / length } else { 0.0 };
        let (p, q) = (integral.values[i], integral.values[(i + 1) % n]);
        std::array::from_fn(|k| {
            turns * integral.sums[n][k] + integral.sums[i][k] + t * (p[k] + 0.5 * share * (q[k] - p[k]))
        })
    }

    /// Unit vector along which the loop extends farthest in the mean square (some such vector, where several do).
    pub(crate) fn principal_axis(&self) -> [f64; 3] {
        let perimeter = self.perimeter();
        let center = self.mean(&self.integral_of_positions(), 0.0, perimeter);
        let mut matrix = [[0.0; 3]; 3];
        for (i, &p) in self.points.iter().enumerate() {
            let before = self.arc_lengths[i] - if i == 0 { 0.0 } else { self.arc_lengths[i - 1] };
            let weight = (before + self.arc_lengths[i + 1] - self.arc_lengths[i]) / perimeter;
            let r = sub(p, center).map(|x| x / perimeter);
            matrix = std::array::from_fn(|k| std::array::from_fn(|l| matrix[k][l] + weight * r[k] * r[l]));
        }
        // Each squaring squares the ratio of the eigenvalues: after 12 a ratio of 0.99 has become 1e-18.
        for _ in 0..12 {
            let trace = matrix[0][0] + matrix[1][1] + matrix[2][2];
            let m = matrix.map(|row| row.map(|x| x / trace));
            matrix = std::array::from_fn(|k| std::array::from_fn(|l| dot(m[k], m[l])));
        }
        let largest = (0..3).fold(0, |b, k| if matrix[k][k] > matrix[b][b] { k } else { b });
        unit(matrix[largest])
    }
}

/// Values at the vertices of a loop and their integrals from its start.
pub(crate) struct LoopIntegral<'a> {
    values: &'a [[f64; 3]],
    sums: Vec<[f64; 3]>,
}
