//! The square film of a spherical camera, which shows the sphere by the equal-area octahedral map.

use glam::Vec2;

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
    use crate::math::octahedral::direction_from_square;

    #[test]
    fn the_map_is_continuous_across_the_edges() {
        let (inside, outside) = (1.0e-4, -1.0e-4);
        for along in [0.1, 0.4, 0.77] {
            for (a, b) in [
                (Vec2::new(inside, along), Vec2::new(outside, along)),
                (Vec2::new(along, 1.0 - inside), Vec2::new(along, 1.0 - outside)),
            ] {
                let step = direction_from_square(wrap(a)) - direction_from_square(wrap(b));
                assert!(step.length() < 2.0e-3, "{a} {b} {step}");
            }
        }
    }
}
