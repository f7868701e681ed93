//! Rendering a scene within a test.

use std::path::{Path, PathBuf};

use renderer::film::{Aov, AovSet, Film, Layer};
use renderer::render::{Frame, Job, RenderError, Unobserved, render};

use crate::image::RgbImage;

/// A scene of the project's own, by its path within `scenes/`.
pub fn own_scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes").join(name)
}

/// Renders `scene` with `spp` samples a pixel at `resolution`, or at its own.
///
/// # Panics
/// If the scene cannot be rendered, with every message of it.
pub fn quick(scene: &Path, spp: u64, resolution: Option<[u32; 2]>) -> Frame {
    with_variance(&Job { scene: scene.to_owned(), spp: Some(spp), resolution, ..Job::default() })
}

/// Renders an own scene with some of its text replaced.
///
/// # Panics
/// As [`quick`], and if the text to be replaced is not there.
pub fn altered(name: &str, replacements: &[(&str, &str)], spp: u64) -> Frame {
    let mut text = std::fs::read_to_string(own_scene(name)).expect("the project's own scene is there");
    for (old, new) in replacements {
        assert!(text.contains(old), "{name} does not contain {old}");
        text = text.replace(old, new);
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("scene.pbrt");
    std::fs::write(&path, text).expect("a scene in the temporary folder");
    quick(&path, spp, None)
}

/// Renders `job`.
///
/// # Panics
/// As [`quick`].
pub fn run(job: &Job) -> Frame {
    render(job, &Unobserved).unwrap_or_else(|error| panic!("{}", describe(&error)))
}

/// Renders `job` with what [`mean_and_error`] needs.
///
/// # Panics
/// As [`quick`].
pub fn with_variance(job: &Job) -> Frame {
    run(&Job { aovs: AovSet::from_iter([Aov::Variance]), ..job.clone() })
}

/// An error with all its messages.
pub fn describe(error: &RenderError) -> String {
    match error {
        RenderError::Scene(messages) | RenderError::Compile(messages) => {
            let text: Vec<String> = messages.iter().map(ToString::to_string).collect();
            format!("{error}\n{}", text.join("\n"))
        }
        other => other.to_string(),
    }
}

/// Adds the samples of `film` to `sum`, by way of what parts store.
///
/// # Panics
/// If they are of different shapes.
pub fn add(sum: &mut Film, film: &Film) {
    let mut words = Vec::new();
    film.store(0..film.slots(), &mut words);
    let mut rest = words.as_slice();
    sum.tiles().iter_mut().try_for_each(|tile| tile.load(&mut rest)).expect("what was stored");
    assert!(rest.is_empty(), "films of different shapes");
}

/// The pixels of a film, in 32 bits.
pub fn pixels(film: &Film) -> RgbImage {
    let bounds = film.bounds();
    let mut image = RgbImage { width: bounds.width() as usize, height: bounds.height() as usize, pixels: Vec::new() };
    for y in bounds.min[1]..bounds.max[1] {
        for x in bounds.min[0]..bounds.max[0] {
            image.pixels.push(film.pixel([x, y]).mean().as_vec3().to_array());
        }
    }
    image
}

/// Mean over the film and the standard error of that mean, both of the green channel.
///
/// The error is that of independent samples; stratified ones do better, so a test with it is on the safe side.
///
/// # Panics
/// If the film was rendered without variances.
pub fn mean_and_error(film: &Film) -> (f64, f64) {
    let bounds = film.bounds();
    let (mut mean, mut variance, mut pixels) = (0.0, 0.0, 0.0);
    for y in bounds.min[1]..bounds.max[1] {
        for x in bounds.min[0]..bounds.max[0] {
            let pixel = film.pixel([x, y]);
            mean += pixel.mean().y;
            variance += variance_of_mean(film, [x, y]);
            pixels += 1.0;
        }
    }
    (mean / pixels, variance.sqrt() / pixels)
}

/// Variance of a pixel's mean as if its samples were independent, of the green channel.
///
/// # Panics
/// If the film was rendered without variances.
pub fn variance_of_mean(film: &Film, at: [u32; 2]) -> f64 {
    let (pixel, squares) = (film.pixel(at), film.layer(Layer::Squares, at).expect("a film with variances"));
    pixel.sample_variance(squares).y / pixel.count().max(1) as f64
}
