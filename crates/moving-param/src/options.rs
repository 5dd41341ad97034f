//! Options of the fits with moving parameters.

use crate::{Boundary, Error, FootPointOptions};

/// How a fit with moving parameters works.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// The method.
    pub method: Method,
    /// What happens to points on the boundary.
    pub boundary: Boundary,
    /// How foot points are sought.
    pub foot_points: FootPointOptions,
    /// Distance at which a point counts as met, in units of the points: where all are met, nothing moves any more.
    pub tolerance: f64,
    /// Whether corrections are undone and postponed to the next refinement where they do harm.
    pub guard: bool,
}

impl Default for Options {
    /// The joint Levenberg–Marquardt method with its guard, boundary points kept on their sides.
    fn default() -> Self {
        Self {
            method: Method::Joint(JointOptions::default()),
            boundary: Boundary::Kept,
            foot_points: FootPointOptions::default(),
            tolerance: 0.0,
            guard: true,
        }
    }
}

/// The methods.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Method {
    /// Foot points and coefficients in turn (Imperatore 2024, §5.1.2, Algorithm 7): A-PDM, A-TDM and A-HDM.
    Alternating {
        /// What the coefficients minimize.
        distance: Distance,
        /// Corrections after each refinement.
        corrections: usize,
    },
    /// Coefficients and parameters together, by Levenberg–Marquardt steps from which the parameters are eliminated.
    Joint(JointOptions),
    /// J-PDM: coefficients and parameters together, by L-BFGS (Imperatore 2024, §5.3), in unknowns measured by the matrix of a
    /// joint step, anew after every 30 iterations.
    JointLbfgs(Schedule),
    /// Coefficients, and one smooth map of the parameter domain that moves all parameters: to be compared with, where
    /// parameters that move one by one would follow noise. Sides are kept, whatever [`Options::boundary`] says, and so are seams.
    SquareMap(SquareMapOptions),
}

/// The distance that the coefficients minimize while the parameters rest.
#[derive(Clone, Debug, PartialEq)]
pub enum Distance {
    /// To the point of the map (5.4): A-PDM.
    Point,
    /// To the tangent line or plane (5.12): A-TDM. `damping` times the mean diagonal entry of the matrix is added to its
    /// diagonal (5.14); here it holds the *step* of the coefficients, so that it does not bias the result.
    Tangent {
        /// Relative damping.
        damping: f64,
    },
    /// `γ_i` times the squared point distance plus `1 − γ_i` times the squared tangent distance (5.15): A-HDM.
    Hybrid(Blend),
}

/// The weights `γ_i` of A-HDM.
#[derive(Clone, Debug, PartialEq)]
pub enum Blend {
    /// `d_i / (2 max d)`.
    ErrorDriven,
    /// `d_i / (d_i + ρ_i)`, `ρ_i` the smallest radius of curvature at each point: its principal curvature of largest
    /// magnitude, one number per point in their order, in units of the points.
    CurvatureDriven(Vec<f64>),
    /// The same number for all points, in [0, 1].
    Constant(f64),
}

/// Settings of the joint Levenberg–Marquardt method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointOptions {
    /// Largest number of steps after each refinement.
    pub max_steps: usize,
    /// Steps end where one lowers the objective by less than this share.
    pub decrease: f64,
    /// Newton steps towards the foot point after each step, on the stepped map; 0 for the plain method.
    pub polish: usize,
    /// Rounds in which the few points that are still outside the tolerance get more weight, so that cells need not be
    /// refined for them.
    pub emphasis: usize,
    /// Stiffness of springs that hold the parameters where they started: a move by some length along the surface costs as
    /// much as a distance of that length times its root. 0 for none.
    pub stiffness: f64,
    /// Stiffness of springs that let the parameter of a point move as those of its neighbours do, in the same measure. Needs triangles
    /// ([`crate::MovingFit::with_centres`]). 0 for none.
    pub cohesion: f64,
    /// Weight of the centres of triangles between the points, and of the edges of their rim, where points leave cells empty: they
    /// keep the surface from swinging between points and beyond them, but are no data: errors do not fall to round-off. Needs triangles
    /// ([`crate::MovingFit::with_centres`]). 0 for none.
    pub between: f64,
    /// How much it costs that a surface in space folds: for each point of the part that folds, times the mean squared distance
    /// before each step, or the squared tolerance if that is larger. 0 for nothing.
    pub regularity: f64,
}

/// Stiffness of the springs that hold moving parameters where they started. Parameters laid out well need to move little;
/// without springs they open voids between them. Of 0, 1e-4 and 1e-3, on 14 scans, this needed the fewest control points
/// at 0.5 %, and all three about as many at 0.1 %.
const STIFFNESS: f64 = 1e-4;

/// Stiffness of the springs between neighbours. Of 0, 0.05, 0.1, 0.2, 0.3 and 1, on eight scans, 0.1 was the least with which hardly any
/// creases remained; from 0.2 on more control points are needed.
const COHESION: f64 = 0.1;

/// Weight of the centres of triangles between points. Of 0.03, 0.1 and 0.3, on seven scans at 0.5 % and 0.1 %, this left the
/// fewest sharp turns for about the same control points; 0 leaves two to four times as many.
const BETWEEN: f64 = 0.3;

impl JointOptions {
    /// What `thb fit` runs for surfaces, and [`JointOptions::default`] gives. Springs between neighbours and centres of triangles take
    /// part only where there are triangles.
    pub const DEFAULT: Self =
        Self { stiffness: STIFFNESS, cohesion: COHESION, between: BETWEEN, ..Self::WITHOUT_SPRINGS };

    /// The same with distances, smoothing and lost area only: for curves, whose parameters have an order already, and where points are
    /// to be met to round-off.
    pub const WITHOUT_SPRINGS: Self = Self {
        max_steps: 10,
        decrease: 3e-2,
        polish: 2,
        emphasis: 2,
        stiffness: 0.0,
        cohesion: 0.0,
        between: 0.0,
        regularity: 100.0,
    };
}

impl Default for JointOptions {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of the method whose parameters are moved by one map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SquareMapOptions {
    /// Control points of the map in each direction, 3 or more; its degree is 3, or 2 where there are only 3 of them.
    pub per_side: usize,
    /// Largest number of steps after each refinement.
    pub max_steps: usize,
    /// Steps end where one lowers the objective by less than this share.
    pub decrease: f64,
    /// Weight of the barrier `J − 1 − ln J` on the Jacobian determinant J of the map, as a share of what it would cost if all
    /// points were a tolerance away. 0 for none; steps to where J is not positive are refused in any case.
    pub barrier: f64,
}

impl Default for SquareMapOptions {
    /// 8 × 8 control points.
    fn default() -> Self {
        Self { per_side: 8, max_steps: 20, decrease: 1e-3, barrier: 1e-2 }
    }
}

/// Most control points of a map per direction: its equations are dense.
const MAX_PER_SIDE: usize = 32;

/// When L-BFGS stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Schedule {
    /// The same limits for all spaces: schedule (a).
    Constant {
        /// Norm of the gradient at which to stop.
        gradient: f64,
        /// Largest number of iterations.
        max_iterations: u64,
    },
    /// Limits that tighten with the number of levels ℓ, counted from 0 (5.22): `gradient / 2^ℓ` and `max_iterations · 2^ℓ`;
    /// schedule (b).
    PerLevel {
        /// Norm of the gradient on level 0.
        gradient: f64,
        /// Number of iterations on level 0.
        max_iterations: u64,
    },
}

impl Schedule {
    /// Schedule (a) of Imperatore 2024, Example 5.3.3 (a).
    pub const A: Self = Self::Constant { gradient: 1e-6, max_iterations: 500 };

    /// Schedule (b) of Imperatore 2024, (5.22).
    pub const B: Self = Self::PerLevel { gradient: 1e-5, max_iterations: 200 };

    /// Gradient norm and number of iterations for a space of `levels` levels.
    pub(crate) fn limits(self, levels: usize) -> (f64, u64) {
        match self {
            Self::Constant { gradient, max_iterations } => (gradient, max_iterations),
            Self::PerLevel { gradient, max_iterations } => {
                let doubled = levels.saturating_sub(1).min(u32::BITS as usize - 1) as u32;
                (gradient * 0.5_f64.powi(doubled as i32), max_iterations << doubled)
            }
        }
    }
}

impl Options {
    /// Checks the options for `points` points of dimension `dim` and maps from dimension `parameters`.
    pub(crate) fn check(&self, parameters: usize, dim: usize, points: usize) -> Result<(), Error> {
        let number = |name, value: f64, valid: bool, allowed| {
            if valid { Ok(()) } else { Err(Error::Option { name, value, allowed }) }
        };
        number("tolerance", self.tolerance, self.tolerance >= 0.0, "at least 0")?;
        let normal = || if dim > parameters { Ok(()) } else { Err(Error::NoNormal { parameters, points: dim }) };
        match &self.method {
            Method::Alternating { distance: Distance::Point, .. } => Ok(()),
            Method::Alternating { distance: Distance::Tangent { damping }, .. } => {
                normal()?;
                number("damping", *damping, *damping >= 0.0, "at least 0")
            }
            Method::Alternating { distance: Distance::Hybrid(blend), .. } => {
                normal()?;
                match blend {
                    Blend::ErrorDriven => Ok(()),
                    Blend::Constant(gamma) => number("γ", *gamma, (0.0..=1.0).contains(gamma), "between 0 and 1"),
                    Blend::CurvatureDriven(curvatures) if curvatures.len() == points => Ok(()),
                    Blend::CurvatureDriven(curvatures) => {
                        Err(Error::Shape { what: "curvatures", given: curvatures.len(), expected: points })
                    }
                }
            }
            Method::Joint(joint) => {
                normal()?;
                number("decrease", joint.decrease, joint.decrease >= 0.0, "at least 0")?;
                number("stiffness", joint.stiffness, joint.stiffness >= 0.0, "at least 0")?;
                number("cohesion", joint.cohesion, joint.cohesion >= 0.0, "at least 0")?;
                number("between", joint.between, joint.between >= 0.0, "at least 0")?;
                number("regularity", joint.regularity, joint.regularity >= 0.0, "at least 0")
            }
            Method::SquareMap(square) => {
                number("barrier", square.barrier, square.barrier >= 0.0, "at least 0")?;
                number("decrease", square.decrease, square.decrease >= 0.0, "at least 0")?;
                let per_side = square.per_side;
                number("control points per side", per_side as f64, (3..=MAX_PER_SIDE).contains(&per_side), "3 to 32")
            }
            Method::JointLbfgs(schedule) => {
                let (gradient, _) = schedule.limits(1);
                number("gradient", gradient, gradient >= 0.0, "at least 0")
            }
        }
    }
}
