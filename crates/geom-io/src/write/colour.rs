//! Colours for scalars.

/// How values become colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColourMap {
    /// [`Self::Diverging`] where values of both signs occur, else [`Self::Sequential`].
    #[default]
    Automatic,
    /// From blue over grey at 0 to red, symmetric about 0: signed deviations.
    Diverging,
    /// From dark violet to yellow: distances.
    Sequential,
}

/// Moreland's cool-warm map ("Diverging color maps for scientific visualization", ISVC 2009), every fourth of
/// the 33 colours of its published table.
const DIVERGING: [[u8; 3]; 9] = [
    [59, 76, 192],
    [98, 130, 234],
    [141, 176, 254],
    [184, 208, 249],
    [221, 221, 221],
    [245, 196, 173],
    [244, 154, 123],
    [222, 96, 77],
    [180, 4, 38],
];

/// Viridis (van der Walt and Smith 2015, CC0) at nine equidistant places.
const SEQUENTIAL: [[u8; 3]; 9] = [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
];

/// A colour map with its range.
pub(super) struct Colours {
    table: &'static [[u8; 3]; 9],
    low: f64,
    high: f64,
}

impl Colours {
    /// `range` defaults to that of the values; a diverging map takes it symmetric about 0.
    pub(super) fn new(map: ColourMap, range: Option<(f64, f64)>, values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = range.unwrap_or_else(|| {
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
        });
        let diverging = match map {
            ColourMap::Automatic => low < 0.0 && high > 0.0,
            ColourMap::Diverging => true,
            ColourMap::Sequential => false,
        };
        match diverging {
            true => {
                let reach = low.abs().max(high.abs());
                Self { table: &DIVERGING, low: -reach, high: reach }
            }
            false => Self { table: &SEQUENTIAL, low, high },
        }
    }

    /// Red, green, blue; values beyond the range get the colours of its ends.
    pub(super) fn rgb(&self, value: f64) -> [u8; 3] {
        // Where all values are equal: the middle of a diverging map, the low end of a sequential one.
        let extent = self.high - self.low;
        let t = if extent > 0.0 {
            ((value - self.low) / extent).clamp(0.0, 1.0)
        } else if self.table == &DIVERGING {
            0.5
        } else {
            0.0
        };
        let place = t * (self.table.len() - 1) as f64;
        let below = (place as usize).min(self.table.len() - 2);
        let fraction = place - below as f64;
        let mix = |a: u8, b: u8| (f64::from(a) + fraction * (f64::from(b) - f64::from(a))).round() as u8;
        let (a, b) = (self.table[below], self.table[below + 1]);
        [mix(a[0], b[0]), mix(a[1], b[1]), mix(a[2], b[2])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_is_grey_and_the_larger_side_takes_the_full_colour() {
        let colours = Colours::new(ColourMap::Automatic, None, [-1.0, 4.0].into_iter());
        assert_eq!(colours.rgb(0.0), [221, 221, 221]);
        assert_eq!(colours.rgb(4.0), [180, 4, 38]);
        assert_eq!(colours.rgb(-4.0), [59, 76, 192]);
        assert_eq!(colours.rgb(-1.0), DIVERGING[3]);
    }

    #[test]
    fn distances_run_from_violet_to_yellow_and_are_clamped_to_the_range() {
        let colours = Colours::new(ColourMap::Automatic, Some((0.0, 2.0)), std::iter::empty());
        assert_eq!(colours.rgb(0.0), [68, 1, 84]);
        assert_eq!(colours.rgb(7.0), [253, 231, 37]);
        assert_eq!(colours.rgb(0.125), [70, 23, 103]);
    }

    #[test]
    fn equal_values_have_a_colour() {
        assert_eq!(Colours::new(ColourMap::Automatic, None, [3.0].into_iter()).rgb(3.0), [68, 1, 84]);
        assert_eq!(Colours::new(ColourMap::Diverging, None, [0.0].into_iter()).rgb(0.0), [221, 221, 221]);
        assert_eq!(Colours::new(ColourMap::Automatic, None, std::iter::empty()).rgb(0.0), [68, 1, 84]);
    }
}
