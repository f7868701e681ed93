//! Measures OpenImageIO's texture look-ups: `cargo run --release -p oiio --example lookups [IMAGE]`.
//!
//! Prints nanoseconds per look-up by filter, by levels, by tile size and by threads, for coherent look-ups (a walk of
//! one texel at a time) and for random ones. Without an image it makes one of 2048 × 2048 bytes.
#![allow(clippy::print_stdout)]

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::Instant;

use oiio::{
    Channel, Compression, FileFormat, Filter, Format, Lookup, MipMode, Output, Texture, TextureOptions, TextureSystem,
    Window,
};

const LOOKUPS: u32 = 200_000;

/// The quickest of the batches counts: the others were disturbed by whatever else the machine does.
const BATCH: u32 = 5_000;

fn main() -> Result<(), oiio::Error> {
    oiio::set_threads(1)?;
    let folder = std::env::temp_dir().join(format!("lookups-{}", std::process::id()));
    let path = match std::env::args_os().nth(1) {
        Some(path) => PathBuf::from(path),
        None => make_image(&folder)?,
    };
    println!("{} {}", oiio::version(), path.display());
    println!(
        "{:>5} {:>12} {:>12} {:>9} {:>9} {:>9} {:>9}",
        "tile", "filter", "levels", "walk/1", "walk/2", "any/1", "any/2"
    );
    for tile in [64, 256, 0] {
        let system = TextureSystem::new(&TextureOptions { tile, ..TextureOptions::default() })?;
        let texture = system.open(&path)?;
        for (filter, mip) in [
            (Filter::Closest, MipMode::NoMip),
            (Filter::Closest, MipMode::OneLevel),
            (Filter::Bilinear, MipMode::NoMip),
            (Filter::Bilinear, MipMode::OneLevel),
            (Filter::Bilinear, MipMode::Trilinear),
            (Filter::Bilinear, MipMode::Anisotropic),
            (Filter::SmartBicubic, MipMode::Anisotropic),
        ] {
            let lookup = Lookup { filter, mip, ..Lookup::default() };
            let run = |random, threads| measure(&system, &texture, &lookup, random, threads);
            run(true, 1)?;
            let [a, b, c, d] = [run(false, 1)?, run(false, 2)?, run(true, 1)?, run(true, 2)?];
            let (filter, mip) = (format!("{filter:?}"), format!("{mip:?}"));
            println!("{tile:>5} {filter:>12} {mip:>12} {a:>9.0} {b:>9.0} {c:>9.0} {d:>9.0}");
        }
        println!("      {:?}", system.stats());
    }
    let _ = std::fs::remove_dir_all(&folder);
    Ok(())
}

/// Nanoseconds of one thread per look-up, while `threads` look up at once, averaged over the threads.
fn measure(
    system: &TextureSystem,
    texture: &Texture,
    lookup: &Lookup,
    random: bool,
    threads: u32,
) -> Result<f64, oiio::Error> {
    let run = |thread: u32| {
        let mut sampler = system.sampler()?;
        let step = 1.0 / texture.width as f32;
        let mut least = f64::INFINITY;
        let mut start = Instant::now();
        for i in 0..LOOKUPS {
            let bits = (i + thread * LOOKUPS).wrapping_mul(0x9e37_79b9);
            let (u, v) = ((bits >> 8) as f32 / (1 << 24) as f32, (bits.reverse_bits() >> 8) as f32 / (1 << 24) as f32);
            let st = if random { [u, v] } else { [i as f32 * step, (i / 2048) as f32 * step] };
            black_box(sampler.sample(texture, st, [step, 0.0], [0.0, step], lookup)?);
            if i % BATCH == BATCH - 1 {
                least = least.min(start.elapsed().as_nanos() as f64 / f64::from(BATCH));
                start = Instant::now();
            }
        }
        Ok(least)
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|thread| scope.spawn(move || run(thread))).collect();
        let times = workers.into_iter().map(|worker| worker.join().expect("a worker panicked"));
        times.sum::<Result<f64, _>>().map(|sum| sum / f64::from(threads))
    })
}

fn make_image(folder: &Path) -> Result<PathBuf, oiio::Error> {
    const SIZE: usize = 2048;
    let path = folder.join("image.png");
    std::fs::create_dir_all(folder)
        .map_err(|e| oiio::Error::Write { path: folder.to_owned(), reason: e.to_string() })?;
    let pixels: Vec<f32> =
        (0..SIZE * SIZE * 3).map(|i| ((i / 3 * 7 + i / 3 / SIZE * 13) % 256) as f32 / 255.0).collect();
    oiio::write(&Output {
        path: &path,
        file_format: FileFormat::Png,
        data_window: Window::at_origin(SIZE, SIZE),
        display_window: Window::at_origin(SIZE, SIZE),
        channels: ["R", "G", "B"].map(|name| Channel { name: name.to_owned(), format: Format::U8 }).to_vec(),
        pixels: &pixels,
        attributes: vec![],
        compression: Compression::default(),
    })?;
    Ok(path)
}
