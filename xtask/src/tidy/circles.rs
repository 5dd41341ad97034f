//! Files of a crate do not import each other in a circle.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result};
use syn::visit::Visit;

use super::files::{files, relative};

/// Crates some of whose files still import each other in circles.
const WITH_CIRCLES: [&str; 3] = ["fit-ls", "geom-io", "param-nn"];

/// A module: the names on the way to it from the root of its crate.
type Module = Vec<String>;

pub(super) fn check(root: &Path) -> Result<Vec<String>> {
    let mut findings = Vec::new();
    for entry in std::fs::read_dir(root.join("crates")).context("cannot list crates")? {
        let folder = entry?.path();
        let name = relative(&root.join("crates"), &folder).display().to_string();
        let circles = circles(&imports(&folder.join("src"))?);
        match (circles.is_empty(), WITH_CIRCLES.contains(&name.as_str())) {
            (true, true) => {
                findings.push(format!("crate {name} has no circles any more: take it off the list of those that have"))
            }
            (false, false) => findings.extend(
                circles
                    .iter()
                    .map(|circle| format!("crate {name}: files import each other in a circle: {}", circle.join(", "))),
            ),
            _ => (),
        }
    }
    Ok(findings)
}

/// Each module with those that its code names; of a name that is re-exported, the one that has it.
fn imports(source: &Path) -> Result<BTreeMap<Module, BTreeSet<Module>>> {
    let mut modules = BTreeMap::new();
    for path in files(source)?.into_iter().filter(|path| path.extension().is_some_and(|e| e == "rs")) {
        let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        let file = syn::parse_file(&text).with_context(|| format!("cannot parse {}", path.display()))?;
        let mut module: Module =
            relative(source, &path).with_extension("").iter().map(|part| part.to_string_lossy().into_owned()).collect();
        if module.last().is_some_and(|last| ["lib", "main", "mod"].contains(&last.as_str())) {
            module.pop();
        }
        let mut named = Named::default();
        named.visit_file(&file);
        modules.insert(module, named);
    }
    let mut edges = BTreeMap::new();
    for (module, named) in &modules {
        let targets = named.used.iter().filter_map(|path| target(&modules, module, path, 0));
        edges.insert(module.clone(), targets.filter(|target| target != module).collect());
    }
    Ok(edges)
}

/// The paths of a file, without its tests.
#[derive(Default)]
struct Named {
    /// Those that its code uses; re-exports are not among them.
    used: BTreeSet<Vec<String>>,
    /// Re-exports: a name, and the path that it stands for.
    exported: BTreeMap<String, Vec<String>>,
}

impl<'ast> Visit<'ast> for Named {
    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        let mut leaves = Vec::new();
        collect(&item.tree, &mut Vec::new(), &mut leaves);
        for (name, path) in leaves {
            if matches!(item.vis, syn::Visibility::Inherited) {
                self.used.insert(path);
            } else {
                self.exported.insert(name, path);
            }
        }
    }

    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        let is_test = |attribute: &syn::Attribute| {
            attribute.path().is_ident("cfg")
                && matches!(attribute.parse_args::<syn::Path>(), Ok(path) if path.is_ident("test"))
        };
        if !item.attrs.iter().any(is_test) {
            syn::visit::visit_item_mod(self, item);
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        if path.segments.len() > 1 {
            self.used.insert(path.segments.iter().map(|segment| segment.ident.to_string()).collect());
        }
        syn::visit::visit_path(self, path);
    }
}

/// The leaves of a tree of imports: the name that each gets, and its path.
fn collect(tree: &syn::UseTree, before: &mut Vec<String>, leaves: &mut Vec<(String, Vec<String>)>) {
    let mut leaf = |name: String, last: Option<String>| {
        leaves.push((name, before.iter().cloned().chain(last).collect()));
    };
    match tree {
        syn::UseTree::Name(name) if name.ident == "self" => leaf(before.last().cloned().unwrap_or_default(), None),
        syn::UseTree::Name(name) => leaf(name.ident.to_string(), Some(name.ident.to_string())),
        syn::UseTree::Rename(renamed) => leaf(renamed.rename.to_string(), Some(renamed.ident.to_string())),
        syn::UseTree::Glob(_) => leaf("*".to_owned(), None),
        syn::UseTree::Path(path) => {
            before.push(path.ident.to_string());
            collect(&path.tree, before, leaves);
            before.pop();
        }
        syn::UseTree::Group(group) => group.items.iter().for_each(|tree| collect(tree, before, leaves)),
    }
}

/// Re-exports that are followed for one path.
///
/// Limit: a name that is re-exported more often is taken to be where the last one is.
const MOST_EXPORTS: usize = 16;

/// The module of this crate that has what a path names; `None` if that is of another crate.
fn target(modules: &BTreeMap<Module, Named>, from: &[String], path: &[String], followed: usize) -> Option<Module> {
    let mut at: Module = from.to_vec();
    let mut rest = path;
    match rest.first()?.as_str() {
        "crate" => {
            at.clear();
            rest = &rest[1..];
        }
        "self" => rest = &rest[1..],
        "super" => {
            while rest.first().is_some_and(|part| part == "super") {
                at.pop();
                rest = &rest[1..];
            }
        }
        first => {
            let child: Module = from.iter().cloned().chain([first.to_owned()]).collect();
            if !modules.contains_key(&child) {
                return None;
            }
        }
    }
    while let Some(next) = rest.first() {
        let child: Module = at.iter().cloned().chain([next.clone()]).collect();
        if modules.contains_key(&child) {
            at = child;
            rest = &rest[1..];
            continue;
        }
        let exported = modules.get(&at).and_then(|named| named.exported.get(next)).filter(|_| followed < MOST_EXPORTS);
        return match exported {
            Some(path) => target(modules, &at, path, followed + 1),
            None => Some(at),
        };
    }
    Some(at)
}

/// Groups of modules each of which reaches all others of its group.
fn circles(edges: &BTreeMap<Module, BTreeSet<Module>>) -> Vec<Vec<String>> {
    let reached = |from: &Module| {
        let mut seen: BTreeSet<&Module> = BTreeSet::new();
        let mut open: Vec<&Module> = edges.get(from).into_iter().flatten().collect();
        while let Some(module) = open.pop() {
            if seen.insert(module) {
                open.extend(edges.get(module).into_iter().flatten());
            }
        }
        seen
    };
    let all: BTreeMap<&Module, BTreeSet<&Module>> = edges.keys().map(|module| (module, reached(module))).collect();
    let mut circles = BTreeSet::new();
    for (module, reach) in all.iter().filter(|(module, reach)| reach.contains(*module)) {
        let group = reach.iter().filter(|other| all.get(*other).is_some_and(|back| back.contains(module)));
        let name = |module: &&Module| if module.is_empty() { "lib.rs".to_owned() } else { module.join("::") };
        circles.insert(group.map(name).collect::<Vec<String>>());
    }
    circles.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crate_of(files: &[(&str, &str)]) -> Vec<Vec<String>> {
        let folder = std::env::temp_dir().join(format!("circles-{}-{}", std::process::id(), files.len()));
        for (name, text) in files {
            let path = folder.join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        let found = circles(&imports(&folder).unwrap());
        std::fs::remove_dir_all(&folder).unwrap();
        found
    }

    #[test]
    fn circles_are_found_through_re_exports_and_paths_in_code() {
        let found = crate_of(&[
            ("lib.rs", "mod a; mod b; mod c; pub use a::Thing as Other;"),
            ("a.rs", "use crate::b::{self, Used as Renamed};"),
            ("b/mod.rs", "fn f() -> Vec<crate::Other> { Vec::new() }"),
            ("c.rs", "use super::a; use std::fmt::Debug;"),
        ]);
        assert_eq!(found, [["a", "b"]]);
    }

    #[test]
    fn trees_tests_and_other_crates_are_no_circles() {
        let found = crate_of(&[
            ("lib.rs", "mod a; mod b; pub use a::A; pub use b::B; pub use other::Thing;"),
            ("a.rs", "use crate::B; #[cfg(test)] mod tests { use crate::b::C; }"),
            ("b.rs", "use serde::Serialize; #[cfg(test)] mod tests { use crate::a::A; }"),
            ("c.rs", "use crate::b::B;"),
            ("d.rs", ""),
        ]);
        assert_eq!(found, [[""; 0]; 0]);
    }
}
