//! Our pictures of scenes by others against the pictures that other renderers made of them.
#![allow(clippy::print_stdout, reason = "tests print the figures that they judge")]

use tests::image::{agreement, read_exr};
use tests::{render, shared};

/// One reference and how near to it we must be.
struct Case {
    scene: &'static str,
    reference: &'static str,
    /// Largest relative difference of the image mean, any channel.
    mean: f64,
    /// Largest median over blocks of the relative difference; infinite where the reference is too noisy for blocks.
    blocks: f64,
}

/// Differences of a spectral renderer's means from an RGB renderer's are up to 3 %.
const PBRT: f64 = 0.03;

#[test]
fn images_agree_with_those_of_other_renderers() {
    let Some(folder) = shared::folder() else { return };
    let case = |scene, reference, mean, blocks| Case { scene, reference, mean, blocks };
    let cases = [
        case("cornell-box", "cornell-box-256x256-pbrt4-256spp", PBRT, 0.04),
        case("veach-mis", "veach-mis-384x288-pbrt4-256spp", PBRT, 0.04),
        case("coffee", "coffee-256x320-pbrt4-256spp", PBRT, 0.04),
        case("kitchen", "kitchen-320x180-pbrt4-256spp", PBRT, 0.04),
        case("living-room", "living-room-320x180-pbrt4-256spp", PBRT, 0.04),
        case("bmw-m6", "bmw-m6-350x250-pbrt4-256spp", PBRT, 0.04),
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
        let found = agreement(&render::pixels(&frame.film), &reference);
        let [r, g, b] = found.mean_ratio;
        let line = format!(
            "{:15} mean {r:.4} {g:.4} {b:.4}  blocks {:.4}  {:.1} s",
            case.scene, found.median_block_difference, frame.statistics.render_seconds
        );
        println!("{line}");
        let worst = found.mean_ratio.iter().map(|ratio| (ratio - 1.0).abs()).fold(0.0, f64::max);
        if worst > case.mean || found.median_block_difference > case.blocks {
            failures.push(line);
        }
    }
    assert!(failures.is_empty(), "too far from the reference:\n{}", failures.join("\n"));
}
