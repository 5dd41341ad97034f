//! Every number that decides between the results of several methods.

use serde::Serialize;

/// Declares the thresholds once: the fields of [`Policy`], their defaults, their reasons and the commands that show what others do.
macro_rules! thresholds {
    ($($(#[doc = $doc:literal])* $name:ident = $value:literal, $command:literal;)*) => {
        /// What a fit by several methods decides by.
        #[derive(Clone, Copy, Debug, PartialEq, Serialize)]
        pub struct Policy {
            $($(#[doc = $doc])* pub $name: f64,)*
        }

        impl Default for Policy {
            fn default() -> Self {
                Self { $($name: $value,)* }
            }
        }

        impl Policy {
            /// The names of the thresholds, each with the command that shows what other values do.
            pub const COMMANDS: &'static [(&'static str, &'static str)] = &[$((stringify!($name), $command),)*];

            /// The same with one threshold changed; `None` if there is none of that name.
            #[must_use]
            pub fn with(mut self, name: &str, value: f64) -> Option<Self> {
                match name {
                    $(stringify!($name) => self.$name = value,)*
                    _ => return None,
                }
                Some(self)
            }
        }
    };
}

thresholds! {
    /// Control points, as a share of those of what is kept so far, that a surface as good may have at most to be taken instead. Parameters
    /// that stay where they were laid out leave fewer surprises, so that they go first where hardly anything is gained.
    most_control_points = 0.95, "cargo xtask corpus --data DIR --vary most_control_points=0.8,0.9,0.95,1";
    /// Spaces that fixed parameters are fitted in before moving ones are tried, which nearly always need fewer control points: as many
    /// as tell how the error falls.
    first_spaces = 3.0, "cargo xtask corpus --data DIR --vary first_spaces=1,2,3,4";
    /// Share of the control points of fixed parameters, at the same root mean square distance, from which on moving parameters are given up.
    hopeless = 0.95, "cargo xtask corpus --data DIR --vary hopeless=0.85,0.9,0.95,1,1.1";
    /// The same for parameters that move freely, beside those that move with their neighbours.
    hopeless_freely = 0.85, "cargo xtask corpus --data DIR --vary hopeless_freely=0.75,0.8,0.85,0.9,0.95";
    /// Control points, as a share of the points, that a candidate may have if nothing has reached the tolerance: with as many as points a
    /// surface follows any noise.
    most_per_point = 0.9, "cargo xtask corpus --data DIR --vary most_per_point=0.7,0.9,1";
    /// Largest distance between surface and scan, in diagonals, that is no defect whatever the other candidates have, and that no warning
    /// tells: gaps between the points of a scan are smaller.
    far = 0.07, "cargo xtask corpus --data DIR --vary far=0.035,0.07,0.14";
    /// How much further from the scan than a surface with fixed parameters a candidate may lie, as a factor.
    further = 1.1, "cargo xtask corpus --data DIR --vary further=1.05,1.1,1.2";
    /// Share of neighbouring samples between which the normal may turn by more than a right angle, if fixed parameters do not reach the
    /// tolerance.
    creased = 5e-4, "cargo xtask corpus --data DIR --vary creased=2.5e-4,5e-4,1e-3";
    /// What a candidate may add to that share of fixed parameters, if these reach the tolerance.
    creased_more = 1.5e-4, "cargo xtask corpus --data DIR --vary creased_more=0,1.5e-4,3e-4";
    /// Share of the area across the points that a candidate may add: with few points normals are rough, and all surfaces lie across some.
    across_more = 2e-4, "cargo xtask corpus --data DIR --vary across_more=1e-4,2e-4,4e-4";
    /// Factor by which that share may grow besides.
    across_factor = 1.25, "cargo xtask corpus --data DIR --vary across_factor=1,1.25,1.5";
    /// That share from which on the normals of the points are no good: points on distant lines have neighbours on their own line only.
    across_most = 0.05, "cargo xtask corpus --data DIR --vary across_most=0.025,0.05,0.1";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_are_changed_by_name() {
        let policy = Policy::default().with("hopeless", 2.0).unwrap();
        assert_eq!((policy.hopeless, policy.far), (2.0, Policy::default().far));
        assert!(Policy::default().with("hopeles", 2.0).is_none());
        assert!(Policy::COMMANDS.iter().all(|(name, command)| command.contains(&format!("--vary {name}="))));
    }
}
