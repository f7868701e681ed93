//! Affine transforms between spaces.

use glam::{DMat4, DVec4, Mat4, Vec3};

/// An affine or projective map with its inverse. Products are formed in `f64`, so that a long chain of file directives
/// rounds only once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    forward: DMat4,
    inverse: DMat4,
}

impl Default for Transform {
    fn default() -> Self {
        Self { forward: DMat4::IDENTITY, inverse: DMat4::IDENTITY }
    }
}

impl Transform {
    /// The map with matrix `m`. A singular matrix has an inverse of non-finite numbers: see [`Self::is_invertible`].
    pub fn new(m: DMat4) -> Self {
        Self { forward: m, inverse: m.inverse() }
    }

    /// The map with matrix `m` whose inverse is known.
    pub fn with_inverse(m: DMat4, inverse: DMat4) -> Self {
        Self { forward: m, inverse }
    }

    /// Whether an inverse exists.
    pub fn is_invertible(&self) -> bool {
        self.forward.is_finite() && self.inverse.is_finite()
    }

    /// The matrix, in `f64`.
    pub fn matrix(&self) -> DMat4 {
        self.forward
    }

    /// The matrix, rounded to `f32`.
    pub fn matrix_f32(&self) -> Mat4 {
        self.forward.as_mat4()
    }

    /// The inverse map.
    pub fn inverse(&self) -> Self {
        Self { forward: self.inverse, inverse: self.forward }
    }

    /// Applies to a point, dividing by w.
    pub fn point(&self, p: Vec3) -> Vec3 {
        self.forward.project_point3(p.as_dvec3()).as_vec3()
    }

    /// Applies to a vector: no translation.
    pub fn vector(&self, v: Vec3) -> Vec3 {
        self.forward.transform_vector3(v.as_dvec3()).as_vec3()
    }

    /// Applies to a normal: by the transpose of the inverse, not normalised.
    pub fn normal(&self, n: Vec3) -> Vec3 {
        let v: DVec4 = self.inverse.transpose() * n.as_dvec3().extend(0.0);
        v.truncate().as_vec3()
    }

    /// Whether the map turns a right-handed frame into a left-handed one.
    pub fn swaps_handedness(&self) -> bool {
        glam::DMat3::from_mat4(self.forward).determinant() < 0.0
    }
}

impl std::ops::Mul for Transform {
    type Output = Transform;

    /// `a_from_b * b_from_c = a_from_c`.
    fn mul(self, rhs: Transform) -> Transform {
        Transform { forward: self.forward * rhs.forward, inverse: rhs.inverse * self.inverse }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn products_apply_right_to_left_and_invert() {
        let a = Transform::new(DMat4::from_translation(DVec3::new(1.0, 2.0, 3.0)));
        let b = Transform::new(DMat4::from_scale(DVec3::new(2.0, -4.0, 8.0)));
        let p = Vec3::new(1.0, 1.0, 1.0);
        assert_eq!((a * b).point(p), Vec3::new(3.0, -2.0, 11.0));
        assert_eq!((a * b).inverse().point((a * b).point(p)), p);
        assert!(b.swaps_handedness() && !a.swaps_handedness());
        assert_eq!(b.normal(Vec3::Y), Vec3::new(0.0, -0.25, 0.0));
    }
}
