//! What a dielectric coat makes of a rough metal's energy, tabulated once per coat and roughness.
//!
//! Light that enters the coat meets the metal once or several times before it leaves. What leaves after one bounce has a
//! closed form under a smooth coat; under a rough one its shape does, but not its energy. What comes back from the coat
//! without total reflection keeps the mirror direction and is counted with that lobe as its `echo`; what was totally
//! reflected has lost it and leaves almost diffusely. The split is measured here by walks with a perfect metal; since the
//! number of bounces n is known of each part, a metal of reflectance F scales it by Fⁿ.

use glam::{Vec2, Vec3};

use super::coat::{Coat, CoatTable, Split, attenuation};
use super::conductor::Reflection;
use super::fresnel::dielectric;
use super::microfacet::Ggx;
use super::table::{Axis, CosineTable, Position, blend};
use crate::math::Rgb;

/// Bounces on the base that pbrt-v4 follows: every other of its default `maxdepth` 10 events.
pub(super) const BASE_BOUNCES: usize = 5;

/// Tables of a metal under one coat.
#[derive(Clone, Debug)]
pub struct MetalTable {
    coat: Axis,
    base: Axis,
    /// By coat, then base.
    rows: Vec<MetalRow>,
}

#[derive(Clone, Debug)]
struct MetalRow {
    /// Energy after one bounce on a perfect metal.
    single: CosineTable,
    /// Square root of what the closed form of the single bounce must be multiplied by to have that energy.
    gain: CosineTable,
    /// Energy that went through total reflection, all bounces.
    diffused: CosineTable,
    /// Its mean under Lambertian illumination.
    diffused_mean: f32,
    /// Fractions of it by bounces n = 2, 3, …
    diffused_by_bounce: [f32; BASE_BOUNCES - 1],
    /// Energy that comes back without total reflection, relative to the single bounce, by bounces n = 2, 3, …
    echo_by_bounce: [f32; BASE_BOUNCES - 1],
}

/// A place in a [`MetalTable`].
#[derive(Clone, Copy, Debug)]
pub(super) struct MetalPosition {
    coat: Position,
    base: Position,
}

impl MetalTable {
    /// Nodes of textured surfaces. Coarser than the coat's: a row costs more, and what it holds is a correction.
    const NODES: [f32; 6] = [0.0, 0.1, 0.2, 0.35, 0.6, 1.0];

    /// A metal of width `base_alpha`, or textured if that is `None`, under `coat`.
    pub fn new(coat: &CoatTable, base_alpha: Option<f32>) -> Self {
        let coats = if coat.is_textured() { Axis::textured(&Self::NODES) } else { coat.alphas().clone() };
        let base = base_alpha.map_or_else(|| Axis::textured(&Self::NODES), Axis::constant);
        let rows = coats
            .nodes()
            .iter()
            .flat_map(|&c| base.nodes().iter().map(move |&b| (c, b)))
            .map(|(c, b)| MetalRow::new(&Coat::new(Ggx::isotropic(c), coat), Ggx::isotropic(b)))
            .collect();
        Self { coat: coats, base, rows }
    }

    #[inline]
    pub(super) fn locate(&self, coat_alpha: f32, base_alpha: f32) -> MetalPosition {
        MetalPosition { coat: self.coat.locate(coat_alpha), base: self.base.locate(base_alpha) }
    }

    #[inline]
    fn at(&self, position: MetalPosition, f: impl Fn(&MetalRow) -> f32) -> f32 {
        let width = self.base.nodes().len();
        let of_coat = |coat: u32| {
            let start = coat as usize * width;
            blend(&self.rows[start..start + width], position.base, &f)
        };
        let a = of_coat(position.coat.index);
        if position.coat.fraction == 0.0 {
            a
        } else {
            a + (of_coat(position.coat.index + 1) - a) * position.coat.fraction
        }
    }

    /// Energy that leaves after one bounce on a perfect metal.
    #[inline]
    pub(super) fn single(&self, position: MetalPosition, cos_theta: f32) -> f32 {
        self.at(position, |row| row.single.at(cos_theta))
    }

    /// Factor of the closed form of the single bounce, for each of its two directions.
    #[inline]
    pub(super) fn gain(&self, position: MetalPosition, cos_theta: f32) -> f32 {
        self.at(position, |row| row.gain.at(cos_theta))
    }

    /// Energy that leaves after total reflections, from a perfect metal.
    #[inline]
    pub(super) fn diffused(&self, position: MetalPosition, cos_theta: f32) -> f32 {
        self.at(position, |row| row.diffused.at(cos_theta))
    }

    /// Mean of [`Self::diffused`] under Lambertian illumination.
    #[inline]
    pub(super) fn diffused_mean(&self, position: MetalPosition) -> f32 {
        self.at(position, |row| row.diffused_mean)
    }

    /// What a metal of reflectance `f` leaves of [`Self::diffused`].
    #[inline]
    pub(super) fn diffused_by_metal(&self, position: MetalPosition, f: Rgb) -> Rgb {
        f * f * self.series(position, f, |row, n| row.diffused_by_bounce[n])
    }

    /// Echo of a metal of reflectance `f`, relative to the single bounce.
    #[inline]
    pub(super) fn echo(&self, position: MetalPosition, f: Rgb) -> Rgb {
        f * self.series(position, f, |row, n| row.echo_by_bounce[n])
    }

    /// c₀ + c₁f + c₂f² + …
    #[inline]
    fn series(&self, position: MetalPosition, f: Rgb, c: impl Fn(&MetalRow, usize) -> f32) -> Rgb {
        (0..BASE_BOUNCES - 1).rev().fold(Rgb::ZERO, |sum, n| sum * f + self.at(position, |row| c(row, n)))
    }
}

/// The metal's width as seen through the coat's facets.
///
/// A facet tilted by δ turns what it refracts by (1 − 1/η)δ inside the coat; one of the metal turns what it reflects by
/// twice its tilt. Two refractions therefore act as a tilt of variance ½(1 − 1/η)² that of the coat's, and variances of
/// independent tilts add: \[Belcour18\] section 4, to first order.
#[inline]
pub(super) fn widened(base: Ggx, coat: &Ggx, eta: f32) -> Ggx {
    if coat.is_smooth() {
        return base;
    }
    let bend = 1.0 - 1.0 / eta;
    let alpha2 = base.alpha() * base.alpha() + 0.5 * bend * bend * coat.alpha() * coat.alpha();
    // Behind a rough coat there is no mirror, however slight the roughness.
    Ggx::new(alpha2.map(f32::sqrt).max(Vec2::splat(Ggx::SMOOTH)))
}

/// Direction inside the coat, above the base, of a direction outside; `None` under total reflection.
#[inline]
pub(super) fn inside(w: Vec3, eta: f32) -> Option<Vec3> {
    let interface = dielectric(w.z, eta);
    (interface.cos_t > 0.0).then(|| Vec3::new(w.x / eta, w.y / eta, interface.cos_t))
}

/// Energy by number of bounces on the base, and whether it was totally reflected.
#[derive(Clone, Copy, Debug, Default)]
struct Ledger {
    direct: [f64; BASE_BOUNCES],
    diffused: [f64; BASE_BOUNCES],
}

impl MetalRow {
    /// Walks per cosine. The first bounce, which carries most of the energy, is stratified; all cosines share the walks'
    /// numbers, so the tables are smooth.
    const WALKS: u32 = 192;

    fn new(coat: &Coat, base: Ggx) -> Self {
        let mut ledgers = Vec::with_capacity(CosineTable::INTERVALS + 1);
        let single = CosineTable::new(|mu| {
            ledgers.push(walk(coat, &base, grazing_limit(mu)));
            ledgers[ledgers.len() - 1].direct[0] as f32
        });
        let of = |pick: &dyn Fn(&Ledger) -> f64| {
            let mut values = ledgers.iter().map(pick);
            CosineTable::new(|_| values.next().unwrap_or(0.0) as f32)
        };
        let gain = CosineTable::new(|mu| {
            let model = single_bounce_albedo(coat, &widened(base, &coat.ggx, coat.table.eta()), grazing_limit(mu));
            // Where the model has no energy there is nothing to correct.
            if coat.ggx.is_smooth() || model <= 0.0 { 1.0 } else { (single.at(mu) / model).sqrt() }
        });
        let diffused = of(&|ledger| ledger.diffused.iter().sum());
        let (single_mean, diffused_mean) = (single.cosine_mean(), diffused.cosine_mean());
        let share = |part: f32, whole: f32| if whole > 0.0 { part / whole } else { 0.0 };
        Self {
            diffused_by_bounce: std::array::from_fn(|n| {
                share(of(&|ledger| ledger.diffused[n + 1]).cosine_mean(), diffused_mean)
            }),
            echo_by_bounce: std::array::from_fn(|n| {
                share(of(&|ledger| ledger.direct[n + 1]).cosine_mean(), single_mean)
            }),
            single,
            gain,
            diffused,
            diffused_mean,
        }
    }
}

/// A direction at cosine `mu`; one in the tangent plane stands for the limit towards it.
fn grazing_limit(mu: f32) -> Vec3 {
    let z = mu.max(1e-3);
    Vec3::new((1.0 - z * z).sqrt(), 0.0, z)
}

/// Point `i` of the four-dimensional Kronecker sequence of the generalised golden ratio (root of x⁵ = x + 1).
fn kronecker(i: u32) -> [f32; 4] {
    const ROOT: f64 = 1.167_303_978_261_418_7;
    std::array::from_fn(|d| (0.5 + f64::from(i) * ROOT.powi(-(d as i32) - 1)).fract() as f32)
}

/// Uniform number of walk `i`, event `n`, by an integer hash (\[Wellons18\] `lowbias32`).
fn hashed(i: u32, n: u32) -> f32 {
    let mut x = i.wrapping_mul(0x9e37_79b9) ^ n.wrapping_mul(0x85eb_ca6b);
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    ((x ^ (x >> 16)) >> 8) as f32 / (1u32 << 24) as f32
}

/// Mean over walks from `wo` between the coat and a perfect metal; at the coat both ways on are followed.
fn walk(coat: &Coat, base: &Ggx, wo: Vec3) -> Ledger {
    let (eta, thickness) = (coat.table.eta(), coat.table.thickness());
    let mut ledger = Ledger::default();
    for i in 0..MetalRow::WALKS {
        let first = kronecker(i);
        let entry = Split::new(&coat.ggx, wo, eta, Vec2::new(first[0], first[1]));
        let Some((down, mut energy)) = entry.transmitted else { continue };
        energy *= attenuation(thickness, down.z);
        let mut w = -down;
        let mut diffused = false;
        for bounce in 0..BASE_BOUNCES {
            let u = |k: u32| hashed(i, 4 * bounce as u32 + k);
            let u_base = if bounce == 0 { Vec2::new(first[2], first[3]) } else { Vec2::new(u(0), u(1)) };
            let up = if base.is_smooth() {
                Vec3::new(-w.x, -w.y, w.z)
            } else {
                let Some(lobe) = Reflection::sample(base, w, u_base) else { break };
                energy *= lobe.value / lobe.pdf;
                lobe.wi
            };
            energy *= attenuation(thickness, up.z);
            // Seen from the coat, the light arrives from below: mirror it, GGX does not mind.
            let below = Vec3::new(-up.x, -up.y, up.z);
            let exit = Split::new(&coat.ggx, below, 1.0 / eta, Vec2::new(u(2), u(3)));
            if let Some((_, fraction)) = exit.transmitted {
                let part = if diffused { &mut ledger.diffused } else { &mut ledger.direct };
                part[bounce] += f64::from(energy * fraction) / f64::from(MetalRow::WALKS);
            }
            let Some((back, fraction)) = exit.reflected else { break };
            energy *= fraction * attenuation(thickness, back.z);
            diffused |= exit.total;
            w = Vec3::new(-back.x, -back.y, back.z);
        }
    }
    ledger
}

/// Directional albedo of the closed form of the single bounce on a perfect metal, before its gain.
fn single_bounce_albedo(coat: &Coat, base: &Ggx, wo: Vec3) -> f32 {
    let eta = coat.table.eta();
    let Some(w) = inside(wo, eta) else { return 0.0 };
    if base.is_smooth() {
        return 0.0;
    }
    let mut sum = 0.0_f64;
    for i in 0..MetalRow::WALKS {
        let k = kronecker(i);
        let Some(lobe) = Reflection::sample(base, w, Vec2::new(k[2], k[3])) else { continue };
        let Some(out) = inside(lobe.wi, 1.0 / eta) else { continue };
        sum += f64::from(lobe.value / lobe.pdf * coat.transmitted(out.z));
    }
    coat.transmitted(wo.z) * (sum / f64::from(MetalRow::WALKS)) as f32
}
