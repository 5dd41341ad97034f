//! BIDGCN: Figures 4.24 to 4.31 of Imperatore 2024 as tables.

mod guarded;
mod moving;
mod real;
mod synthetic;
mod text;

use std::path::Path;

use anyhow::Result;
use param_nn::{Bidgcn, Pargcn, PargcnOptions, Reading};

use super::mapped::{CLASSICAL, Method};

/// What is computed.
#[derive(Clone, Copy, Debug)]
pub struct BidgcnTables<'a> {
    /// A folder with the clouds of the authors that are public, in `thesis/`, meshes of Nefertiti, and raw scans.
    pub data: Option<&'a Path>,
    /// Clouds of a cell.
    pub clouds: u64,
    /// Steps in which the published form and the ablation are trained; without, they are left out.
    pub train: Option<u64>,
}

/// The document; `tell` hears how far it is.
///
/// # Errors
/// What reading, training, mapping and fitting meet.
pub fn document(options: &BidgcnTables<'_>, tell: &mut dyn FnMut(&str)) -> Result<String> {
    let networks = Networks::embedded()?;
    let mut text = text::introduction(options, &networks);
    text += &synthetic::tables(&networks, options.clouds, tell)?;
    match options.train {
        Some(steps) => text += &synthetic::trained(&networks.bidgcn, steps, options.clouds, tell)?,
        None => text += "\n## The published form, and the ablation\n\nLeft out: `--train STEPS` was not given.\n",
    }
    match options.data {
        Some(folder) => {
            text += &real::tables(&networks, folder, tell)?;
            text += &moving::tables(&networks, folder, tell)?;
            text += &guarded::tables(folder, tell)?;
        }
        None => text += "\n## Real clouds\n\nLeft out: `--data DIR` was not given.\n",
    }
    Ok(text)
}

/// The networks that come with `param-nn`.
struct Networks {
    bidgcn: Bidgcn,
    averaged: Bidgcn,
    pargcn: Pargcn,
}

/// Places of LPSP and of the two readings of BIDGCN among the methods.
const LPSP: usize = 2;
const BIDGCN: usize = 4;
const AVERAGED: usize = 5;

impl Networks {
    fn embedded() -> Result<Self> {
        let bidgcn = Bidgcn::embedded()?;
        Ok(Self { averaged: bidgcn.clone().read_as(Reading::BEST), bidgcn, pargcn: Pargcn::embedded()? })
    }

    fn methods(&self) -> [(&'static str, Method<'_>); 6] {
        let [unif, recd, lpsp] = CLASSICAL;
        [
            unif,
            recd,
            lpsp,
            ("PARGCN", Method::Pargcn(&self.pargcn, PargcnOptions::default())),
            ("BIDGCN", Method::Bidgcn(&self.bidgcn)),
            ("BIDGCN, averaged", Method::Bidgcn(&self.averaged)),
        ]
    }
}
