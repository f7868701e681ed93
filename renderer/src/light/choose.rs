//! A choice among few, in proportion to their weights.

/// The index in whose share of the sum `u` in [0, 1) falls, and how far into that share, in [0, 1): as uniform as `u` was,
/// less the digits spent. The probability of the choice is its weight over the sum. Weights are not negative.
///
/// `None`: all weights are 0.
#[inline(always)]
pub fn choose<const N: usize>(weights: &[f32; N], u: f32) -> Option<(usize, f32)> {
    let target = u * weights.iter().sum::<f32>();
    let mut before = 0.0;
    let mut chosen = None;
    for (index, &weight) in weights.iter().enumerate() {
        if weight > 0.0 {
            // Rounding may leave the target beyond the last share: the last index that has one takes it.
            chosen = Some((index, before));
            if target < before + weight {
                break;
            }
        }
        before += weight;
    }
    let (index, before) = chosen?;
    Some((index, ((target - before) / weights[index]).clamp(0.0, super::BELOW_ONE)))
}

#[cfg(test)]
mod tests {
    use super::choose;

    #[test]
    fn shares_are_in_proportion_and_rescaled() {
        let weights = [0.0, 1.0, 0.0, 2.0, 1.0, 0.0];
        for (u, index, rest) in [(0.0, 1, 0.0), (0.125, 1, 0.5), (0.25, 3, 0.0), (0.5, 3, 0.5), (0.875, 4, 0.5)] {
            assert_eq!(choose(&weights, u), Some((index, rest)), "{u}");
        }
        assert_eq!(choose(&[0.0; 3], 0.5), None);
    }

    #[test]
    fn what_has_no_weight_is_never_chosen() {
        // Sums that round: the last share ends before the sum of all.
        let weights = [0.1, 0.2, 0.3, 1e-9, 0.0];
        for u in [0.0, 0.5, super::super::BELOW_ONE] {
            let (index, rest) = choose(&weights, u).unwrap();
            assert!(weights[index] > 0.0 && (0.0..1.0).contains(&rest));
        }
        assert_eq!(choose(&[0.0, f32::from_bits(1), 0.0], 0.7).unwrap().0, 1);
    }
}
