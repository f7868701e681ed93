//! The GGX (Trowbridge–Reitz) distribution of microfacet normals with height-correlated Smith masking.
//!
//! With s(w) = √(cos² + αₓ²x² + αᵧ²y²) the masking terms have closed forms that stay finite in the tangent plane:
//! G₁/cosθ = 2/(cosθ + s) and G₂/(cosθₒ cosθᵢ) = 2/(cosθᵢ sₒ + cosθₒ sᵢ). All directions here are above the surface;
//! callers mirror them there.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::{Vec2, Vec3};

/// GGX with a width along either tangent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ggx {
    alpha: Vec2,
}

impl Ggx {
    /// Below this width in both directions a surface is drawn as perfectly smooth: pbrt-v4's threshold.
    pub const SMOOTH: f32 = 1e-3;

    /// A perfectly smooth surface.
    pub const MIRROR: Self = Self { alpha: Vec2::ZERO };

    /// Widths along the tangents. Neither falls below 10⁻⁴ unless both are smooth: D would overflow.
    #[inline]
    pub fn new(alpha: Vec2) -> Self {
        let smooth = alpha.max_element() < Self::SMOOTH;
        Self { alpha: if smooth { Vec2::ZERO } else { alpha.max(Vec2::splat(1e-4)).min(Vec2::ONE * 1e3) } }
    }

    /// The same width in all directions.
    pub fn isotropic(alpha: f32) -> Self {
        Self::new(Vec2::splat(alpha))
    }

    /// Widths along the tangents; zero when smooth.
    pub fn alpha(&self) -> Vec2 {
        self.alpha
    }

    /// The width of an isotropic surface whose D has the same peak.
    #[inline]
    pub fn mean_alpha(&self) -> f32 {
        if self.alpha.x == self.alpha.y { self.alpha.x } else { (self.alpha.x * self.alpha.y).sqrt() }
    }

    /// Reflection is a mirror's.
    #[inline]
    pub fn is_smooth(&self) -> bool {
        self.alpha.x == 0.0
    }

    /// Roughened so that a path that has already scattered diffusely can find light through it (pbrt-v4's rule).
    pub fn regularized(self) -> Self {
        Self::new(self.alpha.map(regularized_alpha))
    }

    /// Density of microfacet area over normals, sr⁻¹. `m` need not face up.
    #[inline]
    pub fn d(&self, m: Vec3) -> f32 {
        self.d_along(m, 1.0)
    }

    /// [`Self::d`] of the normal along `h`, of squared length `h2`: the normal itself need not be formed.
    ///
    /// D = 1/(π αₓαᵧ e²) with e = x²/αₓ² + y²/αᵧ² + z² of the unit normal, cleared of all divisions but one.
    #[inline]
    pub fn d_along(&self, h: Vec3, h2: f32) -> f32 {
        let area = self.alpha.x * self.alpha.y;
        let (x, y, z) = (h.x * self.alpha.y, h.y * self.alpha.x, h.z * area);
        // 1/e, at most area⁻² ≤ 10¹⁴. Of an h too short to be squared nothing is known: its density is 0.
        let inverse = h2 / (x * x + y * y + z * z).max(f32::MIN_POSITIVE);
        FRAC_1_PI * area * area * area * inverse * inverse
    }

    /// s(w) of the module's head.
    #[inline]
    pub fn stretch(&self, w: Vec3) -> f32 {
        ((self.alpha * w.truncate()).length_squared() + w.z * w.z).sqrt()
    }

    /// A normal seen from `wo` (cosθ ≥ 0), with density D(m) · 2 (wo·m)⁺/(cosθₒ + sₒ).
    ///
    /// **Source**: \[Dupuy23\] "Sampling Visible GGX Normals with Spherical Caps", listing 3.
    #[inline]
    pub fn sample_visible(&self, wo: Vec3, u: Vec2) -> Vec3 {
        let stretched = (self.alpha * wo.truncate()).extend(wo.z);
        let w = stretched.normalize();
        let (sin_phi, cos_phi) = (2.0 * PI * u.x).sin_cos();
        let z = (1.0 - u.y) * (1.0 + w.z) - w.z;
        let r = (1.0 - z * z).max(0.0).sqrt();
        let h = Vec3::new(r * cos_phi, r * sin_phi, z) + w;
        // h.z ≥ 0 up to rounding; h vanishes only for w and its antipode, which needs u.y = 1 and w.z = 0.
        (self.alpha * h.truncate()).extend(h.z.max(f32::MIN_POSITIVE)).normalize()
    }
}

/// pbrt-v4's regularisation of one width.
pub fn regularized_alpha(alpha: f32) -> f32 {
    if alpha < 0.3 { (2.0 * alpha).clamp(0.1, 0.3) } else { alpha }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫ D(m) (w·m)⁺ dm = cosθ / G₁: the projected area of the visible facets.
    #[test]
    fn visible_normals_project_to_the_surface() {
        for alpha in [Vec2::new(0.1, 0.1), Vec2::new(0.7, 0.3), Vec2::new(1.0, 1.0)] {
            let ggx = Ggx::new(alpha);
            for theta in [0.0_f64, 0.7, 1.4] {
                let w = Vec3::new(theta.sin() as f32 * 0.6, theta.sin() as f32 * 0.8, theta.cos() as f32);
                let expected = f64::from(0.5 * (w.z + ggx.stretch(w)));
                let (n_theta, n_phi) = (1000, 400);
                let mut sum = 0.0;
                for i in 0..n_theta {
                    // Midpoints of a polar angle squared at the pole, where narrow lobes live.
                    let x = (i as f64 + 0.5) / n_theta as f64;
                    let polar = x * x * std::f64::consts::FRAC_PI_2;
                    let d_polar = 2.0 * x * std::f64::consts::FRAC_PI_2 / n_theta as f64;
                    for j in 0..n_phi {
                        let phi = (j as f64 + 0.5) / n_phi as f64 * std::f64::consts::TAU;
                        let m = glam::DVec3::new(polar.sin() * phi.cos(), polar.sin() * phi.sin(), polar.cos());
                        let seen = f64::from(w.dot(m.as_vec3()).max(0.0));
                        sum += f64::from(ggx.d(m.as_vec3())) * seen * polar.sin() * d_polar;
                    }
                }
                sum *= std::f64::consts::TAU / n_phi as f64;
                assert!((sum / expected - 1.0).abs() < 1e-3, "{alpha} {theta}: {sum} {expected}");
            }
        }
    }

    #[test]
    fn smooth_means_both_widths() {
        assert!(Ggx::new(Vec2::splat(9e-4)).is_smooth());
        assert!(!Ggx::new(Vec2::new(0.0, 1e-3)).is_smooth());
        assert_eq!(Ggx::MIRROR.regularized().alpha(), Vec2::splat(0.1));
        assert_eq!(Ggx::isotropic(0.12).regularized().alpha(), Vec2::splat(0.24));
        assert_eq!(Ggx::isotropic(0.4).regularized().alpha(), Vec2::splat(0.4));
    }
}
