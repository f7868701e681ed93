//! What a dielectric coat makes of a rough metal's energy, tabulated once per coat and roughness.
//!
//! Light that enters the coat meets the metal once or several times before it leaves. What leaves after one bounce has a
//! closed form under a smooth coat; under a rough one its shape does, but not its energy. What comes back from the coat
//! without total reflection keeps the mirror direction and is counted with that lobe as its `echo`; what was totally
//! reflected has lost it and leaves almost diffusely. Both are integrated here for a perfect metal, bounce by bounce, as
//! functions of the cosine: a metal of reflectance F scales what has bounced n times by Fⁿ.

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
    /// Factor g of the closed form f of the single bounce: g(ωₒ) f g(ωᵢ) has the energy of the bounce and its echo.
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

impl MetalRow {
    fn new(coat: &Coat, base: Ggx) -> Self {
        let inside = Inside::new(coat, &base);
        let entries = Entries::new(coat);
        let outside =
            |values: &[f32]| CosineTable::new(|mu| entries.mean(mu, |mu_inside| interpolate(values, mu_inside)));
        let mean_after = |values: &[f32]| outside(values).cosine_mean();
        let share = |part: f32, whole: f32| if whole > 0.0 { part / whole } else { 0.0 };

        let lobe = LobeSamples::new(coat, &widened(base, &coat.ggx, coat.table.eta()));
        // Under a smooth coat the closed form is exact and need not be interpolated.
        let exact = coat.ggx.is_smooth();
        let single = if exact { lobe.albedo(&CosineTable::new(|_| 1.0)) } else { outside(&inside.direct[0]) };
        let single_mean = single.cosine_mean();
        let echo_by_bounce = std::array::from_fn(|n| share(mean_after(&inside.direct[n + 1]), single_mean));
        let echo: f32 = echo_by_bounce.iter().sum();
        let echoes = outside(&sum(&inside.direct[1..]));
        let target = CosineTable::new(|mu| (single.at(mu) + echoes.at(mu)) / (1.0 + echo));

        let diffused = outside(&sum(&inside.diffused));
        let diffused_mean = diffused.cosine_mean();
        Self {
            gain: lobe.gain(&target),
            diffused_by_bounce: std::array::from_fn(|n| share(mean_after(&inside.diffused[n + 1]), diffused_mean)),
            echo_by_bounce,
            single,
            diffused,
            diffused_mean,
        }
    }
}

/// Point `i` of the four-dimensional Kronecker sequence of the generalised golden ratio (root of x⁵ = x + 1).
fn kronecker(i: u32) -> (Vec2, Vec2) {
    const ROOT: f64 = 1.167_303_978_261_418_7;
    let x = |power: i32| (0.5 + f64::from(i) * ROOT.powi(-power)).fract() as f32;
    (Vec2::new(x(1), x(2)), Vec2::new(x(3), x(4)))
}

/// Intervals of the cosine inside the coat. Finer than outside: all that enters does so within the critical angle.
const INSIDE_INTERVALS: usize = 128;

/// Points per cosine. Every integrand is smooth but for the onset of total reflection: halving this moves albedos by
/// less than half a percent.
const POINTS: u32 = 2048;

/// A direction at cosine `mu`; one in the tangent plane stands for the limit towards it.
fn grazing_limit(mu: f32) -> Vec3 {
    let z = mu.max(1e-3);
    Vec3::new((1.0 - z * z).sqrt(), 0.0, z)
}

/// Values at multiples of 1/`INSIDE_INTERVALS`, at `mu`.
fn interpolate(values: &[f32], mu: f32) -> f32 {
    let x = mu.clamp(0.0, 1.0) * INSIDE_INTERVALS as f32;
    let i = (x as usize).min(INSIDE_INTERVALS - 1);
    values[i] + (values[i + 1] - values[i]) * (x - i as f32)
}

/// Sum of functions of the cosine inside.
fn sum(functions: &[Vec<f32>]) -> Vec<f32> {
    (0..=INSIDE_INTERVALS).map(|i| functions.iter().map(|f| f[i]).sum()).collect()
}

/// Of light on its way to a perfect metal inside the coat, by its cosine: what leaves after bounce 1, 2, ….
struct Inside {
    /// Without total reflection.
    direct: Vec<Vec<f32>>,
    /// With it.
    diffused: Vec<Vec<f32>>,
}

/// One way of light from the base to the coat and, in part, back.
#[derive(Clone, Copy)]
struct Cycle {
    /// Fraction that leaves.
    exit: f32,
    /// Fraction that arrives at the base again, and at which cosine.
    back: f32,
    cosine: f32,
    total: bool,
}

impl Inside {
    fn new(coat: &Coat, base: &Ggx) -> Self {
        let cycles: Vec<Vec<Cycle>> = (0..=INSIDE_INTERVALS)
            .map(|i| {
                let w = grazing_limit(i as f32 / INSIDE_INTERVALS as f32);
                (0..POINTS).filter_map(|k| cycle(coat, base, w, kronecker(k))).collect()
            })
            .collect();
        let step = |f: &dyn Fn(&Cycle) -> f32| -> Vec<f32> {
            cycles.iter().map(|cycles| cycles.iter().map(f).sum::<f32>() / POINTS as f32).collect()
        };
        let mut total = step(&|cycle| cycle.exit);
        let mut direct = vec![total.clone()];
        let mut diffused = vec![vec![0.0; INSIDE_INTERVALS + 1]];
        for bounce in 1..BASE_BOUNCES {
            let previous = &direct[bounce - 1];
            let kept = step(&|cycle| if cycle.total { 0.0 } else { cycle.back * interpolate(previous, cycle.cosine) });
            total = step(&|cycle| cycle.back * interpolate(&total, cycle.cosine));
            diffused.push(total.iter().zip(&kept).map(|(total, kept)| (total - kept).max(0.0)).collect());
            direct.push(kept);
        }
        Self { direct, diffused }
    }
}

/// From `w`, above the base, by one facet of the metal and one of the coat.
fn cycle(coat: &Coat, base: &Ggx, w: Vec3, (u_base, u_coat): (Vec2, Vec2)) -> Option<Cycle> {
    let thickness = coat.table.thickness();
    let (up, mut energy) = if base.is_smooth() {
        (Vec3::new(-w.x, -w.y, w.z), 1.0)
    } else {
        let lobe = Reflection::sample(base, w, u_base)?;
        (lobe.wi, lobe.value / lobe.pdf)
    };
    energy *= attenuation(thickness, up.z);
    // The coat is met from below: mirrored, its inside is above it. GGX does not mind.
    let at_coat = Split::new(&coat.ggx, Vec3::new(-up.x, -up.y, up.z), 1.0 / coat.table.eta(), u_coat);
    let (cosine, fraction) = at_coat.reflected.map_or((0.0, 0.0), |(back, fraction)| (back.z, fraction));
    let back = if fraction > 0.0 { fraction * attenuation(thickness, cosine) } else { 0.0 };
    let exit = at_coat.transmitted.map_or(0.0, |transmitted| transmitted.1);
    Some(Cycle { exit: energy * exit, back: energy * back, cosine, total: at_coat.total })
}

/// Where light from outside arrives at the base.
struct Entries(Vec<Vec<(f32, f32)>>);

impl Entries {
    /// Cosines inside and energies, for each node of a [`CosineTable`].
    fn new(coat: &Coat) -> Self {
        let points = if coat.ggx.is_smooth() { 1 } else { POINTS };
        let at = |mu: f32| -> Vec<(f32, f32)> {
            (0..points)
                .filter_map(|k| {
                    let split = Split::new(&coat.ggx, grazing_limit(mu), coat.table.eta(), kronecker(k).0);
                    let (down, energy) = split.transmitted?;
                    Some((-down.z, energy * attenuation(coat.table.thickness(), down.z) / points as f32))
                })
                .collect()
        };
        Self((0..=CosineTable::INTERVALS).map(|i| at(i as f32 / CosineTable::INTERVALS as f32)).collect())
    }

    /// Mean of `f` over what enters at `mu`, a node of a [`CosineTable`].
    fn mean(&self, mu: f32, f: impl Fn(f32) -> f32) -> f32 {
        let node = (mu * CosineTable::INTERVALS as f32).round() as usize;
        self.0[node].iter().map(|&(cosine, energy)| energy * f(cosine)).sum()
    }
}

/// Samples of the closed form of the single bounce on a perfect metal.
struct LobeSamples {
    /// For each node of a [`CosineTable`]: the cosine at which light leaves, and its energy.
    samples: Vec<Vec<(f32, f32)>>,
}

impl LobeSamples {
    fn new(coat: &Coat, base: &Ggx) -> Self {
        let eta = coat.table.eta();
        let sample = |wo: Vec3, k: u32| {
            let w = inside(wo, eta)?;
            let (up, energy) = if base.is_smooth() {
                (w, 1.0)
            } else {
                let lobe = Reflection::sample(base, w, kronecker(k).1)?;
                (lobe.wi, lobe.value / lobe.pdf)
            };
            let out = inside(up, 1.0 / eta)?;
            Some((out.z, energy * coat.transmitted(wo.z) * coat.transmitted(out.z) / POINTS as f32))
        };
        let at = |i: usize| {
            let wo = grazing_limit(i as f32 / CosineTable::INTERVALS as f32);
            (0..POINTS).filter_map(|k| sample(wo, k)).collect()
        };
        Self { samples: (0..=CosineTable::INTERVALS).map(at).collect() }
    }

    /// Directional albedo of the closed form times `gain` of the direction in which the light leaves.
    fn albedo(&self, gain: &CosineTable) -> CosineTable {
        let mut nodes = self.samples.iter();
        CosineTable::new(|_| {
            let node = nodes.next().map_or(&[][..], Vec::as_slice);
            node.iter().map(|&(cosine, energy)| energy * gain.at(cosine)).sum()
        })
    }

    /// The symmetric gain with which the closed form has the directional albedo `target`, by damped Sinkhorn iteration.
    fn gain(&self, target: &CosineTable) -> CosineTable {
        let mut gain = CosineTable::new(|_| 1.0);
        // Each step halves the error in log g where the lobe is narrow, which is the slow case: 2⁻⁸.
        for _ in 0..8 {
            let albedo = self.albedo(&gain);
            gain = CosineTable::new(|mu| {
                // Where the model has no energy there is nothing to correct.
                let (now, wanted, model) = (gain.at(mu), target.at(mu), albedo.at(mu));
                if model > 0.0 { (now * wanted / model).sqrt() } else { now }
            });
        }
        gain
    }
}
