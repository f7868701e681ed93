//! Reflectance of conductors: complex Fresnel equations, integrated over the spectrum.

use glam::DVec3;

use super::{Spectrum, observer};
use crate::math::Rgb;

/// Reflectance of unpolarised light at the interface from a dielectric to a conductor.
///
/// `cos_theta` in [0, 1]; `eta` and `k` are the parts of the conductor's complex index over that of the dielectric.
///
/// **Source**: \[Born99\] section 14.2, with the real quantities of equations (15) and (17) eliminated.
pub fn fresnel_conductor(cos_theta: f64, eta: f64, k: f64) -> f64 {
    let cos2 = (cos_theta * cos_theta).clamp(0.0, 1.0);
    let sin2 = 1.0 - cos2;
    let cos_theta = cos2.sqrt();
    // (a + ib)² = (η + ik)² − sin²θ.
    let real = eta * eta - k * k - sin2;
    let modulus = real.hypot(2.0 * eta * k);
    let a = (0.5 * (modulus + real)).max(0.0).sqrt();
    // Both denominators vanish only where there is no interface at all, or nothing but an interface.
    let ratio = |p: f64, q: f64, none: f64| if p + q > 0.0 { (p - q) / (p + q) } else { none };
    let perpendicular = ratio(modulus + cos2, 2.0 * a * cos_theta, 0.0);
    let parallel = perpendicular * ratio(cos2 * modulus + sin2 * sin2, 2.0 * a * cos_theta * sin2, 1.0);
    0.5 * (perpendicular + parallel)
}

/// Reflectance of a conductor in linear RGB by the angle of incidence, for unpolarised light.
///
/// For spectra, the reflectance is integrated over wavelengths under D65 and each channel clamped to [0, 1] (as
/// [`Spectrum::reflectance_rgb`]). Where η and k are both RGB, each channel has its own interface.
#[derive(Clone, Debug, PartialEq)]
pub struct ConductorTable {
    /// At cosθ = i / INTERVALS.
    reflectance: Box<[Rgb; INTERVALS + 1]>,
}

/// A linear interpolation over a step h = 1/128 is off by at most h²/8 · max |R″|. |R″| is largest near grazing, where the
/// parallel component dips within cosθ ≈ 1/|η + ik|. It is below 80 for all that is known by name, which makes 6.1e-4;
/// above cosθ = 1/4, where 94 % of the projected solid angle is, it is below 5.4, which makes 4.1e-5.
const INTERVALS: usize = 128;

impl ConductorTable {
    /// The table of a conductor with indices `eta` and `k` under a dielectric of index `eta_outside` (1: air). Where only one
    /// of the two is RGB, the other becomes RGB as [`Spectrum::unbounded_rgb`].
    pub fn new(eta: &Spectrum, k: &Spectrum, eta_outside: f32) -> Self {
        // An index of 0 or less, which is none, must not become a NaN.
        let outside = f64::from(eta_outside.max(f32::MIN_POSITIVE));
        let reflectance: Box<dyn Fn(f64) -> DVec3> = match (eta, k) {
            (Spectrum::Rgb(_), _) | (_, Spectrum::Rgb(_)) => {
                let (eta, k) = (eta.unbounded_rgb().as_dvec3() / outside, k.unbounded_rgb().as_dvec3() / outside);
                Box::new(move |cos_theta| {
                    DVec3::from_array([0, 1, 2].map(|c| fresnel_conductor(cos_theta, eta[c], k[c])))
                })
            }
            _ => {
                let index = |lambda: f64| (eta.value(lambda) / outside, k.value(lambda) / outside);
                let indices: Vec<(f64, f64)> = observer::wavelengths().map(index).collect();
                Box::new(move |cos_theta| {
                    let spectrum = indices.iter().map(|&(eta, k)| fresnel_conductor(cos_theta, eta, k));
                    observer::weigh_under_d65(spectrum)
                })
            }
        };
        Self {
            reflectance: Box::new(std::array::from_fn(|i| {
                reflectance(i as f64 / INTERVALS as f64).as_vec3().clamp(Rgb::ZERO, Rgb::ONE)
            })),
        }
    }

    /// Reflectance at the cosine of the angle of incidence; outside [0, 1], that at the nearer end.
    #[inline]
    pub fn reflectance(&self, cos_theta: f32) -> Rgb {
        let x = cos_theta.clamp(0.0, 1.0) * INTERVALS as f32;
        // The minimum keeps cosθ = 1 in the last interval.
        let low = (x as usize).min(INTERVALS - 1);
        let t = x - low as f32;
        self.reflectance[low] * (1.0 - t) + self.reflectance[low + 1] * t
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::named;
    use proptest::prelude::*;

    fn metal(formula: &str) -> (Spectrum, Spectrum) {
        (named(&format!("metal-{formula}-eta")).unwrap(), named(&format!("metal-{formula}-k")).unwrap())
    }

    #[test]
    fn metals_have_their_published_reflectance_at_normal_incidence() {
        // Linear Rec.709 F0 of these metals as renderers publish it ([Hoffman15] and others): three figures.
        for (formula, expected) in [
            ("Au", Rgb::new(1.0, 0.782, 0.344)),
            ("Cu", Rgb::new(0.955, 0.638, 0.538)),
            ("Al", Rgb::new(0.913, 0.922, 0.924)),
            ("Ag", Rgb::new(0.972, 0.960, 0.915)),
        ] {
            let (eta, k) = metal(formula);
            let f0 = ConductorTable::new(&eta, &k, 1.0).reflectance(1.0);
            assert!((f0 - expected).abs().max_element() < 1e-3, "{formula}: {f0}, published {expected}");
        }
    }

    #[test]
    fn the_table_interpolates_as_closely_as_derived() {
        for formula in ["Ag", "Al", "Au", "Cu", "CuZn", "MgO", "TiO2"] {
            let (eta, k) = metal(formula);
            let table = ConductorTable::new(&eta, &k, 1.0);
            for i in 0..2 * INTERVALS {
                // The middles of the intervals, where the error is largest, and the quarters.
                let cos_theta = (i as f64 + 0.5) / (2 * INTERVALS) as f64;
                let exact = observer::rgb_under_d65(|l| fresnel_conductor(cos_theta, eta.value(l), k.value(l)));
                let exact = exact.clamp(DVec3::ZERO, DVec3::ONE);
                let error = (table.reflectance(cos_theta as f32).as_dvec3() - exact).abs().max_element();
                let bound = if cos_theta < 0.25 { 6.2e-4 } else { 4.2e-5 };
                assert!(error < bound, "{formula} at {cos_theta}: {error}");
            }
        }
    }

    #[test]
    fn limits_of_the_fresnel_equations() {
        // Normal incidence: ((η − 1)² + k²) / ((η + 1)² + k²).
        for (eta, k) in [(1.5, 0.0), (0.2, 3.0), (1.0, 7.0), (3.0, 0.5)] {
            let f0 = ((eta - 1.0_f64).powi(2) + k * k) / ((eta + 1.0).powi(2) + k * k);
            assert!((fresnel_conductor(1.0, eta, k) - f0).abs() < 1e-15);
            assert!((fresnel_conductor(0.0, eta, k) - 1.0).abs() < 1e-12);
        }
        // No interface; nothing behind it.
        assert!(fresnel_conductor(0.5, 1.0, 0.0).abs() < 1e-15 && fresnel_conductor(0.0, 1.0, 0.0) == 0.0);
        assert_eq!(fresnel_conductor(1.0, 0.0, 0.0), 1.0);
        // Brewster's angle of a dielectric: half of the perpendicular part is left.
        let eta = 1.5_f64;
        let cos = 1.0 / (1.0 + eta * eta).sqrt();
        let perpendicular = ((1.0 - eta * eta) / (1.0 + eta * eta)).powi(2);
        assert!((fresnel_conductor(cos, eta, 0.0) - 0.5 * perpendicular).abs() < 1e-15);
    }

    #[test]
    fn under_a_coat_the_indices_are_relative_to_it() {
        let scaled = |factor: f32| {
            let scale = |spectrum: Spectrum| match spectrum {
                Spectrum::Sampled(samples) => {
                    Spectrum::Sampled(samples.iter().map(|&(l, v)| (l, v * factor)).collect())
                }
                other => other,
            };
            let (eta, k) = metal("Cu");
            (scale(eta), scale(k))
        };
        let (eta, k) = metal("Cu");
        let coated = ConductorTable::new(&eta, &k, 1.5);
        let (eta, k) = scaled(1.0 / 1.5);
        let in_air = ConductorTable::new(&eta, &k, 1.0);
        for i in 0..=10 {
            let cos_theta = i as f32 / 10.0;
            assert!((coated.reflectance(cos_theta) - in_air.reflectance(cos_theta)).abs().max_element() < 1e-6);
        }
    }

    #[test]
    fn rgb_indices_reflect_channel_by_channel() {
        let (eta, k) = (Rgb::new(0.2, 1.0, 2.0), Rgb::new(3.0, 2.0, 1.0));
        let table = ConductorTable::new(&Spectrum::Rgb(eta), &Spectrum::Rgb(k), 1.0);
        for c in 0..3 {
            let exact = fresnel_conductor(0.5, f64::from(eta[c]), f64::from(k[c])) as f32;
            assert!((table.reflectance(0.5)[c] - exact).abs() < 1e-6);
        }
    }

    proptest! {
        #[test]
        fn reflectance_is_a_fraction(cos_theta in 0.0f64..=1.0, eta in 0.0f64..10.0, k in 0.0f64..10.0) {
            let r = fresnel_conductor(cos_theta, eta, k);
            prop_assert!((0.0..=1.0 + 1e-12).contains(&r), "{r}");
        }
    }

    #[test]
    fn look_ups_stay_in_the_table() {
        let (eta, k) = metal("Au");
        let table = ConductorTable::new(&eta, &k, 1.0);
        for cos_theta in [-1.0, -0.0, 1.0, 2.0, f32::INFINITY, f32::NEG_INFINITY] {
            assert!(table.reflectance(cos_theta).is_finite());
        }
        for outside in [0.0, -1.0, f32::NAN] {
            assert!(ConductorTable::new(&eta, &k, outside).reflectance(0.5).is_finite());
        }
        assert_eq!(table.reflectance(-1.0), table.reflectance(0.0));
        assert_eq!(table.reflectance(2.0), table.reflectance(1.0));
    }
}
