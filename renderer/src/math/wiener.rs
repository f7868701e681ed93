//! Images as far as they are more than noise.

use std::ops::Add;

use glam::DVec3;

use super::window::windows;

/// Half the side of the windows: 49 pixels know their own noise to a fifth and their scatter as well.
const RADIUS: usize = 3;

/// Sums over a window.
#[derive(Clone, Copy, Default)]
struct Moments {
    value: DVec3,
    square: f64,
    noise: f64,
}

impl Add for Moments {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, square: self.square + other.square, noise: self.noise + other.noise }
    }
}

/// The mean over a window, and of what a pixel differs from that the share that noise does not explain. `noise` has in each
/// pixel a deviation whose square estimates the variance of the value; both are row by row, of one length.
///
/// **Source**: the filter of \[Lee80\] for additive noise.
pub fn wiener(values: &[DVec3], noise: &[DVec3], width: usize) -> Vec<DVec3> {
    let moments = |(value, noise): (&DVec3, &DVec3)| Moments {
        value: *value,
        square: value.length_squared(),
        noise: noise.length_squared(),
    };
    let around = windows(values.iter().zip(noise).map(moments).collect(), width, RADIUS, |sum, count| {
        let n = count as f64;
        let mean = sum.value / n;
        let scatter = sum.square / n - mean.length_squared();
        (mean, if scatter > 0.0 { (1.0 - sum.noise / n / scatter).max(0.0) } else { 0.0 })
    });
    values.iter().zip(around).map(|(value, (mean, signal))| mean + signal * (*value - mean)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One pixel of 1000 and of this noise among pixels of 1 with noise 0.1.
    fn at_the_lamp(noise: f64) -> f64 {
        let (mut values, mut noises) = (vec![DVec3::ONE; 32 * 32], vec![DVec3::splat(0.1); 32 * 32]);
        (values[16 * 32 + 16], noises[16 * 32 + 16]) = (DVec3::splat(1e3), DVec3::splat(noise));
        wiener(&values, &noises, 32)[16 * 32 + 16].x
    }

    #[test]
    fn a_lamp_stays_and_a_firefly_goes() {
        assert!(at_the_lamp(1.0) > 990.0);
        // The window's mean.
        assert!((at_the_lamp(1e3) - (1e3 + 48.0) / 49.0).abs() < 1.0);
    }
}
