//! `tessera report`: what a render took, as one page with the picture.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::args::ReportArguments;
use crate::exit::Failure;
use crate::job;
use crate::log::Log;
use crate::output::OutputFile;
use crate::picture::Picture;
use crate::study::page::escaped;
use crate::study::picture::{data_url, gain};

/// Runs the command.
pub fn run(arguments: &ReportArguments, log: &Log) -> Result<(), Failure> {
    job::require_extension(&arguments.output, "html", "reports are pages")?;
    let output = OutputFile::prepare(&arguments.output)?;
    let refused = |why: &dyn std::fmt::Display| Failure::Input(format!("{}: {why}", arguments.stats.display()));
    let text = std::fs::read_to_string(&arguments.stats).map_err(|why| refused(&why))?;
    let stats: Value = serde_json::from_str(&text).map_err(|why| refused(&why))?;
    if stats["seconds"]["render"].as_f64().is_none() {
        return Err(refused(&"these are not statistics as \"tessera render --stats\" writes them"));
    }
    let picture = match find_picture(arguments, &stats) {
        Some(path) => Some(embedded(&path)?),
        None => {
            log.warning("the image is not where it was written to, so the page is without it; --picture names it");
            None
        }
    };
    output.write(page(&stats, picture.as_deref()).as_bytes())?;
    log.info(&format!("wrote {}", arguments.output.display()));
    Ok(())
}

/// The image: the one that is named, or that of the statistics, seen from here or from where they are.
fn find_picture(arguments: &ReportArguments, stats: &Value) -> Option<PathBuf> {
    if let Some(path) = &arguments.picture {
        return Some(path.clone());
    }
    let written = Path::new(stats["output"].as_str()?);
    let beside = arguments.stats.parent()?.join(written.file_name()?);
    [written.to_owned(), beside].into_iter().find(|path| path.is_file() && path.extension().is_some_and(|e| e == "exr"))
}

/// The image for the page, tone-mapped.
fn embedded(path: &Path) -> Result<String, Failure> {
    let picture = Picture::read(path, None)?;
    let folder = tempfile::tempdir().map_err(|why| Failure::Output(format!("a temporary folder: {why}")))?;
    data_url(&picture, gain(&picture), &folder.path().join("picture.png"))
}

fn page(stats: &Value, picture: Option<&str>) -> String {
    let scene = escaped(stats["scene"].as_str().unwrap_or("a scene"));
    let mut html = format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{scene}</title>\n<style>\n{}</style>\n\
         </head>\n<body>\n<main>\n",
        include_str!("../study/page.css")
    );
    html += &header(stats, &scene);
    if let Some(url) = picture {
        html += &format!("<div class=\"card\"><img alt=\"{scene}\" style=\"width:100%\" src=\"{url}\"></div>\n");
    }
    html += &section("Time", "Seconds of wall-clock time.", &bars(&times(stats), |x| format!("{x:.2} s")));
    html += &section("Rays", "Queries of the geometry.", &bars(&rays(stats), |x| format!("{:.2} million", x / 1e6)));
    html += &section("Memory", "Bytes at most.", &bars(&memory(stats), |x| format!("{:.1} MB", x / 1e6)));
    if let Some(probes) = stats["filter"]["probes"].as_array() {
        let named = |(k, count): (usize, &Value)| (format!("{} looked at", k + 1), count.as_f64().unwrap_or(0.0));
        let counts: Vec<_> = probes.iter().enumerate().map(named).collect();
        html +=
            &section("Probes", "Cells of the filter by slots that were looked at.", &bars(&counts, |x| format!("{x}")));
    }
    for (name, words) in [("filter", "What the filter did."), ("problems", "What was not as it should be.")] {
        if let Some(values) = stats[name].as_object() {
            let rows = values.iter().filter(|(_, value)| !value.is_array() && !value.is_object());
            let row = |(key, value): (&String, &Value)| {
                let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
                format!("<tr><td>{}</td><td>{}</td></tr>\n", escaped(&key.replace('_', " ")), escaped(&value))
            };
            let rows: String = rows.map(row).collect();
            let title = name[..1].to_uppercase() + &name[1..];
            html += &section(&title, words, &format!("<table>\n{rows}</table>"));
        }
    }
    html + "</main>\n</body>\n</html>\n"
}

fn header(stats: &Value, scene: &str) -> String {
    let number = |value: &Value| value.as_f64().unwrap_or(0.0);
    let whole = if stats["complete"].as_bool() == Some(true) { "complete" } else { "not complete" };
    let samples = number(&stats["samples"][1]) - number(&stats["samples"][0]);
    format!(
        "<header>\n<p class=\"kicker\">What a render took</p>\n<h1>{scene}</h1>\n<ul class=\"facts\"><li><b>{} × {}</b> pixels</li>\
         <li><b>{samples}</b> samples each, {whole}</li><li>frame <b>{}</b>, seed <b>{}</b></li><li><b>{}</b> threads</li>\
         <li><b>{:.2}</b> million rays a second</li><li>tessera <b>{}</b></li></ul>\n</header>\n",
        number(&stats["resolution"][0]),
        number(&stats["resolution"][1]),
        number(&stats["frame"]),
        number(&stats["seed"]),
        number(&stats["threads"]),
        number(&stats["rays"]["per_second"]) / 1e6,
        escaped(stats["version"].as_str().unwrap_or("of an unknown version")),
    )
}

fn section(title: &str, words: &str, body: &str) -> String {
    format!("<h2>{title}</h2>\n<p>{words}</p>\n<div class=\"card\">{body}</div>\n")
}

/// Values of an object by the names that people read.
fn named(values: &Value, names: &[(&str, &str)]) -> Vec<(String, f64)> {
    let found = names.iter().filter_map(|(key, name)| Some(((*name).to_owned(), values[*key].as_f64()?)));
    found.collect()
}

fn times(stats: &Value) -> Vec<(String, f64)> {
    let names = [
        ("parse", "reading the scene"),
        ("compile", "building the world"),
        ("render", "rendering"),
        ("write", "writing"),
    ];
    let mut times = named(&stats["seconds"], &names);
    // Filtering is a part of rendering.
    if let Some(filter) = stats["filter"]["seconds"].as_f64() {
        if let Some(render) = times.iter_mut().find(|(name, _)| name == "rendering") {
            *render = ("tracing".into(), (render.1 - filter).max(0.0));
        }
        times.push(("filtering".into(), filter));
    }
    times
}

fn rays(stats: &Value) -> Vec<(String, f64)> {
    named(&stats["rays"], &[("camera", "camera rays"), ("closest_hit", "closest hit"), ("shadow", "shadow rays")])
}

fn memory(stats: &Value) -> Vec<(String, f64)> {
    let names = [("peak_resident_bytes", "all, resident"), ("embree_bytes", "BVH"), ("film_bytes", "film")];
    let mut memory = named(&stats["memory"], &names);
    memory.extend(named(&stats["filter"], &[("bytes", "filter")]));
    memory
}

/// Horizontal bars with their values, from 0.
fn bars(values: &[(String, f64)], label: impl Fn(f64) -> String) -> String {
    const ROW: usize = 30;
    let largest = values.iter().fold(f64::MIN_POSITIVE, |largest, (_, value)| largest.max(*value));
    let mut svg = format!("<svg viewBox=\"0 0 1000 {}\">\n", ROW * values.len());
    for (row, (name, value)) in values.iter().enumerate() {
        let (y, width) = (ROW * row, 680.0 * value / largest);
        svg += &format!(
            "<text class=\"end\" x=\"150\" y=\"{}\">{}</text><rect class=\"s2\" fill=\"currentColor\" x=\"162\" y=\"{}\" \
             width=\"{width:.1}\" height=\"16\" rx=\"3\"/><text x=\"{:.1}\" y=\"{}\">{}</text>\n",
            y + 19,
            escaped(name),
            y + 7,
            width + 172.0,
            y + 19,
            escaped(&label(*value)),
        );
    }
    svg + "</svg>"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_shows_all_phases_and_no_markup_of_others() {
        let stats = serde_json::json!({
            "version": "0.1.0", "scene": "<script>.pbrt", "resolution": [8, 4], "samples": [0, 16], "complete": true,
            "seconds": { "parse": 0.5, "compile": 1.0, "render": 6.0, "write": 0.1, "total": 7.6 },
            "rays": { "camera": 512, "closest_hit": 2000, "shadow": 900, "per_second": 483.0 },
            "memory": { "peak_resident_bytes": null, "embree_bytes": 1000, "film_bytes": 100 },
            "filter": { "name": "talk", "seconds": 2.0, "bytes": 10, "probes": [5, 1] },
            "problems": { "rejected_samples": 3 }
        });
        assert_eq!(times(&stats).iter().map(|(_, s)| s).sum::<f64>(), 7.6);
        let page = page(&stats, None);
        for words in
            ["8 × 4", "tracing", "4.00 s", "filtering", "rejected samples", "2 looked at", "&lt;script&gt;.pbrt"]
        {
            assert!(page.contains(words), "no {words}");
        }
        assert!(!page.contains("<script") && !page.contains("all, resident") && !page.contains("http"));
    }
}
