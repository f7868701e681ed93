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
    fn a_sample_lies_in_a_cell_with_a_value_and_as_far_into_it_as_u(
        values in prop::collection::vec(prop_oneof![Just(0.0f32), 0.0f32..1.0, 1e-30f32..1e-20, 1e20f32..1e30], 6..60),
        u in 0.0f32..1.0,
        v in 0.0f32..1.0,
    ) {
        let values = &values[..values.len() / 6 * 6];
        let distribution = PiecewiseConstant2D::new(values, 6).unwrap();
        let ([x, y], within) = distribution.sample_cell(Vec2::new(u, v));
        prop_assert!(within.cmpge(Vec2::ZERO).all() && within.cmplt(Vec2::ONE).all());
        prop_assert!(values[6 * y + x] > 0.0 || values.iter().all(|&v| v == 0.0));
        // A difference, a quotient, a product and a sum of numbers up to 1 are rounded.
        let back = |cdf: &[f32], bin: usize, within: f32| cdf[bin] + (cdf[bin + 1] - cdf[bin]) * within;
        prop_assert!((back(&distribution.rows.values[7 * y..], x, within.x) - u).abs() <= 4.0 * f32::EPSILON);
        prop_assert!((back(&distribution.marginal.values, y, within.y) - v).abs() <= 4.0 * f32::EPSILON);
    }
}

#[test]
fn cells_get_their_share_of_samples() {
    let (width, height) = (24, 17);
    let values = uneven(width, height);
    let distribution = PiecewiseConstant2D::new(&values, width).unwrap();
    let n = 1 << 18;
    let mut counts = vec![0.0; values.len()];
    for i in 0..n {
        // Samples of different pixels are independent, as χ² demands.
        let u = Sampler::new(7).pixel_sample([i, 3], 0).d2(Dimension::FILM);
        let ([x, y], _) = distribution.sample_cell(u);
        counts[y * width + x] += 1.0;
    }
    let total: f64 = values.iter().map(|&v| f64::from(v)).sum();
    let expected: Vec<f64> = values.iter().map(|&v| f64::from(v) / total * f64::from(n)).collect();
    let p = chi2_p_value(&counts, &expected);
    assert!(p > 1e-4, "p = {p}");
}

#[test]
fn zeros_and_unusable_values_never_fail() {
    assert!(PiecewiseConstant2D::new(&[], 3).is_none());
    let uniform = PiecewiseConstant2D::new(&[0.0; 6], 3).unwrap();
    let (cell, within) = uniform.sample_cell(Vec2::new(0.25, 0.75));
    assert!(cell == [0, 1] && (within - Vec2::new(0.75, 0.5)).abs().max_element() <= 4.0 * f32::EPSILON);

    let odd = PiecewiseConstant2D::new(&[f32::NAN, 2.0, -3.0, f32::INFINITY], 4).unwrap();
    for u in [0.0, 0.5, BELOW_ONE, 1.0] {
        assert_eq!(odd.sample_cell(Vec2::splat(u)).0, [1, 0]);
    }
}

#[test]
fn a_first_cell_too_improbable_for_u_is_skipped() {
    let distribution = PiecewiseConstant2D::new(&[f32::MIN_POSITIVE, 0.0, 1.0e30], 3).unwrap();
    assert_eq!(distribution.sample_cell(Vec2::ZERO).0, [2, 0]);
}
