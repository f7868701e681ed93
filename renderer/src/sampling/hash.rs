//! Hashes of integers: a bijective 64-bit mix, and the nested hash that is an Owen scramble of reversed bits.

/// A bijection of 64-bit words in which every input bit flips every output bit with probability close to 1/2, also for
/// inputs that are small integers or differ in one bit.
///
/// **Source**: the finaliser "moremur" of Pelle Evensen, of the family of \[Steele14\] `mix64`.
#[inline]
pub const fn mix64(mut x: u64) -> u64 {
    x = (x ^ (x >> 27)).wrapping_mul(0x3c79_ac49_2ba7_b653);
    x = (x ^ (x >> 33)).wrapping_mul(0x1c69_b3f7_4ac4_ae35);
    x ^ (x >> 27)
}

/// A seeded bijection of 32-bit words in which each output bit depends only on the input bits at and below it: on words
/// with reversed bits, a nested uniform scramble in base 2.
///
/// **Source**: \[Laine11\] section 3.1, \[Burley20\] section 3, with the steps and constants that \[Vegdahl21\] found to
/// have the least bias. The seed must come from a good hash.
#[inline]
pub(super) const fn nested_hash(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::stats;

    #[test]
    fn flipping_one_bit_flips_every_bit_of_the_mix_half_the_time() {
        // Over n random words each of the 64 × 64 flip counts is binomial(n, 1/2); with 4096 of them, none should leave
        // 5.5 standard deviations (probability 1.6e-4 for a perfect mix).
        let n = 4096_u64;
        let limit = 5.5 * (n as f64 / 4.0).sqrt();
        for input in 0..64 {
            let mut flips = [0_u32; 64];
            for i in 0..n {
                let changed = mix64(i) ^ mix64(i ^ (1 << input));
                for (bit, count) in flips.iter_mut().enumerate() {
                    *count += (changed >> bit & 1) as u32;
                }
            }
            for count in flips {
                assert!((f64::from(count) - n as f64 / 2.0).abs() < limit, "bit {input}: {count} of {n}");
            }
        }
    }

    #[test]
    fn the_nested_hash_is_nested_and_bijective() {
        for seed in [0, 1, 0xdead_beef, u32::MAX] {
            for depth in 1..=12 {
                // The lowest `depth` bits of the output are a permutation of the lowest `depth` bits of the input, and
                // what is above does not matter.
                let mask = (1_u32 << depth) - 1;
                let mut seen = vec![false; 1 << depth];
                for x in 0..=mask {
                    let y = nested_hash(x, seed) & mask;
                    assert!(!std::mem::replace(&mut seen[y as usize], true));
                    assert_eq!(y, nested_hash(x | 0xabcd_e000 & !mask, seed) & mask);
                }
            }
        }
    }

    #[test]
    fn the_coins_of_the_nested_hash_are_fair_and_pairwise_independent() {
        // An Owen scramble flips the bit at depth d by a coin of its own for each of the 2^d prefixes. The variance of a
        // scrambled net depends on the coins by pairs only. 31 coins of five levels make 465 pairs.
        let coins: Vec<(u32, u32)> =
            (0..5).flat_map(|depth| (0..1 << depth).map(move |prefix| (prefix, depth))).collect();
        let outcomes: Vec<Vec<usize>> = (0..1 << 12)
            .map(|i| {
                let seed = mix64(i) as u32;
                coins.iter().map(|&(prefix, depth)| (nested_hash(prefix, seed) >> depth & 1) as usize).collect()
            })
            .collect();
        for a in 0..coins.len() {
            for b in 0..a {
                let mut counts = [0.0; 4];
                for coins in &outcomes {
                    counts[coins[a] * 2 + coins[b]] += 1.0;
                }
                let p = stats::chi2_p_value(&counts, &[outcomes.len() as f64 / 4.0; 4]);
                // With 465 pairs, chance alone gives a p below this in one of 2000 sets of seeds; this is one fixed set.
                assert!(p > 1e-6, "{:?} {:?}: p = {p}", coins[a], coins[b]);
            }
        }
    }
}
