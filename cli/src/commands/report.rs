//! `tessera report`: what a render took, as one page with the picture.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::args::ReportArguments;
use crate::exit::Failure;
use crate::job;
use crate::log::Log;
use crate::output::OutputFile;
use crate::picture::Picture;
use crate::stats;
use crate::study::page::escaped;
use crate::study::picture::{data_url, gain};

/// Runs the command.
pub fn run(arguments: &ReportArguments, log: &Log) -> Result<(), Failure> {
    job::require_extension(&arguments.output, "html", "reports are pages")?;
    let output = OutputFile::prepare(&arguments.output)?;
    let refused = |why: &dyn std::fmt::Display| Failure::Input(format!("{}: {why}", arguments.stats.display()));
    let bytes = std::fs::read(&arguments.stats).map_err(|why| refused(&why))?;
    let stats = serde_json::from_slice(&bytes).ok().filter(|stats: &Value| stats["seconds"]["render"].is_f64());
    let Some(stats) = stats else {
        return Err(refused(&"this is not a file of statistics, as \"tessera render --stats FILE.json\" writes one"));
    };
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
    html += &section("Memory", "Bytes at most.", &bars(&memory(stats), |x| stats::size(x as u64)));
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
                format!(
                    "<tr><td>{}</td><td>{}</td></tr>\n",
                    escaped(&key.replace('_', " ")),
                    escaped(&shown(key, value))
                )
            };
            let rows: String = rows.map(row).collect();
            let title = name[..1].to_uppercase() + &name[1..];
            html += &section(&title, words, &format!("<table>\n{rows}</table>"));
        }
    }
    html + "</main>\n</body>\n</html>\n"
}

/// A figure with its unit, which its name tells.
fn shown(key: &str, value: &Value) -> String {
    match (key, value.as_f64()) {
        ("bytes", Some(bytes)) => stats::size(bytes as u64),
        ("seconds", Some(seconds)) => format!("{seconds:.2} s"),
        ("share" | "occupancy" | "unresolved_share", Some(share)) => format!("{:.1} %", 100.0 * share),
        (_, Some(_)) if value.is_u64() => grouped(value.as_u64().unwrap_or_default()),
        (_, Some(number)) => stats::figure(number),
        _ => value.as_str().map_or_else(|| value.to_string(), str::to_owned),
    }
}

/// A count with its thousands apart.
fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let space = |at: usize| if at > 0 && (digits.len() - at) % 3 == 0 { "\u{202f}" } else { "" };
    digits.char_indices().map(|(at, digit)| format!("{}{digit}", space(at))).collect()
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
    fn figures_have_units_and_three_digits() {
        for (key, value, text) in [
            ("bytes", 26_279_150.into(), "26.3 MB"),
            ("bytes", 1200.into(), "1.2 kB"),
            ("share", 0.189_235_277.into(), "18.9 %"),
            ("seconds", 2.345.into(), "2.35 s"),
            ("cells", 1_234_567.into(), "1\u{202f}234\u{202f}567"),
            ("cells", 123.into(), "123"),
            ("name", Value::from("talk"), "talk"),
        ] {
            assert_eq!(shown(key, &value), text);
        }
    }

    #[test]
    fn what_is_no_file_of_statistics_is_called_so() {
        let folder = tempfile::tempdir().unwrap();
        let (stats, output) = (folder.path().join("a.exr"), folder.path().join("a.html"));
        for content in [&b"\x76\x2f\x31\x01\xff"[..], b"{}", b"text"] {
            std::fs::write(&stats, content).unwrap();
            let arguments = ReportArguments { stats: stats.clone(), output: output.clone(), picture: None };
            let failure = run(&arguments, &Log::new(crate::log::Level::Error)).unwrap_err();
            assert!(failure.code() == 3 && failure.to_string().contains("not a file of statistics"), "{failure}");
        }
    }

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
