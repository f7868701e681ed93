//! How a file gives colours: colour spaces, sampled spectra, spectrum files.

use std::path::Path;

use super::interim::Interim;
use super::source::read_file;
use crate::math::Rgb;
use crate::spectrum::Spectrum;

/// Wavelength of the sodium D lines in nm, at which refractive indices are tabulated.
pub(super) const SODIUM_LINE: f32 = 589.3;

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

/// A colour space that a file may name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum ColorSpace {
    #[default]
    Srgb,
    DciP3,
    Rec2020,
    Aces,
}

impl ColorSpace {
    /// Names in files.
    pub(super) const NAMES: [(&'static str, ColorSpace); 4] = [
        ("srgb", ColorSpace::Srgb),
        ("dci-p3", ColorSpace::DciP3),
        ("rec2020", ColorSpace::Rec2020),
        ("aces2065-1", ColorSpace::Aces),
    ];

    /// Whether its numbers are linear Rec.709 as they stand.
    pub(super) fn is_rec709(self) -> bool {
        self == Self::Srgb
    }

    /// Linear RGB of this space as linear Rec.709 RGB.
    pub(super) fn to_rec709(self, rgb: Rgb, _usage: Usage) -> Rgb {
        rgb
    }
}

/// The spectrum as linear Rec.709 RGB.
pub(super) fn rgb(spectrum: &Spectrum, usage: Usage) -> Rgb {
    match usage {
        Usage::Albedo => spectrum.reflectance_rgb(),
        Usage::Illuminant => spectrum.illuminant_rgb(),
        Usage::Unbounded => spectrum.unbounded_rgb(),
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
/// When a value is missing or the wavelengths do not ascend.
pub(super) fn sampled(values: &[f32]) -> Result<Spectrum, String> {
    if values.is_empty() || values.len() % 2 != 0 {
        return Err(format!("a spectrum is a list of wavelengths and values, not {} numbers", values.len()));
    }
    let samples: Vec<(f32, f32)> = values.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect();
    if let Some(pair) = samples.windows(2).find(|pair| pair[1].0 <= pair[0].0) {
        return Err(format!("the wavelengths of a spectrum ascend, but {} follows {}", pair[1].0, pair[0].0));
    }
    Ok(Spectrum::Sampled(samples.into()))
}

/// Reads a spectrum file: wavelengths and values, with `#` before comments.
///
/// # Errors
/// A sentence without the file's name.
pub(super) fn read_spd(path: &Path) -> Result<Spectrum, String> {
    let bytes = read_file(path)?;
    let text = String::from_utf8_lossy(&bytes);
    let mut values = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let numbers = line.split('#').next().unwrap_or_default();
        for word in numbers.split_ascii_whitespace() {
            match super::lexer::parse_f32(word.as_bytes()) {
                Ok(value) => values.push(value),
                Err(_) => {
                    let word = super::report::shown(word);
                    return Err(format!("line {}: expected a number, found {word}", index + 1));
                }
            }
        }
    }
    sampled(&values)
}
