//! Analytic shapes: what lights sample, and the surfaces that Embree has no primitive for.
//!
//! Shapes are in world space: their transform is applied on entry. Intersection and sampling compute in `f64` and round
//! their results once, so an error bound is little more than half an ulp. Normals are oriented as pbrt orients them:
//! by the cross product of the parameter's tangents, flipped by `reverse_orientation ^ swaps_handedness`; where a mesh
//! has vertex normals, to their side.

pub mod curve;
pub mod cylinder;
pub mod disk;
pub mod loop_subdivision;
pub mod patch;
mod placement;
pub mod sphere;
#[cfg(test)]
pub(crate) mod testing;
pub mod triangle;

use glam::{DVec3, Vec2, Vec3};

pub use cylinder::Cylinder;
pub use disk::Disk;
pub use patch::Patch;
pub use sphere::Sphere;
pub use triangle::Triangle;

use crate::math::{PointWithError, next_away_from_zero, next_towards_zero};

/// A shape in world space, small enough to keep one per emitting triangle.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A triangle.
    Triangle(Triangle),
    /// A bilinear patch.
    Patch(Box<Patch>),
    /// A sphere, or part of one, or the ellipsoid that its transform makes of it.
    Sphere(Box<Sphere>),
    /// A disk, or part of one.
    Disk(Box<Disk>),
    /// An open cylinder, or part of one.
    Cylinder(Box<Cylinder>),
}

/// Where a ray meets a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeHit {
    /// Ray parameter, in units of the direction.
    pub t: f32,
    /// Parameters of the shape. Triangle: barycentric coordinates of vertices 1 and 2. Others: in [0, 1].
    pub u: f32,
    /// See `u`.
    pub v: f32,
    /// Quadrics: the hit in the shape's own space, from which point, normal and tangents follow without trigonometry.
    /// Others: zero.
    pub local: Vec3,
}

/// A point of a shape with its differential geometry, world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The point.
    pub point: PointWithError,
    /// Unit, oriented.
    pub n: Vec3,
    /// Change of the point with u; zero at a pole.
    pub dpdu: Vec3,
    /// Change of the point with v.
    pub dpdv: Vec3,
}

/// A sampled point of a shape, world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeSample {
    /// The point.
    pub point: PointWithError,
    /// Unit, oriented.
    pub n: Vec3,
    /// Surface parameters, for textures.
    pub uv: Vec2,
    /// Density (sr⁻¹) as seen from the reference point. Finite and positive.
    pub pdf: f32,
}

macro_rules! each {
    ($self:expr, $shape:ident => $body:expr) => {
        match $self {
            Shape::Triangle($shape) => $body,
            Shape::Patch($shape) => $body,
            Shape::Sphere($shape) => $body,
            Shape::Disk($shape) => $body,
            Shape::Cylinder($shape) => $body,
        }
    };
}

impl Shape {
    /// The same shape with holes, through which parts of it are seen behind others: samples go to all of it.
    #[must_use]
    pub fn with_holes(self) -> Self {
        match self {
            Self::Sphere(sphere) => Self::Sphere(Box::new(sphere.with_holes())),
            // Sampled all over as they are.
            Self::Triangle(_) | Self::Patch(_) | Self::Disk(_) | Self::Cylinder(_) => self,
        }
    }

    /// Surface area, one side.
    pub fn area(&self) -> f32 {
        each!(self, shape => shape.area())
    }

    /// Lower and upper corner of a box that encloses the shape, rounding included.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        each!(self, shape => shape.bounds())
    }

    /// Unit axis and cosine of the half angle of a cone that holds all oriented normals; cosine −1: all directions.
    pub fn normal_cone(&self) -> (Vec3, f32) {
        each!(self, shape => shape.normal_cone())
    }

    /// Nearest hit with `t_range.0 < t <= t_range.1`.
    pub fn intersect(&self, origin: Vec3, direction: Vec3, t_range: (f32, f32)) -> Option<ShapeHit> {
        each!(self, shape => shape.intersect(origin, direction, t_range))
    }

    /// A point of the shape to connect `from` to. `u` is uniform in [0, 1)². `None`: this `u` yields no usable point.
    pub fn sample(&self, from: Vec3, u: Vec2) -> Option<ShapeSample> {
        each!(self, shape => shape.sample(from, u))
    }

    /// Density (sr⁻¹) with which [`Self::sample`] from `from` yields the direction to `point`, which lies on the shape
    /// and has the normal `n` there (either side).
    pub fn pdf(&self, from: Vec3, point: Vec3, n: Vec3) -> f32 {
        each!(self, shape => shape.pdf(from, point, n))
    }
}

/// Density over area (m⁻²) at `point` with normal `n` as density over solid angle (sr⁻¹) seen from `from`. Infinite edge-on.
///
/// **Source**: \[Pharr23\] equation 4.14: dω = |cosθ| dA / r².
fn solid_angle_pdf(area_pdf: f64, from: Vec3, point: Vec3, n: Vec3) -> f32 {
    let to_point = point.as_dvec3() - from.as_dvec3();
    let squared = to_point.length_squared();
    (area_pdf * squared * squared.sqrt() / to_point.dot(n.as_dvec3()).abs()) as f32
}

/// As [`solid_angle_pdf`], with 0 where the density is not finite: directions that are never sampled.
fn finite_solid_angle_pdf(area_pdf: f64, from: Vec3, point: Vec3, n: Vec3) -> f32 {
    let pdf = solid_angle_pdf(area_pdf, from, point, n);
    if pdf.is_finite() { pdf } else { 0.0 }
}

/// The sample with these parts, unless its density is unusable.
fn usable(point: PointWithError, n: Vec3, uv: Vec2, pdf: f32) -> Option<ShapeSample> {
    (pdf.is_finite() && pdf > 0.0).then_some(ShapeSample { point, n, uv, pdf })
}

/// `p` rounded to `f32`. The bound is that of the rounding, plus `slack` for what came before it.
fn rounded(p: DVec3, slack: DVec3) -> PointWithError {
    // Half an ulp is at most ε/2·|p| above the denormals, where it is half the smallest of them.
    const RELATIVE: f64 = f32::EPSILON as f64 * 0.5;
    const SMALLEST: f64 = f32::MIN_POSITIVE as f64 * f32::EPSILON as f64;
    let error = p.abs() * RELATIVE + slack + SMALLEST;
    PointWithError { p: p.as_vec3(), error: Vec3::from_array(error.to_array().map(round_up)) }
}

/// The least `f32` not below `x`.
fn round_up(x: f64) -> f32 {
    let rounded = x as f32;
    if f64::from(rounded) >= x {
        return rounded;
    }
    if rounded >= 0.0 { next_away_from_zero(rounded) } else { next_towards_zero(rounded) }
}

/// The greatest `f32` not above `x`.
fn round_down(x: f64) -> f32 {
    -round_up(-x)
}

/// The box `lower..upper` rounded outwards.
fn rounded_bounds(lower: DVec3, upper: DVec3) -> (Vec3, Vec3) {
    (Vec3::from_array(lower.to_array().map(round_down)), Vec3::from_array(upper.to_array().map(round_up)))
}

/// Whether a ray parameter lies in a range, lower end exclusive: a ray never meets what it starts on.
fn in_range(t: f64, (near, far): (f32, f32)) -> bool {
    t > f64::from(near) && t <= f64::from(far)
}
