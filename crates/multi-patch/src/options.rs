//! Options of the fit of several patches.

use crate::Error;

/// How a surface of several patches is fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// μ, the weight of the plates, in units in which the diagonal is 1.
    pub plates: f64,
    /// ω, the weight of the angles at smooth arcs: 1, or 3 where smoothness counts more; 0 leaves kinks.
    pub smoothness: f64,
    /// Most Gauss–Newton steps on the angles.
    pub angle_steps: usize,
    /// Diagonal of the part, the unit of length of the objective.
    pub diagonal: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self { plates: 1e-6, smoothness: 1.0, angle_steps: 6, diagonal: 1.0 }
    }
}

impl Options {
    /// Refuses what has no meaning.
    ///
    /// # Errors
    /// [`Error::Option`].
    pub fn check(&self) -> Result<(), Error> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        if !positive(self.plates) {
            return Err(Error::Option { name: "plates", value: self.plates, range: "a positive number" });
        }
        if !(self.smoothness >= 0.0 && self.smoothness.is_finite()) {
            return Err(Error::Option {
                name: "smoothness",
                value: self.smoothness,
                range: "zero or a positive number",
            });
        }
        if !positive(self.diagonal) {
            return Err(Error::Option { name: "diagonal", value: self.diagonal, range: "a positive number" });
        }
        Ok(())
    }
}
