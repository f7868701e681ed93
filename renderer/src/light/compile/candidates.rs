//! How lights present themselves to the light tree.

use std::f64::consts::FRAC_PI_2;

use glam::{DMat3, DVec3, Vec2};

use super::super::bounds::{ALL_DIRECTIONS, LightBounds, cone_from_cosine};
use super::super::tree::build::Candidate;
use crate::shape::Shape;

/// An emitting shape of the given area and mean radiance; `None`: it emits nothing.
pub fn of_shape(number: u32, shape: &Shape, area: f64, radiance: f64, two_sided: bool) -> Option<Candidate> {
    let (low, high) = shape.bounds();
    let (axis, cos) = shape.normal_cone();
    let (axis, theta_o) = cone_from_cosine(axis, cos);
    // What is seen of a surface that faces all ways, such as a sphere, is on average a quarter of its area (Cauchy).
    let seen = if theta_o < FRAC_PI_2 { area } else { area / 4.0 };
    let (low, high, intensity) = (low.as_dvec3(), high.as_dvec3(), radiance * seen);
    let bounds = LightBounds { low, high, axis, theta_o, theta_e: FRAC_PI_2, two_sided, intensity };
    let usable = intensity > 0.0 && intensity.is_finite() && low.is_finite() && high.is_finite();
    usable.then(|| Candidate { light: number, bounds, depth: depth(shape, &bounds) })
}

/// How far the shape reaches below the centre of its box along its axis. Of a flat shape any of its points tells.
fn depth(shape: &Shape, bounds: &LightBounds) -> f64 {
    let center = bounds.center();
    let above = (center + bounds.axis * bounds.radius()).as_vec3();
    let sample = if bounds.theta_o == 0.0 { shape.sample(above, Vec2::splat(0.5)) } else { None };
    let exact = sample.map(|s| {
        let error = s.point.error.as_dvec3().dot(bounds.axis.abs());
        bounds.axis.dot(center - s.point.p.as_dvec3()) + error
    });
    exact.unwrap_or(f64::INFINITY).min(bounds.depth())
}

/// A light at `p` that shines everywhere, with this mean of its intensity over directions and channels.
pub fn of_point(number: u32, p: DVec3, intensity: f64) -> Option<Candidate> {
    at_point(number, p, ALL_DIRECTIONS, FRAC_PI_2, intensity)
}

/// A light at `p` that shines along the axis z of its space, fully up to `start` radians from it and not beyond `end`.
pub fn of_cone(
    number: u32,
    p: DVec3,
    light_from_world: DMat3,
    [start, end]: [f64; 2],
    intensity: f64,
) -> Option<Candidate> {
    // The tree computes angles from cosines of f32. Near 0 each of the three errs by up to √(8·2⁻²⁴).
    const ANGLE_ERROR: f64 = 2.1e-3;
    // A cone that its transform skews is bounded by nothing; 1e-4 of skew moves an angle by half that, which the margin
    // covers. Beyond a hemisphere the bounds need a wide cone of normals, for which all directions serve as well.
    let gram = light_from_world * light_from_world.transpose();
    let mean = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
    let deviation = gram - DMat3::from_diagonal(DVec3::splat(mean));
    let skewed = deviation.to_cols_array().iter().any(|v| v.abs() > 1e-4 * mean);
    if skewed || end + ANGLE_ERROR >= FRAC_PI_2 {
        return of_point(number, p, intensity);
    }
    let axis = (light_from_world.inverse() * DVec3::Z).normalize();
    at_point(number, p, (axis, start), end - start + ANGLE_ERROR, intensity)
}

fn at_point(number: u32, p: DVec3, (axis, theta_o): (DVec3, f64), theta_e: f64, intensity: f64) -> Option<Candidate> {
    let bounds = LightBounds { low: p, high: p, axis, theta_o, theta_e, two_sided: false, intensity };
    (intensity > 0.0 && intensity.is_finite() && p.is_finite()).then_some(Candidate {
        light: number,
        bounds,
        depth: 0.0,
    })
}
