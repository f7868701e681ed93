//! Bounds of rounding errors.

use glam::Vec3;

/// Half the distance from 1 to the next `f32`: the relative error of one correctly rounded operation.
const MACHINE_EPSILON: f32 = f32::EPSILON * 0.5;

/// Relative error bound of `n` successive rounded operations, γₙ = nε/(1 − nε).
///
/// Source: \[Higham02\] section 3.1.
pub const fn gamma(n: u32) -> f32 {
    n as f32 * MACHINE_EPSILON / (1.0 - n as f32 * MACHINE_EPSILON)
}

/// The largest `f32` below 1.
pub const BELOW_ONE: f32 = 1.0 - MACHINE_EPSILON;

/// The next float away from zero; an infinity stays. (`f32::next_up` is younger than our compiler.)
pub fn next_away_from_zero(x: f32) -> f32 {
    // The bits of a float without its sign count its magnitude.
    if x.is_finite() { f32::from_bits(x.to_bits() + 1) } else { x }
}

/// The next float towards zero, which stays.
pub fn next_towards_zero(x: f32) -> f32 {
    if x == 0.0 { x } else { f32::from_bits(x.to_bits() - 1) }
}

/// A point that was computed with rounding, and the bound of its absolute error per axis.
///
/// **Space**: whichever the producer says; world space in an interaction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointWithError {
    /// The rounded point.
    pub p: Vec3,
    /// The true point lies within `p ± error`, axis by axis.
    pub error: Vec3,
}

impl PointWithError {
    /// A point that is exact by definition, such as a camera or a point light.
    pub fn exact(p: Vec3) -> Self {
        Self { p, error: Vec3::ZERO }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_of_floats_are_neighbours() {
        assert_eq!(next_away_from_zero(1.0), 1.0 + f32::EPSILON);
        assert_eq!(next_towards_zero(1.0), 1.0 - f32::EPSILON / 2.0);
        assert_eq!(next_away_from_zero(-1.0), -1.0 - f32::EPSILON);
        assert_eq!(next_away_from_zero(0.0), f32::from_bits(1));
        assert_eq!(next_away_from_zero(f32::MAX), f32::INFINITY);
        assert_eq!(next_towards_zero(0.0), 0.0);
    }
}
