//! From points in order to points with parameters: closing, corners, parameters.

use geom_io::{LengthUnit, ReadError, ReadErrorKind, ReadOptions, Scan, TakenColumn, read_scan};
use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, concatenate};
use param_classic::parameterize_sequence;
use param_nn::sequence_parameters;
use point_cloud::BoundingBox;

use super::choices::{ClosedChoice, CornerChoice, CurveParameters, Ends};
use super::closing::{FEWEST_REPEATED, Meeting, Repeated, meeting, repeated};
use super::corners::find_corners;
use super::options::CurveOptions;
use crate::Error;
use crate::parameters::extent;
use std::path::Path;

/// How a curve ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Closing {
    /// At two places.
    Open,
    /// Nowhere: it goes on smoothly.
    Periodic,
    /// At one place, a corner.
    AtCorner,
}

impl Closing {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Periodic => "periodic",
            Self::AtCorner => "at a corner",
        }
    }
}

/// A sequence that is ready to be fitted.
#[derive(Clone, Debug)]
pub(super) struct Sequence {
    /// `(m, N)`; of a graph the values only.
    pub(super) points: Array2<f64>,
    /// `(m,)`, non-decreasing unless given.
    pub(super) parameters: Array1<f64>,
    /// Lower and upper end of the parameters.
    pub(super) domain: (f64, f64),
    pub(super) closing: Closing,
    /// Whether the first and the last point are kept.
    pub(super) held: bool,
    /// Corners inside the domain, as rows of `points`, increasing.
    pub(super) corners: Vec<usize>,
    /// All corners as rows of the input.
    pub(super) corner_rows: Vec<usize>,
    /// Rows of the input, of all points.
    pub(super) rows: Vec<usize>,
    pub(super) method: &'static str,
    pub(super) notes: Vec<String>,
}

/// What a file or a caller gave.
pub(super) struct Given {
    pub(super) points: Array2<f64>,
    pub(super) parameters: Option<Array1<f64>>,
    pub(super) notes: Vec<String>,
    pub(super) format: &'static str,
    pub(super) unit: Option<LengthUnit>,
    pub(super) columns: Vec<TakenColumn>,
}

/// Reads a sequence. A table without columns x and y, but of two or three columns, is taken as it stands.
pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Given, Error> {
    let scan = match read_scan(path, options) {
        Err(ReadError { kind: ReadErrorKind::ColumnsNotFound { found, .. }, .. })
            if options.columns.is_empty() && (2..=3).contains(&found.len()) =>
        {
            let columns = (1..=found.len()).map(|k| k.to_string()).collect();
            let mut scan = read_scan(path, &ReadOptions { columns, ..options.clone() })?;
            scan.notes.push(format!("columns {} were taken as coordinates, in this order", found.join(", ")));
            scan
        }
        other => other?,
    };
    let Scan { cloud, format, notes, unit, columns, .. } = scan;
    let parameters = cloud.parameters.filter(|p| p.ncols() == 1).map(|p| p.column(0).to_owned());
    Ok(Given { points: cloud.points, parameters, notes, format: format.name(), unit, columns })
}

/// Finds closing, corners and parameters.
pub(super) fn prepare(given: Given, options: &CurveOptions) -> Result<Sequence, Error> {
    let Given { points, parameters, notes, .. } = given;
    point_cloud::check_finite(points.view())?;
    if points.nrows() < 2 {
        return Err(point_cloud::CloudError::TooFewPoints { given: points.nrows(), required: 2 }.into());
    }
    if options.graph {
        return graph(&points, notes, options);
    }
    let wants_given = match options.param {
        CurveParameters::Auto => parameters.is_some(),
        other => other == CurveParameters::Given,
    };
    if wants_given {
        let parameters = parameters.ok_or(Error::NoParameters {
            asked: options.param.to_string(),
            needed: "a column u",
            hint: "",
        })?;
        return with_given(points, parameters, notes, options);
    }
    laid_out(points, notes, options)
}

/// The first coordinate is the parameter; rows are sorted by it.
fn graph(points: &Array2<f64>, mut notes: Vec<String>, options: &CurveOptions) -> Result<Sequence, Error> {
    if points.ncols() < 2 {
        return Err(Error::GraphColumns { given: points.ncols() });
    }
    let x = points.column(0);
    let mut order: Vec<usize> = (0..x.len()).collect();
    order.sort_by(|&a, &b| x[a].total_cmp(&x[b]));
    if !order.is_sorted() {
        notes.push("rows were sorted by x".to_owned());
    }
    let sorted = points.select(Axis(0), &order);
    let parameters = sorted.column(0).to_owned();
    let domain = domain_of(parameters.view())?;
    let columns: Vec<usize> = (1..points.ncols()).collect();
    // A function may have kinks where the user says so; turning depends on the scale of its axes.
    let corner_rows = match &options.corners {
        CornerChoice::Rows(rows) => checked(rows, points.nrows())?,
        CornerChoice::Auto | CornerChoice::None => Vec::new(),
    };
    let mut place = vec![0; order.len()];
    order.iter().enumerate().for_each(|(at, &row)| place[row] = at);
    let mut corners: Vec<usize> = corner_rows.iter().map(|&row| place[row]).collect();
    corners.sort_unstable();
    Ok(Sequence {
        points: sorted.select(Axis(1), &columns),
        corners: inner(corners, &parameters, domain),
        parameters,
        domain,
        closing: Closing::Open,
        held: options.ends == Ends::Held,
        corner_rows,
        rows: order,
        method: "graph",
        notes,
    })
}

fn with_given(
    points: Array2<f64>,
    parameters: Array1<f64>,
    notes: Vec<String>,
    options: &CurveOptions,
) -> Result<Sequence, Error> {
    let closed = options.closed == ClosedChoice::Yes;
    let corner_rows = match &options.corners {
        CornerChoice::Rows(rows) => checked(rows, points.nrows())?,
        // Parameters of the file need not follow its rows.
        CornerChoice::Auto | CornerChoice::None => Vec::new(),
    };
    let domain = if closed { (0.0, 1.0) } else { domain_of(parameters.view())? };
    if let Some((index, &value)) = parameters.iter().enumerate().find(|(_, u)| !(domain.0..=domain.1).contains(*u)) {
        return Err(Error::OutsidePeriod { index, value });
    }
    if closed && !corner_rows.is_empty() {
        return Err(Error::ClosedWithCorners);
    }
    let mut corners = corner_rows.clone();
    corners.sort_by(|&a, &b| parameters[a].total_cmp(&parameters[b]));
    Ok(Sequence {
        corners: inner(corners, &parameters, domain),
        rows: (0..points.nrows()).collect(),
        points,
        parameters,
        domain,
        closing: if closed { Closing::Periodic } else { Closing::Open },
        held: !closed && options.ends == Ends::Held,
        corner_rows,
        method: "given",
        notes,
    })
}

fn laid_out(mut points: Array2<f64>, mut notes: Vec<String>, options: &CurveOptions) -> Result<Sequence, Error> {
    let rows_given = points.nrows();
    // Values alone have neither length nor direction: they are functions of their number.
    let are_values = points.ncols() == 1;
    let (closed, again) = closes(points.view(), are_values, &mut notes, options)?;
    let m = rows_given - again.len();
    let of = |rows: std::ops::Range<usize>| points.select(Axis(0), &rows.collect::<Vec<_>>());
    let (turn, beyond) = (of(0..m), of(m..rows_given));
    points = turn;
    let corner_rows = match &options.corners {
        CornerChoice::Auto if !are_values => find_corners(points.view(), closed),
        CornerChoice::Auto | CornerChoice::None => Vec::new(),
        CornerChoice::Rows(rows) => checked(rows, rows_given)?,
    };
    let mut corners: Vec<usize> = corner_rows.iter().map(|&row| row % m).collect();
    corners.sort_unstable();
    corners.dedup();
    let closing = match (closed, corners.first()) {
        (false, _) => Closing::Open,
        (true, None) => Closing::Periodic,
        (true, Some(_)) => Closing::AtCorner,
    };
    let mut rows: Vec<usize> = (0..m).collect();
    let mut first = 0;
    if let (Closing::AtCorner, Some(&corner)) = (closing, corners.first()) {
        // The seam is laid into the first corner, which then stands at both ends.
        first = corner;
        rows = (first..m).chain(0..=first).collect();
        points = points.select(Axis(0), &rows);
        corners.iter_mut().for_each(|corner| *corner -= first);
        if first > 0 {
            notes.push(format!("the curve starts at row {first}, a corner"));
        }
    }
    let param = match options.param {
        CurveParameters::Auto if are_values => CurveParameters::Uniform,
        CurveParameters::Auto | CurveParameters::Given => CurveParameters::Chord,
        other => other,
    };
    let parameters = parameters_of(points.view(), closing, param)?;
    let domain = (0.0, 1.0);
    let held = closing == Closing::AtCorner || closing == Closing::Open && options.ends == Ends::Held;
    let sequence = Sequence {
        corners: inner(corners, &parameters, domain),
        points,
        parameters,
        domain,
        closing,
        held,
        corner_rows,
        rows,
        method: match param {
            CurveParameters::Centripetal => "centripetal",
            CurveParameters::Parcnn => "parcnn",
            CurveParameters::Uniform => "uniform",
            _ => "chord",
        },
        notes,
    };
    Ok(sequence.with_repeated(beyond.view(), &again, first))
}

/// Whether points close, and what stands at their end that the turn has already: its first point again, or more of them.
fn closes(
    points: ArrayView2<'_, f64>,
    are_values: bool,
    notes: &mut Vec<String>,
    options: &CurveOptions,
) -> Result<(bool, Vec<Repeated>), Error> {
    let last = points.nrows() - 1;
    let has_first_again = points.row(0) == points.row(last);
    if options.closed == ClosedChoice::No || options.closed == ClosedChoice::Auto && are_values {
        return Ok((false, Vec::new()));
    }
    let asked = options.closed == ClosedChoice::Yes;
    let meeting = meeting(points);
    let near = asked || has_first_again && last > 2 || matches!(meeting, Meeting::Near | Meeting::OverGap);
    let beside = if asked { BESIDE_TOLERANCES * options.tol.resolve(BoundingBox::of(points)?.diagonal()) } else { 0.0 };
    let again = if are_values || has_first_again {
        Vec::new()
    } else {
        repeated(points, beside, if near { 1 } else { FEWEST_REPEATED })
    };
    let closed = near || !again.is_empty();
    if !again.is_empty() {
        notes.push(format!(
            "the last {} points, from row {} on, go round once more and are fitted with the first ones",
            again.len(),
            points.nrows() - again.len()
        ));
    } else if !asked && !has_first_again {
        match meeting {
            Meeting::OverGap => notes.push(
                "the ends are apart by no more than other neighbours there, and the curve is closed; --closed no leaves it \
                 open"
                .to_owned(),
            ),
            Meeting::Nearly(steps) => notes.push(format!(
                "the ends are {steps:.1} mean steps apart, and the curve is taken to be open; --closed yes closes it"
            )),
            Meeting::Near | Meeting::Apart => {}
        }
    }
    // The first point again is one place of a closed curve.
    let again = if closed && has_first_again && last > 1 { vec![Repeated::DROPPED] } else { again };
    Ok((closed, again))
}

/// Distance, in tolerances, within which points of a closed curve stand beside its first steps.
///
/// Derived: both are within one tolerance of the curve.
const BESIDE_TOLERANCES: f64 = 2.0;

impl Sequence {
    /// The same with points `(k, N)` that go round once more, merged by their parameters; `first` is where the sequence
    /// starts in the turn.
    fn with_repeated(mut self, beyond: ArrayView2<'_, f64>, again: &[Repeated], first: usize) -> Self {
        let turn = self.points.nrows() - usize::from(self.closing == Closing::AtCorner);
        let further: Vec<(f64, usize)> = again
            .iter()
            .enumerate()
            .filter(|(_, place)| **place != Repeated::DROPPED)
            .map(|(k, place)| {
                let at = (place.step + turn - first) % turn;
                let (from, to) = (self.parameters[at], self.parameters.get(at + 1).copied().unwrap_or(self.domain.1));
                (from + place.share * (to - from), k)
            })
            .collect();
        if further.is_empty() {
            return self;
        }
        let m = self.points.nrows();
        let mut order: Vec<(f64, usize)> = self.parameters.iter().copied().zip(0..m).collect();
        order.extend(further.iter().map(|&(u, k)| (u, m + k)));
        // A stable sort: of equal parameters those of the turn come first, and the corner at the end stays there.
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let dimension = self.points.ncols();
        let points = Array2::from_shape_fn((order.len(), dimension), |(i, k)| match order[i].1 {
            at if at < m => self.points[[at, k]],
            at => beyond[[at - m, k]],
        });
        let rows = order.iter().map(|&(_, at)| if at < m { self.rows[at] } else { turn + at - m }).collect();
        let mut place = vec![0; m];
        order.iter().enumerate().filter(|(_, (_, at))| *at < m).for_each(|(i, &(_, at))| place[at] = i);
        self.corners.iter_mut().for_each(|corner| *corner = place[*corner]);
        self.parameters = order.iter().map(|&(u, _)| u).collect();
        self.points = points;
        self.rows = rows;
        self
    }
}

/// Parameters in [0, 1]; of a periodic curve they end one step before 1.
fn parameters_of(points: ArrayView2<'_, f64>, closing: Closing, param: CurveParameters) -> Result<Array1<f64>, Error> {
    let of = |points: ArrayView2<'_, f64>| -> Result<Array1<f64>, Error> {
        match param.rule() {
            Some(rule) => Ok(parameterize_sequence(points, rule)?),
            None => Ok(sequence_parameters(points, None)?),
        }
    };
    if closing != Closing::Periodic {
        return of(points);
    }
    let first = points.select(Axis(0), &[0]);
    let round = concatenate(Axis(0), &[points, first.view()]).map_err(|_| fit_ls::Error::Shape {
        what: "points",
        given: points.nrows(),
        expected: points.nrows(),
    })?;
    let all = of(round.view())?;
    Ok(all.select(Axis(0), &(0..points.nrows()).collect::<Vec<_>>()))
}

/// The corners whose parameters lie inside the domain: at its ends there is nothing to do.
fn inner(mut corners: Vec<usize>, parameters: &Array1<f64>, domain: (f64, f64)) -> Vec<usize> {
    corners.retain(|&corner| parameters[corner] > domain.0 && parameters[corner] < domain.1);
    corners.dedup_by(|a, b| parameters[*a] == parameters[*b]);
    corners
}

fn checked(rows: &[usize], points: usize) -> Result<Vec<usize>, Error> {
    match rows.iter().find(|&&row| row >= points) {
        Some(&row) => Err(Error::NoSuchPoint { option: "--corners", row: row as u64 }),
        None => Ok(rows.to_vec()),
    }
}

fn domain_of(parameters: ArrayView1<'_, f64>) -> Result<(f64, f64), Error> {
    let (lower, upper) = extent(parameters);
    if upper > lower { Ok((lower, upper)) } else { Err(Error::FlatDomain { direction: 0, value: lower }) }
}
