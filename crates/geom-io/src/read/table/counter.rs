//! A first column that counts points or tells their time, and so is no coordinate.
//!
//! Coordinates of a surface do not go up, or down, by the same step from every row to the next: the points would lie on as many
//! planes; nor does it by about the same step, as the clock of a scanner. Those of a curve may. What tells a coordinate then is that a program writes all three of them in the same way.

/// Fewest rows that tell.
///
/// Limit: three points of a line of a grid go up by the same step; eight in a file of eight lines and more are no grid.
const FEWEST_ROWS: usize = 8;

/// Share of the steps that have to be the smallest one: points that were deleted leave gaps in their numbers.
///
/// Calibrated: `a_first_column_that_counts` and `coordinates_are_not_counted` in the tests.
const SMALLEST_STEPS: f64 = 0.8;

/// Share of the steps of a clock that read the time of every point, between half and twice their median.
///
/// Calibrated: `times_that_jitter` in the tests; the steps of random coordinates that were sorted have 46 % there.
const LIKE_STEPS: f64 = 0.9;

/// Fewest steps that tell a clock.
///
/// Limit: of 20 steps between sorted random numbers 18 are like their median once in 10⁴ files.
const FEWEST_CLOCK_STEPS: usize = 20;

/// Values from which on numbers that increase throughout are times: seconds since 1970 passed it in 1973, and coordinates in
/// metres on the Earth stay below 2·10⁷.
const EPOCH: f64 = 1e8;

/// What a first column holds in place of x.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Counter {
    /// Numbers of points.
    Number,
    /// Their times.
    Time,
}

/// A column of a sample of rows.
#[derive(Clone, Debug, Default)]
pub(super) struct Written {
    pub(super) values: Vec<f64>,
    /// Most digits behind the decimal sign.
    pub(super) decimals: usize,
    /// Whether no number has a decimal sign or an exponent.
    pub(super) are_digits: bool,
}

impl Written {
    pub(super) fn new() -> Self {
        Self { are_digits: true, ..Self::default() }
    }

    pub(super) fn push(&mut self, text: &[u8], value: f64) {
        self.values.push(value);
        let is_digits = text.iter().all(|b| b.is_ascii_digit());
        self.are_digits &= is_digits;
        if !is_digits {
            let point = text.iter().position(|b| matches!(b, b'.' | b','));
            let fraction = &text[point.map_or(text.len(), |at| at + 1)..];
            self.decimals = self.decimals.max(fraction.iter().take_while(|b| b.is_ascii_digit()).count());
        }
    }
}

/// What the first of four columns or more holds, if it is no coordinate; the other three are those behind it.
pub(super) fn first_is(columns: &[Written]) -> Option<Counter> {
    let [first, others @ ..] = columns else { return None };
    let others = others.first_chunk::<3>()?;
    if first.values.len() < FEWEST_ROWS {
        return None;
    }
    let steps: Vec<f64> = first.values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let up = steps.iter().all(|&step| step > 0.0);
    let down = steps.iter().all(|&step| step < 0.0);
    if !up && !down {
        return None;
    }
    let smallest = steps.iter().fold(f64::INFINITY, |least, step| least.min(step.abs()));
    let share = |is_step: &dyn Fn(f64) -> bool| {
        steps.iter().filter(|step| is_step(step.abs())).count() as f64 / steps.len() as f64
    };
    let counts = share(&|step| step == smallest) >= SMALLEST_STEPS;
    let are_whole = first.values.iter().all(|value| value.fract() == 0.0);
    // The three coordinates are written in one way, and the first column in another.
    let written_alike = others.iter().all(|other| other.decimals == others[0].decimals);
    let written_apart = written_alike && first.decimals != others[0].decimals;
    let are_epochs = up && is_epoch(first) && others.iter().all(|other| other.values[0].abs() < EPOCH);
    if are_whole && counts {
        let from_the_start = smallest == 1.0 && first.values[0].abs() <= 1.0 && share(&|step| step == 1.0) == 1.0;
        let have_fractions = others.iter().all(|other| !other.are_digits);
        let is_number =
            first.are_digits && (from_the_start || written_apart || have_fractions) || from_the_start && written_alike;
        if is_number {
            return Some(Counter::Number);
        }
    }
    // Equal up to the last digit that is written.
    let last_digit = 0.1_f64.powi(first.decimals.min(15) as i32);
    let is_even = share(&|step| step - smallest <= 1.01 * last_digit) == 1.0;
    let mut sorted: Vec<f64> = steps.iter().map(|step| step.abs()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let median = sorted[sorted.len() / 2];
    let is_clock = steps.len() >= FEWEST_CLOCK_STEPS
        && others[0].decimals > 0
        && share(&|step| (0.5 * median..=2.0 * median).contains(&step)) >= LIKE_STEPS;
    (are_epochs || up && (is_even || is_clock) && !are_whole && written_apart).then_some(Counter::Time)
}

/// Whether values are as far from 0 as times since 1970, and as close together as those of a scan, which takes no year.
fn is_epoch(column: &Written) -> bool {
    /// Limit: a month in half a century.
    const SPAN: f64 = 1e-3;
    let (first, last) = (column.values[0], column.values[column.values.len() - 1]);
    first >= EPOCH && last - first <= SPAN * first
}
