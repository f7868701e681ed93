//! Times light samples and their densities: `cargo run --release -p renderer --example lights [environment image]`.
#![allow(clippy::print_stdout)]

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use glam::{Vec2, Vec3};
use renderer::light::{Emitter, Lights, Receiver};
use renderer::math::Transform;
use renderer::sampling::{Dimension, Sampler};
use renderer::scene::Span;
use renderer::scene::description::{AreaLight, AreaLightId, Light, LightKind};
use renderer::shape::{Shape, Triangle};
use renderer::texture::Textures;

/// Uniform numbers that the branch predictor does not learn.
fn number(i: u32, k: u32) -> f32 {
    Sampler::new(1).pixel_sample([i, k], 0).d1(Dimension::FILM)
}

fn vector(i: u32, k: u32) -> Vec3 {
    Vec3::new(number(i, k), number(i, k + 1), number(i, k + 2)) * 2.0 - 1.0
}

fn triangles(count: u32) -> Vec<Emitter> {
    let size = 0.3 / (count as f32).cbrt();
    let triangle = |i: u32| {
        let p = vector(i, 0);
        let shape = Triangle::new([p, p + size * vector(i, 3), p + size * vector(i, 6)], None, None, false)?;
        Some(Emitter { face_area: shape.area(), shape: Shape::Triangle(shape), alpha: None, light: AreaLightId(0) })
    };
    (0..count).filter_map(triangle).collect()
}

fn light(kind: LightKind) -> Light {
    Light { world_from_light: Transform::default(), kind, group: None, span: Span::default() }
}

/// Nanoseconds a call, the best of some rounds.
fn nanoseconds(mut call: impl FnMut(usize)) -> f64 {
    const CALLS: usize = 4096;
    let round = || {
        let start = Instant::now();
        (0..CALLS).for_each(&mut call);
        start.elapsed().as_secs_f64() * 1e9 / CALLS as f64
    };
    std::iter::repeat_with(round).take(50).fold(f64::INFINITY, f64::min)
}

fn main() {
    let environment = std::env::args().nth(1).map(|path| {
        let image = Some(PathBuf::from(path));
        light(LightKind::Infinite { radiance: Vec3::ONE, image, illuminance: None, portal: vec![] })
    });
    let points = |count: u32| -> Vec<Light> {
        (0..count).map(|i| light(LightKind::Point { intensity: Vec3::ONE, from: vector(i, 0), power: None })).collect()
    };
    let mut scenes: Vec<(String, Vec<Light>, Vec<Emitter>)> = Vec::new();
    scenes.extend(environment.map(|light| ("environment".to_owned(), vec![light], vec![])));
    scenes.extend([1, 8, 1000].map(|n| (format!("{n} points"), points(n), vec![])));
    scenes.extend([1, 2, 8, 64, 1000, 100_000].map(|n| (format!("{n} triangles"), vec![], triangles(n))));

    let area = [AreaLight {
        radiance: Vec3::ONE,
        image: None,
        two_sided: false,
        power: None,
        group: None,
        span: Span::default(),
    }];
    let inputs: Vec<(Receiver, f32, Vec2, Vec3)> = (0..4096)
        .map(|i| {
            let receiver = Receiver { p: vector(i, 20), n: vector(i, 23).normalize() };
            (receiver, number(i, 26), Vec2::new(number(i, 27), number(i, 28)), vector(i, 30))
        })
        .collect();
    for (name, lights, emitters) in scenes {
        let count = emitters.len();
        let textures = Textures::default();
        let start = Instant::now();
        let (lights, _) = match Lights::build(&lights, &area, emitters, (Vec3::NEG_ONE, Vec3::ONE)) {
            Ok(built) => built,
            Err(errors) => return println!("{errors:?}"),
        };
        let build = start.elapsed();
        let sample = nanoseconds(|i| {
            let (from, u, v, _) = &inputs[i];
            black_box(lights.sample(&textures, from, *u, *v));
        });
        let density = nanoseconds(|i| {
            let (from, .., p) = &inputs[i];
            black_box(match count {
                0 => lights.escaped(from.n, Some(from), 1.0).map(|(radiance, _)| radiance.x).sum(),
                _ => lights.emitter_pdf((i * 7919 % count) as u32, from, *p, Vec3::Z),
            });
        });
        println!("{name:18} sample {sample:6.0} ns   density of a hit {density:6.0} ns   built in {build:.2?}");
    }
}
