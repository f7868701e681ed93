//! The area of a surface that a path's cone of rays covers.

use glam::{Vec2, Vec3};

use super::SurfaceInteraction;
use crate::texture::TexturePoint;

impl SurfaceInteraction<'_> {
    /// Where textures are looked up for a path whose cone has the given radius (world units) here; its diameter is one
    /// pixel's step.
    ///
    /// A plane at the angle θ cuts a cone in an ellipse: across the view its half axis is the radius r, and along the view
    /// r/cosθ for a narrow cone. At grazing angles the cone's spread counts: with its apex at distance t, the nearer side
    /// of the cut lies r / (cosθ + (r/t) sinθ) away, which never exceeds t. That side is taken for both: the other one
    /// recedes to infinity.
    ///
    /// **Source**: \[Akenine21\], with the bound above in place of theirs.
    pub fn texture_point(&self, radius: f32) -> TexturePoint {
        let cos = self.ng.dot(self.wo);
        let along_view = self.wo - self.ng * cos;
        let sin = along_view.length();
        // Seen head on, the footprint is a circle and any axes will do.
        let s = if sin > 0.0 { along_view / sin } else { self.ng.any_orthonormal_vector() };
        let spread = radius / self.t.max(f32::MIN_POSITIVE);
        let half_axis = radius / (cos.abs() + spread * sin);
        let half_axis = if half_axis.is_finite() { half_axis } else { radius };
        let (dpdx, dpdy) = (2.0 * half_axis * s, 2.0 * radius * self.ng.cross(s));
        let derivatives = if radius > 0.0 { self.derivatives() } else { None };
        let (duvdx, duvdy) = derivatives.map_or(Default::default(), |d| (uv_change(d, dpdx), uv_change(d, dpdy)));
        TexturePoint { p: self.point.p, n: self.ns, uv: self.uv(), dpdx, dpdy, duvdx, duvdy }
    }
}

/// The change of (u, v) that moves a point by `dp`, in the sense of least squares.
///
/// **Source**: \[Pharr23\] section 10.1.1.
fn uv_change((dpdu, dpdv): (Vec3, Vec3), dp: Vec3) -> Vec2 {
    let (e, f, g) = (dpdu.length_squared(), dpdu.dot(dpdv), dpdv.length_squared());
    let (x, y) = (dpdu.dot(dp), dpdv.dot(dp));
    let change = Vec2::new(g * x - f * y, e * y - f * x) / (e * g - f * f);
    if change.is_finite() { change } else { Vec2::ZERO }
}
