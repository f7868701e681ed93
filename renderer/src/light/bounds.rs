//! Where a group of lights is and whither it shines: what the light tree is built from. In `f64`.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec3, Vec3};

/// Bounds of one light or of a group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightBounds {
    /// Lower corner, world.
    pub low: DVec3,
    /// Upper corner, world.
    pub high: DVec3,
    /// Unit axis of the cone of normals.
    pub axis: DVec3,
    /// Half angle of the cone of normals, radians, in [0, π].
    pub theta_o: f64,
    /// Emission reaches this far beyond each normal, radians, in [0, π/2].
    pub theta_e: f64,
    /// Each normal also emits into the opposite direction.
    pub two_sided: bool,
    /// Radiant intensity of the group along its normals, mean of the channels, W/sr: what it sends to a distant point
    /// that sees it face-on. (pbrt takes the power; but then a point light counts for four times the diffuse emitter that
    /// gives the same irradiance.)
    pub intensity: f64,
}

impl LightBounds {
    /// The bounds of `self` and `other` together.
    pub fn union(&self, other: &Self) -> Self {
        let two_sided = self.two_sided || other.two_sided;
        // The axis of a group that is two-sided throughout has no sign.
        let flip = self.two_sided && other.two_sided && self.axis.dot(other.axis) < 0.0;
        let other_axis = if flip { -other.axis } else { other.axis };
        let (axis, theta_o) = cone_union((self.axis, self.theta_o), (other_axis, other.theta_o));
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            axis,
            theta_o,
            theta_e: self.theta_e.max(other.theta_e),
            two_sided,
            intensity: self.intensity + other.intensity,
        }
    }

    /// Centre of the box.
    pub fn center(&self) -> DVec3 {
        0.5 * (self.low + self.high)
    }

    /// Radius of the sphere around the box.
    pub fn radius(&self) -> f64 {
        0.5 * (self.high - self.low).length()
    }

    /// How far the box reaches below its centre along the axis.
    pub fn depth(&self) -> f64 {
        (0.5 * (self.high - self.low)).dot(self.axis.abs())
    }

    /// Cost of a node: intensity × measure of its directions × area of its bounding sphere.
    ///
    /// The area is that of the sphere because the importance sees no more of the box than its sphere; unlike the box, the
    /// sphere also has an area where point lights stand in a row.
    ///
    /// **Source**: \[Conty18\], surface area orientation heuristic.
    pub fn cost(&self) -> f64 {
        let o = self.theta_o;
        let w = (o + self.theta_e).min(PI);
        let (sin_o, cos_o) = o.sin_cos();
        let directions =
            2.0 * PI * (1.0 - cos_o) + FRAC_PI_2 * (2.0 * w * sin_o - (o - 2.0 * w).cos() - 2.0 * o * sin_o + cos_o);
        self.intensity * directions * self.radius().powi(2)
    }
}

/// The cone of all directions around a point light, or around anything without a side.
pub const ALL_DIRECTIONS: (DVec3, f64) = (DVec3::Z, PI);

/// A cone given by its axis and the cosine of its half angle in `f32`, widened by the rounding of that cosine; a cosine of
/// exactly 1 says that the shape is flat.
pub fn cone_from_cosine(axis: Vec3, cos: f32) -> (DVec3, f64) {
    match axis.as_dvec3().try_normalize() {
        Some(axis) if cos >= 1.0 => (axis, 0.0),
        Some(axis) => (axis, f64::from((cos - f32::EPSILON).clamp(-1.0, 1.0)).acos()),
        None => ALL_DIRECTIONS,
    }
}

fn cone_union(a: (DVec3, f64), b: (DVec3, f64)) -> (DVec3, f64) {
    let (a, b) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    if a.1 >= PI {
        return a;
    }
    let cos_between = a.0.dot(b.0);
    let aside = b.0 - a.0 * cos_between;
    let sin_between = aside.length();
    // acos would lose small angles.
    let between = sin_between.atan2(cos_between);
    if between + b.1 <= a.1 {
        return a;
    }
    let theta_o = 0.5 * (a.1 + between + b.1);
    // Opposite axes span no plane to turn in.
    if theta_o >= PI || sin_between == 0.0 {
        return ALL_DIRECTIONS;
    }
    let (sin, cos) = (theta_o - a.1).sin_cos();
    ((a.0 * cos + aside * (sin / sin_between)).normalize(), theta_o)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;
    use proptest::prelude::*;

    fn direction(v: [f64; 3]) -> DVec3 {
        DVec3::from_array(v).normalize_or(DVec3::Z)
    }

    proptest! {
        #[test]
        fn a_union_of_cones_holds_both(
            a in prop::array::uniform3(-1.0f64..1.0),
            b in prop::array::uniform3(-1.0f64..1.0),
            close in prop::bool::ANY,
            oa in 0.0f64..PI,
            ob in 0.0f64..PI,
            spin in 0.0f64..PI,
        ) {
            let a = direction(a);
            let b = if close { (a + 1e-9 * DVec3::from_array(b)).normalize() } else { direction(b) };
            let (axis, theta) = cone_union((a, oa), (b, ob));
            prop_assert!((axis.length() - 1.0).abs() < 1e-12);
            for (cone_axis, cone_theta) in [(a, oa), (b, ob)] {
                // A direction on the rim of the cone is within the union.
                let rim = DQuat::from_axis_angle(cone_axis, 2.0 * spin)
                    * (DQuat::from_axis_angle(cone_axis.any_orthonormal_vector(), cone_theta) * cone_axis);
                let angle = rim.cross(axis).length().atan2(rim.dot(axis));
                prop_assert!(angle <= theta + 1e-7, "{angle} {theta}");
            }
        }
    }

    #[test]
    fn the_measure_of_directions_is_that_of_known_cones() {
        let bounds = |theta_o, theta_e| LightBounds {
            low: DVec3::splat(-1.0),
            high: DVec3::splat(1.0),
            axis: DVec3::Z,
            theta_o,
            theta_e,
            two_sided: false,
            intensity: 2.0,
        };
        // A flat emitter: cosθ over the hemisphere, π. All normals: the whole sphere with weight 1, 4π.
        assert!((bounds(0.0, FRAC_PI_2).cost() - 2.0 * 3.0 * PI).abs() < 1e-9);
        assert!((bounds(PI, FRAC_PI_2).cost() - 2.0 * 3.0 * 4.0 * PI).abs() < 1e-9);
    }

    #[test]
    fn two_sided_axes_have_no_sign() {
        let up = LightBounds {
            low: DVec3::ZERO,
            high: DVec3::ONE,
            axis: DVec3::Z,
            theta_o: 0.0,
            theta_e: FRAC_PI_2,
            two_sided: true,
            intensity: 1.0,
        };
        let down = LightBounds { axis: -DVec3::Z, ..up };
        assert_eq!(up.union(&down).theta_o, 0.0);
        let one_sided = LightBounds { two_sided: false, ..down };
        assert_eq!(up.union(&one_sided).theta_o, PI);
    }
}
