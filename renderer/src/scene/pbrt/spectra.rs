//! How a file gives spectra, and what they stand for.

use std::path::Path;

use super::source::read_file;
use crate::math::Rgb;
use crate::spectrum::{self, RgbSpace, Spectrum};

/// What a spectrum stands for, which decides how it becomes RGB.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Usage {
    /// A reflectance, seen in white light.
    Albedo,
    /// Emitted light.
    Illuminant,
    /// Neither.
    Unbounded,
}

/// Names of colour spaces in files.
pub(super) const SPACES: [&str; 4] = ["srgb", "dci-p3", "rec2020", "aces2065-1"];

/// Linear RGB of a file's space as linear Rec.709 RGB.
pub(super) fn to_rec709(space: RgbSpace, rgb: Rgb, usage: Usage) -> Rgb {
    match usage {
        Usage::Illuminant => space.rec709_from_light() * rgb,
        Usage::Albedo | Usage::Unbounded => space.rec709_from_reflectance() * rgb,
    }
}

/// The spectrum as linear Rec.709 RGB.
pub(super) fn rgb(spectrum: &Spectrum, usage: Usage) -> Rgb {
    match (spectrum, usage) {
        // Judged by whoever knows where it was given, so not yet clamped.
        (Spectrum::Rgb(rgb), _) => *rgb,
        (_, Usage::Albedo) => spectrum.reflectance_rgb(),
        (_, Usage::Illuminant) => spectrum.illuminant_rgb(),
        (_, Usage::Unbounded) => spectrum.unbounded_rgb(),
    }
}

/// Whether the spectrum differs from wavelength to wavelength.
pub(super) fn varies(spectrum: &Spectrum) -> bool {
    match spectrum {
        Spectrum::Rgb(rgb) => rgb.min_element() != rgb.max_element(),
        Spectrum::Blackbody(_) => true,
        Spectrum::Sampled(samples) => samples.windows(2).any(|pair| pair[0].1 != pair[1].1),
    }
}

/// A spectrum from `λ value λ value ...`.
///
/// # Errors
/// When a value is missing or the wavelengths do not increase.
pub(super) fn sampled(values: &[f32]) -> Result<Spectrum, String> {
    if values.len() % 2 != 0 {
        return Err(format!("a spectrum is pairs of wavelength (nm) and value, not {} numbers", values.len()));
    }
    let samples: Vec<(f32, f32)> = values.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect();
    Spectrum::sampled(&samples).map_err(|why| why.to_string())
}

/// Reads a spectrum file.
///
/// # Errors
/// A sentence without the file's name.
pub(super) fn read_spd(path: &Path) -> Result<Spectrum, String> {
    // A file that is no spectrum may be one long word, which the message would repeat.
    const LONGEST: usize = 300;
    let bytes = read_file(path)?;
    let read = spectrum::read_spd(&String::from_utf8_lossy(&bytes));
    read.map_err(|why| why.to_string().chars().take(LONGEST).map(|c| if c.is_control() { ' ' } else { c }).collect())
}
