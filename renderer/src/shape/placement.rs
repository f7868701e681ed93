//! How a quadric is placed in the world: an affine map, and what it does to points, normals, areas and rounding.

use glam::{DAffine3, DMat3, DVec3, Vec2, Vec3};

use super::{ShapeSample, finite_solid_angle_pdf, rounded, rounded_bounds, solid_angle_pdf, usable};
use crate::math::{PointWithError, Transform};

/// The placement of a shape that is given in its own space.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Placement {
    world_from_shape: DAffine3,
    shape_from_world: DAffine3,
    /// −1 when the normals point the other way.
    orientation: f64,
    /// |det|: ratio of volumes.
    determinant: f64,
    /// Relative error of a round trip between the spaces.
    roundoff: f64,
    /// The factor of lengths, when it is the same in all directions.
    pub scale: Option<f64>,
}

impl Placement {
    /// `None` when the map is singular or not finite.
    pub fn new(world_from_shape: &Transform, reverse_orientation: bool) -> Option<Self> {
        let forward = DAffine3::from_mat4(world_from_shape.matrix());
        let inverse = DAffine3::from_mat4(world_from_shape.inverse().matrix());
        let determinant = forward.matrix3.determinant().abs();
        if !(forward.is_finite() && inverse.is_finite() && determinant > 0.0 && determinant.is_finite()) {
            return None;
        }
        let flipped = reverse_orientation != world_from_shape.swaps_handedness();
        // A map with 4 terms per coordinate errs by γ₄ < 2⁻⁵⁰ of the terms' absolute sum; the way back multiplies that
        // by the condition number.
        let condition = (abs(forward.matrix3) * abs(inverse.matrix3) * DVec3::ONE).max_element();
        Some(Self {
            scale: similarity(forward.matrix3),
            world_from_shape: forward,
            shape_from_world: inverse,
            orientation: if flipped { -1.0 } else { 1.0 },
            determinant,
            roundoff: (1.0 + condition) * 2.0_f64.powi(-50),
        })
    }

    /// A ray in the shape's own space. The ray parameter stays the same.
    pub fn local_ray(&self, origin: Vec3, direction: Vec3) -> (DVec3, DVec3) {
        (
            self.shape_from_world.transform_point3(origin.as_dvec3()),
            self.shape_from_world.transform_vector3(direction.as_dvec3()),
        )
    }

    /// World to shape space.
    pub fn local_point(&self, p: DVec3) -> DVec3 {
        self.shape_from_world.transform_point3(p)
    }

    /// Shape to world space, not rounded.
    pub fn world_point(&self, local: DVec3) -> DVec3 {
        self.world_from_shape.transform_point3(local)
    }

    /// Shape to world space.
    pub fn point(&self, local: DVec3) -> PointWithError {
        let translation = self.world_from_shape.translation;
        let terms = abs(self.world_from_shape.matrix3) * local.abs() + translation.abs();
        rounded(self.world_point(local), DVec3::splat(terms.max_element() * self.roundoff))
    }

    /// A tangent, shape to world space.
    pub fn vector(&self, local: DVec3) -> Vec3 {
        self.world_from_shape.transform_vector3(local).as_vec3()
    }

    /// The unit oriented normal in world space of a normal in shape space.
    pub fn normal(&self, local: DVec3) -> Vec3 {
        ((self.shape_from_world.matrix3.transpose() * local).normalize() * self.orientation).as_vec3()
    }

    /// Ratio of world area to shape-space area where the unit normal in shape space is `local`.
    ///
    /// A cross product maps by the cofactor matrix, which is the determinant times the transposed inverse.
    pub fn area_ratio(&self, local: DVec3) -> f64 {
        self.determinant * (self.shape_from_world.matrix3.transpose() * local).length()
    }

    /// As [`Self::area_ratio`], from the unit normal in world space: Mᵀn is the shape-space normal over the length that
    /// M⁻ᵀ gives it.
    pub fn area_ratio_from_world(&self, n: Vec3) -> f64 {
        self.determinant / (self.world_from_shape.matrix3.transpose() * n.as_dvec3()).length()
    }

    /// The sample at a point that was drawn uniformly over the area in shape space.
    pub fn area_sample(&self, from: Vec3, local: DVec3, normal: DVec3, uv: Vec2, area: f64) -> Option<ShapeSample> {
        let (point, n) = (self.point(local), self.normal(normal));
        let area_pdf = 1.0 / (area * self.area_ratio(normal));
        usable(point, n, uv, solid_angle_pdf(area_pdf, from, point.p, n))
    }

    /// Density (sr⁻¹) of [`Self::area_sample`].
    pub fn area_sample_pdf(&self, from: Vec3, point: Vec3, n: Vec3, area: f64) -> f32 {
        finite_solid_angle_pdf(1.0 / (area * self.area_ratio_from_world(n)), from, point, n)
    }

    /// World area of a surface of area `area` in shape space whose normal at the parameters `(u, v)`, uniform over that
    /// area, is `normal(u, v)`.
    pub fn world_area(&self, area: f64, normal: impl Fn(f64, f64) -> DVec3) -> f32 {
        if let Some(scale) = self.scale {
            return (area * scale * scale) as f32;
        }
        // Midpoint rule: the integrand is smooth, and periodic over a full sweep.
        const STEPS: u32 = 128;
        let at = |i: u32| (f64::from(i) + 0.5) / f64::from(STEPS);
        let sum: f64 = (0..STEPS)
            .flat_map(|i| (0..STEPS).map(move |j| (at(i), at(j))))
            .map(|(u, v)| self.area_ratio(normal(u, v)))
            .sum();
        (area * sum / f64::from(STEPS * STEPS)) as f32
    }

    /// Box around the circle of `radius` around the z axis at `height`; a sphere's when `tall` (its axes are three).
    pub fn circle_bounds(&self, height: f64, radius: f64, tall: bool) -> (Vec3, Vec3) {
        let m = self.world_from_shape.matrix3;
        let centre = self.world_point(DVec3::Z * height);
        // The largest x of an ellipsoid is the length of the first row of its matrix, and so on.
        let z = if tall { m.z_axis } else { DVec3::ZERO };
        let extent = DVec3::from_array(std::array::from_fn(|i| DVec3::new(m.x_axis[i], m.y_axis[i], z[i]).length()));
        let terms = abs(m) * DVec3::splat(radius + height.abs()) + self.world_from_shape.translation.abs();
        let reach = extent * radius + terms * self.roundoff;
        rounded_bounds(centre - reach, centre + reach)
    }
}

fn abs(m: DMat3) -> DMat3 {
    DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs())
}

/// The factor of lengths of a similarity: MᵀM = s²·1.
fn similarity(m: DMat3) -> Option<f64> {
    let gram = m.transpose() * m;
    let squared = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
    // Scene files state rotations in f32 decimals: their columns are orthonormal to a few ε of f32, not better. A sphere
    // that is round to this precision cannot be told from one in an image or by a ray of f32.
    let tolerance = 8.0 * f64::from(f32::EPSILON) * squared;
    let deviation = gram - DMat3::from_diagonal(DVec3::splat(squared));
    let round = deviation.to_cols_array().iter().all(|x| x.abs() <= tolerance);
    round.then(|| squared.sqrt())
}

/// The azimuth of a point around the z axis, in [0, 2π).
pub(super) fn azimuth(p: DVec3) -> f64 {
    let phi = p.y.atan2(p.x);
    if phi < 0.0 { phi + std::f64::consts::TAU } else { phi }
}

/// A sweep in degrees as an angle, limited to a full turn.
pub(super) fn sweep(degrees: f32) -> f64 {
    f64::from(degrees.clamp(0.0, 360.0)).to_radians()
}
