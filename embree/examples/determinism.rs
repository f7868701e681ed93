//! Builds scenes full of coincident surfaces again and again with 1, 2 and 4 builder threads, and prints how many rays
//! are answered otherwise than by the first build: `cargo run --release -p embree --example determinism [-- TRIANGLES]`.
#![allow(clippy::print_stdout)] // its purpose

#[path = "../tests/support/mod.rs"]
mod support;

use embree::{BuildQuality, Device, DeviceOptions};
use support::coincident;

fn main() {
    let triangles = std::env::args().nth(1).and_then(|argument| argument.parse().ok()).unwrap_or(60_000);
    let rays = coincident::rays(20_000);
    for quality in [BuildQuality::Medium, BuildQuality::High] {
        let mut first = None;
        for threads in [1, 2, 4] {
            let mut different = Vec::new();
            for _ in 0..5 {
                let device = Device::new(&DeviceOptions { threads, ..DeviceOptions::default() }).expect("a device");
                let scene = coincident::scene(&device, quality, triangles, 3);
                let answers = coincident::answers(&scene, &rays);
                let first = first.get_or_insert_with(|| answers.clone());
                different.push(first.iter().zip(&answers).filter(|(a, b)| a != b).count());
            }
            println!("{quality:?}, {threads} builder threads: rays answered differently in 5 builds: {different:?}");
        }
    }
}
