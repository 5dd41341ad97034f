//! What is typed for whole parts.

use clap::Args;
use reconstruct::{LayoutChoice, Sharp, Smoothness, SolidOptions};

#[derive(Args, Debug)]
#[command(next_help_heading = "Whole parts")]
pub(crate) struct SolidArgs {
    /// How a part is cut into faces: one, a sheet of four sides; patches of four sides, found by the program or of a layout file
    /// (.json, .json.gz), each a face, and a closed mesh one solid; auto, patches for one closed mesh that STEP files are made of, one
    /// sheet otherwise. With patches, --mesh counts the elements along each side of a patch (4 unless told, more where the tolerance
    /// asks for it); the tolerance is 0.3 % unless told.
    #[arg(long, value_name = "auto|one|patches|FILE", default_value_t = LayoutChoice::Auto)]
    pub(crate) layout: LayoutChoice,
    /// Weight of smooth joins between faces against distances: 1, 3 for finer ones, or off.
    #[arg(long, value_name = "OMEGA", default_value_t = Smoothness::Weight(1.0), allow_hyphen_values = true)]
    pub(crate) smoothness: Smoothness,
    /// Creases: edges of the mesh sharper than this angle, in degrees; off, for none; auto, 40° if the mesh has creases at all, which
    /// coarse and noisy meshes of smooth shapes have not.
    #[arg(long, value_name = "auto|ANGLE|off", default_value_t = SolidOptions::default().sharp)]
    pub(crate) sharp: Sharp,
}
