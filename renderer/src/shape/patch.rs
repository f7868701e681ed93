//! Bilinear patches: p(u, v) interpolates four corners that need not lie in a plane.

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::{
    ShapeHit, ShapeSample, SurfacePoint, finite_solid_angle_pdf, in_range, rounded, rounded_bounds, solid_angle_pdf,
    usable,
};

/// The four corners p00, p10, p01, p11 of a patch.
pub type Corners = [Vec3; 4];

/// The texture coordinates of the corners when the mesh has none: the parameters themselves.
pub const DEFAULT_UV: [Vec2; 4] = [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE];

/// A bilinear patch that emits.
///
/// Its normal is ∂p/∂u × ∂p/∂v, flipped if asked; vertex normals decide the side instead where they do not vanish.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    corners: Corners,
    uv: [Vec2; 4],
    normals: Option<[Vec3; 4]>,
    flipped: bool,
    area: f32,
    /// |∂p/∂u × ∂p/∂v| at the corners: what the sampling density follows.
    weights: [f64; 4],
}

impl Patch {
    /// `None`: no area, or not finite.
    pub fn new(corners: Corners, uv: Option<[Vec2; 4]>, normals: Option<[Vec3; 4]>, flipped: bool) -> Option<Self> {
        let weights = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].map(|(u, v)| cross(&corners, u, v).length());
        let area = area(&corners);
        // A patch folded to a line at a corner has weight 0 there: a floor keeps every point within reach.
        let largest = weights.iter().copied().fold(0.0, f64::max);
        let weights = weights.map(|weight| weight.max(1e-2 * largest));
        let uv = uv.unwrap_or(DEFAULT_UV);
        (area > 0.0 && area.is_finite()).then_some(Self { corners, uv, normals, flipped, area, weights })
    }

    /// Its corners.
    pub fn corners(&self) -> &Corners {
        &self.corners
    }

    /// Surface area.
    pub fn area(&self) -> f32 {
        self.area
    }

    /// See [`super::Shape::bounds`].
    pub fn bounds(&self) -> (Vec3, Vec3) {
        bounds(&self.corners)
    }

    /// See [`super::Shape::normal_cone`]. The unnormalised normal is bilinear in (u, v), so it lies in the convex cone of
    /// its values at the corners.
    pub fn normal_cone(&self) -> (Vec3, f32) {
        let at_corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
            .map(|(u, v)| self.oriented(DVec2::new(u, v), cross(&self.corners, u, v)).normalize_or_zero());
        let axis = at_corners.iter().sum::<DVec3>().normalize_or_zero();
        let cos = at_corners.iter().map(|n| n.dot(axis)).fold(1.0, f64::min);
        // The convex cone argument needs less than a hemisphere, and vertex normals may change the side in between.
        if cos > 0.0 && self.normals.is_none() {
            // The sums above err by a few ε of f64; the result is rounded down to f32.
            (axis.as_vec3(), (cos as f32 - f32::EPSILON).max(-1.0))
        } else {
            (Vec3::Z, -1.0)
        }
    }

    /// Nearest hit.
    pub fn intersect(&self, origin: Vec3, direction: Vec3, t_range: (f32, f32)) -> Option<ShapeHit> {
        intersect(&self.corners, origin, direction, t_range)
    }

    /// See [`super::Shape::sample`]: (u, v) by a bilinear density that follows the area.
    pub fn sample(&self, from: Vec3, u: Vec2) -> Option<ShapeSample> {
        let w = &self.weights;
        let v = sample_linear(w[0] + w[1], w[2] + w[3], u.y.into());
        let u = sample_linear(lerp(w[0], w[2], v), lerp(w[1], w[3], v), u.x.into());
        let normal = cross(&self.corners, u, v);
        let n = self.oriented(DVec2::new(u, v), normal).normalize_or_zero().as_vec3();
        let point = rounded(at(&self.corners, u, v), DVec3::ZERO);
        let area_pdf = self.parameter_pdf(u, v) / normal.length();
        usable(point, n, self.uv_at(u as f32, v as f32), solid_angle_pdf(area_pdf, from, point.p, n))
    }

    /// See [`super::Shape::pdf`].
    pub fn pdf(&self, from: Vec3, point: Vec3, n: Vec3) -> f32 {
        let DVec2 { x: u, y: v } = parameters(&self.corners, point.as_dvec3());
        let area_pdf = self.parameter_pdf(u, v) / cross(&self.corners, u, v).length();
        finite_solid_angle_pdf(area_pdf, from, point, n)
    }

    fn parameter_pdf(&self, u: f64, v: f64) -> f64 {
        let w = &self.weights;
        4.0 * lerp(lerp(w[0], w[1], u), lerp(w[2], w[3], u), v) / w.iter().sum::<f64>()
    }

    fn uv_at(&self, u: f32, v: f32) -> Vec2 {
        self.uv[0].lerp(self.uv[1], u).lerp(self.uv[2].lerp(self.uv[3], u), v)
    }

    fn oriented(&self, DVec2 { x: u, y: v }: DVec2, normal: DVec3) -> DVec3 {
        let normal = if self.flipped { -normal } else { normal };
        let against = self.normals.as_ref().is_some_and(|normals| at(normals, u, v).dot(normal) < 0.0);
        if against { -normal } else { normal }
    }
}

/// Nearest hit of a ray with the patch.
///
/// The ray meets the straight line at constant u in two values of u, the roots of a quadratic; v follows on that line.
///
/// **Source**: \[Reshetov19\].
pub fn intersect(corners: &Corners, origin: Vec3, direction: Vec3, t_range: (f32, f32)) -> Option<ShapeHit> {
    let d = direction.as_dvec3();
    let [q00, q10, q01, q11] = corners.map(|corner| corner.as_dvec3() - origin.as_dvec3());
    let (edge_0, edge_1) = (q01 - q00, q11 - q10);
    // f(u) = (q(u,0) × d) · (q(u,1) − q(u,0)) = a + bu + cu²
    let a = q00.cross(d).dot(edge_0);
    let c = (q10 - q00).cross(d).dot(edge_1 - edge_0);
    let b = q10.cross(d).dot(edge_1) - a - c;
    let candidates = roots(a, b, c).map(|u| {
        if !(0.0..=1.0).contains(&u) {
            return None;
        }
        let (base, edge) = (q00.lerp(q10, u), edge_0.lerp(edge_1, u));
        // Nearest points of the ray and the line base + v·edge.
        let normal = d.cross(edge);
        let squared = normal.length_squared();
        let side = normal.cross(base);
        let (t, v) = (side.dot(edge) / squared, side.dot(d) / squared);
        ((0.0..=1.0).contains(&v) && in_range(t, t_range)).then_some((t, u, v))
    });
    let nearest = candidates.into_iter().flatten().min_by(|x, y| x.0.total_cmp(&y.0));
    nearest.map(|(t, u, v)| ShapeHit { t: t as f32, u: u as f32, v: v as f32, local: Vec3::ZERO })
}

/// The differential geometry at (u, v); the normal is not flipped.
pub fn surface_point(corners: &Corners, u: f32, v: f32) -> SurfacePoint {
    let (u, v) = (f64::from(u), f64::from(v));
    let (dpdu, dpdv) = tangents(corners, u, v);
    SurfacePoint {
        point: rounded(at(corners, u, v), DVec3::ZERO),
        n: dpdu.cross(dpdv).normalize_or_zero().as_vec3(),
        dpdu: dpdu.as_vec3(),
        dpdv: dpdv.as_vec3(),
    }
}

/// Box around a patch, which lies in the convex hull of its corners.
pub fn bounds(corners: &Corners) -> (Vec3, Vec3) {
    let [a, b, c, d] = *corners;
    let (low, high) = (a.min(b).min(c).min(d), a.max(b).max(c).max(d));
    // Intersection computes in f64, so a hit may lie outside the hull by a few ε of f64.
    let slack = low.abs().max(high.abs()).as_dvec3() * 2.0_f64.powi(-48);
    rounded_bounds(low.as_dvec3() - slack, high.as_dvec3() + slack)
}

/// Area, by Gauss–Legendre quadrature over (u, v) of |∂p/∂u × ∂p/∂v|.
fn area(corners: &Corners) -> f32 {
    // Nodes and weights of five points on [-1, 1] (Abramowitz & Stegun, table 25.4).
    const RULE: [(f64, f64); 5] = [
        (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
        (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
        (0.0, 0.568_888_888_888_888_9),
        (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
        (0.906_179_845_938_664, 0.236_926_885_056_189_1),
    ];
    let sum: f64 = RULE
        .iter()
        .flat_map(|&x| RULE.iter().map(move |&y| (x, y)))
        .map(|((u, wu), (v, wv))| wu * wv * cross(corners, 0.5 + 0.5 * u, 0.5 + 0.5 * v).length())
        .sum();
    (0.25 * sum) as f32
}

/// The parameters of the point of the patch nearest to `p`, which lies on it to rounding.
///
/// Newton's iteration on the two tangents. It starts from the best of a coarse grid and converges quadratically: eight
/// steps are beyond f64 wherever the patch is not folded.
fn parameters(corners: &Corners, p: DVec3) -> DVec2 {
    const GRID: [f64; 3] = [1.0 / 6.0, 0.5, 5.0 / 6.0];
    let distance = |uv: &DVec2| (at(corners, uv.x, uv.y) - p).length_squared();
    let starts = GRID.iter().flat_map(|&u| GRID.iter().map(move |&v| DVec2::new(u, v)));
    let mut uv = starts.min_by(|x, y| distance(x).total_cmp(&distance(y))).unwrap_or(DVec2::splat(0.5));
    for _ in 0..8 {
        let (dpdu, dpdv) = tangents(corners, uv.x, uv.y);
        let miss = p - at(corners, uv.x, uv.y);
        let (e, f, g) = (dpdu.length_squared(), dpdu.dot(dpdv), dpdv.length_squared());
        let (x, y) = (miss.dot(dpdu), miss.dot(dpdv));
        let determinant = e * g - f * f;
        if determinant <= 0.0 {
            break;
        }
        let step = DVec2::new(g * x - f * y, e * y - f * x) / determinant;
        uv = (uv + step).clamp(DVec2::ZERO, DVec2::ONE);
    }
    uv
}

fn at(corners: &Corners, u: f64, v: f64) -> DVec3 {
    let [p00, p10, p01, p11] = corners.map(Vec3::as_dvec3);
    (p00 * (1.0 - u) + p10 * u) * (1.0 - v) + (p01 * (1.0 - u) + p11 * u) * v
}

fn tangents(corners: &Corners, u: f64, v: f64) -> (DVec3, DVec3) {
    let [p00, p10, p01, p11] = corners.map(Vec3::as_dvec3);
    ((p10 - p00).lerp(p11 - p01, v), (p01 - p00).lerp(p11 - p10, u))
}

fn cross(corners: &Corners, u: f64, v: f64) -> DVec3 {
    let (dpdu, dpdv) = tangents(corners, u, v);
    dpdu.cross(dpdv)
}

/// Real roots of a + bx + cx², without cancellation; NaN where there is none.
fn roots(a: f64, b: f64, c: f64) -> [f64; 2] {
    if c == 0.0 {
        return [-a / b, f64::NAN];
    }
    let q = -0.5 * (b + (b * b - 4.0 * a * c).sqrt().copysign(b));
    [q / c, a / q]
}

fn lerp(a: f64, b: f64, x: f64) -> f64 {
    a + (b - a) * x
}

/// x in [0, 1] with density proportional to `lerp(a, b, x)`, by inversion.
///
/// **Source**: \[Pharr23\] section 2.4.2.
fn sample_linear(a: f64, b: f64, u: f64) -> f64 {
    (u * (a + b) / (a + lerp(a * a, b * b, u).sqrt())).min(1.0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::Shape;
    use super::super::testing::{Points, check_geometry, check_sampling, random_vec3};
    use super::*;

    const SADDLE: Corners =
        [Vec3::new(-1.0, -1.0, 0.3), Vec3::new(1.2, -0.9, -0.2), Vec3::new(-0.8, 1.0, -0.3), Vec3::new(1.0, 1.3, 0.4)];

    #[test]
    fn samples_follow_the_density() {
        let patch = Patch::new(SADDLE, None, None, false).unwrap();
        let from = [Vec3::new(0.2, 0.1, 1.5), Vec3::new(4.0, -3.0, 1.5), Vec3::new(-1.0, 0.5, -0.6)];
        check_sampling(&Shape::Patch(patch.into()), &from);
        let rectangle = Patch::new([Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0)], None, None, false);
        check_sampling(&Shape::Patch(rectangle.unwrap().into()), &from);
    }

    #[test]
    fn hits_enclose_the_exact_point_and_lie_on_the_surface() {
        let patch = Patch::new(SADDLE, None, None, false).unwrap();
        check_geometry(
            &Shape::Patch(patch.into()),
            |hit| surface_point(&SADDLE, hit.u, hit.v),
            |p| {
                let uv = parameters(&SADDLE, p);
                (at(&SADDLE, uv.x, uv.y) - p).length()
            },
        );
    }

    #[test]
    fn a_rectangle_has_its_area_and_a_point_its_parameters() {
        let rectangle = [Vec3::ZERO, Vec3::X * 3.0, Vec3::Y * 2.0, Vec3::new(3.0, 2.0, 0.0)];
        assert!((area(&rectangle) - 6.0).abs() < 1e-6);
        assert_eq!(Patch::new(rectangle, None, None, false).unwrap().normal_cone().0, Vec3::Z);
        assert!(Patch::new([Vec3::ZERO; 4], None, None, false).is_none());
    }

    #[test]
    fn the_side_follows_the_vertex_normals_unless_they_vanish() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0)];
        let side = |normals, flipped| {
            let patch = Patch::new(corners, None, normals, flipped).unwrap();
            patch.sample(Vec3::new(0.2, 0.2, 1.0), Vec2::splat(0.5)).unwrap().n
        };
        for flipped in [false, true] {
            assert_eq!(side(Some([Vec3::NEG_Z; 4]), flipped), Vec3::NEG_Z);
            assert_eq!(side(Some([Vec3::ZERO; 4]), flipped), side(None, flipped));
        }
    }

    proptest! {
        #[test]
        fn parameters_invert_the_patch(u in 0.0f64..=1.0, v in 0.0f64..=1.0) {
            let uv = parameters(&SADDLE, at(&SADDLE, u, v));
            prop_assert!((uv - DVec2::new(u, v)).length() < 1e-9, "{uv} for {u} {v}");
        }

        #[test]
        fn all_normals_lie_in_the_cone(seed: u64) {
            let mut points = Points::new(seed);
            let corners: Corners = std::array::from_fn(|_| random_vec3(&mut points));
            let patch = Patch::new(corners, None, None, false).unwrap();
            let (axis, cos) = patch.normal_cone();
            let uv = points.square().as_dvec2();
            let n = cross(&corners, uv.x, uv.y).normalize_or_zero().as_vec3();
            prop_assert!(n.dot(axis) >= cos - 1e-6);
        }

        #[test]
        fn a_ray_through_a_point_of_the_patch_hits_it(seed: u64) {
            let mut points = Points::new(seed);
            let corners: Corners = std::array::from_fn(|_| random_vec3(&mut points));
            // Inside the border, where rounding to f32 cannot push the target off the patch.
            let uv = points.square() * 0.98 + 0.01;
            let target = at(&corners, uv.x.into(), uv.y.into()).as_vec3();
            let origin = random_vec3(&mut points) * 4.0;
            let n = cross(&corners, uv.x.into(), uv.y.into()).as_vec3();
            let direction = target - origin;
            prop_assume!(n.dot(direction).abs() > 1e-2 * direction.length());
            let hit = intersect(&corners, origin, direction, (0.0, 1.0 + 1e-4));
            prop_assert!(hit.is_some_and(|hit| hit.t <= 1.0 + 1e-4));
        }
    }
}
