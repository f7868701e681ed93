use super::*;
use crate::sampling::stats::chi2_p_value;
use crate::sampling::{Dimension, Sampler};
use proptest::prelude::*;

fn uneven(width: usize, height: usize) -> Vec<f32> {
    let value = |x: usize, y: usize| if (x + 3 * y) % 7 == 0 { 0.0 } else { 1.0 + (x * y % 13) as f32 * 4.0 };
    (0..height).flat_map(|y| (0..width).map(move |x| value(x, y))).collect()
}

proptest! {
    #[test]
    fn a_sample_lies_in_its_bin_with_its_density(
        values in prop::collection::vec(prop_oneof![Just(0.0f32), 0.0f32..1.0, 1e-30f32..1e-20, 1e20f32..1e30], 1..60),
        u in 0.0f32..1.0,
    ) {
        let distribution = PiecewiseConstant1D::new(&values).unwrap();
        let (x, pdf, bin) = distribution.sample(u);
        prop_assert!((0.0..1.0).contains(&x));
        prop_assert!(pdf > 0.0);
        prop_assert_eq!(pdf, distribution.pdf(x));
        prop_assert_eq!(bin_of(x, values.len()), Some(bin));
        prop_assert!(values[bin] > 0.0 || values.iter().all(|&v| v == 0.0));
    }

    #[test]
    fn inverse_undoes_sample(values in prop::collection::vec(0.01f32..1.0, 6..60), u in 0.0f32..1.0, v in 0.0f32..1.0) {
        let u = Vec2::new(u, v);
        let distribution = PiecewiseConstant2D::new(&values[..values.len() / 6 * 6], 6).unwrap();
        let back = distribution.inverse(distribution.sample(u).0);
        // x has an error of an ulp of 1 (the map's own), u then one of that times the density du/dx, which is at most
        // 60 times 100 here, and one more for the cumulative sums.
        prop_assert!((back - u).abs().max_element() <= 6001.0 * f32::EPSILON, "{u} {back}");
    }
}

#[test]
fn bins_get_their_share_of_samples() {
    let (width, height) = (24, 17);
    let values = uneven(width, height);
    let distribution = PiecewiseConstant2D::new(&values, width).unwrap();
    let n = 1 << 18;
    let mut counts = vec![0.0; values.len()];
    for i in 0..n {
        // Samples of different pixels are independent, as χ² demands.
        let u = Sampler::new(7).pixel_sample([i, 3], 0).d2(Dimension::FILM);
        let (p, pdf, [x, y]) = distribution.sample(u);
        assert_eq!(pdf, distribution.pdf(p));
        counts[y * width + x] += 1.0;
    }
    let total: f64 = values.iter().map(|&v| f64::from(v)).sum();
    let expected: Vec<f64> = values.iter().map(|&v| f64::from(v) / total * f64::from(n)).collect();
    let p = chi2_p_value(&counts, &expected);
    assert!(p > 1e-4, "p = {p}");
}

#[test]
fn densities_integrate_to_one_and_integrals_are_those_of_the_values() {
    let values = uneven(31, 9);
    let distribution = PiecewiseConstant2D::new(&values, 31).unwrap();
    let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64;
    assert!((distribution.integral() - mean).abs() < 1e-12 * mean);
    assert_eq!(distribution.size(), [31, 9]);
    let (mut sum, mut weighted) = (0.0, 0.0);
    for (cell, &value) in values.iter().enumerate() {
        let p = Vec2::new((cell % 31) as f32 + 0.5, (cell / 31) as f32 + 0.5) / Vec2::new(31.0, 9.0);
        let pdf = f64::from(distribution.pdf(p));
        sum += pdf / values.len() as f64;
        weighted += (pdf * mean - f64::from(value)).abs();
    }
    // Each density is rounded once.
    assert!((sum - 1.0).abs() < f64::from(f32::EPSILON));
    assert!(weighted / values.len() as f64 <= mean * f64::from(f32::EPSILON));
}

#[test]
fn zeros_and_unusable_values_never_fail() {
    assert!(PiecewiseConstant1D::new(&[]).is_none() && PiecewiseConstant2D::new(&[], 3).is_none());
    let uniform = PiecewiseConstant2D::new(&[0.0; 6], 3).unwrap();
    assert_eq!(uniform.integral(), 0.0);
    let (p, pdf, _) = uniform.sample(Vec2::new(0.25, 0.75));
    assert!((p - Vec2::new(0.25, 0.75)).abs().max_element() <= f32::EPSILON && pdf == 1.0);

    let odd = PiecewiseConstant1D::new(&[f32::NAN, 2.0, -3.0, f32::INFINITY]).unwrap();
    for u in [0.0, 0.5, 1.0 - f32::EPSILON / 2.0, 1.0] {
        let (x, pdf, bin) = odd.sample(u);
        assert_eq!((pdf, bin), (4.0, 1));
        assert!((0.25..0.5).contains(&x));
    }
    assert_eq!((odd.pdf(-0.1), odd.pdf(1.0), odd.pdf(f32::NAN)), (0.0, 0.0, 0.0));
}

#[test]
fn a_first_bin_too_improbable_for_u_is_skipped() {
    let distribution = PiecewiseConstant1D::new(&[f32::MIN_POSITIVE, 0.0, 1.0e30]).unwrap();
    assert_eq!(distribution.sample(0.0).2, 2);
}
