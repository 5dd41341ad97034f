//! `cargo xtask`: see `cargo xtask --help`.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::{Parser, Subcommand};
use xtask::generate::fixtures;
use xtask::generate::surface::{Kind, Layout};
use xtask::generate::{Noise, Sample};
use xtask::{tidy, workspace_root};

/// Chores of the repository.
#[derive(Parser)]
#[command(bin_name = "cargo xtask")]
enum Arguments {
    /// Check the repository: edges between crates, dependencies, licences, module docs, file sizes, fixtures.
    Tidy,
    /// Generate synthetic data.
    #[command(subcommand)]
    Generate(Generate),
}

#[derive(Subcommand)]
enum Generate {
    /// Write the synthetic files of the folder fixtures.
    Fixtures {
        /// Write nothing; fail if a file differs from what would be written.
        #[arg(long)]
        check: bool,
    },
    /// Sample a surface; the extension chooses the format: .csv, .xyz, .off, .obj, .ply.
    Surface {
        /// The surface.
        #[arg(long)]
        kind: Kind,
        /// Number of points, those on the boundary included.
        #[arg(long)]
        points: usize,
        /// Where points lie in the parameter square; by default as befits the surface.
        #[arg(long)]
        layout: Option<Layout>,
        /// Standard deviation of the noise of each coordinate, in units of the surface or, as `0.1%`, of the diagonal
        /// of its bounding box.
        #[arg(long, default_value = "0")]
        noise: Noise,
        /// Seed of all random numbers.
        #[arg(long, default_value_t = 0)]
        seed: u64,
        /// The file to write.
        #[arg(long)]
        out: PathBuf,
    },
}

#[expect(clippy::print_stdout, reason = "a command-line program reports to its user")]
fn main() -> Result<()> {
    let root = workspace_root();
    match Arguments::parse() {
        Arguments::Tidy => {
            let findings = tidy::check(&root)?;
            findings.iter().for_each(|finding| println!("{finding}"));
            if !findings.is_empty() {
                bail!("{} finding(s)", findings.len());
            }
            println!("tidy");
        }
        Arguments::Generate(Generate::Fixtures { check }) => {
            let folder = root.join(fixtures::FOLDER);
            if !check {
                fixtures::write(&folder)?;
            }
            let differing = fixtures::differing(&folder)?;
            if !differing.is_empty() {
                bail!("not as generated: {}", differing.join(", "));
            }
            println!("{} files are as generated", fixtures::FIXTURES.len());
        }
        Arguments::Generate(Generate::Surface { kind, points, layout, noise, seed, out }) => {
            let layout = layout.unwrap_or(kind.layout());
            Sample { kind, layout, points, noise, seed }.write(&out)?;
        }
    }
    Ok(())
}
