//! Random numbers that are a function of which path asks.

use glam::Vec2;

use crate::hash::mix64;

/// The random numbers of one lobe of one path.
#[derive(Clone, Copy, Debug)]
pub struct Random(u64);

impl Random {
    /// For path `sample` of `slot` in a pass.
    #[inline]
    pub fn new(slot: u32, sample: u8, layer: u8, pass: u32) -> Self {
        Self(mix64(mix64(u64::from(slot) << 16 | u64::from(sample) << 8 | u64::from(layer)) ^ u64::from(pass)))
    }

    /// A point in [0, 1)², another for each `use_`.
    #[inline]
    pub fn point(&self, use_: u64) -> Vec2 {
        // Steps of an odd constant keep the uses apart before the mixing does.
        let bits = mix64(self.0.wrapping_add((use_ + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15)));
        let unit = |bits: u64| (bits >> 40) as f32 * (1.0 / (1 << 24) as f32);
        Vec2::new(unit(bits), unit(bits << 32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// χ² of counts in 16 × 16 squares: 255 degrees of freedom, so 255 ± 6 √510 with odds beyond a billion.
    fn assert_uniform(points: impl Iterator<Item = Vec2>) {
        let (mut counts, mut n) = ([0u32; 256], 0.0);
        for point in points {
            assert!((0.0..1.0).contains(&point.x) && (0.0..1.0).contains(&point.y), "{point}");
            counts[(point.y * 16.0) as usize * 16 + (point.x * 16.0) as usize] += 1;
            n += 1.0;
        }
        let mean = n / 256.0;
        let chi2: f64 = counts.iter().map(|&count| (f64::from(count) - mean).powi(2) / mean).sum();
        assert!((chi2 - 255.0).abs() < 6.0 * 510f64.sqrt(), "chi² {chi2}");
    }

    #[test]
    fn every_number_that_names_a_path_changes_its_points_independently() {
        assert_uniform((0..65536).map(|slot| Random::new(slot, 0, 0, 0).point(0)));
        assert_uniform((0..65536).map(|i| Random::new(i >> 8, i as u8, 0, 0).point(0)));
        assert_uniform((0..65536).map(|i| Random::new(i >> 1, 0, i as u8 & 1, 7).point(1)));
        assert_uniform((0..65536).map(|pass| Random::new(5, 3, 1, pass).point(1)));
        assert_uniform((0..65536).map(|use_| Random::new(5, 3, 1, 2).point(use_)));
    }
}
