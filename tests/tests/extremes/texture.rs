//! Textures with any texels and of any size.

use exr::prelude::*;
use renderer::filtering::Filtering;
use tests::small::values;

use super::support::{attempt, both, check_all, job, picture, pinhole, scene, sky, sound};

/// A scene beside an image of 32-bit floats.
fn with_image(
    name: &str,
    size: (usize, usize),
    texel: impl Fn(usize, usize) -> f32 + Sync,
    text: &str,
) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    write_rgb_file(folder.path().join(name), size.0, size.1, |x, y| {
        let value = texel(x, y);
        (value, value, value)
    })
    .unwrap();
    let path = folder.path().join("scene.pbrt");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

fn textured(filter: &str) -> String {
    let world = sky(1.0)
        + &format!(
            "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"t.exr\" \"string filter\" \"{filter}\"\n"
        )
        + "Material \"diffuse\" \"texture reflectance\" \"t\"\n\
           Shape \"bilinearmesh\" \"point3 P\" [ -9 -9 1  9 -9 1  -9 9 1  9 9 1 ]\n";
    scene([16, 16], 4, &pinhole(60.0), &world)
}

/// One odd texel among others of 0.5, in all filters.
fn odd(value: f32) {
    for filter in ["point", "bilinear", "trilinear", "EWA"] {
        let (_folder, path) =
            with_image("t.exr", (64, 64), |x, y| if (x, y) == (32, 32) { value } else { 0.5 }, &textured(filter));
        for (mode, filtering) in both() {
            let (frame, warnings) = attempt(&path, job(8, filtering)).unwrap();
            sound(&frame);
            let image = values(&frame);
            let near = image.pixels.iter().filter(|pixel| (pixel[1] - 0.5).abs() < 1e-3).count();
            println!(
                "texel {value:e}, {filter}, {mode}: {near} of 256 pixels as without it; {} warnings",
                warnings.len()
            );
            // At most the pixels about it, a quarter of the view, are others.
            assert!(near >= 128, "one texel has spoilt the picture");
            assert!(image.pixels.iter().flatten().all(|&x| x >= 0.0));
            assert!(value.is_finite() || !warnings.is_empty(), "nothing was said");
        }
    }
}

#[test]
fn a_texel_that_is_nan() {
    odd(f32::NAN);
}

#[test]
fn a_texel_that_is_infinite() {
    odd(f32::INFINITY);
}

#[test]
fn a_texel_that_is_negative() {
    odd(-7.0);
}

#[test]
fn a_texel_of_1e30() {
    odd(1e30);
}

#[test]
fn a_texture_of_one_texel() {
    let (_folder, path) = with_image("t.exr", (1, 1), |_, _| 0.25, &textured("EWA"));
    for (mode, filtering) in both() {
        let (frame, _) = attempt(&path, job(4, filtering)).unwrap();
        sound(&frame);
        check_all(&format!("1×1, {mode}"), &values(&frame), 0.25, 2f64.powi(-14));
    }
}

#[test]
fn textures_of_32768_by_1_and_1_by_32768() {
    for size in [(32768, 1), (1, 32768)] {
        for filter in ["bilinear", "EWA"] {
            // Columns or rows of 0 and 1: half of the light wherever the filter is wider than a texel.
            let (_folder, path) = with_image("t.exr", size, |x, y| ((x + y) % 2) as f32, &textured(filter));
            let (frame, _) = attempt(&path, job(16, Filtering::None)).unwrap();
            sound(&frame);
            let mean = values(&frame).mean()[1];
            println!("{size:?}, {filter}: mean {mean:.4}");
            assert!((mean - 0.5).abs() <= 0.02);
        }
    }
}

fn environment() -> String {
    let world = "LightSource \"infinite\" \"string filename\" \"t.exr\"\n".to_owned()
        + &super::support::diffuse(0.5)
        + "Translate 0 0 5\nShape \"sphere\" \"float radius\" 1\n";
    scene([16, 16], 4, &pinhole(40.0), &world)
}

#[test]
fn a_black_environment_is_black() {
    let (_folder, path) = with_image("t.exr", (32, 32), |_, _| 0.0, &environment());
    for (mode, filtering) in both() {
        let (frame, _) = attempt(&path, job(4, filtering)).unwrap();
        sound(&frame);
        println!("{mode}: mean {}", values(&frame).mean()[1]);
        assert!(values(&frame).pixels.iter().flatten().all(|&x| x == 0.0));
    }
}

#[test]
fn an_environment_of_one_texel_is_uniform() {
    let (_folder, path) = with_image("t.exr", (1, 1), |_, _| 3.0, &environment());
    let (frame, _) = attempt(&path, job(256, Filtering::None)).unwrap();
    sound(&frame);
    // The sky is seen as it is; a sphere without occluders shows half of it.
    let image = values(&frame);
    let (sky, ball) = (image.pixels[0][1], image.pixels[8 * 16 + 8][1]);
    println!("sky {sky}, ball {ball}");
    assert!(sky == 3.0 && (ball - 1.5).abs() <= 0.15);
}

#[test]
fn an_environment_with_texels_that_are_no_numbers() {
    for value in [f32::NAN, f32::INFINITY, -1.0, 1e30] {
        let (_folder, path) =
            with_image("t.exr", (16, 16), |x, y| if (x, y) == (3, 5) { value } else { 1.0 }, &environment());
        match attempt(&path, job(4, Filtering::None)) {
            Ok((frame, warnings)) => {
                sound(&frame);
                println!(
                    "environment with {value:e}: mean {:.4e}, {} warnings",
                    values(&frame).mean()[1],
                    warnings.len()
                );
                assert!(value == 1e30 || !warnings.is_empty());
            }
            Err(messages) => println!("environment with {value:e}: {}", messages.lines().nth(1).unwrap_or("")),
        }
    }
}

#[test]
fn images_that_are_missing_or_broken_are_refused() {
    let (folder, path) = with_image("t.exr", (8, 8), |_, _| 0.5, &textured("EWA"));
    let bytes = std::fs::read(folder.path().join("t.exr")).unwrap();
    for (case, bytes) in [("cut", &bytes[..bytes.len() / 2]), ("empty", &[][..]), ("no image", &b"P7 not an image"[..])]
    {
        std::fs::write(folder.path().join("t.exr"), bytes).unwrap();
        super::support::refused_file(case, &path, job(1, Filtering::None), &["t.exr", "scene.pbrt:8:"]);
    }
    std::fs::remove_file(folder.path().join("t.exr")).unwrap();
    super::support::refused_file("missing", &path, job(1, Filtering::None), &["t.exr", "scene.pbrt:8:"]);
}

#[test]
fn texture_scales_at_both_ends() {
    for scale in ["1e-30", "1e10", "0"] {
        let text = scene(
            [8, 8],
            2,
            &pinhole(60.0),
            &(sky(1.0)
                + &format!(
                    "Texture \"c\" \"spectrum\" \"checkerboard\" \"float uscale\" {scale} \"float vscale\" {scale} \"rgb tex1\" [ 0.5 0.5 0.5 ] \"rgb tex2\" [ 0.5 0.5 0.5 ]\n"
                )
                + "Material \"diffuse\" \"texture reflectance\" \"c\"\n\
                   Shape \"bilinearmesh\" \"point3 P\" [ -9 -9 1  9 -9 1  -9 9 1  9 9 1 ]\n"),
        );
        check_all(&format!("uscale {scale}"), &picture(&text, 4, Filtering::None), 0.5, 1e-5);
    }
}

#[test]
fn a_large_square_texture() {
    // `ci/test-extremes` asks for 32768 texels a side, in bytes: 3 GB, and 4 GB with its smaller levels.
    let side = super::support::size("TESSERA_TEXTURE_SIDE", 1024) as usize;
    let folder = tempfile::tempdir().unwrap();
    // A portable graymap whose columns are black and white by turns: its mean is half the light of white.
    let mut bytes = format!("P5\n{side} {side}\n255\n").into_bytes();
    bytes.extend((0..side * side).map(|i| if i % 2 == 0 { 0u8 } else { 255 }));
    std::fs::write(folder.path().join("t.pgm"), bytes).unwrap();
    let path = folder.path().join("scene.pbrt");
    std::fs::write(&path, textured("trilinear").replace("t.exr", "t.pgm")).unwrap();
    let (frame, _) = attempt(&path, job(4, Filtering::None)).unwrap();
    sound(&frame);
    let mean = values(&frame).mean()[1];
    println!("{side}×{side} texels: mean {mean:.5}, built in {:.1} s", frame.statistics.compile_seconds);
    // The wall of 18 units has 57 to 1820 texels a unit, its pixels are 0.07 units: level 2 or coarser, which is one grey.
    assert!((mean - 0.5).abs() <= 0.005);
}

#[test]
fn damaged_images_are_read_or_refused() {
    // The seeds of the fuzz target, with bytes of them changed, taken out, or cut off.
    let folder = tempfile::tempdir().unwrap();
    let mut random = tests::synthetic::Random::new(7);
    let (mut read, mut refused) = (0, 0);
    let images = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/images");
    let mut seeds: Vec<_> = std::fs::read_dir(images).unwrap().map(|entry| entry.unwrap().path()).collect();
    seeds.sort();
    for seed in seeds {
        let whole = std::fs::read(&seed).unwrap();
        let path = folder.path().join(seed.file_name().unwrap());
        for round in 0..60 {
            let mut bytes = whole.clone();
            let at = random.below(bytes.len() as u64) as usize;
            match round % 3 {
                0 => bytes[at] = random.bits() as u8,
                1 => bytes.truncate(at),
                _ => drop(bytes.drain(at..(at + 1 + random.below(8) as usize).min(whole.len()))),
            }
            std::fs::write(&path, bytes).unwrap();
            // A changed header may ask for any size: what is far beyond the seeds' 9×7 is left alone.
            let small = |reader: &oiio::Reader| reader.data_window().width * reader.data_window().height < 1 << 20;
            let pixels = oiio::Reader::open(&path).ok().filter(small).and_then(|mut reader| reader.read_f32().ok());
            *if pixels.is_some() { &mut read } else { &mut refused } += 1;
        }
    }
    println!("{read} damaged images read, {refused} refused");
    assert!(read > 0 && refused > 0);
}

#[test]
fn environments_of_odd_sizes_are_seen_or_refused() {
    for size in [(2, 1), (1, 2), (3, 3), (7, 3), (1, 512)] {
        let (_folder, path) = with_image("t.exr", size, |_, _| 2.0, &environment());
        match attempt(&path, job(16, Filtering::None)) {
            Ok((frame, _)) => {
                sound(&frame);
                println!("environment of {size:?}: sky {}", values(&frame).pixels[0][1]);
                assert_eq!(values(&frame).pixels[0][1], 2.0);
            }
            Err(messages) => {
                println!("environment of {size:?}: {}", messages.lines().nth(1).unwrap_or(""));
                assert!(messages.contains("scene.pbrt:7:") && messages.contains("t.exr"));
            }
        }
    }
}
