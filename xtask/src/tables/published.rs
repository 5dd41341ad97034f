//! The networks as published: what their logs say.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use sha2::{Digest, Sha256};

use super::markdown::{factor, figure, table};
use crate::chart::{Chart, Series, svg};

/// The folder of the committed logs, below the root, and the list of their runs.
const FOLDER: &str = "docs/results/training";
const LIST: &str = "runs.tsv";
const HEADER: &str = "run\tsteps\tweights (SHA-256)\tcommand";

/// Files in the folder of a run.
const LOG: &str = "log.csv";
const WEIGHTS: &str = "weights.safetensors";

/// Degrees of Table 4.1, its networks and the printed mean squared errors.
const DEGREES: [usize; 4] = [2, 3, 4, 5];
const NETWORKS: [(&str, &str, [f64; 4]); 5] = [
    ("mlp", "MLP", [3.78e-5, 1.17e-4, 1.13e-4, 1.60e-4]),
    ("tra", "TRA", [1.58e-2, 9.94e-3, 6.69e-3, 4.94e-3]),
    ("res", "RES", [2.82e-4, 3.40e-4, 2.48e-4, 2.09e-4]),
    ("ppn", "PPN", [7.8e-5, 1.3e-4, 1.4e-4, 1.5e-4]),
    ("cnn", "CNN", [2.22e-5, 4.55e-5, 2.72e-5, 2.22e-5]),
];

/// The log of a run.
struct Run {
    name: String,
    weights: String,
    command: String,
    /// Names of the columns, and their numbers at each validation.
    columns: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Run {
    fn column(&self, name: &str) -> Option<Vec<f64>> {
        let place = self.columns.iter().position(|column| column == name)?;
        Some(self.rows.iter().map(|row| row[place]).collect())
    }

    fn last(&self, name: &str) -> Option<f64> {
        self.column(name)?.pop()
    }

    /// The first error of the validation.
    fn error_column(&self) -> Option<&str> {
        self.columns.iter().map(String::as_str).find(|name| name.starts_with("mse "))
    }

    /// By how much the error of the validation changed over the last fifth of the steps, in percent.
    fn slope(&self) -> Option<f64> {
        let errors = self.column(self.error_column()?)?;
        let steps = self.column("step")?;
        let end = *steps.last()?;
        let before = steps.iter().rposition(|&step| step <= 0.8 * end)?;
        // Means of a tenth of the run each: single validations are noisy.
        let width = (errors.len() / 10).max(1);
        let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len().max(1) as f64;
        let first = mean(&errors[(before + 1).saturating_sub(width)..=before]);
        Some(100.0 * (mean(&errors[errors.len() - width..]) / first - 1.0))
    }

    fn parse(name: &str, weights: &str, command: &str, log: &str) -> Result<Self> {
        let mut lines = log.lines();
        let columns: Vec<String> = lines.next().unwrap_or_default().split(',').map(str::to_owned).collect();
        let row = |line: &str| -> Result<Vec<f64>> {
            let row: Vec<f64> = line.split(',').map(|x| Ok(x.parse()?)).collect::<Result<_>>()?;
            ensure!(row.len() == columns.len(), "{} columns in place of {}", row.len(), columns.len());
            Ok(row)
        };
        let rows = lines.map(row).collect::<Result<_>>().with_context(|| format!("the log of {name}"))?;
        Ok(Self { name: name.into(), weights: weights.into(), command: command.into(), columns, rows })
    }
}

/// Takes logs and checksums from the folders of runs, those without a log left out.
///
/// # Errors
/// What reading and writing meet.
pub fn collect(root: &Path, runs: &Path) -> Result<usize> {
    let folder = root.join(FOLDER);
    std::fs::create_dir_all(&folder)?;
    let mut list = listed(&folder)?;
    let mut count = 0;
    for entry in std::fs::read_dir(runs).with_context(|| format!("cannot read {}", runs.display()))? {
        let run = entry?.path();
        let Ok(log) = std::fs::read_to_string(run.join(LOG)) else { continue };
        let name = run.file_name().context("no name")?.to_string_lossy().into_owned();
        let bytes = std::fs::read(run.join(WEIGHTS)).with_context(|| format!("no weights in {}", run.display()))?;
        let digest: String = Sha256::digest(&bytes).iter().map(|byte| format!("{byte:02x}")).collect();
        let steps = log.lines().last().and_then(|line| line.split(',').next()).unwrap_or("0").to_owned();
        list.insert(name.clone(), format!("{steps}\t{digest}\t{}", command_of(&bytes)?));
        std::fs::write(folder.join(format!("{name}.csv")), log)?;
        count += 1;
    }
    let lines: String = list.iter().map(|(name, rest)| format!("{name}\t{rest}\n")).collect();
    std::fs::write(folder.join(LIST), format!("{HEADER}\n{lines}"))?;
    Ok(count)
}

/// The command in the notes of a weights file.
fn command_of(bytes: &[u8]) -> Result<String> {
    let length = bytes.first_chunk::<8>().context("no weights file")?;
    let header = bytes.get(8..8 + u64::from_le_bytes(*length) as usize).context("no weights file")?;
    let header: serde_json::Value = serde_json::from_slice(header)?;
    Ok(header["__metadata__"]["command"].as_str().context("no command in the weights")?.to_owned())
}

fn listed(folder: &Path) -> Result<BTreeMap<String, String>> {
    let Ok(text) = std::fs::read_to_string(folder.join(LIST)) else { return Ok(BTreeMap::new()) };
    let pair = |line: &str| {
        line.split_once('\t').map(|(a, b)| (a.to_owned(), b.to_owned())).with_context(|| format!("{LIST}: {line}"))
    };
    text.lines().skip(1).map(pair).collect()
}

/// The committed logs.
fn committed(root: &Path) -> Result<BTreeMap<String, Run>> {
    let folder = root.join(FOLDER);
    let mut runs = BTreeMap::new();
    for (name, rest) in listed(&folder)? {
        let [_, weights, command] = rest.split('\t').collect::<Vec<_>>()[..] else {
            anyhow::bail!("{LIST}: {name} has not four fields")
        };
        let log =
            std::fs::read_to_string(folder.join(format!("{name}.csv"))).with_context(|| format!("no log of {name}"))?;
        runs.insert(name.clone(), Run::parse(&name, weights, command, &log)?);
    }
    Ok(runs)
}

/// Errors of the validation against steps, a chart for each degree of Table 4.1; dashed, the best standard parameters.
///
/// # Errors
/// Logs that cannot be read.
pub fn curves(root: &Path) -> Result<String> {
    let runs = committed(root)?;
    let line = |run: &Run, column: &str| -> Vec<[f64; 2]> {
        let (steps, errors) = (run.column("step").unwrap_or_default(), run.column(column).unwrap_or_default());
        steps.into_iter().zip(errors).map(|(step, error)| [step, error]).collect()
    };
    let chart = |degree: usize| {
        let mut series = Vec::new();
        for (colour, (file, name, _)) in NETWORKS.iter().enumerate() {
            let Some(run) = runs.get(&format!("{file}-{degree}")) else { continue };
            let points = line(run, "mse 2d+1");
            series.push(Series { name: (*name).into(), points, colour, dashed: false });
        }
        if let Some(run) = runs.values().find(|run| run.name.ends_with(&format!("-{degree}"))) {
            let points = line(run, "std 2d+1");
            series.push(Series { name: "STD".into(), points, colour: NETWORKS.len(), dashed: true });
        }
        Chart { title: format!("MSE, d = {degree}"), x_label: "steps".into(), series, ..Chart::default() }
    };
    Ok(svg(&DEGREES.map(chart)))
}

/// The page from the committed logs.
///
/// # Errors
/// Logs that cannot be read.
pub fn document(root: &Path) -> Result<String> {
    let runs = committed(root)?;
    let mut text = String::from(INTRODUCTION);
    text += &table_4_1(&runs);
    text += &pargcn(&runs);
    text += BUDGETS;
    text += &budgets(&runs);
    Ok(text)
}

fn table_4_1(runs: &BTreeMap<String, Run>) -> String {
    let mut rows = Vec::new();
    for (k, degree) in DEGREES.into_iter().enumerate() {
        let found: Vec<(usize, &Run)> = NETWORKS
            .iter()
            .enumerate()
            .filter_map(|(n, (file, ..))| Some((n, runs.get(&format!("{file}-{degree}"))?)))
            .collect();
        let mut ranked: Vec<usize> = found.iter().map(|(n, _)| *n).collect();
        let error = |n: usize| found.iter().find(|(m, _)| *m == n).and_then(|(_, run)| run.last("mse 2d+1"));
        ranked.sort_by(|&a, &b| error(a).unwrap_or(f64::NAN).total_cmp(&error(b).unwrap_or(f64::NAN)));
        for (n, run) in &found {
            let (_, name, printed) = NETWORKS[*n];
            let mse = run.last("mse 2d+1").unwrap_or(f64::NAN);
            let mut printed_ranked: Vec<usize> = found.iter().map(|(m, _)| *m).collect();
            printed_ranked.sort_by(|&a, &b| NETWORKS[a].2[k].total_cmp(&NETWORKS[b].2[k]));
            let place =
                |order: &[usize]| order.iter().position(|m| m == n).map_or(String::new(), |p| (p + 1).to_string());
            rows.push(vec![
                format!("{name}, d = {degree}"),
                figure(printed[k]),
                figure(mse),
                factor(mse, printed[k]),
                figure(run.last("std 2d+1").unwrap_or(f64::NAN)),
                place(&printed_ranked),
                place(&ranked),
                format!("{:.0}", run.last("step").unwrap_or(0.0)),
                format!("{:+.0} %", run.slope().unwrap_or(f64::NAN)),
            ]);
        }
    }
    let header =
        ["network", "MSE, printed", "here", "factor", "STD here", "rank, printed", "here", "steps", "last fifth"];
    String::from(TABLE_4_1) + &table(&header, &rows)
}

fn pargcn(runs: &BTreeMap<String, Run>) -> String {
    let Some(run) = runs.get("pargcn") else { return String::new() };
    let columns = ["step", "train_mse", "mse 200 heights", "lpsp 200 heights", "parameter error 200 heights"];
    let Some(columns) = columns.into_iter().map(|name| run.column(name)).collect::<Option<Vec<_>>>() else {
        return String::new();
    };
    let row = |k: usize| {
        vec![
            format!("{:.0}", columns[0][k]),
            format!("{:.1}", columns[0][k] / 1e4),
            figure(columns[1][k]),
            figure(columns[2][k]),
            figure(columns[2][k] / 3.0),
            figure(columns[3][k]),
            format!("{:.4}", columns[4][k]),
        ]
    };
    let header = [
        "steps",
        "epochs",
        "MSE in training",
        "MSE, validation",
        "averaged over coordinates",
        "LPSP, validation",
        "parameters off by",
    ];
    String::from(PARGCN) + &table(&header, &(0..run.rows.len()).map(row).collect::<Vec<_>>())
}

fn budgets(runs: &BTreeMap<String, Run>) -> String {
    let row = |run: &Run| {
        let steps = format!("{:.0}", run.last("step").unwrap_or(0.0));
        let hours = format!("{:.2}", run.last("seconds").unwrap_or(0.0) / 3600.0);
        vec![run.name.clone(), steps, hours, format!("`{}…`", &run.weights[..16]), format!("`{}`", run.command)]
    };
    let header = ["run", "steps", "hours by the clock", "weights (SHA-256)", "command"];
    table(&header, &runs.values().map(row).collect::<Vec<_>>())
}

const INTRODUCTION: &str = "\
# The networks as published

    RAYON_NUM_THREADS=1 nice cargo xtask train NETWORK --recipe published … --out target/recipes/NAME
    cargo xtask tables published --runs target/recipes

The first command trains (all commands stand in the last table; `--resume` goes on), the second copies logs and checksums to
`docs/results/training` and writes this page; without `--runs` it writes the page from the logs that are there. Weights are not
committed, and nothing that ships was trained like this.

What is printed was taken: architecture, loss, data, optimizer, rate, momentum, kernel, sequence lengths, neighbourhoods, precision.
Where the print is silent:

| network | silent on | taken |
|---|---|---|
| all | initial weights | PyTorch's defaults: evenly distributed within ±1/√inputs, biases too |
| PARCNN, MLP, TRA, RES, PPN | batch, decay of the mean square, patience, number of steps | 32; 0.99 (PyTorch's default); 20 validations of 1000 steps each, the compared ones equal steps; the budget |
| MLP, TRA, RES, PPN | optimizer and rate | those of PARCNN: RMSprop, 1e-5, momentum 0.9 |
| RES | batch normalization when asked | statistics of the windows at hand and 64 random sequences |
| PARGCN | batch; momentum 0.9 of Adam; statistics of batch normalization | one cloud; the decay of Adam's mean, its default; those of the cloud at hand |
| BIDGCN, DGCNN | what a plateau is, by how much the rate falls | as in the authors' program (github.com/felixfeliz/BIDGCN): PyTorch's defaults, looked at once an epoch, so that within one epoch the rate is 0.1 |

The text trains PARCNN and PARGCN on sets drawn once or without end, it does not say; here PARCNN's sequences are fresh in each step,
PARGCN's 10,000 and BIDGCN's 100,000 clouds are drawn once and shuffled each epoch. Double precision (BIDGCN, DGCNN) is in the
passes and in the weights, which are kept as two singles each. Rotations of BIDGCN's clouds are even on SO(3); in the authors'
program they prefer some axes.
";

const TABLE_4_1: &str = "
## Table 4.1: ranking at equal steps

MSE on 500 fixed sequences of 2d + 1 points, at the end of the run; the print has 100 others. STD is the best of uniform, centripetal and
chord length on the same 500. *Last fifth*: how the error changed over the last fifth of the steps: where it is below −5 % it was still
falling, and the figure is that of an unfinished training. The print names no number of steps, so neither figures nor ranks can refute it; they
say what this many steps give. Networks that are missing have not been trained yet.

![Errors against steps](figures/published.svg)

";

const PARGCN: &str = "
## PARGCN

10,000 clouds of 264 points, 2,500 for validation (others than those of training, the same family); 50 epochs are printed, with MSE
1.59e-4 on 100 test clouds without the correction (example 4.2.7 (a)). The printed figure is averaged over the coordinates, as all of the
chapter's are (see [classical.md](classical.md)); columns of ours are sums but where it is said.

";

const BUDGETS: &str = "
## Runs

One thread at the lowest priority on a shared machine of two cores: hours by the clock are more than hours of a core.

";
