//! Options, as they are typed and as they stand in the report.

mod choices;
mod fit;
mod parameters;
mod policy;
mod quasi;
mod reweighting;
pub(crate) mod typed;

pub use choices::{BlendChoice, BoundaryChoice, Energy, LambdaChoice, Mark, Method, Samples, Schema, Tolerance};
pub use fit::FitOptions;
pub use parameters::{
    Clean, Closed, Crop, Domain, GivenCorners, Networks, ParameterChoice, ParameterOptions, RadiusChoice, Refine,
    SideRule, ToldSpline,
};
pub use policy::Policy;
pub use quasi::{LocalRule, QuasiOptions};
pub use reweighting::{LossChoice, MarkerChoice, ReweightingOptions, UpdateChoice};
pub use typed::{Pair, ParseOptionError};
pub(crate) use typed::{all_shown, named, parse_error, range, serialize_as_typed, shown};
