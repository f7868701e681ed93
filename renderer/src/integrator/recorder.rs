//! Cutting a path at the vertices that the filter shares with other paths.

use filter::{Lobe, PackedRgb, PathRecord};
use glam::Vec3;

use super::direct::{DirectLight, Vertex};
use crate::bsdf::BsdfSample;
use crate::light::Group;
use crate::math::Rgb;

/// Is told of everything that happens to a path, in order.
pub trait Recorder {
    /// The path has met a surface that scatters, even if it is at its last vertex.
    fn see(&mut self, _: &Vertex<'_>) {}
    /// It will scatter there. `footprint`: side of the square that a pixel covers there, world units, if
    /// the surfaces so far are taken for flat mirrors.
    fn arrive(&mut self, vertex: &Vertex<'_>, footprint: f32);
    /// A light sample brings light to the vertex.
    fn receive(&mut self, vertex: &Vertex<'_>, light: &DirectLight);
    /// The path goes on.
    fn scatter(&mut self, vertex: &Vertex<'_>, next: &BsdfSample);
    /// What follows stands for `worth` times as much.
    fn survive(&mut self, worth: f32);
    /// The path has run into `radiance` of a light of `group`.
    fn meets(&mut self, radiance: Rgb, group: Group);
}

/// Records nothing.
#[derive(Default)]
pub struct Unrecorded;

impl Recorder for Unrecorded {
    #[inline]
    fn arrive(&mut self, _: &Vertex<'_>, _: f32) {}
    #[inline]
    fn receive(&mut self, _: &Vertex<'_>, _: &DirectLight) {}
    #[inline]
    fn scatter(&mut self, _: &Vertex<'_>, _: &BsdfSample) {}
    #[inline]
    fn survive(&mut self, _: f32) {}
    #[inline]
    fn meets(&mut self, _: Rgb, _: Group) {}
}

/// Two that are told the same.
impl<A: Recorder, B: Recorder> Recorder for (A, B) {
    #[inline]
    fn see(&mut self, vertex: &Vertex<'_>) {
        self.0.see(vertex);
        self.1.see(vertex);
    }
    #[inline]
    fn arrive(&mut self, vertex: &Vertex<'_>, footprint: f32) {
        self.0.arrive(vertex, footprint);
        self.1.arrive(vertex, footprint);
    }
    #[inline]
    fn receive(&mut self, vertex: &Vertex<'_>, light: &DirectLight) {
        self.0.receive(vertex, light);
        self.1.receive(vertex, light);
    }
    #[inline]
    fn scatter(&mut self, vertex: &Vertex<'_>, next: &BsdfSample) {
        self.0.scatter(vertex, next);
        self.1.scatter(vertex, next);
    }
    #[inline]
    fn survive(&mut self, worth: f32) {
        self.0.survive(worth);
        self.1.survive(worth);
    }
    #[inline]
    fn meets(&mut self, radiance: Rgb, group: Group) {
        self.0.meets(radiance, group);
        self.1.meets(radiance, group);
    }
}

/// A path cut in three: up to the first vertex that is no mirror and no smooth glass, from there to the next diffuse one,
/// and what follows. [`Cut::after`] lets such vertices pass before it cuts.
///
/// Each piece counts its light from its own beginning, with throughput 1 there, so that nothing is ever divided by a
/// throughput. [`Cut::record`] puts the pieces together. Light is *basic* radiance, over the square of the index of where it
/// is: an interface does not change it but for what it reflects, so that what stands half in glass is lit alike within and
/// without. With plain radiance, vertices within would share 1/η² of the throughput and η² of the light with those outside,
/// and their mean would bring either side what is the other's.
///
/// **Source** of basic radiance: \[Nicodemus63\].
#[derive(Clone, Copy, Debug)]
pub struct Cut {
    /// Light that is met before the first selected vertex, and all of a path without one.
    prefix: Rgb,
    first: Option<Selected>,
    second: Option<Selected>,
    /// Light that is met between the selected vertices, from the first on.
    between: Rgb,
    /// Light that is met beyond the second, from there on.
    beyond: Rgb,
    /// Throughput of basic radiance from the last selected vertex, or from the camera.
    beta: Rgb,
    /// Radiance where the path is over basic radiance: the square of the index there over that at the camera.
    squeezed: f32,
    /// Where the path is, is a selected vertex.
    here: bool,
    /// Vertices at which the path could be cut and is not.
    passing: u8,
}

/// A vertex at which a path is cut.
#[derive(Clone, Copy, Debug)]
struct Selected {
    vertex: filter::Vertex,
    /// Throughput up to the vertex, from the cut before.
    beta: Rgb,
    /// [`crate::bsdf::Bsdf::diffuse_albedo`].
    albedo: Rgb,
    /// Light of the light sample that arrives in the diffuse lobe, over the albedo; and what the other lobes send on.
    received: [Rgb; 2],
    /// The same for light from the direction in which the path goes on.
    weight: (f32, Rgb),
}

impl Selected {
    /// Where light is reflected to counts at the first selected vertex alone: `reflects`.
    fn new(vertex: &Vertex<'_>, albedo: Rgb, footprint: f32, beta: Rgb, reflects: bool) -> Self {
        let side = if vertex.wo.cos_theta() < 0.0 { -1.0 } else { 1.0 };
        let bin = if reflects { reflection_bin(side * vertex.shading.frame.n, vertex.surface.wo) } else { 0 };
        let (p, ng) = (vertex.surface.point.p, side * vertex.surface.ng);
        Self {
            vertex: filter::Vertex::new(p, ng, footprint, vertex.surface.geometry, bin),
            beta,
            albedo,
            received: [Rgb::ZERO; 2],
            weight: (0.0, Rgb::ZERO),
        }
    }

    fn receive(&mut self, vertex: &Vertex<'_>, light: &DirectLight, squeezed: f32) {
        let diffuse = vertex.shading.bsdf.diffuse(vertex.wo, light.wi);
        let incident = light.incident / squeezed;
        self.received[0] += diffuse * incident;
        self.received[1] += (light.f - self.albedo * diffuse).max(Rgb::ZERO) * incident;
    }

    /// `weight`: of basic radiance.
    fn scatter(&mut self, vertex: &Vertex<'_>, next: &BsdfSample, weight: Rgb) {
        // A delta lobe is none of the diffuse one's directions.
        let diffuse = if next.specular { 0.0 } else { vertex.shading.bsdf.diffuse(vertex.wo, next.wi) / next.pdf };
        // The difference of nearly equal numbers where there is no other lobe: rounding may have it negative.
        self.weight = (diffuse, (weight - self.albedo * diffuse).max(Rgb::ZERO));
    }

    fn survive(&mut self, worth: f32) {
        self.weight = (self.weight.0 * worth, self.weight.1 * worth);
    }

    /// Light in the diffuse lobe, over the albedo, and out of the others, when `incident` comes from where the path went.
    fn lobes(&self, incident: Rgb) -> [Rgb; 2] {
        [self.received[0] + self.weight.0 * incident, self.received[1] + self.weight.1 * incident]
    }
}

impl Default for Cut {
    fn default() -> Self {
        Self {
            prefix: Rgb::ZERO,
            first: None,
            second: None,
            between: Rgb::ZERO,
            beyond: Rgb::ZERO,
            beta: Rgb::ONE,
            squeezed: 1.0,
            here: false,
            passing: 0,
        }
    }
}

impl Recorder for Cut {
    fn arrive(&mut self, vertex: &Vertex<'_>, footprint: f32) {
        let bsdf = &vertex.shading.bsdf;
        self.here = false;
        match (&self.first, &self.second) {
            (None, _) if !bsdf.is_specular() => {
                if self.passing > 0 {
                    self.passing -= 1;
                    return;
                }
                let albedo = bsdf.diffuse_albedo(vertex.wo);
                self.first = Some(Selected::new(vertex, albedo, footprint, self.beta, true));
                self.here = true;
            }
            (Some(_), None) => {
                let albedo = bsdf.diffuse_albedo(vertex.wo);
                self.here = albedo != Rgb::ZERO;
                if self.here {
                    self.second = Some(Selected::new(vertex, albedo, footprint, self.beta, false));
                }
            }
            _ => {}
        }
    }

    fn receive(&mut self, vertex: &Vertex<'_>, light: &DirectLight) {
        match (self.here, &mut self.first, &mut self.second) {
            (true, _, Some(second)) => second.receive(vertex, light, self.squeezed),
            (true, Some(first), None) => first.receive(vertex, light, self.squeezed),
            _ => self.meets(light.f * light.incident, light.group),
        }
    }

    fn scatter(&mut self, vertex: &Vertex<'_>, next: &BsdfSample) {
        let squeeze = if next.transmission { next.eta * next.eta } else { 1.0 };
        let weight = next.weight * squeeze;
        self.squeezed *= squeeze;
        match (self.here, &mut self.first, &mut self.second) {
            (true, _, Some(last)) | (true, Some(last), None) => {
                last.scatter(vertex, next, weight);
                self.beta = Rgb::ONE;
            }
            _ => self.beta *= weight,
        }
    }

    fn survive(&mut self, worth: f32) {
        match (self.here, &mut self.first, &mut self.second) {
            (true, _, Some(last)) | (true, Some(last), None) => last.survive(worth),
            _ => self.beta *= worth,
        }
    }

    fn meets(&mut self, radiance: Rgb, _: Group) {
        let piece = match (&self.first, &self.second) {
            (None, _) => &mut self.prefix,
            (Some(_), None) => &mut self.between,
            (Some(_), Some(_)) => &mut self.beyond,
        };
        *piece += self.beta * (radiance / self.squeezed);
    }
}

impl Cut {
    /// A path that is cut only after `passing` vertices at which it could be: their light is the prefix's.
    pub fn after(passing: u8) -> Self {
        Self { passing, ..Self::default() }
    }

    /// Light that no selected vertex sent on, along the camera ray.
    pub fn prefix(&self) -> Rgb {
        self.prefix
    }

    /// The rest of the path, for the filter; `None` if there is none. `weight`: of the sample, of either sign. `share`: what
    /// the sensor takes of its light. That is all light which others read, too: were it part of the throughput, a path that
    /// is too bright would be clamped in its own pixel and whole in those around.
    pub fn record(&self, slot: u32, sample: u64, weight: f32, share: f32) -> Option<PathRecord> {
        let first = self.first.as_ref()?;
        let mut record = PathRecord { slot, first: first.vertex, ..PathRecord::default() };
        record.set_sample(sample as u8);
        let mut rest = self.between;
        let mut transfer = Rgb::ZERO;
        if let Some(second) = &self.second {
            let [suffix, others] = second.lobes(self.beyond);
            rest += second.beta * others;
            transfer = second.beta * second.albedo;
            record.second = second.vertex;
            record.set_sample(sample as u8);
            record.suffix = PackedRgb::new(suffix * share);
        }
        let [diffuse, glossy] = first.lobes(rest);
        let lobe = |throughput: Rgb, rest: Rgb, transfer: Rgb| Lobe {
            throughput: PackedRgb::new(throughput * first.beta * weight),
            rest: PackedRgb::new(rest * share),
            transfer: PackedRgb::new(transfer),
        };
        if first.albedo != Rgb::ZERO {
            record.diffuse = lobe(first.albedo, diffuse, first.weight.0 * transfer);
        }
        let transfer = first.weight.1 * transfer;
        if glossy != Rgb::ZERO || transfer != Rgb::ZERO || first.albedo == Rgb::ZERO {
            record.glossy = lobe(Rgb::ONE, glossy, transfer);
        }
        Some(record)
    }
}

/// Which of 16 parts of the sphere the reflection of `wo` about `n` goes to: glossy light from different parts is not
/// averaged.
fn reflection_bin(n: Vec3, wo: Vec3) -> u8 {
    let reflected = 2.0 * n.dot(wo) * n - wo;
    filter::direction_bin(reflected)
}
