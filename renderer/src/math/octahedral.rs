//! The equal-area octahedral map between the unit square and the sphere of directions, in which pbrt stores environment
//! and goniometric images.

use std::f32::consts::{FRAC_2_PI, FRAC_PI_4};

use glam::{Vec2, Vec3};

/// How far apart two directions are at most, per distance of their points in the square.
///
/// With s = |x| + |y| and t = |y| − |x| of the point in [−1, 1]², in the upper hemisphere cosθ = 1 − s² and
/// φ = π/4 (1 + t/s), so that θ changes by 2/√(2 − s²) ds and the arc along φ by π/4 √(2 − s²) (dt − t/s ds). The squares
/// of these three factors sum to at most 4 + π²/8, at s = 1 and |t| = s. The square's sides are 1 instead of 2, and (s, t)
/// are longer than (x, y) by √2: the stretch is at most √(8 · (4 + π²/8)) = 6.47.
pub const STRETCH: f32 = 6.48;

/// The unit direction at `uv` in [0, 1]². The centre of the square is +z, its corners are −z; u grows along x, v along y.
///
/// Equal areas of the square are equal solid angles: the density on the sphere is that on the square over 4π.
///
/// **Source**: \[Clarberg08\].
#[inline]
pub fn direction_from_square(uv: Vec2) -> Vec3 {
    let p = 2.0 * uv - Vec2::ONE;
    let q = p.abs();
    // Distance along the diagonal: positive in the inner diamond, which is the upper hemisphere.
    let inside = 1.0 - (q.x + q.y);
    let r = 1.0 - inside.abs();
    let phi = if r > 0.0 { ((q.y - q.x) / r + 1.0) * FRAC_PI_4 } else { 0.0 };
    let z = (1.0 - r * r).copysign(inside);
    let sin_theta = r * (2.0 - r * r).max(0.0).sqrt();
    let (sin_phi, cos_phi) = phi.sin_cos();
    Vec3::new((sin_theta * cos_phi).copysign(p.x), (sin_theta * sin_phi).copysign(p.y), z)
}

/// The point of the unit square that shows the unit direction `d`: the inverse of [`direction_from_square`].
#[inline]
pub fn square_from_direction(d: Vec3) -> Vec2 {
    let a = d.abs();
    // √(1 − |z|), written so that nothing cancels near the poles.
    let r = ((d.x * d.x + d.y * d.y) / (1.0 + a.z)).sqrt().min(1.0);
    let (low, high) = if a.x < a.y { (a.x, a.y) } else { (a.y, a.x) };
    let octant = if high > 0.0 { (low / high).atan() * FRAC_2_PI } else { 0.0 };
    let phi = if a.x < a.y { 1.0 - octant } else { octant };
    let (u, v) = (r - phi * r, phi * r);
    // The lower hemisphere is folded outwards over the edges of the diamond.
    let (u, v) = if d.z < 0.0 { (1.0 - v, 1.0 - u) } else { (u, v) };
    0.5 * (Vec2::new(u.copysign(d.x), v.copysign(d.y)) + Vec2::ONE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_map_is_unit_and_inverts(u in 0.0f32..=1.0, v in 0.0f32..=1.0) {
            let d = direction_from_square(Vec2::new(u, v));
            // sinθ and cosθ both derive from r, whose rounding of 2⁻²³ enters the length twice.
            prop_assert!((d.length() - 1.0).abs() < 1e-6);
            // On the outer border two points of the square show one direction: compare directions.
            let again = direction_from_square(square_from_direction(d));
            // uv is rounded to 2⁻²⁴, and moves the direction by up to √8 as fast.
            prop_assert!((again - d).length() < 1e-6, "{d} {again}");
        }

        #[test]
        fn neighbours_stay_neighbours(u in 0.0f32..=1.0, v in 0.0f32..=1.0, du in -0.1f32..0.1, dv in -0.1f32..0.1) {
            let near = Vec2::new(u + du, v + dv).clamp(Vec2::ZERO, Vec2::ONE);
            let apart = (direction_from_square(near) - direction_from_square(Vec2::new(u, v))).length();
            prop_assert!(apart <= STRETCH * (near - Vec2::new(u, v)).length() + 1e-6, "{apart}");
        }

        #[test]
        fn the_inverse_inverts(x in -1.0f32..1.0, y in -1.0f32..1.0, z in -1.0f32..1.0) {
            let d = Vec3::new(x, y, z);
            prop_assume!(d.length() > 1e-3);
            let d = d.normalize();
            prop_assert!((direction_from_square(square_from_direction(d)) - d).length() < 1e-6);
        }
    }

    #[test]
    fn the_layout_is_pbrts() {
        let at = |u: f32, v: f32| direction_from_square(Vec2::new(u, v));
        for (d, expected) in [
            (at(0.5, 0.5), Vec3::Z),
            (at(0.0, 0.0), -Vec3::Z),
            (at(1.0, 0.5), Vec3::X),
            (at(0.5, 1.0), Vec3::Y),
            (at(0.0, 0.5), -Vec3::X),
        ] {
            assert!((d - expected).length() < 1e-6, "{d} {expected}");
        }
        for d in [Vec3::Z, -Vec3::Z, Vec3::X, -Vec3::Y, Vec3::new(-0.0, 0.0, 1.0)] {
            assert!((direction_from_square(square_from_direction(d)) - d).length() < 1e-6, "{d}");
        }
    }

    #[test]
    fn equal_areas_are_equal_solid_angles() {
        // z is uniform in [−1, 1] on the sphere (Archimedes): so must it be over a grid of the square. The grid of
        // midpoints errs by less than one cell's extent in z, 4/n.
        let n = 256;
        let mut below = [0u32; 8];
        for y in 0..n {
            for x in 0..n {
                let d = direction_from_square((Vec2::new(x as f32, y as f32) + 0.5) / n as f32);
                below[(((d.z + 1.0) * 4.0) as usize).min(7)] += 1;
            }
        }
        for count in below {
            assert!((f64::from(count) / f64::from(n * n) - 0.125).abs() < 4.0 / f64::from(n), "{count}");
        }
    }
}
