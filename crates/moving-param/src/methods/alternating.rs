//! Foot points and coefficients in turn: A-PDM, A-TDM, A-HDM (Imperatore 2024, §5.1.2).

use fit_ls::SortedPoints;
use thb_core::SplineMap;

use crate::frame::{Frame, Share, columns, frames};
use crate::moving::{Moves, MovingFit};
use crate::points::patch::dot;
use crate::system::{boundary_functions, stepped};
use crate::{Blend, Distance, Error};

/// Growth of the damping where the equations of tangent distances are singular, and its first value there.
const DAMPING_GROWTH: f64 = 100.0;

/// First damping of singular equations, relative to the mean diagonal entry.
const FIRST_DAMPING: f64 = 1e-9;

/// Attempts to make singular equations solvable by damping.
const ATTEMPTS: usize = 5;

impl<const D: usize> MovingFit<D> {
    pub(crate) fn alternate(
        &mut self,
        mut map: SplineMap<D>,
        distance: &Distance,
        corrections: usize,
        moves: &mut Moves,
    ) -> Result<SplineMap<D>, Error> {
        for _ in 0..corrections {
            self.correct(&map, moves)?;
            map = match distance {
                Distance::Point => self.fit.fit(&map.space().clone())?,
                Distance::Tangent { damping } => self.tangent_step(&map, None, *damping)?,
                Distance::Hybrid(blend) => self.tangent_step(&map, Some(blend), 0.0)?,
            };
        }
        if corrections > 0 && *distance != Distance::Point {
            // Steps of tangent distances leave errors along the surface, which no refinement should follow.
            self.correct(&map, moves)?;
        }
        Ok(map)
    }

    /// The map whose coefficients minimize tangent distances, or a blend of them with point distances, in the frames of
    /// the given map. The boundary is fitted first, on its own (Remark 25).
    fn tangent_step(&mut self, map: &SplineMap<D>, blend: Option<&Blend>, damping: f64) -> Result<SplineMap<D>, Error> {
        let space = map.space().clone();
        let constraints = self.constraints();
        let mut system = self.take_system(&space)?;
        let points = self.fit.points();
        let frames = frames(map, points)?;
        let gamma = gammas(&frames, points, blend);
        let coefficients = map.coefficients().to_owned();
        let held: Vec<usize> =
            (0..points.len()).filter(|&at| constraints.is_held(points.order()[at] as usize)).collect();
        let boundary = boundary_functions(&space);
        let fixed = match held.is_empty() {
            true => None,
            false => system.boundary_step(&space, points, &frames, &held, &coefficients, &boundary)?,
        };
        let weight = |at: usize| points.weights().map_or(1.0, |w| w[at]);
        let columns = columns(points, &frames, &constraints, |at| {
            let on_boundary = constraints.is_held(points.order()[at] as usize);
            match (on_boundary, &fixed) {
                // Without equations of its own the boundary is fitted together with the rest, by point distances.
                (true, None) => Share { point: 1.0, damping: 0.0, weight: weight(at) },
                (true, Some(_)) => Share { point: 1.0, damping: 0.0, weight: 0.0 },
                (false, _) => Share { point: gamma[at], damping: 0.0, weight: weight(at) },
            }
        });
        let given = fixed.unwrap_or_default();
        // The matrix of point distances has the sum of the weights of a function's points on its diagonal.
        let scale = points.total_weight() / boundary.len() as f64;
        let mut ridge = damping * scale;
        let equations = system.equations(map, points, &columns)?;
        for _ in 0..ATTEMPTS {
            if let Some(step) = system.step(&equations, ridge, &given, |_, _| ())? {
                self.system = Some((space.clone(), system));
                return stepped(&space, &coefficients, &step);
            }
            ridge = (ridge * DAMPING_GROWTH).max(FIRST_DAMPING * scale);
        }
        tracing::warn!(ridge, "tangent distances do not determine the coefficients: point distances instead");
        Ok(self.fit.fit(&space)?)
    }
}

/// The weights γ of the point distance, in the order of the sorted points. Points of weight 0 are left out of the largest distance.
fn gammas<const D: usize>(frames: &[Frame<D>], points: &SortedPoints<D>, blend: Option<&Blend>) -> Vec<f64> {
    let distances = || frames.iter().map(|f| dot(&f.residual, &f.residual).sqrt());
    let counts = |at: usize| points.weights().is_none_or(|weights| weights[at] > 0.0);
    match blend {
        None => vec![0.0; frames.len()],
        Some(Blend::Constant(gamma)) => vec![*gamma; frames.len()],
        Some(Blend::ErrorDriven) => {
            let counted = distances().enumerate().filter(|&(at, _)| counts(at));
            let largest = counted.map(|(_, d)| d).fold(f64::MIN_POSITIVE, f64::max);
            distances().map(|d| (d / (2.0 * largest)).min(0.5)).collect()
        }
        Some(Blend::CurvatureDriven(curvatures)) => distances()
            .zip(points.order())
            // d / (d + 1/κ), written so that flat points have γ = 0.
            .map(|(d, &index)| d * curvatures[index as usize].abs() / (d * curvatures[index as usize].abs() + 1.0))
            .collect(),
    }
}
