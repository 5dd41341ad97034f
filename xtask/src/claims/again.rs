//! Claims computed anew.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result};
use param_nn::stream;
use rand::RngExt;

use super::cells::{Cells, Pages};
use super::judge::number;
use super::{Claim, Claims};
use crate::tables;

/// Figures of another kind of processor agree within this share.
const ELSEWHERE: f64 = 0.01;

/// A draw of claims.
#[derive(Clone, Copy, Debug)]
pub struct Again<'a> {
    /// How many.
    pub count: usize,
    /// Seed of the draw.
    pub seed: u64,
    /// The folder with the clouds that the repository does not hold; without it only pages are computed that need none.
    pub data: Option<&'a Path>,
    /// Only claims that a page of this name shows.
    pub only: Option<&'a str>,
}

impl Again<'_> {
    /// Draws, computes and compares; what differs, and how many claims were compared.
    ///
    /// # Errors
    /// What computing a page meets.
    pub fn run(&self, claims: &Claims, root: &Path, say: &mut dyn FnMut(&str)) -> Result<(usize, Vec<String>)> {
        let mut open: Vec<(&Claim, &Cells)> =
            claims.claims.iter().filter_map(|claim| Some((claim, claim.cells.as_ref()?))).collect();
        open.retain(|(_, cells)| !cells.page.contains('/') && self.only.is_none_or(|only| only == cells.page));
        let mut random = stream(self.seed, 0);
        let (mut pages, mut texts) = (Pages::new(root), BTreeMap::new());
        let (mut compared, mut findings) = (0, Vec::new());
        while compared < self.count && !open.is_empty() {
            let (claim, cells) = open.swap_remove(random.random_range(0..open.len()));
            if !texts.contains_key(&cells.page) {
                say(&format!("computing {}", cells.page));
                texts.insert(cells.page.clone(), tables::all::made(&cells.page, root, self.data, say)?);
            }
            let Some(text) = &texts[&cells.page] else { continue };
            // A page made without data or training lacks some of its tables.
            let Ok(now) = cells.of(text) else { continue };
            let then = pages.shown(cells)?;
            let differs = |(now, then): (&String, &String)| now != then && !alike(now, then);
            if now.iter().any(|cell| number(cell).is_none()) && then.iter().all(|cell| number(cell).is_some()) {
                continue;
            }
            compared += 1;
            say(&format!("{}: {}", claim.id, now.join(", ")));
            if now.iter().zip(&then).any(differs) {
                findings.push(format!("{}: now {}, on the page {}", claim.id, now.join(", "), then.join(", ")));
            }
        }
        Ok((compared, findings))
    }
}

fn alike(now: &str, then: &str) -> bool {
    let pair = number(now).zip(number(then)).context("no numbers");
    pair.is_ok_and(|(now, then)| (now - then).abs() <= ELSEWHERE * then.abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workspace_root;

    #[test]
    fn claims_of_a_quick_page_come_out_as_the_page_says() {
        let root = workspace_root();
        let claims = Claims::read(&root).unwrap();
        let again = Again { count: 2, seed: 1, data: None, only: Some("published") };
        let (compared, findings) = again.run(&claims, &root, &mut |_| ()).unwrap();
        assert!(compared > 0 && findings.is_empty(), "{compared} {findings:?}");
    }

    #[test]
    fn another_processor_may_differ_by_a_hundredth() {
        assert!(alike("1.005e-3", "1.00e-3") && !alike("1.02e-3", "1.00e-3") && !alike("–", "1"));
    }
}
