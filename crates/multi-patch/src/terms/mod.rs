//! The terms of the objective, each with its energy, and what it adds to the equations of a step.

mod angles;
#[cfg(test)]
mod check;
mod data;
mod plates;

pub(crate) use angles::{Angles, Form, angle_energy};
pub(crate) use data::Data;
pub(crate) use plates::Plates;
