//! Disks and rings.

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::placement::{Placement, azimuth, sweep};
use super::{ShapeHit, ShapeSample, SurfacePoint, in_range};
use crate::math::{Transform, warp};

/// A disk orthogonal to the z axis of its own space, with an optional hole, swept around z.
///
/// u grows with the azimuth, v from the rim to the hole. The normal is +z unless flipped.
#[derive(Clone, Debug, PartialEq)]
pub struct Disk {
    placement: Placement,
    height: f64,
    radius: f64,
    inner_radius: f64,
    phi_max: f64,
}

impl Disk {
    /// `phi_max` in degrees.
    ///
    /// `None`: no surface, or a singular or non-finite transform.
    pub fn new(
        world_from_shape: &Transform,
        reverse_orientation: bool,
        height: f32,
        radius: f32,
        inner_radius: f32,
        phi_max: f32,
    ) -> Option<Self> {
        let (radius, inner_radius) = (f64::from(radius.abs()), f64::from(inner_radius.abs()));
        let sound = height.is_finite() && radius.is_finite() && radius > inner_radius && phi_max > 0.0;
        let placement = Placement::new(world_from_shape, reverse_orientation)?;
        sound.then(|| Self { placement, height: height.into(), radius, inner_radius, phi_max: sweep(phi_max) })
    }

    /// Surface area.
    pub fn area(&self) -> f32 {
        (self.local_area() * self.placement.area_ratio(DVec3::Z)) as f32
    }

    /// See [`super::Shape::bounds`].
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.placement.circle_bounds(self.height, self.radius, false)
    }

    /// See [`super::Shape::normal_cone`].
    pub fn normal_cone(&self) -> (Vec3, f32) {
        (self.placement.normal(DVec3::Z), 1.0)
    }

    /// The hit; u, v as for textures.
    pub fn intersect(&self, origin: Vec3, direction: Vec3, t_range: (f32, f32)) -> Option<ShapeHit> {
        let (o, d) = self.placement.local_ray(origin, direction);
        let t = (self.height - o.z) / d.z;
        if !in_range(t, t_range) {
            return None;
        }
        let local = o + d * t;
        let rho = DVec2::new(local.x, local.y).length();
        let phi = azimuth(local);
        let inside = rho <= self.radius && rho >= self.inner_radius && phi <= self.phi_max;
        inside.then(|| {
            let uv = self.uv(rho, phi);
            ShapeHit { t: t as f32, u: uv.x, v: uv.y, local: local.as_vec3() }
        })
    }

    /// The differential geometry at a point in the disk's own space.
    pub fn surface_point(&self, local: Vec3) -> SurfacePoint {
        let p = local.as_dvec3().with_z(self.height);
        let radial = DVec2::new(p.x, p.y).normalize_or_zero() * (self.inner_radius - self.radius);
        SurfacePoint {
            point: self.placement.point(p),
            n: self.placement.normal(DVec3::Z),
            dpdu: self.placement.vector(DVec3::new(-p.y, p.x, 0.0) * self.phi_max),
            dpdv: self.placement.vector(radial.extend(0.0)),
        }
    }

    /// See [`super::Shape::sample`]: uniform over the area, which an affine map keeps uniform.
    pub fn sample(&self, from: Vec3, u: Vec2) -> Option<ShapeSample> {
        let (p, uv) = if self.inner_radius == 0.0 && self.phi_max == std::f64::consts::TAU {
            let p = warp::concentric_disk(u).as_dvec2() * self.radius;
            (p, self.uv(p.length(), azimuth(p.extend(0.0))))
        } else {
            let squared = |r: f64| r * r;
            let (outer, inner) = (squared(self.radius), squared(self.inner_radius));
            let rho = (inner + f64::from(u.x) * (outer - inner)).sqrt();
            let phi = f64::from(u.y) * self.phi_max;
            (DVec2::from_angle(phi) * rho, self.uv(rho, phi))
        };
        self.placement.area_sample(from, p.extend(self.height), DVec3::Z, uv, self.local_area())
    }

    /// See [`super::Shape::pdf`].
    pub fn pdf(&self, from: Vec3, point: Vec3, n: Vec3) -> f32 {
        self.placement.area_sample_pdf(from, point, n, self.local_area())
    }

    fn local_area(&self) -> f64 {
        0.5 * self.phi_max * (self.radius - self.inner_radius) * (self.radius + self.inner_radius)
    }

    fn uv(&self, rho: f64, phi: f64) -> Vec2 {
        let v = (self.radius - rho) / (self.radius - self.inner_radius);
        Vec2::new((phi / self.phi_max) as f32, v as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Shape;
    use super::super::testing::{check_geometry, check_sampling, placements};
    use super::*;

    #[test]
    fn samples_follow_the_density() {
        for placement in placements() {
            let centre = placement.point(Vec3::new(0.0, 0.0, 0.5));
            let from = [centre + Vec3::new(0.4, 0.3, 1.0), centre + Vec3::new(-5.0, 2.0, -3.0)];
            let whole = Disk::new(&placement, false, 0.5, 1.5, 0.0, 360.0).unwrap();
            let part = Disk::new(&placement, true, 0.5, 1.5, 0.6, 200.0).unwrap();
            check_sampling(&Shape::Disk(whole.into()), &from);
            check_sampling(&Shape::Disk(part.into()), &from);
        }
    }

    #[test]
    fn hits_enclose_the_exact_point_and_lie_on_the_surface() {
        for placement in placements() {
            let disk = Disk::new(&placement, false, 0.5, 1.5, 0.6, 200.0).unwrap();
            check_geometry(
                &Shape::Disk(disk.clone().into()),
                |hit| disk.surface_point(hit.local),
                |p| placement.matrix().inverse().transform_point3(p).z - 0.5,
            );
        }
    }

    #[test]
    fn a_ray_in_the_plane_misses() {
        let disk = Disk::new(&Transform::default(), false, 0.0, 1.0, 0.0, 360.0).unwrap();
        assert_eq!(disk.intersect(Vec3::X * -3.0, Vec3::X, (0.0, f32::INFINITY)), None);
        assert!(Disk::new(&Transform::default(), false, 0.0, 1.0, 1.0, 360.0).is_none());
    }
}
