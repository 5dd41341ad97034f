//! Tests of what the crate offers, in one program: each of its own would be linked anew.

mod closed;
mod foot_points;
mod methods;
mod own_term;
mod quasi;
mod square_map;
mod weighted;
