//! Linear RGB with Rec.709 primaries and a D65 white.

/// Radiance, reflectance or any other spectral quantity in linear Rec.709 RGB.
pub type Rgb = glam::Vec3;

/// Relative luminance of linear Rec.709 RGB (the Y row of IEC 61966-2-1).
pub fn luminance(rgb: Rgb) -> f32 {
    rgb.dot(Rgb::new(0.212_639, 0.715_169, 0.072_192))
}
