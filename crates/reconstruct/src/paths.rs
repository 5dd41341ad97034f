//! Names of files.

use std::path::{Path, PathBuf};

use geom_io::target_of;

/// The same for all names of a file, also of one that is not there yet in a directory that is, or at the end of a link.
pub(crate) fn identity(path: &Path) -> PathBuf {
    let path = &target_of(path).unwrap_or_else(|_| path.to_owned());
    let of_parent = || {
        let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Some(parent.canonicalize().ok()?.join(path.file_name()?))
    };
    path.canonicalize().ok().or_else(of_parent).unwrap_or_else(|| path.to_owned())
}
