use std::f64::consts::TAU;

use glam::DVec3;

use super::super::infinite::Infinite;
use super::super::testing::{Mean, Random};
use super::*;
use crate::sampling::stats::chi2_p_value;
use crate::texture::RgbImage;

fn image(size: usize, texel: impl Fn(usize, usize) -> Rgb) -> LightImage {
    let pixels = (0..size * size).map(|i| texel(i % size, i / size)).collect();
    LightImage::new(RgbImage { width: size, height: size, pixels }).unwrap().0
}

/// A sky with a sun: values over six orders of magnitude.
fn sky(size: usize) -> LightImage {
    image(size, |x, y| match (x, y) {
        (3, 5) => Rgb::new(4e4, 3e4, 2e4),
        _ if (x + y) % 5 == 0 => Rgb::ZERO,
        _ => Rgb::new(0.1 + x as f32 * 0.02, 0.3, 0.1 + y as f32 * 0.05),
    })
}

fn transforms() -> [DMat3; 3] {
    let turn = DMat3::from_axis_angle(DVec3::new(0.36, 0.48, 0.8), 1.0);
    // As scene files mirror environments; and sheared, so that solid angles change.
    let mirror = DMat3::from_diagonal(DVec3::new(-3.0, 3.0, 3.0));
    let skew = DMat3::from_cols(DVec3::new(1.0, 0.0, 0.2), DVec3::new(0.3, 0.7, 0.0), DVec3::new(0.0, -0.2, 1.5));
    [DMat3::IDENTITY, turn * mirror, turn * skew]
}

fn image_light(image: LightImage, light_from_world: DMat3) -> Infinite {
    Infinite::Image(Box::new(Environment::new(&image, Rgb::new(1.0, 2.0, 0.5), light_from_world)))
}

/// ∫ of radiance × max(0, cos) to `n` over all directions, by midpoints.
fn irradiance(light: &Infinite, n: Vec3) -> DVec3 {
    const STEPS: usize = 1024;
    let mut sum = DVec3::ZERO;
    for i in 0..STEPS * STEPS {
        let uv = (Vec2::new((i % STEPS) as f32, (i / STEPS) as f32) + 0.5) / STEPS as f32;
        let wi = octahedral::direction_from_square(uv);
        sum += light.radiance_and_pdf(wi, n).0.as_dvec3() * f64::from(wi.dot(n).max(0.0));
    }
    sum * (2.0 * TAU / (STEPS * STEPS) as f64)
}

#[test]
fn the_density_is_that_of_samples() {
    // Contrast is low, so that bins which borders of texels cross are integrated well enough by midpoints.
    let rough = || image(12, |x, y| Rgb::new(0.2 + ((5 * x + 7 * y) % 11) as f32 * 0.2, 0.5, 0.0));
    let uniform = Infinite::Uniform { radiance: Rgb::ONE, sampled: true };
    let lights = transforms().into_iter().map(|t| image_light(rough(), t)).chain([uniform]);
    for (index, light) in lights.enumerate() {
        for n in [Vec3::ZERO, Vec3::new(0.6, 0.0, 0.8)] {
            const BINS: usize = 24;
            const STEPS: usize = 24;
            const SAMPLES: usize = 60_000;
            let bin = |d: Vec3| {
                let at = (octahedral::square_from_direction(d) * BINS as f32).as_usizevec2();
                at.y.min(BINS - 1) * BINS + at.x.min(BINS - 1)
            };
            let mut expected = vec![0.0; BINS * BINS];
            let side = BINS * STEPS;
            for i in 0..side * side {
                let uv = (Vec2::new((i % side) as f32, (i / side) as f32) + 0.5) / side as f32;
                let wi = octahedral::direction_from_square(uv);
                let density = f64::from(light.radiance_and_pdf(wi, n).1);
                expected[bin(wi)] += density * SAMPLES as f64 * 2.0 * TAU / (side * side) as f64;
            }
            let total: f64 = expected.iter().sum();
            assert!((total / SAMPLES as f64 - 1.0).abs() < 2e-3, "{index} {n}: {total}");
            let mut observed = vec![0.0; BINS * BINS];
            let mut random = Random::new(11);
            for _ in 0..SAMPLES {
                let Some(sample) = light.sample(n, random.square()) else { continue };
                observed[bin(sample.wi)] += 1.0;
            }
            let p = chi2_p_value(&observed, &expected);
            assert!(p > 1e-4, "{index} {n}: p = {p}");
        }
    }
}

#[test]
fn a_sample_says_what_a_ray_finds() {
    for (index, transform) in transforms().into_iter().enumerate() {
        for compensated in [false, true] {
            let mut light = image_light(sky(16), transform);
            if compensated {
                light.leave_to_bsdf_samples();
            }
            let mut random = Random::new(12);
            let mut different = 0;
            for _ in 0..20_000 {
                let Some(sample) = light.sample(Vec3::ZERO, random.square()) else { continue };
                assert!((sample.wi.length() - 1.0).abs() < 1e-6);
                let (radiance, pdf) = light.radiance_and_pdf(sample.wi, Vec3::ZERO);
                different += u32::from(radiance != sample.radiance || (pdf / sample.pdf - 1.0).abs() > 1e-5);
            }
            // Directions round to 2⁻²⁴, some hundred of which span a texel's border to the next.
            assert!(different < 4, "{index}: {different}");
        }
    }
}

#[test]
fn a_sample_is_withheld_only_below_the_horizon() {
    // Sides that tiles fill and do not fill.
    for (size, transform) in [(64, 0), (131, 1), (258, 2)] {
        let light = image_light(sky(size), transforms()[transform]);
        let mut random = Random::new(16);
        let mut withheld = 0;
        for _ in 0..20_000 {
            let u = random.square();
            let n = octahedral::direction_from_square(random.square());
            match (light.sample(n, u), light.sample(Vec3::ZERO, u).unwrap()) {
                (Some(sample), all) => assert_eq!((sample.wi, sample.pdf), (all.wi, all.pdf)),
                (None, all) => {
                    assert!(all.wi.dot(n) <= 0.0, "{size}: {n} {}", all.wi);
                    withheld += 1;
                }
            }
        }
        assert!(withheld > 5000, "{size}: {withheld}");
    }
}

#[test]
fn irradiance_is_the_mean_of_samples() {
    for (index, transform) in transforms().into_iter().enumerate() {
        let smooth = image(16, |x, y| Rgb::new(0.1 + x as f32, 3.0, (x * y) as f32));
        let light = image_light(smooth, transform);
        for n in [Vec3::Z, Vec3::new(-0.6, 0.8, 0.0)] {
            let expected = irradiance(&light, n);
            let mut mean = Mean::default();
            let mut random = Random::new(13);
            for _ in 0..100_000 {
                let sample = light.sample(n, random.square());
                mean.add(sample.map_or(DVec3::ZERO, |s| {
                    s.radiance.as_dvec3() * f64::from(s.wi.dot(n).max(0.0)) / f64::from(s.pdf)
                }));
            }
            mean.assert_is(expected, &format!("transform {index}, normal {n}"));
        }
    }
}

#[test]
fn a_uniform_environment_gives_pi_times_its_radiance() {
    let light = Infinite::Uniform { radiance: Rgb::new(1.0, 2.0, 3.0), sampled: true };
    let mut random = Random::new(14);
    for (n, expected) in [(Vec3::Y, PI), (Vec3::ZERO, 2.0 * TAU)] {
        let mut mean = Mean::default();
        for _ in 0..1000 {
            let value = light.sample(n, random.square()).map_or(DVec3::ZERO, |s| {
                let cos = if n == Vec3::ZERO { 1.0 } else { s.wi.dot(n) };
                s.radiance.as_dvec3() * f64::from(cos) / f64::from(s.pdf)
            });
            mean.add(value);
        }
        mean.assert_is(DVec3::new(1.0, 2.0, 3.0) * expected, &format!("normal {n}"));
    }
}

#[test]
fn black_tiny_and_dim_maps_are_safe() {
    let sampled = |image| image_light(image, DMat3::IDENTITY);
    let black = sampled(image(4, |_, _| Rgb::ZERO));
    assert!(!black.is_sampled() && black.sample(Vec3::ZERO, Vec2::splat(0.5)).is_none());
    assert_eq!(black.radiance_and_pdf(Vec3::X, Vec3::ZERO), (Rgb::ZERO, 0.0));
    // So dim that no density can be formed: not sampled, but seen.
    let dim = sampled(image(2, |_, _| Rgb::splat(1e-42)));
    assert!(!dim.is_sampled() && dim.radiance_and_pdf(Vec3::X, Vec3::ZERO).1 == 0.0);

    let mut one = sampled(image(1, |_, _| Rgb::ONE));
    let sample = one.sample(Vec3::ZERO, Vec2::new(0.3, 0.9)).unwrap();
    assert!((f64::from(sample.pdf) * 2.0 * TAU - 1.0).abs() < 1e-5);
    // Nothing is above the mean: all is left to BSDF samples.
    one.leave_to_bsdf_samples();
    assert!(!one.is_sampled() && one.radiance_and_pdf(Vec3::X, Vec3::ZERO).1 == 0.0);

    let extreme = sampled(image(2, |x, y| Rgb::splat([1e-12, 1e12, 0.0, 1.0][2 * y + x])));
    let mut random = Random::new(15);
    for _ in 0..1000 {
        let sample = extreme.sample(Vec3::ZERO, random.square()).unwrap();
        assert!(sample.pdf.is_finite() && sample.radiance.is_finite());
    }
}

#[test]
fn compensation_leaves_out_what_is_below_the_mean() {
    let mut light = image_light(image(2, |x, y| Rgb::splat((x + 2 * y) as f32)), DMat3::IDENTITY);
    light.leave_to_bsdf_samples();
    // Values 0, 1, 2, 3 with mean 1.5 leave 0.5 and 1.5 of the lower two texels: densities ½ and 3/2 over half a sphere.
    let pdf = |u, v| {
        f64::from(light.radiance_and_pdf(octahedral::direction_from_square(Vec2::new(u, v)), Vec3::ZERO).1) * 2.0 * TAU
    };
    for (u, v, expected) in [(0.2, 0.2, 0.0), (0.7, 0.2, 0.0), (0.2, 0.7, 1.0), (0.7, 0.7, 3.0)] {
        assert!((pdf(u, v) - expected).abs() < 1e-5, "{u} {v}: {}", pdf(u, v));
    }
}

#[test]
fn illuminance_is_half_of_the_true_one_as_in_pbrt() {
    let ours = pbrt_illuminance(&image(64, |_, _| Rgb::ONE));
    assert!((ours / (PI / 2.0) - 1.0).abs() < 1e-3, "{ours}");
}
