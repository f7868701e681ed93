//! Reflection and refraction at a plane interface.

use glam::Vec3;

use crate::math::Rgb;
use crate::spectrum::ConductorTable;

/// What a smooth dielectric interface does to a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interface {
    /// Fraction of unpolarised light that is reflected; 1 under total internal reflection.
    pub reflectance: f32,
    /// Cosine of the refracted direction to the normal, on the far side; 0 under total internal reflection.
    pub cos_t: f32,
}

/// Fresnel's equations for a dielectric: `cos_i` in [0, 1], `eta` = index of the far side over that of the near side.
///
/// **Source**: \[Pharr23\] section 9.3.5.
#[inline]
pub fn dielectric(cos_i: f32, eta: f32) -> Interface {
    let cos_i = cos_i.min(1.0);
    let sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
    if sin2_t >= 1.0 {
        return Interface { reflectance: 1.0, cos_t: 0.0 };
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    // Half the sum of (p/q)² and (s/t)², on one denominator: divisions are slow.
    let (p, q) = (eta * cos_i - cos_t, eta * cos_i + cos_t);
    let (s, t) = (cos_i - eta * cos_t, cos_i + eta * cos_t);
    let (pt, sq, qt) = (p * t, s * q, q * t);
    Interface { reflectance: 0.5 * (pt * pt + sq * sq) / (qt * qt), cos_t }
}

/// The direction `w` mirrored at the normal `m`; both unit, pointing away from the surface.
#[inline]
pub fn reflect(w: Vec3, m: Vec3) -> Vec3 {
    2.0 * w.dot(m) * m - w
}

/// The direction `w` refracted at the normal `m` with `cos_i` = `w`·`m` ≥ 0 and `cos_t` and `eta` as in [`dielectric`];
/// unit, pointing away from the surface on the far side. Of a large step of the index `cos_t` has few digits: what comes of
/// it is made unit.
#[inline]
pub fn refract(w: Vec3, m: Vec3, cos_i: f32, cos_t: f32, eta: f32) -> Vec3 {
    let inverse = 1.0 / eta;
    (-inverse * w + (inverse * cos_i - cos_t) * m).normalize()
}

/// Fresnel's equations for a conductor with complex index `eta` − i`k` relative to the near side, per channel.
///
/// **Source**: \[Pharr23\] section 9.3.6, in real arithmetic.
#[inline]
pub fn conductor(cos_i: f32, eta: Rgb, k: Rgb) -> Rgb {
    let cos_i = cos_i.min(1.0);
    let cos2 = cos_i * cos_i;
    let sin2 = 1.0 - cos2;
    let (eta2, k2) = (eta * eta, k * k);
    let t0 = eta2 - k2 - sin2;
    let a2_plus_b2 = (t0 * t0 + 4.0 * eta2 * k2).map(f32::sqrt);
    let a = (0.5 * (a2_plus_b2 + t0)).max(Rgb::ZERO).map(f32::sqrt);
    let (t1, t2) = (a2_plus_b2 + cos2, 2.0 * cos_i * a);
    let perpendicular = (t1 - t2) / (t1 + t2);
    let (t3, t4) = (cos2 * a2_plus_b2 + sin2 * sin2, t2 * sin2);
    let parallel = perpendicular * (t3 - t4) / (t3 + t4);
    (0.5 * (parallel + perpendicular)).clamp(Rgb::ZERO, Rgb::ONE)
}

/// Where a conductor takes its reflectance from.
#[derive(Clone, Copy, Debug)]
pub enum ConductorFresnel<'w> {
    /// The same metal everywhere: integrated over the spectrum at build.
    Table(&'w ConductorTable),
    /// Complex index per channel, relative to the medium above.
    Index {
        /// Real part.
        eta: Rgb,
        /// Extinction.
        k: Rgb,
    },
}

impl ConductorFresnel<'_> {
    /// Reflectance at cosθ in [0, 1].
    #[inline]
    pub fn at(&self, cos_theta: f32) -> Rgb {
        match self {
            Self::Table(table) => table.reflectance(cos_theta),
            Self::Index { eta, k } => conductor(cos_theta, *eta, *k),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_dielectric_has_its_known_limits() {
        // ((η − 1)/(η + 1))² at normal incidence; 1 at grazing; 0 at Brewster's angle for the parallel half.
        assert!((dielectric(1.0, 1.5).reflectance - 0.04).abs() < 1e-6);
        assert!((dielectric(0.0, 1.5).reflectance - 1.0).abs() < 1e-6);
        assert_eq!(dielectric(0.5, 1.0).reflectance, 0.0);
        let brewster = (1.5_f32).atan().cos();
        let perpendicular = (1.5_f32 * 1.5 - 1.0) / (1.5 * 1.5 + 1.0);
        assert!((dielectric(brewster, 1.5).reflectance - 0.5 * perpendicular * perpendicular).abs() < 1e-6);
        // The critical angle from inside: sin = 1/1.5.
        let critical = (1.0 - 1.0 / (1.5_f32 * 1.5)).sqrt();
        assert_eq!(dielectric(critical - 1e-4, 1.0 / 1.5).reflectance, 1.0);
        assert!(dielectric(critical + 1e-3, 1.0 / 1.5).reflectance < 1.0);
    }

    #[test]
    fn a_conductor_has_its_known_limits() {
        let k = Rgb::new(3.0, 2.0, 1.0);
        let eta = Rgb::new(0.2, 0.9, 1.5);
        let normal = ((eta - 1.0) * (eta - 1.0) + k * k) / ((eta + 1.0) * (eta + 1.0) + k * k);
        assert!((conductor(1.0, eta, k) - normal).abs().max_element() < 1e-6);
        assert!((conductor(0.0, eta, k) - Rgb::ONE).abs().max_element() < 1e-6);
        // Without extinction it is a dielectric.
        for cos in [0.1, 0.5, 0.9] {
            let expected = dielectric(cos, 1.5).reflectance;
            assert!((conductor(cos, Rgb::splat(1.5), Rgb::ZERO).x - expected).abs() < 1e-5);
        }
    }

    proptest! {
        #[test]
        fn refraction_obeys_snell_and_is_reversible(theta in 0.0f32..1.57, phi in 0.0f32..6.3, eta in 0.4f32..3.0) {
            let w = Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
            let interface = dielectric(w.z, eta);
            prop_assume!(interface.reflectance < 0.999);
            let t = refract(w, Vec3::Z, w.z, interface.cos_t, eta);
            prop_assert!((t.length() - 1.0).abs() < 1e-5);
            prop_assert!((t.truncate() * eta + w.truncate()).length() < 1e-5);
            // The square of a sine is off by a few roundings of 1, and so is that of a cosine, times η² on the way back: near
            // grazing that is much of it. Reflectance changes by at most 4/a per cosine, a being η cosθₜ and cosθₜ/η.
            let back = dielectric(interface.cos_t, 1.0 / eta);
            let rounding = 8.0 * f32::EPSILON * (1.0 + eta * eta);
            let off = rounding / w.z.max(rounding.sqrt());
            prop_assert!((back.cos_t - w.z).abs() <= off);
            let steepest = 2.0 * (eta + 1.0 / eta) / interface.cos_t;
            prop_assert!((back.reflectance - interface.reflectance).abs() <= steepest * off + 8.0 * f32::EPSILON);
        }
    }
}
