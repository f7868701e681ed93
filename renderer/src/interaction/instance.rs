//! Placed copies of objects.

use glam::{Affine3A, DMat3, Mat3, Mat3A, Vec3, Vec3A};

use super::local::{Local, Placed};
use crate::math::{gamma, unit_and_inverse_length};

/// A placed copy of an object: its transform, and how the ray query rounds when it takes rays into object space.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Index of the object's first surface.
    pub first_surface: u32,
    /// Its own index among the instances of its [`super::Geometry`].
    pub(super) number: u32,
    /// The transform, as the ray query has it.
    world_from_object: Affine3A,
    /// Takes normals to world space: the transposed inverse of the linear part, rounded from f64.
    normal_matrix: Mat3A,
    /// Bound of the error of each element of the inverse that the ray query computes in f32.
    inverse_error: f32,
}

impl Instance {
    /// `None`: the transform has no finite inverse.
    pub fn new(world_from_object: Affine3A, first_surface: u32) -> Option<Self> {
        let m = Mat3::from(world_from_object.matrix3).as_dmat3();
        let inverse = m.inverse();
        let sound = world_from_object.is_finite() && inverse.as_mat3().is_finite();
        sound.then(|| Self {
            first_surface,
            number: 0,
            world_from_object,
            normal_matrix: Mat3A::from(inverse.transpose().as_mat3()),
            inverse_error: inverse_error(m, inverse) as f32,
        })
    }

    /// Object to world.
    pub fn world_from_object(&self) -> Affine3A {
        self.world_from_object
    }

    /// A point, object to world, rounded.
    pub fn point(&self, p: Vec3) -> Vec3 {
        self.world_from_object.transform_point3(p)
    }

    /// A vector, object to world.
    #[inline]
    pub fn vector(&self, v: Vec3) -> Vec3 {
        self.world_from_object.transform_vector3(v)
    }

    /// A normal, object to world, not normalised.
    #[inline]
    pub fn normal(&self, n: Vec3) -> Vec3 {
        (self.normal_matrix * Vec3A::from(n)).into()
    }

    /// The hit in world space, with an error bound that keeps spawned rays clear of the surface.
    ///
    /// The ray query takes the origin back to object space as o′ = M⁻¹(o − t), with an inverse in f32. A surface is clear
    /// of o′ if the point's own clearance in object space and the error of o′ along the normal are kept; a distance d along
    /// the world normal is |M⁻ᵀn|·d in object space.
    ///
    /// The error of o′ has two parts. The inverse differs from the exact one by up to e in each element; as its translation
    /// is formed with the same elements, this acts on o − t only: e·Σ|oᵢ − tᵢ|. And forming the translation (γ₃) and
    /// transforming (γ₄) round terms as large as |M⁻¹||t| and |M⁻¹|(|o| + |t|): γ₇|M⁻¹|(|o| + |t|) holds both. The direction
    /// is transformed with the same elements, so a ray that leaves in the tangent plane may come back as described in
    /// [`super::rounding`]: the same bounds for a vector as long as the primitive's extent in the world are to spare.
    #[inline]
    pub(super) fn apply(&self, local: &Local) -> Placed {
        let (m, translation) = (&self.world_from_object.matrix3, self.world_from_object.translation);
        let relative = *m * local.p;
        let p = relative + translation;
        let m = abs(m);
        let rounding = gamma(4) * (m * local.p.abs() + translation.abs());

        // None only where the matrix takes f32 beyond its range.
        let (ng, inverse_stretch) = unit_and_inverse_length(self.normal_matrix * local.ng).unwrap_or((local.ng, 0.0));
        // |n|ᵀ|M⁻¹|
        let seen = abs(&self.normal_matrix) * local.ng.abs();
        let extent = Vec3A::splat((m * local.extent).element_sum());
        let of_inverse = self.inverse_error * local.ng.abs().element_sum() * (relative.abs() + extent).element_sum();
        let origin_error = of_inverse + gamma(7) * seen.dot(p.abs() + translation.abs() + extent);
        let clearance = (local.clearance + origin_error) * inverse_stretch;
        let error = m * local.error + rounding + ng.abs() * clearance;
        Placed::new(p, error, ng, local.ns.map(|ns| self.normal_matrix * ns))
    }
}

#[inline]
fn abs(m: &Mat3A) -> Mat3A {
    Mat3A::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs())
}

/// Bound of the error of an element of M⁻¹ when computed in f32 as adjoint over determinant.
///
/// An element of the adjoint is a difference of two products, in error by γ₂ of both; the determinant is three of those
/// times an element, summed, in error by γ₅ of its terms. With P for the same sums with all signs positive, the quotient
/// errs by γ₂ P(adj)/|det| + |M⁻¹| (γ₅ P(det)/|det| + γ₂).
fn inverse_error(m: DMat3, inverse: DMat3) -> f64 {
    let [a, b, c] = [m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs()];
    let positive_cross = |a: glam::DVec3, b: glam::DVec3| {
        glam::DVec3::new(a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x)
    };
    let adjoint = [positive_cross(b, c), positive_cross(c, a), positive_cross(a, b)];
    let determinant = m.determinant().abs();
    let condition = a.dot(adjoint[0]) / determinant;
    let largest_adjoint = adjoint.iter().map(|row| row.max_element()).fold(0.0, f64::max);
    let largest_inverse = inverse.to_cols_array().iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    let gamma = |n: u32| f64::from(gamma(n));
    gamma(2) * largest_adjoint / determinant + largest_inverse * (gamma(5) * condition + gamma(2))
}
