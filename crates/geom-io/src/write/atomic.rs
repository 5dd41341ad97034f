//! Whole files or none.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use tempfile::NamedTempFile;

use crate::error::WriteError;

/// Writes a file whole or not at all.
///
/// The content goes to a temporary file in the same folder, which takes the place of `path` once it is complete and
/// on disk. Whatever fails before, a file that was there stays as it was, and nothing is left behind.
/// A symbolic link stays one: its target is replaced. Pipes and devices are written to directly.
/// Permissions are those of a new file (on Unix 0666 less the umask).
///
/// # Errors
/// [`WriteError::Io`] with the system's reason, or with the error of `content`.
pub fn write_atomically(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), WriteError> {
    let write = || {
        let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        match fs::metadata(&target) {
            Ok(found) if found.is_dir() => Err(io::ErrorKind::IsADirectory.into()),
            // Renaming would put an ordinary file in the place of, say, /dev/null.
            Ok(found) if !found.is_file() => fill(&File::options().write(true).open(&target)?, content),
            _ => replace(&target, content),
        }
    };
    write().map_err(|reason| WriteError::Io { path: path.to_owned(), reason })
}

/// Checks that [`write_atomically`] could make a file, in directories that may have to be made before. Leaves nothing behind.
///
/// # Errors
/// [`WriteError::Io`] with the system's reason.
pub fn check_writable(path: &Path) -> Result<(), WriteError> {
    let check = || {
        let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        match fs::metadata(&target) {
            Ok(found) if found.is_dir() => Err(io::ErrorKind::IsADirectory.into()),
            // Opening a pipe waits for its reader.
            Ok(found) if !found.is_file() => Ok(()),
            _ => {
                let there = folder(&target).ancestors().find(|folder| folder.exists());
                temporary_in(there.unwrap_or(Path::new("."))).map(drop)
            }
        }
    };
    check().map_err(|reason| WriteError::Io { path: path.to_owned(), reason })
}

fn folder(target: &Path) -> &Path {
    match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

fn temporary_in(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    // The crate's own default, 0600, would keep others from reading the result.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.prefix(".").suffix(".part").tempfile_in(folder)
}

fn replace(target: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let file = temporary_in(folder(target))?;
    fill(file.as_file(), content)?;
    // Otherwise a power cut after the rename could leave an empty file under the name of a complete one.
    file.as_file().sync_all()?;
    file.persist(target)?;
    Ok(())
}

fn fill(file: &File, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut writer = BufWriter::new(file);
    content(&mut writer)?;
    writer.flush()
}
