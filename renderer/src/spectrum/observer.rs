//! The CIE 1931 2° observer: from spectra to XYZ and to linear Rec.709 RGB.

use std::sync::LazyLock;

use glam::{DMat3, DVec3};

use super::illuminant::{self, D65};
use super::observer_data::CIE_1931;
use super::rgb_space;

/// Shortest wavelength, nm.
const FIRST: usize = 360;
/// Steps of 1 nm, up to 830 nm.
const COUNT: usize = (CIE_1931.len() - 1) * STRIDE + 1;
/// Distance of the tabulated wavelengths, nm.
const STRIDE: usize = 5;

struct Observer {
    /// x̄, ȳ, z̄ by nm.
    matching: Vec<DVec3>,
    /// RGB of a reflectance of 1 at one wavelength under D65: sums to (1, 1, 1).
    d65_weights: Vec<DVec3>,
    /// XYZ of D65 at Y = 1.
    d65_white: DVec3,
    rec709_from_xyz: DMat3,
}

static OBSERVER: LazyLock<Observer> = LazyLock::new(|| {
    let matching: Vec<DVec3> = (0..COUNT).map(matching_at).collect();
    let d65: Vec<DVec3> =
        (0..COUNT).map(|i| illuminant::daylight_value(D65, (FIRST + i) as f64) * matching[i]).collect();
    let sum: DVec3 = d65.iter().sum();
    let d65_white = sum / sum.y;
    let rec709_from_xyz = rgb_space::xyz_from_rgb(rgb_space::REC709, d65_white).inverse();
    let d65_weights = d65.iter().map(|xyz| rec709_from_xyz * (xyz / sum.y)).collect();
    Observer { matching, d65_weights, d65_white, rec709_from_xyz }
});

/// The matching functions at `FIRST + i` nm: cubic between four tabulated values, as the CIE recommends (CIE 015:2018
/// section 7.2.2.1), linear in the first and last interval.
fn matching_at(i: usize) -> DVec3 {
    let row = |j: usize| DVec3::from(CIE_1931[j]);
    let (low, t) = (i / STRIDE, (i % STRIDE) as f64 / STRIDE as f64);
    if t == 0.0 {
        return row(low);
    }
    if low == 0 || low + 2 >= CIE_1931.len() {
        return row(low).lerp(row(low + 1), t);
    }
    let cubic = row(low - 1) * (t * (t - 1.0) * (2.0 - t) / 6.0)
        + row(low) * ((t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0)
        + row(low + 1) * ((t + 1.0) * t * (2.0 - t) / 2.0)
        + row(low + 2) * ((t + 1.0) * t * (t - 1.0) / 6.0);
    cubic.max(DVec3::ZERO)
}

/// The wavelengths (nm) of all integrals.
pub(super) fn wavelengths() -> impl Iterator<Item = f64> {
    (FIRST..FIRST + COUNT).map(|nm| nm as f64)
}

/// XYZ of a spectrum in nm: the plain sums of its products with the matching functions.
pub(super) fn xyz(spectrum: impl Fn(f64) -> f64) -> DVec3 {
    wavelengths().zip(&OBSERVER.matching).map(|(lambda, &matching)| spectrum(lambda) * matching).sum()
}

/// Linear Rec.709 RGB, unclamped, of a reflectance spectrum under D65.
pub(super) fn rgb_under_d65(reflectance: impl Fn(f64) -> f64) -> DVec3 {
    weigh_under_d65(wavelengths().map(reflectance))
}

/// [`rgb_under_d65`] of reflectances at all [`wavelengths`].
pub(super) fn weigh_under_d65(reflectances: impl Iterator<Item = f64>) -> DVec3 {
    reflectances.zip(&OBSERVER.d65_weights).map(|(reflectance, &weight)| reflectance * weight).sum()
}

/// XYZ of D65 at Y = 1.
pub(super) fn d65_white() -> DVec3 {
    OBSERVER.d65_white
}

/// Linear Rec.709 from XYZ: D65 at Y = 1 becomes (1, 1, 1).
pub(super) fn rec709_from_xyz() -> DMat3 {
    OBSERVER.rec709_from_xyz
}

/// Luminance Y of the primaries of Rec.709.
pub(super) fn rec709_luminance() -> DVec3 {
    OBSERVER.rec709_from_xyz.inverse().row(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolation_reproduces_the_tabulated_nanometres() {
        // CIE 018:2019 table at 1 nm. The table itself holds at most seven digits of a smoothed curve, which a cubic
        // through four points follows to a part in 2000 of the peaks.
        for (nm, expected) in [
            (436, [0.3343513, 0.01800736, 1.6564048]),
            (507, [0.00383656, 0.4443096, 0.1901196]),
            (557, [0.5446916, 0.9993046, 0.0049]),
            (603, [1.0552244, 0.5924756, 0.000_684]),
            (668, [0.09969044, 0.03656384, 0.0]),
        ] {
            let difference = matching_at(nm - FIRST) - DVec3::from(expected);
            assert!(difference.abs().max_element() < 5e-4, "{nm} nm: {difference}");
        }
    }

    #[test]
    fn the_matching_functions_integrate_as_published_and_see_equal_energy_as_nearly_white() {
        let sum = xyz(|_| 1.0);
        // 106.856895 is the sum of the 1 nm table of ȳ; the five figures of the 5 nm table times 5 agree to 2e-6.
        assert!((sum.y - 106.856_895).abs() < 1e-3, "{sum}");
        // Equal energy is at x = 0.33331, y = 0.33329 (CIE 015:2018 table 10.3): 1/3 to the precision of the functions.
        let chromaticity = sum / sum.element_sum();
        assert!((chromaticity.x - 0.33331).abs() < 1e-5 && (chromaticity.y - 0.33329).abs() < 1e-5, "{chromaticity}");
    }

    #[test]
    fn the_white_of_d65_is_the_standard_one() {
        let white = d65_white();
        // CIE 015:2018 table 10.3: x = 0.31272, y = 0.32903; IEC 61966-2-1 rounds them to 0.3127, 0.3290.
        let (x, y) = (white.x / white.element_sum(), white.y / white.element_sum());
        assert!((x - 0.31272).abs() < 2e-5 && (y - 0.32903).abs() < 2e-5, "{x} {y}");
        assert!((rec709_from_xyz() * white - 1.0).abs().max_element() < 1e-12);
        assert!((rgb_under_d65(|_| 1.0) - 1.0).abs().max_element() < 1e-12);
        let luminance = rec709_luminance();
        assert!((luminance - DVec3::new(0.212_639, 0.715_169, 0.072_192)).abs().max_element() < 2e-4, "{luminance}");
    }
}
