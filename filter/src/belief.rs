//! What to believe of a quantity that is not negative, from an uncertain estimate of it and from its surroundings.

/// The most probable value of a quantity b ≥ 0 with an estimate e of the standard error s, where B is believed of the
/// quantities around it: the peak of a normal density of e about b, times a density of b proportional to b exp(−b/B), whose
/// own peak is B,
///
/// b = (m + √(m² + 4s²)) / 2,  m = e − s²/B.
///
/// Where s is small this is e, where it is large B. Where nothing is believed of the surroundings, 0 without certainty.
#[inline]
pub fn most_probable(estimate: f64, standard_error: f64, around: f64) -> f64 {
    if standard_error == 0.0 {
        return estimate.max(0.0);
    }
    if around <= 0.0 {
        return 0.0;
    }
    let square = standard_error * standard_error;
    let m = estimate - square / around;
    let root = (m * m + 4.0 * square).sqrt();
    // Twice the same, the second without a difference of like numbers.
    if m > 0.0 { 0.5 * (m + root) } else { 2.0 * square / (root - m) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_believed_lies_between_the_estimate_and_the_surroundings() {
        assert!((most_probable(2.0, 1e-6, 0.5) - 2.0).abs() < 1e-6);
        assert!((most_probable(2.0, 1e6, 0.5) - 0.5).abs() < 1e-6);
        assert_eq!(most_probable(2.0, 0.0, 0.5), 2.0);
        assert_eq!(most_probable(-2.0, 0.0, 0.5), 0.0);
        assert_eq!(most_probable(2.0, 1.0, 0.0), 0.0);
        for estimate in [-3.0, 0.0, 0.4, 0.5, 7.0] {
            let mut last = 0.0;
            for around in [1e-30, 1e-3, 0.1, 1.0, 1e3, 1e30] {
                let found = most_probable(estimate, 0.7, around);
                // The peak of the density there: neither side is more probable.
                let density = |b: f64| b.ln() - b / around - 0.5 * ((b - estimate) / 0.7).powi(2);
                assert!(
                    found > last && density(found) >= density(found * 1.01) && density(found) >= density(found * 0.99)
                );
                last = found;
            }
        }
    }
}
