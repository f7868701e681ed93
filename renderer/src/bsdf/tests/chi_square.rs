//! Samples against densities.

use super::*;
use crate::sampling::stats::chi2_p_value;

const COSINES: usize = 24;
const AZIMUTHS: usize = 24;
const SAMPLES: u32 = 60_000;

/// Cell of a direction: uniform in cosθ over the sphere, and in azimuth.
fn cell(w: LocalDir) -> usize {
    let row = ((w.cos_theta() + 1.0) * 0.5 * COSINES as f32) as usize;
    let turn = w.vec().y.atan2(w.vec().x) / std::f32::consts::TAU + 0.5;
    let column = (turn * AZIMUTHS as f32) as usize;
    row.min(COSINES - 1) * AZIMUTHS + column.min(AZIMUTHS - 1)
}

/// Number of samples expected in each cell, by midpoints. The last entry is what is expected outside the densities: delta
/// lobes and lost samples.
fn expectation(bsdf: &Bsdf, wo: LocalDir, subdivisions: usize) -> Vec<f64> {
    let n = subdivisions;
    let mut expected = Vec::with_capacity(COSINES * AZIMUTHS + 1);
    let area = 2.0 / COSINES as f64 * std::f64::consts::TAU / AZIMUTHS as f64 / (n * n) as f64;
    for row in 0..COSINES {
        for column in 0..AZIMUTHS {
            let mut sum = 0.0;
            for k in 0..n * n {
                let fraction =
                    |i: usize, k: usize, of: usize| (i * n + k) as f32 / (of * n) as f32 + 0.5 / (of * n) as f32;
                let z = 2.0 * fraction(row, k / n, COSINES) - 1.0;
                let phi = (fraction(column, k % n, AZIMUTHS) - 0.5) * std::f32::consts::TAU;
                sum += f64::from(bsdf.pdf(wo, direction(z, phi)));
            }
            expected.push(sum * area * f64::from(SAMPLES));
        }
    }
    let inside: f64 = expected.iter().sum();
    // Rounding and the midpoints must not make it negative.
    expected.push((f64::from(SAMPLES) - inside).max(1e-3));
    expected
}

#[test]
fn samples_follow_their_density() {
    let mut worst = (1.0, String::new());
    let mut tests = 0;
    for (m, (name, bsdf)) in rough_models().iter().enumerate() {
        for (k, (z, phi)) in [(0.95, 0.4), (0.4, 2.0), (0.15, -1.0), (-0.6, 1.1)].into_iter().enumerate() {
            let wo = direction(z, phi);
            let mut observed = vec![0.0; COSINES * AZIMUTHS + 1];
            let mut random = Random::new((m * 16 + k) as u64);
            for _ in 0..SAMPLES {
                let sample = bsdf.sample(wo, random.next(), random.pair());
                let at = match sample {
                    Some(sample) if !sample.specular => {
                        let pdf = bsdf.pdf(wo, sample.wi);
                        assert!((sample.pdf / pdf - 1.0).abs() < 2e-2, "{name} {wo:?}: {} {pdf}", sample.pdf);
                        cell(sample.wi)
                    }
                    _ => COSINES * AZIMUTHS,
                };
                observed[at] += 1.0;
            }
            let p = chi2_p_value(&observed, &expectation(bsdf, wo, 16));
            tests += 1;
            if p <= worst.0 {
                worst = (p, format!("{name} from {z}"));
            }
        }
    }
    // Šidák: all tests together reject what is right once in a thousand.
    let significance = 1.0 - (1.0 - 1e-3_f64).powf(1.0 / f64::from(tests));
    assert!(worst.0 > significance, "{worst:?}, below {significance}");
}
