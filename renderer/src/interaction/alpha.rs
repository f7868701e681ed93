//! Surfaces with holes: hits that count with a probability.

use embree::Hit;
use glam::Vec2;

use super::Geometry;
use crate::math::Ray;
use crate::sampling::mix64;
use crate::scene::description::Value;
use crate::texture::{TexturePoint, Textures};

/// Probability of the points of a surface being there.
#[derive(Clone, Debug, PartialEq)]
pub struct Alpha {
    /// The probability: from 1 on all are there, below 0 none.
    pub value: Value<f32>,
    /// It follows the texture coordinates alone, so that a hit's place need not be found.
    pub by_uv: bool,
}

/// Decides by a surface's alpha texture whether a hit is real.
///
/// The decision compares alpha with a hash of the hit alone, so the same point is always either there or not, for
/// every kind of ray, and no random numbers are used up. The texture is looked up without a footprint.
#[derive(Clone, Copy)]
pub struct AlphaTest<'w> {
    /// The surfaces.
    pub geometry: &'w Geometry,
    /// Their textures.
    pub textures: &'w Textures,
}

impl AlphaTest<'_> {
    /// Whether a hit of `ray` is real.
    pub fn accepts(&self, ray: &Ray, hit: &Hit) -> bool {
        let (geometry, _) = self.geometry.locate(hit);
        let surface = &self.geometry.surfaces[geometry as usize];
        let Some(alpha) = &surface.alpha else { return true };
        let at = if alpha.by_uv {
            let uv = surface.primitives.uv(hit.primitive, Vec2::new(hit.u, hit.v));
            TexturePoint { uv, ..TexturePoint::default() }
        } else {
            self.geometry.interaction(ray, hit).texture_point(0.0)
        };
        let alpha = self.textures.float(&alpha.value, &at);
        // 1 is always real and 0 never: the threshold is in [0, 1).
        alpha > threshold(hit)
    }
}

/// Uniform in [0, 1), the same for the same hit.
fn threshold(hit: &Hit) -> f32 {
    let pair = |a: u32, b: u32| u64::from(a) << 32 | u64::from(b);
    let place = mix64(pair(hit.geometry, hit.primitive) ^ mix64(u64::from(hit.instance.unwrap_or(u32::MAX))));
    let hash = mix64(pair(hit.u.to_bits(), hit.v.to_bits()) ^ place);
    // 24 bits fill the mantissa.
    (hash >> 40) as f32 * 2.0_f32.powi(-24)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn thresholds_are_uniform_and_differ_between_primitives() {
        let hit = |u: f32, primitive| Hit { t: 1.0, u, v: 0.5, ng: Vec3::Z, geometry: 3, primitive, instance: None };
        let n = 10_000;
        let mut bins = [0_f64; 20];
        for i in 0..n {
            bins[(threshold(&hit(i as f32 / n as f32, 7)) * 20.0) as usize] += 1.0;
        }
        let expected = f64::from(n) / 20.0;
        let chi_squared: f64 = bins.iter().map(|count| (count - expected).powi(2) / expected).sum();
        // 19 degrees of freedom: 43.8 is exceeded with probability 0.001; the hash is fixed.
        assert!(chi_squared < 43.8, "{chi_squared}");
        assert_ne!(threshold(&hit(0.25, 7)), threshold(&hit(0.25, 8)));
        assert_eq!(threshold(&hit(0.25, 7)), threshold(&hit(0.25, 7)));
    }
}
