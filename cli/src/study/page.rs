//! The page: one file that needs nothing else.

use std::fmt::Write;

use super::chart::{Axis, Chart, Frame, tick};
use super::measure::Point;
use super::picture;
use super::plan::Plan;
use super::renders::Renders;
use super::verdict::{Price, number, on_front, time};
use crate::args::StudyArguments;
use crate::exit::Failure;
use crate::job;
use crate::picture::Picture;

/// All that the page shows.
pub struct Study<'a> {
    /// What was asked.
    pub arguments: &'a StudyArguments,
    /// What was rendered.
    pub plan: &'a Plan,
    /// The renders.
    pub renders: &'a Renders,
    /// Their figures.
    pub points: &'a [Point],
    /// relMSE of the reference.
    pub reference_noise: f64,
    /// By target, the first recommended for.
    pub prices: &'a [Vec<Price>],
    /// One sentence.
    pub recommendation: &'a str,
}

/// Settings whose colours differ.
const COLOURS: usize = 6;
/// Pixels of all pictures together: of PNGs of noise, as text, some four bytes each.
const PICTURE_PIXELS: usize = 430_000;
/// A crop, in pixels.
const CROP: [usize; 2] = [48, 32];
const CROPS: usize = 3;

/// The page as HTML.
///
/// # Errors
/// A picture cannot be read, or its PNG not be written.
pub fn page(study: &Study<'_>) -> Result<String, Failure> {
    let title = format!("{} – speed against accuracy", escaped(&scene_name(study)));
    let pictures = study.pictures()?;
    let mut html = format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n<style>\n{}",
        include_str!("page.css")
    );
    html += ":root {";
    for (index, picture) in pictures.iter().enumerate() {
        write!(html, "--p{index}:url({});", picture.url).expect("a string takes all text");
    }
    html += "}\n</style>\n</head>\n<body>\n<main>\n";
    html += &study.header();
    html += &study.prices();
    html += &study.errors();
    html += &study.comparison(&pictures)?;
    html += &study.foretold();
    html += &study.parts();
    html += &study.footer();
    html += "</main>\n<script>\n";
    html += include_str!("page.js");
    html += "</script>\n</body>\n</html>\n";
    Ok(html)
}

/// A picture of the page.
struct Shown {
    name: String,
    url: String,
    /// Budget; the reference has none.
    spp: Option<u64>,
}

impl Study<'_> {
    fn header(&self) -> String {
        let [reference, _] = &self.renders.reference;
        let reference_spp: u64 = self.plan.reference.iter().flatten().sum();
        let origin = if reference_spp > 0 { format!("{reference_spp} samples") } else { "given".to_owned() };
        let threads = self.renders.done.first().map_or(0, |done| done.record.threads);
        format!(
            "<header>\n<p class=\"kicker\">Speed against accuracy</p>\n<h1>{}</h1>\n<p class=\"verdict\">{}</p>\n\
             <ul class=\"facts\"><li><b>{} × {}</b> pixels</li><li><b>{}</b> renders on <b>{threads}</b> threads</li>\
             <li>reference <b>{origin}</b>, itself known to relMSE <b>{}</b></li><li><b>{}</b></li></ul>\n</header>\n",
            escaped(&scene_name(self)),
            escaped(self.recommendation),
            reference.width,
            reference.height,
            self.renders.done.len(),
            number(self.reference_noise),
            job::software(),
        )
    }

    fn prices(&self) -> String {
        let mut html = "<h2>What an error costs</h2>\n<p>Time, and samples per pixel, until a render comes to a given \
                        error. Between the budgets that were rendered it is interpolated; ~ marks what lies beyond \
                        them.</p>\n<div class=\"card\"><table>\n<tr><th>relMSE</th>"
            .to_owned();
        for (index, setting) in self.plan.settings.iter().enumerate() {
            html += &format!("<th class=\"s{}\">{}</th>", index % COLOURS, escaped(&setting.name));
        }
        html += "</tr>\n";
        let mut rows: Vec<(f64, &Vec<Price>)> = self.arguments.target.iter().copied().zip(self.prices).collect();
        rows.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (target, prices) in rows {
            html += &format!("<tr><td>{}</td>", number(target));
            for setting in 0..self.plan.settings.len() {
                html += &match prices.iter().position(|price| price.setting == setting) {
                    None => "<td class=\"none\">not reached</td>".to_owned(),
                    Some(place) => {
                        let price = &prices[place];
                        let class = if place == 0 { " class=\"best\"" } else { "" };
                        let about = if price.foretold { "~ " } else { "" };
                        format!("<td{class}>{about}{}<small>{} spp</small></td>", time(price.seconds), price.spp)
                    }
                };
            }
            html += "</tr>\n";
        }
        html + "</table></div>\n"
    }

    fn errors(&self) -> String {
        let frame = Frame { size: [560.0, 400.0], margins: [58.0, 84.0, 28.0, 48.0] };
        let heights = || self.points.iter().flat_map(|p| [p.relmse, p.interval[0], p.interval[1]]);
        let y = || Axis::over("relMSE", heights().filter(|y| *y > 0.2 * self.lowest()), tick);
        let clock = if self.arguments.cpu_time { "time (processor seconds over threads)" } else { "time" };
        let seconds = Axis::over(clock, self.points.iter().map(|p| p.seconds), time_tick);
        let samples = Axis::at("samples per pixel", &self.plan.budgets);
        let against_time = self.error_chart(Chart::new(frame, seconds, y()), |p| p.seconds, true);
        let against_spp = self.error_chart(Chart::new(frame, samples, y()), |p| p.spp as f64, false);
        format!(
            "<h2>Error against time, and against samples</h2>\n<p>Lower and further left is better. Bands are 95 % \
             intervals of the mean error, from renders with independent seeds.</p>\n<div class=\"pair\">\n\
             <div class=\"card\"><h3>Against time</h3>\n{}</div>\n<div class=\"card\"><h3>Against samples</h3>\n{}</div>\n\
             </div>\n<ul class=\"legend\">{}<li><i class=\"ring\"></i>nothing else is better in less time</li>\
             <li><i class=\"front\"></i>Pareto front</li></ul>\n",
            against_time.finish("Error against time"),
            against_spp.finish("Error against samples per pixel"),
            self.legend(),
        )
    }

    fn lowest(&self) -> f64 {
        self.points.iter().map(|p| p.relmse).filter(|y| *y > 0.0).fold(f64::INFINITY, f64::min)
    }

    fn error_chart(&self, mut chart: Chart, x: impl Fn(&Point) -> f64, front: bool) -> Chart {
        if self.reference_noise > 0.5 * self.lowest() {
            chart.level(self.reference_noise, "noise of the reference");
        }
        if front {
            let mut best: Vec<&Point> = self.points.iter().filter(|p| on_front(p, self.points)).collect();
            best.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
            chart.line("front", &best.iter().map(|p| [x(p), p.relmse]).collect::<Vec<_>>());
        }
        for index in 0..self.plan.settings.len() {
            let class = format!("s{}", index % COLOURS);
            let points: Vec<&Point> = self.points.iter().filter(|p| p.setting == index && p.relmse > 0.0).collect();
            chart.band(&class, &points.iter().map(|p| (x(p), p.interval)).collect::<Vec<_>>());
            chart.line(&class, &points.iter().map(|p| [x(p), p.relmse]).collect::<Vec<_>>());
            for p in &points {
                let (spp, error, took) = (p.spp, number(p.relmse), time(p.seconds));
                let words = format!("{}, {spp} samples: relMSE {error}, {took}", escaped(&p.name));
                chart.dot(&class, [x(p), p.relmse], front && on_front(p, self.points), &words);
            }
            if let Some(last) = points.last() {
                chart.name(&class, [x(last), last.relmse], &escaped(&last.name));
            }
        }
        chart
    }

    fn legend(&self) -> String {
        let item =
            |(index, name): (usize, &str)| format!("<li><i class=\"s{}\"></i>{}</li>", index % COLOURS, escaped(name));
        self.plan.settings.iter().map(|setting| setting.name.as_str()).enumerate().map(item).collect()
    }

    /// What renders thought of their errors.
    fn foretold(&self) -> String {
        let known: Vec<(&Point, f64)> = self
            .points
            .iter()
            .filter_map(|p| Some((p, p.predicted.filter(|x| *x > 0.0 && p.relmse_best > 0.0)?)))
            .collect();
        if known.is_empty() {
            return String::new();
        }
        let frame = Frame { size: [560.0, 400.0], margins: [58.0, 84.0, 28.0, 48.0] };
        let values = || known.iter().flat_map(|(p, predicted)| [p.relmse_best, *predicted]);
        let axis = |title: &str| Axis::over(title, values(), tick);
        let mut chart =
            Chart::new(frame, axis("relMSE of the best 99.9 % against the reference"), axis("relMSE as estimated"));
        let [low, high] = axis("").range;
        // The diagonal, and what is within a factor of 1.25 of it, cut off by the axes.
        let near = |x: f64| (x, [(x / 1.25).max(low), (x * 1.25).min(high)]);
        chart.band("level", &[low, low * 1.25, high / 1.25, high].map(near));
        chart.line("level", &[[low, low], [high, high]]);
        let mut off = Vec::new();
        for index in 0..self.plan.settings.len() {
            let class = format!("s{}", index % COLOURS);
            let points: Vec<&(&Point, f64)> = known.iter().filter(|(p, _)| p.setting == index).collect();
            chart.line(&format!("{class} thin"), &points.iter().map(|(p, y)| [p.relmse_best, *y]).collect::<Vec<_>>());
            for (p, predicted) in &points {
                let (estimate, error) = (number(*predicted), number(p.relmse_best));
                let words = format!("{}, {} samples: estimated {estimate}, is {error}", escaped(&p.name), p.spp);
                chart.dot(&class, [p.relmse_best, *predicted], false, &words);
                off.push((predicted / p.relmse_best).ln().abs());
            }
        }
        off.sort_by(f64::total_cmp);
        let median = 100.0 * off[off.len() / 2].exp_m1();
        format!(
            "<h2>What the renderer knew</h2>\n<div class=\"pair\">\n<div class=\"card\"><h3>Estimated against measured</h3>\n{}\
             </div>\n<div><p>Every render estimates its own error, without a reference: that is what \
             <code>--target-error</code> goes by. It is the relMSE of the best 99.9 % of the pixels. Dots on the diagonal \
             were right; the band is a factor of 1.25.</p>\n\
             <p>Half of these estimates, each a mean over seeds, are within <b>{median:.0} %</b> of the error that was then \
             measured. Renders of too few samples to tell are not shown.</p>\n<ul class=\"legend\">{}</ul></div>\n</div>\n",
            chart.finish("Estimated against measured error"),
            self.legend(),
        )
    }

    /// Bias and variance of each setting.
    fn parts(&self) -> String {
        let frame = Frame { size: [400.0, 300.0], margins: [58.0, 20.0, 28.0, 48.0] };
        // What is within two standard errors of 0 cannot be told from it.
        let certain = |p: &Point| if p.squared_bias > 2.0 * p.squared_bias_error { p.squared_bias } else { 0.0 };
        let values = || self.points.iter().flat_map(|p| [p.relmse, p.variance, certain(p)]);
        let floor = 0.02 * self.lowest();
        let mut html = "<h2>Bias and variance</h2>\n<p>Error that differs from seed to seed goes away with samples; error \
                        that is the same in all of them must be made to. Dots of the squared bias are left out where it \
                        is too small to be told from 0.</p>\n<div class=\"three\">\n"
            .to_owned();
        for (index, setting) in self.plan.settings.iter().enumerate() {
            let class = format!("s{}", index % COLOURS);
            let y = Axis::over("share of the relMSE", values().filter(|y| *y > floor), tick);
            let mut chart = Chart::new(frame, Axis::at("samples per pixel", &self.plan.budgets), y);
            let points: Vec<&Point> = self.points.iter().filter(|p| p.setting == index).collect();
            let line = |part: &dyn Fn(&Point) -> f64| -> Vec<[f64; 2]> {
                points.iter().map(|p| [p.spp as f64, part(p)]).filter(|[_, y]| *y > floor).collect()
            };
            let (variance, bias) = (line(&|p| p.variance), line(&certain));
            chart.line(&format!("{class} thin"), &variance);
            chart.line(&format!("{class} thin dash"), &bias);
            for (name, points) in [("variance", &variance), ("squared bias", &bias)] {
                for &[spp, part] in points {
                    chart.dot(&class, [spp, part], false, &format!("{spp} samples: {name} {}", number(part)));
                }
            }
            html += &format!(
                "<div class=\"card\"><h3 class=\"{class}\">{}</h3>\n{}</div>\n",
                escaped(&setting.name),
                chart.finish("Bias and variance against samples per pixel")
            );
        }
        html + "</div>\n<ul class=\"legend\"><li><i></i>variance</li><li><i class=\"dash\"></i>squared bias</li></ul>\n"
    }

    /// Budgets whose pictures are shown: as many as there is room for, from the middle.
    fn shown_budgets(&self) -> Vec<u64> {
        let [reference, _] = &self.renders.reference;
        let room = PICTURE_PIXELS / reference.pixels.len().max(1);
        let count = (room.saturating_sub(1) / self.plan.settings.len().max(1)).clamp(1, 3).min(self.plan.budgets.len());
        let budgets = &self.plan.budgets;
        // 4, 16 and 64 of 1, 4, 16, 64, 256; 4 and 64 for two; 16 for one.
        let middle = (budgets.len() - 1) / 2;
        let mut indices = match count {
            1 => vec![middle],
            2 => vec![middle.saturating_sub(1), (middle + 1).min(budgets.len() - 1)],
            _ => vec![middle.saturating_sub(1), middle, (middle + 1).min(budgets.len() - 1)],
        };
        indices.dedup();
        indices.into_iter().map(|index| budgets[index]).collect()
    }

    fn picture(&self, setting: usize, spp: u64) -> Result<Option<Picture>, Failure> {
        let wanted = |done: &&super::renders::Done| done.render.setting == setting && done.render.spp == spp;
        self.renders.done.iter().find(wanted).map(|done| Picture::read(&done.path, None)).transpose()
    }

    fn pictures(&self) -> Result<Vec<Shown>, Failure> {
        let folder = self.arguments.output.join("images");
        let failure = |why| Failure::Output(format!("cannot make the folder \"{}\": {why}", folder.display()));
        std::fs::create_dir_all(&folder).map_err(failure)?;
        let [reference, _] = &self.renders.reference;
        let gain = picture::gain(reference);
        let mut shown = Vec::new();
        for spp in self.shown_budgets() {
            for (index, setting) in self.plan.settings.iter().enumerate() {
                if let Some(picture) = self.picture(index, spp)? {
                    let file = folder.join(format!("{}-{spp:06}.png", setting.name));
                    let url = picture::data_url(&picture, gain, &file)?;
                    shown.push(Shown { name: format!("{}, {spp} spp", setting.name), url, spp: Some(spp) });
                }
            }
        }
        let url = picture::data_url(reference, gain, &folder.join("reference.png"))?;
        shown.push(Shown { name: "reference".to_owned(), url, spp: None });
        Ok(shown)
    }

    fn comparison(&self, pictures: &[Shown]) -> Result<String, Failure> {
        let [reference, _] = &self.renders.reference;
        let (width, height) = (reference.width, reference.height);
        let first = pictures.iter().find_map(|shown| shown.spp);
        let columns: Vec<usize> =
            (0..pictures.len()).filter(|&k| pictures[k].spp == first || pictures[k].spp.is_none()).collect();
        let option = |chosen: usize| -> String {
            let option = |(k, shown): (usize, &Shown)| {
                let selected = if k == chosen { " selected" } else { "" };
                format!("<option value=\"{k}\"{selected}>{}</option>", escaped(&shown.name))
            };
            pictures.iter().enumerate().map(option).collect()
        };
        let (left, right) = (columns[0], columns[columns.len().saturating_sub(2)]);
        let mut html = format!(
            "<h2>Side by side</h2>\n<p>Drag to compare; every picture has the same exposure.</p>\n<div class=\"card\">\n\
             <div class=\"controls\"><label>left <select id=\"left\">{}</select></label>\
             <label>right <select id=\"right\">{}</select></label></div>\n\
             <div class=\"slider\" style=\"aspect-ratio:{width}/{height}\"><div></div><div class=\"over\"></div><hr><span></span>\
             <input type=\"range\" min=\"0\" max=\"100\" step=\"0.1\" value=\"50\" aria-label=\"where the pictures meet\"></div>\n",
            option(left),
            option(right),
        );
        html += &format!("<div class=\"crops\" style=\"grid-template-columns:repeat({},1fr)\">\n", columns.len());
        let crops = self.crops()?;
        let size = [CROP[0].min(width), CROP[1].min(height)];
        for k in columns {
            html += &format!("<figure><figcaption>{}</figcaption>", escaped(&pictures[k].name));
            for [x, y] in &crops {
                // Where a background of a size lies, in per cent, is measured between the outermost places.
                let place = |at: usize, crop: usize, whole: usize| 100.0 * at as f64 / (whole - crop).max(1) as f64;
                html += &format!(
                    "<div class=\"crop\" style=\"aspect-ratio:{}/{};background:var(--p{k}) {:.3}% {:.3}%/{:.2}% auto\"></div>",
                    size[0],
                    size[1],
                    place(*x, size[0], width),
                    place(*y, size[1], height),
                    100.0 * width as f64 / size[0] as f64,
                );
            }
            html += "</figure>\n";
        }
        Ok(html + "</div>\n</div>\n")
    }

    /// Crops where the settings differ most from the reference.
    fn crops(&self) -> Result<Vec<[usize; 2]>, Failure> {
        let [reference, _] = &self.renders.reference;
        let (width, height) = (reference.width, reference.height);
        let gain = picture::gain(reference);
        let budget = self.shown_budgets()[0];
        let mut pictures = Vec::new();
        for setting in 0..self.plan.settings.len() {
            pictures.extend(self.picture(setting, budget)?);
        }
        let display = |pixel: &[f32; 3]| f64::from(crate::tone::display(crate::args::Tone::Filmic, gain * pixel[1]));
        let difference = |x: usize, y: usize| {
            let at = y * width + x;
            let off = |p: &Picture| (display(&p.pixels[at]) - display(&reference.pixels[at])).abs();
            pictures.iter().map(off).fold(0.0, f64::max)
        };
        Ok(picture::crops([width, height], [CROP[0].min(width), CROP[1].min(height)], CROPS, difference))
    }

    fn footer(&self) -> String {
        format!(
            "<h2>How this was made</h2>\n<p>The same command makes this page again; renders that are there are not \
             repeated.</p>\n<pre>{}</pre>\n<footer><p>relMSE is the mean over pixels and channels of (I − A)(I − B) / (R² + \
             0.01 m²), with A and B two independent halves of the reference, whose noise cancels in the product, R their \
             mean, and m its mean over the image. Time is that of tracing and filtering, without reading the scene, its \
             mean over seeds. study.csv and study.json beside this page hold the figures.</p></footer>\n",
            escaped(&command(std::env::args().skip(1))),
        )
    }
}

/// The command as it could be typed again.
fn command(arguments: impl Iterator<Item = String>) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+#%@".contains(c);
    let quoted = |argument: String| {
        let bare = !argument.is_empty() && argument.chars().all(plain);
        if bare { argument } else { format!("'{}'", argument.replace('\'', r"'\''")) }
    };
    std::iter::once("tessera".to_owned()).chain(arguments.map(quoted)).collect::<Vec<_>>().join(" ")
}

/// The scene's folder if that says more than its file, as it does where all are called scene.
fn scene_name(study: &Study<'_>) -> String {
    let path = &study.arguments.scene;
    let stem = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let folder = path.parent().and_then(|folder| folder.file_name()).map(|name| name.to_string_lossy().into_owned());
    if stem.starts_with("scene") { folder.unwrap_or(stem) } else { stem }
}

/// Text as HTML shows it.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A time at an axis, where all are round.
fn time_tick(seconds: f64) -> String {
    match seconds {
        s if s < 0.999 => format!("{} ms", number(1000.0 * s)),
        s if s < 3600.0 => format!("{} s", number(s)),
        s => format!("{} h", number(s / 3600.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_can_be_typed_again() {
        let typed = ["study", "a b.pbrt", "-o", "it's"].map(str::to_owned);
        assert_eq!(command(typed.into_iter()), r"tessera study 'a b.pbrt' -o 'it'\''s'");
        assert_eq!(escaped("a<b & \"c\">"), "a&lt;b &amp; &quot;c&quot;&gt;");
    }
}
