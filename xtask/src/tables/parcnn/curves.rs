//! Tables 4.1 to 4.3: plane sequences.

use std::fmt::Write as _;

use anyhow::Result;
use ndarray::{Array2, ArrayView2, Axis};
use param_classic::{Rule, parameterize_sequence};
use param_nn::{
    Architecture, Comparison, ComparisonNetwork, Form, GridTrainOptions, GridTrainer, GriddedCloud, GriddedSpec,
    Parcnn, Recipe, Shape, SplineSpace, stream,
};

use super::fitting::{Fitted, adaptive_curve, fit, jointly_moved, polynomials};
use super::{DEGREES, ITEMS, SEED};
use crate::tables::markdown::{factor, figure, table};

/// Classical rules; the best one on the average of a cell is STD.
const RULES: [Rule; 3] = [Rule::Uniform, Rule::Centripetal, Rule::ChordLength];

/// Networks that Table 4.1 compares: MLP, TRA, RES, PPN.
const NETWORKS: [ComparisonNetwork; 4] =
    [ComparisonNetwork::Mlp, ComparisonNetwork::Transformer, ComparisonNetwork::Residual, ComparisonNetwork::Ppn];

/// The transformer is the slowest to train and hardly learns; it gets one step where the others get this many.
const TRANSFORMER_SHARE: u64 = 10;

/// Sequences a training step of the compared networks, and their largest learning rate.
const BATCH: usize = 32;
const RATE: f64 = 2e-3;

/// Seeds of training and of the reference batch; test sequences have another.
const TRAINING_SEED: u64 = 1;

/// Lengths of Tables 4.2 and 4.3.
const LENGTHS: [usize; 3] = [20, 50, 80];

/// Interior knots of Table 4.3.
const INTERIOR_KNOTS: usize = 5;

/// Printed in Table 4.1, MSE, MAX, HSD of STD, MLP, TRA, RES, PPN, CNN. The printed MAX of MLP, TRA, RES and CNN are
/// squares.
const TABLE_1: [[[f64; 6]; 3]; 4] = [
    [
        [2.74e-3, 3.78e-5, 1.58e-2, 2.82e-4, 7.8e-5, 2.22e-5],
        [4.62e-2, 7.60e-5, 2.60e-2, 5.56e-4, 1.0e-2, 4.37e-5],
        [6.17e-2, 7.50e-3, 1.78e-1, 2.27e-2, 8.2e-3, 6.33e-3],
    ],
    [
        [1.86e-3, 1.17e-4, 9.94e-3, 3.40e-4, 1.3e-4, 4.55e-5],
        [6.09e-2, 2.83e-4, 1.53e-2, 6.63e-4, 1.5e-2, 1.23e-4],
        [5.88e-2, 1.45e-2, 1.51e-1, 2.69e-2, 1.2e-2, 9.73e-3],
    ],
    [
        [8.96e-4, 1.13e-4, 6.69e-3, 2.48e-4, 1.4e-4, 2.72e-5],
        [2.11e-2, 2.87e-4, 1.07e-2, 5.32e-4, 1.7e-2, 5.44e-5],
        [4.47e-2, 1.58e-2, 1.31e-1, 2.50e-2, 1.4e-2, 8.05e-3],
    ],
    [
        [4.75e-4, 1.60e-4, 4.94e-3, 2.09e-4, 1.5e-4, 2.22e-5],
        [1.16e-2, 6.52e-4, 9.49e-3, 3.63e-4, 1.9e-2, 6.32e-5],
        [3.41e-2, 1.96e-2, 1.17e-1, 2.41e-2, 1.6e-2, 7.67e-3],
    ],
];

/// Which of the six have squares as MAX.
const SQUARED: [bool; 6] = [false, true, true, true, false, true];

/// Printed in Table 4.2: STD, PPN, CNN for each length.
const TABLE_2: [[[f64; 3]; 3]; 4] = [
    [[2.97e-3, 5.3e-4, 3.21e-5], [1.79e-3, 7.3e-4, 2.23e-5], [1.46e-3, 7.9e-4, 4.13e-5]],
    [[2.20e-3, 6.7e-4, 1.31e-4], [1.43e-3, 8.7e-4, 8.80e-5], [1.41e-3, 8.5e-4, 1.09e-4]],
    [[1.66e-3, 3.3e-4, 7.24e-5], [1.06e-3, 4.3e-4, 5.30e-5], [9.48e-4, 4.1e-4, 6.13e-5]],
    [[1.35e-3, 4.8e-4, 3.71e-5], [7.65e-4, 5.8e-4, 2.50e-5], [5.09e-4, 5.6e-4, 3.55e-5]],
];

/// Printed in Table 4.3, trigonometric, then noisy: STD and CNN for each length.
const TABLE_3: [[[[f64; 2]; 3]; 4]; 2] = [
    [
        [[3.01e-4, 1.56e-5], [2.17e-4, 6.08e-6], [1.71e-4, 5.82e-6]],
        [[1.35e-4, 1.63e-5], [1.10e-4, 1.05e-5], [3.16e-5, 7.84e-6]],
        [[1.74e-4, 5.53e-6], [2.48e-5, 3.66e-6], [3.14e-5, 4.74e-6]],
        [[3.09e-5, 2.54e-6], [1.17e-5, 1.88e-6], [4.03e-5, 1.92e-6]],
    ],
    [
        [[1.27e-4, 7.69e-5], [1.32e-4, 9.46e-5], [1.54e-4, 1.02e-4]],
        [[9.54e-5, 3.36e-5], [1.21e-4, 6.33e-5], [1.12e-4, 7.24e-5]],
        [[7.37e-5, 2.68e-5], [1.66e-4, 8.89e-5], [8.41e-5, 4.04e-5]],
        [[9.02e-5, 2.72e-5], [1.68e-4, 7.64e-5], [1.04e-4, 6.11e-5]],
    ],
];

fn sequences(shape: Shape, count: usize, noise: f64) -> Result<Vec<GriddedCloud>> {
    let spec = GriddedSpec { shape, size: [count, 1], noise };
    (0..ITEMS).map(|index| Ok(spec.sample(&mut stream(SEED, index))?)).collect()
}

fn column(parameters: ndarray::Array1<f64>) -> Array2<f64> {
    parameters.insert_axis(Axis(1))
}

/// MSE, MAX, HSD.
type Errors = [f64; 3];

fn errors(fitted: &Fitted<1>, points: ArrayView2<'_, f64>) -> Result<Errors> {
    Ok([fitted.mse(), fitted.max(), fitted.hausdorff(points)?])
}

/// Means over the sequences.
fn mean(sequences: &[GriddedCloud], mut of: impl FnMut(ArrayView2<'_, f64>) -> Result<Errors>) -> Result<Errors> {
    let mut sums = [0.0; 3];
    for sequence in sequences {
        let errors = of(sequence.points.view())?;
        (0..3).for_each(|k| sums[k] += errors[k] / sequences.len() as f64);
    }
    Ok(sums)
}

/// The best rule for each measure.
fn standard(sequences: &[GriddedCloud], degree: usize) -> Result<Errors> {
    let space = polynomials::<1>(degree)?;
    let mut best = [f64::INFINITY; 3];
    for rule in RULES {
        let errors = mean(sequences, |points| {
            errors(&fit(&column(parameterize_sequence(points, rule)?), points, &space)?, points)
        })?;
        (0..3).for_each(|k| best[k] = best[k].min(errors[k]));
    }
    Ok(best)
}

/// Our network, and the same followed by joint steps.
fn learned(network: &Parcnn, sequences: &[GriddedCloud], degree: usize) -> Result<[Errors; 2]> {
    let space = polynomials::<1>(degree)?;
    let parameters = |points: ArrayView2<'_, f64>| -> Result<Array2<f64>> {
        Ok(column(network.predict_sequence(points, SplineSpace::polynomials(degree))?))
    };
    let fixed = mean(sequences, |points| errors(&fit(&parameters(points)?, points, &space)?, points))?;
    let moved = mean(sequences, |points| errors(&jointly_moved(&parameters(points)?, points, &space)?, points))?;
    Ok([fixed, moved])
}

/// The published form of Table 4.1, trained on sequences of 2d + 1 points.
fn published(degree: usize, steps: u64) -> Result<Parcnn> {
    let form = Form::Published { degree, blocks: 6, width: 30 };
    let architecture = Architecture { dimension: 2, directions: 1, form };
    let mut trainer = GridTrainer::new(GridTrainOptions {
        architecture,
        steps,
        batch: BATCH,
        shortest: true,
        recipe: Recipe::AdamW,
        rate: RATE,
        seed: TRAINING_SEED,
    });
    for _ in 0..steps {
        trainer.step()?;
    }
    Ok(trainer.network("table 4.1"))
}

/// Table 4.1, with the compared networks trained for `steps` steps each, and Table 4.2 with the PPN-like ones of them.
pub(super) fn tables_1_and_2(steps: Option<u64>) -> Result<String> {
    let network = Parcnn::embedded(2, 1)?;
    let (mut first, mut second) = (Vec::new(), Vec::new());
    for ((degree, printed), printed_long) in DEGREES.into_iter().zip(TABLE_1).zip(TABLE_2) {
        let polynomial = Shape::Curve { degree, dimension: 2 };
        let space = polynomials::<1>(degree)?;
        let short = sequences(polynomial, 2 * degree + 1, 0.0)?;
        let standard_errors = standard(&short, degree)?;
        let [ours, moved] = learned(&network, &short, degree)?;
        let mut compared = Vec::new();
        let mut ppn = None;
        if let Some(steps) = steps {
            for kind in NETWORKS {
                let steps = if kind == ComparisonNetwork::Transformer { steps / TRANSFORMER_SHARE } else { steps };
                let trained = Comparison::train(kind, degree, (steps, BATCH), RATE, TRAINING_SEED)?;
                compared.push(mean(&short, |points| {
                    errors(&fit(&column(trained.predict(points, TRAINING_SEED)?), points, &space)?, points)
                })?);
                ppn = (kind == ComparisonNetwork::Ppn).then_some(trained);
            }
            let trained = published(degree, steps)?;
            compared.push(mean(&short, |points| {
                let parameters = trained.predict_unguarded(points, SplineSpace::polynomials(degree))?;
                errors(&fit(&column(parameters), points, &space)?, points)
            })?);
        }
        for (measure, name) in ["MSE", "MAX", "HSD"].into_iter().enumerate() {
            let root = |k: usize| if measure == 1 && SQUARED[k] { printed[1][k].sqrt() } else { printed[measure][k] };
            let mut row = vec![format!("{name}, d = {degree}"), figure(root(0)), figure(standard_errors[measure])];
            for k in 1..6 {
                row.push(figure(root(k)));
                row.push(compared.get(k - 1).map_or("–".into(), |errors: &Errors| figure(errors[measure])));
            }
            row.extend([ours[measure], moved[measure]].map(figure));
            first.push(row);
        }
        for (count, printed) in LENGTHS.into_iter().zip(printed_long) {
            let long = sequences(polynomial, count, 0.0)?;
            let [ours, moved] = learned(&network, &long, degree)?;
            let windows = match &ppn {
                Some(trained) => figure(
                    mean(&long, |points| {
                        errors(&fit(&column(trained.predict(points, TRAINING_SEED)?), points, &space)?, points)
                    })?[0],
                ),
                None => "–".into(),
            };
            second.push(vec![
                format!("d = {degree}, m = {count}"),
                figure(printed[0]),
                figure(standard(&long, degree)?[0]),
                figure(printed[1]),
                windows,
                figure(printed[2]),
                figure(ours[0]),
                factor(ours[0], printed[2]),
                figure(moved[0]),
            ]);
        }
    }
    let mut text = String::from("\n## Table 4.1\n\n");
    writeln!(text, "Sequences of 2d + 1 points. {}\n", training_note(steps))?;
    let mut header = vec!["".to_owned(), "STD, printed".into(), "ours".into()];
    for name in ["MLP", "TRA", "RES", "PPN", "CNN"] {
        header.extend([format!("{name}, printed"), "ours".into()]);
    }
    header.extend(["shipped".into(), "and 2 joint steps".into()]);
    text += &table(&header.iter().map(String::as_str).collect::<Vec<_>>(), &first);
    text += super::text::AFTER_TABLE_1;
    let header = ["", "STD, printed", "ours", "PPN, printed", "PPN, ours", "CNN, printed", "shipped", "factor"];
    text += &table(&[&header[..], &["and 2 joint steps"]].concat(), &second);
    Ok(text)
}

fn training_note(steps: Option<u64>) -> String {
    match steps {
        Some(steps) => format!(
            "\"Ours\" of the networks: trained for this table in {steps} steps of {BATCH} fresh sequences of 2d + 1 points, \
             AdamW, rate {RATE}, the \
             transformer in a tenth of them; \"CNN, ours\" is the published form with 6 layers of 30 channels."
        ),
        None => "The compared networks were not trained: `--train STEPS` was not given.".into(),
    }
}

/// Table 4.3.
pub(super) fn table_3() -> Result<String> {
    let network = Parcnn::embedded(2, 1)?;
    let mut text = String::from(super::text::BEFORE_TABLE_3);
    for (kind, printed) in TABLE_3.into_iter().enumerate() {
        let mut rows = Vec::new();
        for (degree, printed) in DEGREES.into_iter().zip(printed) {
            for (count, printed) in LENGTHS.into_iter().zip(printed) {
                let items = match kind {
                    0 => sequences(Shape::Trigonometric { order: 5, dimension: 2 }, count, 0.0)?,
                    _ => sequences(Shape::Curve { degree, dimension: 2 }, count, 1e-2)?,
                };
                let curve = |of: &dyn Fn(ArrayView2<'_, f64>) -> Result<Array2<f64>>| {
                    mean(&items, |points| Ok([adaptive_curve(&of(points)?, points, degree, INTERIOR_KNOTS)?, 0.0, 0.0]))
                };
                let mut best = f64::INFINITY;
                for rule in RULES {
                    best = best.min(curve(&|points| Ok(column(parameterize_sequence(points, rule)?)))?[0]);
                }
                // The spline has as many elements, though not uniform ones; noisy polynomials are polynomials.
                let elements = if kind == 0 { INTERIOR_KNOTS + 1 } else { 1 };
                let space = SplineSpace { degree, elements };
                let ours = curve(&|points| Ok(column(network.predict_sequence(points, space)?)))?[0];
                rows.push(vec![
                    format!("d = {degree}, m = {count}"),
                    figure(printed[0]),
                    figure(best),
                    figure(printed[1]),
                    figure(ours),
                    factor(ours, printed[1]),
                ]);
            }
        }
        text += ["\nTrigonometric curves:\n\n", "\nNoisy polynomial curves:\n\n"][kind];
        text += &table(&["", "STD, printed", "ours", "CNN, printed", "shipped", "factor"], &rows);
    }
    Ok(text)
}
