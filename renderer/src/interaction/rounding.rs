//! How far off a surface a spawned ray must start so that the ray query, which rounds too, does not meet it again.
//!
//! A spawned ray starts at o = p + d·n, beyond the error of p (see [`crate::math::spawn_ray`]). It must also clear the
//! plane that the ray query tests, which is not quite that of the vertices. The query decides by the sign of
//!
//! T = Ng · (v₀ − o),
//!
//! with a normal Ng that it computes from rounded edges. With p's barycentric coordinates the exact plane of the triangle
//! passes through p to within p's error, but the *computed* Ng may be tilted: each of its components errs by up to γ₄ of
//! the two products of edges that it is the difference of, which for a sliver are far larger than the difference. A bound
//! made of edge lengths would therefore push rays off a sliver by a good part of its length.
//!
//! **The fast test** (Möller–Trumbore) computes e₁ = v₀ − v₁, e₂ = v₂ − v₀ and Ng = e₂ × e₁ from the vertices alone, so the
//! same bits for every ray, and reports them with the hit. So the tilt need not be bounded: the height of p over the tested
//! plane is *measured* as h = |n · (v₀ − p)| with n = Ng/|Ng|. What remains is the rounding of T itself: of v₀ − o (one
//! operation) and of the dot product (three), γ₄ Σ|nᵢ||v₀ − o|ᵢ, as much again for the measurement of h, and the rounding of
//! n, of d and of o, which are relative to the same terms: γ₁₂ Σ|nᵢ||v₀ − p|ᵢ covers all of it, as |v₀ − o| exceeds
//! |v₀ − p| by no more than d.
//!
//! **The watertight test** (Plücker) computes vertices relative to the origin, vᵢ′ = vᵢ − o, edges and Ng from those, and
//! T = Ng · v₀′. The rounding of vᵢ′ moves the plane at p by a combination of the vertices' own movements weighted by p's
//! barycentric coordinates, Σ|bᵢ| ε maxᵢ Σⱼ|nⱼ||vᵢ − p|ⱼ, sliver or not; Σ|bᵢ| exceeds 1 only as far as p's error takes it
//! out of the triangle, by that error over the triangle's heights. Then Ng has the error of its products, for which the
//! test chooses, component by component, the pair of edges with the smaller one (`stable_triangle_normal`): with
//! a − b = Ng exactly, |a| + |b| ≤ |Ng| + 2|b|, so the unit normal errs by τᵢ = γ₄(|nᵢ| + 2|b|ᵢ/|Ng|) and T by Σ τᵢ|v₀ − p|ᵢ.
//! That depends on the ray, so it cannot be measured; it is small for slivers with one short edge, and what is due for
//! those with none.
//!
//! **Which side a ray leaves by** is the sign of n · direction, which the query computes as well, and for directions in the
//! tangent plane with another result: it may take a ray that leaves for one that approaches by the angle that the two
//! normals differ by, γ₄ or τ. Such a ray comes down at a distance of the spare clearance over that angle. So with the angle
//! times the triangle's extent to spare it comes down outside the triangle.

use glam::Vec3A;

use crate::math::gamma;

/// Which of Embree's triangle tests rays are traced with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TriangleTest {
    /// Möller–Trumbore: scenes that are not robust.
    #[default]
    Fast,
    /// Plücker coordinates: robust scenes.
    Watertight,
}

impl TriangleTest {
    /// Distance along the unit normal `n` of the query that clears the tested plane of a triangle from its point `p`, known
    /// to ± `error`. `to` leads from p to the vertices; `extent` holds their largest coordinates.
    #[inline]
    pub(super) fn clearance(self, to: &[Vec3A; 3], extent: Vec3A, n: Vec3A, error: Vec3A) -> f32 {
        let products = n.abs().dot(to[0].abs());
        let tangential = gamma(4) * extent.element_sum();
        match self {
            Self::Fast => n.dot(to[0]).abs() + gamma(12) * products + tangential,
            Self::Watertight => gamma(12) * products + tangential + watertight(to, extent, n, error),
        }
    }
}

/// What the watertight test needs beyond the rounding of its last dot product.
#[inline]
fn watertight(to: &[Vec3A; 3], extent: Vec3A, n: Vec3A, error: Vec3A) -> f32 {
    let (e0, e1, e2) = (to[2] - to[0], to[0] - to[1], to[1] - to[2]);
    // The products that are compared: z·y, x·z, y·x of neighbouring edges.
    let products = |a: Vec3A, b: Vec3A| Vec3A::new(a.z * b.y, a.x * b.z, a.y * b.x).abs();
    let chosen = products(e0, e1).min(products(e1, e2));
    let doubled_area = e0.cross(e1).length().max(f32::MIN_POSITIVE);
    let tilt = gamma(4) * (n.abs() + 2.0 * chosen / doubled_area);
    let weights = 1.0 + error.length() * (e0.length() + e1.length() + e2.length()) / doubled_area;
    gamma(2) * weights * n.abs().dot(extent) + tilt.dot(to[0].abs()) + tilt.element_sum() * extent.element_sum()
}
