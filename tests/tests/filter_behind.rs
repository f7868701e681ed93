//! Behind glass and in mirrors the filter works as in plain view, where one that is guided by what the camera sees first
//! has nothing to go by.

#![allow(clippy::print_stdout)]

use std::path::Path;

use renderer::film::{AovSet, Image};
use renderer::filtering::{Blend, Filtering};
use renderer::render::{Frame, Job};
use tests::baselines::cross_bilateral::{CrossBilateral, Guides};
use tests::error::Errors;
use tests::image::RgbImage;
use tests::render::{own_scene, run};

const SIZE: [u32; 2] = [96, 54];

fn frame(scene: &Path, seed: u64, spp: u64, filtering: Filtering) -> Frame {
    let mut aovs = AovSet::default();
    ["albedo", "N", "depth"].iter().for_each(|name| assert!(aovs.insert(name)));
    run(&Job {
        scene: scene.to_owned(),
        spp: Some(spp),
        seed: Some(seed),
        resolution: Some(SIZE),
        filtering,
        aovs,
        ..Job::default()
    })
}

fn channels<const N: usize>(image: &Image, names: [&str; N]) -> Vec<[f32; N]> {
    let at =
        names.map(|name| image.channels.iter().position(|channel| channel.name == name).expect("it was asked for"));
    image.values.chunks_exact(image.channels.len()).map(|pixel| at.map(|at| pixel[at])).collect()
}

fn rgb(frame: &Frame) -> Vec<[f32; 3]> {
    channels(&frame.film.image(), ["R", "G", "B"])
}

/// Gains of the filter and of the cross-bilateral filter at 16 samples per pixel.
fn gains(scene: &str) -> [f64; 2] {
    let scene = own_scene(scene);
    let reference = |seed| {
        let pixels = rgb(&frame(&scene, seed, 512, Filtering::None));
        RgbImage { width: SIZE[0] as usize, height: SIZE[1] as usize, pixels }
    };
    let (a, b) = (reference(11), reference(12));
    let error = |pixels: &[[f32; 3]]| Errors::new(pixels, &a, &b).relmse(0.999);
    let plain = frame(&scene, 1, 16, Filtering::None);
    let filtered = frame(&scene, 1, 16, Filtering::Adaptive(filter::Params::default(), Blend::default()));
    let image = plain.film.image();
    let (normal, albedo) =
        (channels(&image, ["N.X", "N.Y", "N.Z"]), channels(&image, ["albedo.R", "albedo.G", "albedo.B"]));
    let depth: Vec<f32> = channels(&image, ["depth.Z"]).into_iter().flatten().collect();
    let guides = Guides { normal: &normal, albedo: &albedo, depth: &depth };
    let bilateral = CrossBilateral::default().filter(&rgb(&plain), SIZE[0] as usize, &guides);
    let none = error(&rgb(&plain));
    let gains = [none / error(&rgb(&filtered)), none / error(&bilateral)];
    println!("{}: path space {:.2}, screen space {:.2}", scene.display(), gains[0], gains[1]);
    gains
}

/// The bound: at least 4 at 16 samples, and more than in screen space.
fn check(scene: &str) {
    let [path_space, screen_space] = gains(scene);
    assert!(path_space >= 4.0, "{scene}: {path_space}");
    assert!(path_space > screen_space, "{scene}: {path_space} against {screen_space}");
}

#[test]
fn behind_a_pane() {
    check("filter/pane.pbrt");
}

#[test]
fn in_a_mirror() {
    check("filter/mirror.pbrt");
}
