//! Whole files or none.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::NamedTempFile;

use crate::error::WriteError;

/// Limit: symbolic links that lead to one another, as the system has it.
const MAX_LINKS: usize = 40;

/// Files that are being written, under their temporary names.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes what is being written, for a process that is about to end. No other file is begun while the result lives.
#[must_use = "files are begun again once it is dropped"]
pub fn remove_unfinished() -> impl Sized {
    let files = unfinished();
    for path in files.iter() {
        // One that was renamed in the meantime is finished.
        let _ = fs::remove_file(path);
    }
    files
}

/// Writes a file whole or not at all.
///
/// The content goes to a temporary file in the same folder, which takes the place of `path` once it is complete and
/// on disk. Whatever fails before, a file that was there stays as it was, and nothing is left behind.
/// A symbolic link stays one: its target is replaced, or made where there is none. Pipes and devices are written to directly.
/// Permissions are those of a new file (on Unix 0666 less the umask).
///
/// # Errors
/// [`WriteError::Io`] with the system's reason, or with the error of `content`.
pub fn write_atomically(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), WriteError> {
    let write = || {
        let target = target_of(path)?;
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
        let target = target_of(path)?;
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

/// The file that a path stands for, there or not: where symbolic links lead.
///
/// # Errors
/// What the system says of links that cannot be read or lead in a circle.
pub fn target_of(path: &Path) -> io::Result<PathBuf> {
    let mut target = path.to_owned();
    for _ in 0..MAX_LINKS {
        match fs::symlink_metadata(&target) {
            Ok(found) if found.is_symlink() => {
                let next = fs::read_link(&target)?;
                target = folder(&target).join(next);
            }
            _ => return Ok(fs::canonicalize(&target).unwrap_or(target)),
        }
    }
    Err(io::Error::other("symbolic links lead to one another"))
}

fn folder(target: &Path) -> &Path {
    match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// A file under a temporary name, known as unfinished until it has its own.
struct Unfinished {
    /// `None` once it has.
    file: Option<NamedTempFile>,
    path: PathBuf,
}

impl Unfinished {
    fn as_file(&self) -> io::Result<&File> {
        self.file.as_ref().map(NamedTempFile::as_file).ok_or_else(|| io::ErrorKind::NotFound.into())
    }

    fn persist(mut self, target: &Path) -> io::Result<()> {
        if let Some(file) = self.file.take() {
            file.persist(target)?;
        }
        Ok(())
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        // Removed before it is forgotten.
        drop(self.file.take());
        unfinished().remove(&self.path);
    }
}

fn temporary_in(folder: &Path) -> io::Result<Unfinished> {
    let mut builder = tempfile::Builder::new();
    // The crate's own default, 0600, would keep others from reading the result.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut files = unfinished();
    let file = builder.prefix(".").suffix(".part").tempfile_in(folder)?;
    let path = file.path().to_owned();
    files.insert(path.clone());
    Ok(Unfinished { file: Some(file), path })
}

fn replace(target: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let file = temporary_in(folder(target))?;
    fill(file.as_file()?, content)?;
    // Otherwise a power cut after the rename could leave an empty file under the name of a complete one.
    file.as_file()?.sync_all()?;
    file.persist(target)
}

fn fill(file: &File, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut writer = BufWriter::new(file);
    content(&mut writer)?;
    writer.flush()
}
