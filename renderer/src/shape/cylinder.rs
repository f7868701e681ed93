//! Open cylinders.

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::placement::{Placement, azimuth, sweep};
use super::{ShapeHit, ShapeSample, SurfacePoint, in_range};
use crate::math::Transform;

/// A cylinder around the z axis of its own space, without caps, swept around z.
///
/// u grows with the azimuth, v with the height. The normal points outwards unless flipped.
#[derive(Clone, Debug, PartialEq)]
pub struct Cylinder {
    placement: Placement,
    radius: f64,
    z_min: f64,
    z_max: f64,
    phi_max: f64,
}

impl Cylinder {
    /// `phi_max` in degrees.
    ///
    /// `None`: no surface, or a singular or non-finite transform.
    pub fn new(
        world_from_shape: &Transform,
        reverse_orientation: bool,
        radius: f32,
        [z_min, z_max]: [f32; 2],
        phi_max: f32,
    ) -> Option<Self> {
        let (low, high) = (f64::from(z_min.min(z_max)), f64::from(z_min.max(z_max)));
        let sound = radius.is_finite() && radius != 0.0 && low.is_finite() && high.is_finite();
        let placement = Placement::new(world_from_shape, reverse_orientation)?;
        (sound && high > low && phi_max > 0.0).then(|| Self {
            placement,
            radius: f64::from(radius.abs()),
            z_min: low,
            z_max: high,
            phi_max: sweep(phi_max),
        })
    }

    /// Surface area.
    pub fn area(&self) -> f32 {
        self.placement.world_area(self.local_area(), |u, _| self.outwards(u))
    }

    /// See [`super::Shape::bounds`].
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let (low, high) = self.placement.circle_bounds(self.z_min, self.radius, false);
        let (low_top, high_top) = self.placement.circle_bounds(self.z_max, self.radius, false);
        (low.min(low_top), high.max(high_top))
    }

    /// See [`super::Shape::normal_cone`]: all normals are orthogonal to the axis, M⁻ᵀn · Mz = n · z.
    pub fn normal_cone(&self) -> (Vec3, f32) {
        (self.placement.vector(DVec3::Z).normalize_or(Vec3::Z), 0.0)
    }

    /// Nearest hit; u, v as for textures.
    pub fn intersect(&self, origin: Vec3, direction: Vec3, t_range: (f32, f32)) -> Option<ShapeHit> {
        let (o, d) = self.placement.local_ray(origin, direction);
        // As for the sphere, in the plane orthogonal to the axis.
        let (o2, d2) = (DVec2::new(o.x, o.y), DVec2::new(d.x, d.y));
        let a = d2.length_squared();
        let t_nearest = -o2.dot(d2) / a;
        let nearest = (o2 + d2 * t_nearest).length();
        let half_chord = ((self.radius - nearest) * (self.radius + nearest) / a).sqrt();
        if !half_chord.is_finite() {
            return None;
        }
        [t_nearest - half_chord, t_nearest + half_chord].into_iter().filter(|&t| in_range(t, t_range)).find_map(|t| {
            let local = o + d * t;
            let phi = azimuth(local);
            (local.z >= self.z_min && local.z <= self.z_max && phi <= self.phi_max).then(|| {
                let v = (local.z - self.z_min) / (self.z_max - self.z_min);
                ShapeHit { t: t as f32, u: (phi / self.phi_max) as f32, v: v as f32, local: local.as_vec3() }
            })
        })
    }

    /// The differential geometry at a point in the cylinder's own space.
    pub fn surface_point(&self, local: Vec3) -> SurfacePoint {
        let local = local.as_dvec3();
        let outwards = DVec2::new(local.x, local.y).normalize_or(DVec2::X);
        let p = (outwards * self.radius).extend(local.z);
        SurfacePoint {
            point: self.placement.point(p),
            n: self.placement.normal(outwards.extend(0.0)),
            dpdu: self.placement.vector(DVec3::new(-p.y, p.x, 0.0) * self.phi_max),
            dpdv: self.placement.vector(DVec3::Z * (self.z_max - self.z_min)),
        }
    }

    /// See [`super::Shape::sample`]: uniform over the area in the cylinder's own space.
    pub fn sample(&self, from: Vec3, u: Vec2) -> Option<ShapeSample> {
        let n = self.outwards(u.x.into());
        let z = self.z_min + f64::from(u.y) * (self.z_max - self.z_min);
        self.placement.area_sample(from, (n * self.radius).with_z(z), n, u, self.local_area())
    }

    /// See [`super::Shape::pdf`].
    pub fn pdf(&self, from: Vec3, point: Vec3, n: Vec3) -> f32 {
        self.placement.area_sample_pdf(from, point, n, self.local_area())
    }

    fn local_area(&self) -> f64 {
        self.phi_max * self.radius * (self.z_max - self.z_min)
    }

    fn outwards(&self, u: f64) -> DVec3 {
        DVec2::from_angle(u * self.phi_max).extend(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Shape;
    use super::super::testing::{check_geometry, check_sampling, placements};
    use super::*;

    #[test]
    fn samples_follow_the_density_from_outside_and_inside() {
        for placement in placements() {
            let centre = placement.point(Vec3::new(0.0, 0.0, 0.3));
            let from = [centre + Vec3::new(4.0, 3.0, 1.0), centre + Vec3::new(0.1, -0.2, 0.1)];
            let whole = Cylinder::new(&placement, false, 1.0, [-1.0, 1.5], 360.0).unwrap();
            let part = Cylinder::new(&placement, true, 1.0, [-1.0, 1.5], 140.0).unwrap();
            check_sampling(&Shape::Cylinder(whole.into()), &from);
            check_sampling(&Shape::Cylinder(part.into()), &from);
        }
    }

    #[test]
    fn hits_enclose_the_exact_point_and_lie_on_the_surface() {
        for placement in placements() {
            let cylinder = Cylinder::new(&placement, false, 1.0, [-1.0, 1.5], 300.0).unwrap();
            check_geometry(
                &Shape::Cylinder(cylinder.clone().into()),
                |hit| cylinder.surface_point(hit.local),
                |p| {
                    let local = placement.matrix().inverse().transform_point3(p);
                    DVec2::new(local.x, local.y).length() - 1.0
                },
            );
        }
    }

    #[test]
    fn a_ray_along_the_axis_misses() {
        let cylinder = Cylinder::new(&Transform::default(), false, 1.0, [-1.0, 1.0], 360.0).unwrap();
        assert_eq!(cylinder.intersect(Vec3::new(0.3, 0.0, -5.0), Vec3::Z, (0.0, f32::INFINITY)), None);
    }
}
