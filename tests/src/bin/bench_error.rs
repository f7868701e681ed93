//! How well the renderer knows its own error: one JSON line per number of samples and filter.
//!
//! `bench_error SCENE.pbrt WIDTHxHEIGHT SPP[,SPP...] REFERENCE-A.exr REFERENCE-B.exr [TARGET[,TARGET...]]`
//!
//! For each, the predicted relMSE over the measured one, both of the best 99.9 % of the pixels; the slope of the logarithms of
//! predicted over measured RMSE of blocks of 32×32 pixels, of all pixels and of those; and the share of values within 1.96
//! standard errors of the reference, whose own noise is added: pooled over 7×7 pixels, for with one degree of freedom it
//! would cover but 70 %. References of half floats are known to 2⁻¹¹ of their values, and errors below that are not seen.
//! With targets, the measured relMSE over the target of frames that were stopped by it.
//!
//! Errors are relative to the references' mean after a Wiener filter. Where little light is found references of thousands of
//! samples are noisy too: dark pixels that are darker yet by chance would count for several times as much.
//!
//! `TESSERA_SEED` is the seed of the frames, 1 if it is not set; `TESSERA_FILTERS` the filters, `none,adaptive`.
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
use renderer::math::{wiener, windows};
use renderer::render::{self, Frame, Job, Observer};
use serde_json::json;
use tests::error::Errors;
use tests::image::{RgbImage, read_exr};

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Relative rounding of half floats, 2⁻¹¹.
const HALF_FLOAT: f64 = 1.0 / 2048.0;

/// The share of the pixels that relMSE is of, the best ones.
const BEST: f64 = 0.999;

/// What frames are measured against.
struct References {
    halves: [RgbImage; 2],
    /// What squared errors are multiplied by.
    weights: Vec<DVec3>,
    /// Squared errors of the references' mean, relative.
    noise: Vec<DVec3>,
}

impl References {
    fn new(a: RgbImage, b: RgbImage) -> Self {
        let value = |image: &RgbImage, i: usize| glam::Vec3::from_array(image.pixels[i]).as_dvec3();
        let count = a.pixels.len();
        let mean: Vec<DVec3> = (0..count).map(|i| 0.5 * (value(&a, i) + value(&b, i))).collect();
        let noise: Vec<DVec3> = (0..count).map(|i| 0.5 * (value(&a, i) - value(&b, i))).collect();
        let level = mean.iter().sum::<DVec3>() / count as f64;
        let smooth = wiener(&mean, &noise, a.width);
        let weights: Vec<DVec3> = smooth.into_iter().map(|r| (r * r + 0.01 * level * level).recip()).collect();
        let noise = noise.iter().zip(&weights).map(|(noise, weight)| *noise * *noise * *weight).collect();
        let noise = windows(noise, a.width, 3, |sum: DVec3, count| sum / count as f64);
        Self { halves: [a, b], weights, noise }
    }

    fn errors(&self, image: &[[f32; 3]]) -> Errors {
        let [a, b] = &self.halves;
        Errors::weighted(image, a, b, |i, c| self.weights[i][c])
    }
}

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
        seed: Some(std::env::var("TESSERA_SEED").map_or(Ok(1), |seed| seed.parse())?),
        resolution: Some([width.parse()?, height.parse()?]),
        ..Job::default()
    };
    let references = References::new(read_exr(Path::new(a)), read_exr(Path::new(b)));
    let filters = std::env::var("TESSERA_FILTERS").unwrap_or_else(|_| "none,adaptive".to_owned());
    for name_of_filter in filters.split(',') {
        let filtering = Filtering::named(name_of_filter).ok_or("no such filter")?;
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
            let measured = references.errors(&pixels(&frame)).relmse(BEST);
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

fn figures(frame: &Frame, estimate: Option<Estimate>, references: &References) -> serde_json::Value {
    let image = pixels(frame);
    let errors = references.errors(&image);
    let known: Vec<[f32; 3]> = frame.film.bounds().pixels().map(|at| frame.film.error(at).to_array()).collect();
    let [a, b] = &references.halves;
    let (mut within, mut predicted) = (0usize, errors.clone());
    for (i, error) in known.iter().enumerate() {
        predicted.pixels[i] = 0.0;
        for c in 0..3 {
            let weight = references.weights[i][c];
            let [a, b, e] = [a.pixels[i][c], b.pixels[i][c], error[c]].map(f64::from);
            let (r, noise) = (0.5 * (a + b), (references.noise[i][c] / weight).sqrt());
            within += usize::from((f64::from(image[i][c]) - r).abs() <= 1.96 * e.hypot(noise) + HALF_FLOAT * r.abs());
            predicted.pixels[i] += e * e * weight / 3.0;
        }
    }
    let slope_of_all = slope(&errors, &predicted);
    let measured = errors.relmse(BEST);
    let (mut best, mut predicted_best) = (errors.clone(), predicted);
    let mut sorted = errors.pixels.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let most = sorted[((sorted.len() as f64 * BEST).round() as usize).clamp(1, sorted.len()) - 1];
    for i in (0..image.len()).filter(|i| errors.pixels[*i] > most) {
        (best.pixels[i], predicted_best.pixels[i]) = (0.0, 0.0);
    }
    json!({
        "measured": measured,
        "measured_all": errors.relmse(1.0),
        "predicted": estimate.map(|estimate| estimate.relmse),
        "interval": estimate.map(|estimate| estimate.interval),
        "ratio": estimate.map(|estimate| estimate.relmse / measured),
        "slope": slope_of_all,
        "slope_best": slope(&best, &predicted_best),
        "coverage": within as f64 / (3 * image.len()) as f64,
    })
}

/// Of the logarithms of predicted over measured RMSE of blocks, by the reduced major axis, as both have noise.
fn slope(measured: &Errors, predicted: &Errors) -> f64 {
    let pairs: Vec<(f64, f64)> = (measured.blocks(32).into_iter().zip(predicted.blocks(32)))
        .filter(|(measured, predicted)| *measured > HALF_FLOAT * HALF_FLOAT && *predicted > 0.0)
        .map(|(measured, predicted)| (0.5 * measured.ln(), 0.5 * predicted.ln()))
        .collect();
    let n = pairs.len() as f64;
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>() / n;
    let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
    (mean(&|p| (p.1 - y).powi(2)) / mean(&|p| (p.0 - x).powi(2))).sqrt()
}

fn pixels(frame: &Frame) -> Vec<[f32; 3]> {
    frame.film.bounds().pixels().map(|at| frame.film.value(at).as_vec3().max(glam::Vec3::ZERO).to_array()).collect()
}
