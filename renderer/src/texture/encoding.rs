//! Transfer functions between stored and linear values.

use crate::scene::description::Encoding;

impl Encoding {
    /// The linear value of a stored one, both usually in [0, 1].
    pub fn decode(self, stored: f32) -> f32 {
        match self {
            Self::Srgb => decode_srgb(stored),
            Self::Linear => stored,
            Self::Gamma(gamma) => stored.max(0.0).powf(gamma),
        }
    }

    /// Linear values of the 256 bytes.
    pub fn table(self) -> Box<[f32; 256]> {
        Box::new(std::array::from_fn(|byte| self.decode(byte as f32 / 255.0)))
    }
}

/// **Source**: IEC 61966-2-1.
fn decode_srgb(stored: f32) -> f32 {
    if stored <= 0.04045 { stored / 12.92 } else { ((stored + 0.055) / 1.055).powf(2.4) }
}

/// The value of a 16-bit float. Infinities and NaN, of which loaded images have none, become large numbers.
///
/// Exponent and mantissa are moved to their places in an `f32`, and a multiplication then corrects the bias, which also
/// normalises denormals.
#[inline]
pub fn half_to_f32(bits: u16) -> f32 {
    const BIAS: f32 = f32::from_bits((127 + 127 - 15) << 23);
    let magnitude = f32::from_bits(u32::from(bits & 0x7fff) << 13) * BIAS;
    f32::from_bits(magnitude.to_bits() | (u32::from(bits & 0x8000) << 16))
}

/// The nearest 16-bit float of a finite value, ties to even; values beyond the range become the largest one.
pub fn f32_to_half(value: f32) -> u16 {
    let bits = value.to_bits();
    let sign = (bits >> 16) as u16 & 0x8000;
    let magnitude = f32::from_bits(bits & 0x7fff_ffff);
    if magnitude >= 65_520.0 {
        return sign | 0x7bff;
    }
    // Below 2^-14 halves are multiples of 2^-24: adding 2^-1, whose last place that is, rounds to them.
    if magnitude < f32::from_bits((127 - 14) << 23) {
        return sign | ((magnitude + 0.5).to_bits() - 0.5_f32.to_bits()) as u16;
    }
    let odd = (bits >> 13) & 1;
    let rounded = (bits & 0x7fff_ffff) + 0xfff + odd;
    sign | ((rounded - ((127 - 15) << 23)) >> 13) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The inverse as the standard states it.
    ///
    /// **Source**: IEC 61966-2-1.
    fn encode(encoding: Encoding, linear: f32) -> f32 {
        match encoding {
            Encoding::Srgb if linear <= 0.003_130_8 => linear * 12.92,
            Encoding::Srgb => 1.055 * linear.powf(1.0 / 2.4) - 0.055,
            Encoding::Linear => linear,
            Encoding::Gamma(gamma) => linear.powf(1.0 / gamma),
        }
    }

    #[test]
    fn srgb_has_its_known_values_and_inverts() {
        assert_eq!((Encoding::Srgb.decode(0.0), Encoding::Srgb.decode(1.0)), (0.0, 1.0));
        // Mid grey 0.5 is 21.4 % of the light.
        assert!((Encoding::Srgb.decode(0.5) - 0.214_041_14).abs() < 1e-6);
        for encoding in [Encoding::Srgb, Encoding::Linear, Encoding::Gamma(2.2)] {
            let table = encoding.table();
            for byte in 0..=255_u8 {
                let back = encode(encoding, table[usize::from(byte)]) * 255.0;
                assert_eq!(back.round() as u8, byte, "{encoding:?}");
            }
        }
        assert!((Encoding::Gamma(2.0).decode(0.5) - 0.25).abs() < 1e-6);
    }

    #[test]
    fn every_finite_half_survives_the_way_to_float_and_back() {
        for bits in 0..=u16::MAX {
            if bits & 0x7c00 != 0x7c00 {
                assert_eq!(f32_to_half(half_to_f32(bits)), bits);
            }
        }
        assert_eq!(half_to_f32(0x3c00), 1.0);
        assert_eq!(half_to_f32(0x0001), 2.0_f32.powi(-24));
        assert_eq!(half_to_f32(0xfbff), -65_504.0);
        assert_eq!(f32_to_half(1.0e9), 0x7bff);
        // Ties go to the even neighbour: 2049 lies between 2048 and 2050.
        assert_eq!(half_to_f32(f32_to_half(2049.0)), 2048.0);
        assert_eq!(half_to_f32(f32_to_half(2051.0)), 2052.0);
    }
}
