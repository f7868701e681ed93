//! What the statistical tests of lights share.

use glam::{DVec3, Vec2, Vec3};

use crate::sampling::mix64;

/// Deterministic uniform numbers.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(mix64(seed))
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (mix64(self.0) >> 40) as f32 * 2.0_f32.powi(-24)
    }

    pub fn square(&mut self) -> Vec2 {
        Vec2::new(self.unit(), self.unit())
    }

    /// Uniform in the cube [−1, 1)³.
    pub fn cube(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    /// A unit vector.
    pub fn direction(&mut self) -> Vec3 {
        crate::math::warp::uniform_sphere(self.square())
    }
}

/// Mean of samples and its standard deviation.
#[derive(Default)]
pub struct Mean {
    count: f64,
    sum: DVec3,
    squares: DVec3,
}

impl Mean {
    pub fn add(&mut self, value: DVec3) {
        self.count += 1.0;
        self.sum += value;
        self.squares += value * value;
    }

    pub fn value(&self) -> DVec3 {
        self.sum / self.count
    }

    /// Asserts that the mean agrees with `expected`: within 4.5 standard deviations (two in 300,000 correct tests fail, and
    /// the seeds are fixed), or within the rounding of `f32` arithmetic where samples hardly vary.
    pub fn assert_is(&self, expected: DVec3, what: &str) {
        let mean = self.value();
        let variance = (self.squares / self.count - mean * mean).max(DVec3::ZERO) / (self.count - 1.0);
        for c in 0..3 {
            let allowed = 4.5 * variance[c].sqrt() + 1e-5 * expected[c].abs();
            let off = (mean[c] - expected[c]).abs();
            assert!(off <= allowed, "{what}: {} instead of {}, allowed ±{allowed}", mean[c], expected[c]);
        }
    }
}
