//! Measures our texture look-ups as OpenImageIO's are measured by its own example:
//! `cargo run --release -p renderer --example textures [IMAGE]`.
#![allow(clippy::print_stdout)]

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use glam::Vec2;
use renderer::scene::description::{Encoding, TextureFilter, Wrap};
use renderer::texture::image::{Channels, TexelData, Texels, load_texels};
use renderer::texture::pyramid::{Footprint, Pyramid};

const LOOKUPS: u32 = 500_000;

/// The quickest of the batches counts: the others were disturbed by whatever else the machine does.
const BATCH: u32 = 5_000;

fn main() -> Result<(), String> {
    let texels = match std::env::args_os().nth(1) {
        Some(path) => vec![("file", load_texels(&PathBuf::from(path), Channels::Rgb, None)?)],
        None => vec![("bytes", bytes(3)), ("grey", bytes(1)), ("half", halves())],
    };
    println!("{:>6} {:>10} {:>9} {:>9} {:>9} {:>9}", "texels", "filter", "walk/1", "walk/2", "any/1", "any/2");
    for (name, texels) in texels {
        let start = Instant::now();
        let pyramid = Pyramid::new(texels);
        let built = start.elapsed();
        for filter in [TextureFilter::Point, TextureFilter::Bilinear, TextureFilter::Trilinear, TextureFilter::Ewa] {
            let run = |random, threads| measure(&pyramid, filter, random, threads);
            run(true, 1);
            let [a, b, c, d] = [run(false, 1), run(false, 2), run(true, 1), run(true, 2)];
            println!("{name:>6} {:>10} {a:>9.1} {b:>9.1} {c:>9.1} {d:>9.1}", format!("{filter:?}"));
        }
        println!("       {:?}, {} kB, built in {built:.2?}", pyramid.size(), pyramid.bytes() / 1024);
    }
    Ok(())
}

/// Nanoseconds of one thread per look-up, while `threads` look up at once, averaged over the threads.
fn measure(pyramid: &Pyramid, filter: TextureFilter, random: bool, threads: u32) -> f64 {
    let run = |thread: u32| {
        let step = 1.0 / pyramid.size()[0] as f32;
        let footprint = Footprint { dx: Vec2::new(step, 0.0), dy: Vec2::new(0.0, step) };
        let mut least = f64::INFINITY;
        let mut start = Instant::now();
        for i in 0..LOOKUPS {
            let bits = (i + thread * LOOKUPS).wrapping_mul(0x9e37_79b9);
            let (u, v) = ((bits >> 8) as f32 / (1 << 24) as f32, (bits.reverse_bits() >> 8) as f32 / (1 << 24) as f32);
            let st = if random { Vec2::new(u, v) } else { Vec2::new(i as f32, (i / 2048) as f32) * step };
            black_box(pyramid.filter(black_box(st), &footprint, filter, Wrap::Repeat));
            if i % BATCH == BATCH - 1 {
                least = least.min(start.elapsed().as_nanos() as f64 / f64::from(BATCH));
                start = Instant::now();
            }
        }
        least
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|thread| scope.spawn(move || run(thread))).collect();
        workers.into_iter().map(|worker| worker.join().expect("a worker panicked")).sum::<f64>() / f64::from(threads)
    })
}

fn bytes(channels: usize) -> Texels {
    let data = (0..2048 * 2048 * channels).map(|i| (i / channels * 7 + i / channels / 2048 * 13) as u8).collect();
    texels(channels, TexelData::U8(data))
}

fn halves() -> Texels {
    let data = (0..2048 * 2048 * 3).map(|i: usize| 0x3800 + (i % 1024) as u16).collect();
    texels(3, TexelData::Half(data))
}

fn texels(channels: usize, data: TexelData) -> Texels {
    Texels { width: 2048, height: 2048, channels, data, encoding: Encoding::Srgb, alpha: false, replaced: 0 }
}
