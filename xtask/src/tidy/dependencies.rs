//! Dependencies that are declared are used.

use std::collections::BTreeSet;
use std::path::Path;

use anyhow::{Context, Result};
use cargo_metadata::{DependencyKind, Metadata};

use super::files::{relative, sources};

/// Folders of a package whose files are compiled for tests, benches and examples only.
const DEVELOPMENT: [&str; 3] = ["tests", "benches", "examples"];

pub(super) fn check(root: &Path, metadata: &Metadata) -> Result<Vec<String>> {
    let mut findings = Vec::new();
    let mut declared = BTreeSet::new();
    for package in metadata.workspace_packages() {
        let folder = package.manifest_path.parent().context("a manifest has no folder")?.as_std_path();
        let (mut shipped, mut all) = (String::new(), String::new());
        for (path, text) in sources(folder)? {
            let development = DEVELOPMENT.iter().any(|part| relative(folder, &path).starts_with(part));
            if !development {
                text.lines().filter(|line| !line.trim_start().starts_with("//")).for_each(|line| {
                    shipped.push_str(line);
                    shipped.push('\n');
                });
            }
            all.push_str(&text);
        }
        for dependency in &package.dependencies {
            declared.insert(dependency.name.clone());
            let name = dependency.rename.as_ref().unwrap_or(&dependency.name).replace('-', "_");
            // Doc examples are tests: they count for development only.
            let text = if dependency.kind == DependencyKind::Development { &all } else { &shipped };
            if !mentions(text, &name) {
                findings.push(format!("{} declares {} but does not use it", package.name, dependency.name));
            }
        }
    }
    let manifest = std::fs::read_to_string(root.join("Cargo.toml"))?;
    let unused = workspace_dependencies(&manifest).filter(|name| !declared.contains(*name));
    findings.extend(unused.map(|name| format!("no crate inherits {name} from the workspace's dependencies")));
    Ok(findings)
}

/// Whether Rust code names a crate: in a path, or in a `use`.
fn mentions(code: &str, name: &str) -> bool {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    code.match_indices(name).any(|(at, _)| {
        let (before, after) = (&code[..at], &code[at + name.len()..]);
        let whole = !before.ends_with(is_part) && !after.starts_with(is_part);
        whole && (after.starts_with("::") || before.ends_with("use "))
    })
}

/// Names in the section of the root manifest that crates inherit from.
fn workspace_dependencies(manifest: &str) -> impl Iterator<Item = &str> {
    let section = manifest.lines().skip_while(|line| line.trim() != "[workspace.dependencies]").skip(1);
    section
        .take_while(|line| !line.starts_with('['))
        .filter(|line| !line.trim_start().starts_with('#'))
        .filter_map(|line| line.split_once('=').map(|(name, _)| name.trim()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crates_are_found_in_paths_and_imports_only() {
        assert!(mentions("use csv;", "csv"));
        assert!(mentions("let r = ::csv::Reader::new();", "csv"));
        for other in ["let csv = 1;", "my_csv::read()", "csv_core::Reader", "\"a csv file\""] {
            assert!(!mentions(other, "csv"), "{other}");
        }
    }

    #[test]
    fn inherited_names_are_those_of_one_section() {
        let manifest =
            "[a]\nx = 1\n[workspace.dependencies]\n# y = 2\nfit-ls = { path = \"f\" }\ncsv = \"1\"\n\n[b]\nz = 3\n";
        assert_eq!(workspace_dependencies(manifest).collect::<Vec<_>>(), ["fit-ls", "csv"]);
    }
}
