use std::f64::consts::FRAC_PI_2;

use glam::{DVec3, Vec3};

use super::super::bounds::ALL_DIRECTIONS;
use super::super::testing::Random;
use super::*;
use build::Candidate;

fn point(light: u32, p: Vec3, intensity: f64) -> Candidate {
    let p = p.as_dvec3();
    let (axis, theta_o) = ALL_DIRECTIONS;
    let bounds = LightBounds { low: p, high: p, axis, theta_o, theta_e: FRAC_PI_2, two_sided: false, intensity };
    Candidate { light, bounds, depth: 0.0 }
}

/// A small flat emitter.
fn flat(light: u32, p: Vec3, n: Vec3, radius: f64, intensity: f64, two_sided: bool) -> Candidate {
    let (p, axis) = (p.as_dvec3(), n.as_dvec3().normalize());
    let half = radius * (DVec3::ONE - axis * axis).max(DVec3::ZERO).powf(0.5);
    let bounds =
        LightBounds { low: p - half, high: p + half, axis, theta_o: 0.0, theta_e: FRAC_PI_2, two_sided, intensity };
    Candidate { light, bounds, depth: 0.0 }
}

fn mixed_lights(count: u32, random: &mut Random) -> Vec<Candidate> {
    (0..count)
        .map(|i| {
            let intensity = 10.0_f64.powf(f64::from(4.0 * random.unit()));
            match i % 3 {
                0 => point(i, random.cube(), intensity),
                1 => flat(i, random.cube(), random.direction(), 0.02, intensity, false),
                _ => flat(i, random.cube(), random.direction(), 0.02, intensity, true),
            }
        })
        .collect()
}

fn receivers(count: usize, random: &mut Random) -> Vec<Receiver> {
    let receiver = |i| Receiver { p: random.cube() * 1.5, n: if i % 4 == 0 { Vec3::ZERO } else { random.direction() } };
    (0..count).map(receiver).collect()
}

/// Irradiance (up to a factor) that the centre of a light sends to the receiver.
fn arriving(candidate: &Candidate, from: &Receiver) -> f64 {
    let bounds = &candidate.bounds;
    let to_light = bounds.center() - from.p.as_dvec3();
    let wi = to_light.normalize();
    let cos_light = match (bounds.theta_o, bounds.two_sided) {
        (0.0, true) => bounds.axis.dot(wi).abs(),
        (0.0, false) => bounds.axis.dot(-wi).max(0.0),
        _ => 1.0,
    };
    let cos_i = if from.n == Vec3::ZERO { 1.0 } else { from.n.as_dvec3().dot(wi).max(0.0) };
    bounds.intensity * cos_light * cos_i / to_light.length_squared()
}

#[test]
fn probabilities_are_the_frequencies_of_choices() {
    let mut random = Random::new(1);
    for count in [1, 2, 5, 8, 9, 70] {
        let lights = mixed_lights(count, &mut random);
        let tree = LightTree::build(&lights, count as usize, 3.0);
        for from in receivers(12, &mut random) {
            const STEPS: u32 = 20_000;
            let mut chosen = vec![0u32; count as usize];
            let mut none = 0;
            for i in 0..STEPS {
                match tree.choose(&from, (i as f32 + 0.5) / STEPS as f32) {
                    Some((light, pmf)) => {
                        // The product over levels is taken in the other order.
                        assert!((tree.pmf(&from, light) / pmf - 1.0).abs() < 1e-5);
                        chosen[light as usize] += 1;
                    }
                    None => none += 1,
                }
            }
            let mut sum = f64::from(none) / f64::from(STEPS);
            for (light, &times) in chosen.iter().enumerate() {
                let pmf = f64::from(tree.pmf(&from, light as u32));
                // A light has one interval of u: the steps in it are its length to within one, and rounding.
                assert!((f64::from(times) / f64::from(STEPS) - pmf).abs() < 1.1 / f64::from(STEPS), "{count} {light}");
                sum += pmf;
            }
            assert!((sum - 1.0).abs() < f64::from(count + 2) / f64::from(STEPS), "{sum}");
        }
    }
}

#[test]
fn probabilities_of_lights_that_reach_everywhere_sum_to_one() {
    let mut random = Random::new(2);
    for count in [2, 8, 9, 300] {
        let lights: Vec<_> = (0..count).map(|i| point(i, random.cube(), 1.0 + f64::from(random.unit()))).collect();
        let tree = LightTree::build(&lights, count as usize, 3.0);
        for _ in 0..50 {
            let from = Receiver { p: random.cube() * 2.0, n: Vec3::ZERO };
            let sum: f64 = (0..count).map(|light| f64::from(tree.pmf(&from, light))).sum();
            assert!((sum - 1.0).abs() < 1e-5, "{count}: {sum}");
        }
    }
}

#[test]
fn no_light_that_arrives_is_missed() {
    let mut random = Random::new(3);
    let lights = mixed_lights(400, &mut random);
    let tree = LightTree::build(&lights, lights.len(), 3.0);
    for from in receivers(300, &mut random) {
        let brute: f64 = lights.iter().map(|light| arriving(light, &from)).sum();
        // The mean of value/pmf over u, by the pmf itself: only lights of probability 0 could be missing.
        let by_tree: f64 =
            lights.iter().filter(|light| tree.pmf(&from, light.light) > 0.0).map(|light| arriving(light, &from)).sum();
        assert!((by_tree - brute).abs() <= 1e-6 * brute, "{by_tree} {brute}");
    }
}

#[test]
fn the_mean_over_choices_is_the_sum_over_lights() {
    let mut random = Random::new(4);
    let lights = mixed_lights(200, &mut random);
    let tree = LightTree::build(&lights, lights.len(), 3.0);
    let (mut by_tree, mut by_uniform) = (0.0, 0.0);
    for from in receivers(60, &mut random) {
        let brute: f64 = lights.iter().map(|light| arriving(light, &from)).sum();
        if brute == 0.0 {
            continue;
        }
        const SAMPLES: u32 = 4000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for i in 0..SAMPLES {
            let u = (i as f32 + random.unit()) / SAMPLES as f32;
            let value =
                tree.choose(&from, u).map_or(0.0, |(l, pmf)| arriving(&lights[l as usize], &from) / f64::from(pmf));
            sum += value;
            squares += value * value;
        }
        let mean = sum / f64::from(SAMPLES);
        let variance = (squares / f64::from(SAMPLES) - mean * mean).max(0.0);
        // Stratified in u, the error is below that of independent samples, for which 5 deviations are next to impossible.
        let deviation = (variance / f64::from(SAMPLES)).sqrt();
        assert!((mean - brute).abs() <= 5.0 * deviation + 1e-5 * brute, "{mean} {brute} {deviation}");
        let uniform: f64 = lights.iter().map(|l| arriving(l, &from).powi(2)).sum::<f64>() * lights.len() as f64;
        by_tree += variance / (brute * brute);
        by_uniform += (uniform - brute * brute) / (brute * brute);
    }
    // What the tree is for.
    assert!(by_tree < 0.1 * by_uniform, "{by_tree} {by_uniform}");
}

#[test]
fn what_is_behind_is_never_chosen() {
    // Both triangles of a lamp that shines down, seen from above and from its own plane; and a receiver that faces away.
    let lights: Vec<_> = (0..2).map(|i| flat(i, Vec3::X * i as f32, -Vec3::Z, 0.7, 1.0, false)).collect();
    let tree = LightTree::build(&lights, 2, 10.0);
    let below = Receiver { p: Vec3::new(0.5, 0.0, -0.01), n: Vec3::ZERO };
    assert!(tree.choose(&below, 0.3).is_some());
    for p in [Vec3::new(0.5, 0.1, 0.01), Vec3::new(0.5, 0.1, 0.0), Vec3::new(7.0, 0.0, 3.0)] {
        let from = Receiver { p, n: Vec3::ZERO };
        assert_eq!((tree.choose(&from, 0.3), tree.pmf(&from, 0)), (None, 0.0), "{p}");
    }
    let facing_away = Receiver { p: Vec3::new(0.0, 0.0, -5.0), n: -Vec3::Z };
    assert_eq!((tree.choose(&facing_away, 0.9), tree.pmf(&facing_away, 1)), (None, 0.0));
}

#[test]
fn extreme_intensities_and_places_stay_finite() {
    let mut random = Random::new(5);
    for scale in [1e-12_f32, 1.0, 1e12] {
        let lights: Vec<_> =
            (0..100).map(|i| point(i, random.cube() * scale, 10.0_f64.powi(i as i32 % 25 - 12))).collect();
        let tree = LightTree::build(&lights, 100, 3.0 * f64::from(scale));
        for light in &lights {
            // At the place of a light, and anywhere.
            for p in [light.bounds.low.as_vec3(), random.cube() * scale, random.cube() * scale * 1e4] {
                let from = Receiver { p, n: Vec3::ZERO };
                let mut sum = 0.0;
                for light in 0..100 {
                    let pmf = tree.pmf(&from, light);
                    assert!(pmf.is_finite() && pmf >= 0.0);
                    sum += pmf;
                }
                assert!((sum - 1.0).abs() < 1e-4, "{sum}");
            }
        }
    }
}

#[test]
fn many_lights_in_one_place_and_clusters_within_clusters_make_no_deep_tree() {
    let together: Vec<_> = (0..1000).map(|i| point(i, Vec3::ONE, 1.0)).collect();
    let nested: Vec<_> = (0..1000).map(|i| point(i, Vec3::splat(0.5_f32.powi(i as i32 % 120)), 1.0)).collect();
    for lights in [together, nested] {
        let tree = LightTree::build(&lights, lights.len(), 1.0);
        let from = Receiver { p: Vec3::ZERO, n: Vec3::ZERO };
        let sum: f32 = (0..1000).map(|light| tree.pmf(&from, light)).sum();
        assert!((sum - 1.0).abs() < 1e-3, "{sum}");
    }
}

#[test]
fn a_hundred_thousand_lights_are_built_and_chosen_from() {
    let mut random = Random::new(6);
    let lights = mixed_lights(100_000, &mut random);
    let tree = LightTree::build(&lights, lights.len(), 3.0);
    for from in receivers(1000, &mut random) {
        let Some((light, pmf)) = tree.choose(&from, random.unit()) else { continue };
        assert!((tree.pmf(&from, light) / pmf - 1.0).abs() < 1e-4);
    }
    // A binary tree would have as many nodes as lights, less one.
    assert!(tree.nodes.len() < lights.len() / 3, "{} nodes", tree.nodes.len());
}
