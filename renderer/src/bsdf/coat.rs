//! The dielectric coat of the layered models: what it reflects, lets in and keeps in, tabulated once per coat.
//!
//! The model is the one that pbrt-v4 evaluates by random walks: two parallel interfaces, light between them attenuated by
//! exp(−thickness/|cosθ|) per crossing. Light that meets the coat from outside at cosine μ is reflected with albedo R(μ)
//! or arrives at the base with T(μ); of light that leaves a Lambertian base a fraction `internal` comes back to it. All
//! three are integrals of the same single-scattering GGX interface as [`super::Dielectric`]'s, its losses included.

use glam::{Vec2, Vec3};

use super::fresnel::{dielectric, reflect, refract};
use super::microfacet::Ggx;
use super::table::{Axis, CosineTable, Position, blend};

/// Tables of one coat, for one width alpha or for all.
#[derive(Clone, Debug)]
pub struct CoatTable {
    eta: f32,
    thickness: f32,
    axis: Axis,
    rows: Vec<CoatRow>,
}

#[derive(Clone, Debug)]
struct CoatRow {
    /// (R(μ), T(μ)), attenuation on the way to the base included in T.
    outside: CosineTable<Vec2>,
    /// Mean of T under Lambertian illumination.
    mean_transmitted: f32,
    /// Of Lambertian light from the base, what returns to it, attenuation both ways included.
    internal: f32,
}

impl CoatTable {
    /// Nodes of textured coats: what is tabulated varies slowly with alpha.
    const NODES: [f32; 11] = [0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0];

    /// A coat with relative index `eta` whose width is `alpha`, or textured if that is `None`. `thickness` in mean free
    /// paths.
    pub fn new(eta: f32, thickness: f32, alpha: Option<f32>) -> Self {
        let thickness = thickness.max(0.0);
        // Without a step of the index the interface does nothing, however rough.
        let alpha = if eta == 1.0 { Some(0.0) } else { alpha };
        let axis = alpha.map_or_else(|| Axis::textured(&Self::NODES), Axis::constant);
        let row = |&alpha: &f32| CoatRow::new(eta, thickness, Ggx::isotropic(alpha));
        let rows = axis.nodes().iter().map(row).collect();
        Self { eta, thickness, axis, rows }
    }

    /// Relative index of the coat.
    pub fn eta(&self) -> f32 {
        self.eta
    }

    /// Its width is textured.
    pub(super) fn is_textured(&self) -> bool {
        self.axis.nodes().len() == Self::NODES.len()
    }

    pub(super) fn alphas(&self) -> &Axis {
        &self.axis
    }

    /// Thickness in mean free paths.
    pub fn thickness(&self) -> f32 {
        self.thickness
    }
}

impl CoatRow {
    /// Strata of the cosine for the internal reflection: fine, as the onset of total reflection is a step there.
    const COSINES: u32 = 128;

    fn new(eta: f32, thickness: f32, ggx: Ggx) -> Self {
        let points = facet_points(&ggx, FACETS);
        let mean = |cos_theta: f32, eta: f32, f: &dyn Fn(&Split) -> Vec2| {
            let w = grazing_limit(cos_theta);
            points.iter().map(|&(u, share)| share * f(&Split::new(&ggx, w, eta, u))).sum::<Vec2>()
        };
        let crossing = |w: Vec3| attenuation(thickness, w.z);
        let outside = CosineTable::new(|mu| {
            mean(mu, eta, &|split| {
                let transmitted = split.transmitted.map_or(0.0, |(w, energy)| energy * crossing(w));
                Vec2::new(split.reflected.map_or(0.0, |(_, energy)| energy), transmitted)
            })
        });
        let internal = (0..Self::COSINES)
            .map(|i| {
                // Uniform in μ²: cosine-weighted.
                let mu = ((i as f32 + 0.5) / Self::COSINES as f32).sqrt();
                let back = |split: &Split| split.reflected.map_or(0.0, |(w, energy)| energy * crossing(w));
                let back = mean(mu, 1.0 / eta, &|split| Vec2::splat(back(split))).x;
                f64::from(back * attenuation(thickness, mu))
            })
            .sum::<f64>();
        Self {
            mean_transmitted: outside.map(|entry| entry.y).cosine_mean(),
            outside,
            internal: (internal / f64::from(Self::COSINES)) as f32,
        }
    }
}

/// Strata of a facet that is integrated over: azimuth and cap.
pub(super) const FACETS: [u32; 2] = [12, 16];

/// Midpoints for [`Ggx::sample_visible`] from a direction without y, with weights that sum to 1: half of the azimuths, as
/// the other half mirrors them. The strata shrink towards the rim of the cap, where GGX has its long tail: with alpha =
/// 0.1 more than 1 % of the facets are steep enough to reflect into the surface at normal incidence.
pub(super) fn facet_points(ggx: &Ggx, [azimuths, caps]: [u32; 2]) -> Vec<(Vec2, f32)> {
    if ggx.is_smooth() {
        return vec![(Vec2::splat(0.5), 1.0)];
    }
    let point = |i, j| {
        // u = 1 − rim², of density 2 rim.
        let rim = (j as f32 + 0.5) / caps as f32;
        let u = Vec2::new(0.5 * (i as f32 + 0.5) / azimuths as f32, 1.0 - rim * rim);
        (u, 2.0 * rim / (azimuths * caps) as f32)
    };
    (0..azimuths).flat_map(|i| (0..caps).map(move |j| point(i, j))).collect()
}

/// A direction without y at cosine `mu`; one in the tangent plane stands for the limit towards it.
pub(super) fn grazing_limit(mu: f32) -> Vec3 {
    let z = mu.clamp(1e-3, 1.0);
    Vec3::new((1.0 - z * z).sqrt(), 0.0, z)
}

/// What is left of light that has crossed the coat once.
#[inline]
pub(super) fn attenuation(thickness: f32, cos_theta: f32) -> f32 {
    (-thickness / cos_theta.abs()).exp()
}

/// Both ways on from one sampled facet, each with its weight: energy over the density of the facet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Split {
    /// Above the surface.
    pub reflected: Option<(Vec3, f32)>,
    /// Below.
    pub transmitted: Option<(Vec3, f32)>,
    /// Total internal reflection.
    pub total: bool,
}

impl Split {
    /// For `w` above the surface and `eta` = index below over above.
    pub fn new(ggx: &Ggx, w: Vec3, eta: f32, u: Vec2) -> Self {
        let m = if ggx.is_smooth() { Vec3::Z } else { ggx.sample_visible(w, u) };
        let cos_m = w.dot(m).max(0.0);
        let interface = dielectric(cos_m, eta);
        let visible = |wi: Vec3| {
            let (so, zi) = (ggx.stretch(w), wi.z.abs());
            zi * (w.z + so) / (zi * so + w.z * ggx.stretch(wi))
        };
        let up = reflect(w, m);
        let down = refract(w, m, cos_m, interface.cos_t, eta);
        let (r, t) = (interface.reflectance, 1.0 - interface.reflectance);
        Self {
            reflected: (up.z > 0.0 && r > 0.0).then(|| (up, r * visible(up))),
            transmitted: (down.z < 0.0 && t > 0.0).then(|| (down, t * visible(down))),
            total: interface.reflectance == 1.0,
        }
    }
}

/// The coat at one point.
#[derive(Clone, Copy, Debug)]
pub struct Coat<'w> {
    pub(super) ggx: Ggx,
    pub(super) table: &'w CoatTable,
    row: Position,
}

impl<'w> Coat<'w> {
    /// The coat of `table` with the width of `ggx`. The tables of an anisotropic coat are those of the isotropic one with
    /// the same peak. Without a step of the index there is no interface, however rough.
    #[inline]
    pub fn new(ggx: Ggx, table: &'w CoatTable) -> Self {
        let ggx = if table.eta == 1.0 { Ggx::MIRROR } else { ggx };
        Self { ggx, table, row: table.axis.locate(ggx.mean_alpha()) }
    }

    pub(super) fn regularized(self) -> Self {
        Self::new(self.ggx.regularized(), self.table)
    }

    /// R(μ) and T(μ).
    #[inline]
    pub(super) fn reflected_and_transmitted(&self, cos_theta: f32) -> (f32, f32) {
        blend(&self.table.rows, self.row, |row| row.outside.at(cos_theta)).into()
    }

    /// T(μ).
    #[inline]
    pub(super) fn transmitted(&self, cos_theta: f32) -> f32 {
        self.reflected_and_transmitted(cos_theta).1
    }

    /// Mean of T under Lambertian illumination.
    #[inline]
    pub(super) fn mean_transmitted(&self) -> f32 {
        blend(&self.table.rows, self.row, |row| row.mean_transmitted)
    }

    /// Fraction of Lambertian light from the base that returns to it.
    #[inline]
    pub(super) fn internal(&self) -> f32 {
        blend(&self.table.rows, self.row, |row| row.internal)
    }
}
