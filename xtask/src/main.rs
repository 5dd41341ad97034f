//! `cargo xtask`: see `cargo xtask --help`.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::{Parser, Subcommand};
use param_nn::{GriddedSpec, ScatteredSpec};
use xtask::claims::{self, Again, Claims};
use xtask::corpus::{self, Corpus, Vary};
use xtask::fuzz::Fuzz;
use xtask::generate::surface::{Kind, Layout};
use xtask::generate::{Noise, Sample};
use xtask::generate::{fixtures, gridded, scattered, solids};
use xtask::train::Train;
use xtask::{tables, tidy, workspace_root};

/// Where figures go, below the root.
const FIGURES: &str = "docs/results/figures";

/// Chores of the repository.
#[derive(Parser)]
#[command(bin_name = "cargo xtask")]
enum Arguments {
    /// Check the repository: edges between crates, dependencies, licences, module docs, file sizes, fixtures.
    Tidy,
    /// Write manual pages and completions of shells for thb.
    Manual {
        /// The folder to write to.
        #[arg(long, default_value = "target/manual")]
        out: PathBuf,
    },
    /// Generate synthetic data.
    #[command(subcommand)]
    Generate(Generate),
    /// Compute published tables anew and write them to docs/results.
    #[command(subcommand)]
    Tables(Tables),
    /// Write docs/results/claims.md and the count in README.md from xtask/claims.toml, or compute claims anew.
    Claims(ClaimsArguments),
    /// Draw the figures of Imperatore 2024, chapter 5, anew, from the clouds they were made with. Times do not matter; one
    /// thread, RAYON_NUM_THREADS=1, is enough.
    Figures {
        /// A folder with the public clouds of the authors in `thesis/`; without it nothing is drawn.
        #[arg(long)]
        data: Option<PathBuf>,
        /// The folder to write to, docs/results/figures by default.
        #[arg(long)]
        out: Option<PathBuf>,
    },
    /// Fit the scans of xtask/corpus.txt and write docs/results/corpus.md and corpus.jsonl, or compare with them.
    Corpus(CorpusArguments),
    /// One fit of the corpus, in a process of its own.
    #[command(hide = true)]
    CorpusRow {
        /// What to fit, as JSON.
        #[arg(long)]
        job: String,
    },
    /// Train a network.
    #[command(subcommand)]
    Train(Train),
    /// Run the fuzz targets with libFuzzer, or the inputs that are kept without it.
    Fuzz {
        /// Seconds of all targets in sum, by the clock.
        #[arg(long, default_value_t = 600, conflicts_with = "replay")]
        seconds: u64,
        /// Executions of a target in all runs of the state, after which its turn ends. [default: no limit]
        #[arg(long, conflicts_with_all = ["replay", "minimize"])]
        executions: Option<u64>,
        /// Targets, by the names of the files in fuzz/fuzz_targets. [default: all]
        #[arg(long, value_delimiter = ',', conflicts_with = "replay")]
        targets: Vec<String>,
        /// The folder where a run goes on from the one before, target/fuzz by default.
        #[arg(long, conflicts_with = "replay")]
        state: Option<PathBuf>,
        /// The folder of programs that were built before, which are run instead of building them.
        #[arg(long, conflicts_with = "replay")]
        programs: Option<PathBuf>,
        /// Instead keep, as fuzz/corpus, the fewest of the kept and the found inputs that reach as much.
        #[arg(long, conflicts_with_all = ["replay", "seconds"])]
        minimize: bool,
        /// Instead run the inputs in fuzz/corpus and fuzz/regressions once, within the bounds of memory and time.
        #[arg(long)]
        replay: bool,
    },
}

/// Whether claims are written down or computed anew.
#[derive(clap::Args)]
struct ClaimsArguments {
    /// Write nothing; compute so many claims anew, drawn at random, and fail if a figure but a time differs from its page.
    #[arg(long, value_name = "N")]
    check: Option<usize>,
    /// Seed of the draw.
    #[arg(long, default_value_t = 0, requires = "check")]
    seed: u64,
    /// A folder with the clouds that this repository does not hold; without it only claims are drawn that need none.
    #[arg(long, requires = "check")]
    data: Option<PathBuf>,
    /// Draw only claims whose figures stand on this page.
    #[arg(long, requires = "check", value_name = "PAGE")]
    only: Option<String>,
}

impl ClaimsArguments {
    #[expect(clippy::print_stdout, reason = "a command-line program reports to its user")]
    fn run(self, root: &Path) -> Result<()> {
        let list = Claims::read(root)?;
        let findings = match self.check {
            None => {
                claims::write(root, &list)?;
                println!("{}\n{}", claims::PAGE, claims::count_line(&list));
                list.findings(root)?
            }
            Some(count) => {
                let again = Again { count, seed: self.seed, data: self.data.as_deref(), only: self.only.as_deref() };
                let (compared, findings) = again.run(&list, root, &mut |line| println!("{line}"))?;
                println!("{compared} claims computed anew, {} differ", findings.len());
                findings
            }
        };
        findings.iter().for_each(|finding| println!("{finding}"));
        if !findings.is_empty() {
            bail!("{} finding(s)", findings.len());
        }
        Ok(())
    }
}

/// What of the corpus is fitted, and how.
#[derive(clap::Args)]
struct CorpusArguments {
    /// A folder with the scans that this repository does not hold; without it fixtures and generated scans are fitted.
    #[arg(long)]
    data: Option<PathBuf>,
    /// Fit only scans whose names contain this.
    #[arg(long, value_name = "NAME")]
    only: Option<String>,
    /// Methods, as `thb fit --method` names them.
    #[arg(long, value_delimiter = ',', default_value = "auto")]
    methods: Vec<String>,
    /// Compare values of a threshold of the default.
    #[arg(long, value_name = "NAME=VALUE,...")]
    vary: Option<Vary>,
    /// Run every candidate of the default to its end.
    #[arg(long)]
    all_candidates: bool,
    /// Fit on two threads, too, and tell the time.
    #[arg(long)]
    two_threads: bool,
    /// Write nothing; fail if control points, verdicts, shares or errors differ from docs/results/corpus.jsonl.
    #[arg(long)]
    check: bool,
    /// The page to write, docs/results/corpus.md by default; rows go to a file of the same name with the extension jsonl.
    #[arg(long)]
    out: Option<PathBuf>,
}

impl CorpusArguments {
    #[expect(clippy::print_stdout, reason = "a command-line program reports to its user")]
    fn run(self, root: &Path) -> Result<()> {
        let corpus = Corpus {
            root,
            data: self.data.as_deref(),
            only: self.only.as_deref(),
            methods: &self.methods,
            vary: self.vary.as_ref(),
            all_candidates: self.all_candidates,
            two_threads: self.two_threads,
        };
        let rows = corpus.rows(&mut |line| println!("{line}"))?;
        if self.check {
            let findings = corpus::differing(&corpus::from_file(&corpus::file(root))?, &rows);
            findings.iter().for_each(|finding| println!("{finding}"));
            if !findings.is_empty() {
                bail!("{} of {} rows differ", findings.len(), rows.len());
            }
            println!("{} rows are as before", rows.len());
            return Ok(());
        }
        let page = self.out.unwrap_or_else(|| root.join("docs/results/corpus.md"));
        for (path, text) in
            [(page.clone(), corpus::page(&rows)), (page.with_extension("jsonl"), corpus::to_lines(&rows)?)]
        {
            std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
            println!("{}", path.display());
        }
        Ok(())
    }
}

#[derive(Subcommand)]
enum Generate {
    /// Sample random curves and surfaces at sorted random parameters; one file an item: u,x,y and so on.
    Gridded {
        /// What is sampled.
        #[arg(long)]
        kind: gridded::Kind,
        /// Degree, or order of trigonometric curves.
        #[arg(long, default_value_t = 3)]
        degree: usize,
        /// Points along the (first) direction.
        #[arg(long)]
        points: usize,
        /// Points along the second direction of surfaces; as many by default.
        #[arg(long)]
        across: Option<usize>,
        /// Standard deviation of the noise of each coordinate, before the points are scaled into the unit box.
        #[arg(long, default_value_t = 0.0)]
        noise: f64,
        /// Seed of all random numbers.
        #[arg(long, default_value_t = 0)]
        seed: u64,
        /// Number of items.
        #[arg(long, default_value_t = 1)]
        count: u64,
        /// What is written.
        #[arg(long, default_value = "csv")]
        format: gridded::FileFormat,
        /// The folder to write to.
        #[arg(long)]
        out: PathBuf,
    },
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
    /// Write closed shapes of six kinds as meshes, NAME.off, with their sharp edges, NAME.creases, and what is known of them, solids.json.
    Solids {
        /// Kinds of shapes.
        #[arg(long, value_enum, value_delimiter = ',', default_values_t = solids::Kind::ALL)]
        kinds: Vec<solids::Kind>,
        /// Shapes of each kind.
        #[arg(long, default_value_t = 12)]
        count: usize,
        /// Seed of all random numbers.
        #[arg(long, default_value_t = 0)]
        seed: u64,
        /// The folder to write to.
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

/// What the table of whole parts is made of.
#[derive(clap::Args)]
struct SolidsTable {
    /// A folder with meshes, `solids/NAME.off`, and layouts, `layouts/NAME_KIND.json.gz`; without it nothing is fitted.
    #[arg(long)]
    data: Option<PathBuf>,
    /// A Python interpreter with the packages of tests/peers/requirements.txt.
    #[arg(long, value_name = "PROGRAM", default_value = "python3")]
    python: PathBuf,
    /// The program; target/release/thb of the workspace by default.
    #[arg(long, value_name = "PROGRAM")]
    thb: Option<PathBuf>,
    /// Elements along each side of a patch of a given layout.
    #[arg(long, default_value_t = 4)]
    elements: usize,
    /// Generated shapes of each kind.
    #[arg(long, default_value_t = 12)]
    count: usize,
    /// Seed of the generated shapes.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Parts whose names contain one of these, and no others.
    #[arg(long, value_delimiter = ',')]
    only: Vec<String>,
    /// Go on with a run that was cut off, if the code has not changed since.
    #[arg(long)]
    resume: bool,
    /// A folder for meshes, STEP files and finished rows, target/solids by default.
    #[arg(long)]
    steps: Option<PathBuf>,
    /// The file to write, docs/results/solids.md by default.
    #[arg(long)]
    out: Option<PathBuf>,
}

impl SolidsTable {
    /// The page; nothing without data.
    fn document(&self, root: &Path, say: &mut dyn FnMut(&str)) -> Result<Option<String>> {
        let Some(data) = &self.data else {
            say("skipped: solids need --data DIR");
            return Ok(None);
        };
        let folder = self.steps.clone().unwrap_or_else(|| root.join("target/solids"));
        let thb = self.thb.clone().unwrap_or_else(|| root.join("target/release/thb"));
        let solids = tables::solids::Solids {
            data,
            python: &self.python,
            thb: &thb,
            root,
            elements: self.elements,
            count: self.count,
            seed: self.seed,
            only: &self.only,
            resume: self.resume,
            out: &folder,
        };
        tables::solids::document(&solids, say).map(Some)
    }
}

#[derive(Subcommand)]
enum Tables {
    /// Tables 4.1 to 4.5: sequences and grids, learned and classical.
    Parcnn {
        /// A folder with the public grids: `thesis/car2.xml`, `thesis/shiphull_scalePts.xml`, `iea15_blade_grid.csv`;
        /// without it only generated points are used.
        #[arg(long)]
        data: Option<PathBuf>,
        /// Steps in which the networks that ours is compared with are trained; without, they are left out.
        #[arg(long, value_name = "STEPS")]
        train: Option<u64>,
        /// The file to write, docs/results/parcnn.md by default.
        #[arg(long)]
        out: Option<PathBuf>,
    },
    /// Stand-ins for Tables 5.2 and 5.3: quasi-interpolation and least squares, fixed and moving parameters, voids.
    Qi {
        /// A folder with the public clouds, such as `deepdrawingC.xml`; without it only generated clouds are fitted.
        #[arg(long)]
        data: Option<PathBuf>,
        /// The file to write, docs/results/qi.md by default.
        #[arg(long)]
        out: Option<PathBuf>,
    },
    /// Moving parameters (Imperatore 2024, chapter 5): its methods on its clouds, with their figures; G+Smo; foot points;
    /// noise. Times are meant for one thread: RAYON_NUM_THREADS=1.
    Moving {
        /// A folder with the public clouds of the authors in `thesis/`, `deepdrawingC.xml` and the stand-ins; without it
        /// only generated surfaces are used.
        #[arg(long)]
        data: Option<PathBuf>,
        /// G+Smo's fitting as built by tests/peers/build_gismo_fitting.sh, to be run in turn with ours; without it its figures
        /// are those of another day.
        #[arg(long, value_name = "PROGRAM")]
        gismo: Option<PathBuf>,
        /// The file to write, docs/results/moving.md by default; figures go to the folder `figures` beside it.
        #[arg(long)]
        out: Option<PathBuf>,
    },
    /// Tables 3.1 and 3.2: curves whose weights follow their markers; fits of measured curves.
    Curves {
        /// A folder with measured curves, such as `titanium_heat.csv`; without it only generated ones are fitted.
        #[arg(long)]
        data: Option<PathBuf>,
        /// The file to write, docs/results/curves.md by default.
        #[arg(long)]
        out: Option<PathBuf>,
    },
    /// Figure 3.2: weights with hierarchical box splines.
    BoxSplines {
        /// The file to write, docs/results/box-splines.md by default.
        #[arg(long)]
        out: Option<PathBuf>,
    },
    /// Figure 3.7, gross outliers, corrupted patches, and the rules for the smoothing weight.
    Rwls {
        /// A folder with `thesis/nefertiti_up.xml` and `nefertiti_head_8933.obj`; without it only generated clouds are fitted.
        #[arg(long)]
        data: Option<PathBuf>,
        /// The file to write, docs/results/rwls.md by default.
        #[arg(long)]
        out: Option<PathBuf>,
    },
    /// Figures 4.24 to 4.31: BIDGCN, PARGCN, UNIF, RECD and LPSP on scattered clouds. Times are meant for one thread:
    /// RAYON_NUM_THREADS=1.
    Bidgcn {
        /// A folder with the public clouds of the authors in `thesis/`, the meshes `nefertiti_*.obj` and raw scans; without
        /// it only generated clouds are mapped.
        #[arg(long)]
        data: Option<PathBuf>,
        /// Clouds of a cell.
        #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..))]
        clouds: u64,
        /// Steps in which the published form and the ablation are trained; without, they are left out.
        #[arg(long, value_name = "STEPS")]
        train: Option<u64>,
        /// The file to write, docs/results/bidgcn.md by default.
        #[arg(long)]
        out: Option<PathBuf>,
    },
    /// Tables 4.6 to 4.8: PARGCN beside UNIF, RECD and LPSP.
    Pargcn {
        /// A folder with the public clouds of the authors in `thesis/`; without it only generated clouds are mapped.
        #[arg(long)]
        data: Option<PathBuf>,
        /// The file to write, docs/results/pargcn.md by default.
        #[arg(long)]
        out: Option<PathBuf>,
    },
    /// Tables 4.6 to 4.8: UNIF, RECD and LPSP on scattered clouds.
    Classical {
        /// A folder with the public clouds of the authors in `thesis/`; without it only generated clouds are mapped.
        #[arg(long)]
        data: Option<PathBuf>,
        /// The file to write, docs/results/classical.md by default.
        #[arg(long)]
        out: Option<PathBuf>,
    },
    /// Whole parts, on layouts of our own and on given ones: a solid each, measured from its STEP file.
    Solids(SolidsTable),
    /// Compute all pages anew that need no training, and fail if a figure but a time differs from the committed page by more
    /// than a hundredth; writes nothing.
    All {
        /// A folder with the clouds that this repository does not hold.
        #[arg(long, required_unless_present = "quick")]
        data: Option<PathBuf>,
        /// Without data: tables of generated clouds and of fixtures only, a few minutes.
        #[arg(long, conflicts_with = "data")]
        quick: bool,
    },
    /// Chapter 5 at the printed settings.
    Printed {
        /// A folder with the public clouds of the authors in `thesis/`; without it nothing is computed.
        #[arg(long)]
        data: Option<PathBuf>,
        /// The file to write, docs/results/printed.md by default.
        #[arg(long)]
        out: Option<PathBuf>,
    },
    /// What `train --recipe published` came to, from the logs in docs/results/training.
    Published {
        /// A folder with the folders of runs, whose logs are copied first.
        #[arg(long)]
        runs: Option<PathBuf>,
        /// The file to write, docs/results/published.md by default.
        #[arg(long)]
        out: Option<PathBuf>,
    },
    /// Every scan of a surface, fitted with the defaults: reported figures beside those of tests/peers/measure_step.py.
    Truth {
        /// A folder with the scans, by the names in xtask/src/tables/truth/files.rs; without it nothing is fitted.
        #[arg(long)]
        data: Option<PathBuf>,
        /// A Python interpreter with the packages of tests/peers/requirements.txt.
        #[arg(long, value_name = "PROGRAM", default_value = "python3")]
        python: PathBuf,
        /// Fit only files whose names contain this.
        #[arg(long, value_name = "NAME")]
        only: Option<String>,
        /// Take rows of this commit that are finished from the file of `--cache`, also of files that `--only` leaves out.
        #[arg(long)]
        resume: bool,
        /// The file of finished rows, target/truth.jsonl by default; surfaces are written to a folder beside it.
        #[arg(long, value_name = "FILE")]
        cache: Option<PathBuf>,
        /// The file to write, docs/results/truth.md by default.
        #[arg(long)]
        out: Option<PathBuf>,
    },
}

#[expect(clippy::print_stdout, reason = "a command-line program reports to its user")]
fn main() -> Result<()> {
    let root = workspace_root();
    match Arguments::parse() {
        Arguments::Claims(arguments) => arguments.run(&root)?,
        Arguments::Corpus(arguments) => arguments.run(&root)?,
        Arguments::CorpusRow { job } => println!("{}", corpus::run(&job)?),
        Arguments::Train(train) => train.run(&mut |line| println!("{line}"))?,
        Arguments::Figures { data: None, .. } => println!("skipped: the figures need --data DIR"),
        Arguments::Figures { data: Some(data), out } => {
            let figures = tables::moving::figures(&data, &mut |line| println!("{line}"))?;
            let out = out.unwrap_or_else(|| root.join(FIGURES));
            let paths = tables::moving::write_figures(&figures, &out)?;
            paths.iter().for_each(|path| println!("{}", path.display()));
        }
        Arguments::Tables(tables) => write_table(tables, &root, &mut |line| println!("{line}"))?,
        Arguments::Generate(Generate::Gridded { kind, degree, points, across, noise, seed, count, format, out }) => {
            let across = if kind == gridded::Kind::Surface { across.unwrap_or(points) } else { across.unwrap_or(1) };
            let spec = GriddedSpec { shape: kind.shape(degree), size: [points, across], noise };
            let paths = gridded::write(&spec, format, seed, count, &out)?;
            println!("{} items in {}", paths.len(), out.display());
        }
        Arguments::Generate(Generate::Scattered { family, degree, points, noise, seed, count, out }) => {
            let spec = ScatteredSpec { control_points: family.into(), degree, interior: points, noise };
            let paths = scattered::write(&spec, seed, count, &out)?;
            println!("{} clouds in {}", paths.len(), out.display());
        }
        Arguments::Fuzz { seconds, executions, targets, state, programs, minimize, replay } => {
            let state = state.unwrap_or_else(|| root.join("target/fuzz"));
            let fuzz = Fuzz { root: &root, targets, state, programs };
            let say = &mut |line: &str| println!("{line}");
            match (replay, minimize) {
                (true, _) => fuzz.replay()?,
                (_, true) => fuzz.minimize(say)?,
                _ => fuzz.run(seconds, executions.unwrap_or(u64::MAX), say)?,
            }
        }
        Arguments::Manual { out } => {
            for file in xtask::manual::write(&out)? {
                println!("{}", file.display());
            }
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
        Arguments::Generate(Generate::Solids { kinds, count, seed, out }) => {
            let known = solids::write(&out, &kinds, count, seed, &mut |line| println!("{line}"))?;
            println!("{} meshes in {}", known.len(), out.display());
        }
        Arguments::Generate(Generate::Surface { kind, points, layout, noise, seed, out }) => {
            let layout = layout.unwrap_or(kind.layout());
            Sample { kind, layout, points, noise, seed }.write(&out)?;
        }
    }
    Ok(())
}

/// Fails if a page that is computed anew differs.
fn compare_pages(root: &Path, data: Option<&Path>, say: &mut dyn FnMut(&str)) -> Result<()> {
    let findings = tables::all::compare(root, data, say)?;
    findings.iter().for_each(|finding| say(finding));
    if !findings.is_empty() {
        bail!("{} figure(s) differ", findings.len());
    }
    Ok(())
}

/// The page of networks trained as published, its picture written, after the logs of `runs` were added to it.
fn published(runs: Option<&Path>, root: &Path, say: &mut dyn FnMut(&str)) -> Result<String> {
    if let Some(runs) = runs {
        say(&format!("{} runs", tables::published::collect(root, runs)?));
    }
    let picture = [("published.svg", tables::published::curves(root)?)];
    tables::moving::write_figures(&picture, &root.join(FIGURES))?;
    tables::published::document(root)
}

/// Makes the page of one of the tables and writes it.
fn write_table(tables: Tables, root: &Path, say: &mut dyn FnMut(&str)) -> Result<()> {
    let (page, out, missing, text) = match tables {
        Tables::Parcnn { data, train, out } => {
            let missing = data.is_none().then_some("Table 4.5 needs --data DIR and was left out");
            ("parcnn", out, missing, tables::parcnn::document(data.as_deref(), train)?)
        }
        Tables::Bidgcn { data, clouds, train, out } => {
            let missing = data.is_none().then_some("the table of real clouds needs --data DIR and was left out");
            let tables = tables::bidgcn::BidgcnTables { data: data.as_deref(), clouds, train };
            ("bidgcn", out, missing, tables::bidgcn::document(&tables, say)?)
        }
        Tables::Pargcn { data, out } => {
            let missing = data.is_none().then_some("Tables 4.7 and 4.8 need --data DIR and were left out");
            let text = tables::pargcn::document(data.as_deref(), say)?;
            ("pargcn", out, missing, text)
        }
        Tables::Qi { data, out } => {
            let missing = data.is_none().then_some("tables of measured clouds need --data DIR and were left out");
            ("qi", out, missing, tables::qi::document(data.as_deref())?)
        }
        Tables::Moving { data, gismo, out } => {
            let missing = data.is_none().then_some("tables of public clouds need --data DIR and were left out");
            let page = tables::moving::page(data.as_deref(), gismo.as_deref(), say)?;
            let beside = out.as_ref().map(|out| out.with_file_name("figures"));
            let folder = beside.unwrap_or_else(|| root.join(FIGURES));
            tables::moving::write_figures(&page.figures, &folder)?;
            ("moving", out, missing, page.text)
        }
        Tables::Curves { data, out } => {
            let missing = data.is_none().then_some("the table of measured curves needs --data DIR and was left out");
            ("curves", out, missing, tables::curves::document(data.as_deref())?)
        }
        Tables::BoxSplines { out } => ("box-splines", out, None, tables::box_splines::document()?),
        Tables::Rwls { data, out } => {
            let missing = data.is_none().then_some("measured clouds need --data DIR and were left out");
            ("rwls", out, missing, tables::rwls::document(data.as_deref())?)
        }
        Tables::Solids(solids) => {
            let Some(page) = solids.document(root, say)? else { return Ok(()) };
            ("solids", solids.out, None, page)
        }
        Tables::Truth { data, python, only, resume, cache, out } => {
            let Some(data) = data else {
                say("the table needs --data DIR and was not made");
                return Ok(());
            };
            let cache = cache.unwrap_or_else(|| root.join("target/truth.jsonl"));
            let truth =
                tables::truth::Truth { data: &data, python: &python, only: only.as_deref(), cache: &cache, resume };
            ("truth", out, None, tables::truth::document(&truth, say)?)
        }
        Tables::All { data, .. } => return compare_pages(root, data.as_deref(), say),
        Tables::Printed { data, out } => {
            let Some(data) = data else {
                say("skipped: the page needs --data DIR");
                return Ok(());
            };
            ("printed", out, None, tables::moving::printed_settings(&data, say)?)
        }
        Tables::Published { runs, out } => ("published", out, None, published(runs.as_deref(), root, say)?),
        Tables::Classical { data, out } => {
            let missing = data.is_none().then_some("Tables 4.7 and 4.8 need --data DIR and were left out");
            ("classical", out, missing, tables::classical::document(data.as_deref())?)
        }
    };
    let path = out.unwrap_or_else(|| root.join(format!("docs/results/{page}.md")));
    std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    missing.into_iter().for_each(&mut *say);
    say(&path.display().to_string());
    Ok(())
}
