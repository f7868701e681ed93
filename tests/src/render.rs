//! Rendering a scene within a test.

use std::path::Path;

use renderer::film::Film;
use renderer::render::{Frame, Job, Unobserved, render};

use crate::image::RgbImage;

/// Renders `scene` with `spp` samples a pixel at `resolution`, or at its own.
///
/// # Panics
/// If the scene cannot be rendered, with every message of it.
pub fn quick(scene: &Path, spp: u64, resolution: Option<[u32; 2]>) -> Frame {
    run(&Job { scene: scene.to_owned(), spp: Some(spp), resolution, ..Job::default() })
}

/// Renders `job`.
///
/// # Panics
/// As [`quick`].
pub fn run(job: &Job) -> Frame {
    render(job, &Unobserved).unwrap_or_else(|error| {
        use renderer::render::RenderError::{Compile, Scene};
        if let Scene(messages) | Compile(messages) = &error {
            let text: Vec<String> = messages.iter().map(ToString::to_string).collect();
            panic!("{error}\n{}", text.join("\n"));
        }
        panic!("{error}")
    })
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
