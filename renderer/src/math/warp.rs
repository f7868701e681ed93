//! Maps from the unit square, each with its density and, where a caller needs it, its inverse.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4, PI};

use glam::{Vec2, Vec3};

use super::LocalDir;

/// Uniform on the unit disk, by the concentric map, which keeps strata compact.
///
/// **Source**: \[Shirley97\].
pub fn concentric_disk(u: Vec2) -> Vec2 {
    let v = 2.0 * u - Vec2::ONE;
    if v == Vec2::ZERO {
        return Vec2::ZERO;
    }
    let (radius, theta) =
        if v.x.abs() > v.y.abs() { (v.x, FRAC_PI_4 * (v.y / v.x)) } else { (v.y, FRAC_PI_2 - FRAC_PI_4 * (v.x / v.y)) };
    let (sin, cos) = theta.sin_cos();
    radius * Vec2::new(cos, sin)
}

/// Density cosθ/π around +z.
pub fn cosine_hemisphere(u: Vec2) -> LocalDir {
    let d = concentric_disk(u);
    LocalDir::new(d.extend((1.0 - d.length_squared()).max(0.0).sqrt()))
}

/// Density (sr⁻¹) of [`cosine_hemisphere`].
pub fn cosine_hemisphere_pdf(cos_theta: f32) -> f32 {
    cos_theta.max(0.0) * FRAC_1_PI
}

/// Uniform on the unit sphere.
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (2.0 * PI * u.y).sin_cos();
    Vec3::new(r * cos, r * sin, z)
}

/// Uniform in the cone of directions around +z whose half angle has `one_minus_cos` = 1 − cosθ. The difference is the
/// parameter because it keeps its precision for narrow cones.
pub fn uniform_cone(u: Vec2, one_minus_cos: f32) -> Vec3 {
    let drop = u.x * one_minus_cos;
    let r = (drop * (2.0 - drop)).max(0.0).sqrt();
    let (sin, cos) = (2.0 * PI * u.y).sin_cos();
    Vec3::new(r * cos, r * sin, 1.0 - drop)
}

/// Barycentric coordinates of vertices 0 and 1 of a uniform point in a triangle, without folding strata apart.
///
/// **Source**: \[Heitz19\] "A Low-Distortion Map Between Triangle and Square".
pub fn uniform_triangle(u: Vec2) -> Vec2 {
    if u.x < u.y {
        let b0 = u.x / 2.0;
        Vec2::new(b0, u.y - b0)
    } else {
        let b1 = u.y / 2.0;
        Vec2::new(u.x - b1, b1)
    }
}
