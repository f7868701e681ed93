//! Exact sums: in whole quanta, the same in any order.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};

use glam::{DVec3, Vec3};

/// Radiance in whole quanta of `unit` · 2⁻³⁰; squared luminance in quanta of (`unit` · 2⁻²⁰)².
#[derive(Clone, Copy, Debug)]
pub struct Quantum {
    per_radiance: f64,
    per_square: f64,
    largest: f32,
}

/// The luminance of linear Rec.709.
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// What one path brings to a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Deposit {
    rgb: [u64; 3],
    square: u128,
}

impl Quantum {
    /// For radiance of the order of `unit`, of which only the power of two counts.
    pub fn new(unit: f32) -> Self {
        let exponent = (f64::from(unit).to_bits() >> 52) as i32 - 1023;
        Self {
            per_radiance: 2f64.powi(30 - exponent),
            per_square: 2f64.powi(2 * (20 - exponent)),
            largest: 2f64.powi(20 + exponent).min(f64::from(f32::MAX)) as f32,
        }
    }

    /// In quanta. `None` for what is not finite, negative, subnormal, or above 2²⁰ units: no cell may take it.
    #[inline]
    pub fn deposit(&self, radiance: Vec3) -> Option<Deposit> {
        // Comparisons with NaN are false.
        let fits = |x: f32| x == 0.0 || (x >= f32::MIN_POSITIVE && x <= self.largest);
        if !radiance.to_array().into_iter().all(fits) {
            return None;
        }
        let luminance = f64::from(radiance.dot(LUMINANCE));
        Some(Deposit {
            rgb: radiance.as_dvec3().to_array().map(|x| (x * self.per_radiance + 0.5) as u64),
            square: (luminance * luminance * self.per_square + 0.5) as u128,
        })
    }
}

/// The sums and the counter of a cell, which threads add to at once. A cache line.
///
/// A sum of radiance has 96 bits and holds 2⁴⁶ of the largest deposits; that of squares has 128 and holds 2⁴⁸.
#[derive(Debug, Default)]
#[repr(align(64))]
pub struct Cell {
    low: [AtomicU64; 3],
    high: [AtomicU32; 3],
    /// The pass that the cell was last used in; 0: none.
    used: AtomicU32,
    count: AtomicU64,
    square_low: AtomicU64,
    square_high: AtomicU64,
}

impl Cell {
    /// Adds a deposit of a pass. What wraps in the lower half carries to the upper: additions commute, so no order counts.
    #[inline]
    pub fn add(&self, deposit: &Deposit, pass: u32, square: bool) {
        for ((low, high), x) in self.low.iter().zip(&self.high).zip(deposit.rgb) {
            if low.fetch_add(x, Relaxed).checked_add(x).is_none() {
                high.fetch_add(1, Relaxed);
            }
        }
        if square {
            let (low, mut high) = (deposit.square as u64, (deposit.square >> 64) as u64);
            high += u64::from(self.square_low.fetch_add(low, Relaxed).checked_add(low).is_none());
            if high > 0 {
                self.square_high.fetch_add(high, Relaxed);
            }
        }
        self.count.fetch_add(1, Relaxed);
        self.used.store(pass, Relaxed);
    }

    /// Deposits so far.
    #[inline]
    pub fn count(&self) -> u64 {
        self.count.load(Relaxed)
    }

    /// The pass that the cell was last used in; 0: none.
    #[inline]
    pub fn used(&self) -> u32 {
        self.used.load(Relaxed)
    }

    /// Mean radiance; NaN if there was no deposit.
    #[inline]
    pub fn mean(&self, quantum: &Quantum) -> DVec3 {
        let sum = |i: usize| {
            let bits = u128::from(self.high[i].load(Relaxed)) << 64 | u128::from(self.low[i].load(Relaxed));
            bits as f64
        };
        DVec3::new(sum(0), sum(1), sum(2)) / (self.count() as f64 * quantum.per_radiance)
    }

    /// Variance of the mean over its square, by luminance. Infinite as long as one deposit leaves it unknown.
    #[inline]
    pub fn relative_variance(&self, quantum: &Quantum) -> f64 {
        let n = self.count() as f64;
        let bits = u128::from(self.square_high.load(Relaxed)) << 64 | u128::from(self.square_low.load(Relaxed));
        let mean = self.mean(quantum).dot(LUMINANCE.as_dvec3());
        let variance = (bits as f64 / (n * quantum.per_square) - mean * mean).max(0.0);
        if n < 2.0 {
            f64::INFINITY
        } else if mean == 0.0 {
            0.0
        } else {
            variance / ((n - 1.0) * mean * mean)
        }
    }

    /// Forgets deposits, but not when they came.
    pub fn clear(&mut self) {
        *self = Self { used: AtomicU32::new(self.used()), ..Self::default() };
    }

    /// Forgets all.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}

/// What one slot gets, in quanta of `unit` · 2⁻²⁴, for sums in any order. A summand is limited to 2⁸⁰ units, so that 2²³ of
/// them fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SlotSum([i128; 3]);

const SLOT_SHIFT: i32 = 6;

impl SlotSum {
    /// Adds radiance; false, and unchanged, if it is not a number.
    #[inline]
    #[must_use]
    pub fn add(&mut self, radiance: DVec3, quantum: &Quantum) -> bool {
        if radiance.is_nan() {
            return false;
        }
        const LIMIT: f64 = (1u128 << (80 + 30 - SLOT_SHIFT)) as f64;
        let scaled = radiance * (quantum.per_radiance / f64::from(1 << SLOT_SHIFT));
        for (sum, x) in self.0.iter_mut().zip(scaled.to_array()) {
            *sum += (x.clamp(-LIMIT, LIMIT) + 0.5f64.copysign(x)) as i128;
        }
        true
    }

    /// Adds another sum.
    pub fn merge(&mut self, other: &Self) {
        for (sum, x) in self.0.iter_mut().zip(other.0) {
            *sum = sum.saturating_add(x);
        }
    }

    /// The sum.
    pub fn get(&self, quantum: &Quantum) -> Vec3 {
        (DVec3::from_array(self.0.map(|x| x as f64)) * (f64::from(1 << SLOT_SHIFT) / quantum.per_radiance)).as_vec3()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_cell_may_take_is_refused() {
        let quantum = Quantum::new(1.0);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 1e30, 1e-40, -1e-40] {
            for channel in 0..3 {
                let mut rgb = [1.0; 3];
                rgb[channel] = bad;
                assert_eq!(quantum.deposit(Vec3::from_array(rgb)), None, "{bad} in channel {channel}");
            }
        }
        assert!(quantum.deposit(Vec3::ZERO).is_some());
    }

    #[test]
    fn two_to_the_33_of_the_largest_deposits_are_summed_exactly() {
        let quantum = Quantum::new(1.0);
        let deposit = quantum.deposit(Vec3::splat(1_048_576.0)).unwrap();
        // 2³³ deposits, 2¹³ at a time: so many fit in the 64 bits of a deposit.
        let many = Deposit { rgb: deposit.rgb.map(|x| x << 13), square: deposit.square << 13 };
        let cell = Cell::default();
        for _ in 0..1 << 20 {
            cell.add(&many, 1, true);
        }
        // The counter counted 2²⁰: the mean is that of 2¹³ in one.
        assert_eq!(cell.mean(&quantum), DVec3::splat(f64::from(1u32 << 20) * 8192.0));
        cell.count.store(1 << 33, Relaxed);
        assert_eq!(cell.mean(&quantum), DVec3::splat(1_048_576.0));
        assert!(cell.relative_variance(&quantum) < 1e-15);
    }

    #[test]
    fn the_relative_variance_is_that_of_the_mean() {
        let quantum = Quantum::new(0.5);
        let cell = Cell::default();
        for x in [1.0, 2.0, 3.0, 6.0] {
            cell.add(&quantum.deposit(Vec3::splat(x)).unwrap(), 1, true);
        }
        // Mean 3, Σ (x − 3)² = 14, variance of the mean 14/(4·3).
        assert!((cell.relative_variance(&quantum) - 14.0 / 12.0 / 9.0).abs() < 1e-6);
    }

    #[test]
    fn one_deposit_or_none_leaves_the_variance_unknown_and_black_ones_do_not() {
        let quantum = Quantum::new(1.0);
        let cell = Cell::default();
        assert_eq!(cell.relative_variance(&quantum), f64::INFINITY);
        cell.add(&quantum.deposit(Vec3::ZERO).unwrap(), 1, true);
        assert_eq!(cell.relative_variance(&quantum), f64::INFINITY);
        cell.add(&quantum.deposit(Vec3::ZERO).unwrap(), 1, true);
        assert_eq!(cell.relative_variance(&quantum), 0.0);
    }

    #[test]
    fn slots_keep_what_is_a_number() {
        let quantum = Quantum::new(1.0);
        let mut sum = SlotSum::default();
        assert!(!sum.add(DVec3::new(1.0, f64::NAN, 0.0), &quantum));
        assert!(sum.add(DVec3::new(1e20, -2.5, f64::INFINITY), &quantum));
        assert!(sum.add(DVec3::new(0.0, 1.0, -f64::INFINITY), &quantum));
        assert_eq!(sum.get(&quantum), Vec3::new(1e20, -1.5, 0.0));
    }
}
