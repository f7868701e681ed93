//! `tessera preview`.

use super::{Bench, read};

#[test]
fn srgb_values_and_exposure_are_exact() {
    let bench = Bench::new();
    bench.write_image("a.exr", 4, 1, |x, _| [[0.0; 3], [0.18; 3], [1.0; 3], [7.0, 0.18, -1.0]][x]);
    bench.succeed(&["preview", "a.exr", "-o", "a.png", "--tone", "srgb"]);
    let bytes =
        |name: &str| -> Vec<f32> { read(&bench.path(name)).pixels.iter().map(|v| (v * 255.0).round()).collect() };
    assert_eq!(bytes("a.png"), [0.0, 0.0, 0.0, 118.0, 118.0, 118.0, 255.0, 255.0, 255.0, 255.0, 118.0, 0.0]);
    assert!(read(&bench.path("a.png")).eight_bit());
    // Two stops up: 0.72 is 220.6 of 255 in sRGB.
    bench.succeed(&["preview", "a.exr", "-o", "b.png", "--tone", "srgb", "--exposure", "2"]);
    assert_eq!(bytes("b.png")[3], 221.0);
    bench.succeed(&["preview", "a.exr", "-o", "c.png", "--tone", "srgb", "--exposure", "-20"]);
    assert!(bytes("c.png").iter().all(|&value| value == 0.0));
}

#[test]
fn the_filmic_curve_keeps_highlights_apart() {
    let bench = Bench::new();
    bench.write_image("a.exr", 3, 1, |x, _| [[0.18; 3], [1.0; 3], [4.0; 3]][x]);
    bench.succeed(&["preview", "a.exr", "-o", "a.png"]);
    let pixels = read(&bench.path("a.png")).pixels;
    assert!(pixels[0] < pixels[3] && pixels[3] < pixels[6] && pixels[6] < 1.0, "{pixels:?}");
}
