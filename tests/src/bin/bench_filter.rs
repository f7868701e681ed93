//! What a filter gains: one JSON line per number of samples and method.
//!
//! `bench_filter SCENE.pbrt WIDTHxHEIGHT SPP[,SPP...] REFERENCES-A REFERENCES-B [KEY=VALUE ...]`
//!
//! References are EXR files of the scene, comma-separated: the mean of each list is one of two independent halves. Keys:
//! - `methods`: comma-separated of `none`, `talk`, `adaptive`, and `NAME:FOLDER` for images that are there already, files
//!   `FOLDER/SCENE-SPP.exr` with the seconds that each took in `FOLDER/SCENE-SPP.seconds`; for those that are absent
//!   nothing is printed. Gains are over the first. `none,talk,adaptive` unless told;
//! - `seed`;
//! - `out`: a folder for images and seconds, in such folders `METHOD`; the images with what denoisers want besides;
//! - settings of the filters, as `tessera render --filter-set` has them; each goes to the filters that have it.
//!
//! Never a test: it only prints.
#![forbid(unsafe_code)]
#![allow(clippy::print_stdout)]

use std::path::{Path, PathBuf};

use renderer::film::{Aov, exr};
use renderer::filtering::{Filtering, Report};
use renderer::render::{self, Frame, Job, Statistics, Unobserved};
use serde_json::{Map, Value, json};
use tests::error::Errors;
use tests::image::{RgbImage, read_exr};

type Failure = Box<dyn std::error::Error + Send + Sync>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, resolution, spps, a, b, settings @ ..] = arguments.as_slice() else {
        return Err("usage: bench_filter SCENE.pbrt WxH SPP[,SPP...] REFERENCES-A REFERENCES-B [KEY=VALUE ...]".into());
    };
    let (width, height) = resolution.split_once('x').ok_or("the resolution is WIDTHxHEIGHT")?;
    let settings = Settings::parse(settings)?;
    let folder = Path::new(scene).parent().and_then(Path::file_name).ok_or("the scene is in no folder")?;
    let bench = Bench {
        name: folder.to_string_lossy().into_owned(),
        job: Job {
            scene: PathBuf::from(scene),
            seed: Some(settings.seed),
            resolution: Some([width.parse()?, height.parse()?]),
            ..Job::default()
        },
        a: reference(a),
        b: reference(b),
        settings,
    };
    spps.split(',').try_for_each(|spp| bench.run(spp.parse()?))
}

/// What comes after the references.
struct Settings {
    methods: Vec<Method>,
    seed: u64,
    out: Option<PathBuf>,
}

/// How an image comes about.
enum Method {
    Ours(Filtering),
    Others { name: String, folder: PathBuf },
}

impl Settings {
    fn parse(arguments: &[String]) -> Result<Self, Failure> {
        let pairs = arguments.iter().map(|setting| setting.split_once('=').ok_or("settings are KEY=VALUE"));
        let pairs: Vec<(&str, &str)> = pairs.collect::<Result<_, _>>()?;
        let (mut methods, mut seed, mut out) = ("none,talk,adaptive", 1, None);
        let mut knobs = Vec::new();
        for (key, value) in pairs {
            match key {
                "methods" => methods = value,
                "seed" => seed = value.parse()?,
                "out" => out = Some(PathBuf::from(value)),
                _ => knobs.push((key, value)),
            }
        }
        let mut methods = methods.split(',').map(Method::parse).collect::<Result<Vec<_>, _>>()?;
        for (key, value) in knobs {
            let mut known = false;
            for method in &mut methods {
                if let Method::Ours(filtering) = method {
                    if filtering.settings().iter().any(|(name, _)| *name == key) {
                        filtering.set(key, value)?;
                        known = true;
                    }
                }
            }
            if !known {
                return Err(format!("none of the methods has a setting {key}").into());
            }
        }
        Ok(Self { methods, seed, out })
    }
}

impl Method {
    fn parse(text: &str) -> Result<Self, Failure> {
        match text.split_once(':') {
            Some((name, folder)) => Ok(Self::Others { name: name.into(), folder: folder.into() }),
            None => Ok(Self::Ours(Filtering::named(text).ok_or_else(|| format!("no method is called {text}"))?)),
        }
    }

    fn name(&self) -> &str {
        match self {
            Self::Ours(filtering) => filtering.name(),
            Self::Others { name, .. } => name,
        }
    }
}

/// A scene and what its images are judged by.
struct Bench {
    name: String,
    job: Job,
    a: RgbImage,
    b: RgbImage,
    settings: Settings,
}

/// How far an image is from the references, and what it took if we made it.
#[derive(Clone)]
struct Figures {
    relmse: f64,
    untrimmed: f64,
    blocks: Vec<f64>,
    seconds: Option<f64>,
}

impl Bench {
    /// Prints a line for every method.
    fn run(&self, spp: u64) -> Result<(), Failure> {
        let mut base = None;
        for method in &self.settings.methods {
            let (image, seconds, statistics) = match method {
                Method::Ours(filtering) => {
                    let frame = self.render(spp, *filtering)?;
                    (pixels(&frame), Some(frame.statistics.render_seconds), Some(frame.statistics))
                }
                Method::Others { folder, .. } => {
                    let file = folder.join(format!("{}-{spp}.exr", self.name));
                    if !file.is_file() {
                        continue;
                    }
                    let seconds = std::fs::read_to_string(file.with_extension("seconds"));
                    (read_exr(&file).pixels, seconds.ok().and_then(|text| text.trim().parse().ok()), None)
                }
            };
            let errors = Errors::new(&image, &self.a, &self.b);
            let figures = Figures {
                relmse: errors.relmse(0.999),
                untrimmed: errors.relmse(1.0),
                blocks: errors.blocks(32),
                seconds,
            };
            let mut line = self.line(spp, method, &image);
            let base = base.get_or_insert_with(|| figures.clone());
            figures.compare(base, &mut line);
            if let Some(statistics) = &statistics {
                costs(statistics, &mut line);
            }
            println!("{}", Value::Object(line));
        }
        Ok(())
    }

    fn render(&self, spp: u64, filtering: Filtering) -> Result<Frame, Failure> {
        let guides = self.settings.out.is_some().then_some([Aov::Albedo, Aov::Normal]);
        let aovs = guides.into_iter().flatten().collect();
        let frame = render::render(&Job { spp: Some(spp), filtering, aovs, ..self.job.clone() }, &Unobserved)?;
        if let Some(folder) = &self.settings.out {
            let folder = folder.join(filtering.name());
            std::fs::create_dir_all(&folder)?;
            let file = folder.join(format!("{}-{spp}.exr", self.name));
            exr::write(&frame.film, Vec::new(), &file)?;
            std::fs::write(file.with_extension("seconds"), frame.statistics.render_seconds.to_string())?;
        }
        Ok(frame)
    }

    fn line(&self, spp: u64, method: &Method, image: &[[f32; 3]]) -> Map<String, Value> {
        let references = 0.5 * (mean(&self.a.pixels) + mean(&self.b.pixels));
        let line = json!({
            "scene": self.name,
            "spp": spp,
            "filter": method.name(),
            "mean_ratio": mean(image) / references,
        });
        line.as_object().cloned().unwrap_or_default()
    }
}

impl Figures {
    fn compare(&self, base: &Self, line: &mut Map<String, Value>) {
        let gain = base.relmse / self.relmse;
        let worse = self.blocks.iter().zip(&base.blocks).filter(|(own, base)| **own > 1.25 * **base).count();
        line.extend([
            ("relmse".into(), json!(self.relmse)),
            ("gain".into(), json!(gain)),
            ("gain_untrimmed".into(), json!(base.untrimmed / self.untrimmed)),
            ("blocks_worse".into(), json!(worse)),
            ("blocks".into(), json!(base.blocks.len())),
        ]);
        if let (Some(own), Some(base)) = (self.seconds, base.seconds) {
            line.insert("seconds".into(), json!(own));
            line.insert("gain_equal_time".into(), json!(gain * base / own));
        }
    }
}

fn costs(statistics: &Statistics, line: &mut Map<String, Value>) {
    line.insert("filter_seconds".into(), json!(statistics.filter_seconds));
    let figures = match &statistics.filter {
        None => json!({}),
        Some(Report::Adaptive(report)) => json!({
            "cells": report.cells,
            "second_cells": report.second_cells,
            "pairs": report.pairs,
            "bytes": report.bytes,
            "unfiltered": report.unfiltered,
        }),
        Some(Report::Talk(report)) => json!({
            "cells": report.cells,
            "bytes": report.bytes,
            "occupancy": report.occupancy(),
            "mean_probes": report.mean_probes(),
            "unresolved_share": report.unresolved_share(),
        }),
    };
    line.extend(figures.as_object().cloned().unwrap_or_default());
}

fn mean(image: &[[f32; 3]]) -> f64 {
    image.iter().flatten().map(|x| f64::from(*x)).sum::<f64>() / (3 * image.len()) as f64
}

/// The mean of several images.
fn reference(files: &str) -> RgbImage {
    let images: Vec<RgbImage> = files.split(',').map(|file| read_exr(Path::new(file))).collect();
    let mut mean = images[0].clone();
    for (i, pixel) in mean.pixels.iter_mut().enumerate() {
        *pixel =
            std::array::from_fn(|c| images.iter().map(|image| image.pixels[i][c]).sum::<f32>() / images.len() as f32);
    }
    mean
}

fn pixels(frame: &Frame) -> Vec<[f32; 3]> {
    frame.film.bounds().pixels().map(|at| frame.film.value(at).as_vec3().max(glam::Vec3::ZERO).to_array()).collect()
}
