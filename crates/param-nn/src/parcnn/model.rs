//! Trained networks: files, and the parameters they give.

use std::collections::BTreeMap;
use std::sync::Arc;

use ndarray::{Array1, Array3, ArrayView2, ArrayView3};
use point_cloud::check_finite;

use super::fit::SplineSpace;
use super::grid::{Grid, State, distance};
use super::layout::{Architecture, Form, Layout};
use super::network::Keep;
use super::pass::{Pass, Task};
use crate::archive::Archive;
use crate::bezier::LARGEST_DEGREE;
use crate::error::NnError;
use crate::gridded::scale_to_unit_box;

/// Version of the weights' format; others are refused.
const VERSION: &str = "1";

/// Most points of a grid: the network keeps some ten kilobytes a point while it runs.
pub const LARGEST_GRID: usize = 250_000;

/// Most functions of the splines along a direction; the fit of a grid solves a dense system in their square.
const MOST_FUNCTIONS: usize = 24;

/// Times that the feedback form is run.
const PASSES: usize = 4;

/// A line counts as running backwards if turning it round brings it nearer to its neighbour than this share of its present
/// distance.
const BACKWARDS: f64 = 0.5;

/// A network that parameterizes point sequences or grids (Imperatore 2024, §4.1).
#[derive(Clone, Debug)]
pub struct Parcnn {
    pub(crate) layout: Arc<Layout>,
    pub(crate) theta: Vec<f32>,
    pub(crate) notes: BTreeMap<String, String>,
}

/// Trained by the commands in their notes.
const PLANE_SEQUENCES: &[u8] = include_bytes!("../../weights/parcnn-curve2.safetensors");
const SPACE_SEQUENCES: &[u8] = include_bytes!("../../weights/parcnn-curve3.safetensors");
const GRIDS: &[u8] = include_bytes!("../../weights/parcnn-surface.safetensors");

/// Parameters of a point sequence, shape `(m, N)` with N 2 or 3, by the network that comes with this crate: shape `(m)`. A
/// missing space is [`SplineSpace::suggested`]; see [`Parcnn::predict_sequence`]. Reads the weights anew in every call; for
/// many sequences, keep a [`Parcnn::embedded`].
///
/// ```
/// use ndarray::Array2;
/// use param_nn::{SplineSpace, sequence_parameters};
///
/// // Points on a parabola, the first ones close together.
/// let t: Vec<f64> = (0..20).map(|k| (k as f64 / 19.0).powi(2)).collect();
/// let points = Array2::from_shape_fn((20, 2), |(i, k)| [t[i], 1.0 - (2.0 * t[i] - 1.0).powi(2)][k]);
/// let u = sequence_parameters(points.view(), Some(SplineSpace::polynomials(2)))?;
/// assert!(u.iter().zip(&t).all(|(a, b)| (a - b).abs() < 0.01));
/// # Ok::<(), param_nn::NnError>(())
/// ```
///
/// # Errors
/// As [`Parcnn::predict_sequence`]; [`NnError::NoNetwork`] for N other than 2 and 3.
pub fn sequence_parameters(points: ArrayView2<'_, f64>, space: Option<SplineSpace>) -> Result<Array1<f64>, NnError> {
    let space = space.unwrap_or(SplineSpace::suggested(points.nrows()));
    Parcnn::embedded(points.ncols(), 1)?.predict_sequence(points, space)
}

/// Parameters of a grid of points, shape `(m₁, m₂, 3)`, by the network that comes with this crate: shape `(m₁, m₂, 2)`. A
/// missing space is [`SplineSpace::suggested`] for the shorter lines; see [`Parcnn::predict_grid`].
///
/// # Errors
/// As [`Parcnn::predict_grid`]; [`NnError::NoNetwork`] for N other than 3.
pub fn grid_parameters(points: ArrayView3<'_, f64>, space: Option<SplineSpace>) -> Result<Array3<f64>, NnError> {
    let (first, second, dimension) = points.dim();
    let space = space.unwrap_or(SplineSpace::suggested(first.min(second)));
    Parcnn::embedded(dimension, 2)?.predict_grid(points, space)
}

impl Parcnn {
    /// The network that comes with this crate for points of a dimension, along 1 direction (sequences) or 2 (grids): there
    /// is one for (2, 1), (3, 1) and (3, 2).
    ///
    /// # Errors
    /// [`NnError::NoNetwork`] if there is none; otherwise as [`Parcnn::load`], none if the crate was built from undamaged
    /// files.
    pub fn embedded(dimension: usize, directions: usize) -> Result<Self, NnError> {
        match (dimension, directions) {
            (2, 1) => Self::load(PLANE_SEQUENCES),
            (3, 1) => Self::load(SPACE_SEQUENCES),
            (3, 2) => Self::load(GRIDS),
            _ => Err(NnError::NoNetwork { dimension, directions }),
        }
    }

    /// A network from the bytes of a weights file.
    ///
    /// # Errors
    /// [`NnError::DamagedWeights`], [`NnError::OtherWeights`].
    pub fn load(bytes: &[u8]) -> Result<Self, NnError> {
        Self::of_archive(Archive::from_bytes(bytes)?)
    }

    pub(crate) fn of_archive(mut archive: Archive) -> Result<Self, NnError> {
        let other = |what, found: String, required: &'static str| Err(NnError::OtherWeights { what, found, required });
        let version = archive.metadata.remove("version").unwrap_or_default();
        if version != VERSION {
            return other("format version", version, VERSION);
        }
        let text = archive.metadata.remove("architecture").unwrap_or_default();
        let Some(architecture) = parse(&text) else {
            return other("architecture", text, "that of a parcnn network");
        };
        let layout = Layout::new(architecture);
        let theta = layout.slots.take(&mut archive)?;
        Ok(Self { layout: Arc::new(layout), theta, notes: archive.metadata })
    }

    /// The bytes of a weights file: safetensors, with the architecture, a checksum and the notes as metadata.
    pub fn to_bytes(&self) -> Vec<u8> {
        self.to_archive().to_bytes()
    }

    pub(crate) fn to_archive(&self) -> Archive {
        let mut metadata = self.notes.clone();
        metadata.insert("version".into(), VERSION.into());
        metadata.insert("architecture".into(), name(self.layout.architecture));
        let mut archive = Archive { metadata, ..Archive::default() };
        self.layout.slots.put(&self.theta, &mut archive);
        archive
    }

    /// What kind of network it is.
    pub fn architecture(&self) -> Architecture {
        self.layout.architecture
    }

    /// Number of trained weights.
    pub fn weights(&self) -> usize {
        self.theta.len()
    }

    /// What the file says about its making: command, seed, steps.
    pub fn notes(&self) -> &BTreeMap<String, String> {
        &self.notes
    }

    /// Parameters of a point sequence, shape `(m, N)`, in any units: m increasing numbers from 0 to 1. They are meant for
    /// fits with splines like `space`; see [`SplineSpace::suggested`]. The fit of that space is never worse than at
    /// uniform, centripetal and chord-length parameters.
    ///
    /// The result does not depend on position, size, rotation and reflection of the sequence, up to round-off of single
    /// precision, nor on the number of threads. Closed sequences repeat their first point at the end.
    ///
    /// # Errors
    /// [`NnError::BadGrid`] for fewer than 3 points, or 2 neighbours at the same place; points that are not finite;
    /// [`NnError::WrongShape`] if the network is for another dimension, or for grids; [`NnError::BadOption`];
    /// [`NnError::TooManyPoints`].
    pub fn predict_sequence(&self, points: ArrayView2<'_, f64>, space: SplineSpace) -> Result<Array1<f64>, NnError> {
        let (count, dimension) = points.dim();
        let grid = self.checked_grid(points, [count, 1], 1, dimension)?;
        let state = self.run(grid, space)?;
        Ok(state.uv.iter().map(|uv| uv[0]).collect())
    }

    /// Parameters of a grid of points, shape `(m₁, m₂, 3)`: shape `(m₁, m₂, 2)`, increasing from 0 to 1 along each line.
    /// Otherwise as [`Parcnn::predict_sequence`].
    ///
    /// # Errors
    /// As [`Parcnn::predict_sequence`]; [`NnError::BadGrid`] for lines that run backwards.
    pub fn predict_grid(&self, points: ArrayView3<'_, f64>, space: SplineSpace) -> Result<Array3<f64>, NnError> {
        let (first, second, dimension) = points.dim();
        let rows = points.to_shape((first * second, dimension));
        let rows = rows.map_err(|_| wrong_shape([first * second, dimension], self.layout.architecture.dimension))?;
        let grid = self.checked_grid(rows.view(), [first, second], 2, dimension)?;
        check_orientation(&grid)?;
        let uv = self.run(grid, space)?.uv;
        Ok(Array3::from_shape_fn((first, second, 2), |(i, j, k)| uv[i * second + j][k]))
    }

    /// As [`Parcnn::predict_sequence`], but what the last pass gives, whether or not it is better than classical parameters.
    ///
    /// # Errors
    /// As [`Parcnn::predict_sequence`].
    pub fn predict_unguarded(&self, points: ArrayView2<'_, f64>, space: SplineSpace) -> Result<Array1<f64>, NnError> {
        let (count, dimension) = points.dim();
        let task = checked_task(self.checked_grid(points, [count, 1], 1, dimension)?, space)?;
        Ok(self.last_state(&task).uv.iter().map(|uv| uv[0]).collect())
    }

    fn checked_grid(
        &self,
        points: ArrayView2<'_, f64>,
        size: [usize; 2],
        directions: usize,
        dimension: usize,
    ) -> Result<Grid, NnError> {
        let architecture = self.layout.architecture;
        if dimension != architecture.dimension {
            return Err(wrong_shape([points.nrows(), dimension], architecture.dimension));
        }
        if directions != architecture.directions {
            return Err(NnError::OtherWeights {
                what: "directions",
                found: architecture.directions.to_string(),
                required: if directions == 1 { "1, for sequences" } else { "2, for grids" },
            });
        }
        if points.nrows() > LARGEST_GRID {
            return Err(NnError::TooManyPoints { given: points.nrows(), limit: LARGEST_GRID });
        }
        for (direction, &count) in size.iter().enumerate().take(directions) {
            if count < 3 {
                let problem = "has fewer than 3 points on a line; there is nothing to parameterize";
                return Err(NnError::BadGrid { direction, line: 0, place: count, problem });
            }
        }
        check_finite(points)?;
        let xyz = points.rows().into_iter().map(|p| std::array::from_fn(|k| if k < dimension { p[k] } else { 0.0 }));
        let grid = Grid { xyz: xyz.collect(), size, dimension };
        for direction in 0..directions {
            if let Some(edge) = grid.edge_lengths(direction).iter().position(|&l| l == 0.0) {
                let edges = size[direction] - 1;
                let problem = "has the same place as its predecessor; drop one of the two";
                return Err(NnError::BadGrid { direction, line: edge / edges, place: edge % edges + 1, problem });
            }
        }
        Ok(grid)
    }

    fn run(&self, grid: Grid, space: SplineSpace) -> Result<State, NnError> {
        let SplineSpace { degree, elements } = space;
        let span = tracing::info_span!("parcnn", points = grid.xyz.len(), degree, elements);
        let _guard = span.enter();
        Ok(self.best_state(&checked_task(grid, space)?))
    }

    /// What the last pass gives, without a look back.
    pub(crate) fn last_state(&self, task: &Task) -> State {
        let mut states = vec![task.classical_state()];
        for _ in 0..self.passes() {
            states =
                Pass::<f32>::new(&self.layout, &self.theta, std::slice::from_ref(task), &states, Keep::Nothing).states;
        }
        states.swap_remove(0)
    }

    fn passes(&self) -> usize {
        match self.layout.architecture.form {
            Form::Feedback { .. } => PASSES,
            Form::Published { .. } => 1,
        }
    }

    /// The best among the classical parameters and those of all passes.
    pub(crate) fn best_state(&self, task: &Task) -> State {
        let mut best = task.classical_state();
        let mut states = vec![best.clone()];
        for _ in 0..self.passes() {
            states =
                Pass::<f32>::new(&self.layout, &self.theta, std::slice::from_ref(task), &states, Keep::Nothing).states;
            if states[0].fit.mse < best.fit.mse {
                best = states[0].clone();
            }
        }
        best
    }
}

impl SplineSpace {
    /// A space for sequences or lines of `count` points of which nothing is known: cubic, four points a function.
    pub fn suggested(count: usize) -> Self {
        Self { degree: 3, elements: (count / 4).saturating_sub(3).clamp(1, 8) }
    }
}

fn checked_task(mut grid: Grid, space: SplineSpace) -> Result<Task, NnError> {
    let SplineSpace { degree, elements } = space;
    if !(1..=LARGEST_DEGREE).contains(&degree) {
        return Err(NnError::BadOption { name: "degree", value: degree as f64, range: "from 1 to 8" });
    }
    if elements == 0 || space.functions() > MOST_FUNCTIONS {
        return Err(NnError::BadOption { name: "elements", value: elements as f64, range: "from 1 to 24 − degree" });
    }
    scale_to_unit_box(&mut grid.xyz);
    Ok(Task::new(grid, space))
}

fn wrong_shape(given: [usize; 2], dimension: usize) -> NnError {
    NnError::WrongShape { what: "points", given, required: [given[0], dimension] }
}

fn check_orientation(grid: &Grid) -> Result<(), NnError> {
    for direction in 0..2 {
        let [lines, places] = grid.lines(direction);
        for line in 1..lines {
            let gap = |turned: bool| -> f64 {
                let at = |line, place| grid.xyz[grid.index(direction, line, place)];
                let partner = |place| if turned { places - 1 - place } else { place };
                (0..places).map(|place| distance(at(line - 1, place), at(line, partner(place)))).sum()
            };
            if gap(true) < BACKWARDS * gap(false) {
                let problem = "runs against the line before it; turn it round";
                return Err(NnError::BadGrid { direction, line, place: 0, problem });
            }
        }
    }
    Ok(())
}

/// `feedback 3 2 6 64`: form, N, D, blocks, width; the published form has its degree last.
fn name(architecture: Architecture) -> String {
    let Architecture { dimension, directions, form } = architecture;
    match form {
        Form::Feedback { blocks, width } => format!("feedback {dimension} {directions} {blocks} {width}"),
        Form::Published { degree, blocks, width } => {
            format!("published {dimension} {directions} {blocks} {width} {degree}")
        }
    }
}

fn parse(name: &str) -> Option<Architecture> {
    let mut words = name.split(' ');
    let kind = words.next()?;
    let numbers: Vec<usize> = words.map(str::parse).collect::<Result<_, _>>().ok()?;
    let (dimension, directions, form) = match (kind, &numbers[..]) {
        ("feedback", &[n, d, blocks, width]) => (n, d, Form::Feedback { blocks, width }),
        ("published", &[n, d, blocks, width, degree]) => (n, d, Form::Published { degree, blocks, width }),
        _ => return None,
    };
    let sizes = match form {
        Form::Feedback { blocks, width } => [blocks, width, 1],
        Form::Published { degree, blocks, width } => [blocks, width, degree],
    };
    // A damaged file must not ask for more memory than there is.
    let sensible = (2..=3).contains(&dimension)
        && (1..=2).contains(&directions)
        && sizes.iter().all(|s| (1..=1024).contains(s))
        && sizes[2] <= LARGEST_DEGREE;
    sensible.then_some(Architecture { dimension, directions, form })
}

#[cfg(test)]
#[path = "model_tests.rs"]
mod tests;
