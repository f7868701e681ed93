//! Spectra, and what they look like in linear RGB.
//!
//! Everything is integrated over 360 nm to 830 nm in steps of 1 nm with the CIE 1931 2° observer, in `f64`, once when a
//! scene is read. The renderer itself carries linear Rec.709 RGB.

mod conductor;
mod glass;
mod illuminant;
mod illuminant_data;
mod metal;
mod metal_data;
mod named;
mod observer;
mod observer_data;
mod rgb_space;
mod spd;
mod uplift;

pub use conductor::{ConductorTable, fresnel_conductor};
pub use illuminant::{blackbody_radiance, daylight};
pub use named::{named, names};
pub use rgb_space::RgbSpace;
pub use spd::{SpectrumError, read_spd};
pub use uplift::Uplift;

use std::sync::Arc;

use glam::DVec3;

use crate::math::Rgb;

/// A spectrum as a scene file gives it.
#[derive(Clone, Debug, PartialEq)]
pub enum Spectrum {
    /// Linear Rec.709 RGB.
    Rgb(Rgb),
    /// Planck radiator, kelvin.
    Blackbody(f32),
    /// Piecewise linear: (wavelength in nm, value), by ascending wavelength. 0 outside its range.
    Sampled(Arc<[(f32, f32)]>),
}

/// Wavelength (nm) of the yellow line of helium, d, at which glass is catalogued.
const D_LINE: f64 = 587.6;

impl Spectrum {
    /// A spectrum by (wavelength in nm, value).
    ///
    /// **Errors**: unless there is a sample, all numbers are finite, and the wavelengths are positive and increase.
    pub fn sampled(samples: &[(f32, f32)]) -> Result<Self, SpectrumError> {
        spd::check(samples)?;
        Ok(Self::Sampled(samples.into()))
    }

    /// A spectrum with this value at every wavelength.
    pub fn constant(value: f32) -> Self {
        Self::Rgb(Rgb::splat(value))
    }

    /// The value at a wavelength in nm.
    ///
    /// A black body is relative to its own peak. RGB has no wavelengths: it is read as three bands that meet at 490 nm and
    /// 580 nm, which is exact only for greys.
    pub fn at(&self, lambda_nm: f32) -> f32 {
        self.value(f64::from(lambda_nm)) as f32
    }

    /// As the reflectance of a surface: its linear RGB under D65, white being (1, 1, 1).
    ///
    /// Saturated spectra leave the gamut of Rec.709; each channel is then clamped to [0, 1]. The lower bound keeps light
    /// positive, the upper one keeps a surface from returning more of a channel than it receives.
    pub fn reflectance_rgb(&self) -> Rgb {
        self.under_d65().clamp(Rgb::ZERO, Rgb::ONE)
    }

    /// As the emission of a light: RGB as it is given, any other spectrum as its hue at luminance 1.
    ///
    /// That is the meaning of a light's spectrum in pbrt-v4, which divides every light by the luminance of its spectrum
    /// (an RGB light by that of its white). The level of a light is its `scale`, its power or its illuminance. Hues
    /// outside Rec.709 have their negative channels set to 0 and keep luminance 1. A spectrum without visible light is
    /// black.
    pub fn illuminant_rgb(&self) -> Rgb {
        if let Self::Rgb(rgb) = *self {
            return rgb;
        }
        let xyz = observer::xyz(|lambda| self.value(lambda));
        let rgb = (observer::rec709_from_xyz() * xyz).max(DVec3::ZERO);
        let luminance = observer::rec709_luminance().dot(rgb);
        if luminance > 0.0 && luminance.is_finite() { (rgb / luminance).as_vec3() } else { Rgb::ZERO }
    }

    /// As a quantity per wavelength that may exceed 1, such as η, k or an absorption coefficient: linear RGB under D65, a
    /// constant spectrum being grey, negative channels set to 0.
    pub fn unbounded_rgb(&self) -> Rgb {
        self.under_d65().max(Rgb::ZERO)
    }

    /// As the refractive index of a dielectric that does not disperse: the value at 587.6 nm, the d line for which glass
    /// catalogues give n_d; the mean of RGB.
    ///
    /// A spectrum that does not reach that line has the value of its sample nearest to it.
    pub fn refractive_index(&self) -> f32 {
        match self {
            Self::Rgb(rgb) => rgb.element_sum() / 3.0,
            Self::Blackbody(_) => self.value(D_LINE) as f32,
            Self::Sampled(samples) => match (samples.first(), samples.last()) {
                (Some(first), Some(last)) => self.at((D_LINE as f32).clamp(first.0, last.0)),
                _ => 0.0,
            },
        }
    }

    fn under_d65(&self) -> Rgb {
        match *self {
            Self::Rgb(rgb) => rgb,
            _ => observer::rgb_under_d65(|lambda| self.value(lambda)).as_vec3(),
        }
    }

    /// [`Self::at`] in double precision.
    fn value(&self, lambda: f64) -> f64 {
        match self {
            Self::Rgb(rgb) => {
                let [r, g, b] = rgb.to_array().map(f64::from);
                if lambda < 490.0 {
                    b
                } else if lambda < 580.0 {
                    g
                } else {
                    r
                }
            }
            Self::Blackbody(kelvin) => illuminant::blackbody_relative(lambda, f64::from(*kelvin)),
            Self::Sampled(samples) => interpolate(samples, lambda),
        }
    }
}

/// Piecewise linear interpolation, 0 outside.
fn interpolate(samples: &[(f32, f32)], lambda: f64) -> f64 {
    let above = samples.partition_point(|&(x, _)| f64::from(x) < lambda);
    match (above.checked_sub(1).map(|below| samples[below]), samples.get(above)) {
        (_, Some(&(x, y))) if f64::from(x) == lambda => f64::from(y),
        (Some((x0, y0)), Some(&(x1, y1))) => {
            let t = (lambda - f64::from(x0)) / f64::from(x1 - x0);
            f64::from(y0) + t * f64::from(y1 - y0)
        }
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests;
