//! Statistical checks that every shape must pass.

use std::f64::consts::TAU;

use glam::{DMat4, DVec3, Vec2, Vec3};

use super::{Shape, ShapeHit, SurfacePoint, patch};
use crate::math::Transform;

/// Deterministic uniform numbers.
///
/// **Source**: \[Steele14\] SplitMix64.
pub(crate) struct Points(u64);

impl Points {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in [0, 1).
    pub(crate) fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 * 2.0_f32.powi(-24)
    }

    pub(crate) fn square(&mut self) -> Vec2 {
        Vec2::new(self.unit(), self.unit())
    }
}

/// Uniform in the cube [−1, 1)³.
pub(crate) fn random_vec3(points: &mut Points) -> Vec3 {
    Vec3::new(points.unit(), points.unit(), points.unit()) * 2.0 - 1.0
}

/// Placements of every kind: none, moved and turned, mirrored, stretched and sheared.
pub(crate) fn placements() -> Vec<Transform> {
    let turn = DMat4::from_axis_angle(DVec3::new(0.36, 0.48, 0.8), 1.0);
    let shift = DMat4::from_translation(DVec3::new(13.0, -7.0, 3.0));
    let mut shear = DMat4::from_scale(DVec3::new(0.7, 1.0, 1.6));
    shear.y_axis.x = 0.4;
    vec![
        Transform::default(),
        Transform::new(shift * turn * DMat4::from_scale(DVec3::splat(0.8))),
        Transform::new(turn * DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0))),
        Transform::new(shift * turn * shear),
    ]
}

/// Checks `sample` against `pdf` from several points: the pdf that a sample states, that the density integrates to 1 over
/// the directions in which rays meet the shape, and a χ² test of the sampled directions against that density.
pub(crate) fn check_sampling(shape: &Shape, from: &[Vec3]) {
    for (index, &from) in from.iter().enumerate() {
        let directions = Directions::around(shape, from);
        let expected = directions.expected(shape, from);
        let total: f64 = expected.iter().map(|bin| bin.probability).sum();
        let tolerance = 5.0 * expected.iter().map(|bin| bin.variance).sum::<f64>().sqrt();
        assert!(tolerance < 0.15, "from point {index} too few rays meet {shape:?}: {tolerance}");
        assert!(
            (total - 1.0).abs() <= tolerance + 1e-3,
            "from point {index} the pdf of {shape:?} integrates to {total}"
        );
        const SAMPLES: usize = 50_000;
        let counts = directions.counts(shape, from, SAMPLES);
        let z = chi_squared_deviation(&expected, &counts, SAMPLES);
        // Five standard deviations of the statistic: one false alarm in 3.5 million, and the seeds are fixed.
        assert!(z < 5.0, "from point {index} the samples of {shape:?} are off by {z} standard deviations");
    }
}

/// Bins of equal solid angle in the cone of directions from a point to a shape.
struct Directions {
    axis: DVec3,
    s: DVec3,
    t: DVec3,
    one_minus_cos: f64,
}

const BINS: usize = 16;

/// What the density predicts of a bin, from random rays.
#[derive(Clone, Copy, Default)]
struct Bin {
    probability: f64,
    /// Of `probability`; that of independent rays, which bounds that of jittered ones.
    variance: f64,
}

impl Directions {
    fn around(shape: &Shape, from: Vec3) -> Self {
        let (low, high) = shape.bounds();
        let to_centre = ((low + high) * 0.5 - from).as_dvec3();
        let radius = f64::from((high - low).length()) * 0.5;
        let sin_squared = (radius * radius / to_centre.length_squared()).min(1.0);
        let one_minus_cos = if sin_squared < 1.0 { 1.0 - (1.0 - sin_squared).sqrt() } else { 2.0 };
        let axis = to_centre.normalize_or(DVec3::Z);
        let (s, t) = axis.any_orthonormal_pair();
        Self { axis, s, t, one_minus_cos }
    }

    fn direction(&self, x: f64, y: f64) -> DVec3 {
        let drop = x * self.one_minus_cos;
        let (sin, cos) = (y * TAU).sin_cos();
        self.axis * (1.0 - drop) + (self.s * cos + self.t * sin) * (drop * (2.0 - drop)).max(0.0).sqrt()
    }

    fn bin(&self, direction: DVec3) -> usize {
        let x = 0.5 * (direction - self.axis).length_squared() / self.one_minus_cos;
        let y = direction.dot(self.t).atan2(direction.dot(self.s)) / TAU;
        let index = |x: f64| ((x.rem_euclid(1.0) * BINS as f64) as usize).min(BINS - 1);
        index(x.min(1.0 - 1e-9)) * BINS + index(y)
    }

    /// Probability of each bin: the density summed over all hits of each ray, over a jittered grid of rays.
    fn expected(&self, shape: &Shape, from: Vec3) -> Vec<Bin> {
        const RAYS: usize = 32;
        const SIDE: usize = BINS * RAYS;
        let mut points = Points::new(7);
        let mut sums = vec![(0.0, 0.0); BINS * BINS];
        for i in 0..SIDE {
            for j in 0..SIDE {
                let jitter = points.square().as_dvec2();
                let side = SIDE as f64;
                let direction = self.direction((i as f64 + jitter.x) / side, (j as f64 + jitter.y) / side).as_vec3();
                let density = density(shape, from, direction);
                let (sum, squares) = &mut sums[i / RAYS * BINS + j / RAYS];
                *sum += density;
                *squares += density * density;
            }
        }
        let solid_angle = TAU * self.one_minus_cos / (SIDE * SIDE) as f64;
        let rays = (RAYS * RAYS) as f64;
        let bin = |(sum, squares): (f64, f64)| Bin {
            probability: solid_angle * sum,
            variance: solid_angle * solid_angle * (squares - sum * sum / rays).max(0.0) * rays / (rays - 1.0),
        };
        sums.into_iter().map(bin).collect()
    }

    fn counts(&self, shape: &Shape, from: Vec3, samples: usize) -> Vec<usize> {
        let mut points = Points::new(11);
        let mut counts = vec![0; BINS * BINS];
        for _ in 0..samples {
            let Some(sample) = shape.sample(from, points.square()) else { continue };
            let stated = shape.pdf(from, sample.point.p, sample.n);
            assert!((sample.pdf / stated - 1.0).abs() < 1e-3, "sample says {}, pdf says {stated}", sample.pdf);
            counts[self.bin((sample.point.p - from).as_dvec3().normalize())] += 1;
        }
        counts
    }
}

/// Sum of the densities of all points of the shape in a direction.
fn density(shape: &Shape, from: Vec3, direction: Vec3) -> f64 {
    let (mut near, mut sum) = (0.0, 0.0);
    // A line meets each of the shapes at most twice.
    for _ in 0..2 {
        let Some(hit) = shape.intersect(from, direction, (near, f32::INFINITY)) else { break };
        let p = from + direction * hit.t;
        sum += match shape {
            // A sphere that is sampled by solid angle has one density per direction, not per point.
            Shape::Sphere(sphere) => {
                let n = sphere.surface_point(hit.local).n;
                let pdf = f64::from(sphere.pdf(from, p, n));
                if f64::from(sphere.pdf(from, p + n, n)) == pdf { return pdf } else { pdf }
            }
            Shape::Disk(disk) => f64::from(disk.pdf(from, p, disk.surface_point(hit.local).n)),
            Shape::Cylinder(cylinder) => f64::from(cylinder.pdf(from, p, cylinder.surface_point(hit.local).n)),
            Shape::Patch(patch) => f64::from(patch.pdf(from, p, patch::surface_point(patch.corners(), hit.u, hit.v).n)),
            Shape::Triangle(triangle) => f64::from(triangle.pdf(from, p, triangle.normal_cone().0)),
        };
        // Beyond this hit by more than the rounding of t.
        near = hit.t * (1.0 + 4.0 * f32::EPSILON);
    }
    sum
}

/// Pearson's statistic in standard deviations above its mean. Bins that expect fewer than 20 samples are pooled; a bin's
/// variance is that of the count and that of the expectation.
fn chi_squared_deviation(expected: &[Bin], counts: &[usize], samples: usize) -> f64 {
    let (mut statistic, mut degrees) = (0.0, 0.0);
    let mut pooled = (0.0, 0.0, 0.0);
    let samples = samples as f64;
    let mut add = |expected: f64, variance: f64, count: f64| {
        statistic += (count - expected) * (count - expected) / (expected + variance);
        degrees += 1.0;
    };
    for (bin, &count) in expected.iter().zip(counts) {
        let (expected, variance, count) = (bin.probability * samples, bin.variance * samples * samples, count as f64);
        if expected >= 20.0 {
            add(expected, variance, count);
        } else {
            pooled = (pooled.0 + expected, pooled.1 + variance, pooled.2 + count);
        }
    }
    let (pooled_expected, variance, count) = pooled;
    if pooled_expected >= 20.0 {
        add(pooled_expected, variance, count);
    } else {
        let limit = pooled_expected + 5.0 * (20.0 + variance).sqrt();
        assert!(count <= limit, "{count} samples where {pooled_expected} are expected");
    }
    (statistic - degrees) / (2.0 * f64::max(degrees, 1.0)).sqrt()
}

/// Checks hits of random rays: that the point is the ray's to `f32` precision, that it lies on the surface, whose implicit
/// function is `distance`, within its error bound, and that tangents and normal are orthogonal.
pub(crate) fn check_geometry(
    shape: &Shape,
    surface_point: impl Fn(&ShapeHit) -> SurfacePoint,
    distance: impl Fn(DVec3) -> f64,
) {
    let mut points = Points::new(3);
    let (low, high) = shape.bounds();
    let (centre, size) = ((low + high) * 0.5, (high - low).length());
    let mut hits = 0;
    for _ in 0..20_000 {
        let origin = centre + random_vec3(&mut points) * size * 2.0;
        let target = low + (high - low) * (random_vec3(&mut points) * 0.5 + 0.5);
        let direction = target - origin;
        let Some(hit) = shape.intersect(origin, direction, (0.0, f32::INFINITY)) else { continue };
        hits += 1;
        let surface = surface_point(&hit);
        let (p, error) = (surface.point.p.as_dvec3(), surface.point.error.as_dvec3());
        let along_ray = origin.as_dvec3() + direction.as_dvec3() * f64::from(hit.t);
        let scale = f64::from(size + centre.length());
        let cos = f64::from(direction.normalize().dot(surface.n).abs());
        assert!((p - along_ray).length() < 1e-5 * scale / cos.max(1e-3), "{p} is not at {along_ray}");
        // Some point of the error box is on the surface: the implicit function changes sign, or is within the noise of
        // f64, along the diagonal of the box that is nearest to the normal.
        let reach = error * surface.n.as_dvec3().signum();
        let (below, above) = (distance(p - reach), distance(p + reach));
        assert!(below * above <= 0.0 || below.abs().min(above.abs()) < 1e-7 * scale.max(1.0), "{below} {above} at {p}");
        let inside = surface.point.p.cmpge(low).all() && surface.point.p.cmple(high).all();
        assert!(inside, "{p} is outside {low} {high}");
        let tolerance = |v: Vec3| 1e-5 * v.length();
        assert!(surface.dpdu.dot(surface.n).abs() <= tolerance(surface.dpdu));
        assert!(surface.dpdv.dot(surface.n).abs() <= tolerance(surface.dpdv));
    }
    assert!(hits > 1000, "only {hits} rays of 20000 hit {shape:?}");
}
