//! Dependencies between the crates run one way only.

use cargo_metadata::{Dependency, Metadata};

/// Each crate with the crates that may use it.
const USED_BY: [(&str, &[&str]); 15] = [
    (
        "thb-core",
        &[
            "adaptive",
            "fit-ls",
            "fit-qi",
            "moving-param",
            "multi-patch",
            "deviation",
            "quad-layout",
            "geom-io",
            "reconstruct",
        ],
    ),
    ("adaptive", &["fit-ls", "fit-qi", "moving-param", "reconstruct"]),
    ("fit-ls", &["fit-qi", "moving-param", "multi-patch", "quad-layout", "reconstruct"]),
    ("fit-qi", &["moving-param", "reconstruct"]),
    ("moving-param", &["reconstruct"]),
    ("multi-patch", &["reconstruct"]),
    (
        "point-cloud",
        &["param-classic", "param-nn", "multi-patch", "quad-layout", "deviation", "geom-io", "reconstruct"],
    ),
    ("param-classic", &["param-nn", "quad-layout", "reconstruct"]),
    ("quad-layout", &["reconstruct"]),
    ("param-nn", &["reconstruct"]),
    ("deviation", &["reconstruct"]),
    ("report-page", &["reconstruct"]),
    ("geom-io", &["reconstruct"]),
    ("reconstruct", &["cli"]),
    ("cli", &[]),
];

/// Packages outside: they may use every crate, and no crate may use them.
const OUTSIDE: [&str; 3] = ["xtask", "workspace-tests", "workspace-benches"];

/// The crate with the networks and its feature for training, which no crate on the way to the program switches on: it brings a quarter
/// of all packages.
const TRAINING: (&str, &str) = ("param-nn", "candle");

pub(super) fn check(metadata: &Metadata) -> Vec<String> {
    let mut findings = Vec::new();
    for package in metadata.workspace_packages() {
        let name = package.name.as_str();
        let folder = package.manifest_path.parent().and_then(|folder| folder.file_name());
        if !OUTSIDE.contains(&name) && folder != Some(name) {
            findings.push(format!("crate {name} stands in folder {}; name the folder after it", folder.unwrap_or("?")));
        }
        let own = package.dependencies.iter().filter(|dependency| dependency.path.is_some());
        findings.extend(own.clone().filter_map(|dependency| forbidden(name, &dependency.name)));
        let (network, feature) = TRAINING;
        let trains = |d: &Dependency| {
            d.name == network
                && (d.uses_default_features || d.features.iter().any(|switched_on| switched_on == feature))
        };
        if !OUTSIDE.contains(&name) && own.into_iter().any(trains) {
            findings.push(format!("crate {name} uses {network} with feature {feature}; the program is built without"));
        }
    }
    findings
}

/// Why a crate may not use another, if it may not.
fn forbidden(user: &str, used: &str) -> Option<String> {
    if OUTSIDE.contains(&user) {
        return None;
    }
    let known = |name: &str| USED_BY.iter().find(|(crate_name, _)| *crate_name == name);
    match (known(user), known(used)) {
        (None, _) => {
            Some(format!("crate {user} has no place in the order of the crates; give it one in the design and here"))
        }
        (_, Some((_, users))) if users.contains(&user) => None,
        _ => Some(format!("crate {user} may not use {used}: that is no edge of the design")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_of_the_design_are_allowed_and_no_others() {
        assert_eq!(forbidden("fit-ls", "adaptive"), None);
        assert_eq!(forbidden("xtask", "fit-ls"), None);
        for (user, used) in [
            ("adaptive", "fit-ls"),
            ("thb-core", "thb-core"),
            ("cli", "thb-core"),
            ("fit-ls", "xtask"),
            ("new", "thb-core"),
        ] {
            assert!(forbidden(user, used).is_some(), "{user} uses {used}");
        }
    }

    #[test]
    fn the_order_has_no_cycle() {
        // Again and again drop the crates that use none of those left.
        let mut rest: Vec<&str> = USED_BY.iter().map(|(name, _)| *name).collect();
        while !rest.is_empty() {
            let before = rest.len();
            let used: Vec<&str> = rest.clone();
            rest.retain(|user| USED_BY.iter().any(|(name, users)| used.contains(name) && users.contains(user)));
            assert!(rest.len() < before, "a cycle among {rest:?}");
        }
    }
}
