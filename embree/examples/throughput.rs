//! Prints build times and single-thread throughput: `cargo run --release -p embree --example throughput [-- THREADS]`.
//!
//! 1.5 million small triangles on bumpy sheets stand for a large interior; the rays go between random points of its
//! box. With an argument, only the build is timed, with so many builder threads.
#![allow(clippy::print_stdout)] // its purpose

#[path = "../tests/support/mod.rs"]
mod support;

use embree::{
    BuildQuality, CommittedScene, Device, DeviceOptions, Geometry, Isa, Ray, SceneBuilder, SceneOptions,
    TriangleIndices, VertexBuffer,
};
use glam::Vec3;
use std::hint::black_box;
use std::time::Instant;
use support::Numbers;

fn main() {
    let threads = std::env::args().nth(1).and_then(|argument| argument.parse().ok());
    let mesh = sheets(6, 354);
    println!("{} triangles", mesh.1.len());
    if let Some(threads) = threads {
        let options = DeviceOptions { threads, ..DeviceOptions::default() };
        for quality in [BuildQuality::Medium, BuildQuality::High] {
            build(&options, &mesh, SceneOptions { quality, ..SceneOptions::default() });
        }
        return;
    }
    let rays = rays(200_000);
    for isa in [Isa::Avx2, Isa::Native] {
        let options = DeviceOptions { isa, ..DeviceOptions::default() };
        for robust in [true, false] {
            let scene = build(&options, &mesh, SceneOptions { robust, ..SceneOptions::default() });
            measure("intersect", &rays, |ray| scene.intersect(ray).is_some());
            measure("occluded", &rays, |ray| scene.occluded(ray));
        }
    }
    let options = DeviceOptions::default();
    let compact = SceneOptions { compact: true, ..SceneOptions::default() };
    let high = SceneOptions { quality: BuildQuality::High, ..SceneOptions::default() };
    for which in [compact, high] {
        let scene = build(&options, &mesh, which);
        measure("intersect", &rays, |ray| scene.intersect(ray).is_some());
    }
    overhead(&options);
}

/// The cost of a call in itself: rays that miss the box of a single triangle.
fn overhead(options: &DeviceOptions) {
    let device = Device::new(options).expect("a device");
    let mut builder = SceneBuilder::new(&device, SceneOptions::default());
    builder.attach(support::triangle(&device, 0.0));
    let scene = builder.commit().expect("a scene");
    let rays: Vec<_> =
        rays(10_000).into_iter().map(|ray| Ray { origin: ray.origin + 9.0 * Vec3::ONE, ..ray }).collect();
    println!("one triangle, missed");
    measure("intersect", &rays, |ray| scene.intersect(ray).is_some());
    measure("occluded", &rays, |ray| scene.occluded(ray));
}

type Mesh = (VertexBuffer, TriangleIndices);

/// `count` sheets of `side`² bumpy quads in different directions through the cube [-1, 1]³.
fn sheets(count: usize, side: usize) -> Mesh {
    let mut numbers = Numbers(5);
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for sheet in 0..count {
        let base = positions.len() as u32;
        let offset = 2.0 * (sheet / 3) as f32 / (count as f32 / 3.0) - 0.5;
        for j in 0..=side {
            for i in 0..=side {
                let [a, b] = [i, j].map(|k| 2.0 * k as f32 / side as f32 - 1.0);
                let bump = 0.1 * (7.0 * a).sin() * (5.0 * b).cos() + 2e-3 * numbers.next();
                let mut p = [a, b, offset + bump];
                p.rotate_right(sheet % 3);
                positions.push(p);
            }
        }
        let row = side as u32 + 1;
        for j in 0..side as u32 {
            for i in 0..side as u32 {
                let at = base + j * row + i;
                triangles.extend([[at, at + 1, at + row], [at + 1, at + row + 1, at + row]]);
            }
        }
    }
    let vertices = VertexBuffer::new(positions).expect("finite vertices");
    let triangles = TriangleIndices::new(triangles, vertices.len()).expect("valid indices");
    (vertices, triangles)
}

fn rays(count: usize) -> Vec<Ray> {
    let mut numbers = Numbers(3);
    let mut ray = || {
        let origin = numbers.cube();
        Ray { t_far: 1.0, ..Ray::new(origin, numbers.cube() - origin) }
    };
    (0..count).map(|_| ray()).collect()
}

fn build(options: &DeviceOptions, (vertices, triangles): &Mesh, scene: SceneOptions) -> CommittedScene {
    let device = Device::new(options).expect("a device");
    let mut builder = SceneBuilder::new(&device, scene);
    builder.attach(Geometry::triangles(&device, vertices.clone(), triangles.clone()).expect("a mesh"));
    let start = Instant::now();
    let committed = builder.commit().expect("a scene");
    let memory = device.memory();
    println!(
        "{:?}, {:?}: built in {:.2} s with {} threads, holds {} MB, peak {} MB",
        options.isa,
        scene,
        start.elapsed().as_secs_f64(),
        options.threads,
        memory.current >> 20,
        memory.peak >> 20
    );
    committed
}

/// Prints the best of three rounds: the one that was disturbed least.
fn measure(name: &str, rays: &[Ray], query: impl Fn(&Ray) -> bool) {
    let mut best = f64::INFINITY;
    let mut hits = 0;
    for _ in 0..3 {
        let start = Instant::now();
        hits = rays.iter().filter(|ray| black_box(query(black_box(ray)))).count();
        best = best.min(start.elapsed().as_secs_f64());
    }
    let nanoseconds = 1e9 * best / rays.len() as f64;
    println!("  {name}: {:.2} Mrays/s, {nanoseconds:.0} ns each, {hits} of {} hit", 1e3 / nanoseconds, rays.len());
}
