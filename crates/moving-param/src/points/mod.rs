//! One point at a time: the map around it, its foot point, and where its parameter may go.

pub(crate) mod check;
pub(crate) mod constraint;
pub(crate) mod descent;
pub(crate) mod foot_point;
pub(crate) mod frame;
pub(crate) mod patch;
pub(crate) mod place;
pub(crate) mod samples;
pub(crate) mod vector;
