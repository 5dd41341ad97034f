//! Fitting with moving parameters: foot points, alternating methods and joint optimization.

mod alternating;
mod constraint;
mod error;
mod fold;
mod foot_point;
mod frame;
mod joint;
mod lbfgs;
mod moving;
mod options;
mod patch;
mod system;

pub use constraint::{Boundary, Constraints};
pub use error::Error;
pub use foot_point::{Descent, FootPointOptions, FootPointReport, FootPoints, Start, foot_points, project};
pub use moving::{Moves, MovingFit};
pub use options::{Blend, Distance, JointOptions, Method, Options, Schedule};
