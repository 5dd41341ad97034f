//! Files: module docs, sizes, and no traces of the machine they were written on.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

/// Folders of the workspace that hold no sources; in a worktree of Git `.git` is a file.
const SKIPPED: [&str; 5] = [".git", "target", "docs/book", "fuzz/target", "tests/page/node_modules"];

/// Every clone pays for large files, for ever.
const LARGEST: u64 = 2 << 20;

/// Folders at the root of a machine that a portable file has no business with.
const MACHINE_FOLDERS: [&str; 5] = ["work", "root", "home", "Users", "tmp"];

pub(super) fn check(root: &Path) -> Result<Vec<String>> {
    let mut findings = Vec::new();
    for path in files(root)? {
        let name = relative(root, &path).display().to_string();
        let size = path.metadata().with_context(|| format!("cannot read {name}"))?.len();
        if size > LARGEST {
            findings.push(format!("{name} has {size} bytes, more than {LARGEST}"));
            continue;
        }
        let bytes = std::fs::read(&path).with_context(|| format!("cannot read {name}"))?;
        let text = String::from_utf8_lossy(&bytes);
        if path.extension() == Some(OsStr::new("rs")) && !text.starts_with("//!") {
            findings.push(format!("{name} does not open with module docs (//!)"));
        }
        if let Some((line, found)) = machine_path(&text) {
            findings.push(format!("{name}:{line} names a folder of one machine: {found}"));
        }
    }
    Ok(findings)
}

/// A path below a folder.
pub(super) fn relative<'a>(folder: &Path, path: &'a Path) -> &'a Path {
    path.strip_prefix(folder).unwrap_or(path)
}

/// The files of a folder and those below it, in order; links are not followed.
pub(super) fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(inner) = open.pop() {
        for entry in std::fs::read_dir(&inner).with_context(|| format!("cannot list {}", inner.display()))? {
            let entry = entry?;
            let (path, kind) = (entry.path(), entry.file_type()?);
            if SKIPPED.iter().any(|skipped| relative(folder, &path) == Path::new(skipped)) {
                continue;
            }
            if kind.is_dir() {
                open.push(path);
            } else if kind.is_file() && path.extension() != Some(OsStr::new("tmp")) {
                files.push(path);
            }
        }
    }
    files.sort();
    Ok(files)
}

/// The Rust files of a folder and their texts.
pub(super) fn sources(folder: &Path) -> Result<Vec<(PathBuf, String)>> {
    let rust = files(folder)?.into_iter().filter(|path| path.extension() == Some(OsStr::new("rs")));
    rust.map(|path| {
        let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        Ok((path, text))
    })
    .collect()
}

/// The first absolute path into a folder of a machine, with its line.
fn machine_path(text: &str) -> Option<(usize, &str)> {
    // What may stand before a slash that does not start an absolute path: `https://a.b/home/`, `~/tmp/`, `$X/tmp/`.
    let continues = |c: char| c.is_alphanumeric() || "._-~*}>)/\\".contains(c);
    for (number, line) in text.lines().enumerate() {
        for (separator, folder) in MACHINE_FOLDERS.iter().flat_map(|folder| [('/', folder), ('\\', folder)]) {
            let word = format!("{separator}{folder}{separator}");
            let hits = line.match_indices(&word);
            // Windows paths have a drive letter before them.
            let drive = |at: usize| separator == '\\' && line[..at].ends_with(':');
            if let Some((at, found)) =
                hits.into_iter().find(|(at, _)| drive(*at) || separator == '/' && !line[..*at].ends_with(continues))
            {
                return Some((number + 1, &line[at..at + found.len()]));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_into_one_machine_are_found() {
        for folder in MACHINE_FOLDERS {
            let text = format!("first\nread(\"/{folder}/someone/cloud.xyz\")\n");
            assert_eq!(machine_path(&text), Some((2, &*format!("/{folder}/"))));
            assert!(machine_path(&format!("C:\\{folder}\\cloud.xyz")).is_some());
            for harmless in [format!("https://a.example/{folder}/b"), format!("some/{folder}/b"), format!("{folder}/b")]
            {
                assert_eq!(machine_path(&harmless), None, "{harmless}");
            }
        }
    }

    #[test]
    fn this_file_is_among_the_sources_and_build_results_are_not() {
        let root = crate::workspace_root();
        let files = files(&root).unwrap();
        assert!(files.contains(&root.join("xtask/src/tidy/files.rs")));
        assert!(!files.iter().any(|path| path.starts_with(root.join("target")) || path.starts_with(root.join(".git"))));
    }
}
