//! Names of files.

use std::path::{Path, PathBuf};

use geom_io::target_of;

/// The same for all names of a file, also of one that is not there yet, in a directory that is not either, or at the end of a link.
pub(crate) fn identity(path: &Path) -> PathBuf {
    let path = &target_of(path).unwrap_or_else(|_| path.to_owned());
    // By the nearest folder that is there: the name stays the same when those between are made.
    let of_ancestor = |ancestor: &Path| {
        let folder = if ancestor.as_os_str().is_empty() { Path::new(".") } else { ancestor };
        Some(folder.canonicalize().ok()?.join(path.strip_prefix(ancestor).ok()?))
    };
    let known = path.canonicalize().ok().or_else(|| path.ancestors().skip(1).find_map(of_ancestor));
    known.unwrap_or_else(|| path.to_owned())
}

/// Whether an output is meant to be a directory: it is one, or its name has no extension or ends in a separator.
pub(crate) fn is_directory(output: &Path) -> bool {
    output.is_dir() || output.extension().is_none() || output.to_string_lossy().ends_with(std::path::is_separator)
}
