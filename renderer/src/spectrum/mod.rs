//! Spectra and what they look like in linear RGB.

use crate::math::Rgb;

/// A spectrum as a scene file gives it.
#[derive(Clone, Debug, PartialEq)]
pub enum Spectrum {
    /// Linear Rec.709 RGB.
    Rgb(Rgb),
    /// Planck radiator, kelvin.
    Blackbody(f32),
    /// Piecewise linear: (wavelength in nm, value), by ascending wavelength.
    Sampled(std::sync::Arc<[(f32, f32)]>),
}
