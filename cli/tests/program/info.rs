//! `tessera info`.

use super::{Bench, SCENE};

#[test]
fn a_scene_is_counted_and_weighed() {
    let bench = Bench::new();
    bench.write("scene.pbrt", SCENE);
    let report = bench.succeed(&["info", "scene.pbrt", "--format", "json"]).json();
    assert_eq!(report["shapes"], serde_json::json!({ "bilinearmesh": 1, "disk": 1, "sphere": 1 }));
    assert_eq!(report["lights"], serde_json::json!({ "area (shapes)": 1, "infinite (uniform)": 1 }));
    assert_eq!(report["resolution"], serde_json::json!([48, 32]));
    assert_eq!((&report["spp"], &report["camera"]), (&4.into(), &"perspective".into()));
    assert_eq!(report["pixel_bounds"], serde_json::json!([0, 48, 0, 32]));
    assert!(report["features"].as_array().unwrap().contains(&"quadrics".into()), "{report}");
    let memory = &report["memory"];
    assert!(memory["embree_bytes"].as_u64().unwrap() > 0);
    assert!(memory["film_bytes"].as_u64().unwrap() >= 48 * 32 * 8);
    assert!(memory["filter_bytes"].as_u64().unwrap() > 48 * 32 * 32, "{memory}");
    assert!(memory["total_bytes"].as_u64() > memory["film_bytes"].as_u64());
    // A pinhole; a lamp and a sky that is the same all over, which BSDF samples find: the one light needs no choice.
    let follows = &report["follows"];
    assert_eq!((&follows["camera_numbers"], &follows["vertex_numbers"]), (&2.into(), &6.into()), "{follows}");
    assert_eq!(follows["light_sampler"], "the one light, without a choice, 1 environment left to BSDF samples");
    assert_eq!((&follows["alpha_tests"], &follows["texture_bytes"]), (&false.into(), &0.into()), "{follows}");
    assert_eq!(bench.files(), ["scene.pbrt"]);
}

#[test]
fn the_text_is_for_people() {
    let bench = Bench::new();
    bench.write("scene.pbrt", SCENE);
    let text = bench.succeed(&["info", "scene.pbrt"]).stdout;
    for word in [
        "48 x 32 pixels, 4 samples each",
        "1 sphere",
        "1 area (shapes)",
        "gaussian filter",
        "memory",
        "compiled without alpha tests",
        "the filter takes",
        "more work where they are seen",
    ] {
        assert!(text.contains(word), "no {word:?} in {text}");
    }
    // How that was measured is for those who ask.
    assert!(!text.contains("bench-features") && !text.contains('-'), "{text}");
    assert!(bench.succeed(&["info", "scene.pbrt", "-v"]).stdout.contains("bench-features"));
}

#[test]
fn reading_alone_opens_no_mesh() {
    let bench = Bench::new();
    bench.write("broken.ply", "ply\nbut nothing else");
    bench.write("scene.pbrt", &format!("{SCENE}\nShape \"plymesh\" \"string filename\" \"broken.ply\"\n"));
    bench.fail(&["info", "scene.pbrt"], 3, &["broken.ply", "scene.pbrt:20:"]);
    let report = bench.succeed(&["info", "scene.pbrt", "--parse-only", "--format", "json"]).json();
    assert_eq!(report["shapes"]["plymesh"], 1);
    assert!(report["assets"][0].as_str().unwrap().ends_with("broken.ply"));
    assert!(report.get("memory").is_none());
}

#[test]
fn what_will_look_different_is_listed() {
    let bench = Bench::new();
    bench.write(
        "scene.pbrt",
        &format!("{SCENE}\nMaterial \"diffuse\" \"rgb reflectence\" [ 1 0 0 ]\nShape \"sphere\"\n"),
    );
    let report = bench.succeed(&["info", "scene.pbrt", "--format", "json"]).json();
    let warnings = report["warnings"].as_array().unwrap();
    assert!(warnings.iter().any(|warning| warning.as_str().unwrap().contains("reflectence")), "{report}");
}
