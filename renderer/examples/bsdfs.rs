//! Times what a renderer does with materials: `cargo run --release -p renderer --example bsdfs`.
#![allow(clippy::print_stdout)]

use std::hint::black_box;
use std::time::Instant;

use glam::{Vec2, Vec3};
use renderer::bsdf::fresnel::ConductorFresnel;
use renderer::bsdf::microfacet::Ggx;
use renderer::bsdf::{
    Bsdf, Coat, CoatTable, CoatedConductor, CoatedDiffuse, Conductor, Dielectric, Diffuse, MetalTable,
};
use renderer::math::{LocalDir, Rgb};
use renderer::spectrum::{ConductorTable, named};

/// Directions and numbers that the branch predictor does not learn.
fn inputs() -> Vec<(LocalDir, LocalDir, f32, Vec2)> {
    let fraction = |i: u32, k: u32| {
        (f64::from(i) * [0.8191, 0.6711, 0.5497, 0.4503, 0.3689, 0.3022, 0.2476][k as usize]).fract() as f32
    };
    let direction = |z: f32, turn: f32| {
        let r = (1.0 - z * z).sqrt();
        LocalDir::new(Vec3::new(r * (turn * 6.0).cos(), r * (turn * 6.0).sin(), z))
    };
    let entry = |i| {
        let wo = direction(fraction(i, 0), fraction(i, 1));
        let wi = direction(fraction(i, 2), fraction(i, 3));
        (wo, wi, fraction(i, 4), Vec2::new(fraction(i, 5), fraction(i, 6)))
    };
    (1..1 << 12).map(entry).collect()
}

/// Of one call, in the quickest of many rounds: what else the machine does only ever adds.
fn nanoseconds(n: usize, mut f: impl FnMut(usize)) -> f64 {
    let mut round = || {
        let start = Instant::now();
        (0..n).for_each(&mut f);
        start.elapsed().as_secs_f64()
    };
    (0..60).map(|_| round()).fold(f64::INFINITY, f64::min) * 1e9 / n as f64
}

fn main() {
    let spectrum = |name| named(name).expect("a metal with a name");
    let metal = ConductorTable::new(&spectrum("metal-Al-eta"), &spectrum("metal-Al-k"), 1.0);
    let fresnel = ConductorFresnel::Table(&metal);
    let start = Instant::now();
    let smooth = CoatTable::new(1.5, 0.01, Some(0.0));
    println!("smooth coat built in {:.2} ms", start.elapsed().as_secs_f64() * 1e3);
    let start = Instant::now();
    let rough = CoatTable::new(1.5, 0.01, Some(0.3));
    println!("rough coat built in {:.2} ms", start.elapsed().as_secs_f64() * 1e3);
    let start = Instant::now();
    let textured = CoatTable::new(1.5, 0.01, None);
    println!("textured coat built in {:.2} ms", start.elapsed().as_secs_f64() * 1e3);
    let start = Instant::now();
    let coated_metal = MetalTable::new(&smooth, Some(0.22));
    println!("coated metal built in {:.2} ms", start.elapsed().as_secs_f64() * 1e3);

    let ggx = Ggx::isotropic(0.3);
    let albedo = Rgb::splat(0.5);
    let coated = |coat| Bsdf::CoatedDiffuse(CoatedDiffuse::new(albedo, coat));
    let models = [
        ("diffuse", Bsdf::Diffuse(Diffuse { albedo })),
        ("conductor", Bsdf::Conductor(Conductor { ggx, fresnel })),
        (
            "conductor by index",
            Bsdf::Conductor(Conductor { ggx, fresnel: ConductorFresnel::Index { eta: Rgb::ONE, k: Rgb::splat(4.0) } }),
        ),
        ("dielectric", Bsdf::Dielectric(Dielectric { eta: 1.5, ggx })),
        ("dielectric, smooth", Bsdf::Dielectric(Dielectric { eta: 1.5, ggx: Ggx::MIRROR })),
        ("coated diffuse", coated(Coat::new(ggx, &rough))),
        ("coated diffuse, smooth", coated(Coat::new(Ggx::MIRROR, &smooth))),
        ("coated diffuse, textured", coated(Coat::new(Ggx::isotropic(0.27), &textured))),
        (
            "coated conductor",
            Bsdf::CoatedConductor(CoatedConductor::new(
                Ggx::isotropic(0.22),
                fresnel,
                Coat::new(Ggx::MIRROR, &smooth),
                &coated_metal,
            )),
        ),
    ];
    println!("{} bytes; ns for eval_pdf, sample:", size_of::<Bsdf>());
    let inputs = inputs();
    for (name, bsdf) in &models {
        let eval = nanoseconds(inputs.len(), |i| {
            let (wo, wi, ..) = inputs[i];
            black_box(black_box(bsdf).eval_pdf(wo, wi));
        });
        let sample = nanoseconds(inputs.len(), |i| {
            let (wo, _, u_lobe, u) = inputs[i];
            black_box(black_box(bsdf).sample(wo, u_lobe, u));
        });
        println!("{name:26} {eval:6.1} {sample:6.1}");
    }
    let coat = nanoseconds(inputs.len(), |i| {
        let coat = Coat::new(ggx, &rough);
        black_box(CoatedDiffuse::new(Rgb::splat(inputs[i].2), coat));
    });
    println!("making a coated diffuse: {coat:.1}");
}
