//! The texture system against texels that are known.

use std::path::{Path, PathBuf};

use oiio::{
    Channel, Compression, Error, FileFormat, Filter, Format, Lookup, MipMode, Output, TextureOptions, TextureSystem,
    Window, Wrap,
};

const NO_FOOTPRINT: [f32; 2] = [0.0, 0.0];

/// Writes a one- or three-channel float image.
fn image(
    folder: &Path,
    name: &str,
    size: usize,
    channels: usize,
    value: impl Fn(usize, usize, usize) -> f32,
) -> PathBuf {
    let path = folder.join(name);
    let pixels: Vec<f32> =
        (0..size * size * channels).map(|i| value(i / channels % size, i / channels / size, i % channels)).collect();
    let names: &[&str] = if channels == 1 { &["Y"] } else { &["R", "G", "B"] };
    oiio::write(&Output {
        path: &path,
        file_format: FileFormat::Exr,
        data_window: Window::at_origin(size, size),
        display_window: Window::at_origin(size, size),
        channels: names.iter().map(|&name| Channel { name: name.to_owned(), format: Format::Float }).collect(),
        pixels: &pixels,
        attributes: vec![],
        compression: Compression::default(),
    })
    .unwrap();
    path
}

fn every_lookup() -> Vec<Lookup> {
    let mut all = vec![];
    for filter in [Filter::Closest, Filter::Bilinear, Filter::Bicubic, Filter::SmartBicubic] {
        for mip in [MipMode::NoMip, MipMode::OneLevel, MipMode::Trilinear, MipMode::Anisotropic] {
            all.push(Lookup { filter, mip, ..Lookup::default() });
        }
    }
    all
}

#[test]
fn a_constant_image_is_constant_under_every_filter_and_footprint() {
    let folder = tempfile::tempdir().unwrap();
    let path = image(folder.path(), "constant.exr", 32, 3, |_, _, c| [0.25, 0.5, 2.0][c]);
    let system = TextureSystem::new(&TextureOptions::default()).unwrap();
    let texture = system.open(&path).unwrap();
    assert_eq!((texture.width, texture.height, texture.channels), (32, 32, 3));
    let mut sampler = system.sampler().unwrap();
    for lookup in every_lookup() {
        for size in [0.0, 0.01, 0.3, 4.0] {
            let value = sampler.sample(&texture, [0.3, 1.7], [size, 0.0], [0.0, size * 0.2], &lookup).unwrap();
            for (a, b) in value.iter().zip([0.25, 0.5, 2.0]) {
                // Weights of the filters sum to 1 within a few roundings.
                assert!((a - b).abs() < 1e-5, "{lookup:?} {size}: {value:?}");
            }
        }
    }
}

#[test]
fn bilinear_meets_the_texels_of_a_gradient_and_the_middle_between_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = image(folder.path(), "gradient.exr", 16, 1, |x, y, _| x as f32 + 100.0 * y as f32);
    let system = TextureSystem::new(&TextureOptions::default()).unwrap();
    let texture = system.open(&path).unwrap();
    let mut sampler = system.sampler().unwrap();
    let lookup = Lookup { wrap: Wrap::Clamp, mip: MipMode::NoMip, ..Lookup::default() };
    let mut at = |x: f32, y: f32| {
        sampler.sample(&texture, [(x + 0.5) / 16.0, (y + 0.5) / 16.0], NO_FOOTPRINT, NO_FOOTPRINT, &lookup).unwrap()
    };
    for (x, y) in [(0.0, 0.0), (3.0, 5.0), (7.5, 2.0), (7.5, 2.5), (15.0, 15.0)] {
        let value = at(x, y);
        // Texture coordinates round at 2^-24 of 16 texels, and rows differ by 100.
        assert!((value[0] - (x + 100.0 * y)).abs() < 1e-3, "{x} {y}: {value:?}");
        assert_eq!(value[0], value[2], "grey");
    }
    assert_eq!(at(-5.0, -5.0)[0], 0.0, "clamped");
}

#[test]
fn a_wide_footprint_sees_the_mean_of_a_checkerboard() {
    let folder = tempfile::tempdir().unwrap();
    let path = image(folder.path(), "checks.exr", 64, 1, |x, y, _| ((x + y) % 2) as f32);
    let system = TextureSystem::new(&TextureOptions::default()).unwrap();
    let texture = system.open(&path).unwrap();
    let mut sampler = system.sampler().unwrap();
    for mip in [MipMode::OneLevel, MipMode::Trilinear, MipMode::Anisotropic] {
        let lookup = Lookup { mip, ..Lookup::default() };
        let value = sampler.sample(&texture, [0.4, 0.6], [0.25, 0.0], [0.0, 0.25], &lookup).unwrap();
        assert!((value[0] - 0.5).abs() < 1e-5, "{mip:?} {value:?}");
    }
}

#[test]
fn odd_texels_do_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let system = TextureSystem::new(&TextureOptions::default()).unwrap();
    let mut sampler = system.sampler().unwrap();
    let one = system.open(image(folder.path(), "one.exr", 1, 3, |_, _, c| c as f32)).unwrap();
    let nan =
        system.open(image(folder.path(), "nan.exr", 8, 1, |x, _, _| if x == 3 { f32::NAN } else { 1.0 })).unwrap();
    for lookup in every_lookup() {
        for size in [0.0, 0.2, 1.0e9] {
            let value = sampler.sample(&one, [-3.2, 0.9], [size, 0.0], [0.0, size], &lookup).unwrap();
            assert!((value[1] - 1.0).abs() < 1e-5 && (value[2] - 2.0).abs() < 1e-5, "{lookup:?} {value:?}");
            sampler.sample(&nan, [0.4, 0.1], [size, 0.0], [0.0, size], &lookup).unwrap();
        }
        sampler.sample(&one, [f32::NAN, f32::INFINITY], [f32::NAN, 0.0], [0.0, f32::INFINITY], &lookup).unwrap();
    }
}

#[test]
fn a_missing_or_damaged_file_is_found_when_it_is_opened_or_read() {
    let folder = tempfile::tempdir().unwrap();
    let system = TextureSystem::new(&TextureOptions::default()).unwrap();
    let error = system.open(folder.path().join("missing.png")).unwrap_err();
    assert!(matches!(error, Error::Open { .. }) && error.to_string().contains("missing.png"), "{error}");

    let path = image(folder.path(), "cut.exr", 64, 3, |x, y, c| (x * y + c) as f32);
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let result = system.open(&path).and_then(|texture| {
        system.sampler()?.sample(&texture, [0.5, 0.9], NO_FOOTPRINT, NO_FOOTPRINT, &Lookup::default())
    });
    assert!(result.unwrap_err().to_string().contains("cut.exr"));
}

#[test]
fn threads_see_the_same_values() {
    let folder = tempfile::tempdir().unwrap();
    let path = image(folder.path(), "noise.exr", 64, 3, |x, y, c| ((x * 7 + y * 13 + c) % 17) as f32);
    let system = TextureSystem::new(&TextureOptions::default()).unwrap();
    let texture = system.open(&path).unwrap();
    let sum = || {
        let mut sampler = system.sampler().unwrap();
        (0..2000_u16)
            .map(|i| {
                let st = [f32::from(i) * 0.618_034, f32::from(i) * 0.754_878];
                sampler.sample(&texture, st, [0.02, 0.0], [0.0, 0.02], &Lookup::default()).unwrap()[0]
            })
            .sum::<f32>()
    };
    let sums: Vec<f32> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..4).map(|_| scope.spawn(sum)).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert!(sums.iter().all(|&s| s == sums[0]), "{sums:?}");
}
