//! From scene light to display values.

use crate::args::Tone;

/// The sRGB encoding of a linear value, cut off at 0 and 1.
///
/// **Source**: IEC 61966-2-1.
pub fn srgb_from_linear(linear: f32) -> f32 {
    let x = linear.clamp(0.0, 1.0);
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

/// Inverse of [`srgb_from_linear`].
pub fn linear_from_srgb(encoded: f32) -> f32 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// The display value, in [0, 1], of a linear one; black for what is not a number.
pub fn display(tone: Tone, linear: f32) -> f32 {
    let linear = if linear.is_nan() { 0.0 } else { linear.max(0.0) };
    match tone {
        Tone::Filmic => srgb_from_linear(filmic(linear)),
        Tone::Srgb => srgb_from_linear(linear),
    }
}

/// A film-like curve from [0, ∞) to [0, 1).
///
/// **Source**: \[Narkowicz16\] "ACES Filmic Tone Mapping Curve", with the exposure of 0.6 that it needs to keep mid-tones.
pub fn filmic(linear: f32) -> f32 {
    // Beyond this the curve is 1 to rounding, and its squares overflow far later.
    let x = (0.6 * linear).min(1.0e6);
    (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14)
}

/// The linear value that [`filmic`] shows as `shown`, in [0, 1).
pub fn filmic_inverse(shown: f64) -> f64 {
    let (a, b, c) = (2.51 - 2.43 * shown, 0.03 - 0.59 * shown, -0.14 * shown);
    ((b * b - 4.0 * a * c).sqrt() - b) / (2.0 * a) / 0.6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_round_trips_and_hits_known_values() {
        for k in 0..=255 {
            let encoded = k as f32 / 255.0;
            assert!((srgb_from_linear(linear_from_srgb(encoded)) - encoded).abs() < 1e-5, "{k}");
        }
        // 18 % grey is 118 of 255.
        assert_eq!((255.0 * srgb_from_linear(0.18)).round(), 118.0);
    }

    #[test]
    fn the_film_curve_has_an_inverse() {
        for shown in [0.0, 0.1, 0.5, 0.85, 0.99] {
            // Single precision, and a slope of at least 0.02 where the curve is flattest.
            assert!((f64::from(filmic(filmic_inverse(shown) as f32)) - shown).abs() < 1e-5, "{shown}");
        }
    }

    #[test]
    fn every_tone_is_monotone_and_stays_on_the_display() {
        for tone in [Tone::Filmic, Tone::Srgb] {
            let mut last = 0.0;
            for k in 0..400 {
                let value = display(tone, 1.1_f32.powi(k - 200));
                assert!((last..=1.0).contains(&value), "{tone:?} {k} {value}");
                last = value;
            }
            assert_eq!((display(tone, 0.0), display(tone, -1.0), display(tone, f32::NAN)), (0.0, 0.0, 0.0));
            assert!(display(tone, f32::INFINITY) > 0.99);
        }
    }
}
