//! What a path shows besides its radiance: where its light comes from, and what a denoiser wants to know.

use glam::Vec3;

use super::direct::{DirectLight, Vertex};
use super::recorder::Recorder;
use crate::bsdf::BsdfSample;
use crate::interaction::SurfaceInteraction;
use crate::light::Group;
use crate::math::Rgb;

/// Light by the number of times that it was scattered on its way from the light to the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scattered {
    /// Not at all: lights that are seen, or nothing else.
    Never,
    /// Once.
    Once,
    /// More often.
    Often,
}

/// The first surface of a path that is no mirror and no smooth glass, as it is seen by way of these.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Feature {
    /// Hemispherical reflectance, times what the mirrors reflect and the glass lets through.
    pub albedo: Rgb,
    /// Shading normal on the side that is seen, world space.
    pub ns: Vec3,
}

/// Ids of the names of objects and materials.
#[derive(Clone, Debug, Default)]
pub struct Ids {
    /// Of surfaces that are not instanced, by their indices, and then of each instance's.
    pub surfaces: Vec<[u32; 2]>,
    /// Where those of each instance begin.
    pub instances: Vec<u32>,
}

impl Ids {
    /// Those of the object and the material at a hit.
    fn of(&self, surface: &SurfaceInteraction<'_>) -> [u32; 2] {
        let at = match surface.instance() {
            Some(number) => self.instances[number as usize] + surface.number_in_object(),
            None => surface.geometry,
        };
        self.surfaces[at as usize]
    }
}

/// A path's light taken apart, and its first rough surface.
///
/// Reflection and refraction are drawn in proportion to what they carry, so that over many paths a pane shows what is
/// behind it and what it mirrors as they are seen.
#[derive(Clone, Debug, Default)]
pub struct Aside<'w> {
    /// Ids of names, if anybody wants to know.
    ids: Option<&'w Ids>,
    /// Those of the first hit.
    seen: Option<[u32; 2]>,
    /// Light of each class, by [`Scattered`].
    classes: [Rgb; 3],
    /// Light of each group; empty if there is none to be told apart.
    groups: Vec<Rgb>,
    feature: Option<Feature>,
    /// Throughput so far.
    beta: Rgb,
    /// How many times as bright as before radiance is by having been squeezed into smaller angles: no matter of colour.
    squeezed: f32,
    /// What paths that were given up are worth to this one.
    worth: f32,
    bounces: u32,
}

impl<'w> Aside<'w> {
    /// A path that begins, with as many groups of lights to be told apart.
    pub fn new(groups: usize, ids: Option<&'w Ids>) -> Self {
        Self { ids, groups: vec![Rgb::ZERO; groups], beta: Rgb::ONE, squeezed: 1.0, worth: 1.0, ..Self::default() }
    }

    /// Light of a class, scene RGB.
    pub fn class(&self, class: Scattered) -> Rgb {
        self.classes[class as usize]
    }

    /// Light of a group, scene RGB.
    pub fn group(&self, group: Group) -> Rgb {
        self.groups.get(group.0 as usize).copied().unwrap_or_default()
    }

    /// Ids of the names of the object and the material of the first hit.
    pub fn seen(&self) -> Option<[u32; 2]> {
        self.seen
    }

    /// The first rough surface; black where there is none.
    pub fn feature(&self) -> Feature {
        self.feature.unwrap_or_default()
    }

    fn add(&mut self, light: Rgb, group: Group, scattered: u32) {
        let class = match scattered {
            0 => Scattered::Never,
            1 => Scattered::Once,
            _ => Scattered::Often,
        };
        self.classes[class as usize] += light;
        if let Some(sum) = self.groups.get_mut(group.0 as usize) {
            *sum += light;
        }
    }
}

impl Recorder for Aside<'_> {
    fn see(&mut self, vertex: &Vertex<'_>) {
        if self.bounces == 0 {
            self.seen = self.ids.map(|ids| ids.of(vertex.surface));
        }
        if self.feature.is_none() && !vertex.shading.bsdf.is_specular() {
            let albedo = vertex.shading.bsdf.albedo(vertex.wo) * self.beta * self.squeezed;
            let side = if vertex.wo.cos_theta() < 0.0 { -1.0 } else { 1.0 };
            self.feature = Some(Feature { albedo, ns: vertex.shading.frame.n * (side * self.worth) });
        }
    }

    fn arrive(&mut self, _: &Vertex<'_>, _: f32) {}

    fn receive(&mut self, _: &Vertex<'_>, light: &DirectLight) {
        self.add(self.beta * (light.f * light.incident), light.group, self.bounces + 1);
    }

    fn scatter(&mut self, _: &Vertex<'_>, next: &BsdfSample) {
        self.beta *= next.weight;
        self.bounces += 1;
        if next.transmission {
            self.squeezed *= next.eta * next.eta;
        }
    }

    fn survive(&mut self, worth: f32) {
        self.beta *= worth;
        self.worth *= worth;
    }

    fn meets(&mut self, radiance: Rgb, group: Group) {
        self.add(self.beta * radiance, group, self.bounces);
    }
}
