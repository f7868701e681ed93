//! The features of a scene, as Embree's feature mask.

use embree_sys as sys;
use std::fmt;
use std::ops::BitOr;

/// The kinds of geometry and callbacks that a scene holds, those of its instanced scenes included.
///
/// They are passed to every query, which may then model only what the scene requires (RTCFeatureFlags(3)).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Features(u32);

impl Features {
    /// Nothing: the features of an empty scene.
    pub const NONE: Self = Self(0);
    /// Triangle meshes.
    pub const TRIANGLES: Self = Self(sys::RTC_FEATURE_FLAG_TRIANGLE);
    /// Ray-facing cubic Bézier ribbons.
    pub const FLAT_BEZIER_CURVES: Self = Self(sys::RTC_FEATURE_FLAG_FLAT_BEZIER_CURVE);
    /// Cubic Bézier ribbons oriented by normals.
    pub const NORMAL_ORIENTED_BEZIER_CURVES: Self = Self(sys::RTC_FEATURE_FLAG_NORMAL_ORIENTED_BEZIER_CURVE);
    /// Geometry intersected by callbacks into Rust.
    pub const USER_GEOMETRY: Self = Self(sys::RTC_FEATURE_FLAG_USER_GEOMETRY_CALLBACK_IN_GEOMETRY);
    /// Instances of other scenes.
    pub const INSTANCES: Self = Self(sys::RTC_FEATURE_FLAG_INSTANCE);
    /// Geometry that takes part in the filter of a query.
    pub const HIT_FILTER: Self = Self(sys::RTC_FEATURE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS);

    const NAMES: [(Self, &'static str); 6] = [
        (Self::TRIANGLES, "triangles"),
        (Self::FLAT_BEZIER_CURVES, "flat Bézier curves"),
        (Self::NORMAL_ORIENTED_BEZIER_CURVES, "normal-oriented Bézier curves"),
        (Self::USER_GEOMETRY, "user geometry"),
        (Self::INSTANCES, "instances"),
        (Self::HIT_FILTER, "hit filter"),
    ];

    /// Whether all features of `other` are among these.
    #[inline]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Embree's `RTCFeatureFlags`.
    #[inline]
    pub const fn bits(self) -> u32 {
        self.0
    }
}

impl BitOr for Features {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl fmt::Display for Features {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = Self::NAMES.iter().filter(|(feature, _)| self.contains(*feature)).map(|(_, name)| *name);
        let names: Vec<_> = names.collect();
        f.write_str(if names.is_empty() { "nothing" } else { "" })?;
        f.write_str(&names.join(", "))
    }
}

impl fmt::Debug for Features {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Features({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prints_what_it_holds() {
        assert_eq!(format!("{:?}", Features::NONE), "Features(nothing)");
        assert_eq!((Features::HIT_FILTER | Features::TRIANGLES).to_string(), "triangles, hit filter");
    }

    #[test]
    fn contains_is_a_subset_test() {
        let both = Features::INSTANCES | Features::TRIANGLES;
        assert!(both.contains(Features::TRIANGLES) && both.contains(both) && both.contains(Features::NONE));
        assert!(!both.contains(Features::TRIANGLES | Features::USER_GEOMETRY));
    }
}
