//! Our pictures of scenes by others against the pictures that other renderers made of them.
#![allow(clippy::print_stdout, reason = "tests print the figures that they judge")]

use tests::image::{RgbImage, agreement, read_exr, without_brightest};
use tests::{render, shared};

/// One reference and how near to it we must be.
struct Case {
    scene: &'static str,
    /// By pbrt-v4, a spectral renderer.
    reference: &'static str,
    /// By an RGB renderer, whose mean counts within [`RGB`]: where light bounces between saturated surfaces, the products of
    /// channels that such renderers take are not what a spectral one finds.
    rgb_reference: Option<&'static str>,
    /// The mean is judged without the brightest thousandth of the pixels: the five brightest of bmw-m6's reference, of 87,500,
    /// hold 3.5 % of its mean, which is more than the bound. The mean of all pixels is printed beside it. About 0.4 % of the
    /// rest is light that pbrt adds under rough coats, see the renderer's `bsdf/tests/layered_values.rs`.
    trimmed: bool,
    /// Largest relative difference of the image mean, any channel.
    mean: f64,
    /// Largest median over blocks of the relative difference; infinite where the reference is too noisy for blocks.
    blocks: f64,
}

/// Differences of a spectral renderer's means from an RGB renderer's are up to 3 %.
const PBRT: f64 = 0.03;

/// Largest relative difference of the image mean from an RGB renderer's.
const RGB: f64 = 0.02;

#[test]
fn images_agree_with_those_of_other_renderers() {
    let Some(folder) = shared::folder() else { return };
    let case =
        |scene, reference, mean, blocks| Case { scene, reference, rgb_reference: None, trimmed: false, mean, blocks };
    let tungsten = Some("scenes/cornell-box/reference-tungsten.exr");
    let cases = [
        Case { rgb_reference: tungsten, ..case("cornell-box", "cornell-box-256x256-pbrt4-256spp", PBRT, 0.04) },
        case("veach-mis", "veach-mis-384x288-pbrt4-256spp", PBRT, 0.04),
        case("coffee", "coffee-256x320-pbrt4-256spp", PBRT, 0.04),
        case("kitchen", "kitchen-320x180-pbrt4-256spp", PBRT, 0.04),
        case("living-room", "living-room-320x180-pbrt4-256spp", PBRT, 0.04),
        Case { trimmed: true, ..case("bmw-m6", "bmw-m6-350x250-pbrt4-256spp", PBRT, 0.04) },
        case("house", "house-320x180-pbrt4-256spp", PBRT, 0.04),
        case("buddha-fractal", "buddha-fractal-250x400-pbrt4-256spp", PBRT, 0.04),
        case("veach-ajar", "veach-ajar-320x180-pbrt4-256spp", 0.06, f64::INFINITY),
    ];
    let mut failures = Vec::new();
    for case in cases {
        let reference = read_exr(&folder.join("references").join(case.reference).with_extension("exr"));
        let resolution = Some([reference.width as u32, reference.height as u32]);
        let scene = folder.join("scenes").join(case.scene).join("scene-v4.pbrt");
        let frame = render::quick(&scene, 256, resolution);
        assert_eq!(frame.statistics.counters.rejected_samples, 0, "{}: rejected samples", case.scene);
        let image = render::pixels(&frame.film);
        let seconds = frame.statistics.render_seconds;
        let mut agrees = judge(&case, "pbrt", &image, &reference, case.mean, seconds);
        if let Some(path) = case.rgb_reference {
            let reference = read_exr(&folder.join(path)).reduced(image.width);
            agrees |= judge(&case, "rgb", &image, &reference, RGB, seconds);
        }
        if !agrees {
            failures.push(case.scene);
        }
    }
    assert!(failures.is_empty(), "too far from their references: {}", failures.join(", "));
}

/// Prints how an image agrees with a reference, and whether that is near enough.
fn judge(case: &Case, by: &str, image: &RgbImage, reference: &RgbImage, mean: f64, seconds: f64) -> bool {
    let found = agreement(image, reference);
    let [r, g, b] = found.mean_ratio;
    println!(
        "{:15} {by:5} mean {r:.4} {g:.4} {b:.4}  blocks {:.4}  {seconds:.1} s",
        case.scene, found.median_block_difference
    );
    let judged = if case.trimmed {
        let (image, reference) = without_brightest(image, reference, 1e-3);
        let trimmed = agreement(&image, &reference).mean_ratio;
        let [r, g, b] = trimmed;
        println!("{:15} {by:5} mean {r:.4} {g:.4} {b:.4}  without the brightest thousandth", case.scene);
        trimmed
    } else {
        found.mean_ratio
    };
    let worst = judged.iter().map(|ratio| (ratio - 1.0).abs()).fold(0.0, f64::max);
    worst <= mean && found.median_block_difference <= case.blocks
}
