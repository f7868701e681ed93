//! Cells as tables hold them: key and sums in few bytes, for a frame has millions of them.
//!
//! Each number has as many bits as cells usually need; what does not fit is handed on, see [`Cell::add`].

use crate::grid::LeafCell;
use crate::sums::{Deposit, PLAIN_WEIGHT, WideSums};

/// A cell of a table.
pub(crate) trait Cell: Copy + Default + Send + Sync {
    /// An empty one.
    fn new(key: LeafCell) -> Self;
    /// What it is found by.
    fn key(&self) -> LeafCell;
    /// Whether this is its key.
    fn is(&self, key: &LeafCell) -> bool;
    /// Adds a deposit; false, and unchanged, if it does not fit.
    #[must_use]
    fn add(&mut self, deposit: &Deposit) -> bool;
    /// Adds sums; false, and unchanged, if they do not fit.
    #[must_use]
    fn merge(&mut self, sums: &WideSums) -> bool;
    /// Its sums, of which those that such a cell has not mean nothing.
    fn sums(&self) -> WideSums;
}

/// A cell all of whose deposits have weight 1, 40 bytes: the cell's coordinates; its level and attributes, and above them the
/// number of deposits; Σ radiance, and above it Σ luminance², from the lowest bits to the highest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PlainCell([u64; 5]);

/// A cell of deposits of any weight of which only the mean counts, 40 bytes: as [`PlainCell`], but without their number, and
/// above Σ weight · radiance is Σ weight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct MeanCell([u64; 5]);

/// Bits of the number of deposits.
const COUNT_BITS: u32 = 64 - LeafCell::UPPER_BITS;

/// Bits of a sum of radiance without weights: 2¹⁴ units.
const PLAIN_BITS: u32 = 44;
/// The same with weights: 2²² units.
const WEIGHED_BITS: u32 = 52;

/// Three numbers of `bits`, and above them one of three times the bits that are left.
#[inline]
fn join(low: [u64; 3], high: u64, bits: u32) -> [u64; 3] {
    let rest = 64 - bits;
    [low[0] | high << bits, low[1] | high >> rest << bits, low[2] | high >> (2 * rest) << bits]
}

/// Undoes [`join`].
#[inline]
fn split(words: [u64; 3], bits: u32) -> ([u64; 3], u64) {
    let rest = 64 - bits;
    let [a, b, c] = words.map(|word| word >> bits);
    (words.map(|word| word & ((1 << bits) - 1)), a | b << rest | c << (2 * rest))
}

/// The sums of numbers below 2⁶³, and whether they have no more than `bits`.
#[inline]
fn add<const N: usize>(a: [u64; N], b: [u64; N], bits: u32) -> ([u64; N], bool) {
    let sum: [u64; N] = std::array::from_fn(|i| a[i].wrapping_add(b[i]));
    (sum, sum.iter().fold(0, |bits, x| bits | x) >> bits == 0)
}

impl PlainCell {
    #[inline]
    fn add_words(&mut self, count: u64, rgb: [u64; 3], square: u64) -> bool {
        let [cell, upper, words @ ..] = self.0;
        let (own, own_square) = split(words, PLAIN_BITS);
        let (rgb, rgb_fits) = add(own, rgb, PLAIN_BITS);
        let ([square], square_fits) = add([own_square], [square], 3 * (64 - PLAIN_BITS));
        let (count, count_fits) = add_count(upper, count);
        let fits = rgb_fits & square_fits & count_fits;
        if fits {
            let [r, g, b] = join(rgb, square, PLAIN_BITS);
            self.0 = [cell, count, r, g, b];
        }
        fits
    }
}

/// Adds to the number above a key's upper half.
#[inline]
fn add_count(upper: u64, count: u64) -> (u64, bool) {
    let known = upper >> LeafCell::UPPER_BITS;
    let fits = count < (1 << COUNT_BITS) - known;
    (upper.wrapping_add(count << LeafCell::UPPER_BITS), fits)
}

impl Cell for PlainCell {
    #[inline]
    fn new(key: LeafCell) -> Self {
        Self([key.lower(), key.upper(), 0, 0, 0])
    }

    #[inline]
    fn key(&self) -> LeafCell {
        LeafCell::from_parts(self.0[1] & LeafCell::UPPER, self.0[0])
    }

    #[inline]
    fn is(&self, key: &LeafCell) -> bool {
        (self.0[0] ^ key.lower()) | (self.0[1] & LeafCell::UPPER ^ key.upper()) == 0
    }

    #[inline]
    fn add(&mut self, deposit: &Deposit) -> bool {
        deposit.narrow() && deposit.weight == PLAIN_WEIGHT && self.add_words(1, deposit.rgb, deposit.square)
    }

    fn merge(&mut self, sums: &WideSums) -> bool {
        let plain = WideSums::plain_weight(sums.count) == Some(sums.weight);
        let words = sums.words().filter(|_| plain);
        words.is_some_and(|[count, _, r, g, b, square]| self.add_words(count, [r, g, b], square))
    }

    #[inline]
    fn sums(&self) -> WideSums {
        let [_, upper, words @ ..] = self.0;
        let (rgb, square) = split(words, PLAIN_BITS);
        let count = upper >> LeafCell::UPPER_BITS;
        WideSums { count, weight: count * u64::from(PLAIN_WEIGHT), rgb: rgb.map(u128::from), square: square.into() }
    }
}

impl MeanCell {
    #[inline]
    fn add_words(&mut self, weight: u64, rgb: [u64; 3]) -> bool {
        let [cell, upper, words @ ..] = self.0;
        let (own, own_weight) = split(words, WEIGHED_BITS);
        let (rgb, rgb_fits) = add(own, rgb, WEIGHED_BITS);
        let ([weight], weight_fits) = add([own_weight], [weight], 3 * (64 - WEIGHED_BITS));
        let fits = rgb_fits & weight_fits;
        if fits {
            let [r, g, b] = join(rgb, weight, WEIGHED_BITS);
            self.0 = [cell, upper, r, g, b];
        }
        fits
    }
}

impl Cell for MeanCell {
    #[inline]
    fn new(key: LeafCell) -> Self {
        Self([key.lower(), key.upper(), 0, 0, 0])
    }

    #[inline]
    fn key(&self) -> LeafCell {
        LeafCell::from_parts(self.0[1], self.0[0])
    }

    #[inline]
    fn is(&self, key: &LeafCell) -> bool {
        (self.0[0] ^ key.lower()) | (self.0[1] ^ key.upper()) == 0
    }

    #[inline]
    fn add(&mut self, deposit: &Deposit) -> bool {
        self.add_words(deposit.weight.into(), deposit.rgb)
    }

    fn merge(&mut self, sums: &WideSums) -> bool {
        // All that fits is below 2⁶³.
        sums.words().is_some_and(|[_, weight, r, g, b, _]| self.add_words(weight, [r, g, b]))
    }

    #[inline]
    fn sums(&self) -> WideSums {
        let [_, _, words @ ..] = self.0;
        let (rgb, weight) = split(words, WEIGHED_BITS);
        WideSums { weight, rgb: rgb.map(u128::from), ..WideSums::default() }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::grid::CellKey;
    use crate::sums::Quantum;

    fn key() -> LeafCell {
        CellKey::new(-9, 0x7_1234_5678, [-5, 1 << 19, 77]).into()
    }

    /// Adds a deposit until it does not fit, and says how many did.
    fn fill<C: Cell + PartialEq + std::fmt::Debug>(radiance: f32) -> u64 {
        let deposit = Quantum::new(1.0).deposit(Vec3::new(radiance, 0.0, 0.5 * radiance), 1.0).unwrap();
        let (mut cell, mut count) = (C::new(key()), 0);
        let (mut one, mut none) = (WideSums::default(), WideSums::default());
        one.add(&deposit);
        while cell.add(&deposit) {
            count += 1;
        }
        assert_eq!(cell.sums().weight, count << 16);
        assert_eq!(cell.sums().rgb, deposit.rgb.map(|x| u128::from(count * x)));
        let full = cell;
        assert!(!cell.merge(&one));
        one.weight = u64::MAX;
        assert!(!cell.merge(&one));
        none.merge(&cell.sums());
        assert!(cell == full && none == full.sums() && cell.key() == key());
        count
    }

    #[test]
    fn sums_that_do_not_fit_are_left_alone() {
        // By the square and the number of deposits.
        let [bright, dark] = [100.0, 1e-3].map(fill::<PlainCell>);
        assert!(bright > 150 && bright < 200, "{bright}");
        assert!(dark > 40_000, "{dark}");
        // By radiance, 2²² units, and by weight, 2²⁰.
        assert_eq!([4096.0, 1e-3].map(fill::<MeanCell>), [(1 << 10) - 1, (1 << 20) - 1]);
    }

    #[test]
    fn plain_cells_take_what_has_weight_one() {
        let quantum = Quantum::new(1.0);
        let (mut plain, mut mean) = (PlainCell::new(key()), MeanCell::new(key()));
        let [one, half] = [1.0, 0.5].map(|weight| quantum.deposit(Vec3::splat(3.0), weight).unwrap());
        assert!(plain.add(&one) && mean.add(&one) && !plain.add(&half) && mean.add(&half));
        assert!(!plain.merge(&mean.sums()) && plain.merge(&plain.sums()));
        assert_eq!((plain.sums().count, plain.sums().weight), (2, 2 << 16));
        assert_eq!(mean.sums().weight, 3 << 15);
    }

    proptest! {
        #[test]
        fn keys_and_sums_are_kept_apart(
            level in -1100i32..1100, attributes in 0u64..1 << 35, c in any::<[i32; 3]>(),
            deposits in prop::collection::vec((0.0f32..300.0, 0.0f32..16.0), 0..20),
        ) {
            let key = CellKey::new(level, attributes, c.map(|x| x >> 11));
            let quantum = Quantum::new(1.0);
            let (mut plain, mut mean) = (PlainCell::new(key.into()), MeanCell::new(key.into()));
            let mut expected = [WideSums::default(); 2];
            for (radiance, weight) in deposits {
                let deposit = |weight| quantum.deposit(Vec3::new(radiance, 1.0, 0.0), weight).unwrap();
                if plain.add(&deposit(1.0)) {
                    expected[0].add(&deposit(1.0));
                }
                prop_assert!(mean.add(&deposit(weight)));
                expected[1].add(&deposit(weight));
            }
            prop_assert_eq!(plain.sums(), expected[0]);
            prop_assert_eq!((mean.sums().weight, mean.sums().rgb), (expected[1].weight, expected[1].rgb));
            prop_assert_eq!((plain.key().key(), mean.key().key()), (key, key));
            prop_assert!(plain.is(&key.into()) && mean.is(&key.into()));
            let other = key.parent();
            prop_assert!(!plain.is(&other.into()) && !mean.is(&other.into()));
        }
    }
}
