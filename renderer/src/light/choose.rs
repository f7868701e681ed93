//! A choice among few, in proportion to their weights.

use crate::math::BELOW_ONE;

/// What was chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// Its index.
    pub index: usize,
    /// Its probability: its weight over the sum.
    pub pmf: f32,
    /// How far into its share of the sum the number falls, in [0, 1): as uniform as that was, less the digits spent.
    pub rest: f32,
}

/// The index in whose share of the sum `u` in [0, 1) falls. Weights are not negative.
///
/// `None`: all weights are 0.
#[inline(always)]
pub fn choose<const N: usize>(weights: &[f32; N], u: f32) -> Option<Choice> {
    let (mut begins, mut ends, mut sum) = ([0.0; N], [0.0; N], 0.0);
    for i in 0..N {
        begins[i] = sum;
        sum += weights[i];
        ends[i] = sum;
    }
    if sum <= 0.0 {
        return None;
    }
    let target = u * sum;
    // Shares that end before the target are counted, rather than searched for the first one that does not: where a search
    // ends is anyone's guess. What has no weight ends where it begins and is never the first that is left.
    let ended = ends.iter().map(|&end| u32::from(end <= target)).sum::<u32>() as usize;
    let index = if ended < N { ended } else { last(weights)? };
    let rest = ((target - begins[index]) / weights[index]).clamp(0.0, BELOW_ONE);
    Some(Choice { index, pmf: weights[index] / sum, rest })
}

/// Rounding may leave the target beyond the last share: the last index that has one takes it.
#[cold]
fn last(weights: &[f32]) -> Option<usize> {
    weights.iter().rposition(|&weight| weight > 0.0)
}

#[cfg(test)]
mod tests {
    use super::{Choice, choose};
    use crate::math::BELOW_ONE;

    #[test]
    fn shares_are_in_proportion_and_rescaled() {
        let weights = [0.0, 1.0, 0.0, 2.0, 1.0, 0.0];
        for (u, index, rest) in [(0.0, 1, 0.0), (0.125, 1, 0.5), (0.25, 3, 0.0), (0.5, 3, 0.5), (0.875, 4, 0.5)] {
            let pmf = weights[index] / 4.0;
            assert_eq!(choose(&weights, u), Some(Choice { index, pmf, rest }), "{u}");
        }
        assert_eq!(choose(&[0.0; 3], 0.5), None);
    }

    #[test]
    fn what_has_no_weight_is_never_chosen() {
        // Sums that round: the last share ends before the sum of all.
        let weights = [0.1, 0.2, 0.3, 1e-9, 0.0];
        for u in [0.0, 0.5, BELOW_ONE] {
            let Choice { index, rest, .. } = choose(&weights, u).unwrap();
            assert!(weights[index] > 0.0 && (0.0..1.0).contains(&rest));
        }
        assert_eq!(choose(&[0.0, f32::from_bits(1), 0.0], 0.7).unwrap().index, 1);
    }
}
