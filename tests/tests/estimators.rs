//! Three ways to find the lights that must agree: sampling lights, sampling BSDFs, and both.
#![allow(clippy::print_stdout, reason = "tests print the figures that they judge")]

use renderer::render::{Frame, Job};
use renderer::world::Techniques;
use tests::render::{own_scene, variance_of_mean, with_variance};

fn rendered(techniques: Techniques) -> Frame {
    let job = Job { scene: own_scene("analytic/materials.pbrt"), techniques, ..Job::default() };
    with_variance(&job)
}

/// Per block of 16×16 pixels, z of the difference must be below the bound that Šidák gives for all blocks and pairs at a
/// significance of 10⁻⁴.
#[test]
fn light_samples_bsdf_samples_and_both_show_the_same_picture() {
    let frames = [Techniques::Both, Techniques::Lights, Techniques::Bsdfs].map(rendered);
    let [width, height] = frames[0].film.resolution();
    let mut worst = 0.0f64;
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        for y in (0..height).step_by(16) {
            for x in (0..width).step_by(16) {
                let (mut difference, mut variance) = (0.0, 0.0);
                for at in (0..256).map(|k| [x + k % 16, y + k / 16]).filter(|at| at[0] < width && at[1] < height) {
                    for (frame, sign) in [(a, 1.0), (b, -1.0)] {
                        let film = &frames[frame].film;
                        difference += sign * film.pixel(at).mean().y;
                        variance += variance_of_mean(film, at);
                    }
                }
                if variance > 0.0 {
                    worst = worst.max(difference.abs() / variance.sqrt());
                }
            }
        }
    }
    println!("largest z over blocks: {worst:.2}");
    // 3 pairs of 8 × 6 blocks: 1 − (1 − 10⁻⁴)^(1/144) = 6.9e-7, two-sided.
    assert!(worst < 4.97, "the techniques disagree: z = {worst}");
}
