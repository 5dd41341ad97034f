//! A directory of its own for each test, in which `thb` is run.

use std::collections::BTreeSet;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;
use tempfile::TempDir;

/// A directory that vanishes with the value.
pub(crate) struct Lab {
    directory: TempDir,
}

/// What a run of `thb` left.
#[derive(Debug)]
pub(crate) struct Run {
    pub(crate) code: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Lab {
    pub(crate) fn new() -> Self {
        Self { directory: tempfile::tempdir().unwrap() }
    }

    /// A lab with one file.
    pub(crate) fn with(name: &str, content: impl AsRef<[u8]>) -> Self {
        let lab = Self::new();
        lab.put(name, content);
        lab
    }

    pub(crate) fn put(&self, name: &str, content: impl AsRef<[u8]>) {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, content).unwrap();
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    pub(crate) fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub(crate) fn text(&self, name: &str) -> String {
        String::from_utf8(self.bytes(name)).unwrap()
    }

    pub(crate) fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&self.bytes(name)).unwrap()
    }

    /// All files below the directory.
    pub(crate) fn files(&self) -> BTreeSet<String> {
        let root = self.directory.path();
        let mut files = BTreeSet::new();
        let mut open = vec![root.to_owned()];
        while let Some(directory) = open.pop() {
            for entry in std::fs::read_dir(&directory).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    open.push(path);
                } else {
                    files.insert(relative(root, &path));
                }
            }
        }
        files
    }

    /// Runs `thb` with arguments separated by blanks, in the directory and without a terminal. `< FILE` at their end
    /// is its standard input, which is empty otherwise.
    pub(crate) fn thb(&self, arguments: &str) -> Run {
        let (arguments, input) = match arguments.split_once(" < ") {
            Some((arguments, file)) => (arguments, Stdio::from(File::open(self.path(file)).unwrap())),
            None => (arguments, Stdio::null()),
        };
        let output = Command::new(env!("CARGO_BIN_EXE_thb"))
            .args(arguments.split_whitespace())
            .stdin(input)
            .current_dir(self.directory.path())
            .env_remove("RUST_BACKTRACE")
            // STEP files are the same each time.
            .env("SOURCE_DATE_EPOCH", "951782400")
            .output()
            .unwrap();
        let run = Run {
            code: output.status.code().expect("thb was killed"),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        };
        assert!(!run.stderr.contains("panicked"), "thb {arguments}: {}", run.stderr);
        run
    }

    /// Runs `thb`, which succeeds, prints no result, and says nothing but warnings: lines that name a file.
    pub(crate) fn succeeds(&self, arguments: &str) {
        let run = self.thb(arguments);
        let is_warning = |line: &str| line.strip_prefix("thb: ").is_some_and(|line| line.contains(": "));
        assert!(run.code == 0 && run.stdout.is_empty(), "thb {arguments}: {run:?}");
        assert!(run.stderr.lines().all(is_warning), "thb {arguments}: {run:?}");
    }

    /// Runs `thb`, which succeeds and prints JSON.
    pub(crate) fn prints_json(&self, arguments: &str) -> Value {
        let run = self.thb(arguments);
        assert!(run.code == 0 && run.stderr.is_empty(), "thb {arguments}: {run:?}");
        serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("thb {arguments}: {error} in {}", run.stdout))
    }

    /// Runs `thb`, which ends with an exit code and a message that holds all of the given texts, and leaves all files as
    /// they were, without a new one.
    pub(crate) fn fails(&self, arguments: &str, code: i32, texts: &[&str]) {
        let before = self.contents();
        let run = self.thb(arguments);
        assert_eq!(run.code, code, "thb {arguments}: {run:?}");
        assert!(run.stdout.is_empty(), "thb {arguments}: {run:?}");
        for text in texts {
            assert!(run.stderr.contains(text), "thb {arguments}: {text:?} is not in {:?}", run.stderr);
        }
        assert!(self.contents() == before, "thb {arguments}: files were changed: {:?}", self.files());
    }

    fn contents(&self) -> Vec<(String, Vec<u8>)> {
        self.files().into_iter().map(|name| (name.clone(), self.bytes(&name))).collect()
    }
}

/// Numbers of a table with one header line.
pub(crate) fn table(text: &str) -> Vec<Vec<f64>> {
    text.lines().skip(1).map(|line| line.split(',').map(|x| x.parse().unwrap()).collect()).collect()
}

fn relative(root: &Path, path: &Path) -> String {
    let parts: Vec<_> =
        path.strip_prefix(root).unwrap().iter().map(|part| part.to_string_lossy().into_owned()).collect();
    parts.join("/")
}
