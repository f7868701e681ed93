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

#[test]
fn data_is_shown_over_its_range() {
    let bench = Bench::new();
    let names = ["R", "G", "B", "N.X", "N.Y", "N.Z", "depth.Z", "sampleCount"];
    bench.write_channels("a.exr", [4, 1], &names, |x, _| {
        let depth = [10.0, 20.0, 30.0, f32::INFINITY][x];
        vec![0.0, 0.0, 0.0, -1.0, 0.0, 1.0, depth, [4.0, 8.0, 6.0, 4.0][x]]
    });
    let shown = |layer: &str| -> Vec<f32> {
        let run = bench.succeed(&["preview", "a.exr", "-o", "a.png", "--layer", layer, "--exposure", "3"]);
        assert!(run.stderr.contains("is data"), "{}", run.stderr);
        read(&bench.path("a.png")).pixels.iter().map(|v| (v * 255.0).round()).collect()
    };
    assert_eq!(shown("depth"), [0.0, 0.0, 0.0, 128.0, 128.0, 128.0, 255.0, 255.0, 255.0, 255.0, 255.0, 255.0]);
    assert_eq!(shown("sampleCount")[3..9], [255.0, 255.0, 255.0, 128.0, 128.0, 128.0]);
    assert_eq!(shown("N")[..3], [0.0, 128.0, 255.0]);
}

#[test]
fn a_wrong_layer_is_answered_by_those_that_there_are() {
    let bench = Bench::new();
    let names = ["R", "G", "B", "albedo.R", "albedo.G", "albedo.B", "sampleCount"];
    bench.write_channels("a.exr", [1, 1], &names, |_, _| vec![0.0; 7]);
    let words = ["has no layer albdeo; it has R G B sampleCount albedo", "did you mean \"albedo\""];
    bench.fail(&["preview", "a.exr", "-o", "a.png", "--layer", "albdeo"], 3, &words);
}
