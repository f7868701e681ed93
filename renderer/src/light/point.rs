//! Lights of no extent: point, spot, goniometric, projection.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Mat3, Vec2, Vec3};

use super::image::LightImage;
use crate::math::{Rgb, octahedral};

/// A light at one point of the world.
#[derive(Clone, Debug)]
pub struct PointLight {
    position: Vec3,
    light_from_world: Mat3,
    emission: Emission,
}

/// Radiant intensity by direction, W/sr. In light space +z is the axis of a spot and of a projector.
#[derive(Clone, Debug)]
pub enum Emission {
    /// The same in all directions.
    Isotropic(Rgb),
    /// A cone with a smooth edge.
    Spot(Spot),
    /// A factor for each direction.
    Goniometric(Goniometric),
    /// A slide.
    Projection(Projection),
}

impl PointLight {
    /// A light at `position` in the world that emits by directions of its own space.
    pub fn new(position: Vec3, light_from_world: Mat3, emission: Emission) -> Self {
        Self { position, light_from_world, emission }
    }

    /// Where it is, in the world.
    #[inline]
    pub fn position(&self) -> Vec3 {
        self.position
    }

    /// Radiant intensity (W/sr) along the unit direction `w`, which leads away from the light in the world.
    #[inline]
    pub fn intensity(&self, w: Vec3) -> Rgb {
        match &self.emission {
            Emission::Isotropic(intensity) => *intensity,
            Emission::Spot(spot) => spot.intensity(self.to_light(w)),
            Emission::Goniometric(goniometric) => goniometric.intensity(self.to_light(w)),
            Emission::Projection(projection) => projection.intensity(self.to_light(w)),
        }
    }

    #[inline]
    fn to_light(&self, w: Vec3) -> Vec3 {
        (self.light_from_world * w).normalize_or(Vec3::Z)
    }
}

/// A cone around +z whose intensity falls smoothly to zero between two angles.
#[derive(Clone, Debug)]
pub struct Spot {
    intensity: Rgb,
    /// Where the fall begins, radians.
    start: f64,
    /// Where it ends, radians.
    end: f64,
    /// 1 − cos of `end`: differences of cosines would lose the edge of a narrow cone.
    drop_at_end: f32,
    /// 1 over the difference of 1 − cos between `end` and `start`; infinite for a hard edge.
    per_drop: f32,
}

impl Spot {
    /// A cone of half angle `cone` whose edge reaches inwards by `delta`, both in degrees, with `intensity` on the axis.
    pub fn new(intensity: Rgb, cone: f32, delta: f32) -> Self {
        let end = f64::from(cone.clamp(0.0, 180.0)).to_radians();
        let start = (end - f64::from(delta.max(0.0)).to_radians()).max(0.0);
        let width = one_minus_cos(end) - one_minus_cos(start);
        Self { intensity, start, end, drop_at_end: one_minus_cos(end) as f32, per_drop: (1.0 / width) as f32 }
    }

    /// Where the edge begins and ends, radians.
    pub fn angles(&self) -> [f64; 2] {
        [self.start, self.end]
    }

    /// Intensity on the axis.
    pub fn peak(&self) -> Rgb {
        self.intensity
    }

    /// The integral over all directions of the intensity over that on the axis, sr. A smooth step has the mean ½.
    pub fn solid_angle(cone: f32, delta: f32) -> f64 {
        let spot = Self::new(Rgb::ONE, cone, delta);
        PI * (one_minus_cos(spot.start) + one_minus_cos(spot.end))
    }

    #[inline]
    fn intensity(&self, w: Vec3) -> Rgb {
        // 1 − cosθ without cancellation on the lit side.
        let drop = if w.z > 0.0 { (w.x * w.x + w.y * w.y) / (1.0 + w.z) } else { 1.0 - w.z };
        let inside = self.drop_at_end - drop;
        if inside <= 0.0 {
            return Rgb::ZERO;
        }
        let t = (inside * self.per_drop).min(1.0);
        self.intensity * (t * t * (3.0 - 2.0 * t))
    }
}

fn one_minus_cos(angle: f64) -> f64 {
    2.0 * (angle / 2.0).sin().powi(2)
}

/// Intensity scaled by an equal-area octahedral image.
///
/// As in pbrt, the image's y axis is the light's z axis and the other way round.
#[derive(Clone, Debug)]
pub struct Goniometric {
    intensity: Rgb,
    size: usize,
    factors: Box<[f32]>,
}

impl Goniometric {
    /// `intensity` times the mean of the channels of a square image.
    pub fn new(intensity: Rgb, image: &LightImage) -> Self {
        debug_assert_eq!(image.width(), image.height());
        let factors = image.texels().iter().map(|t| t.element_sum() / 3.0).collect();
        Self { intensity, size: image.width(), factors }
    }

    /// The integral of the image's factor over all directions, sr.
    pub fn solid_angle(image: &LightImage) -> f64 {
        2.0 * TAU * image.mean().element_sum() / 3.0
    }

    /// Mean intensity over all directions.
    pub fn mean(&self) -> DVec3 {
        let sum: f64 = self.factors.iter().map(|&f| f64::from(f)).sum();
        self.intensity.as_dvec3() * (sum / self.factors.len() as f64)
    }

    #[inline]
    fn intensity(&self, w: Vec3) -> Rgb {
        let uv = octahedral::square_from_direction(Vec3::new(w.x, w.z, w.y));
        let at = |v: f32| ((v * self.size as f32) as usize).min(self.size - 1);
        self.intensity * self.factors[at(uv.y) * self.size + at(uv.x)]
    }
}

/// A slide projected along +z, its top towards +y.
#[derive(Clone, Debug)]
pub struct Projection {
    scale: Rgb,
    image: LightImage,
    /// Half extents of the slide on the plane z = 1.
    half: Vec2,
}

impl Projection {
    /// `scale` times an image that spans `fov` degrees across its shorter side.
    pub fn new(scale: Rgb, image: LightImage, fov: f32) -> Self {
        let half = Self::half_extents(&image, fov);
        Self { scale, image, half }
    }

    fn half_extents(image: &LightImage, fov: f32) -> Vec2 {
        let tan = (f64::from(fov.clamp(0.0, 180.0)) / 2.0).to_radians().tan() as f32;
        let aspect = image.width() as f32 / image.height() as f32;
        if aspect > 1.0 { Vec2::new(tan * aspect, tan) } else { Vec2::new(tan, tan / aspect) }
    }

    /// The integral over all directions of the image, linear RGB · sr.
    ///
    /// The solid angle of each texel is exact, where pbrt takes cos³θ at its centre.
    pub fn solid_angle(image: &LightImage, fov: f32) -> DVec3 {
        let half = Self::half_extents(image, fov).as_dvec2();
        let edges = |count: usize, half: f64| -> Vec<f64> {
            (0..=count).map(|i| half * (2.0 * i as f64 / count as f64 - 1.0)).collect()
        };
        let (xs, ys) = (edges(image.width(), half.x), edges(image.height(), half.y));
        // ∫∫ (1 + x² + y²)^(−3/2) dx dy from the origin: the solid angle of a rectangle with a corner on the axis.
        let corner = |x: f64, y: f64| (x * y / (1.0 + x * x + y * y).sqrt()).atan();
        let mut sum = DVec3::ZERO;
        for (texels, y) in image.texels().chunks_exact(image.width()).zip(ys.windows(2)) {
            for (texel, x) in texels.iter().zip(xs.windows(2)) {
                let solid_angle = corner(x[1], y[1]) - corner(x[0], y[1]) - corner(x[1], y[0]) + corner(x[0], y[0]);
                sum += texel.as_dvec3() * solid_angle;
            }
        }
        sum
    }

    /// Mean intensity over the slide.
    pub fn mean(&self) -> DVec3 {
        self.scale.as_dvec3() * self.image.mean()
    }

    /// Angle between the axis and the slide's corners, radians.
    pub fn half_angle(&self) -> f64 {
        self.half.as_dvec2().length().atan()
    }

    #[inline]
    fn intensity(&self, w: Vec3) -> Rgb {
        if w.z <= 0.0 {
            return Rgb::ZERO;
        }
        let slide = Vec2::new(w.x, -w.y) / (w.z * self.half);
        if slide.abs().max_element() > 1.0 {
            return Rgb::ZERO;
        }
        self.scale * self.image.nearest(0.5 * (slide + Vec2::ONE))
    }
}

#[cfg(test)]
#[path = "point_tests.rs"]
mod tests;
