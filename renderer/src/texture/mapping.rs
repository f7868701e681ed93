//! From a hit to the coordinates that a texture is a function of.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::{Affine3A, Vec2, Vec3};

use super::TexturePoint;
use super::pyramid::Footprint;
use crate::math::Transform;
use crate::scene::description::{self, Mapping2D};

/// Two texture coordinates and how they change from pixel to pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point2 {
    /// Coordinates s and t.
    pub st: Vec2,
    /// Their derivatives.
    pub footprint: Footprint,
}

/// A position in texture space and how it changes from pixel to pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point3 {
    /// Position.
    pub p: Vec3,
    /// Per pixel in x.
    pub dpdx: Vec3,
    /// Per pixel in y.
    pub dpdy: Vec3,
}

/// [`Mapping2D`] with its transform ready for use.
#[derive(Clone, Copy, Debug)]
pub enum Map2 {
    /// Scale and offset of uv.
    Uv { scale: Vec2, delta: Vec2 },
    /// Polar and azimuthal angle.
    Spherical(Affine3A),
    /// Azimuthal angle and height.
    Cylindrical(Affine3A),
    /// Lengths along two axes.
    Planar { texture_from_world: Affine3A, vs: Vec3, vt: Vec3, delta: Vec2 },
}

/// A 2D or 3D domain with its transform ready for use.
#[derive(Clone, Copy, Debug)]
pub enum Map {
    /// Two dimensions.
    Two(Map2),
    /// Three.
    Three(Affine3A),
}

impl From<&description::Mapping> for Map {
    fn from(mapping: &description::Mapping) -> Self {
        match mapping {
            description::Mapping::Two(two) => Self::Two(two.into()),
            description::Mapping::Three(texture_from_world) => Self::Three(affine(texture_from_world)),
        }
    }
}

impl From<&Mapping2D> for Map2 {
    fn from(mapping: &Mapping2D) -> Self {
        match *mapping {
            Mapping2D::Uv { scale, delta } => Self::Uv { scale, delta },
            Mapping2D::Spherical(ref transform) => Self::Spherical(affine(transform)),
            Mapping2D::Cylindrical(ref transform) => Self::Cylindrical(affine(transform)),
            Mapping2D::Planar { ref texture_from_world, vs, vt, delta } => {
                Self::Planar { texture_from_world: affine(texture_from_world), vs, vt, delta }
            }
        }
    }
}

/// The affine part, rounded to `f32`.
pub fn affine(transform: &Transform) -> Affine3A {
    Affine3A::from_mat4(transform.matrix_f32())
}

/// The point in the texture space of `texture_from_world`.
#[inline]
pub fn map3(texture_from_world: &Affine3A, at: &TexturePoint) -> Point3 {
    Point3 {
        p: texture_from_world.transform_point3(at.p),
        dpdx: texture_from_world.transform_vector3(at.dpdx),
        dpdy: texture_from_world.transform_vector3(at.dpdy),
    }
}

impl Map2 {
    /// The coordinates at a hit, pbrt's: t grows upwards.
    ///
    /// **Source**: \[Pharr23\] section 10.2. The derivatives of the spherical mapping are those of its own s and t, which
    /// pbrt-v4 exchanges.
    #[inline]
    pub fn at(&self, at: &TexturePoint) -> Point2 {
        match self {
            Self::Uv { scale, delta } => Point2 {
                st: *scale * at.uv + *delta,
                footprint: Footprint { dx: *scale * at.duvdx, dy: *scale * at.duvdy },
            },
            Self::Spherical(texture_from_world) => spherical(&map3(texture_from_world, at)),
            Self::Cylindrical(texture_from_world) => cylindrical(&map3(texture_from_world, at)),
            Self::Planar { texture_from_world, vs, vt, delta } => {
                let Point3 { p, dpdx, dpdy } = map3(texture_from_world, at);
                let along = |v: Vec3| Vec2::new(v.dot(*vs), v.dot(*vt));
                Point2 { st: *delta + along(p), footprint: Footprint { dx: along(dpdx), dy: along(dpdy) } }
            }
        }
    }
}

/// (θ/π, φ/2π) with θ from +z and φ from +x.
fn spherical(at: &Point3) -> Point2 {
    let p = at.p;
    let (r2, radius) = (p.length_squared(), p.truncate().length());
    let theta = radius.atan2(p.z);
    let dtheta = Vec3::new(p.x * p.z / radius, p.y * p.z / radius, -radius) / (PI * r2);
    let dphi = dphi(p);
    let derivative = |dp: Vec3| finite(Vec2::new(dtheta.dot(dp), dphi.dot(dp)));
    Point2 {
        st: Vec2::new(theta * FRAC_1_PI, positive_angle(p) / (2.0 * PI)),
        footprint: Footprint { dx: derivative(at.dpdx), dy: derivative(at.dpdy) },
    }
}

/// ((π + φ)/2π, z), with φ in (−π, π] from +x.
fn cylindrical(at: &Point3) -> Point2 {
    let p = at.p;
    let dphi = dphi(p);
    let derivative = |dp: Vec3| finite(Vec2::new(dphi.dot(dp), dp.z));
    Point2 {
        st: Vec2::new((PI + p.y.atan2(p.x)) / (2.0 * PI), p.z),
        footprint: Footprint { dx: derivative(at.dpdx), dy: derivative(at.dpdy) },
    }
}

/// Gradient of φ/2π.
fn dphi(p: Vec3) -> Vec3 {
    Vec3::new(-p.y, p.x, 0.0) / (2.0 * PI * p.truncate().length_squared())
}

/// On the axis an angle has no derivative: there the footprint says nothing.
fn finite(v: Vec2) -> Vec2 {
    if v.is_finite() { v } else { Vec2::ZERO }
}

/// φ in [0, 2π).
fn positive_angle(p: Vec3) -> f32 {
    let phi = p.y.atan2(p.x);
    if phi < 0.0 { phi + 2.0 * PI } else { phi }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat4, DVec3};

    fn placed() -> Transform {
        Transform::new(DMat4::from_translation(DVec3::new(0.5, -1.0, 0.25)) * DMat4::from_rotation_x(0.4))
    }

    fn all() -> Vec<Map2> {
        vec![
            Map2::from(&Mapping2D::Uv { scale: Vec2::new(2.0, -3.0), delta: Vec2::new(0.25, 0.5) }),
            Map2::from(&Mapping2D::Spherical(placed())),
            Map2::from(&Mapping2D::Cylindrical(placed())),
            Map2::from(&Mapping2D::Planar {
                texture_from_world: placed(),
                vs: Vec3::new(1.0, 0.5, 0.0),
                vt: Vec3::new(0.0, 0.0, 2.0),
                delta: Vec2::new(0.1, 0.2),
            }),
        ]
    }

    #[test]
    fn known_points_map_to_known_coordinates() {
        let at = |p: Vec3, uv: Vec2| TexturePoint { p, uv, ..TexturePoint::default() };
        let identity = Transform::default();
        let uv = Map2::Uv { scale: Vec2::new(2.0, 3.0), delta: Vec2::new(0.5, -1.0) };
        assert_eq!(uv.at(&at(Vec3::ZERO, Vec2::new(0.25, 1.0))).st, Vec2::new(1.0, 2.0));
        let sphere = Map2::from(&Mapping2D::Spherical(identity));
        assert_eq!(sphere.at(&at(Vec3::Z * 3.0, Vec2::ZERO)).st, Vec2::new(0.0, 0.0));
        assert!((sphere.at(&at(-Vec3::Y, Vec2::ZERO)).st - Vec2::new(0.5, 0.75)).length() < 1e-6);
        let cylinder = Map2::from(&Mapping2D::Cylindrical(identity));
        assert!((cylinder.at(&at(Vec3::new(0.0, 2.0, 5.0), Vec2::ZERO)).st - Vec2::new(0.75, 5.0)).length() < 1e-6);
    }

    #[test]
    fn footprints_are_the_differences_of_neighbouring_points() {
        let h = 1e-3;
        let base = TexturePoint {
            p: Vec3::new(0.7, 0.4, -0.3),
            uv: Vec2::new(0.3, 0.6),
            dpdx: Vec3::new(0.3, -0.2, 0.5) * h,
            dpdy: Vec3::new(-0.1, 0.8, 0.2) * h,
            duvdx: Vec2::new(0.4, 0.1) * h,
            duvdy: Vec2::new(-0.2, 0.9) * h,
            ..TexturePoint::default()
        };
        for map in all() {
            let here = map.at(&base);
            for (dp, duv, expected) in
                [(base.dpdx, base.duvdx, here.footprint.dx), (base.dpdy, base.duvdy, here.footprint.dy)]
            {
                let side =
                    |sign: f32| map.at(&TexturePoint { p: base.p + sign * dp, uv: base.uv + sign * duv, ..base }).st;
                let difference = (side(1.0) - side(-1.0)) / 2.0;
                // Central differences err by h² relative, coordinates near 1 round at 6e-8.
                assert!((difference - expected).length() < 1e-3 * h, "{map:?}: {difference} {expected}");
            }
        }
    }

    #[test]
    fn the_poles_have_no_footprint_and_no_trouble() {
        for map in [
            Map2::from(&Mapping2D::Spherical(Transform::default())),
            Map2::from(&Mapping2D::Cylindrical(Transform::default())),
        ] {
            for p in [Vec3::ZERO, Vec3::Z, -Vec3::Z] {
                let at = TexturePoint { p, dpdx: Vec3::X, dpdy: Vec3::Y, ..TexturePoint::default() };
                let point = map.at(&at);
                assert!(point.st.is_finite() && point.footprint.dx.is_finite(), "{map:?} {p}");
            }
        }
    }
}
