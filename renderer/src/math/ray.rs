//! Rays, and how a ray leaves a surface without meeting it again.

use glam::Vec3;

use super::PointWithError;
use super::interval::{gamma, next_away_from_zero, next_towards_zero};

/// A half line or segment in world space. `direction` need not be unit; hit distances are in its units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: Vec3,
    /// Where it goes.
    pub direction: Vec3,
    /// Exclusive upper end of the valid parameters, in units of `direction`.
    pub t_max: f32,
}

impl Ray {
    /// A ray without end.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction, t_max: f32::INFINITY }
    }

    /// The point at parameter `t`. Rounded: hit points come from the surface instead.
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }
}

/// The ray that leaves `from` along `direction`, starting outside the error box of the surface point.
///
/// `ng` is the unit geometric normal, either side. The origin moves along the normal, to the side that the direction
/// leaves by, until it is out of the box, and is then rounded outwards, so the surface itself cannot be met again.
///
/// **Source**: \[Pharr23\] section 6.8.6.
pub fn spawn_ray(from: PointWithError, ng: Vec3, direction: Vec3) -> Ray {
    Ray::new(offset_origin(from, ng, direction), direction)
}

/// The open segment between two surface points, for a visibility query: `direction` spans it, `t_max` is just below 1.
///
/// A normal of zero marks a point that lies on no surface. What the query computes for the distance of the target's own
/// plane is wrong by rounding in proportion to the length of the segment: with T = n·(v − o) off by γ₄ Σ|nᵢdᵢ| and n·d by
/// γ₃ Σ|nᵢdᵢ|, their quotient by γ₈ Σ|nᵢdᵢ| / |n·d|. The segment ends that much earlier, so a light is not in its own shadow.
pub fn spawn_segment(from: PointWithError, ng_from: Vec3, to: PointWithError, ng_to: Vec3) -> Ray {
    let origin = offset_origin(from, ng_from, to.p - from.p);
    let target = offset_origin(to, ng_to, origin - to.p);
    let direction = target - origin;
    let cosine = ng_to.dot(direction).abs();
    let slack = if cosine > 0.0 { gamma(8) * ng_to.abs().dot(direction.abs()) / cosine } else { 0.0 };
    // One ulp below 1 keeps the end itself open. A target seen edge on has no length left, and no cosine to light with.
    Ray { origin, direction, t_max: next_towards_zero((1.0 - slack).max(0.0)) }
}

fn offset_origin(from: PointWithError, ng: Vec3, direction: Vec3) -> Vec3 {
    let distance = ng.abs().dot(from.error);
    let offset = if ng.dot(direction) < 0.0 { -ng * distance } else { ng * distance };
    let moved = from.p + offset;
    // Without a branch: which sign goes with which is anyone's guess.
    let outward = |value: f32, offset: f32| {
        let from = if value == 0.0 { 0.0_f32.copysign(offset) } else { value };
        let away = next_away_from_zero(from);
        let towards = f32::from_bits(from.to_bits().wrapping_sub(1));
        let next = if from.is_sign_positive() == offset.is_sign_positive() { away } else { towards };
        if offset == 0.0 { value } else { next }
    };
    Vec3::new(outward(moved.x, offset.x), outward(moved.y, offset.y), outward(moved.z, offset.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spawned_ray_starts_beyond_the_error_box_on_the_side_it_leaves_by() {
        let from = PointWithError { p: Vec3::new(1.0e4, -3.0, 0.5), error: Vec3::new(1.0e-3, 1.0e-6, 2.0e-6) };
        for ng in [Vec3::X, Vec3::new(0.6, 0.0, 0.8), -Vec3::Z] {
            for direction in [Vec3::new(1.0, 0.2, 0.1), Vec3::new(-1.0, 0.2, -0.4)] {
                let ray = spawn_ray(from, ng, direction);
                let side = ng.dot(direction).signum();
                let height = (ray.origin - from.p).as_dvec3().dot(ng.as_dvec3()) * f64::from(side);
                assert!(height >= f64::from(ng.abs().dot(from.error)) * 0.999_999, "{height}");
            }
        }
    }

    #[test]
    fn a_segment_between_exact_points_spans_them() {
        let a = PointWithError::exact(Vec3::ZERO);
        let b = PointWithError::exact(Vec3::new(0.0, 0.0, 4.0));
        let ray = spawn_segment(a, Vec3::ZERO, b, Vec3::ZERO);
        assert_eq!((ray.origin, ray.direction), (a.p, b.p));
        assert!(ray.t_max < 1.0);
    }
}
