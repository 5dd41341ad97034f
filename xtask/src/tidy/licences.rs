//! Licences of everything that ends up in the crates.

use std::collections::{BTreeSet, HashMap};

use anyhow::{Context, Result};
use cargo_metadata::{DependencyKind, Metadata, PackageId};
use spdx::{Expression, ParseMode};

/// Licences that ask for no more than their notice.
const PERMISSIVE: [&str; 11] = [
    "0BSD",
    "Apache-2.0",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "CC0-1.0",
    "ISC",
    "MIT",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
];

/// Packages under another licence that are accepted by name, each with the reason.
const EXCEPTIONS: [(&str, &str, &str); 0] = [];

pub(super) fn check(metadata: &Metadata) -> Result<Vec<String>> {
    let mut findings = Vec::new();
    let used = used_packages(metadata)?;
    for package in metadata.packages.iter().filter(|package| used.contains(&package.id)) {
        let (name, version) = (package.name.as_str(), &package.version);
        match package.license.as_deref() {
            None => findings.push(format!("{name} {version} states no licence")),
            Some(licence) if EXCEPTIONS.iter().any(|(n, l, _)| (*n, *l) == (name, licence)) => {}
            Some(licence) if is_permissive(licence) => {}
            Some(licence) => findings.push(format!("{name} {version} is under {licence:?}, which is not on the list")),
        }
    }
    Ok(findings)
}

/// Whether an SPDX expression can be met by licences of the list alone. Exceptions (`WITH`) only add permissions.
pub(super) fn is_permissive(licence: &str) -> bool {
    // Older manifests separate alternatives by a slash.
    let mode = ParseMode { allow_slash_as_or_operator: true, ..ParseMode::STRICT };
    Expression::parse_mode(licence, mode).is_ok_and(|expression| {
        expression.evaluate(|requirement| requirement.license.id().is_some_and(|id| PERMISSIVE.contains(&id.name)))
    })
}

/// The default members, which are the crates, and all they need in a normal build.
fn used_packages(metadata: &Metadata) -> Result<BTreeSet<&PackageId>> {
    let resolve = metadata.resolve.as_ref().context("cargo metadata resolved nothing")?;
    let nodes: HashMap<_, _> = resolve.nodes.iter().map(|node| (&node.id, node)).collect();
    let mut open: Vec<&PackageId> = metadata.workspace_default_packages().iter().map(|package| &package.id).collect();
    let mut used = BTreeSet::new();
    while let Some(id) = open.pop() {
        if used.insert(id) {
            let node = nodes.get(id).with_context(|| format!("{id} is not resolved"))?;
            let normal = node.deps.iter().filter(|d| d.dep_kinds.iter().any(|k| k.kind != DependencyKind::Development));
            open.extend(normal.map(|dependency| &dependency.pkg));
        }
    }
    Ok(used)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expressions_are_met_by_listed_licences_only() {
        for licence in [
            "MIT",
            "MIT/Apache-2.0",
            "MIT OR GPL-3.0-only",
            "(MIT OR Apache-2.0) AND Unicode-3.0",
            "Apache-2.0 WITH LLVM-exception",
        ] {
            assert!(is_permissive(licence), "{licence}");
        }
        for licence in ["GPL-3.0-only", "MIT AND MPL-2.0", "MPL-2.0", "LicenseRef-own", "", "MIT or so"] {
            assert!(!is_permissive(licence), "{licence}");
        }
    }

    #[test]
    fn a_build_has_the_crates_and_what_they_use_but_no_tests() {
        let metadata = super::super::metadata(&crate::workspace_root()).unwrap();
        let used = used_packages(&metadata).unwrap();
        let has = |name: &str| metadata.packages.iter().any(|p| p.name == name && used.contains(&p.id));
        assert!(has("thb-core") && has("ndarray") && !has("proptest") && !has("xtask"));
    }
}
