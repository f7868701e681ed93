//! Scenes of nothing, and what surrounds the renderer.

use std::process::Command;

use renderer::filtering::Filtering;
use tests::small::{PLAIN, adaptive, bits, room, values};

use super::support::{both, check_all, diffuse, frame, job, picture, pinhole, refused, scene, sky};

#[test]
fn an_empty_scene_is_black() {
    for (mode, filtering) in both() {
        let image = picture(&scene([8, 8], 4, &pinhole(60.0), ""), 4, filtering);
        println!("{mode}: mean {}", image.mean()[1]);
        assert!(image.pixels.iter().flatten().all(|&x| x == 0.0));
    }
}

#[test]
fn a_scene_without_lights_is_black() {
    let text = scene([8, 8], 4, &pinhole(60.0), &(diffuse(0.5) + "Shape \"sphere\" \"float radius\" 3\n"));
    for (mode, filtering) in both() {
        let image = picture(&text, 4, filtering);
        println!("{mode}: mean {}", image.mean()[1]);
        assert!(image.pixels.iter().flatten().all(|&x| x == 0.0));
    }
}

#[test]
fn lights_of_no_strength_are_black() {
    let lights = sky(0.0) + "LightSource \"point\" \"rgb I\" [ 0 0 0 ]\nLightSource \"distant\" \"float scale\" 0\n";
    let text = scene([8, 8], 4, &pinhole(60.0), &(lights + &diffuse(0.5) + "Shape \"sphere\" \"float radius\" 3\n"));
    let image = picture(&text, 4, Filtering::None);
    println!("mean {}", image.mean()[1]);
    assert!(image.pixels.iter().flatten().all(|&x| x == 0.0));
}

#[test]
fn a_sky_alone_is_the_sky() {
    for (mode, filtering) in both() {
        check_all(mode, &picture(&scene([8, 8], 4, &pinhole(60.0), &sky(0.25)), 4, filtering), 0.25, 0.0);
    }
}

#[test]
fn files_without_a_world_are_refused() {
    for (case, text) in [
        ("empty file", ""),
        ("a comment", "# nothing\n"),
        ("a camera alone", "Camera \"perspective\"\n"),
        ("bytes", "\u{0}\u{1}\u{2}"),
    ] {
        refused(case, text, &["error: "]);
    }
}

#[test]
fn an_empty_object_is_nothing() {
    let world = sky(1.0) + "ObjectBegin \"none\"\nObjectEnd\nObjectInstance \"none\"\n";
    check_all("instance of nothing", &picture(&scene([8, 8], 4, &pinhole(60.0), &world), 4, Filtering::None), 1.0, 0.0);
}

#[test]
fn instances_within_instances_without_end_are_refused() {
    let world = "ObjectBegin \"a\"\nObjectInstance \"a\"\nObjectEnd\nObjectInstance \"a\"\n";
    refused("an object within itself", &scene([8, 8], 4, &pinhole(60.0), world), &["scene.pbrt:"]);
}

/// In the child: the bits of a frame, and whether denormal numbers were flushed.
fn fingerprint() -> String {
    let mut all = Vec::new();
    for filtering in [Filtering::None, adaptive()] {
        all.extend(bits(&frame(&room([32, 24], 1.0, 1.0, PLAIN), job(8, filtering))));
    }
    let hash = all
        .iter()
        .flatten()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, &bits| (hash ^ u64::from(bits)).wrapping_mul(0x0100_0000_01b3));
    let flushed = std::hint::black_box(f32::MIN_POSITIVE) * std::hint::black_box(0.5) == 0.0;
    format!("fingerprint {hash:016x}, denormals {}", if flushed { "flushed" } else { "kept" })
}

/// The same test binary, once as it is and once in a process that flushes denormals to zero, as a host application may have
/// set it up before it calls a renderer: a library that does so is loaded first.
#[test]
fn flush_to_zero_changes_no_bit() {
    if std::env::var_os("TESSERA_FINGERPRINT").is_some() {
        println!("{}", fingerprint());
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (source, library) = (folder.path().join("flush.c"), folder.path().join("flush.so"));
    let code = "#include <immintrin.h>\n__attribute__((constructor)) static void flush(void) { _mm_setcsr(_mm_getcsr() | 0x8040); }\n";
    std::fs::write(&source, code).unwrap();
    let compiled = Command::new("cc").args(["-shared", "-fPIC", "-o"]).arg(&library).arg(&source).status();
    assert!(compiled.expect("a C compiler").success());
    let run = |preload: &std::path::Path| {
        let output = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "scene::flush_to_zero_changes_no_bit", "--nocapture", "--test-threads", "1"])
            .env("TESSERA_FINGERPRINT", "1")
            .env("LD_PRELOAD", preload)
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let at =
            text.find("fingerprint ").unwrap_or_else(|| panic!("{text}{}", String::from_utf8_lossy(&output.stderr)));
        text[at..].lines().next().unwrap().to_owned()
    };
    let (kept, flushed) = (run(std::path::Path::new("")), run(&library));
    println!("{kept}; {flushed}");
    assert!(kept.ends_with("kept") && flushed.ends_with("flushed"));
    assert_eq!(kept.split(',').next(), flushed.split(',').next());
}

#[test]
fn one_thread_and_many_give_the_same_bits_at_the_extremes() {
    let text = room([33, 17], 2f32.powi(-20), 1e12, PLAIN);
    for (mode, filtering) in both() {
        let run = |threads| bits(&frame(&text, renderer::render::Job { threads, ..job(5, filtering) }));
        let one = run(1);
        for threads in [2, 3, 16] {
            assert_eq!(one, run(threads), "{threads} threads");
        }
        println!("{mode}: same bits on 1, 2, 3 and 16 threads");
    }
    assert!(values(&frame(&text, job(1, Filtering::None))).mean()[1] > 0.0);
}
