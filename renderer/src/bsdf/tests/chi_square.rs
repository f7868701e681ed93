//! Samples against densities.

use super::*;

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
    expected.push(f64::from(SAMPLES) - inside);
    expected
}

/// χ² as a standard normal variable (\[Wilson31\]), cells of fewer than 5 expected samples pooled.
fn chi_square_z(observed: &[f64], expected: &[f64]) -> f64 {
    let (mut sum, mut cells) = (0.0, 0.0);
    let (mut pooled_observed, mut pooled_expected) = (0.0, 0.0);
    for (&o, &e) in observed.iter().zip(expected) {
        if e < 5.0 {
            pooled_observed += o;
            pooled_expected += e;
        } else {
            sum += (o - e) * (o - e) / e;
            cells += 1.0;
        }
    }
    if pooled_expected >= 5.0 {
        sum += (pooled_observed - pooled_expected) * (pooled_observed - pooled_expected) / pooled_expected;
        cells += 1.0;
    } else {
        // Too little for χ²: still, what cannot happen must not. Poisson of mean < 5 exceeds 25 in 10⁻¹⁰ of all cases.
        assert!(pooled_observed < 25.0, "{pooled_observed} samples where {pooled_expected} are expected");
    }
    let k = f64::max(cells - 1.0, 1.0);
    ((sum / k).cbrt() - (1.0 - 2.0 / (9.0 * k))) / (2.0 / (9.0 * k)).sqrt()
}

#[test]
fn samples_follow_their_density() {
    let mut worst = (0.0, String::new());
    for (m, (name, bsdf)) in rough_models().iter().enumerate() {
        for (k, (z, phi)) in [(0.95, 0.4), (0.4, 2.0), (0.08, -1.0), (-0.6, 1.1)].into_iter().enumerate() {
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
            let statistic = chi_square_z(&observed, &expectation(bsdf, wo, 12));
            if statistic > worst.0 {
                worst = (statistic, format!("{name} from {z}"));
            }
        }
    }
    // 120 tests at 0.1 % together (Šidák): 8.3·10⁻⁶ each, z = 4.3. The midpoint rule adds less than 0.5.
    assert!(worst.0 < 4.8, "{worst:?}");
}
