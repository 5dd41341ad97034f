//! What is typed for whole parts.

use clap::Args;
use reconstruct::{Error, LayoutChoice, Sharp, Smoothness};

#[derive(Args, Debug)]
#[command(next_help_heading = "Whole parts")]
pub(crate) struct SolidArgs {
    /// How a part is cut into faces: one sheet of four sides; patches of four sides, each a face; auto, patches for a closed mesh.
    ///
    /// Patches are found by the program, or are those of a layout file (.json, .json.gz); a closed mesh becomes one solid. auto takes them
    /// for one closed mesh that STEP files are made of. With patches, --mesh counts the elements along each side of a patch (4 unless told, more where the tolerance
    /// asks for it); the tolerance is 0.3 % unless told.
    #[arg(long, value_name = "auto|one|patches|FILE", default_value_t = LayoutChoice::Auto)]
    pub(crate) layout: LayoutChoice,
    /// Weight of smooth joins between faces against distances: 1, 3 for finer ones, or off. [default: 1]
    #[arg(long, value_name = "OMEGA", allow_hyphen_values = true)]
    pub(crate) smoothness: Option<Smoothness>,
    /// Creases: edges of the mesh sharper than this angle, in degrees; off, for none; auto, 40° if the mesh has creases at all, which
    /// coarse and noisy meshes of smooth shapes have not. [default: auto]
    #[arg(long, value_name = "auto|ANGLE|off")]
    pub(crate) sharp: Option<Sharp>,
}

impl SolidArgs {
    /// Whether an option was given that counts for whole parts only.
    pub(crate) fn is_used(&self) -> bool {
        self.smoothness.is_some() || self.sharp.is_some()
    }

    /// An option was typed that nothing would come of, where no whole part is made.
    pub(crate) fn check_unused(&self) -> Result<(), Error> {
        let smoothness = self.smoothness.map(|given| ("--smoothness", given.to_string()));
        let unused = smoothness.or(self.sharp.map(|given| ("--sharp", given.to_string())));
        unused.map_or(Ok(()), |(option, given)| {
            let allowed = "with --layout patches or a layout file, or for one closed mesh of which a STEP file is made";
            Err(Error::OptionRange { option, given, allowed })
        })
    }
}
