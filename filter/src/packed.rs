//! Compact numbers: a frame has millions of path records.

use glam::{Vec2, Vec3};

/// Three finite numbers of either sign with one exponent: 18 bits of mantissa each (one the sign) and 10 of exponent.
///
/// The error is at most 2⁻¹⁸ of the largest component. What is not finite becomes [`PackedRgb::INVALID`], so that the
/// filter can count it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PackedRgb([u32; 2]);

const MANTISSA: u32 = 18;
const EXPONENT_BIAS: i32 = 256;

impl PackedRgb {
    /// Reads as NaN.
    pub const INVALID: Self = Self([u32::MAX; 2]);

    /// Rounds to nearest.
    #[inline]
    pub fn new(rgb: Vec3) -> Self {
        let largest = rgb.abs().max_element();
        if largest.is_normal() && rgb.is_finite() { Self::of_normal(rgb, largest) } else { Self::of_any(rgb) }
    }

    /// By shifts of the mantissas, if the largest of the numbers is normal.
    #[inline]
    fn of_normal(rgb: Vec3, largest: f32) -> Self {
        // An f32 is an integer of 24 bits times 2 to the power of its biased exponent - 150; subnormal ones have the biased
        // exponent 1.
        let parts = |x: f32| {
            let exponent = x.to_bits() >> 23 & 0xff;
            (x.to_bits() & 0x7f_ffff | u32::from(exponent > 0) << 23, exponent.max(1))
        };
        let (mantissa, exponent) = parts(largest);
        // The largest mantissa is in [2¹⁶, 2¹⁷); rounded up to 2¹⁷ it would not fit and the next exponent is taken.
        let exponent = exponent + 7 + ((mantissa + 64) >> 24);
        let mantissa = |x: f32| {
            let (mantissa, own) = parts(x);
            // Shifted by 25 or more, nothing is left.
            let shift = (exponent - own).min(25);
            let whole = (mantissa + (1 << (shift - 1))) >> shift;
            let signed = if x < 0.0 { whole.wrapping_neg() } else { whole };
            u64::from(signed & ((1 << MANTISSA) - 1))
        };
        Self::from_parts([mantissa(rgb.x), mantissa(rgb.y), mantissa(rgb.z)], exponent as i32 - 150)
    }

    /// The same for all there is.
    #[cold]
    fn of_any(rgb: Vec3) -> Self {
        let largest = rgb.abs().max_element();
        if !rgb.is_finite() {
            return Self::INVALID;
        }
        if largest == 0.0 {
            return Self::default();
        }
        // Doubles hold every f32 times any power of two in question, so only the rounding to an integer is inexact.
        let mut exponent = exponent_of(largest) - 16;
        if f64::from(largest) * power_of_two(-exponent) >= f64::from((1 << 17) - 1) + 0.5 {
            exponent += 1;
        }
        let scale = power_of_two(-exponent);
        let mantissa = |x: f32| u64::from(round(f64::from(x) * scale) as u32 & ((1 << MANTISSA) - 1));
        Self::from_parts([mantissa(rgb.x), mantissa(rgb.y), mantissa(rgb.z)], exponent)
    }

    #[inline]
    fn from_parts([x, y, z]: [u64; 3], exponent: i32) -> Self {
        let exponent = (exponent + EXPONENT_BIAS) as u64;
        let bits = x | y << MANTISSA | z << (2 * MANTISSA) | exponent << (3 * MANTISSA);
        Self([bits as u32, (bits >> 32) as u32])
    }

    /// The numbers; NaN for [`PackedRgb::INVALID`].
    #[inline]
    pub fn get(self) -> Vec3 {
        let bits = u64::from(self.0[1]) << 32 | u64::from(self.0[0]);
        // Sign extension: the mantissa moves to the top and back.
        let part = |at: u32| (((bits >> (at * MANTISSA)) as u32) << (32 - MANTISSA)) as i32 >> (32 - MANTISSA);
        let parts = [part(0), part(1), part(2)];
        let exponent = (bits >> (3 * MANTISSA)) as i32 - EXPONENT_BIAS;
        if (-126..=127).contains(&exponent) {
            // Exact: integers of 17 bits, and powers of two that f32 has.
            let scale = f32::from_bits(((exponent + 127) as u32) << 23);
            Vec3::from_array(parts.map(|x| x as f32 * scale))
        } else if bits == 0 {
            Vec3::ZERO
        } else {
            self.get_any(parts, exponent)
        }
    }

    /// The same for all there is.
    #[cold]
    fn get_any(self, parts: [i32; 3], exponent: i32) -> Vec3 {
        if self == Self::INVALID {
            return Vec3::NAN;
        }
        let scale = power_of_two(exponent);
        Vec3::from_array(parts.map(|x| (f64::from(x) * scale) as f32))
    }
}

/// Nearest integer, halves away from zero.
#[inline]
fn round(x: f64) -> i32 {
    (x + 0.5f64.copysign(x)) as i32
}

/// ⌊log₂ x⌋ of a positive finite number, subnormal or not.
#[inline]
fn exponent_of(x: f32) -> i32 {
    // Every f32 is normal as a double.
    (f64::from(x).to_bits() >> 52) as i32 - 1023
}

/// 2ᵉ for |e| < 1023.
#[inline]
fn power_of_two(e: i32) -> f64 {
    f64::from_bits(((1023 + e) as u64) << 52)
}

/// A unit vector by its octahedral map, 8 bits a coordinate: within 1.1°.
///
/// **Source**: \[Cigolle14\].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PackedNormal(u16);

impl PackedNormal {
    /// Nearest representable direction in the octahedral map.
    #[inline]
    pub fn new(n: Vec3) -> Self {
        let p = octahedral(n);
        let bits = |x: f32| ((x * 0.5 + 0.5) * 255.0 + 0.5) as u16;
        Self(bits(p.x) | bits(p.y) << 8)
    }

    /// The direction, unit.
    #[inline]
    pub fn get(self) -> Vec3 {
        self.direction().normalize_or(Vec3::Z)
    }

    /// The direction, of a length between 1/√3 and 1.
    #[inline]
    pub fn direction(self) -> Vec3 {
        let coordinate = |bits: u16| f32::from(bits & 255) / 127.5 - 1.0;
        let p = Vec2::new(coordinate(self.0), coordinate(self.0 >> 8));
        let z = 1.0 - p.x.abs() - p.y.abs();
        let fold = (-z).max(0.0);
        let xy = p - Vec2::new(fold.copysign(p.x), fold.copysign(p.y));
        xy.extend(z)
    }
}

/// Direction to the square [-1, 1]².
#[inline]
pub(crate) fn octahedral(n: Vec3) -> Vec2 {
    let p = n.truncate() / (n.x.abs() + n.y.abs() + n.z.abs());
    if n.z >= 0.0 {
        return p;
    }
    Vec2::new((1.0 - p.y.abs()).copysign(p.x), (1.0 - p.x.abs()).copysign(p.y))
}

/// A positive number to 2⁻⁷, rounded down: the upper half of an f32. Times a power of two it keeps its mantissa, so a
/// scene scaled by one has the same cells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PackedFootprint(u16);

impl PackedFootprint {
    /// Zero for what is not positive and finite.
    #[inline]
    pub fn new(side: f32) -> Self {
        if side > 0.0 && side < f32::INFINITY { Self((side.to_bits() >> 16) as u16) } else { Self(0) }
    }

    /// The number.
    #[inline]
    pub fn get(self) -> f32 {
        f32::from_bits(u32::from(self.0) << 16)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn rgb_is_kept_to_the_bound(x in any::<f32>(), y in any::<f32>(), z in any::<f32>()) {
            let rgb = Vec3::new(x, y, z);
            let got = PackedRgb::new(rgb).get();
            if rgb.is_finite() {
                let bound = f64::from(rgb.abs().max_element()) / f64::from(1 << 17);
                // The last term: what is subnormal after all.
                prop_assert!(f64::from((got - rgb).abs().max_element()) <= bound + 1e-44, "{rgb} became {got}");
            } else {
                prop_assert!(got.is_nan());
            }
        }

        #[test]
        fn ordinary_rgb_is_kept_to_the_bound(x in -9.0f32..9.0, y in 0.0f32..9.0, z in 0.0f32..1e-3) {
            let rgb = Vec3::new(x, y, z);
            let bound = rgb.abs().max_element() / (1 << 17) as f32;
            prop_assert!((PackedRgb::new(rgb).get() - rgb).abs().max_element() <= bound);
        }

        #[test]
        fn scaling_by_a_power_of_two_is_exact(x in 1e-3f32..1e3, y in 0.0f32..1e3, e in -40i32..40) {
            let rgb = Vec3::new(x, y, 0.5);
            let scale = 2f32.powi(e);
            prop_assert_eq!(PackedRgb::new(rgb * scale).get(), PackedRgb::new(rgb).get() * scale);
        }

        #[test]
        fn normals_are_kept_to_a_degree(x in -1.0f32..1.0, y in -1.0f32..1.0, z in -1.0f32..1.0) {
            prop_assume!(Vec3::new(x, y, z).length() > 1e-3);
            let n = Vec3::new(x, y, z).normalize();
            prop_assert!(PackedNormal::new(n).get().dot(n) > 1.1f32.to_radians().cos());
        }
    }

    #[test]
    fn shifts_round_as_doubles_do() {
        // Miri is some thousand times slower.
        for seed in 0..if cfg!(miri) { 200 } else { 200_000 } {
            let part = |k: u64| {
                let bits = crate::hash::mix64(4 * seed + k) as u32;
                // Exponents near each other in most of the cases, so that much is rounded.
                f32::from_bits(if seed % 4 == 0 { bits } else { bits & 0x83ff_ffff | 0x3c00_0000 })
            };
            let rgb = Vec3::new(part(0), part(1), part(2));
            if rgb.is_finite() {
                assert_eq!(PackedRgb::new(rgb), PackedRgb::of_any(rgb), "{rgb}");
            }
        }
    }

    #[test]
    fn mantissas_that_round_up_take_the_next_exponent() {
        let x = 1.0 - f32::EPSILON / 2.0;
        assert_eq!(PackedRgb::new(Vec3::new(x, -x, 0.25)).get(), Vec3::new(1.0, -1.0, 0.25));
    }

    #[test]
    fn zero_is_zero() {
        assert_eq!(PackedRgb::new(Vec3::ZERO).get(), Vec3::ZERO);
    }
}
