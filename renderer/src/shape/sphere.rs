//! Spheres, partial spheres, and the ellipsoids that affine maps make of them.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::placement::{Placement, azimuth, sweep};
use super::{ShapeHit, ShapeSample, SurfacePoint, finite_solid_angle_pdf, in_range, rounded, usable};
use crate::math::{Transform, warp};

/// A sphere around the origin of its own space, cut at two heights and swept around z.
///
/// u grows with the azimuth, v from z_min to z_max. The normal points outwards unless flipped.
#[derive(Clone, Debug, PartialEq)]
pub struct Sphere {
    placement: Placement,
    radius: f64,
    z_min: f64,
    z_max: f64,
    /// Polar angles of z_min and z_max.
    theta: [f64; 2],
    phi_max: f64,
    /// Nothing is cut away.
    whole: bool,
    /// Its far side is seen through holes.
    holed: bool,
}

impl Sphere {
    /// Heights outside the sphere are moved onto it. `phi_max` in degrees.
    ///
    /// `None`: no surface, or a singular or non-finite transform.
    pub fn new(
        world_from_shape: &Transform,
        reverse_orientation: bool,
        radius: f32,
        [z_min, z_max]: [f32; 2],
        phi_max: f32,
    ) -> Option<Self> {
        if !(radius.is_finite() && radius != 0.0 && z_min.is_finite() && z_max.is_finite() && phi_max > 0.0) {
            return None;
        }
        let radius = f64::from(radius.abs());
        let cut = |z: f32| f64::from(z).clamp(-radius, radius);
        let (z_min, z_max) = (cut(z_min.min(z_max)), cut(z_min.max(z_max)));
        let phi_max = sweep(phi_max);
        let whole = z_min == -radius && z_max == radius && phi_max == TAU;
        let theta = [z_min, z_max].map(|z| (z / radius).clamp(-1.0, 1.0).acos());
        let placement = Placement::new(world_from_shape, reverse_orientation)?;
        (z_max > z_min).then_some(Self { placement, radius, z_min, z_max, theta, phi_max, whole, holed: false })
    }

    /// See [`super::Shape::with_holes`].
    #[must_use]
    pub fn with_holes(self) -> Self {
        Self { holed: true, ..self }
    }

    /// Surface area.
    pub fn area(&self) -> f32 {
        self.placement.world_area(self.local_area(), |u, v| self.at(u, v) / self.radius)
    }

    /// See [`super::Shape::bounds`].
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.placement.circle_bounds(0.0, self.radius, true)
    }

    /// See [`super::Shape::normal_cone`].
    pub fn normal_cone(&self) -> (Vec3, f32) {
        (Vec3::Z, -1.0)
    }

    /// Nearest hit; u, v as for textures.
    pub fn intersect(&self, origin: Vec3, direction: Vec3, t_range: (f32, f32)) -> Option<ShapeHit> {
        let (o, d) = self.placement.local_ray(origin, direction);
        // From the point of the line nearest to the centre, half a chord either way: no difference of large squares.
        let a = d.length_squared();
        let t_nearest = -o.dot(d) / a;
        let middle = o + d * t_nearest;
        let nearest = middle.length();
        let half_chord = ((self.radius - nearest) * (self.radius + nearest) / a).sqrt();
        if half_chord.is_nan() {
            return None;
        }
        [-half_chord, half_chord].into_iter().find_map(|half| {
            let t = t_nearest + half;
            if !in_range(t, t_range) {
                return None;
            }
            // Not o + d·t, which is the centre or anywhere where the sphere is small beyond the digits of t.
            let local = middle + d * half;
            self.parameters(local * (self.radius / local.length())).map(|uv| ShapeHit {
                t: t as f32,
                u: uv.x,
                v: uv.y,
                local: local.as_vec3(),
            })
        })
    }

    /// The differential geometry at a point in the sphere's own space.
    pub fn surface_point(&self, local: Vec3) -> SurfacePoint {
        let local = local.as_dvec3();
        let p = local.normalize_or(DVec3::Z) * self.radius;
        let rho = DVec2::new(p.x, p.y).length();
        let azimuthal = if rho > 0.0 { DVec2::new(p.x, p.y) / rho } else { DVec2::X };
        let dpdv = (azimuthal * p.z).extend(-rho) * (self.theta[1] - self.theta[0]);
        SurfacePoint {
            point: self.placement.point(p),
            n: self.placement.normal(p),
            dpdu: self.placement.vector(DVec3::new(-p.y, p.x, 0.0) * self.phi_max),
            dpdv: self.placement.vector(dpdv),
        }
    }

    /// See [`super::Shape::sample`]. A whole sphere is sampled by solid angle: from outside by the cone that it fills,
    /// from inside by the whole sphere of directions. From the sphere itself it is sampled by area, as are an ellipsoid, a
    /// part and what has holes from anywhere.
    pub fn sample(&self, from: Vec3, u: Vec2) -> Option<ShapeSample> {
        let Some(round) = self.round() else {
            let local = self.at(u.x.into(), u.y.into());
            return self.placement.area_sample(from, local, local / self.radius, u, self.local_area());
        };
        let outwards = round.sample(from, u)?;
        let n_local = self.placement.local_point(round.centre + outwards * round.radius).normalize();
        let local = n_local * self.radius;
        let slack = DVec3::splat(round.radius * f64::EPSILON * 16.0);
        let point = rounded(round.centre + outwards * round.radius, slack);
        let n = self.placement.normal(n_local);
        usable(point, n, self.uv(local), round.pdf(from, point.p, n))
    }

    /// See [`super::Shape::pdf`].
    pub fn pdf(&self, from: Vec3, point: Vec3, n: Vec3) -> f32 {
        match self.round() {
            Some(round) => round.pdf(from, point, n),
            None => self.placement.area_sample_pdf(from, point, n, self.local_area()),
        }
    }

    /// The sphere in world space, if it is whole, hides its far side and is still a sphere there.
    fn round(&self) -> Option<RoundSphere> {
        let scale = self.placement.scale.filter(|_| self.whole && !self.holed)?;
        Some(RoundSphere { centre: self.placement.world_point(DVec3::ZERO), radius: self.radius * scale })
    }

    /// Area in the sphere's own space, by Archimedes' theorem.
    fn local_area(&self) -> f64 {
        self.phi_max * self.radius * (self.z_max - self.z_min)
    }

    /// The point at parameters that are uniform over the area. (Not those of textures: v here is the height.)
    fn at(&self, u: f64, v: f64) -> DVec3 {
        let z = self.z_min + v * (self.z_max - self.z_min);
        let (sin, cos) = (u * self.phi_max).sin_cos();
        let rho = ((self.radius - z) * (self.radius + z)).max(0.0).sqrt();
        DVec3::new(rho * cos, rho * sin, z)
    }

    fn uv(&self, local: DVec3) -> Vec2 {
        let theta = (local.z / self.radius).clamp(-1.0, 1.0).acos();
        let v = (theta - self.theta[0]) / (self.theta[1] - self.theta[0]);
        Vec2::new((azimuth(local) / self.phi_max) as f32, v as f32)
    }

    /// Texture coordinates of a point on the sphere, unless it is cut away.
    fn parameters(&self, local: DVec3) -> Option<Vec2> {
        let inside = self.whole
            || ((self.z_min == -self.radius || local.z >= self.z_min)
                && (self.z_max == self.radius || local.z <= self.z_max)
                && azimuth(local) <= self.phi_max);
        inside.then(|| self.uv(local))
    }
}

/// A whole sphere in world space.
struct RoundSphere {
    centre: DVec3,
    radius: f64,
}

/// Where a sphere is seen from.
enum View {
    Inside,
    /// With 1 − cosine of the half angle of the cone that it fills.
    Outside(f64),
    /// From itself, on a side that rounding hides: its inner side sees all of it, its outer side nothing.
    Touching,
}

impl RoundSphere {
    /// The outward unit normal at the sampled point.
    fn sample(&self, from: Vec3, u: Vec2) -> Option<DVec3> {
        let to_centre = self.centre - from.as_dvec3();
        let one_minus_cos_max = match self.view(from) {
            View::Inside => {
                let direction = warp::uniform_sphere(u).as_dvec3().normalize();
                // From −to_centre inside the sphere of radius 1 along a direction that is uniform: the one exit.
                let o = -to_centre / self.radius;
                let b = o.dot(direction);
                let t = -b + (b * b + 1.0 - o.length_squared()).max(0.0).sqrt();
                return (o + direction * t).try_normalize();
            }
            View::Touching => return warp::uniform_sphere(u).as_dvec3().try_normalize(),
            View::Outside(one_minus_cos_max) => one_minus_cos_max,
        };
        // A direction uniform in the cone, then the nearer of the two points where it meets the sphere, as the angle at
        // the centre: the direction's height above the axis there is sin² θ · d.
        let distance = to_centre.length();
        let drop = f64::from(u.x) * one_minus_cos_max;
        let (cos, sin_squared) = (1.0 - drop, drop * (2.0 - drop));
        let sin_max = self.radius / distance;
        let cos_alpha = sin_squared / sin_max + cos * (1.0 - sin_squared / (sin_max * sin_max)).max(0.0).sqrt();
        let sin_alpha = (1.0 - cos_alpha * cos_alpha).max(0.0).sqrt();
        let (sin_phi, cos_phi) = (f64::from(u.y) * TAU).sin_cos();
        let axis = to_centre / distance;
        let (s, t) = axis.any_orthonormal_pair();
        (axis * -cos_alpha + (s * cos_phi + t * sin_phi) * sin_alpha).try_normalize()
    }

    /// Density (sr⁻¹) of the direction to `point` with the normal `n`.
    fn pdf(&self, from: Vec3, point: Vec3, n: Vec3) -> f32 {
        let uniform_over = |solid_angle_over_2_pi: f64| (1.0 / (TAU * solid_angle_over_2_pi)) as f32;
        match self.view(from) {
            View::Inside => uniform_over(2.0),
            View::Outside(one_minus_cos_max) => uniform_over(one_minus_cos_max),
            View::Touching => finite_solid_angle_pdf(1.0 / (2.0 * TAU * self.radius * self.radius), from, point, n),
        }
    }

    fn view(&self, from: Vec3) -> View {
        let from = from.as_dvec3();
        let squared = self.centre.distance_squared(from);
        // A point of the sphere is rounded by at most 2⁻²⁴ of its coordinates; the same again for what came before that.
        const ROUNDING: f64 = f32::EPSILON as f64;
        if (squared.sqrt() - self.radius).abs() <= ROUNDING * from.length() {
            return View::Touching;
        }
        let sin_squared = self.radius * self.radius / squared;
        if sin_squared >= 1.0 {
            return View::Inside;
        }
        // sin²θ / (1 + cosθ), which does not cancel for a far sphere.
        View::Outside(sin_squared / (1.0 + (1.0 - sin_squared).sqrt()))
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::super::Shape;
    use super::super::testing::{check_geometry, check_sampling, placements};
    use super::*;

    fn sphere(placement: &Transform, z: [f32; 2], phi_max: f32) -> Sphere {
        Sphere::new(placement, false, 1.5, z, phi_max).unwrap()
    }

    #[test]
    fn samples_follow_the_density_from_outside_and_inside_whole_and_cut() {
        for placement in placements() {
            let centre = placement.point(Vec3::ZERO);
            let from = [
                centre + Vec3::new(4.0, 3.0, 1.0),
                centre + Vec3::new(0.3, -0.2, 0.4),
                centre + Vec3::new(-90.0, 20.0, 60.0),
            ];
            check_sampling(&Shape::Sphere(sphere(&placement, [-1.5, 1.5], 360.0).into()), &from);
            check_sampling(&Shape::Sphere(sphere(&placement, [-0.9, 1.2], 250.0).into()), &from);
            check_sampling(&Shape::Sphere(sphere(&placement, [-1.5, 1.5], 360.0).with_holes().into()), &from);
        }
    }

    #[test]
    fn from_its_own_points_a_sphere_is_seen_by_area_whichever_side_they_are_rounded_to() {
        for placement in placements() {
            let sphere = sphere(&placement, [-1.5, 1.5], 360.0);
            let Some(round) = sphere.round() else { continue };
            let mut beside = [0; 2];
            for k in 0..200 {
                let u = Vec2::new((k as f32 + 0.5) / 200.0, (k as f32 * 0.618_034).fract());
                let from = (round.centre + warp::uniform_sphere(u).as_dvec3().normalize() * round.radius).as_vec3();
                beside[usize::from(round.centre.distance(from.as_dvec3()) > round.radius)] += 1;
                // Seen from a point of the sphere, equal areas are equal shares of the cosine.
                let seen = sphere.sample(from, Vec2::new(0.3, 0.8)).unwrap();
                let wi = (seen.point.p - from).as_dvec3().normalize();
                let inwards = (round.centre - from.as_dvec3()).normalize();
                let expected = wi.dot(inwards) / std::f64::consts::PI;
                assert!((f64::from(seen.pdf) / expected - 1.0).abs() < 1e-5, "{} {expected}", seen.pdf);
                assert_eq!(seen.pdf, sphere.pdf(from, seen.point.p, seen.n));
            }
            assert!(beside[0] > 20 && beside[1] > 20, "rounding takes no sides: {beside:?}");
        }
    }

    #[test]
    fn hits_enclose_the_exact_point_and_lie_on_the_surface() {
        for placement in placements() {
            for (z, phi_max) in [([-1.5, 1.5], 360.0), ([-0.9, 1.2], 250.0)] {
                let sphere = sphere(&placement, z, phi_max);
                check_geometry(
                    &Shape::Sphere(sphere.clone().into()),
                    |hit| sphere.surface_point(hit.local),
                    |p| placement.matrix().inverse().transform_point3(p).length() - 1.5,
                );
            }
        }
    }

    #[test]
    fn areas_are_those_of_geometry() {
        let whole = |scale: Vec3| {
            let placement = Transform::new(glam::DMat4::from_scale(scale.as_dvec3()));
            Sphere::new(&placement, false, 1.0, [-1.0, 1.0], 360.0).unwrap().area()
        };
        assert!((whole(Vec3::splat(2.0)) / (16.0 * PI) - 1.0).abs() < 1e-6);
        // An oblate spheroid a = 2, c = 1: 2πa²(1 + (1−e²)/e · artanh e), e² = 3/4.
        let e = 0.75_f32.sqrt();
        let exact = 2.0 * PI * 4.0 * (1.0 + (1.0 - e * e) / e * e.atanh());
        assert!((whole(Vec3::new(2.0, 2.0, 1.0)) / exact - 1.0).abs() < 1e-4, "{}", whole(Vec3::new(2.0, 2.0, 1.0)));
    }

    #[test]
    fn a_mirrored_or_reversed_sphere_turns_its_normals_and_both_turn_them_back() {
        let mirror = Transform::new(glam::DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0)));
        let n = |placement: &Transform, reverse| {
            Sphere::new(placement, reverse, 1.0, [-1.0, 1.0], 360.0).unwrap().surface_point(Vec3::X).n
        };
        assert_eq!(n(&Transform::default(), false), Vec3::X);
        assert_eq!(n(&Transform::default(), true), Vec3::NEG_X);
        assert_eq!(n(&mirror, false), Vec3::X);
        assert_eq!(n(&mirror, true), Vec3::NEG_X);
    }
}
