//! The library that report pages bundle is the one that its maintainer made: the file's fingerprint stands beside it, with the command.

use std::path::Path;

use anyhow::{Context, Result};
use sha2::{Digest, Sha256};

/// The bundle, and the file that names its fingerprint.
const BUNDLE: &str = "crates/report-page/assets/three.js";
const NOTES: &str = "crates/report-page/assets/README.md";

pub(super) fn check(root: &Path) -> Result<Vec<String>> {
    let bundle = std::fs::read(root.join(BUNDLE)).with_context(|| format!("cannot read {BUNDLE}"))?;
    let notes = std::fs::read_to_string(root.join(NOTES)).with_context(|| format!("cannot read {NOTES}"))?;
    Ok(finding(&bundle, &notes).into_iter().collect())
}

fn finding(bundle: &[u8], notes: &str) -> Option<String> {
    let sum: String = Sha256::digest(bundle).iter().map(|byte| format!("{byte:02x}")).collect();
    (!notes.contains(&sum)).then(|| {
        format!("{BUNDLE} has the SHA-256 {sum}, which {NOTES} does not name: make it by the command there, and write down what came out")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bundle_that_was_changed_is_told() {
        // The example of FIPS 180-4.
        let notes = "SHA-256 ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(finding(b"abc", notes), None);
        assert!(finding(b"abd", notes).is_some_and(|text| text.contains(BUNDLE)));
    }
}
