//! Files for what reads only files.

use std::path::{Path, PathBuf};

/// A file that is there while it is used.
pub(super) struct Temporary(PathBuf);

impl Temporary {
    /// A file of a name's ending with these bytes. Targets run one input at a time, so one name a process is enough.
    pub(super) fn new(ending: &str, bytes: &[u8]) -> Self {
        let path = std::env::temp_dir().join(format!("thb-fuzz-{}.{ending}", std::process::id()));
        std::fs::write(&path, bytes).expect("temporary files can be written");
        Self(path)
    }

    /// Where it is.
    pub(super) fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}
