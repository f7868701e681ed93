//! Charts with logarithmic axes, as SVG.

use std::fmt::Write;

use super::verdict::number;

/// Size of a chart in its own units, and the room around its axes: left, right, top, bottom.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Width and height.
    pub size: [f64; 2],
    /// Left, right, top, bottom.
    pub margins: [f64; 4],
}

/// An axis over powers.
#[derive(Clone, Debug)]
pub struct Axis {
    /// What is shown.
    pub title: String,
    /// Ends.
    pub range: [f64; 2],
    /// Places with a line and what is written there.
    pub ticks: Vec<(f64, String)>,
}

impl Axis {
    /// An axis that holds all positive `values`, with a little air, and ticks at powers of ten or, if these are few, at 1, 2
    /// and 5 of them.
    pub fn over(title: &str, values: impl Iterator<Item = f64>, label: impl Fn(f64) -> String) -> Self {
        let [low, high] = extent(values);
        let decade = |exponent: i32, digit: f64| digit * 10.0_f64.powi(exponent);
        let exponents = low.log10().floor() as i32..=high.log10().ceil() as i32;
        let within = |x: &f64| (low..=high).contains(x);
        let whole: Vec<f64> = exponents.clone().map(|e| decade(e, 1.0)).filter(within).collect();
        let fine = || exponents.clone().flat_map(|e| [1.0, 2.0, 5.0].map(|d| decade(e, d))).filter(within).collect();
        let ticks: Vec<f64> = if whole.len() > 2 { whole } else { fine() };
        let ticks = ticks.into_iter().map(|tick| (tick, label(tick))).collect();
        Self { title: title.to_owned(), range: [low, high], ticks }
    }

    /// An axis with ticks at given values.
    pub fn at(title: &str, values: &[u64]) -> Self {
        let range = extent(values.iter().map(|&value| value as f64));
        Self { title: title.to_owned(), range, ticks: values.iter().map(|&v| (v as f64, v.to_string())).collect() }
    }

    fn share(&self, value: f64) -> f64 {
        let [low, high] = self.range;
        ((value / low).ln() / (high / low).ln()).clamp(-0.5, 1.5)
    }
}

/// The ends of all positive values, 15 % apart from them.
fn extent(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let positive = values.filter(|x| *x > 0.0 && x.is_finite());
    let (low, high) = positive.fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
    if low > high { [0.1, 10.0] } else { [low / 1.15, high * 1.15] }
}

/// A chart that is being drawn.
pub struct Chart {
    frame: Frame,
    x: Axis,
    y: Axis,
    body: String,
    /// Names that wait for a place at the right: height, class, text.
    names: Vec<(f64, String, String)>,
}

impl Chart {
    /// Axes, grid and titles.
    pub fn new(frame: Frame, x: Axis, y: Axis) -> Self {
        let mut chart = Self { frame, x, y, body: String::new(), names: Vec::new() };
        chart.draw_axes();
        chart
    }

    fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let ([width, height], [left, right, top, bottom]) = (self.frame.size, self.frame.margins);
        [left + self.x.share(x) * (width - left - right), height - bottom - self.y.share(y) * (height - top - bottom)]
    }

    fn push(&mut self, element: std::fmt::Arguments<'_>) {
        self.body.write_fmt(element).expect("a string takes all text");
        self.body.push('\n');
    }

    fn draw_axes(&mut self) {
        let ([width, height], [left, right, top, bottom]) = (self.frame.size, self.frame.margins);
        for (value, label) in self.y.ticks.clone() {
            let [_, y] = self.place([self.x.range[0], value]);
            self.push(format_args!(
                r#"<line class="grid" x1="{left}" x2="{}" y1="{y:.1}" y2="{y:.1}"/>"#,
                width - right
            ));
            self.push(format_args!(r#"<text class="tick end" x="{}" y="{:.1}">{label}</text>"#, left - 8.0, y + 4.0));
        }
        for (value, label) in self.x.ticks.clone() {
            let [x, _] = self.place([value, self.y.range[0]]);
            let low = height - bottom;
            self.push(format_args!(r#"<line class="grid" x1="{x:.1}" x2="{x:.1}" y1="{top}" y2="{low}"/>"#));
            self.push(format_args!(r#"<text class="tick mid" x="{x:.1}" y="{}">{label}</text>"#, low + 18.0));
        }
        let (x_title, y_title) = (self.x.title.clone(), self.y.title.clone());
        let middle = 0.5 * (left + width - right);
        self.push(format_args!(r#"<text class="axis mid" x="{middle}" y="{}">{x_title}</text>"#, height - 6.0));
        self.push(format_args!(r#"<text class="axis" x="{}" y="{}">{y_title}</text>"#, left - 44.0, top - 10.0));
    }

    /// A line through points.
    pub fn line(&mut self, class: &str, points: &[[f64; 2]]) {
        let path = self.path(points.iter().copied());
        self.push(format_args!(r#"<path class="line {class}" d="M{path}"/>"#));
    }

    /// The area between low and high values.
    pub fn band(&mut self, class: &str, points: &[(f64, [f64; 2])]) {
        let low = points.iter().map(|(x, [low, _])| [*x, *low]);
        let high = points.iter().rev().map(|(x, [_, high])| [*x, *high]);
        let path = self.path(low.chain(high));
        self.push(format_args!(r#"<path class="band {class}" d="M{path}Z"/>"#));
    }

    fn path(&self, points: impl Iterator<Item = [f64; 2]>) -> String {
        let steps: Vec<String> = points
            .map(|point| {
                let [x, y] = self.place(point);
                format!("{x:.1} {y:.1}")
            })
            .collect();
        steps.join("L")
    }

    /// A dot with words for whoever points at it; ringed if it matters.
    pub fn dot(&mut self, class: &str, point: [f64; 2], ringed: bool, words: &str) {
        let [x, y] = self.place(point);
        if ringed {
            self.push(format_args!(r#"<circle class="ring {class}" cx="{x:.1}" cy="{y:.1}" r="8"/>"#));
        }
        self.push(format_args!(
            r#"<circle class="dot {class}" cx="{x:.1}" cy="{y:.1}" r="4"><title>{words}</title></circle>"#
        ));
    }

    /// A name at the end of a line, at the right of the axes.
    pub fn name(&mut self, class: &str, point: [f64; 2], text: &str) {
        let [_, y] = self.place(point);
        self.names.push((y, class.to_owned(), text.to_owned()));
    }

    /// A level with words on it.
    pub fn level(&mut self, y: f64, words: &str) {
        let [low, high] = self.x.range;
        self.line("level", &[[low, y], [high, y]]);
        let [x, y] = self.place([low, y]);
        self.push(format_args!(r#"<text class="note" x="{:.1}" y="{:.1}">{words}</text>"#, x + 6.0, y - 5.0));
    }

    /// The finished chart, for those who cannot see it described by `label`.
    pub fn finish(mut self, label: &str) -> String {
        // Names move down until they do not touch, then up as far as the last has to.
        self.names.sort_by(|a, b| a.0.total_cmp(&b.0));
        let ([width, height], [_, right, ..]) = (self.frame.size, self.frame.margins);
        let mut last = f64::NEG_INFINITY;
        for (y, class, text) in std::mem::take(&mut self.names) {
            last = (y + 4.0).max(last + 16.0);
            self.push(format_args!(
                r#"<text class="name {class}" x="{}" y="{last:.1}">{text}</text>"#,
                width - right + 12.0
            ));
        }
        format!("<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{label}\">\n{}</svg>\n", self.body)
    }
}

/// A number as a tick has it.
pub fn tick(x: f64) -> String {
    number(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_hold_their_values_and_have_round_ticks() {
        let axis = Axis::over("", [0.003, 0.5, 20.0].into_iter(), tick);
        assert!(axis.range[0] < 0.003 && axis.range[1] > 20.0);
        let labels: Vec<_> = axis.ticks.iter().map(|(_, label)| label.as_str()).collect();
        assert_eq!(labels, ["0.01", "0.1", "1", "10"]);
        let axis = Axis::over("", [2.0, 9.0].into_iter(), tick);
        assert_eq!(axis.ticks.iter().map(|(_, label)| label.as_str()).collect::<Vec<_>>(), ["2", "5", "10"]);
        // Nothing to show is no reason to fail.
        assert_eq!(Axis::over("", [0.0, f64::NAN].into_iter(), tick).range, [0.1, 10.0]);
    }

    #[test]
    fn larger_is_higher_and_further_right() {
        let frame = Frame { size: [200.0, 100.0], margins: [20.0; 4] };
        let axis = || Axis { title: String::new(), range: [1.0, 100.0], ticks: Vec::new() };
        let chart = Chart::new(frame, axis(), axis());
        assert_eq!(chart.place([1.0, 1.0]), [20.0, 80.0]);
        assert_eq!(chart.place([100.0, 100.0]), [180.0, 20.0]);
        assert_eq!(chart.place([10.0, 10.0]), [100.0, 50.0]);
    }

    #[test]
    fn names_do_not_touch() {
        let frame = Frame { size: [200.0, 100.0], margins: [20.0; 4] };
        let axis = || Axis { title: String::new(), range: [1.0, 100.0], ticks: Vec::new() };
        let mut chart = Chart::new(frame, axis(), axis());
        chart.name("a", [1.0, 10.0], "a");
        chart.name("b", [1.0, 10.1], "b");
        let svg = chart.finish("");
        assert!(svg.contains(r#"y="53.9">b"#) && svg.contains(r#"y="69.9">a"#), "{svg}");
    }
}
