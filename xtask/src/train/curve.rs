//! Learning curves as SVG.

use crate::chart::{Chart, Series, svg as picture};

/// The columns `mse …` of a log over its first column, both logarithmic; dashed, the column after each, of which `rival`
/// says what it is.
pub(super) fn svg(log: &str, rival: &str) -> String {
    let mut lines = log.lines();
    let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|x| x.parse().unwrap_or(f64::NAN)).collect()).collect();
    let column = |k: usize| -> Vec<[f64; 2]> {
        let entry = |row: &[f64], k: usize| row.get(k).copied().unwrap_or(f64::NAN);
        rows.iter().map(|row| [entry(row, 0), entry(row, k)]).collect()
    };
    let mut series = Vec::new();
    for (colour, k) in (0..names.len()).filter(|&k| names[k].starts_with("mse ")).enumerate() {
        let name = names[k].trim_start_matches("mse ").to_owned();
        series.push(Series { name, points: column(k), colour, dashed: false });
        series.push(Series { points: column(k + 1), colour, dashed: true, ..Series::default() });
    }
    let title = format!("MSE on fixed clouds; dashed: {rival}");
    picture(&[Chart { title, x_label: "steps".into(), series, ..Chart::default() }])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_fall_from_left_to_right() {
        let log = "step,seconds,mse 200,lpsp 200,parameter error 200\n10,1,1e-2,1e-4,0.3\n100,9,1e-3,1e-4,0.1\n";
        let picture = svg(log, "LPSP");
        // Log 2 at the top left, log 4 at the bottom; the middle of the height is log 3.
        assert!(picture.contains("points=\"70.0,34.0 545.0,203.0\""), "{picture}");
        assert!(picture.contains("points=\"70.0,372.0 545.0,372.0\""), "{picture}");
    }

    #[test]
    fn a_log_without_rows_is_an_empty_picture() {
        assert!(svg("step,mse 200\n", "LPSP").ends_with("</svg>\n"));
    }
}
