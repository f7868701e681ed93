//! Weights of multiple importance sampling.

/// Power heuristic (β = 2) for one sample each of two techniques: the weight of the one with density `a` against the
/// one with density `b`, in [0, 1]; 0 if `a` is 0.
///
/// The ratio is squared rather than the densities, whose squares may overflow.
///
/// **Source**: \[Veach97\] section 9.2.4.
#[inline]
pub fn power_heuristic(a: f32, b: f32) -> f32 {
    if a > 0.0 {
        let ratio = b / a;
        1.0 / (1.0 + ratio * ratio)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::power_heuristic;

    #[test]
    fn the_weights_of_both_techniques_sum_to_one_at_the_extremes() {
        let extremes = [f32::from_bits(1), f32::MIN_POSITIVE, 1e-30, 1.0, 3.0, 1e30, f32::MAX];
        for a in extremes {
            for b in extremes {
                let sum = power_heuristic(a, b) + power_heuristic(b, a);
                // Two quotients of three roundings each, and a sum.
                assert!((sum - 1.0).abs() < 4.0 * f32::EPSILON, "{a} {b}: {sum}");
            }
            assert_eq!((power_heuristic(a, 0.0), power_heuristic(0.0, a)), (1.0, 0.0));
        }
        assert_eq!(power_heuristic(0.0, 0.0), 0.0);
    }
}
