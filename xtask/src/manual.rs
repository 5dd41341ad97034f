//! Manual pages and completions of shells, from the arguments of `thb`.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::CommandFactory;
use clap_complete::{Shell, generate_to};

use crate::args;

/// Writes `man/man1/thb.1` and one page a command, and `completions/` for bash, elvish, fish, PowerShell and zsh below a folder; returns
/// the files.
pub fn write(out: &Path) -> Result<Vec<PathBuf>> {
    let (pages, completions) = (out.join("man").join("man1"), out.join("completions"));
    for folder in [&pages, &completions] {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    }
    // All options, not only those of -h.
    clap_mangen::generate_to(args::Cli::command(), &pages)?;
    let shells = [Shell::Bash, Shell::Elvish, Shell::Fish, Shell::PowerShell, Shell::Zsh];
    for shell in shells {
        generate_to(shell, &mut args::Cli::command(), "thb", &completions)?;
    }
    let mut files = Vec::new();
    for folder in [pages, completions] {
        for entry in std::fs::read_dir(&folder).with_context(|| format!("cannot list {}", folder.display()))? {
            files.push(entry?.path());
        }
    }
    files.sort();
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_has_a_page_and_every_shell_its_options() {
        let folder = tempfile::tempdir().unwrap();
        let files = write(folder.path()).unwrap();
        let text = |name: &str| {
            let file = files.iter().find(|path| path.ends_with(name)).unwrap_or_else(|| panic!("{name} in {files:?}"));
            std::fs::read_to_string(file).unwrap()
        };
        for command in ["", "-fit", "-index", "-fit-curve", "-param", "-eval", "-convert", "-compare", "-info"] {
            assert!(text(&format!("man/man1/thb{command}.1")).contains("\n.SH SYNOPSIS"), "{command}");
        }
        // Options that -h does not show, with what they mean.
        let page = text("thb-fit.1");
        for option in ["max\\-dofs", "Largest number of control points", "Options for a kind of scan"] {
            assert!(page.contains(option), "{option}");
        }
        for shell in ["thb.bash", "thb.elv", "thb.fish", "_thb.ps1", "_thb"] {
            assert!(["max-dofs", "resume"].iter().all(|word| text(shell).contains(word)), "{shell}");
        }
        // Elvish and PowerShell get no values.
        for shell in ["thb.bash", "thb.fish", "_thb"] {
            assert!(text(shell).contains("terrain"), "{shell}");
        }
    }
}
