//! The two stages of a fit.

use std::sync::Arc;

use ndarray::Array2;
use point_cloud::vec3::{norm, sub};
use rayon::prelude::*;
use thb_core::{CellSpace, MultiPatchSpace, SplineMap, SymmetricPattern};

use crate::arc_points::{ArcElement, arc_elements};
use crate::equations::Solver;
use crate::feet::follow;
use crate::problem::Problem;
use crate::samples::Samples;
use crate::term::{State, Term};
use crate::terms::{Angles, Data, Form, Plates, angle_energy};
use crate::{Error, Options, Surface};

/// Weight of the plates in the first step, and what it is multiplied by from step to step: parameters settle on a stiff surface first.
///
/// Calibrated: on layouts of a blob, a double torus, a figure and a mechanical part, by folds and the largest angle. A factor of 0.18 leaves
/// more folds at short arcs of the part; a first weight of 0.01 pulls its corners off.
const FIRST_PLATES: f64 = 1e-4;
const PLATES_FACTOR: f64 = 0.5;

/// ω of the whole vector v in the first stage of a second attempt, as a share of what is asked for up to 1, and in its Gauss–Newton steps.
///
/// Calibrated: as [`FIRST_PLATES`], when all attempts had this form and the other was a sine with lengths held: without it in the steps two
/// of the four folded, with three and thirty times as much the largest angles were larger by some tenths and by a factor of 2 to 3. Not
/// measured anew since it is the second attempt.
const FIRST_SHARE: f64 = 0.1;
const HELD_SHARE: f64 = 0.018;

/// h, the length that angles are multiplied by, is this times the diagonal / (√P n), for P patches of n × n elements: about three times the
/// size of an element.
///
/// Calibrated: on 20 closed meshes, `thb fit PART.off --smoothness 1` and `3` when it was the size itself: the threefold weight
/// divides the 99th percentile of angles by 2.8 in the median, and that of distances grows by 1.1 % at most. The largest angle grows on
/// three (`bull`, `camel`, `joint`).
const ANGLE_LENGTH: f64 = 2.1;

/// One step of a fit, for logs and reports.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Step {
    /// μ.
    pub plates: f64,
    /// ω.
    pub smoothness: f64,
    /// The value of the data term after the step, before parameters follow, in squared diagonals.
    pub data: f64,
    /// The value of the angle term, in squared diagonals.
    pub angles: f64,
}

/// A fitted surface.
#[derive(Debug)]
pub struct Fitted {
    /// The surface.
    pub surface: Surface,
    /// The samples at their foot points.
    pub samples: Samples,
    /// The distance of each sample from the surface at its foot point.
    pub distances: Vec<f64>,
    /// What happened.
    pub steps: Vec<Step>,
}

/// The fit between two steps.
pub(crate) struct Fit<'a> {
    pub(crate) space: &'a Arc<MultiPatchSpace>,
    pub(crate) sharp: &'a [bool],
    elements: Arc<[ArcElement]>,
    form: Form,
    pub(crate) plates: Plates,
    solver: Solver,
    pub(crate) samples: Samples,
    /// In diagonals.
    pub(crate) coefficients: Vec<f64>,
    /// (ω h)² / n_E for ω = 1.
    unit_of_angles: f64,
    steps: Vec<Step>,
}

/// Fits a surface to samples.
///
/// First data and plates while μ falls, with a pass of foot points a step; then Gauss–Newton steps with the angles; then these again with
/// stiffer plates where the surface turns over. The result does not depend on the number of threads.
///
/// # Errors
/// [`Error`].
pub fn fit(problem: Problem<'_>, options: &Options) -> Result<Fitted, Error> {
    options.check()?;
    problem.check()?;
    let (functions, samples) = (problem.space.n_functions(), problem.samples.len());
    let span = tracing::info_span!("multi_patch_fit", functions, samples);
    let _guard = span.enter();
    let outward = problem.outward;
    let attempt = |form| -> Result<(Fit<'_>, usize), Error> {
        let problem = Problem { samples: problem.samples.clone(), ..problem };
        let mut fit = Fit::new(problem, form, options)?;
        fit.first_stage(options)?;
        fit.second_stage(options)?;
        let turned = fit.unfold(outward, options)?;
        Ok((fit, turned))
    };
    let (mut fit, turned) = attempt(Form::AcrossPlanes)?;
    if turned > 0 && options.smoothness > 0.0 {
        let (other, of_other) = attempt(Form::Whole)?;
        tracing::info!(turned, of_other, "the whole form");
        if of_other < turned {
            fit = other;
        }
    }
    fit.finish(options)
}

impl<'a> Fit<'a> {
    fn new(problem: Problem<'a>, form: Form, options: &Options) -> Result<Self, Error> {
        let Problem { space, sharp, sizes, mut samples, .. } = problem;
        // Lengths in diagonals; coordinates are small already where parts lie near the origin.
        samples.iter_mut().for_each(|sample| sample.point = sample.point.map(|x| x / options.diagonal));
        let samples = Samples::new(space, samples)?;
        let elements = arc_elements(space, sharp)?;
        let groups: Vec<Vec<u32>> = elements.iter().map(|element| element.functions.clone()).collect();
        let pattern = SymmetricPattern::with_groups(space.as_ref(), &groups);
        let smooth_arcs = elements.chunk_by(|a, b| a.arc == b.arc).count();
        let size = ANGLE_LENGTH / (space.n_cells() as f64).sqrt();
        // All control points in the centre: the first step is a fit from nothing.
        let mut centre = [0.0; 3];
        for sample in samples.as_slice() {
            (0..3).for_each(|k| centre[k] += sample.weight * sample.point[k] / samples.total_weight());
        }
        let coefficients = centre.repeat(space.n_functions());
        Ok(Self {
            space,
            sharp,
            plates: Plates::new(space, &pattern, sizes),
            solver: Solver::new(&pattern)?,
            samples,
            coefficients,
            unit_of_angles: size * size / smooth_arcs.max(1) as f64,
            elements: elements.into(),
            form,
            steps: Vec::new(),
        })
    }

    fn set_plates(&mut self, plates: f64) {
        self.plates.set_weight(plates / self.space.n_patches() as f64);
    }

    pub(crate) fn surface(&self, coefficients: &[f64], unit: f64) -> Result<Surface, Error> {
        let values = Array2::from_shape_fn((self.space.n_functions(), 3), |(i, k)| unit * coefficients[3 * i + k]);
        Ok(SplineMap::new(Arc::clone(self.space), values)?)
    }

    /// The angle term at the surface as it is, unless it has no weight.
    fn angles(&self, smoothness: f64, form: Form) -> Option<Angles> {
        let scale = smoothness * smoothness * self.unit_of_angles;
        (scale > 0.0).then(|| Angles::frozen(Arc::clone(&self.elements), scale, form, &self.coefficients))
    }

    /// Moves the coefficients to the least sum of data, plates and angles, all of them quadratic.
    fn step(&mut self, angles: &[Angles]) -> Result<(), Error> {
        let mut equations = self.solver.equations(!angles.is_empty())?;
        let state = State { space: self.space, coefficients: &self.coefficients, samples: &self.samples };
        Data.linearize(&state, &mut equations);
        self.plates.linearize(&state, &mut equations);
        angles.iter().for_each(|angles| angles.linearize(&state, &mut equations));
        let step = self.solver.solve(equations)?;
        self.coefficients.iter_mut().zip(step).for_each(|(c, d)| *c += d);
        Ok(())
    }

    /// Parameters follow the surface.
    fn follow(&mut self) -> Result<(), Error> {
        let surface = self.surface(&self.coefficients, 1.0)?;
        follow(&mut self.samples, &surface, self.sharp);
        Ok(())
    }

    fn note(&mut self, plates: f64, smoothness: f64) {
        let state = State { space: self.space, coefficients: &self.coefficients, samples: &self.samples };
        let angles = angle_energy(&self.elements, self.unit_of_angles, &self.coefficients);
        let step = Step { plates, smoothness, data: Data.energy(&state), angles };
        tracing::info!(?step, "step");
        self.steps.push(step);
    }

    /// μ falls to what is asked for, without the angle term in a first attempt.
    fn first_stage(&mut self, options: &Options) -> Result<(), Error> {
        let mut plates = FIRST_PLATES.max(options.plates);
        loop {
            let is_first = self.steps.is_empty();
            self.set_plates(plates);
            let smoothness = match self.form {
                Form::Whole if !is_first => FIRST_SHARE * options.smoothness.min(1.0),
                _ => 0.0,
            };
            self.step(self.angles(smoothness, Form::Whole).as_slice())?;
            self.note(plates, smoothness);
            self.follow()?;
            if plates <= options.plates && !is_first {
                return Ok(());
            }
            plates = (plates * PLATES_FACTOR).max(options.plates);
        }
    }

    /// Gauss–Newton steps with the angles.
    pub(crate) fn second_stage(&mut self, options: &Options) -> Result<(), Error> {
        self.set_plates(options.plates);
        let held = match self.form {
            Form::AcrossPlanes => 0.0,
            Form::Whole => HELD_SHARE * options.smoothness.min(1.0),
        };
        for _ in 0..options.angle_steps {
            let angles = self.angles(options.smoothness, Form::AcrossPlanes);
            let terms: Vec<Angles> = angles.into_iter().chain(self.angles(held, Form::Whole)).collect();
            if terms.is_empty() {
                break;
            }
            self.step(&terms)?;
            self.note(options.plates, options.smoothness);
            self.follow()?;
        }
        Ok(())
    }

    fn finish(self, options: &Options) -> Result<Fitted, Error> {
        let unit = options.diagonal;
        let surface = self.surface(&self.coefficients, unit)?;
        let Self { samples, steps, .. } = self;
        let samples = samples.scaled(unit);
        let bezier = surface.bezier();
        let places = samples.as_slice().par_iter().zip(samples.cells());
        let distances =
            places.map(|(s, &cell)| norm(sub(bezier.jet(cell as usize, s.place.u).value, s.point))).collect();
        Ok(Fitted { surface, samples, distances, steps })
    }
}
