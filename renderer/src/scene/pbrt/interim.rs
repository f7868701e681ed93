//! Stand-ins until `crate::spectrum` has these.

use crate::math::Rgb;
use crate::spectrum::Spectrum;

pub(super) fn named(name: &str) -> Option<Spectrum> {
    let rgb = match name {
        "metal-Cu-eta" => Rgb::new(0.2, 0.92, 1.1),
        "metal-Cu-k" => Rgb::new(3.9, 2.45, 2.14),
        "metal-Al-eta" => Rgb::new(1.66, 0.88, 0.52),
        "metal-Al-k" => Rgb::new(9.2, 6.3, 4.8),
        "metal-Ag-eta" => Rgb::new(0.15, 0.14, 0.13),
        "metal-Ag-k" => Rgb::new(4.0, 3.1, 2.3),
        "metal-Au-eta" => Rgb::new(0.14, 0.37, 1.44),
        "metal-Au-k" => Rgb::new(3.98, 2.38, 1.6),
        _ if ["metal-", "glass-", "stdillum-", "illum-"].iter().any(|p| name.starts_with(p)) => Rgb::splat(1.5),
        _ => return None,
    };
    Some(Spectrum::Rgb(rgb))
}

pub(super) fn names() -> impl Iterator<Item = &'static str> {
    ["metal-Cu-eta", "metal-Cu-k"].into_iter()
}

pub(super) trait Interim {
    fn reflectance_rgb(&self) -> Rgb;
    fn illuminant_rgb(&self) -> Rgb;
    fn unbounded_rgb(&self) -> Rgb;
    fn at(&self, lambda: f32) -> f32;
}

impl Interim for Spectrum {
    fn reflectance_rgb(&self) -> Rgb {
        self.unbounded_rgb()
    }
    fn illuminant_rgb(&self) -> Rgb {
        match self {
            Spectrum::Rgb(rgb) => *rgb,
            _ => Rgb::ONE,
        }
    }
    fn unbounded_rgb(&self) -> Rgb {
        match self {
            Spectrum::Rgb(rgb) => *rgb,
            _ => Rgb::new(self.at(620.0), self.at(540.0), self.at(460.0)),
        }
    }
    fn at(&self, lambda: f32) -> f32 {
        match self {
            Spectrum::Rgb(rgb) => rgb.y,
            Spectrum::Blackbody(_) => 1.0,
            Spectrum::Sampled(samples) => {
                let after = samples.partition_point(|s| s.0 < lambda);
                match (after.checked_sub(1).map(|i| samples[i]), samples.get(after)) {
                    (Some(a), Some(b)) => a.1 + (b.1 - a.1) * (lambda - a.0) / (b.0 - a.0),
                    (Some(a), None) => a.1,
                    (None, Some(b)) => b.1,
                    (None, None) => 0.0,
                }
            }
        }
    }
}

pub(super) fn white_balance(_kelvin: f32) -> glam::Mat3 {
    glam::Mat3::IDENTITY
}
