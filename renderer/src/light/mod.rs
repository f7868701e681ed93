//! Lights: what they emit, how they are sampled, and which one a sample goes to.
//!
//! pbrt-v4's lights by pbrt-v4's meaning. A light is *bounded* (emitting shapes, and lights at a point) or *infinite*
//! (environments, and parallel light). A light sample goes to each infinite light with the same probability, and with that
//! probability once more to the bounded ones, among which a [`tree`] chooses by what the receiver may get of them.
//!
//! # Invariants
//! Densities are per solid angle at the receiver, in sr⁻¹, and include the probability of choosing the light. Cosines at
//! the receiver are the caller's. What [`Lights::emitter_pdf`] says of a point and [`Lights::escaped`] of a direction is
//! what [`Lights::sample`] would have had there: the weights of both sum to 1, but for emitting surfaces in one place, of
//! which a sample may choose any and a ray hits one.

mod area;
mod bounds;
mod choose;
mod compile;
mod environment;
mod image;
mod infinite;
mod mis;
mod point;
#[cfg(test)]
mod testing;
mod tree;

use std::sync::Arc;

use glam::{Vec2, Vec3};

pub use compile::{Emitter, Message};
pub use mis::power_heuristic;

use crate::math::{BELOW_ONE, PointWithError, Rgb};
use crate::texture::Textures;
use area::AreaEmitter;
use image::LightImage;
use infinite::Infinite;
use point::PointLight;
use tree::LightTree;

/// All lights of a scene.
#[derive(Clone, Debug, Default)]
pub struct Lights {
    /// By the numbers that [`Self::emitted`] takes.
    emitters: Vec<AreaEmitter>,
    /// Over the emitters' surfaces.
    images: Vec<Arc<LightImage>>,
    /// Lights at a point.
    points: Vec<Member<PointLight>>,
    /// Over emitters, then points, numbered on.
    tree: LightTree,
    /// Those that are sampled come first.
    infinite: Vec<Member<Infinite>>,
    /// How many those are.
    sampled_infinite: usize,
    /// Probability of each of those; the bounded lights together have the rest.
    infinite_pmf: f32,
    /// Names of the groups.
    groups: Vec<Arc<str>>,
}

/// What a light sample chooses from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Selection {
    /// Lights with a place, by a tree if there are several.
    pub bounded: usize,
    /// Infinite ones.
    pub infinite: usize,
    /// Infinite ones that BSDF samples alone find.
    pub unsampled: usize,
    /// Bytes of the tree.
    pub tree_bytes: usize,
}

/// A group of lights, by its number: what its lights send is of interest by itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Group(pub u16);

/// The name of the group of all lights that are in none.
pub const NO_GROUP: &str = "default";

/// A light and the group that it is in.
#[derive(Clone, Debug)]
struct Member<L> {
    light: L,
    group: Group,
}

/// A point that light is gathered for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    /// Where, in the world.
    pub p: Vec3,
    /// Unit normal of the hemisphere that receives; zero: all directions count.
    pub n: Vec3,
}

/// Light from one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Radiance (W/(sr m²)) that arrives if nothing is in between; of a delta: irradiance (W/m²) orthogonal to `wi`.
    pub radiance: Rgb,
    /// Unit, towards the light.
    pub wi: Vec3,
    /// Density (sr⁻¹) times the probability of choosing the light; of a delta only that probability. Positive.
    pub pdf: f32,
    /// The light has no extent: no other technique can find it.
    pub delta: bool,
    /// What must be visible.
    pub target: Target,
    /// The light's group.
    pub group: Group,
}

/// Where a light sample ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// On an emitting surface.
    Surface {
        /// The point.
        point: PointWithError,
        /// Its unit normal.
        n: Vec3,
    },
    /// At a point.
    Point(Vec3),
    /// Beyond the scene.
    Infinite,
}

impl Lights {
    /// There is no light at all.
    pub fn is_empty(&self) -> bool {
        self.tree.is_empty() && self.infinite.is_empty()
    }

    /// How one of them is chosen for a light sample.
    pub fn selection(&self) -> Selection {
        Selection {
            bounded: self.emitters.len() + self.points.len(),
            infinite: self.sampled_infinite,
            unsampled: self.infinite.len() - self.sampled_infinite,
            tree_bytes: self.tree.bytes(),
        }
    }

    /// Leaves to BSDF samples what they find better: uniform environments entirely, and of environment images what is
    /// below the mean. For an integrator that takes a BSDF sample beside each light sample and weights both by
    /// [`power_heuristic`]: the sum stays complete and has less variance, and fewer shadow rays are needed. Light samples
    /// alone no longer see all light.
    ///
    /// **Source**: \[Karlik19\]; pbrt-v4 does the same.
    #[must_use]
    pub fn beside_bsdf_samples(mut self) -> Self {
        for member in &mut self.infinite {
            member.light.leave_to_bsdf_samples();
        }
        self.arrange();
        self
    }

    /// Sorts out which infinite lights are sampled, and how often.
    fn arrange(&mut self) {
        self.infinite.sort_by_key(|member| !member.light.is_sampled());
        self.sampled_infinite = self.infinite.iter().filter(|member| member.light.is_sampled()).count();
        let choices = self.sampled_infinite + usize::from(!self.tree.is_empty());
        self.infinite_pmf = 1.0 / choices.max(1) as f32;
    }

    /// Probability that a light sample goes to the bounded lights.
    #[inline]
    fn bounded_pmf(&self) -> f32 {
        // The same as for each infinite light, of which there is one fewer than there are choices.
        self.infinite_pmf
    }

    /// Light for a receiver from one light, chosen by `u_select` and sampled by `u`, all uniform in [0, 1).
    ///
    /// The mean of radiance·f/pdf is the integral of incident radiance times f over solid angle, without regard to what is
    /// in between. `None`: a sample of value 0. `textures`: those of the emitters' alpha.
    #[inline]
    pub fn sample(&self, textures: &Textures, from: &Receiver, u_select: f32, u: Vec2) -> Option<LightSample> {
        let choice = u_select / self.infinite_pmf;
        if self.sampled_infinite > 0 && (choice as usize) < self.sampled_infinite {
            return self.sample_infinite(choice as usize, from, u);
        }
        // What is left of the number, in [0, 1).
        let rest = (choice - self.sampled_infinite as f32).clamp(0.0, BELOW_ONE);
        let (light, pmf) = self.tree.choose(from, rest)?;
        let pmf = pmf * self.bounded_pmf();
        match self.emitters.get(light as usize) {
            Some(emitter) => self.sample_emitter(emitter, textures, pmf, from, u),
            None => sample_point(&self.points[light as usize - self.emitters.len()], pmf, from),
        }
    }

    #[inline]
    fn sample_infinite(&self, index: usize, from: &Receiver, u: Vec2) -> Option<LightSample> {
        let Member { light, group } = &self.infinite[index];
        let sample = light.sample(from.n, u)?;
        let pdf = sample.pdf * self.infinite_pmf;
        Some(LightSample {
            radiance: sample.radiance,
            wi: sample.wi,
            pdf,
            delta: sample.delta,
            target: Target::Infinite,
            group: *group,
        })
    }

    #[inline]
    fn sample_emitter(
        &self,
        emitter: &AreaEmitter,
        textures: &Textures,
        pmf: f32,
        from: &Receiver,
        u: Vec2,
    ) -> Option<LightSample> {
        let sample = emitter.shape.sample(from.p, u)?;
        let wi = (sample.point.p - from.p).try_normalize()?;
        let radiance = emitter.sampled(&self.images, textures, &sample, -wi);
        let pdf = sample.pdf * pmf;
        let target = Target::Surface { point: sample.point, n: sample.n };
        usable(radiance, pdf).then_some(LightSample { radiance, wi, pdf, delta: false, target, group: emitter.group })
    }

    /// Radiance that the surface point at `uv` of an emitter sends along `wo`; `n` is its unit normal as the shape orients
    /// it. Emitters are numbered as they were given to [`Self::build`].
    #[inline]
    pub fn emitted(&self, emitter: u32, uv: Vec2, n: Vec3, wo: Vec3) -> Rgb {
        self.emitters[emitter as usize].emission.radiance(&self.images, uv, n, wo)
    }

    /// The group of an emitter.
    #[inline]
    pub fn emitter_group(&self, emitter: u32) -> Group {
        self.emitters[emitter as usize].group
    }

    /// Names of the groups, by their numbers: all of them have lights.
    pub fn groups(&self) -> &[Arc<str>] {
        &self.groups
    }

    /// Density (sr⁻¹) with which [`Self::sample`] would have chosen the point `p` of an emitter, which has the normal `n`
    /// there.
    #[inline]
    pub fn emitter_pdf(&self, emitter: u32, from: &Receiver, p: Vec3, n: Vec3) -> f32 {
        let pmf = self.tree.pmf(from, emitter) * self.bounded_pmf();
        if pmf > 0.0 { pmf * self.emitters[emitter as usize].shape.pdf(from.p, p, n) } else { 0.0 }
    }

    /// Radiance that a ray along the unit `direction` finds beyond the scene: of each infinite light its own, times its
    /// weight against light samples for the receiver that the ray left with density `bsdf_pdf` (sr⁻¹). Without a receiver
    /// no light sample could have gone there: the weights are 1.
    #[inline]
    pub fn escaped(
        &self,
        direction: Vec3,
        from: Option<&Receiver>,
        bsdf_pdf: f32,
    ) -> impl Iterator<Item = (Rgb, Group)> {
        let n = from.map_or(Vec3::ZERO, |receiver| receiver.n);
        self.infinite.iter().map(move |Member { light, group }| {
            let (radiance, pdf) = light.radiance_and_pdf(direction, n);
            let weighted = from.is_some() && pdf > 0.0;
            let weight = if weighted { power_heuristic(bsdf_pdf, pdf * self.infinite_pmf) } else { 1.0 };
            (radiance * weight, *group)
        })
    }
}

#[inline]
fn sample_point(Member { light, group }: &Member<PointLight>, pmf: f32, from: &Receiver) -> Option<LightSample> {
    let to_light = light.position() - from.p;
    let wi = to_light.try_normalize()?;
    let radiance = light.intensity(-wi) / to_light.length_squared();
    let target = Target::Point(light.position());
    usable(radiance, pmf).then_some(LightSample { radiance, wi, pdf: pmf, delta: true, target, group: *group })
}

/// The sample has a value: it is neither black nor out of the range of `f32`.
#[inline]
fn usable(radiance: Rgb, pdf: f32) -> bool {
    radiance != Rgb::ZERO && radiance.is_finite() && pdf > 0.0 && pdf.is_finite()
}

#[cfg(test)]
mod tests;
