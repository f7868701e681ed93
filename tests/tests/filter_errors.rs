//! Error, bias and energy of the adaptive filter on small scenes: never worse than none, and right in the end.
//!
//! The thorough variants, with more scenes, samples and seeds, are for `ci/test-filter`.
#![allow(clippy::print_stdout, reason = "tests print the figures that they judge")]

use std::collections::HashMap;

use renderer::film::{AovSet, Film};
use renderer::filtering::{Filtering, Paths};
use renderer::integrator::Opaque;
use renderer::render::{Job, Unobserved, prepare, trace_tile};
use renderer::sampling::Sampler;
use tests::image::RgbImage;
use tests::small::{PLAIN, SceneFile, adaptive, average, cavity, chequered, room, squared_error, view};
use tests::synthetic::{mean, thorough};

const GLOSSY: &str = "Material \"coateddiffuse\" \"rgb reflectance\" [ 0.2 0.5 0.8 ] \"float roughness\" 0.2\n";
const METAL: &str = "Material \"conductor\" \"rgb reflectance\" [ 0.9 0.8 0.5 ] \"float roughness\" 0.15\n";
const GLASS: &str = "Material \"dielectric\" \"float eta\" 1.5\n";

const SIZE: [u32; 2] = [48, 36];

/// Two independent references.
struct References([RgbImage; 2]);

impl References {
    fn new(scene: &SceneFile, spp: u64) -> Self {
        Self([1001, 1002].map(|seed| scene.values(spp, seed, Filtering::None)))
    }

    /// Mean squared error relative to brightness, over the pixels that count.
    fn error(&self, image: &RgbImage, counts: impl Fn(usize, usize) -> bool) -> f64 {
        squared_error(image, &self.0[0], &self.0[1], counts)
    }

    /// The same of the product of two independent images' errors: the squared bias.
    fn bias(&self, a: &RgbImage, b: &RgbImage) -> f64 {
        let reference = average(&self.0);
        let level = reference.mean().iter().sum::<f64>() / 3.0;
        let mut sum = 0.0;
        for ((a, b), (ra, rb)) in a.pixels.iter().zip(&b.pixels).zip(self.0[0].pixels.iter().zip(&self.0[1].pixels)) {
            for c in 0..3 {
                let r = f64::from(0.5 * (ra[c] + rb[c]));
                let product = f64::from(a[c] - ra[c]) * f64::from(b[c] - rb[c]);
                sum += product / (r * r + 0.01 * level * level);
            }
        }
        sum / (3 * a.pixels.len()) as f64
    }
}

/// Filtered over unfiltered squared error, mean over seeds of each.
fn ratio(
    scene: &SceneFile,
    references: &References,
    spp: u64,
    seeds: u64,
    counts: impl Fn(usize, usize) -> bool + Copy,
) -> f64 {
    let errors = |filtering: Filtering| {
        let errors: Vec<f64> =
            (0..seeds).map(|seed| references.error(&scene.values(spp, seed, filtering), counts)).collect();
        mean(&errors)
    };
    errors(adaptive()) / errors(Filtering::None)
}

#[test]
fn the_filter_does_no_harm() {
    let mut scenes = vec![("room", room(SIZE, 1.0, 1.0, PLAIN))];
    let mut samples = vec![1, 4, 16, 64];
    let mut reference = 1024;
    if thorough() {
        scenes.push(("cavity", cavity(SIZE)));
        scenes.push(("coated", room(SIZE, 1.0, 1.0, GLOSSY)));
        scenes.push(("metal", room(SIZE, 1.0, 1.0, METAL)));
        scenes.push(("glass", room(SIZE, 1.0, 1.0, GLASS)));
        scenes.push(("chequered", chequered(SIZE, 0.1)));
        samples.extend([256, 1024]);
        reference = 16384;
    }
    let mut worst: f64 = 0.0;
    for (name, text) in scenes {
        let scene = SceneFile::new(&text);
        let references = References::new(&scene, reference);
        for &spp in &samples {
            let ratio = ratio(&scene, &references, spp, if spp < 64 { 4 } else { 2 }, |_, _| true);
            println!("{name}, {spp} spp: gain {:.2} (bound 0.98)", 1.0 / ratio);
            worst = worst.max(ratio);
        }
    }
    assert!(1.0 / worst >= 0.98, "gain {}", 1.0 / worst);
}

#[test]
fn energy_is_that_of_the_same_samples() {
    let mut scenes = vec![("room", room(SIZE, 1.0, 1.0, PLAIN)), ("coated", room(SIZE, 1.0, 1.0, GLOSSY))];
    if thorough() {
        scenes.push(("metal", room(SIZE, 1.0, 1.0, METAL)));
        scenes.push(("glass", room(SIZE, 1.0, 1.0, GLASS)));
        scenes.push(("cavity", cavity(SIZE)));
        scenes.push(("chequered", chequered(SIZE, 0.1)));
    }
    let seeds = if thorough() { 32 } else { 8 };
    for (name, text) in scenes {
        let scene = SceneFile::new(&text);
        for spp in [4, 16, 64] {
            let ratios: Vec<f64> = (0..seeds)
                .map(|seed| {
                    let energy = |filtering| scene.values(spp, seed, filtering).mean().iter().sum::<f64>();
                    energy(adaptive()) / energy(Filtering::None) - 1.0
                })
                .collect();
            let off = mean(&ratios);
            let spread = (ratios.iter().map(|x| (x - off).powi(2)).sum::<f64>() / (seeds - 1) as f64).sqrt();
            let error = spread / (seeds as f64).sqrt();
            println!("{name}, {spp} spp: energy off by {:.3} % ± {:.3} % (bound 0.2 %)", 100.0 * off, 100.0 * error);
            assert!(off.abs() <= 0.002 + 3.0 * error);
        }
    }
}

/// Cells of one surface have one albedo, so what remains is what the adaptive filter may be off by without a clamp.
#[test]
fn energy_is_that_of_clamped_samples() {
    let text = room(SIZE, 1.0, 1.0, PLAIN).replace("Film \"rgb\"", "Film \"rgb\" \"float maxcomponentvalue\" 0.2");
    let scene = SceneFile::new(&text);
    let seeds = 8;
    for (name, filtering) in [("talk", Filtering::named("talk").expect("the talk's filter")), ("adaptive", adaptive())]
    {
        let ratios: Vec<f64> = (0..seeds)
            .map(|seed| {
                let energy = |filtering| scene.values(16, seed, filtering).mean().iter().sum::<f64>();
                energy(filtering) / energy(Filtering::None) - 1.0
            })
            .collect();
        let off = mean(&ratios);
        let spread = (ratios.iter().map(|x| (x - off).powi(2)).sum::<f64>() / (seeds - 1) as f64).sqrt();
        let error = spread / (seeds as f64).sqrt();
        println!("{name}: energy off by {:.3} % ± {:.3} %", 100.0 * off, 100.0 * error);
        assert!(off.abs() <= 0.002 + 3.0 * error);
    }
}

#[test]
fn bias_vanishes() {
    let mut scenes = vec![("room", room(SIZE, 1.0, 1.0, PLAIN))];
    let mut samples = vec![4, 16, 64];
    if thorough() {
        scenes.push(("cavity", cavity(SIZE)));
        scenes.push(("coated", room(SIZE, 1.0, 1.0, GLOSSY)));
        samples.extend([256, 1024]);
    }
    for (name, text) in scenes {
        let scene = SceneFile::new(&text);
        let references = References::new(&scene, if thorough() { 16384 } else { 1024 });
        let mut last = f64::INFINITY;
        for &spp in &samples {
            let seeds = if spp > 64 { 4 } else { 8 };
            let images: Vec<RgbImage> = (0..2 * seeds).map(|seed| scene.values(spp, seed, adaptive())).collect();
            let (a, b) = images.split_at(seeds as usize);
            let bias = references.bias(&average(a), &average(b)).max(0.0).sqrt();
            let error =
                mean(&images.iter().map(|image| references.error(image, |_, _| true)).collect::<Vec<_>>()).sqrt();
            println!(
                "{name}, {spp} spp: rms bias {bias:.4}, rms error {error:.4} (bias must fall, and end below half)"
            );
            assert!(bias < last);
            assert!(spp < 1024 || bias < 0.5 * error);
            last = bias;
        }
    }
}

#[test]
fn dark_corners_and_contact_shadows_are_not_worse_than_noise() {
    // The inside of the box and the gap under the slab: 48 × 36 pixels of which the middle is the box.
    let scene = SceneFile::new(&cavity(SIZE));
    let references = References::new(&scene, if thorough() { 16384 } else { 1024 });
    let inside = |x: usize, y: usize| (12..36).contains(&x) && (10..26).contains(&y);
    let samples: &[u64] = if thorough() { &[4, 16, 64, 256, 1024] } else { &[16] };
    for &spp in samples {
        let seeds = if spp > 64 { 2 } else { 4 };
        let ratio = ratio(&scene, &references, spp, seeds, inside);
        let level = |image: &RgbImage| {
            let pixels = image.pixels.iter().enumerate().filter(|(i, _)| inside(i % 48, i / 48));
            pixels.map(|(_, pixel)| f64::from(pixel[1])).sum::<f64>()
        };
        let off: Vec<f64> = (0..2 * seeds)
            .map(|seed| {
                let of = |filtering| level(&scene.values(spp, seed, filtering));
                of(adaptive()) / of(Filtering::None) - 1.0
            })
            .collect();
        let error = (off.iter().map(|x| (x - mean(&off)).powi(2)).sum::<f64>()).sqrt() / off.len() as f64;
        println!(
            "cavity, {spp} spp: squared error {ratio:.3} of unfiltered (bound 1/0.98), mean off by {:.2} ± {:.2} % (bound \
             5 %)",
            100.0 * mean(&off),
            100.0 * error
        );
        // Light that leaks in or out of the box, in the mean of all of it.
        assert!(mean(&off).abs() <= 0.05 + 3.0 * error);
        assert!(ratio <= 1.0 / 0.98);
    }
}

#[test]
fn glossy_floors_are_not_worse_than_noise() {
    let alphas: &[f32] = if thorough() { &[0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5] } else { &[0.1] };
    for &alpha in alphas {
        let scene = SceneFile::new(&chequered(SIZE, alpha));
        let references = References::new(&scene, if thorough() { 16384 } else { 1024 });
        let ratio = ratio(&scene, &references, 64, 4, |_, _| true).sqrt();
        println!("GGX floor of width {alpha} under checks, 64 spp: error {ratio:.3} of unfiltered (bound 1.05)");
        assert!(ratio <= 1.05);
    }
}

/// A floor under a lamp, with no shadow and nothing else.
fn open_floor() -> String {
    view(
        SIZE,
        "Camera \"perspective\" \"float fov\" 60",
        "Material \"diffuse\" \"rgb reflectance\" [ 0.5 0.5 0.5 ]\n\
         Shape \"bilinearmesh\" \"point3 P\" [ -9 0 -1 9 0 -1 -9 9 -1 9 9 -1 ]\n\
         AttributeBegin\nTranslate 0 4 4\nAreaLightSource \"diffuse\" \"rgb L\" [ 20 20 20 ]\n\
         Shape \"sphere\" \"float radius\" 1.5\nAttributeEnd\n",
    )
}

/// Sums of one cell over one image: deposits, luminance, its square.
type Moments = [f64; 3];

#[test]
fn variances_of_cells_are_those_that_are_predicted() {
    // What the filter takes for the variance of a cell's mean, from its deposits as if they were independent, against what
    // it is, over seeds: the samples are of a low-discrepancy sequence.
    const SEEDS: u64 = 24;
    for (name, text, spp) in [
        ("room", room(SIZE, 1.0, 1.0, PLAIN), 4),
        ("room", room(SIZE, 1.0, 1.0, PLAIN), if thorough() { 64 } else { 16 }),
        ("open floor", open_floor(), 4),
        ("open floor", open_floor(), if thorough() { 256 } else { 16 }),
    ] {
        let scene = SceneFile::new(&text);
        let prepared = prepare(&Job { scene: scene.path(), ..Job::default() }, &Unobserved).expect("a scene");
        let world = &prepared.world;
        let queries = Opaque(world.geometry.scene());
        let mut cells: HashMap<[i32; 5], Vec<Moments>> = HashMap::new();
        for seed in 0..SEEDS {
            let mut film = Film::new(world.sensor.resolution, world.sensor.bounds, AovSet::default(), false);
            let sampler = Sampler::new(seed);
            for tile in &mut film.tiles() {
                let mut paths = Paths::default();
                trace_tile(world, &queries, tile, &(0..spp), &sampler, false, &mut paths);
                for record in paths.records {
                    // Cells of about four pixels a side.
                    let vertex = &record.first;
                    let cell = vertex.p.map(|x| (x / 0.25).floor() as i32);
                    let n = vertex.n.get();
                    let facing =
                        (n.x * 1.5).round() as i32 * 9 + (n.y * 1.5).round() as i32 * 3 + (n.z * 1.5).round() as i32;
                    let key = [vertex.surface() as i32, facing, cell[0], cell[1], cell[2]];
                    let y = f64::from(record.diffuse.incident(record.suffix.get()).y);
                    let sums = &mut cells.entry(key).or_insert_with(|| vec![[0.0; 3]; SEEDS as usize])[seed as usize];
                    *sums = [sums[0] + 1.0, sums[1] + y, sums[2] + y * y];
                }
            }
        }
        let mut ratios = Vec::new();
        let (mut predicted_sum, mut actual_sum) = (0.0, 0.0);
        for seeds in cells.values().filter(|seeds| seeds.iter().all(|[n, ..]| *n >= 8.0)) {
            let means: Vec<f64> = seeds.iter().map(|[n, sum, _]| sum / n).collect();
            let centre = mean(&means);
            let actual = means.iter().map(|x| (x - centre).powi(2)).sum::<f64>() / (SEEDS - 1) as f64;
            let variance = |[n, sum, square]: &Moments| (square - sum * sum / n) / (n - 1.0) / n;
            let predicted = mean(&seeds.iter().map(variance).collect::<Vec<_>>());
            if actual > 0.0 {
                ratios.push(predicted / actual);
                predicted_sum += predicted / (centre * centre);
                actual_sum += actual / (centre * centre);
            }
        }
        ratios.sort_by(f64::total_cmp);
        let at = |share: f64| ratios[((ratios.len() - 1) as f64 * share) as usize];
        println!(
            "{name}, {spp} spp: predicted over actual variance of the means of {} cells: median {:.2}, 10 % {:.2}, 90 % {:.2}, of \
             sums {:.2} (asked 0.5 to 2)",
            ratios.len(),
            at(0.5),
            at(0.1),
            at(0.9),
            predicted_sum / actual_sum
        );
        // Too small: noise would be taken for signal. Too large: belief would come late.
        assert!(at(0.5) >= 0.5, "noise is underestimated");
        assert!(at(0.5) <= 2.0, "noise is overestimated");
    }
}

#[test]
fn noise_of_pixels_is_what_their_halves_say() {
    // The blend takes a quarter of the squared difference between even and odd samples for the variance of a pixel. Halves
    // of a low-discrepancy sequence know of each other, so it need not be.
    const SEEDS: u64 = 16;
    for (name, text) in
        [("room", room(SIZE, 1.0, 1.0, PLAIN)), ("metal", room(SIZE, 1.0, 1.0, METAL)), ("open floor", open_floor())]
    {
        let scene = SceneFile::new(&text);
        for &spp in if thorough() { &[2, 4, 16, 64][..] } else { &[2, 16] } {
            let (mut predicted, mut images) = (vec![0.0; (SIZE[0] * SIZE[1]) as usize], Vec::new());
            for seed in 0..SEEDS {
                let job = Job { spp: Some(spp), seed: Some(seed), filtering: adaptive(), ..Job::default() };
                let film = scene.render(job).film;
                for (i, at) in film.bounds().pixels().enumerate() {
                    let [even, odd] = film.pixel(at).halves().expect("more than one sample").map(|half| half.y);
                    predicted[i] += (0.5 * (even - odd)).powi(2) / SEEDS as f64;
                }
                images.push(film.bounds().pixels().map(|at| film.pixel(at).mean().y).collect::<Vec<f64>>());
            }
            // Sums relative to brightness, without the brightest: they are lamps' edges and fireflies.
            let (mut said, mut is) = (0.0, 0.0);
            let centres: Vec<f64> =
                (0..predicted.len()).map(|i| images.iter().map(|image| image[i]).sum::<f64>() / SEEDS as f64).collect();
            let level = mean(&centres);
            for (i, &centre) in centres.iter().enumerate().filter(|(_, centre)| **centre < 5.0 * level) {
                let variance = images.iter().map(|image| (image[i] - centre).powi(2)).sum::<f64>() / (SEEDS - 1) as f64;
                let scale = (centre * centre + 0.01 * level * level).recip();
                said += predicted[i] * scale;
                is += variance * scale;
            }
            println!(
                "{name}, {spp} spp: variance of pixels by their halves over what it is: {:.2} (bounds 0.5, 2)",
                said / is
            );
            assert!((0.5..=2.0).contains(&(said / is)));
        }
    }
}
