//! Arrays as bytes in a page: whole numbers, differences of neighbours, byte planes, compressed, in letters.
//!
//! Points that are neighbours in a list are near each other in space, so the differences are small and their high bytes nearly all 0;
//! with the bytes of one place of all numbers next to one another (a plane) that compresses to a third.

use std::io::Write;

use base64::Engine;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use serde::Serialize;

/// The largest number that coordinates become: 16 bits.
pub const LARGEST_NUMBER: f64 = 65535.0;

/// The number from 0 to [`LARGEST_NUMBER`] nearest to where `x` lies between two bounds; 0 where these are equal.
pub fn quantize(x: f64, lower: f64, upper: f64) -> u16 {
    let share = (x - lower) / (upper - lower);
    // Without extent the share is NaN, which becomes 0.
    (share.clamp(0.0, 1.0) * LARGEST_NUMBER).round() as u16
}

/// What [`quantize`] stands for: off by half a step of the range at most.
pub fn dequantize(number: u16, lower: f64, upper: f64) -> f64 {
    lower + (upper - lower) * f64::from(number) / LARGEST_NUMBER
}

/// How the numbers of a section are to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Kind {
    /// Each component as the difference from the row before, modulo 2¹⁶ or 2⁸.
    Numbers,
    /// The first component as the difference from the row before, the others from the first; positive and negative by turns.
    Indices,
}

/// One array: rows of `components` numbers of `bytes` bytes each.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Section {
    pub(crate) name: String,
    pub(crate) kind: Kind,
    pub(crate) components: usize,
    pub(crate) bytes: usize,
    pub(crate) count: usize,
}

/// Arrays, one behind the other.
#[derive(Clone, Debug, Default)]
pub struct Sections {
    pub(crate) table: Vec<Section>,
    bytes: Vec<u8>,
}

impl Sections {
    /// Adds rows of numbers of 16 bits.
    pub fn add_numbers<const N: usize>(&mut self, name: &str, rows: &[[u16; N]]) {
        let mut before = [0u16; N];
        let differences = rows.iter().map(|row| {
            let difference = std::array::from_fn(|k| u32::from(zigzag16(row[k].wrapping_sub(before[k]))));
            before = *row;
            difference
        });
        let differences: Vec<[u32; N]> = differences.collect();
        self.add(name, Kind::Numbers, 2, &differences);
    }

    /// Adds rows of indices, such as the corners of triangles.
    pub fn add_indices<const N: usize>(&mut self, name: &str, rows: &[[u32; N]]) {
        let mut before = 0u32;
        let differences = rows.iter().map(|row| {
            let first = row[0];
            let difference =
                std::array::from_fn(|k| zigzag32(row[k].wrapping_sub(if k == 0 { before } else { first })));
            before = first;
            difference
        });
        let differences: Vec<[u32; N]> = differences.collect();
        self.add(name, Kind::Indices, 4, &differences);
    }

    /// The planes of numbers: all lowest bytes of the first component, all second ones, and so on.
    fn add<const N: usize>(&mut self, name: &str, kind: Kind, bytes: usize, rows: &[[u32; N]]) {
        for k in 0..N {
            for place in 0..bytes {
                self.bytes.extend(rows.iter().map(|row| row[k].to_le_bytes()[place]));
            }
        }
        self.table.push(Section { name: name.to_owned(), kind, components: N, bytes, count: rows.len() });
    }

    /// All bytes, compressed (zlib) and in letters (base64).
    pub fn to_text(&self) -> String {
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
        // Writing into a vector does not fail.
        let compressed = encoder.write_all(&self.bytes).and_then(|()| encoder.finish()).unwrap_or_default();
        base64::engine::general_purpose::STANDARD.encode(compressed)
    }
}

/// Small for small differences of either sign: 0, -1, 1, -2, … become 0, 1, 2, 3, …
fn zigzag16(difference: u16) -> u16 {
    (difference << 1) ^ (if difference >> 15 == 1 { u16::MAX } else { 0 })
}

fn zigzag32(difference: u32) -> u32 {
    (difference << 1) ^ (if difference >> 31 == 1 { u32::MAX } else { 0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::io::Read;

    /// What the viewer does.
    fn read_back(sections: &Sections) -> Vec<Vec<Vec<u32>>> {
        let compressed = base64::engine::general_purpose::STANDARD.decode(sections.to_text()).unwrap();
        let mut bytes = Vec::new();
        flate2::read::ZlibDecoder::new(&compressed[..]).read_to_end(&mut bytes).unwrap();
        let mut at = 0;
        let mut all = Vec::new();
        for section in &sections.table {
            let Section { kind, components, bytes: size, count, .. } = *section;
            let raw = |at: usize, k: usize, i: usize| {
                (0..size).fold(0u32, |sum, b| sum | u32::from(bytes[at + (k * size + b) * count + i]) << (8 * b))
            };
            let mut rows: Vec<Vec<u32>> = Vec::new();
            for i in 0..count {
                let mut row = vec![0u32; components];
                for k in 0..components {
                    let z = raw(at, k, i);
                    let difference = (z >> 1) ^ (z & 1).wrapping_neg();
                    let before = |k: usize| rows.last().map_or(0, |row| row[k]);
                    row[k] = match kind {
                        Kind::Numbers => before(k).wrapping_add(difference) & 0xffff,
                        Kind::Indices => (if k == 0 { before(0) } else { row[0] }).wrapping_add(difference),
                    };
                }
                rows.push(row);
            }
            at += components * size * count;
            all.push(rows);
        }
        assert_eq!(at, bytes.len());
        all
    }

    proptest! {
        #[test]
        fn arrays_are_read_back(
            numbers in prop::collection::vec(any::<[u16; 3]>(), 0..40),
            indices in prop::collection::vec(any::<[u32; 2]>(), 0..40),
        ) {
            let mut sections = Sections::default();
            sections.add_numbers("numbers", &numbers);
            sections.add_indices("indices", &indices);
            let wide: Vec<Vec<u32>> = numbers.iter().map(|row| row.map(u32::from).to_vec()).collect();
            let pairs: Vec<Vec<u32>> = indices.iter().map(|row| row.to_vec()).collect();
            prop_assert_eq!(read_back(&sections), vec![wide, pairs]);
        }

        #[test]
        fn numbers_stand_for_places_half_a_step_away_at_most(
            lower in -1e6..1e6, extent in 1e-6..1e6, share in 0.0..=1.0,
        ) {
            let (upper, x): (f64, f64) = (lower + extent, lower + share * extent);
            let back = dequantize(quantize(x, lower, upper), lower, upper);
            prop_assert!((back - x).abs() <= 0.5001 * (upper - lower) / LARGEST_NUMBER);
        }
    }

    #[test]
    fn places_without_extent_and_beyond_it_are_numbers_too() {
        assert_eq!(quantize(3.0, 3.0, 3.0), 0);
        assert_eq!(dequantize(0, 3.0, 3.0), 3.0);
        assert_eq!([quantize(-9.0, 0.0, 1.0), quantize(9.0, 0.0, 1.0)], [0, u16::MAX]);
        assert_eq!(quantize(f64::NAN, 0.0, 1.0), 0);
    }
}
