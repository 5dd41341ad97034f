//! Knot vectors and univariate B-splines.

use std::ops::Range;

use ndarray::{Array2, ArrayView2};

use crate::{Error, MAX_DEGREE};

/// Values of up to `MAX_DEGREE + 1` functions, on the stack.
pub(crate) type Row = [f64; MAX_DEGREE + 1];

/// Largest number of elements of level 0 in one direction: cell indices of the finest level must fit in 32 bits.
const MAX_ELEMENTS: usize = 1 << 16;

/// Largest absolute knot.
///
/// Limit: lengths and quotients of lengths stay finite.
const LARGEST: f64 = 1e100;

/// Shortest span.
///
/// Limit: its square is a normal number.
const SHORTEST: f64 = 1e-150;

/// Shortest span as a share of the length of the domain.
///
/// Limit: conversions between bases multiply coefficients by (length / span)^p at most, 10¹⁴⁴ at the largest degree, so that
/// coefficients up to 10¹⁰⁰ stay finite. Only next to zero do floating-point numbers lie that close together.
const SHORTEST_SHARE: f64 = 1.0 / (1_u64 << 60) as f64;

/// An open knot vector: non-decreasing, end knots of multiplicity `p + 1`, inner knots of multiplicity at most `p + 1`; or
/// a periodic one: simple knots that go on beyond both ends as they do at the other end.
///
/// A *span* is a non-empty knot interval `[breaks[s], breaks[s+1])`; the last one is closed. Function `i` has the support
/// `[knots[i], knots[i+p+1]]` (Imperatore 2024, §2.1.1).
///
/// **Periodic vectors.** Both ends of the domain are one place, the *seam*. There are as many B-splines as spans, of
/// which the first `p` reach across the seam: functions and spans are counted modulo their number, and at least `p + 1`
/// spans keep a function from overlapping itself. All splines are `p − 1` times continuously differentiable at the seam.
#[derive(Clone, Debug, PartialEq)]
pub struct KnotVector {
    degree: usize,
    knots: Vec<f64>,
    breaks: Vec<f64>,
    /// For each span the index of the last knot at its left end.
    span_knot: Vec<usize>,
    /// For each knot the index of its value among the breaks; empty for a periodic vector, where knot `j` is break `j − p`
    /// some periods on.
    break_of_knot: Vec<usize>,
    periodic: bool,
}

impl KnotVector {
    /// An open knot vector from its knots.
    ///
    /// # Errors
    /// [`Error::Degree`], [`Error::TooFewKnots`], [`Error::KnotOrder`], [`Error::Multiplicity`], [`Error::Elements`],
    /// [`Error::KnotRange`], [`Error::KnotSpan`].
    pub fn new(degree: usize, knots: Vec<f64>) -> Result<Self, Error> {
        if !(1..=MAX_DEGREE).contains(&degree) {
            return Err(Error::Degree { given: degree, limit: MAX_DEGREE });
        }
        let needed = 2 * (degree + 1);
        if knots.len() < needed {
            return Err(Error::TooFewKnots { given: knots.len(), degree, needed });
        }
        let (mut breaks, mut span_knot, mut break_of_knot) = (Vec::new(), Vec::new(), Vec::with_capacity(knots.len()));
        let mut multiplicity = 0;
        for (index, &value) in knots.iter().enumerate() {
            if !value.is_finite() || breaks.last().is_some_and(|&b| value < b) {
                return Err(Error::KnotOrder { index, value });
            }
            if breaks.last().is_none_or(|&b| value > b) {
                if let Some(&previous) = breaks.last() {
                    let first = breaks.len() == 1;
                    if multiplicity > degree + 1 || (first && multiplicity < degree + 1) {
                        return Err(Error::Multiplicity { value: previous, given: multiplicity, degree });
                    }
                    span_knot.push(index - 1);
                }
                breaks.push(value);
                multiplicity = 0;
            }
            multiplicity += 1;
            break_of_knot.push(breaks.len() - 1);
        }
        if breaks.len() > MAX_ELEMENTS + 1 {
            return Err(Error::Elements { given: breaks.len() - 1, limit: MAX_ELEMENTS });
        }
        if multiplicity != degree + 1 || breaks.len() < 2 {
            let value = knots[knots.len() - 1];
            return Err(Error::Multiplicity { value, given: multiplicity, degree });
        }
        check_lengths(&breaks)?;
        Ok(Self { degree, knots, breaks, span_knot, break_of_knot, periodic: false })
    }

    /// The open knot vector with `elements` equal spans on `[0, 1]` and simple inner knots.
    ///
    /// # Errors
    /// [`Error::Degree`], [`Error::Elements`].
    pub fn uniform(degree: usize, elements: usize) -> Result<Self, Error> {
        if !(1..=MAX_ELEMENTS).contains(&elements) {
            return Err(Error::Elements { given: elements, limit: MAX_ELEMENTS });
        }
        let inner = (1..elements).map(|i| i as f64 / elements as f64);
        let ends = |value| std::iter::repeat_n(value, degree + 1);
        Self::new(degree, ends(0.0).chain(inner).chain(ends(1.0)).collect())
    }

    /// The periodic knot vector with simple knots at the given breaks, of which the last one is the first one again, a
    /// period on.
    ///
    /// # Errors
    /// [`Error::Degree`], [`Error::KnotOrder`], [`Error::RepeatedKnot`], [`Error::Elements`],
    /// [`Error::TooFewPeriodicElements`] for fewer than `degree + 1` spans, [`Error::KnotRange`], [`Error::KnotSpan`], also
    /// where a span vanishes a period on.
    pub fn periodic(degree: usize, breaks: Vec<f64>) -> Result<Self, Error> {
        if !(1..=MAX_DEGREE).contains(&degree) {
            return Err(Error::Degree { given: degree, limit: MAX_DEGREE });
        }
        let n = breaks.len().saturating_sub(1);
        if n > MAX_ELEMENTS {
            return Err(Error::Elements { given: n, limit: MAX_ELEMENTS });
        }
        if n < degree + 1 {
            return Err(Error::TooFewPeriodicElements { given: n, degree, needed: degree + 1 });
        }
        for (index, &value) in breaks.iter().enumerate() {
            if !value.is_finite() || (index > 0 && value < breaks[index - 1]) {
                return Err(Error::KnotOrder { index, value });
            }
            if index > 0 && value == breaks[index - 1] {
                return Err(Error::RepeatedKnot { index, value });
            }
        }
        check_lengths(&breaks)?;
        let continued = Self::continued(degree, breaks);
        match continued.vanishing_span() {
            Some([lower, upper]) => Err(Error::KnotSpan { lower, upper, limit: f64::EPSILON * upper.abs() }),
            None => Ok(continued),
        }
    }

    /// The periodic knot vector with `elements` equal spans on `[0, 1]`.
    ///
    /// # Errors
    /// [`Error::Degree`], [`Error::Elements`], [`Error::TooFewPeriodicElements`].
    pub fn uniform_periodic(degree: usize, elements: usize) -> Result<Self, Error> {
        if elements > MAX_ELEMENTS {
            return Err(Error::Elements { given: elements, limit: MAX_ELEMENTS });
        }
        Self::periodic(degree, (0..=elements).map(|i| i as f64 / elements.max(1) as f64).collect())
    }

    /// The breaks of a periodic vector, continued by `degree` knots on each side.
    fn continued(degree: usize, breaks: Vec<f64>) -> Self {
        let n = breaks.len() - 1;
        let period = breaks[n] - breaks[0];
        let before = breaks[n - degree..n].iter().map(|t| t - period);
        let after = breaks[1..=degree].iter().map(|t| t + period);
        let knots = before.chain(breaks.iter().copied()).chain(after).collect();
        let span_knot = (degree..degree + n).collect();
        Self { degree, knots, breaks, span_knot, break_of_knot: Vec::new(), periodic: true }
    }

    /// The ends of a span of a periodic vector that round-off leaves without length, there or a period on.
    pub(crate) fn vanishing_span(&self) -> Option<[f64; 2]> {
        let mut pairs = self.knots.windows(2).filter(|_| self.periodic);
        pairs.find(|pair| pair[0] >= pair[1]).map(|pair| [pair[0], pair[1]])
    }

    /// The open knot vector with the same breaks: its splines include those of a periodic vector, cut at the seam. An
    /// open vector is returned as it is.
    pub fn opened(&self) -> Self {
        if !self.periodic {
            return self.clone();
        }
        let (degree, n) = (self.degree, self.n_spans());
        let ends = |t| std::iter::repeat_n(t, degree);
        let knots: Vec<f64> =
            ends(self.breaks[0]).chain(self.breaks.iter().copied()).chain(ends(self.breaks[n])).collect();
        let break_of_knot = (0..knots.len()).map(|j| j.saturating_sub(degree).min(n)).collect();
        let breaks = self.breaks.clone();
        Self { degree, knots, breaks, span_knot: self.span_knot.clone(), break_of_knot, periodic: false }
    }

    /// The same knots on another interval.
    ///
    /// # Errors
    /// [`Error::KnotOrder`] if the interval is empty or not finite.
    pub fn on_interval(&self, lower: f64, upper: f64) -> Result<Self, Error> {
        let (a, b) = self.domain();
        let place = |t: f64| if t == b { upper } else { lower + (t - a) / (b - a) * (upper - lower) };
        if self.periodic {
            return Self::periodic(self.degree, self.breaks.iter().map(|&t| place(t)).collect());
        }
        Self::new(self.degree, self.knots.iter().map(|&t| place(t)).collect())
    }

    /// The polynomial degree.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Whether the vector is periodic.
    pub fn is_periodic(&self) -> bool {
        self.periodic
    }

    /// All knots, with repetitions; of a periodic vector the breaks and `degree` further knots on each side.
    pub fn knots(&self) -> &[f64] {
        &self.knots
    }

    /// The different knots, increasing; one more than there are spans.
    pub fn breaks(&self) -> &[f64] {
        &self.breaks
    }

    /// First and last break.
    pub fn domain(&self) -> (f64, f64) {
        (self.breaks[0], self.breaks[self.n_spans()])
    }

    /// Number of B-splines.
    pub fn n_functions(&self) -> usize {
        if self.periodic { self.n_spans() } else { self.knots.len() - self.degree - 1 }
    }

    /// Number of non-empty knot intervals.
    pub fn n_spans(&self) -> usize {
        self.span_knot.len()
    }

    /// The first of the `degree + 1` B-splines that do not vanish on a span. The others follow, in a periodic vector
    /// modulo [`KnotVector::n_functions`]: see [`KnotVector::function`].
    pub fn first_function(&self, span: usize) -> usize {
        self.span_knot[span] - self.degree
    }

    /// The B-spline with the number `local`, from 0 to the degree, of those that do not vanish on a span.
    pub fn function(&self, span: usize, local: usize) -> usize {
        let (function, n) = (self.first_function(span) + local, self.n_functions());
        if function < n { function } else { function - n }
    }

    /// The spans in the support of a B-spline. In a periodic vector they are counted modulo [`KnotVector::n_spans`]: a
    /// support across the seam starts before it and ends beyond the last span.
    pub fn support(&self, function: usize) -> Range<usize> {
        if self.periodic {
            let start = self.before(function, self.degree);
            return start..start + self.degree + 1;
        }
        self.break_of_knot[function]..self.break_of_knot[function + self.degree + 1]
    }

    /// The spans in the supports of the B-splines that do not vanish on a span, each once; in a periodic vector modulo
    /// [`KnotVector::n_spans`].
    pub fn support_extension(&self, span: usize) -> Range<usize> {
        let p = self.degree;
        if self.periodic {
            let start = self.before(span, p);
            return start..start + (2 * p + 1).min(self.n_spans());
        }
        let first = self.first_function(span);
        self.support(first).start..self.support(first + p).end
    }

    /// A span, so many before it and so many after it, each once; in a periodic vector modulo [`KnotVector::n_spans`].
    pub fn neighbourhood(&self, span: usize, [before, after]: [usize; 2]) -> Range<usize> {
        let n = self.n_spans();
        if self.periodic {
            let before = before.min(n - 1);
            let start = self.before(span, before);
            return start..start + before + (after + 1).min(n - before);
        }
        span.saturating_sub(before)..(span + after + 1).min(n)
    }

    /// The index `distance` places before another one on the circle of spans.
    fn before(&self, index: usize, distance: usize) -> usize {
        let n = self.n_spans();
        (index + n - distance % n) % n
    }

    /// The span that holds `u`: half-open, the last one closed. `None` outside the domain and for NaN.
    pub fn span_at(&self, u: f64) -> Option<usize> {
        let (lower, upper) = self.domain();
        if !(lower..=upper).contains(&u) {
            return None;
        }
        let last = self.n_spans() - 1;
        // Knots are mostly equidistant: start where they would be, then walk.
        let mut span = (((u - lower) / (upper - lower) * (last + 1) as f64) as usize).min(last);
        if self.breaks[span] <= u && (span == last || u < self.breaks[span + 1]) {
            return Some(span);
        }
        span = self.breaks.partition_point(|&b| b <= u);
        Some(span.saturating_sub(1).min(last))
    }

    /// Greville abscissae: the means of `degree` consecutive knots, one per B-spline. B-spline coefficients equal to
    /// them give the identity, but in a periodic vector, where the identity is no spline and the means are wrapped into
    /// the domain.
    pub fn greville(&self) -> Vec<f64> {
        let p = self.degree;
        let mean = |i: usize| self.knots[i + 1..=i + p].iter().sum::<f64>() / p as f64;
        let (lower, upper) = self.domain();
        let place = |mean| if self.periodic { wrapped(mean, lower, upper) } else { mean };
        (0..self.n_functions()).map(|i| place(mean(i))).collect()
    }

    /// The knot vector with the midpoint of each span inserted once.
    pub fn refined(&self) -> Self {
        if self.periodic {
            let halves = self.breaks.windows(2).flat_map(|pair| [pair[0], pair[0] + 0.5 * (pair[1] - pair[0])]);
            return Self::continued(self.degree, halves.chain([self.domain().1]).collect());
        }
        let mut knots = Vec::with_capacity(self.knots.len() + self.n_spans());
        for (i, &knot) in self.knots.iter().enumerate() {
            knots.push(knot);
            if let Some(&next) = self.knots.get(i + 1).filter(|&&next| next > knot) {
                knots.push(knot + 0.5 * (next - knot));
            }
        }
        let n_spans = 2 * self.n_spans();
        let (mut breaks, mut span_knot, mut break_of_knot) =
            (Vec::with_capacity(n_spans + 1), Vec::with_capacity(n_spans), Vec::with_capacity(knots.len()));
        for (index, &value) in knots.iter().enumerate() {
            if breaks.last().is_none_or(|&b| value > b) {
                if index > 0 {
                    span_knot.push(index - 1);
                }
                breaks.push(value);
            }
            break_of_knot.push(breaks.len() - 1);
        }
        Self { degree: self.degree, knots, breaks, span_knot, break_of_knot, periodic: false }
    }

    /// The knot vector with further knots, and the coefficients `(n_functions, N)` in its B-splines.
    ///
    /// # Errors
    /// As [`KnotVector::new`] or [`KnotVector::periodic`], where an inserted knot becomes too frequent;
    /// [`Error::OutsideDomain`], [`Error::Shape`].
    pub fn insert(&self, further: &[f64], coefficients: ArrayView2<'_, f64>) -> Result<(Self, Array2<f64>), Error> {
        let (given, expected) = (coefficients.nrows(), self.n_functions());
        if given != expected {
            return Err(Error::Shape { what: "rows of coefficients", given, expected });
        }
        let present = if self.periodic { &self.breaks } else { &self.knots };
        let mut knots: Vec<f64> = present.iter().chain(further).copied().collect();
        knots.sort_by(f64::total_cmp);
        let fine = if self.periodic { Self::periodic(self.degree, knots)? } else { Self::new(self.degree, knots)? };
        if fine.domain() != self.domain() {
            let (lower, upper) = self.domain();
            let value = if fine.domain().0 < lower { fine.domain().0 } else { fine.domain().1 };
            return Err(Error::OutsideDomain { value, direction: 0, lower, upper });
        }
        let mut refined = Array2::zeros((fine.n_functions(), coefficients.ncols()));
        for (j, mut target) in refined.outer_iter_mut().enumerate() {
            let (first, weights) = self.coefficient_weights(&fine, j);
            for (i, weight) in weights[..=self.degree].iter().enumerate() {
                let row = (first + i as isize).rem_euclid(expected as isize) as usize;
                target.scaled_add(*weight, &coefficients.row(row));
            }
        }
        Ok((fine, refined))
    }

    /// Values of the `degree + 1` B-splines that do not vanish at `u`, with the index of the first. In a periodic vector the
    /// others follow modulo [`KnotVector::n_functions`].
    ///
    /// # Errors
    /// [`Error::OutsideDomain`].
    pub fn basis(&self, u: f64) -> Result<(usize, Vec<f64>), Error> {
        self.basis_derivatives(u, 0).map(|(first, mut rows)| (first, rows.swap_remove(0)))
    }

    /// Derivatives of order `0..=order` of the `degree + 1` B-splines that do not vanish at `u`: the index of the first,
    /// and one row of `degree + 1` numbers per order. At a knot the derivatives are those of the span to its right.
    ///
    /// # Errors
    /// [`Error::OutsideDomain`].
    pub fn basis_derivatives(&self, u: f64, order: usize) -> Result<(usize, Vec<Vec<f64>>), Error> {
        let (lower, upper) = self.domain();
        let span = self.span_at(u).ok_or(Error::OutsideDomain { value: u, direction: 0, lower, upper })?;
        let p = self.degree;
        let mu = self.span_knot[span];
        let rows = (0..=order)
            .map(|r| {
                if r > p {
                    return vec![0.0; p + 1];
                }
                // Values of degree p − r, then r times N' = q (N_i/(t_{i+q}−t_i) − N_{i+1}/(t_{i+q+1}−t_{i+1})).
                let mut values = vec![0.0; p + 1];
                let low = discrete_bsplines(&self.knots, mu, p - r, |_| u);
                values[..=p - r].copy_from_slice(&low[..=p - r]);
                for q in p - r + 1..=p {
                    let mut raised = vec![0.0; p + 1];
                    for i in 0..q {
                        let left = mu + 1 + i - q;
                        let slope = q as f64 * values[i] / (self.knots[left + q] - self.knots[left]);
                        raised[i] -= slope;
                        raised[i + 1] += slope;
                    }
                    values = raised;
                }
                values
            })
            .collect();
        Ok((mu - p, rows))
    }

    /// Bézier matrix of a span, `(degree + 1)²` row-major: row `i` holds the Bernstein coefficients of the span's `i`-th
    /// B-spline.
    pub(crate) fn bezier_matrix(&self, span: usize) -> Vec<f64> {
        let p = self.degree;
        let (a, b) = (self.breaks[span], self.breaks[span + 1]);
        let mut matrix = vec![0.0; (p + 1) * (p + 1)];
        for k in 0..=p {
            let weights = discrete_bsplines(&self.knots, self.span_knot[span], p, |r| if r < p - k { a } else { b });
            for i in 0..=p {
                matrix[i * (p + 1) + k] = weights[i];
            }
        }
        matrix
    }

    /// Number of B-splines that do not vanish on the domain, those across the seam counted at both ends.
    pub(crate) fn n_images(&self) -> usize {
        self.knots.len() - self.degree - 1
    }

    /// Weights of this vector's coefficients in coefficient `j` of a refinement: the first index and `degree + 1` weights.
    /// Where a
    /// vector is periodic, functions are counted on beyond both ends, as the knots are; the opened vector counts as a
    /// refinement.
    pub fn coefficient_weights(&self, fine: &Self, j: usize) -> (isize, [f64; MAX_DEGREE + 1]) {
        let p = self.degree;
        // Of a function across the seam all images have the same weights: take the one that starts within the domain.
        let (start, turns) = if fine.periodic {
            let (span, n) = (j as isize - p as isize, fine.n_spans() as isize);
            (span.rem_euclid(n) as usize + p, span.div_euclid(n))
        } else {
            (j, 0)
        };
        let at = fine.knots[start];
        let span = self.breaks.partition_point(|&b| b <= at).saturating_sub(1).min(self.n_spans() - 1);
        let mu = self.span_knot[span];
        let first = (mu - p) as isize + turns * self.n_spans() as isize;
        (first, discrete_bsplines(&self.knots, mu, p, |r| fine.knots[start + 1 + r]))
    }
}

/// Checks sizes of increasing breaks, of which there are two or more.
fn check_lengths(breaks: &[f64]) -> Result<(), Error> {
    let (first, last) = (breaks[0], breaks[breaks.len() - 1]);
    if let Some(&value) = [first, last].iter().find(|end| end.abs() > LARGEST) {
        return Err(Error::KnotRange { value, limit: LARGEST });
    }
    let limit = (SHORTEST_SHARE * (last - first)).max(SHORTEST);
    match breaks.windows(2).find(|pair| pair[1] - pair[0] < limit) {
        Some(pair) => Err(Error::KnotSpan { lower: pair[0], upper: pair[1], limit }),
        None => Ok(()),
    }
}

/// A number moved by whole periods into `[lower, upper)`.
pub(crate) fn wrapped(u: f64, lower: f64, upper: f64) -> f64 {
    if (lower..upper).contains(&u) {
        return u;
    }
    let inside = lower + (u - lower).rem_euclid(upper - lower);
    // Just below a whole number of periods the remainder rounds to a period.
    if inside < upper || inside.is_nan() { inside } else { lower }
}

/// Discrete B-splines (Oslo algorithm): the Cox–de Boor recursion on the knot span `mu`, with its own argument at each
/// of the `degree` steps. Equal arguments give the values of the B-splines; `degree` consecutive knots of a refined
/// vector give the weights of knot insertion, which are non-negative, with exact zeros where they must vanish.
fn discrete_bsplines(knots: &[f64], mu: usize, degree: usize, argument: impl Fn(usize) -> f64) -> Row {
    let mut values = Row::default();
    values[0] = 1.0;
    for q in 1..=degree {
        let x = argument(q - 1);
        let mut carried = 0.0;
        for i in 0..q {
            let (left, right) = (knots[mu + 1 + i - q], knots[mu + 1 + i]);
            let share = values[i] / (right - left);
            values[i] = carried + (right - x) * share;
            carried = (x - left) * share;
        }
        values[q] = carried;
    }
    values
}
