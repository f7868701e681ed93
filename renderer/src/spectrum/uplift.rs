//! From RGB back to a spectrum: the smooth reflectance that an RGB albedo stands for.
//!
//! An RGB renderer multiplies channels, which is right for one bounce. Where a model is not linear in the albedo, as the
//! bounces under a coat are not, the channels of a saturated albedo are wrong by tens of percent: red = 1 does not mean
//! that all red light is reflected. Such a model is integrated over the wavelengths of the spectrum found here.

use glam::{DMat3, DVec3};

use super::observer;
use crate::math::Rgb;

/// A reflectance spectrum s(λ) = ½ + z/(2√(1 + z²)), z a quadratic polynomial in λ: smooth and within (0, 1).
///
/// **Source**: \[Jakob19\] "A Low-Dimensional Function Space for Efficient Spectral Upsampling", equation 6; pbrt-v4 reads
/// its RGB albedos so. Here the polynomial is found by Levenberg's method instead of from a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uplift {
    coefficients: DVec3,
}

impl Uplift {
    /// The spectrum whose RGB under D65 is nearest to `rgb`, each channel in [0, 1].
    pub fn new(rgb: Rgb) -> Self {
        let target = rgb.as_dvec3().clamp(DVec3::ZERO, DVec3::ONE);
        // The grey of the same mean: z for which the sigmoid has that value everywhere.
        let grey = (target.element_sum() / 3.0).clamp(1e-4, 1.0 - 1e-4);
        let start = (2.0 * grey - 1.0) / (1.0 - (2.0 * grey - 1.0).powi(2)).sqrt();
        let mut best = Self { coefficients: DVec3::new(start, 0.0, 0.0) };
        let mut residual = target - best.rgb(sigmoid);
        let mut damping = 1e-3;
        for _ in 0..ITERATIONS {
            if residual.abs().max_element() < TOLERANCE {
                break;
            }
            let jacobian = best.jacobian();
            let normal = jacobian.transpose() * jacobian + DMat3::from_diagonal(DVec3::splat(damping));
            let step = normal.inverse() * (jacobian.transpose() * residual);
            let next = Self { coefficients: best.coefficients + step };
            let next_residual = target - next.rgb(sigmoid);
            // Written so that a step into NaN is rejected too.
            if next_residual.length_squared() < residual.length_squared() {
                (best, residual, damping) = (next, next_residual, damping * 0.3);
            } else {
                damping *= 10.0;
            }
        }
        best
    }

    /// RGB under D65 of `f(s(λ))`: what a model `f` makes of this reflectance, by wavelength. Negative channels are set to 0.
    pub fn rgb_of(&self, f: impl Fn(f64) -> f64) -> Rgb {
        self.rgb(|z| f(sigmoid(z))).max(DVec3::ZERO).as_vec3()
    }

    fn rgb(&self, f: impl Fn(f64) -> f64) -> DVec3 {
        observer::weigh_under_d65(observer::wavelengths().map(|lambda| f(self.polynomial(lambda))))
    }

    fn polynomial(&self, lambda: f64) -> f64 {
        self.coefficients.dot(powers(lambda))
    }

    /// Change of RGB with each coefficient, by columns.
    fn jacobian(&self) -> DMat3 {
        let column = |k: usize| {
            observer::weigh_under_d65(observer::wavelengths().map(|lambda| {
                let z = self.polynomial(lambda);
                powers(lambda)[k] * 0.5 / (1.0 + z * z).powf(1.5)
            }))
        };
        DMat3::from_cols(column(0), column(1), column(2))
    }
}

/// Far below a step of 8 bits. Albedos at the edge of the gamut do not reach it; then the iterations end the search.
const TOLERANCE: f64 = 1e-5;

/// Interior albedos take fewer than twenty.
const ITERATIONS: usize = 60;

fn sigmoid(z: f64) -> f64 {
    0.5 + 0.5 * z / (1.0 + z * z).sqrt()
}

/// 1, x, x² for x in [-1, 1] over the visible wavelengths, which keeps the system well conditioned.
fn powers(lambda: f64) -> DVec3 {
    let x = (lambda - 595.0) / 235.0;
    DVec3::new(1.0, x, x * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spectra_have_the_rgb_that_was_asked_for() {
        for rgb in [
            Rgb::new(0.5, 0.5, 0.5),
            Rgb::new(0.8, 0.2, 0.1),
            Rgb::new(0.1, 0.6, 0.3),
            Rgb::new(0.05, 0.1, 0.7),
            Rgb::new(0.9, 0.85, 0.3),
            Rgb::new(0.01, 0.01, 0.012),
        ] {
            let found = Uplift::new(rgb).rgb_of(|s| s);
            assert!((found - rgb).abs().max_element() < 1e-4, "{rgb} became {found}");
        }
    }

    #[test]
    fn albedos_at_the_edge_of_the_gamut_come_near() {
        for rgb in [Rgb::new(1.0, 0.378_676, 0.013_473), Rgb::ONE, Rgb::ZERO, Rgb::new(1.0, 0.0, 0.0)] {
            let found = Uplift::new(rgb).rgb_of(|s| s);
            assert!((found - rgb).abs().max_element() < 0.02, "{rgb} became {found}");
        }
    }

    #[test]
    fn a_saturated_red_under_a_coat_is_darker_than_its_channel_says() {
        // Mitsuba 3's upsampling gives 1.938 for the red of ρ/(1 − 0.58 ρ), the channel alone 1/(1 − 0.58) = 2.381.
        let bounces = |s: f64| s / (1.0 - 0.58 * s);
        let rgb = Uplift::new(Rgb::new(1.0, 0.378_676, 0.013_473)).rgb_of(bounces);
        assert!((rgb.x - 1.938).abs() < 0.04, "{rgb}");
        assert!((rgb.y - 0.501).abs() < 0.02, "{rgb}");
    }
}
