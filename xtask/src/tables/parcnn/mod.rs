//! PARCNN: Tables 4.1 to 4.5 of Imperatore 2024 (1 to 5 of the book chapter).

mod curves;
pub(super) mod fitting;
mod surfaces;
mod text;

use std::path::Path;

use anyhow::Result;

/// Seed of all test items; its number means nothing.
const SEED: u64 = 41;

/// Items of a cell, as in the text.
const ITEMS: u64 = 100;

const DEGREES: [usize; 4] = [2, 3, 4, 5];

/// The document; `data` is a folder with the grids that are public, `train` the number of steps for the networks that
/// ours is compared with.
///
/// # Errors
/// What reading, training and fitting meet.
pub fn document(data: Option<&Path>, train: Option<u64>) -> Result<String> {
    let mut text = String::from(text::INTRODUCTION);
    text += &curves::tables_1_and_2(train)?;
    text += &curves::table_3()?;
    text += &surfaces::table_4()?;
    match data {
        Some(folder) => text += &surfaces::real_grids(folder)?,
        None => text += "\n## Table 4.5 and examples on real grids\n\nLeft out: `--data DIR` was not given.\n",
    }
    Ok(text)
}
