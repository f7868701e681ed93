//! Orthonormal frames and directions in them.

use glam::Vec3;

use super::unit;

/// A unit direction in the frame of a surface: `z` is along the shading normal.
///
/// Made only by [`Frame::to_local`], by the warps and by reflection and refraction within the frame, so a world-space
/// vector cannot be handed to a BSDF by mistake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalDir(Vec3);

impl LocalDir {
    /// A direction whose coordinates are already those of the frame. `v` is unit to rounding.
    pub fn new(v: Vec3) -> Self {
        debug_assert!((v.length_squared() - 1.0).abs() < 1e-3, "not unit: {v}");
        Self(v)
    }

    /// The coordinates.
    pub fn vec(self) -> Vec3 {
        self.0
    }

    /// Cosine of the angle to the shading normal, negative below the surface.
    pub fn cos_theta(self) -> f32 {
        self.0.z
    }

    /// Absolute cosine of the angle to the shading normal.
    pub fn abs_cos_theta(self) -> f32 {
        self.0.z.abs()
    }

    /// Both directions on one side of the surface; a direction in the tangent plane is on no side.
    pub fn same_hemisphere(self, other: LocalDir) -> bool {
        self.0.z * other.0.z > 0.0
    }

    /// The direction mirrored to the other side of the surface.
    pub fn flipped(self) -> Self {
        Self(Vec3::new(self.0.x, self.0.y, -self.0.z))
    }

    /// The opposite direction.
    pub fn reversed(self) -> Self {
        Self(-self.0)
    }
}

/// How much of a tangent's square must be left without its part along the normal: more than rounding leaves, or its direction
/// means nothing.
const REST: f32 = 1e-10;

/// A right-handed orthonormal frame: tangent `s`, bitangent `t`, normal `n`, in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Tangent.
    pub s: Vec3,
    /// Bitangent.
    pub t: Vec3,
    /// Normal.
    pub n: Vec3,
}

impl Frame {
    /// A frame around the unit normal `n`, with an arbitrary but deterministic tangent.
    ///
    /// **Source**: \[Duff17\] listing 3.
    pub fn from_normal(n: Vec3) -> Self {
        let sign = 1.0_f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// A frame around the unit normal `n` whose tangent is `tangent` made orthogonal to it; any tangent if that is
    /// degenerate.
    pub fn from_normal_and_tangent(n: Vec3, tangent: Vec3) -> Self {
        let squared = tangent.length_squared();
        if !(f32::MIN_POSITIVE / REST..=f32::MAX).contains(&squared) {
            return Self::from_extreme_tangent(n, tangent);
        }
        let s = tangent - n * n.dot(tangent);
        if s.length_squared() <= REST * squared {
            return Self::from_normal(n);
        }
        let s = s.normalize();
        Self { s, t: n.cross(s), n }
    }

    /// The same where the square of the tangent, or of what is left of it, leaves the range of `f32`.
    #[cold]
    fn from_extreme_tangent(n: Vec3, tangent: Vec3) -> Self {
        unit(tangent).map_or_else(|| Self::from_normal(n), |tangent| Self::from_normal_and_tangent(n, tangent))
    }

    /// World to local.
    pub fn to_local(&self, v: Vec3) -> LocalDir {
        LocalDir(Vec3::new(v.dot(self.s), v.dot(self.t), v.dot(self.n)))
    }

    /// Local to world.
    pub fn to_world(&self, v: LocalDir) -> Vec3 {
        self.s * v.0.x + self.t * v.0.y + self.n * v.0.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn frames_are_orthonormal_for_tangents_of_any_length() {
        let n = Vec3::new(0.48, -0.6, 0.64);
        let expected = Frame::from_normal_and_tangent(n, Vec3::new(0.3, 0.5, -0.2));
        for exponent in -45..=38 {
            let scale = 10_f64.powi(exponent);
            let tangent = (glam::DVec3::new(0.3, 0.5, -0.2) * scale).as_vec3();
            let frame = Frame::from_normal_and_tangent(n, tangent);
            assert!((frame.s.length() - 1.0).abs() < 1e-6 && frame.s.dot(n).abs() < 1e-6, "10^{exponent}: {frame:?}");
            // Where the tangent itself has its digits, its direction is kept.
            assert!(exponent < -37 || frame.s.distance(expected.s) < 1e-6, "10^{exponent}: {frame:?}");
        }
        for strange in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY] {
            assert!((Frame::from_normal_and_tangent(n, strange).s.length() - 1.0).abs() < 1e-6);
        }
    }

    proptest! {
        #[test]
        fn frames_are_orthonormal_and_invert(x in -1.0f32..1.0, y in -1.0f32..1.0, z in -1.0f32..1.0) {
            let v = Vec3::new(x, y, z);
            prop_assume!(v.length() > 1e-3);
            let frame = Frame::from_normal(v.normalize());
            prop_assert!(frame.s.dot(frame.t).abs() < 1e-6);
            prop_assert!((frame.s.cross(frame.t) - frame.n).length() < 1e-6);
            let w = Vec3::new(z, x, -y).normalize();
            prop_assert!((frame.to_world(frame.to_local(w)) - w).length() < 1e-6);
        }
    }

    #[test]
    fn a_tangent_along_the_normal_falls_back() {
        let frame = Frame::from_normal_and_tangent(Vec3::Z, Vec3::Z * 3.0);
        assert!(frame.s.is_finite() && frame.s.dot(Vec3::Z).abs() < 1e-6);
    }
}
