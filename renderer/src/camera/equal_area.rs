//! The equal-area map between the unit square and the sphere.

use std::f32::consts::FRAC_PI_4;

use glam::{Vec2, Vec3};

/// The unit direction of a point of [0, 1]². The inner diamond is the hemisphere z > 0, the corners are −z.
///
/// **Source**: \[Clarberg08\], as used by pbrt-v4's equal-area images.
pub fn sphere_from_square(square: Vec2) -> Vec3 {
    let p = 2.0 * square - Vec2::ONE;
    let (u, v) = (p.x.abs(), p.y.abs());
    // Positive inside the diamond |u| + |v| = 1, where the upper hemisphere lies.
    let inside = 1.0 - (u + v);
    let r = 1.0 - inside.abs();
    let phi = if r == 0.0 { FRAC_PI_4 } else { FRAC_PI_4 * ((v - u) / r + 1.0) };
    let (sin, cos) = phi.sin_cos();
    let sin_theta = r * (2.0 - r * r).max(0.0).sqrt();
    Vec3::new((sin_theta * cos).copysign(p.x), (sin_theta * sin).copysign(p.y), (1.0 - r * r).copysign(inside))
}

/// The point of [0, 1]² that lies beside a point at most 1 outside of it: an edge of the square is glued to itself,
/// turned by 180° around its midpoint.
pub fn wrap(square: Vec2) -> Vec2 {
    let (mut u, mut v) = (square.x, square.y);
    if !(0.0..=1.0).contains(&u) {
        (u, v) = (if u < 0.0 { -u } else { 2.0 - u }, 1.0 - v);
    }
    if !(0.0..=1.0).contains(&v) {
        (u, v) = (1.0 - u, if v < 0.0 { -v } else { 2.0 - v });
    }
    // A filter wider than the film leaves even the neighbouring copy.
    Vec2::new(u.clamp(0.0, 1.0), v.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn landmarks_map_where_they_should_and_all_directions_are_unit() {
        let cases = [
            ((0.5, 0.5), Vec3::Z),
            ((1.0, 0.5), Vec3::X),
            ((0.5, 1.0), Vec3::Y),
            ((0.0, 0.5), -Vec3::X),
            ((0.0, 0.0), -Vec3::Z),
            ((1.0, 0.0), -Vec3::Z),
        ];
        for ((u, v), expected) in cases {
            assert!((sphere_from_square(Vec2::new(u, v)) - expected).length() < 1e-6, "{u} {v}");
        }
        for k in 0..10_000 {
            let d = sphere_from_square(Vec2::new((k % 100) as f32 / 99.0, (k / 100) as f32 / 99.0));
            assert!((d.length() - 1.0).abs() < 1e-6, "{d}");
        }
    }

    /// Equal areas: the fraction of a grid of points that falls into a cap of half angle θ is (1 − cosθ)/2. A cap's
    /// border crosses O(n) of the n² cells, hence the tolerance.
    #[test]
    fn equal_areas_of_the_square_cover_equal_solid_angles() {
        const N: usize = 400;
        for axis in [Vec3::Z, -Vec3::X, Vec3::new(0.48, 0.6, -0.64)] {
            for cos_theta in [0.9_f32, 0.3, -0.5] {
                let inside = (0..N * N)
                    .filter(|k| {
                        let p = Vec2::new((k % N) as f32 + 0.5, (k / N) as f32 + 0.5) / N as f32;
                        sphere_from_square(p).dot(axis) > cos_theta
                    })
                    .count();
                let share = inside as f32 / (N * N) as f32;
                assert!((share - (1.0 - cos_theta) / 2.0).abs() < 2.0 / N as f32, "{axis} {cos_theta} {share}");
            }
        }
    }

    #[test]
    fn the_map_is_continuous_across_the_edges() {
        let (inside, outside) = (1.0e-4, -1.0e-4);
        for along in [0.1, 0.4, 0.77] {
            for (a, b) in [
                (Vec2::new(inside, along), Vec2::new(outside, along)),
                (Vec2::new(along, 1.0 - inside), Vec2::new(along, 1.0 - outside)),
            ] {
                let step = sphere_from_square(wrap(a)) - sphere_from_square(wrap(b));
                assert!(step.length() < 2.0e-3, "{a} {b} {step}");
            }
        }
    }
}
