//! `cargo xtask`: see `cargo xtask --help`.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::{Parser, Subcommand};
use param_nn::{ScatteredSpec, TrainOptions, Variant};
use xtask::generate::surface::{Kind, Layout};
use xtask::generate::{Noise, Sample};
use xtask::generate::{fixtures, scattered};
use xtask::train::Run;
use xtask::{tables, tidy, workspace_root};

/// Chores of the repository.
#[derive(Parser)]
#[command(bin_name = "cargo xtask")]
enum Arguments {
    /// Check the repository: edges between crates, dependencies, licences, module docs, file sizes, fixtures.
    Tidy,
    /// Generate synthetic data.
    #[command(subcommand)]
    Generate(Generate),
    /// Compute published tables anew and write them to docs/results.
    #[command(subcommand)]
    Tables(Tables),
    /// Train a network.
    #[command(subcommand)]
    Train(Train),
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
    /// Sample random polynomial surfaces at random parameters; one CSV file a cloud: u,v,x,y,z,boundary.
    Scattered {
        /// The control points.
        #[arg(long)]
        family: scattered::Family,
        /// Degree of the surfaces.
        #[arg(long, default_value_t = 2)]
        degree: usize,
        /// Points inside; the boundary gets 4(⌈√points⌉ + 1) further ones.
        #[arg(long)]
        points: usize,
        /// Standard deviation of the noise of each coordinate, before the cloud is scaled into the unit cube.
        #[arg(long, default_value_t = 0.0)]
        noise: f64,
        /// Seed of all random numbers.
        #[arg(long, default_value_t = 0)]
        seed: u64,
        /// Number of clouds.
        #[arg(long, default_value_t = 1)]
        count: u64,
        /// The folder to write to.
        #[arg(long)]
        out: PathBuf,
    },
}

#[derive(Subcommand)]
enum Train {
    /// BIDGCN, which parameterizes scattered clouds. Run it in one thread: RAYON_NUM_THREADS=1.
    Bidgcn {
        /// Steps, one cloud each.
        #[arg(long)]
        steps: u64,
        /// Largest learning rate.
        #[arg(long, default_value_t = 3e-3)]
        rate: f64,
        /// Seed of weights and clouds.
        #[arg(long, default_value_t = 0)]
        seed: u64,
        /// The form as published: points are not turned into the frame of the boundary.
        #[arg(long)]
        plain: bool,
        /// The ablation without the boundary-informed input layer (DGCNN).
        #[arg(long)]
        ablation: bool,
        /// The folder of the run: checkpoint, weights, log and curve.
        #[arg(long)]
        out: PathBuf,
        /// Go on from the checkpoint in the folder; rate, seed and form are then taken from it. With other `steps` the
        /// rate goes on along the curve of the new length.
        #[arg(long)]
        resume: bool,
        /// Minutes between checkpoints.
        #[arg(long, default_value_t = 3.0)]
        minutes: f64,
    },
}

#[derive(Subcommand)]
enum Tables {
    /// Tables 4.6 to 4.8: UNIF, RECD and LPSP on scattered clouds.
    Classical {
        /// A folder with the public clouds of the authors in `thesis/`; without it only generated clouds are mapped.
        #[arg(long)]
        data: Option<PathBuf>,
        /// The file to write, docs/results/classical.md by default.
        #[arg(long)]
        out: Option<PathBuf>,
    },
}

#[expect(clippy::print_stdout, reason = "a command-line program reports to its user")]
fn main() -> Result<()> {
    let root = workspace_root();
    match Arguments::parse() {
        Arguments::Train(Train::Bidgcn { steps, rate, seed, plain, ablation, out, resume, minutes }) => {
            let variant = if ablation { Variant::Dgcnn } else { Variant::Bidgcn };
            let options = TrainOptions { variant, frame: !plain, steps, rate, seed };
            let flags = [(plain, " --plain"), (ablation, " --ablation")];
            let flags: String = flags.into_iter().filter_map(|(set, flag)| set.then_some(flag)).collect();
            let command = format!("cargo xtask train bidgcn --steps {steps} --rate {rate} --seed {seed}{flags}");
            Run { options, out, resume, minutes, command }.train(|line| println!("{line}"))?;
        }
        Arguments::Tables(Tables::Classical { data, out }) => {
            let path = out.unwrap_or_else(|| root.join("docs/results/classical.md"));
            let text = tables::classical::document(data.as_deref())?;
            std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
            if data.is_none() {
                println!("Tables 4.7 and 4.8 need --data DIR and were left out");
            }
            println!("{}", path.display());
        }
        Arguments::Generate(Generate::Scattered { family, degree, points, noise, seed, count, out }) => {
            let spec = ScatteredSpec { control_points: family.into(), degree, interior: points, noise };
            let paths = scattered::write(&spec, seed, count, &out)?;
            println!("{} clouds in {}", paths.len(), out.display());
        }
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
