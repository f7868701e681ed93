//! What the filter gains: one JSON line per scene, samples and filter.
//!
//! `bench_filter SCENE.pbrt WIDTHxHEIGHT SPP[,SPP...] REFERENCES-A REFERENCES-B [KEY=VALUE ...]`
//!
//! References are EXR files of the scene, comma-separated: the mean of each list is one of two independent halves. Keys are
//! settings of the filter, `seed`, and `out`, a folder for the images. Never a test: it only prints.
#![forbid(unsafe_code)]
#![allow(clippy::print_stdout)]

use std::path::{Path, PathBuf};

use renderer::filtering::{Blend, Filtering};
use renderer::render::{self, Frame, Job, Unobserved};
use tests::error::Errors;
use tests::image::{RgbImage, read_exr};

type Failure = Box<dyn std::error::Error + Send + Sync>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, resolution, spps, a, b, settings @ ..] = arguments.as_slice() else {
        return Err("usage: bench_filter SCENE.pbrt WxH SPP[,SPP...] REFERENCES-A REFERENCES-B [KEY=VALUE ...]".into());
    };
    let (width, height) = resolution.split_once('x').ok_or("the resolution is WIDTHxHEIGHT")?;
    let resolution = Some([width.parse()?, height.parse()?]);
    let (mut params, mut seed, mut out) = (filter::Params::default(), 1, None);
    let mut blend = Blend::default();
    for setting in settings {
        let (key, value) = setting.split_once('=').ok_or("settings are KEY=VALUE")?;
        match key {
            "seed" => seed = value.parse()?,
            "out" => out = Some(PathBuf::from(value)),
            "trees" => params.trees = value.parse()?,
            "second_trees" => params.second_trees = value.parse()?,
            "leaf" => params.leaf = value.parse()?,
            "second_leaf" => params.second_leaf = value.parse()?,
            "radius" => blend.radius = value.parse()?,
            "doubt" => blend.doubt = value.parse()?,
            "glossy_doubt" => blend.glossy_doubt = value.parse()?,
            "tau" => params.shrinkage.tau = value.parse()?,
            "trusted" => params.shrinkage.trusted = value.parse()?,
            "levels" => params.shrinkage.levels = value.parse()?,
            _ => return Err(format!("no setting is called {key}").into()),
        }
    }
    let (a, b) = (reference(a), reference(b));
    for spp in spps.split(',') {
        let spp: u64 = spp.parse()?;
        let mut plain = None;
        for (name, filtering) in [("none", Filtering::None), ("adaptive", Filtering::Adaptive(params, blend))] {
            let job = Job {
                scene: PathBuf::from(scene),
                spp: Some(spp),
                seed: Some(seed),
                resolution,
                filtering,
                ..Job::default()
            };
            let frame = render::render(&job, &Unobserved)?;
            let image = pixels(&frame);
            let errors = Errors::new(&image, &a, &b);
            let (trimmed, all) = (errors.relmse(0.999), errors.relmse(1.0));
            let seconds = frame.statistics.render_seconds;
            let base = plain.get_or_insert((trimmed, all, seconds, errors.blocks(32)));
            let worse = errors.blocks(32).iter().zip(&base.3).filter(|(f, u)| **f > 1.25 * **u).count();
            let mean = |image: &[[f32; 3]]| {
                image.iter().map(|p| p.iter().map(|x| f64::from(*x)).sum::<f64>()).sum::<f64>()
                    / (3 * image.len()) as f64
            };
            let references = 0.5 * (mean(&a.pixels) + mean(&b.pixels));
            let report = frame.statistics.filter.unwrap_or_default();
            let line = serde_json::json!({
                "scene": Path::new(scene).parent().and_then(Path::file_name).map(|name| name.to_string_lossy()),
                "spp": spp,
                "filter": name,
                "relmse": trimmed,
                "gain": base.0 / trimmed,
                "gain_untrimmed": base.1 / all,
                "gain_equal_time": base.0 / trimmed * base.2 / seconds,
                "mean_ratio": mean(&image) / references,
                "blocks_worse": worse,
                "blocks": base.3.len(),
                "seconds": seconds,
                "filter_seconds": frame.statistics.filter_seconds,
                "cells": report.cells,
                "second_cells": report.second_cells,
                "pairs": report.pairs,
                "bytes": report.bytes,
                "unfiltered": report.unfiltered,
            });
            println!("{line}");
            if let Some(folder) = &out {
                let stem = Path::new(scene).parent().and_then(Path::file_name).ok_or("the scene is in no folder")?;
                let name = folder.join(format!("{}-{spp}-{name}.exr", stem.to_string_lossy()));
                renderer::film::exr::write(&frame.film, Vec::new(), &name)?;
            }
        }
    }
    Ok(())
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
