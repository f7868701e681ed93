//! What a dielectric coat makes of a rough metal's energy, tabulated once per coat and roughness.
//!
//! Light that enters the coat meets the metal once or several times before it leaves. What leaves after one bounce has a
//! closed form under a smooth coat; under a rough one its shape does, but not its energy. What comes back from the coat
//! without total reflection keeps the mirror direction and is counted with that lobe as its `echo`; what was totally
//! reflected has lost it and leaves almost diffusely. Both are integrated here for a perfect metal, bounce by bounce, as
//! functions of the cosine: a metal of reflectance F scales what has bounced n times by Fⁿ.

use glam::{Vec2, Vec3};

use super::coat::{Coat, CoatTable, FACETS, Split, attenuation, facet_points, grazing_limit};
use super::conductor::Reflection;
use super::fresnel::dielectric;
use super::microfacet::Ggx;
use super::table::{Axis, CosineTable, INTERVALS, Position, blend};
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
        // Of two constant widths both are regularised or neither is: the mixed rows are hardly asked for.
        let paired = base_alpha.is_some() && !coat.is_textured() && coats.nodes().len() == 2 && base.nodes().len() == 2;
        let mut rows: Vec<MetalRow> = Vec::with_capacity(coats.nodes().len() * base.nodes().len());
        for (i, &c) in coats.nodes().iter().enumerate() {
            for (j, &b) in base.nodes().iter().enumerate() {
                let row = match rows.last() {
                    Some(row) if paired && i != j => row.clone(),
                    _ => MetalRow::new(&Coat::new(Ggx::isotropic(c), coat), Ggx::isotropic(b)),
                };
                rows.push(row);
            }
        }
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

/// Intervals of the cosine inside the coat. Finer than outside: all that enters does so within the critical angle.
const INSIDE_INTERVALS: usize = 128;

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

/// Where light goes from one surface to the other: cosines there, and energies.
struct Ways(Vec<Vec<(f32, f32)>>);

impl Ways {
    /// From each node of [`INSIDE_INTERVALS`].
    fn new(from: impl Fn(Vec3) -> Vec<(f32, f32)>) -> Self {
        Self((0..=INSIDE_INTERVALS).map(|i| from(grazing_limit(i as f32 / INSIDE_INTERVALS as f32))).collect())
    }

    /// Of a function of the cosine at the other surface, its mean as one of the cosine here.
    fn mean(&self, values: &[f32]) -> Vec<f32> {
        let at = |ways: &Vec<(f32, f32)>| ways.iter().map(|&(mu, energy)| energy * interpolate(values, mu)).sum();
        self.0.iter().map(at).collect()
    }
}

impl Inside {
    /// The facets of either surface are integrated over on their own: between isotropic surfaces light forgets its
    /// azimuth as far as energies are concerned.
    fn new(coat: &Coat, base: &Ggx) -> Self {
        let (eta, thickness) = (1.0 / coat.table.eta(), coat.table.thickness());
        let up = Ways::new(|w| up_from_base(base, w, thickness));
        let points = facet_points(&coat.ggx, FACETS);
        let splits = |w: Vec3| points.iter().map(move |&(u, share)| (share, Split::new(&coat.ggx, w, eta, u)));
        let back = |total_too: bool| {
            Ways::new(|w| {
                let kept = splits(w).filter(|(_, split)| total_too || !split.total);
                let back = kept.filter_map(|(share, split)| Some((share, split.reflected?)));
                back.map(|(share, (w, energy))| (w.z, share * energy * attenuation(thickness, w.z))).collect()
            })
        };
        let (back_all, back_direct) = (back(true), back(false));
        let leaving = |w| splits(w).filter_map(|(share, split)| Some(share * split.transmitted?.1)).sum();
        let exit: Vec<f32> =
            (0..=INSIDE_INTERVALS).map(|i| leaving(grazing_limit(i as f32 / INSIDE_INTERVALS as f32))).collect();

        let mut all = up.mean(&exit);
        let mut direct = vec![all.clone()];
        let mut diffused = vec![vec![0.0; INSIDE_INTERVALS + 1]];
        for bounce in 1..BASE_BOUNCES {
            let kept = up.mean(&back_direct.mean(&direct[bounce - 1]));
            all = up.mean(&back_all.mean(&all));
            diffused.push(all.iter().zip(&kept).map(|(all, kept)| (all - kept).max(0.0)).collect());
            direct.push(kept);
        }
        Self { direct, diffused }
    }
}

/// Where a perfect metal reflects light that comes from `w`, and what of it arrives at the coat.
fn up_from_base(base: &Ggx, w: Vec3, thickness: f32) -> Vec<(f32, f32)> {
    if base.is_smooth() {
        return vec![(w.z, attenuation(thickness, w.z))];
    }
    let points = facet_points(base, FACETS);
    let lobes = points.iter().filter_map(|&(u, share)| Some((share, Reflection::sample(base, w, u)?)));
    lobes.map(|(share, lobe)| (lobe.wi.z, share * lobe.value / lobe.pdf * attenuation(thickness, lobe.wi.z))).collect()
}

/// Where light from outside arrives at the base.
struct Entries(Vec<Vec<(f32, f32)>>);

impl Entries {
    /// Cosines inside and energies, for each node of a [`CosineTable`].
    fn new(coat: &Coat) -> Self {
        let points = facet_points(&coat.ggx, FACETS);
        let at = |mu: f32| -> Vec<(f32, f32)> {
            let enter = |&(u, share): &(Vec2, f32)| {
                let (w, energy) = Split::new(&coat.ggx, grazing_limit(mu), coat.table.eta(), u).transmitted?;
                Some((-w.z, share * energy * attenuation(coat.table.thickness(), w.z)))
            };
            points.iter().filter_map(enter).collect()
        };
        Self((0..=INTERVALS).map(|i| at(i as f32 / INTERVALS as f32)).collect())
    }

    /// Mean of `f` over what enters at `mu`, a node of a [`CosineTable`].
    fn mean(&self, mu: f32, f: impl Fn(f32) -> f32) -> f32 {
        let node = (mu * INTERVALS as f32).round() as usize;
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
        let at = |i: usize| -> Vec<(f32, f32)> {
            let wo = grazing_limit(i as f32 / INTERVALS as f32);
            let Some(w) = inside(wo, eta) else { return Vec::new() };
            // Light on its way out is attenuated as part of what the coat transmits.
            let up = up_from_base(base, w, 0.0);
            let out = up.iter().filter_map(|&(mu, energy)| Some((inside(grazing_limit(mu), 1.0 / eta)?.z, energy)));
            out.map(|(mu, energy)| (mu, energy * coat.transmitted(wo.z) * coat.transmitted(mu))).collect()
        };
        Self { samples: (0..=INTERVALS).map(at).collect() }
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
