//! The length unit of a scan: asked for, told by its file, or taken for granted.

use geom_io::LengthUnit;
use serde::Serializer;

/// Sizes of a part, in millimetres, beyond which it is more likely that the unit is another one.
///
/// Limit: a hint and no more; scanned parts are 10 mm to 100 m across.
const USUAL_SIZE: std::ops::RangeInclusive<f64> = 10.0..=1e5;

/// The unit that was asked for, else that of the file, else millimetres.
pub(crate) fn resolve(asked: Option<LengthUnit>, of_file: Option<LengthUnit>) -> LengthUnit {
    asked.or(of_file).unwrap_or_default()
}

/// What there is to say about the unit of a scan with this diagonal, in its own unit.
pub(crate) fn hint(asked: Option<LengthUnit>, of_file: Option<LengthUnit>, diagonal: f64) -> Option<String> {
    match (asked, of_file) {
        (Some(asked), Some(of_file)) if asked != of_file => {
            Some(format!("the file is in the unit {}, --units says {}, which was taken", of_file.name(), asked.name()))
        }
        (None, None) if !USUAL_SIZE.contains(&diagonal) => Some(format!(
            "the scan is {} mm across, since the file tells no unit; if it is in another one, --units um, cm, m, inch or ft \
             says so",
            four_digits(diagonal)
        )),
        _ => None,
    }
}

/// A number with as many digits as anybody reads.
pub(crate) fn four_digits(value: f64) -> String {
    format!("{value:.3e}").parse().map_or_else(|_| value.to_string(), |rounded: f64| rounded.to_string())
}

pub(crate) fn serialize<S: Serializer>(unit: &Option<LengthUnit>, serializer: S) -> Result<S::Ok, S::Error> {
    match unit {
        Some(unit) => serializer.serialize_str(unit.name()),
        None => serializer.serialize_none(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_asked_for_comes_before_the_file() {
        let (metre, inch) = (Some(LengthUnit::Metre), Some(LengthUnit::Inch));
        assert_eq!(resolve(None, None), LengthUnit::Millimetre);
        assert_eq!(resolve(None, metre), LengthUnit::Metre);
        assert_eq!(resolve(inch, metre), LengthUnit::Inch);
        assert!(hint(inch, metre, 50.0).unwrap().contains("inch"));
        for (asked, of_file, diagonal, told) in [
            (None, None, 9.99, true),
            (None, None, 10.0, false),
            (None, None, 1e5, false),
            (None, None, 1.01e5, true),
            (inch, None, 1e-3, false),
            (None, metre, 1e9, false),
            (metre, metre, 1e9, false),
        ] {
            assert_eq!(hint(asked, of_file, diagonal).is_some(), told, "{asked:?} {of_file:?} {diagonal}");
        }
    }
}
