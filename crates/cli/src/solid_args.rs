//! What is typed for whole parts.

use std::path::PathBuf;

use clap::Args;
use reconstruct::{Sharp, Smoothness, SolidOptions};

#[derive(Args, Debug)]
#[command(next_help_heading = "Whole parts")]
pub(crate) struct SolidArgs {
    /// Layout of a whole part in patches of four sides, JSON (.json, .json.gz): every patch becomes a face, and a closed mesh one
    /// solid. --mesh counts the elements along each side of a patch; the tolerance is 0.3 % unless told.
    #[arg(long, value_name = "FILE")]
    pub(crate) layout: Option<PathBuf>,
    /// Weight of smooth joins between faces against distances: 1, 3 for finer ones, or off.
    #[arg(long, value_name = "OMEGA", default_value_t = Smoothness::Weight(1.0), allow_hyphen_values = true, requires = "layout")]
    pub(crate) smoothness: Smoothness,
    /// Angle, in degrees, from which on a layout's arc along an edge of the mesh stays sharp; or off, for none.
    #[arg(long, value_name = "ANGLE", default_value_t = SolidOptions::of_layout(PathBuf::new()).sharp, requires = "layout")]
    pub(crate) sharp: Sharp,
}
