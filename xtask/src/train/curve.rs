//! Learning curves as SVG.

use std::fmt::Write as _;

const WIDTH: f64 = 900.0;
const HEIGHT: f64 = 500.0;
const MARGIN: f64 = 60.0;
const COLOURS: [&str; 5] = ["#1b6ca8", "#d1495b", "#2e933c", "#8d5a97", "#c98a00"];

/// The columns `mse …` of a log over its first column, both logarithmic; dashed, the column after each, of which `rival`
/// says what it is.
pub(super) fn svg(log: &str, rival: &str) -> String {
    let mut lines = log.lines();
    let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|x| x.parse().unwrap_or(f64::NAN)).collect()).collect();
    let columns: Vec<usize> = (0..names.len()).filter(|&k| names[k].starts_with("mse ")).collect();
    let log10 = |row: &[f64], k: usize| row.get(k).copied().unwrap_or(f64::NAN).log10();
    let range = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        (low, if high > low { high } else { low + 1.0 })
    };
    let (left, right) = range(&mut rows.iter().map(|row| log10(row, 0)));
    let errors = rows.iter().flat_map(|row| columns.iter().flat_map(|&k| [log10(row, k), log10(row, k + 1)]));
    let (bottom, top) = range(&mut errors.into_iter());
    let x = |value: f64| MARGIN + (WIDTH - 2.0 * MARGIN) * (value - left) / (right - left);
    let y = |value: f64| HEIGHT - MARGIN - (HEIGHT - 2.0 * MARGIN) * (value - bottom) / (top - bottom);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" \
         font-size=\"13\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    // Writing to a string cannot fail.
    for decade in bottom.floor() as i32..=top.ceil() as i32 {
        let height = y(f64::from(decade));
        if (MARGIN..=HEIGHT - MARGIN).contains(&height) {
            let _ = writeln!(
                out,
                "<path d=\"M{MARGIN} {height:.1}H{:.1}\" stroke=\"#ddd\"/><text x=\"8\" y=\"{height:.1}\">1e{decade}</text>",
                WIDTH - MARGIN
            );
        }
    }
    for decade in left.floor() as i32..=right.ceil() as i32 {
        let place = x(f64::from(decade));
        if (MARGIN..=WIDTH - MARGIN).contains(&place) {
            let _ = writeln!(out, "<text x=\"{place:.1}\" y=\"{:.1}\">1e{decade}</text>", HEIGHT - MARGIN + 20.0);
        }
    }
    let _ = writeln!(
        out,
        "<text x=\"{MARGIN}\" y=\"{:.1}\">steps; MSE on fixed clouds, dashed: {rival}</text>",
        HEIGHT - 12.0
    );
    for (n, &k) in columns.iter().enumerate() {
        let colour = COLOURS[n % COLOURS.len()];
        for (column, dash) in [(k, ""), (k + 1, " stroke-dasharray=\"6 5\"")] {
            let points: Vec<String> =
                rows.iter().map(|row| format!("{:.1},{:.1}", x(log10(row, 0)), y(log10(row, column)))).collect();
            let points = points.join(" ");
            let _ = writeln!(
                out,
                "<polyline points=\"{points}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\"{dash}/>"
            );
        }
        let name = names[k].trim_start_matches("mse ");
        let place = MARGIN + 20.0 * n as f64;
        let _ = writeln!(out, "<text x=\"{:.1}\" y=\"{place}\" fill=\"{colour}\">{name}</text>", WIDTH - MARGIN - 80.0);
    }
    out + "</svg>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_fall_from_left_to_right() {
        let log = "step,seconds,mse 200,lpsp 200,parameter error 200\n10,1,1e-2,1e-4,0.3\n100,9,1e-3,1e-4,0.1\n";
        let picture = svg(log, "LPSP");
        // Log 2 at the top left, log 4 at the bottom; the middle of the height is log 3.
        assert!(picture.contains("points=\"60.0,60.0 840.0,250.0\""), "{picture}");
        assert!(picture.contains("points=\"60.0,440.0 840.0,440.0\""), "{picture}");
    }

    #[test]
    fn a_log_without_rows_is_an_empty_picture() {
        assert!(svg("step,mse 200\n", "LPSP").ends_with("</svg>\n"));
    }
}
