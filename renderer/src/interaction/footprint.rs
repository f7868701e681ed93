//! The area of a surface that a path's cone of rays covers.

use glam::{Vec2, Vec3};

use super::{Primitives, SurfaceInteraction};
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
        let (duvdx, duvdy) = if radius > 0.0 { self.uv_changes(dpdx, dpdy) } else { Default::default() };
        TexturePoint { p: self.point.p, n: self.ng, uv: self.uv(), dpdx, dpdy, duvdx, duvdy }
    }

    /// The changes of (u, v) along two tangents.
    fn uv_changes(&self, dpdx: Vec3, dpdy: Vec3) -> (Vec2, Vec2) {
        if let Primitives::Triangles(mesh) = &self.surface.primitives {
            // Along the edges the change is known, whether or not texture coordinates span the plane.
            let [p0, p1, p2] = mesh.triangle(self.primitive);
            let [uv0, uv1, uv2] = mesh.uv(self.primitive);
            let along = Coordinates::of(self.vector(p1 - p0), self.vector(p2 - p0));
            let change = |dp| {
                let c = along.coordinates(dp);
                c.x * (uv1 - uv0) + c.y * (uv2 - uv0)
            };
            return (change(dpdx), change(dpdy));
        }
        let along = self.derivatives().map(|(dpdu, dpdv)| Coordinates::of(dpdu, dpdv));
        along.map_or(Default::default(), |along| (along.coordinates(dpdx), along.coordinates(dpdy)))
    }
}

/// Coordinates of vectors by two others, in the sense of least squares.
///
/// **Source**: \[Pharr23\] section 10.1.1.
struct Coordinates {
    a: Vec3,
    b: Vec3,
    /// Rows of the inverse of their Gram matrix, which is symmetric; zero if they are parallel.
    inverse: [Vec2; 2],
}

impl Coordinates {
    #[inline]
    fn of(a: Vec3, b: Vec3) -> Self {
        let (aa, ab, bb) = (a.length_squared(), a.dot(b), b.length_squared());
        let determinant = aa * bb - ab * ab;
        let scale = if determinant > 0.0 && determinant.is_finite() { determinant.recip() } else { 0.0 };
        Self { a, b, inverse: [Vec2::new(bb, -ab) * scale, Vec2::new(-ab, aa) * scale] }
    }

    #[inline]
    fn coordinates(&self, v: Vec3) -> Vec2 {
        let products = Vec2::new(self.a.dot(v), self.b.dot(v));
        Vec2::new(self.inverse[0].dot(products), self.inverse[1].dot(products))
    }
}
