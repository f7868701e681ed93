//! Frames of one pixel and of very many, and samples with very large numbers.

use renderer::filtering::Filtering;
use renderer::render::Job;
use tests::render::mean_and_error;
use tests::small::{SceneFile, adaptive, bits, values};

use super::support::{Z, both, check_all, check_mean, diffuse, frame, job, pinhole, refused, refused_file, scene, sky};

fn sphere(size: [u32; 2]) -> String {
    scene(
        size,
        4,
        &pinhole(40.0),
        &(sky(1.0) + &diffuse(0.5) + "Translate 0 0 9\nShape \"sphere\" \"float radius\" 8\n"),
    )
}

#[test]
fn an_image_of_one_pixel_with_one_sample() {
    for (mode, filtering) in both() {
        check_all(
            &format!("1×1, 1 sample, {mode}"),
            &values(&frame(&sphere([1, 1]), job(1, filtering))),
            0.5,
            2f64.powi(-14),
        );
    }
}

#[test]
fn an_image_of_one_row_of_16384() {
    for (mode, filtering) in both() {
        let image = values(&frame(&sphere([16384, 1]), job(1, filtering)));
        println!("16384×1, {mode}: mean {:.5}", image.mean()[1]);
        assert!((0.5..=1.0).contains(&image.mean()[1]));
    }
}

#[test]
fn an_image_of_one_column_of_16384() {
    for (mode, filtering) in both() {
        let image = values(&frame(&sphere([1, 16384]), job(1, filtering)));
        println!("1×16384, {mode}: mean {:.5}", image.mean()[1]);
        assert!((0.5..=1.0).contains(&image.mean()[1]));
    }
}

#[test]
fn a_crop_of_an_image_of_a_million_by_a_million() {
    let size = 1 << 20;
    let job = Job { pixel_bounds: Some([size - 8, size, size - 8, size]), ..job(4, Filtering::None) };
    let text = scene([1 << 20, 1 << 20], 4, &pinhole(40.0), &sky(1.0));
    check_all("last 8×8 of 2²⁰×2²⁰", &values(&frame(&text, job)), 1.0, 0.0);
}

#[test]
fn a_frame_beyond_memory_is_refused() {
    let file = SceneFile::new(&scene([1 << 20, 1 << 20], 4, &pinhole(40.0), &sky(1.0)));
    for (_, filtering) in both() {
        refused_file("2²⁰×2²⁰", &file.path(), job(1, filtering), &["1048576 x 1048576", "memory"]);
    }
}

#[test]
fn frames_without_pixels_are_refused() {
    for size in ["0", "-1", "2000000"] {
        let text = sphere([4, 4]).replace("xresolution\" 4", &format!("xresolution\" {size}"));
        refused(&format!("xresolution {size}"), &text, &["scene.pbrt:1:"]);
    }
    let file = SceneFile::new(&sphere([4, 4]));
    let outside = Job { pixel_bounds: Some([9, 12, 0, 4]), ..job(1, Filtering::None) };
    refused_file("a crop outside of the frame", &file.path(), outside, &["no pixel"]);
}

/// A scene whose samples differ.
fn noisy() -> String {
    scene(
        [16, 16],
        100,
        &pinhole(40.0),
        &(super::support::lamp(1.0)
            + &diffuse(0.5)
            + &super::support::closed_box(1.0).replacen(
                "Shape",
                "AreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ] \"bool twosided\" true\nShape",
                1,
            )),
    )
}

#[test]
fn samples_beyond_2_to_the_32_are_new_and_right() {
    let range = |start: u64| Job { sample_range: Some(start..start + 64), ..job(64, Filtering::None) };
    let first = frame(&noisy(), range(0));
    let mut seen = vec![bits(&first)];
    for start in [1 << 32, 1 << 33, (1 << 32) + 64, 1 << 52, u64::MAX - 64] {
        let later = frame(&noisy(), range(start));
        check_mean(&format!("samples from {start}"), &later, 2.0, 1e-4);
        assert!(!seen.contains(&bits(&later)), "samples from {start} repeat others");
        seen.push(bits(&later));
    }
}

#[test]
fn samples_beyond_2_to_the_32_are_filtered() {
    let (_, error) = mean_and_error(&frame(&noisy(), job(64, Filtering::None)).film);
    for start in [1 << 32, u64::MAX - 64] {
        let image = values(&frame(&noisy(), Job { sample_range: Some(start..start + 64), ..job(64, adaptive()) }));
        println!("samples from {start}, filtered: mean {:.5}", image.mean()[1]);
        assert!((image.mean()[1] - 2.0).abs() <= Z * error + 2.0 * 2f64.powi(-15));
    }
}

#[test]
fn sample_counts_of_0_and_empty_ranges() {
    let file = SceneFile::new(&sphere([4, 4]));
    let empty = Job { sample_range: Some(8..8), ..job(1, Filtering::None) };
    refused_file("samples 8:8", &file.path(), empty, &["8:8", "empty"]);
    refused("pixelsamples 0", &sphere([4, 4]).replace("pixelsamples\" 16", "pixelsamples\" 0"), &["scene.pbrt:3:"]);
}

#[test]
fn any_seed_gives_the_picture() {
    for seed in [0, 1, u64::from(u32::MAX), 1 << 32, u64::MAX] {
        let rendered = frame(&noisy(), Job { seed: Some(seed), ..job(64, Filtering::None) });
        check_mean(&format!("seed {seed}"), &rendered, 2.0, 1e-4);
    }
}

#[test]
fn a_large_square_image() {
    // `ci/test-extremes` asks for 16384 pixels a side. The whole would be 39 GB of sums, which is refused where there is not as
    // much: of a frame that large the middle eighth of the rows is rendered.
    let side = super::support::size("TESSERA_FRAME_SIDE", 1024);
    let rows = if side > 4096 { side / 8 } else { side };
    let first = (side - rows) / 2;
    let pixel_bounds = Some([0, side, first, first + rows].map(|x| x as i32));
    let text = scene([side, side], 2, &pinhole(40.0), &sky(0.25));
    let rendered = frame(&text, Job { pixel_bounds, ..job(1, Filtering::None) });
    let mean = rendered.film.mean();
    println!(
        "{side}×{rows} of {side}×{side}: mean {mean}, {:.1} s, {} MB of film",
        rendered.statistics.render_seconds,
        rendered.statistics.film_bytes >> 20
    );
    assert_eq!(mean, glam::Vec3::splat(0.25));
}
