//! Line charts as SVG.

use std::fmt::Write as _;

/// Size of one chart without its legend.
const SIZE: [f64; 2] = [575.0, 420.0];

/// Room around the plot: left, right, top, bottom.
const MARGIN: [f64; 4] = [70.0, 30.0, 34.0, 48.0];

/// Told apart on white by most readers; further series begin anew.
const COLOURS: [&str; 12] = [
    "#1b6ca8", "#d1495b", "#2e933c", "#8d5a97", "#c98a00", "#333333", "#00a1a1", "#9b6b43", "#e377c2", "#7f7f7f",
    "#8fb339", "#4b3fd1",
];

/// Decades below which an axis gets ticks between powers of ten.
const FEW_DECADES: f64 = 1.6;

/// Height of a line of the legend.
const LINE: f64 = 16.0;

/// Between a plot and its legend.
const GAP: f64 = 12.0;

/// Width of the line in the legend and of the room around it.
const SAMPLE: f64 = 40.0;

/// Width of a letter of the legend, about.
const LETTER: f64 = 6.6;

/// A line of a chart.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// What the legend says; nothing for a line that shares another's entry.
    pub name: String,
    /// Places, in order. Those that an axis cannot show (not finite, or not positive on a logarithmic one) are left out.
    pub points: Vec<[f64; 2]>,
    /// Which colour; the same number gives the same colour.
    pub colour: usize,
    /// Whether the line is dashed.
    pub dashed: bool,
}

/// A chart with a logarithmic y axis.
#[derive(Clone, Debug, Default)]
pub struct Chart {
    /// Above the plot.
    pub title: String,
    /// Below it.
    pub x_label: String,
    /// Whether the x axis is linear; logarithmic else.
    pub linear_x: bool,
    /// A height at which a grey line is drawn, such as a tolerance.
    pub level: Option<f64>,
    /// The lines.
    pub series: Vec<Series>,
}

/// The range of an axis, in decades where it is logarithmic.
#[derive(Clone, Copy, Debug)]
struct Axis {
    low: f64,
    high: f64,
    linear: bool,
}

impl Axis {
    fn over(values: impl Iterator<Item = f64>, linear: bool) -> Self {
        let scaled = values.map(|x| if linear { x } else { x.log10() }).filter(|x| x.is_finite());
        let (low, high) = scaled.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        match (low.is_finite(), high > low) {
            (true, true) => Self { low, high, linear },
            (true, false) => Self { low, high: low + 1.0, linear },
            _ => Self { low: 0.0, high: 1.0, linear },
        }
    }

    /// The place of a value on the axis, from 0 to 1 within its range.
    fn share(&self, value: f64) -> Option<f64> {
        let at = if self.linear { value } else { value.log10() };
        at.is_finite().then(|| (at - self.low) / (self.high - self.low))
    }

    /// Values with a tick.
    fn ticks(&self) -> Vec<f64> {
        if self.linear {
            let step = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0];
            let step = step.into_iter().find(|s| (self.high - self.low) / s <= 8.0).unwrap_or(self.high - self.low);
            let first = (self.low / step).ceil() as i64;
            return (first..=(self.high / step).floor() as i64).map(|k| k as f64 * step).collect();
        }
        let mantissas: &[f64] = if self.high - self.low < FEW_DECADES { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let decades = self.low.floor() as i32..=self.high.ceil() as i32;
        let all = decades.flat_map(|decade| mantissas.iter().map(move |m| m * 10_f64.powi(decade)));
        // A hair beyond the range, for round-off at its ends.
        all.filter(|x| self.share(*x).is_some_and(|s| (-1e-9..=1.0 + 1e-9).contains(&s))).collect()
    }

    fn label(&self, value: f64) -> String {
        if self.linear || (1.0..1e5).contains(&value) { format!("{value:.0}") } else { format!("{value:.0e}") }
    }
}

impl Chart {
    fn draw(&self, left: f64, out: &mut String) {
        let scaled = |p: &[f64; 2]| [if self.linear_x { p[0] } else { p[0].log10() }, p[1].log10()];
        let shown = |p: &&[f64; 2]| scaled(p).iter().all(|x| x.is_finite());
        let values = |k: usize| self.series.iter().flat_map(move |s| s.points.iter().filter(shown).map(move |p| p[k]));
        let x_axis = Axis::over(values(0), self.linear_x);
        let y_axis = Axis::over(values(1).chain(self.level), false);
        let [west, east, north, south] = MARGIN;
        let (width, height) = (SIZE[0] - west - east, SIZE[1] - north - south);
        let (first, last) = (left + west, left + west + width);
        let (top, bottom) = (north, north + height);
        let x = |value: f64| x_axis.share(value).map(|s| first + s * width);
        let y = |value: f64| y_axis.share(value).map(|s| bottom - s * height);
        // Writing to a string cannot fail.
        for value in y_axis.ticks() {
            let (Some(at), label) = (y(value), y_axis.label(value)) else { continue };
            let _ = writeln!(
                out,
                "<path d=\"M{first:.1} {at:.1}H{last:.1}\" stroke=\"#ddd\"/><text x=\"{:.1}\" y=\"{:.1}\" \
                 text-anchor=\"end\">{label}</text>",
                first - 6.0,
                at + 4.0
            );
        }
        for value in x_axis.ticks() {
            let (Some(at), label) = (x(value), x_axis.label(value)) else { continue };
            let _ = writeln!(
                out,
                "<path d=\"M{at:.1} {top:.1}V{bottom:.1}\" stroke=\"#eee\"/><text x=\"{at:.1}\" y=\"{:.1}\" \
                 text-anchor=\"middle\">{label}</text>",
                bottom + 16.0
            );
        }
        if let Some(at) = self.level.and_then(y) {
            let _ =
                writeln!(out, "<path d=\"M{first:.1} {at:.1}H{last:.1}\" stroke=\"#888\" stroke-dasharray=\"2 3\"/>");
        }
        let _ = writeln!(
            out,
            "<rect x=\"{first:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" fill=\"none\" \
             stroke=\"#999\"/>\n<text x=\"{first:.1}\" y=\"{:.1}\" font-weight=\"bold\">{}</text>\n<text x=\"{:.1}\" \
             y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
            top - 12.0,
            escaped(&self.title),
            first + 0.5 * width,
            bottom + 36.0,
            escaped(&self.x_label)
        );
        for series in &self.series {
            let places =
                series.points.iter().filter(shown).filter_map(|p| Some(format!("{:.1},{:.1}", x(p[0])?, y(p[1])?)));
            let places: Vec<String> = places.collect();
            let dash = if series.dashed { " stroke-dasharray=\"6 4\"" } else { "" };
            let colour = COLOURS[series.colour % COLOURS.len()];
            let _ = writeln!(
                out,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.6\"{dash}/>",
                places.join(" ")
            );
        }
    }

    /// Names and the looks of their lines.
    fn named(&self) -> Vec<(&str, usize, bool)> {
        let named = self.series.iter().filter(|s| !s.name.is_empty());
        named.map(|s| (&*s.name, s.colour, s.dashed)).collect()
    }

    /// The names beside the plot; the width they need.
    fn legend(&self, left: f64, out: &mut String) -> f64 {
        let named = self.named();
        for (line, &(name, colour, dashed)) in named.iter().enumerate() {
            let at = MARGIN[2] + LINE * (line as f64 + 1.0);
            let dash = if dashed { " stroke-dasharray=\"6 4\"" } else { "" };
            let colour = COLOURS[colour % COLOURS.len()];
            // Writing to a string cannot fail.
            let _ = writeln!(
                out,
                "<path d=\"M{left:.1} {:.1}h26\" stroke=\"{colour}\" stroke-width=\"1.6\"{dash}/><text x=\"{:.1}\" \
                 y=\"{at:.1}\">{}</text>",
                at - 4.0,
                left + 32.0,
                escaped(name)
            );
        }
        let letters = named.iter().map(|(name, ..)| name.chars().count()).max().unwrap_or(0);
        SAMPLE + LETTER * letters as f64
    }
}

/// Charts side by side, as one picture. Neighbours with the same legend share it.
pub fn svg(charts: &[Chart]) -> String {
    let mut inner = String::new();
    let mut width = 0.0;
    for (number, chart) in charts.iter().enumerate() {
        chart.draw(width, &mut inner);
        width += SIZE[0];
        if charts.get(number + 1).is_none_or(|next| next.named() != chart.named()) {
            width += chart.legend(width - MARGIN[1] + GAP, &mut inner);
        }
    }
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n{inner}</svg>\n",
        SIZE[1]
    )
}

/// Text without characters that mean something in XML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn falling() -> Chart {
        let series = |name: &str, high: f64, colour: usize, dashed: bool| Series {
            name: name.into(),
            points: vec![[10.0, high], [100.0, 0.1 * high]],
            colour,
            dashed,
        };
        let series = vec![series("a < b", 1e-2, 0, false), series("", 1e-3, 0, true)];
        Chart { title: "t".into(), x_label: "steps".into(), series, ..Chart::default() }
    }

    #[test]
    fn curves_fall_from_the_upper_left_to_the_lower_right() {
        let picture = svg(&[falling()]);
        // The plot spans x from 70 to 545 and y from 34 to 372; 1e-3 is half-way between 1e-2 and 1e-4.
        assert!(picture.contains("points=\"70.0,34.0 545.0,203.0\""), "{picture}");
        assert!(picture.contains("points=\"70.0,203.0 545.0,372.0\""), "{picture}");
        assert!(picture.contains("a &lt; b") && picture.contains("stroke-dasharray"));
        assert_eq!(picture.matches("<text").count(), 3 + 4 + 2 + 1, "ticks, title and label, one name: {picture}");
    }

    #[test]
    fn what_has_no_logarithm_is_left_out() {
        let mut chart = falling();
        chart.series[0].points.extend([[0.0, 1.0], [20.0, 0.0], [f64::NAN, 1.0]]);
        assert_eq!(svg(&[chart]).matches("70.0,34.0 545.0,203.0\"").count(), 1);
        assert!(svg(&[Chart::default()]).ends_with("</svg>\n"));
    }

    #[test]
    fn charts_stand_side_by_side() {
        let picture = svg(&[falling(), Chart { linear_x: true, ..falling() }]);
        assert!(picture.contains("points=\"645.0,34.0 1120.0,203.0\""), "{picture}");
        assert_eq!(picture.matches("a &lt; b").count(), 1, "one legend: {picture}");
    }
}
