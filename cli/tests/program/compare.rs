//! `tessera compare`.

use super::{Bench, read};

#[test]
fn figures_are_those_of_the_formulas() {
    let bench = Bench::new();
    bench.write_image("image.exr", 64, 32, |_, _| [1.5, 1.0, 2.0]);
    bench.write_image("reference.exr", 64, 32, |_, _| [1.0, 1.0, 1.0]);
    let figures = bench.succeed(&["compare", "image.exr", "reference.exr", "--format", "json"]).json();
    let number = |key: &str| figures[key].as_f64().unwrap();
    assert!((number("relmse") - (0.25 + 1.0) / 3.0 / 1.01).abs() < 1e-9, "{figures}");
    assert!((number("rmse") - (1.25_f64 / 3.0).sqrt()).abs() < 1e-9, "{figures}");
    assert!((number("block_difference") - 0.5).abs() < 1e-9, "{figures}");
    assert_eq!(number("max_difference"), 1.0);
    assert_eq!(figures["mean_ratio"], serde_json::json!([1.5, 1.0, 2.0]));
    assert_eq!(figures["resolution"], serde_json::json!([64, 32]));
    let text = bench.succeed(&["compare", "image.exr", "reference.exr"]).stdout;
    assert!(text.contains("relMSE") && text.contains("1.50000"), "{text}");
}

#[test]
fn thresholds_decide_the_exit_code() {
    let bench = Bench::new();
    bench.write_image("image.exr", 64, 32, |_, _| [1.1; 3]);
    bench.write_image("reference.exr", 64, 32, |_, _| [1.0; 3]);
    let with = |flag: &'static str, limit: &'static str| ["compare", "image.exr", "reference.exr", flag, limit];
    // relMSE 0.01 / 1.01; means and blocks 0.1.
    for (flag, below, above) in [
        ("--max-relmse", "0.00990", "0.00991"),
        ("--max-mean-difference", "0.0999", "0.1001"),
        ("--max-block-difference", "0.0999", "0.1001"),
    ] {
        let run = bench.fail(&with(flag, below), 5, &["above", below]);
        assert!(run.stdout.contains("relMSE"), "the figures are missing: {}", run.stdout);
        bench.succeed(&with(flag, above));
    }
}

#[test]
fn the_difference_image_keeps_size_and_sign() {
    let bench = Bench::new();
    bench.write_image("image.exr", 5, 4, |x, y| [x as f32, y as f32, 1.0]);
    bench.write_image("reference.exr", 5, 4, |_, _| [2.0, 0.5, 1.0]);
    bench.succeed(&["compare", "image.exr", "reference.exr", "-o", "difference.exr"]);
    let image = read(&bench.path("difference.exr"));
    let value = |x: usize, y: usize, name: &str| {
        image.pixels[(y * image.width + x) * image.channels.len() + image.channel(name).unwrap()]
    };
    assert_eq!((value(0, 3, "R"), value(0, 3, "signed.R")), (2.0, -2.0));
    assert_eq!((value(4, 0, "G"), value(4, 0, "signed.G")), (0.5, -0.5));
    assert_eq!(value(1, 1, "signed.B"), 0.0);
    assert_eq!(bench.files(), ["difference.exr", "image.exr", "reference.exr"]);
}

#[test]
fn what_cannot_be_compared_exits_with_3() {
    let bench = Bench::new();
    bench.write_image("a.exr", 5, 4, |_, _| [1.0; 3]);
    bench.write_image("b.exr", 4, 5, |_, _| [1.0; 3]);
    bench.fail(&["compare", "a.exr", "b.exr"], 3, &["5 x 4", "4 x 5"]);
    bench.fail(&["compare", "a.exr", "a.exr", "--layer", "albedo"], 3, &["albedo", "it has R G B"]);
}

#[test]
fn pixels_that_are_not_finite_fail_the_comparison() {
    let bench = Bench::new();
    bench.write_image("a.exr", 8, 8, |x, y| if x + y == 0 { [f32::NAN, 1.0, 1.0] } else { [1.0; 3] });
    bench.write_image("b.exr", 8, 8, |_, _| [1.0; 3]);
    let run = bench.fail(&["compare", "a.exr", "b.exr"], 5, &["not finite"]);
    assert!(run.stdout.contains("1 in the image, 0 in the reference"), "{}", run.stdout);
}

/// Noise of 0.1 that the layer `error` knows: half the frame is 0.1 too bright, half too dark.
#[test]
fn an_error_layer_and_a_second_reference_say_what_is_noise() {
    let bench = Bench::new();
    let names = ["R", "G", "B", "error.R", "error.G", "error.B"];
    bench.write_channels("image.exr", [64, 32], &names, |x, y| {
        let value = if (x + y) % 2 == 0 { 1.1 } else { 0.9 };
        vec![value, value, value, 0.1, 0.1, 0.1]
    });
    for (name, value) in [("reference.exr", 1.0), ("bright.exr", 1.1), ("dark.exr", 0.9)] {
        bench.write_image(name, 64, 32, |_, _| [value; 3]);
    }
    let figures = bench.succeed(&["compare", "image.exr", "reference.exr", "--format", "json"]).json();
    assert!((figures["predicted"]["relmse"].as_f64().unwrap() - 0.01 / 1.01).abs() < 1e-7, "{figures}");
    assert_eq!(figures["predicted"]["coverage"], 1.0);
    let z = |figures: &serde_json::Value| figures["z_test"]["frame"].as_f64().unwrap().abs();
    assert!(z(&figures) < 1e-3, "{figures}");
    let figures = bench.succeed(&["compare", "image.exr", "bright.exr", "--format", "json"]).json();
    // 0.1 of a pixel's noise 0.1, over 64 x 32 of them.
    assert!((z(&figures) - (64.0_f64 * 32.0).sqrt()).abs() < 0.01, "{figures}");
    let halves = ["compare", "image.exr", "bright.exr", "--second-reference", "dark.exr", "--format", "json"];
    let figures = bench.succeed(&halves).json();
    assert!(figures["relmse"].as_f64().unwrap().abs() < 1e-6, "{figures}");
    let text = bench.succeed(&halves[..5]).stdout;
    assert!(["predicted", "HDR-FLIP", "PSNR", "worst of 32 blocks"].iter().all(|word| text.contains(word)), "{text}");
}

#[test]
fn filtered_images_are_not_tested_by_their_pixels() {
    let bench = Bench::new();
    bench.write("scene.pbrt", super::SCENE);
    for filter in ["none", "adaptive"] {
        let output = format!("{filter}.exr");
        bench.succeed(&["render", "scene.pbrt", "-o", &output, "--aov", "error", "--spp", "16", "--filter", filter]);
    }
    let plain = bench.succeed(&["compare", "none.exr", "none.exr"]).stdout;
    assert!(plain.contains("worst of") && !plain.contains("not tested"), "{plain}");
    let filtered = bench.succeed(&["compare", "adaptive.exr", "none.exr"]).stdout;
    assert!(
        filtered.contains("not tested") && filtered.contains("\"adaptive\"") && !filtered.contains("p ="),
        "{filtered}"
    );
    let json = bench.succeed(&["compare", "adaptive.exr", "none.exr", "--format", "json"]).json();
    assert!(json["z_test"].is_null() && !json["predicted"].is_null(), "{json}");
    bench.succeed(&["preview", "none.exr", "-o", "none.png"]);
    let run = bench.succeed(&["compare", "none.png", "none.exr"]);
    assert!(run.stderr.contains("8 bits"), "{}", run.stderr);
}

/// One pixel of 2048 is off by 100 times its value; the other figure leaves the worst two of them out.
#[test]
fn a_gate_on_the_best_pixels_does_not_see_the_worst() {
    let bench = Bench::new();
    bench.write_image("r.exr", 64, 32, |_, _| [1.0; 3]);
    bench.write_image("i.exr", 64, 32, |x, y| [if (x, y) == (3, 4) { 101.0 } else { 1.0 }; 3]);
    bench.fail(&["compare", "i.exr", "r.exr", "--max-relmse", "1"], 5, &["the relMSE is"]);
    bench.succeed(&["compare", "i.exr", "r.exr", "--max-relmse-best", "0.001"]);
    bench.write_image("i.exr", 64, 32, |_, _| [1.5; 3]);
    bench.fail(&["compare", "i.exr", "r.exr", "--max-relmse-best", "0.1"], 5, &["best 99.9 %"]);
}
