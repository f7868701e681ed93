//! Sums whose bits do not depend on the order of what is added, so that slices of a frame add up to the whole.
//!
//! Binary floating point is cut at fixed places into bins of 40 bits. A sum keeps two bins as integers: that of its largest
//! term so far and the one below; what a term has below these is dropped, term by term. A larger term moves both down.
//! What a bin holds in the end is the same for every order, because bins that are kept at the end were kept from the
//! start. A dropped tail is less than 2⁻⁴⁰ of the sum's largest term.
//!
//! **Source**: the binned sums of \[Ahrens20\], with integers in place of their floating-point bins.

/// Bits of a bin.
const WIDTH: i32 = 40;

/// Terms that a sum takes without overflow: 2⁶³⁻⁴⁰.
pub const MOST_TERMS: u64 = 1 << 23;

/// Sum of vectors whose components share their bins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sum<const N: usize> {
    /// The upper bin's lowest bit has the value 2^(WIDTH · top).
    top: i32,
    /// Upper and lower bin of each component.
    bins: [[i64; 2]; N],
}

impl<const N: usize> Default for Sum<N> {
    fn default() -> Self {
        Self { top: EMPTY, bins: [[0; 2]; N] }
    }
}

impl<const N: usize> Sum<N> {
    /// Words that a sum is stored as.
    pub const WORDS: usize = 1 + 2 * N;

    /// Adds a finite term.
    #[inline]
    pub fn add(&mut self, term: [f64; N]) {
        let largest = term.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
        if largest == 0.0 {
            return;
        }
        self.raise(bin(largest));
        // Exact: powers of two, and both casts cut at a bin's border.
        let unit = power(-WIDTH * self.top);
        for (bins, x) in self.bins.iter_mut().zip(term) {
            let scaled = x * unit;
            let upper = scaled as i64;
            bins[0] += upper;
            bins[1] += ((scaled - upper as f64) * power(WIDTH)) as i64;
        }
    }

    /// Adds the terms of another sum.
    pub fn merge(&mut self, other: &Self) {
        let mut other = *other;
        self.raise(other.top);
        other.raise(self.top);
        for (bins, others) in self.bins.iter_mut().zip(other.bins) {
            // What was stored by somebody else may be anything.
            *bins = [bins[0].saturating_add(others[0]), bins[1].saturating_add(others[1])];
        }
    }

    /// Moves the bins so that the upper one is at least `top`.
    #[inline]
    fn raise(&mut self, top: i32) {
        if top > self.top {
            let next = top - self.top == 1;
            for bins in &mut self.bins {
                *bins = [0, if next { bins[0] } else { 0 }];
            }
            self.top = top;
        }
    }

    /// The sum, rounded once.
    pub fn value(&self) -> [f64; N] {
        let unit = power(WIDTH * (self.top - 1));
        let whole = |[upper, lower]: [i64; 2]| (i128::from(upper) << WIDTH) + i128::from(lower);
        self.bins.map(|bins| whole(bins) as f64 * unit)
    }

    /// Appends the sum's [`Self::WORDS`], to be stored.
    pub fn store(&self, words: &mut Vec<u64>) {
        words.push(i64::from(self.top) as u64);
        words.extend(self.bins.as_flattened().iter().map(|x| *x as u64));
    }

    /// Takes what [`Self::store`] appended off the front; `None` where no sum has such words.
    pub fn load(words: &mut &[u64]) -> Option<Self> {
        let (own, rest) = words.split_at_checked(Self::WORDS)?;
        *words = rest;
        let top = i32::try_from(own[0] as i64).ok().filter(|top| *top == EMPTY || (LOWEST..=HIGHEST).contains(top))?;
        Some(Self { top, bins: std::array::from_fn(|i| [own[1 + 2 * i] as i64, own[2 + 2 * i] as i64]) })
    }
}

/// Below the bin of every number.
const EMPTY: i32 = LOWEST - 2;

/// The bin of the largest number.
const HIGHEST: i32 = 1024 / WIDTH;

/// The lowest bin whose unit has a finite reciprocal. Smaller numbers go below it, and those under 2⁻¹⁰⁰⁰ are dropped.
const LOWEST: i32 = -24;

/// The bin that has the leading bit of a positive number.
#[inline]
fn bin(x: f64) -> i32 {
    let exponent = (x.to_bits() >> 52) as i32 - 1023;
    exponent.div_euclid(WIDTH).max(LOWEST)
}

/// 2^n.
#[inline]
fn power(n: i32) -> f64 {
    match n {
        -1022..=1023 => f64::from_bits(((n + 1023) as u64) << 52),
        _ => 2f64.powi(n),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Terms of all magnitudes that f32 has, both signs.
    fn terms(count: u64, seed: u64) -> Vec<[f64; 3]> {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let x = f32::from_bits((state >> 32) as u32);
            if x.is_finite() { f64::from(x) } else { 1.0 }
        };
        (0..count).map(|_| [next(), next(), next()]).collect()
    }

    fn sum(terms: &[[f64; 3]]) -> Sum<3> {
        let mut sum = Sum::default();
        terms.iter().for_each(|term| sum.add(*term));
        sum
    }

    #[test]
    fn no_order_and_no_grouping_changes_a_bit() {
        for seed in 0..200 {
            let mut terms = terms(60, seed);
            let whole = sum(&terms);
            for parts in [2, 3, 7] {
                let mut merged = Sum::default();
                terms.chunks(60 / parts + 1).for_each(|part| merged.merge(&sum(part)));
                assert_eq!(merged, whole);
            }
            terms.reverse();
            assert_eq!(sum(&terms), whole);
            terms.sort_by(|a, b| a[0].total_cmp(&b[0]));
            assert_eq!(sum(&terms), whole);
            let mut words = Vec::new();
            whole.store(&mut words);
            assert_eq!(Sum::load(&mut words.as_slice()), Some(whole));
        }
    }

    #[test]
    fn the_sum_is_right_to_two_to_the_minus_forty_of_the_largest_term() {
        for seed in 0..200 {
            let terms = terms(1 + seed % 50, 1000 + seed);
            let largest = terms.as_flattened().iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
            let sum = sum(&terms).value();
            for channel in 0..3 {
                // In f64 the naive sum of so few terms is nearer than the bound that is tested.
                let naive: f64 = terms.iter().map(|term| term[channel]).sum();
                let error = (sum[channel] - naive).abs();
                assert!(error <= terms.len() as f64 * largest * power(-WIDTH), "{error:e} of {largest:e}");
            }
        }
    }

    #[test]
    fn sums_of_like_terms_are_exact() {
        let mut sum = Sum::default();
        (0..100_000).for_each(|_| sum.add([0.1f32.into(), 1.0, 3e-8f32.into()]));
        assert_eq!(sum.value()[0], 100_000.0 * f64::from(0.1f32));
        assert_eq!(sum.value()[1], 100_000.0);
        assert_eq!(Sum::<3>::default().value(), [0.0; 3]);
    }

    #[test]
    fn the_ends_of_the_range_are_finite_and_kept() {
        for x in [f64::MIN_POSITIVE, 5e-324, 1e-150, f64::from(f32::MAX), f64::from(f32::MAX).powi(2), 1e300] {
            let value = sum(&[[x; 3], [-x; 3], [x; 3]]).value()[0];
            assert!((value - x).abs() <= x * power(-WIDTH) || x < power(-1000), "{x:e}: {value:e}");
            assert!(value.is_finite());
        }
    }

    #[test]
    fn as_many_terms_as_are_promised_fit() {
        // As large as the terms of a bin get.
        let term = power(WIDTH).next_down();
        let mut half = sum(&[[term; 3]]);
        for _ in 0..22 {
            let same = half;
            half.merge(&same);
        }
        let mut whole = half;
        whole.merge(&half);
        assert_eq!(MOST_TERMS, 1 << 23);
        assert!(whole.value()[0] == 2.0 * half.value()[0] && whole.bins[0][0] < i64::MAX);
        assert!((whole.value()[0] / term / MOST_TERMS as f64 - 1.0).abs() < 1e-11);
    }

    #[test]
    fn words_of_no_sum_are_refused() {
        let mut words = Vec::new();
        Sum::<3>::default().store(&mut words);
        words[0] = 1000;
        assert_eq!(Sum::<3>::load(&mut words.as_slice()), None);
        assert_eq!(Sum::<3>::load(&mut &words[..6]), None);
    }
}
