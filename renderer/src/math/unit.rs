//! Directions of vectors of any length.

use glam::{Vec3, Vec3A};

/// `v` made unit, also where its squared length leaves the range of `f32`; `None` for zero and what is not finite.
#[inline]
pub fn unit(v: Vec3) -> Option<Vec3> {
    Some(unit_and_inverse_length(v.into())?.0.into())
}

/// The same with the inverse of the length.
#[inline]
pub fn unit_and_inverse_length(v: Vec3A) -> Option<(Vec3A, f32)> {
    let squared = v.length_squared();
    if !(f32::MIN_POSITIVE..=f32::MAX).contains(&squared) {
        return extreme_unit_and_inverse_length(v);
    }
    let inverse = squared.sqrt().recip();
    Some((v * inverse, inverse))
}

#[cold]
fn extreme_unit_and_inverse_length(v: Vec3A) -> Option<(Vec3A, f32)> {
    let v = v.as_dvec3();
    let length = v.length();
    (length > 0.0 && length.is_finite()).then(|| ((v / length).as_vec3a(), length.recip() as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_of_any_length_have_a_direction() {
        for exponent in -38..=38 {
            let length = 10_f32.powi(exponent);
            let (unit, inverse) = unit_and_inverse_length(Vec3A::new(0.6, 0.0, -0.8) * length).unwrap();
            assert!(unit.distance(Vec3A::new(0.6, 0.0, -0.8)) < 1e-6, "10^{exponent}: {unit}");
            assert!((inverse * length - 1.0).abs() < 1e-6, "10^{exponent}: {inverse}");
        }
        assert_eq!(unit(Vec3::new(0.0, 1e-45, 0.0)), Some(Vec3::Y));
        assert_eq!([Vec3::ZERO, Vec3::NAN, Vec3::INFINITY].map(unit), [None; 3]);
    }
}
