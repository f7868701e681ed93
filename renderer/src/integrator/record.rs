//! What a path brings back.

use glam::{DVec3, Vec3};

use crate::math::Rgb;

/// What a path brings to its pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Radiance along the camera ray.
    pub radiance: Rgb,
    /// 1 where the camera ray met a surface that scatters, 0 where it escaped.
    pub alpha: f32,
    /// The first hit; left at its default where none is asked for.
    pub first: FirstHit,
}

/// The first hit of a path, for auxiliary outputs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FirstHit {
    /// Hemispherical reflectance.
    pub albedo: Rgb,
    /// Shading normal.
    pub ns: Vec3,
    /// Geometric normal.
    pub ng: Vec3,
    /// Position, in the coordinates of the scene's files.
    pub p: DVec3,
    /// Distance along the camera ray, through interfaces.
    pub depth: f32,
}

impl FirstHit {
    /// No hit.
    pub const NOTHING: Self = Self { albedo: Rgb::ZERO, ns: Vec3::ZERO, ng: Vec3::ZERO, p: DVec3::ZERO, depth: 0.0 };
}
