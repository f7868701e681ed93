//! Triangles as emitters: sampled by solid angle where that pays, by area elsewhere.

use glam::{DVec3, Vec2, Vec3};

use super::{ShapeHit, ShapeSample, finite_solid_angle_pdf, in_range, solid_angle_pdf, usable};
use crate::math::{PointWithError, gamma, warp};

/// A triangle that emits.
#[derive(Clone, Debug, PartialEq)]
pub struct Triangle {
    p: [Vec3; 3],
    uv: [Vec2; 3],
    /// Unit, oriented.
    n: Vec3,
    /// Cosines between `n` and the vertex normals: the emitting side follows the interpolated vertex normal.
    facing: [f32; 3],
    area: f32,
    centroid: Vec3,
    /// Square of the distance from the centroid within which the spherical triangle is sampled: see [`NEAR`].
    near_squared: f32,
    /// Angle by which the plane that a ray is tested against may be tilted from the exact one, about vertex 0.
    tilt: f32,
}

/// Distance of the centroid, in longest edges, up to which the spherical triangle is sampled. Beyond, the triangle is seen
/// under less than 0.43 sr, and area sampling, which is cheaper, is taken instead. Chosen for speed: what it adds to the
/// variance was not measured.
const NEAR: f32 = 1.0;

/// Solid angles (sr) between which the spherical triangle is sampled where it is near. Below, seen edge on, area sampling
/// does as well; near a hemisphere (2π) its three great circles coincide and the angles between them lose all precision,
/// and sampling the BSDF is the better strategy anyway.
///
/// **Source**: \[Pharr23\] section 6.5.4.
const SOLID_ANGLES: std::ops::RangeInclusive<f64> = 2e-4..=6.22;

/// The texture coordinates of a triangle whose mesh has none.
pub const DEFAULT_UV: [Vec2; 3] = [Vec2::ZERO, Vec2::X, Vec2::ONE];

impl Triangle {
    /// The triangle `p`, counter-clockwise seen from the side of its normal, or from the other side when `flipped`.
    /// Vertex normals, where they do not vanish, decide the side instead; `flipped` is then already in them.
    ///
    /// `None`: no area, or not finite.
    pub fn new(p: [Vec3; 3], uv: Option<[Vec2; 3]>, normals: Option<[Vec3; 3]>, flipped: bool) -> Option<Self> {
        let [p0, p1, p2] = p.map(Vec3::as_dvec3);
        let (e1, e2) = (p1 - p0, p2 - p0);
        let cross = e1.cross(e2);
        let doubled_area = cross.length();
        let area = (0.5 * doubled_area) as f32;
        if !(area > 0.0 && area.is_finite()) {
            return None;
        }
        // f32 forms the edges, multiplies and subtracts: each component of the normal errs by γ₄ of its two products.
        let (a, b) = (e1.abs(), e2.abs());
        let products = DVec3::new(a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x);
        let n = (cross / doubled_area).as_vec3();
        let n = if flipped { -n } else { n };
        let facing = normals.map_or([1.0; 3], |normals| normals.map(|normal| normal.dot(n)));
        let tilt = gamma(4) * (products.length() / doubled_area) as f32;
        let longest = e1.length_squared().max(e2.length_squared()).max((p2 - p1).length_squared()) as f32;
        let centroid = ((p0 + p1 + p2) / 3.0).as_vec3();
        let near_squared = NEAR * NEAR * longest;
        Some(Self { p, uv: uv.unwrap_or(DEFAULT_UV), n, facing, area, centroid, near_squared, tilt })
    }

    /// Surface area.
    pub fn area(&self) -> f32 {
        self.area
    }

    /// See [`super::Shape::bounds`].
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let [p0, p1, p2] = self.p;
        (p0.min(p1).min(p2), p0.max(p1).max(p2))
    }

    /// See [`super::Shape::normal_cone`].
    pub fn normal_cone(&self) -> (Vec3, f32) {
        let [f0, f1, f2] = self.facing;
        if f0.min(f1).min(f2) >= 0.0 {
            (self.n, 1.0)
        } else if f0.max(f1).max(f2) < 0.0 {
            (-self.n, 1.0)
        } else {
            // The vertex normals disagree about the side, so parts of the triangle face either way.
            (self.n, -1.0)
        }
    }

    /// Nearest hit; u, v are the barycentric coordinates of vertices 1 and 2.
    pub fn intersect(&self, origin: Vec3, direction: Vec3, t_range: (f32, f32)) -> Option<ShapeHit> {
        let (t, b1, b2) = self.ray(origin.as_dvec3(), direction.as_dvec3())?;
        let inside = b1 >= 0.0 && b2 >= 0.0 && b1 + b2 <= 1.0 && in_range(t, t_range);
        inside.then_some(ShapeHit { t: t as f32, u: b1 as f32, v: b2 as f32, local: Vec3::ZERO })
    }

    /// See [`super::Shape::sample`].
    pub fn sample(&self, from: Vec3, u: Vec2) -> Option<ShapeSample> {
        let Some(seen) = self.worth_sampling(from) else {
            let b = warp::uniform_triangle(u);
            return self.sample_at(b.x, b.y, |point, n| solid_angle_pdf(1.0 / f64::from(self.area), from, point, n));
        };
        let weights = seen.sample(u.x.into(), u.y.into());
        let inverse = 1.0 / (weights[0] + weights[1] + weights[2]);
        self.sample_at((weights[0] * inverse) as f32, (weights[1] * inverse) as f32, |_, _| {
            (1.0 / seen.solid_angle) as f32
        })
    }

    /// See [`super::Shape::pdf`].
    pub fn pdf(&self, from: Vec3, point: Vec3, n: Vec3) -> f32 {
        match self.worth_sampling(from) {
            Some(seen) => (1.0 / seen.solid_angle) as f32,
            None => finite_solid_angle_pdf(1.0 / f64::from(self.area), from, point, n),
        }
    }

    /// The spherical triangle, where it is to be sampled rather than the area.
    fn worth_sampling(&self, from: Vec3) -> Option<SphericalTriangle> {
        if (from - self.centroid).length_squared() > self.near_squared {
            return None;
        }
        let seen = SphericalTriangle::new(&self.p, from);
        SOLID_ANGLES.contains(&seen.solid_angle).then_some(seen)
    }

    /// The sample at barycentric coordinates `b0`, `b1` of vertices 0 and 1.
    ///
    /// The point errs by γ₃ of its three products, and by what b₂ is rounded, twice below 1, times vertex 2.
    #[inline]
    fn sample_at(&self, b0: f32, b1: f32, pdf: impl FnOnce(Vec3, Vec3) -> f32) -> Option<ShapeSample> {
        let [p0, p1, p2] = self.p;
        let b = [b0, b1, 1.0 - b0 - b1];
        let products = [p0 * b[0], p1 * b[1], p2 * b[2]];
        let size = products[0].abs() + products[1].abs() + products[2].abs();
        let error = gamma(3) * size + gamma(2) * p2.abs() + Vec3::splat(f32::MIN_POSITIVE);
        let mut point = PointWithError { p: products[0] + products[1] + products[2], error };
        // A shadow ray must end before the plane that it will be tested against.
        let deviation = self.tilt * (point.p - self.p[0]).length();
        point.error += self.n.abs() * deviation;
        let side = b[0] * self.facing[0] + b[1] * self.facing[1] + b[2] * self.facing[2];
        let n = if side < 0.0 { -self.n } else { self.n };
        let uv = self.uv[0] * b[0] + self.uv[1] * b[1] + self.uv[2] * b[2];
        usable(point, n, uv, pdf(point.p, n))
    }

    /// Ray parameter and barycentric coordinates of vertices 1 and 2 where the line meets the plane.
    ///
    /// **Source**: \[Moeller97\].
    fn ray(&self, origin: DVec3, direction: DVec3) -> Option<(f64, f64, f64)> {
        let [p0, p1, p2] = self.p.map(Vec3::as_dvec3);
        let (e1, e2) = (p1 - p0, p2 - p0);
        let s1 = direction.cross(e2);
        let divisor = s1.dot(e1);
        if divisor == 0.0 {
            return None;
        }
        let s = origin - p0;
        let s2 = s.cross(e1);
        Some((e2.dot(s2) / divisor, s.dot(s1) / divisor, direction.dot(s2) / divisor))
    }
}

/// The directions from a point to a triangle, as a triangle on the unit sphere.
struct SphericalTriangle {
    a: DVec3,
    b: DVec3,
    c: DVec3,
    /// 1 over the distances of the vertices.
    nearness: [f64; 3],
    /// |a · (b × c)|
    volume: f64,
    /// 1 + a · b
    ab: f64,
    /// a · c + b · c
    abc: f64,
    /// Steradians; NaN from a vertex.
    solid_angle: f64,
}

impl SphericalTriangle {
    /// **Source** of the solid angle: \[Oosterom83\] equation 8.
    fn new(p: &[Vec3; 3], from: Vec3) -> Self {
        let to = p.map(|p| p.as_dvec3() - from.as_dvec3());
        let nearness = to.map(|to| to.length_recip());
        let [a, b, c] = [to[0] * nearness[0], to[1] * nearness[1], to[2] * nearness[2]];
        let volume = a.dot(b.cross(c)).abs();
        let (ab, abc) = (1.0 + a.dot(b), (a + b).dot(c));
        let solid_angle = 2.0 * volume.atan2(ab + abc);
        Self { a, b, c, nearness, volume, ab, abc, solid_angle }
    }

    /// A direction uniform in solid angle, as weights of the vertices, not negative: the ray meets the flat triangle at
    /// their mean.
    ///
    /// **Source**: \[Peters21\] "BRDF Importance Sampling for Polygonal Lights", for the half vector. The
    /// differences that cancel for small triangles are left out: with w = 1 − b·ĉ = |b − ĉ|²/2 and a cosine of 1 − u₁w
    /// to b, (1 − cos²)/(1 − (b·ĉ)²) is u₁(2 − u₁w)/(2 − w).
    fn sample(&self, u0: f64, u1: f64) -> [f64; 3] {
        let Self { a, b, c, .. } = *self;
        // Choose the area of the sub-triangle a, b, ĉ. The vector half way from a to ĉ, on the arc from a to c, has the
        // coordinates that give its area by the formula for the solid angle.
        let (sin, cos) = (0.5 * u0 * self.solid_angle).sin_cos();
        let half = [self.volume * cos - self.abc * sin, self.ab * sin];
        let h = a * half[0] + c * half[1];
        let scale = 2.0 * a.dot(h) / h.length_squared();
        let c_hat = [scale * half[0] - 1.0, scale * half[1]];

        // Choose the direction on the arc from b to ĉ.
        let w = 0.5 * (a * c_hat[0] + c * c_hat[1] - b).length_squared();
        let drop = u1 * w;
        let along = (u1 * (2.0 - drop) / (2.0 - w)).max(0.0).sqrt();
        let weights = [along * c_hat[0], 1.0 - drop - along * (1.0 - w), along * c_hat[1]];
        // Weights are those of unit vectors so far. Below zero they are by rounding.
        std::array::from_fn(|i| (weights[i] * self.nearness[i]).max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use proptest::prelude::*;

    use super::super::testing::{Points, check_sampling, random_vec3};
    use super::super::{Shape, usable};
    use super::*;

    fn shape(p: [Vec3; 3]) -> Shape {
        Shape::Triangle(Triangle::new(p, None, None, false).unwrap())
    }

    #[test]
    fn samples_follow_the_density_from_near_far_and_grazing() {
        let triangle = shape([Vec3::new(-1.0, 0.2, 0.0), Vec3::new(1.3, -0.4, 0.1), Vec3::new(0.3, 1.5, -0.2)]);
        let from = [
            Vec3::new(0.1, 0.3, 1.0),
            Vec3::new(0.2, 0.3, -0.05),
            Vec3::new(3.0, 2.0, 0.2),
            Vec3::new(-30.0, 40.0, 90.0),
            Vec3::new(2.0, 0.4, 0.2),
        ];
        check_sampling(&triangle, &from);
        let sliver = shape([Vec3::ZERO, Vec3::new(2.0, 0.0, 0.0), Vec3::new(1.0, 5e-2, 0.0)]);
        check_sampling(&sliver, &[Vec3::new(1.0, 0.0, 0.5)]);
    }

    #[test]
    fn an_octant_is_an_eighth_of_the_sphere() {
        let octant = SphericalTriangle::new(&[Vec3::X, Vec3::Y, Vec3::Z], Vec3::ZERO);
        assert!((octant.solid_angle - PI / 2.0).abs() < 1e-14);
    }

    #[test]
    fn the_side_follows_the_vertex_normals() {
        let p = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let sample = |normals, flipped| {
            let triangle = Triangle::new(p, None, normals, flipped).unwrap();
            triangle.sample(Vec3::new(0.2, 0.2, 1.0), Vec2::splat(0.5)).unwrap().n
        };
        assert_eq!(sample(None, false), Vec3::Z);
        assert_eq!(sample(None, true), Vec3::NEG_Z);
        for flipped in [false, true] {
            assert_eq!(sample(Some([Vec3::NEG_Z; 3]), flipped), Vec3::NEG_Z);
            assert_eq!(sample(Some([Vec3::ZERO; 3]), flipped), sample(None, flipped));
        }
    }

    #[test]
    fn without_area_there_is_no_triangle_and_edge_on_no_sample() {
        assert!(Triangle::new([Vec3::ZERO, Vec3::X, Vec3::X * 2.0], None, None, false).is_none());
        assert!(Triangle::new([Vec3::ZERO, Vec3::X, Vec3::NAN], None, None, false).is_none());
        let triangle = Triangle::new([Vec3::ZERO, Vec3::X, Vec3::Y], None, None, false).unwrap();
        assert_eq!(triangle.sample(Vec3::new(5.0, 0.0, 0.0), Vec2::splat(0.3)), None);
        assert!(usable(Default::default(), Vec3::Z, Vec2::ZERO, f32::NAN).is_none());
    }

    proptest! {
        #[test]
        fn samples_are_on_the_triangle_within_their_error(seed: u64) {
            let mut points = Points::new(seed);
            let p: [Vec3; 3] = std::array::from_fn(|_| random_vec3(&mut points) * 100.0);
            let triangle = Triangle::new(p, None, None, false).unwrap();
            let from = random_vec3(&mut points) * 100.0;
            if let Some(sample) = triangle.sample(from, points.square()) {
                let [p0, p1, p2] = p.map(Vec3::as_dvec3);
                let n = (p1 - p0).cross(p2 - p0).normalize();
                let height = (sample.point.p.as_dvec3() - p0).dot(n).abs();
                prop_assert!(height <= n.abs().dot(sample.point.error.as_dvec3()), "{height}");
                prop_assert!((sample.pdf / triangle.pdf(from, sample.point.p, sample.n) - 1.0).abs() < 1e-5);
            }
        }
    }
}
