//! How well the renderer knows its own error: one JSON line per number of samples and filter.
//!
//! `bench_error SCENE.pbrt WIDTHxHEIGHT SPP[,SPP...] REFERENCE-A.exr REFERENCE-B.exr [TARGET[,TARGET...]]`
//!
//! For each, the predicted relMSE over the measured one, the slope of the logarithms of predicted over measured RMSE of blocks of
//! 32×32 pixels, and the share of values within 1.96 standard errors of the reference, whose own noise is added: pooled over
//! 7×7 pixels, for with one degree of freedom it would cover but 70 %. References of half floats are known to 2⁻¹¹ of their
//! values, and errors below that are not seen. With targets, the measured relMSE over the target of frames that were stopped
//! by it.
//!
//! Never a test: it only prints.
#![forbid(unsafe_code)]
#![allow(clippy::print_stdout)]

use std::path::{Path, PathBuf};

use glam::DVec3;
use renderer::error::{Estimate, Goal, Watch};
use renderer::film::Film;
use renderer::filtering::Filtering;
use renderer::frame::Accumulation;
use renderer::math::windows;
use renderer::render::{self, Frame, Job, Observer};
use serde_json::json;
use tests::error::Errors;
use tests::image::{RgbImage, read_exr};

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Relative rounding of half floats, 2⁻¹¹.
const HALF_FLOAT: f64 = 1.0 / 2048.0;

struct Watched(Watch);

impl Observer for Watched {
    fn pass_done(&self, frame: &mut Accumulation) {
        self.0.pass_done(frame);
    }
    fn stop_requested(&self) -> bool {
        self.0.reached()
    }
    fn next_look(&self) -> u64 {
        self.0.next_look()
    }
    fn look(&self, film: &Film, samples: u64) -> bool {
        self.0.look(film, samples)
    }
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, resolution, spps, a, b, targets @ ..] = arguments.as_slice() else {
        return Err("usage: bench_error SCENE.pbrt WxH SPP[,SPP...] REFERENCE-A REFERENCE-B [TARGET,...]".into());
    };
    let (width, height) = resolution.split_once('x').ok_or("the resolution is WIDTHxHEIGHT")?;
    let name = Path::new(scene).parent().and_then(Path::file_name).ok_or("the scene is in no folder")?;
    let job = Job {
        scene: PathBuf::from(scene),
        seed: Some(1),
        resolution: Some([width.parse()?, height.parse()?]),
        ..Job::default()
    };
    let references = [read_exr(Path::new(a)), read_exr(Path::new(b))];
    for filtering in ["none", "adaptive"].map(|name| Filtering::named(name).expect("a known filter")) {
        for spp in spps.split(',').filter(|spp| !spp.is_empty()) {
            let spp = spp.parse()?;
            let (frame, estimate) = run(&Job { spp: Some(spp), filtering, ..job.clone() }, Goal::default())?;
            let mut line = figures(&frame, estimate, &references);
            line["scene"] = json!(name.to_string_lossy());
            line["filter"] = json!(filtering.name());
            line["spp"] = json!(spp);
            println!("{line}");
        }
        for target in targets.iter().flat_map(|list| list.split(',')) {
            let relmse: f64 = target.parse()?;
            let goal = Goal { relmse: Some(relmse), noise: None };
            let (frame, _) = run(&Job { spp: Some(4096), filtering, ..job.clone() }, goal)?;
            let measured = Errors::new(&pixels(&frame), &references[0], &references[1]).relmse(1.0);
            let samples = frame.samples.count();
            let landed = measured / relmse;
            let (scene, filter) = (name.to_string_lossy(), filtering.name());
            println!(
                "{}",
                json!({"scene": scene, "filter": filter, "target": relmse, "samples": samples, "landed": landed})
            );
        }
    }
    Ok(())
}

fn run(job: &Job, goal: Goal) -> Result<(Frame, Option<Estimate>), Failure> {
    let watched = Watched(Watch::new(goal));
    let mut frame = render::render(job, &watched)?;
    let estimate = watched.0.finish(&mut frame.film);
    Ok((frame, estimate))
}

fn figures(frame: &Frame, estimate: Option<Estimate>, [a, b]: &[RgbImage; 2]) -> serde_json::Value {
    let image = pixels(frame);
    let errors = Errors::new(&image, a, b);
    let known: Vec<[f32; 3]> = frame.film.bounds().pixels().map(|at| frame.film.error(at).to_array()).collect();
    let mean: [f64; 3] = std::array::from_fn(|c| 0.5 * (a.mean()[c] + b.mean()[c]));
    let weight = |i: usize, c: usize| {
        let r = 0.5 * (f64::from(a.pixels[i][c]) + f64::from(b.pixels[i][c]));
        (r * r + 0.01 * mean[c] * mean[c]).recip()
    };
    let of_reference = |i: usize| {
        let noise = |c: usize| 0.5 * f64::from(a.pixels[i][c] - b.pixels[i][c]);
        DVec3::new(noise(0), noise(1), noise(2)).powf(2.0) * DVec3::new(weight(i, 0), weight(i, 1), weight(i, 2))
    };
    let of_reference =
        windows((0..image.len()).map(of_reference).collect(), a.width, 3, |sum: DVec3, count| sum / count as f64);
    let (mut within, mut predicted) = (0usize, errors.clone());
    for (i, error) in known.iter().enumerate() {
        predicted.pixels[i] = 0.0;
        for c in 0..3 {
            let [a, b, e] = [a.pixels[i][c], b.pixels[i][c], error[c]].map(f64::from);
            let (r, noise) = (0.5 * (a + b), (of_reference[i][c] / weight(i, c)).sqrt());
            within += usize::from((f64::from(image[i][c]) - r).abs() <= 1.96 * e.hypot(noise) + HALF_FLOAT * r.abs());
            predicted.pixels[i] += e * e * weight(i, c) / 3.0;
        }
    }
    let pairs: Vec<(f64, f64)> = (errors.blocks(32).into_iter().zip(predicted.blocks(32)))
        .filter(|(measured, predicted)| *measured > HALF_FLOAT * HALF_FLOAT && *predicted > 0.0)
        .map(|(measured, predicted)| (0.5 * measured.ln(), 0.5 * predicted.ln()))
        .collect();
    let interval = estimate.map(|estimate| estimate.interval);
    json!({
        "measured": errors.relmse(1.0),
        "predicted": estimate.map(|estimate| estimate.relmse),
        "interval": interval,
        "ratio": estimate.map(|estimate| estimate.relmse / errors.relmse(1.0)),
        "slope": slope(&pairs),
        "coverage": within as f64 / (3 * image.len()) as f64,
    })
}

/// Of the second over the first by the reduced major axis, as both have noise.
fn slope(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>() / n;
    let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
    (mean(&|p| (p.1 - y).powi(2)) / mean(&|p| (p.0 - x).powi(2))).sqrt()
}

fn pixels(frame: &Frame) -> Vec<[f32; 3]> {
    frame.film.bounds().pixels().map(|at| frame.film.value(at).as_vec3().max(glam::Vec3::ZERO).to_array()).collect()
}
