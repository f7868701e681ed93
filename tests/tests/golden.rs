//! Pictures as they were accepted: a change that alters what is rendered shows here.
//!
//! `TESSERA_BLESS=1 cargo test -p tests --test golden` makes them anew, which is right only after a change that was meant to
//! alter the picture, and after looking at it.
#![allow(clippy::print_stdout, reason = "tests print the figures that they judge")]

use std::path::{Path, PathBuf};

use renderer::film::{self, Aov, AovSet};
use renderer::render::Job;
use tests::render::{own_scene, run};

/// One stored picture: mean, variance of one sample and number of samples, by pixel, of the three channels.
struct Golden {
    size: [usize; 2],
    mean: Vec<[f64; 3]>,
    variance: Vec<[f64; 3]>,
    samples: f64,
}

/// Reads a picture with a reader that is not ours.
fn read(path: &Path) -> Golden {
    let image =
        exr::prelude::read_first_flat_layer_from_file(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let layer = image.layer_data;
    let channel = |name: &str| -> Vec<f64> {
        let found = layer.channel_data.list.iter().find(|c| c.name.eq(name)).unwrap_or_else(|| panic!("no {name}"));
        found.sample_data.values_as_f32().map(f64::from).collect()
    };
    let rgb = |names: [&str; 3]| -> Vec<[f64; 3]> {
        let [r, g, b] = names.map(channel);
        r.iter().zip(g).zip(b).map(|((r, g), b)| [*r, g, b]).collect()
    };
    Golden {
        size: [layer.size.x(), layer.size.y()],
        mean: rgb(["R", "G", "B"]),
        variance: rgb(["variance.R", "variance.G", "variance.B"]),
        samples: channel("sampleCount")[0],
    }
}

fn golden(scene: &str, spp: u64) {
    let name = Path::new(scene).file_stem().unwrap().to_string_lossy().into_owned();
    let reference: PathBuf = own_scene("golden").join(format!("{name}.exr"));
    let aovs = AovSet::from_iter([Aov::Variance, Aov::SampleCount]);
    let job = |seed, spp| Job { scene: own_scene(scene), seed: Some(seed), spp: Some(spp), aovs, ..Job::default() };
    if std::env::var_os("TESSERA_BLESS").is_some() {
        // Another seed, so that picture and test are independent.
        film::exr::write(&run(&job(1, 16 * spp)).film, Vec::new(), &reference).unwrap();
    }
    let stored = read(&reference);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("now.exr");
    film::exr::write(&run(&job(0, spp)).film, Vec::new(), &path).unwrap();
    let now = read(&path);
    assert_eq!(now.size, stored.size);

    let [width, height] = now.size;
    let block = |x: usize, y: usize, side: usize| {
        let rows = y..(y + side).min(height);
        rows.flat_map(move |row| (x..(x + side).min(width)).map(move |column| row * width + column))
    };
    let z = |pixels: &mut dyn Iterator<Item = usize>, channel: usize| {
        let (mut difference, mut variance, mut level, mut count) = (0.0, 0.0, 0.0, 0.0);
        for at in pixels {
            difference += now.mean[at][channel] - stored.mean[at][channel];
            variance += now.variance[at][channel] / now.samples + stored.variance[at][channel] / stored.samples;
            level += stored.mean[at][channel];
            count += 1.0f64;
        }
        // Both pictures hold means as halves, each rounded to 2⁻¹¹ of itself at most; a tenth of that is left for rounding
        // that does not average out.
        let rounding = level * 2f64.powi(-11) * (1.0 / count.sqrt()).max(0.1);
        (difference.abs() - rounding).max(0.0) / variance.max(f64::MIN_POSITIVE).sqrt()
    };
    let mut worst = 0.0f64;
    for y in (0..height).step_by(8) {
        for x in (0..width).step_by(8) {
            for channel in 0..3 {
                worst = worst.max(z(&mut block(x, y, 8), channel));
            }
        }
    }
    let whole = (0..3).map(|channel| z(&mut block(0, 0, width.max(height)), channel)).fold(0.0, f64::max);
    println!("{name}: largest z of a block {worst:.2}, of the whole {whole:.2}");
    // 16 × 12 blocks of 3 channels at a significance of 10⁻⁴ for all: 1 − (1 − 10⁻⁴)^(1/576) = 1.7e-7, two-sided. The variance
    // is that of independent samples, which stratified ones do not reach: the test errs on the side of passing.
    assert!(worst < 5.23, "{name}: a block is {worst} standard errors from the accepted picture");
    assert!(whole < 4.15, "{name}: the whole is {whole} standard errors from the accepted picture");
}

#[test]
fn materials_look_as_accepted() {
    golden("analytic/materials.pbrt", 64);
}
