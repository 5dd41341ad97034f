//! What STEP files say of themselves: the part's name, when it was written, and by what.

use std::time::{SystemTime, UNIX_EPOCH};

use geom_io::{StepOptions, StepSchema};

use crate::options::Schema;
use crate::program::PROGRAM;

/// Options of STEP files that name the part (empty for the name of the file), this program, and the time of writing: now, or what the
/// variable `SOURCE_DATE_EPOCH` says, for files that are the same each time.
pub fn step_options(name: &str, schema: Schema) -> StepOptions {
    let schema = match schema {
        Schema::Ap214 => StepSchema::Ap214,
        Schema::Ap242 => StepSchema::Ap242,
    };
    StepOptions {
        product: name.to_owned(),
        originating_system: PROGRAM.to_owned(),
        time_stamp: time_stamp(seconds_now()),
        schema,
        ..StepOptions::default()
    }
}

/// Seconds since the start of 1970.
fn seconds_now() -> u64 {
    let told = std::env::var("SOURCE_DATE_EPOCH").ok().and_then(|text| text.parse().ok());
    told.unwrap_or_else(|| SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs()))
}

/// A time in ISO 8601, in the Gregorian calendar and universal time.
fn time_stamp(seconds: u64) -> String {
    let (days, of_day) = (seconds / 86_400, seconds % 86_400);
    // Counted from 1 March of year 0 the day of leap years comes last, in years, centuries and ages of 400 years alike.
    let days = days + 719_468;
    let (age, of_age) = (days / 146_097, days % 146_097);
    let year_of_age = (of_age - of_age / 1_460 + of_age / 36_524 - of_age / 146_096) / 365;
    let of_year = of_age - (365 * year_of_age + year_of_age / 4 - year_of_age / 100);
    let month_from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    let year = 400 * age + year_of_age + u64::from(month < 3);
    let (hour, minute, second) = (of_day / 3600, of_day / 60 % 60, of_day % 60);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}+00:00")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_those_of_the_calendar() {
        // As `date --utc --date @SECONDS` prints them.
        for (seconds, text) in [
            (0, "1970-01-01T00:00:00+00:00"),
            (951_782_399, "2000-02-28T23:59:59+00:00"),
            (951_782_400, "2000-02-29T00:00:00+00:00"),
            (951_868_800, "2000-03-01T00:00:00+00:00"),
            (1_735_689_599, "2024-12-31T23:59:59+00:00"),
            (4_107_542_400, "2100-03-01T00:00:00+00:00"),
        ] {
            assert_eq!(time_stamp(seconds), text);
        }
    }
}
