//! Sums in which no order can change a bit.

use glam::{DVec3, Vec3};

/// Radiance in whole numbers.
///
/// A deposit is rounded to multiples of `unit` · 2⁻³⁰, its squared luminance to multiples of (`unit` · 2⁻¹⁸)², its weight to
/// multiples of 2⁻¹⁶. Rounding is to nearest and happens once per deposit; everything after it is exact, so sums are the
/// same in any order and any grouping. Radiance below `unit` · 2⁻³¹ reads as black: `unit` should be near the mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantum {
    rgb: f64,
    square: f64,
    largest: f32,
}

/// The luminance of linear Rec.709, by which noise is judged.
pub const LUMINANCE: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

const RGB_BITS: i32 = 30;
const SQUARE_BITS: i32 = 36;
const WEIGHT_BITS: i32 = 16;
/// Deposits up to 2²⁰ units: their squares, 2⁴⁰⁺³⁶ quanta, need more than 64 bits and go to the wide sums.
const LARGEST_BITS: i32 = 20;
/// Largest weight; the smallest is a quantum, so that no deposit vanishes.
const LARGEST_WEIGHT: f32 = 16.0;
/// What a cell's own sums stay below.
const LIMIT: u64 = 1 << 63;

impl Quantum {
    /// For radiance of the order of `unit`, of which only the power of two counts.
    pub fn new(unit: f32) -> Self {
        let unit = if unit.is_normal() && unit > 0.0 { unit } else { 1.0 };
        let exponent = (f64::from(unit).to_bits() >> 52) as i32 - 1023;
        Self {
            rgb: 2f64.powi(RGB_BITS - exponent),
            square: 2f64.powi(SQUARE_BITS - 2 * exponent),
            largest: 2f64.powi(LARGEST_BITS + exponent).min(f64::from(f32::MAX)) as f32,
        }
    }

    /// One deposit, of a weight that is cut to [2⁻¹⁶, 16]. `None` for radiance that is not finite, negative, subnormal, or
    /// above 2²⁰ units: no cell may take it.
    #[inline]
    pub fn deposit(&self, radiance: Vec3, weight: f32) -> Option<Deposit> {
        // Comparisons with NaN fail, and infinities are above the largest.
        let within = |x: f32| (0.0..=self.largest).contains(&x) && (x >= f32::MIN_POSITIVE || x == 0.0);
        if !(within(radiance.x) && within(radiance.y) && within(radiance.z)) {
            return None;
        }
        const QUANTA: f32 = (1 << WEIGHT_BITS) as f32;
        let weight = if weight.is_nan() { 1.0 } else { (weight * QUANTA).clamp(1.0, LARGEST_WEIGHT * QUANTA) + 0.5 };
        let weight = weight as u32;
        let share = f64::from(weight as f32 / QUANTA);
        let radiance = radiance.as_dvec3();
        let luminance = radiance.dot(LUMINANCE);
        // At most 2²⁰⁺³⁰⁺⁴ quanta: signed conversions are one instruction.
        let whole = |x: f64| (x + 0.5) as i64 as u64;
        let square = luminance * luminance * self.square * share + 0.5;
        Some(Deposit {
            weight,
            rgb: (radiance * (self.rgb * share)).to_array().map(whole),
            square: if square < LIMIT as f64 { square as i64 as u64 } else { square as u128 as u64 },
            square_above: if square < LIMIT as f64 { 0 } else { (square as u128 >> 64) as u32 },
        })
    }

    /// Radiance per quantum of a sum.
    pub fn radiance(&self) -> f64 {
        self.rgb.recip()
    }

    /// Squared radiance per quantum of a sum of squares.
    pub fn squared_radiance(&self) -> f64 {
        self.square.recip()
    }

    /// Weight per quantum of a sum of weights.
    pub fn weight(&self) -> f64 {
        2f64.powi(-WEIGHT_BITS)
    }
}

/// What one path brings to a cell, in quanta.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Deposit {
    pub(crate) rgb: [u64; 3],
    /// Up to 2⁸⁰: the lower 64 bits and those above.
    pub(crate) square: u64,
    square_above: u32,
    pub(crate) weight: u32,
}

impl Deposit {
    /// Whether its square is small enough for a cell's own sums.
    #[inline]
    pub(crate) fn narrow(&self) -> bool {
        self.square_above == 0 && self.square < LIMIT
    }
}

/// Sums of a cell that hold what cells usually hold; more is handed to [`WideSums`].
pub trait CellSums: Copy + Default + std::fmt::Debug + Send + Sync {
    /// Adds other sums; false, and unchanged, if they do not fit.
    #[must_use]
    fn merge(&mut self, sums: &WideSums) -> bool;
    /// The same sums without a limit.
    fn wide(&self) -> WideSums;
}

/// The sums of a cell, 48 bytes, each below 2⁶³.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sums(
    /// Deposits, Σ weight, Σ weight · radiance, Σ weight · luminance².
    [u64; 6],
);

/// Weight 1 in quanta.
pub(crate) const PLAIN_WEIGHT: u32 = 1 << WEIGHT_BITS;

/// The same sums without a limit: 2⁴⁰ of the largest deposits fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WideSums {
    /// Deposits.
    pub count: u64,
    /// Σ weight.
    pub weight: u64,
    /// Σ weight · radiance.
    pub rgb: [u128; 3],
    /// Σ weight · luminance².
    pub square: u128,
}

impl CellSums for Sums {
    fn merge(&mut self, sums: &WideSums) -> bool {
        // All that fits is below 2⁶³.
        sums.words().is_some_and(|words| self.add_words(words))
    }

    #[inline]
    fn wide(&self) -> WideSums {
        let Self([count, weight, r, g, b, square]) = *self;
        WideSums { count, weight, rgb: [r, g, b].map(u128::from), square: square.into() }
    }
}

impl Sums {
    #[inline]
    fn add_words(&mut self, words: [u64; 6]) -> bool {
        // Both below 2⁶³, so nothing wraps, and the top bits say what has grown too large.
        let sum: [u64; 6] = std::array::from_fn(|i| self.0[i].wrapping_add(words[i]));
        let fits = sum.iter().fold(0, |bits, x| bits | x) < LIMIT;
        if fits {
            self.0 = sum;
        }
        fits
    }
}

impl WideSums {
    /// Adds a deposit.
    pub fn add(&mut self, deposit: &Deposit) {
        let rgb = deposit.rgb.map(u128::from);
        let square = u128::from(deposit.square_above) << 64 | u128::from(deposit.square);
        self.merge(&Self { count: 1, weight: deposit.weight.into(), rgb, square });
    }

    /// The weight of so many deposits of weight 1; `None` for more than there can be.
    #[inline]
    pub fn plain_weight(count: u64) -> Option<u64> {
        count.checked_mul(PLAIN_WEIGHT.into())
    }

    /// Count, weight, radiance and square if all are below 2⁶³.
    #[inline]
    pub fn words(&self) -> Option<[u64; 6]> {
        let [r, g, b] = self.rgb;
        let words = [self.count.into(), self.weight.into(), r, g, b, self.square];
        words.iter().all(|x| *x < LIMIT.into()).then(|| words.map(|x| x as u64))
    }

    /// Mean radiance, Σ weight · radiance / Σ weight.
    #[inline]
    pub fn mean(&self, quantum: &Quantum) -> Vec3 {
        let weight = self.weight as f64 * quantum.weight();
        (DVec3::from_array(self.rgb.map(float)) * quantum.radiance() / weight).as_vec3()
    }

    /// Adds other sums. What others have stored may be of any size.
    pub fn merge(&mut self, other: &Self) {
        self.count = self.count.saturating_add(other.count);
        self.weight = self.weight.saturating_add(other.weight);
        for (sum, x) in self.rgb.iter_mut().zip(other.rgb) {
            *sum = sum.saturating_add(x);
        }
        self.square = self.square.saturating_add(other.square);
    }
}

/// Nearest number; nearly all are short, for which there are instructions.
#[inline]
pub(crate) fn float(x: u128) -> f64 {
    #[cold]
    fn long(x: u128) -> f64 {
        x as f64
    }
    if x >> 63 == 0 { x as i64 as f64 } else { long(x) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn what_no_cell_may_take_is_refused() {
        let quantum = Quantum::new(1.0);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 1e30, 1e-40] {
            for channel in 0..3 {
                let mut rgb = [1.0; 3];
                rgb[channel] = bad;
                assert_eq!(quantum.deposit(Vec3::from_array(rgb), 1.0), None, "{bad} in channel {channel}");
            }
        }
        assert!(quantum.deposit(Vec3::ZERO, 1.0).is_some());
    }

    #[test]
    fn means_are_weighted() {
        let quantum = Quantum::new(1.0);
        let mut sums = WideSums::default();
        for (radiance, weight) in [(Vec3::new(1.0, 2.0, 0.0), 3.0), (Vec3::new(5.0, 0.0, 4.0), 1.0)] {
            sums.add(&quantum.deposit(radiance, weight).unwrap());
        }
        assert_eq!(sums.mean(&quantum), Vec3::new(2.0, 1.5, 1.0));
    }

    #[test]
    fn two_to_the_33_of_the_largest_deposits_are_summed_exactly() {
        let quantum = Quantum::new(1.0);
        let deposit = quantum.deposit(Vec3::splat(1_048_576.0), 16.0).unwrap();
        let mut wide = WideSums::default();
        wide.add(&deposit);
        for _ in 0..33 {
            let copy = wide;
            wide.merge(&copy);
        }
        assert_eq!(wide.count, 1 << 33);
        assert_eq!(wide.weight, u64::from(deposit.weight) << 33);
        assert_eq!(wide.rgb, [u128::from(deposit.rgb[0]) << 33; 3]);
        assert_eq!(wide.square, 1 << (36 + 40 + 4 + 33));
    }

    #[test]
    fn sums_that_do_not_fit_are_left_alone() {
        let mut part = WideSums::default();
        part.add(&Quantum::new(1.0).deposit(Vec3::splat(10_000.0), 1.0).unwrap());
        let (mut sums, mut expected) = (Sums::default(), WideSums::default());
        while sums.merge(&part) {
            expected.merge(&part);
        }
        assert!(expected.count > 0);
        assert_eq!(sums.wide(), expected);
        let before = sums;
        assert!(!sums.merge(&before.wide()));
        assert_eq!(sums, before);
    }

    proptest! {
        #[test]
        fn no_order_or_grouping_changes_a_bit(values in prop::collection::vec(0.0f32..1e4, 1..40), cut in 0usize..40) {
            let quantum = Quantum::new(0.25);
            let deposits: Vec<Deposit> =
                values.iter().enumerate().map(|(i, &x)| quantum.deposit(Vec3::new(x, 1.0, x / 3.0), i as f32 / 7.0).unwrap()).collect();
            let sum = |deposits: &[Deposit]| deposits.iter().fold(WideSums::default(), |mut sum, d| { sum.add(d); sum });
            let (a, b) = deposits.split_at(cut.min(deposits.len()));
            let mut grouped = sum(b);
            grouped.merge(&sum(a));
            prop_assert_eq!(grouped, sum(&deposits));
        }

        #[test]
        fn deposits_are_rounded_to_their_quantum(x in 0.0f32..1000.0) {
            let quantum = Quantum::new(1.0);
            let deposit = quantum.deposit(Vec3::splat(x), 1.0).unwrap();
            let error = deposit.rgb[0] as f64 * quantum.radiance() - f64::from(x);
            prop_assert!(error.abs() <= 0.5 * quantum.radiance());
        }
    }
}
