//! Light that reaches a vertex directly: by a light sample, or because the path ran into the light.

use glam::Vec3;

use crate::interaction::SurfaceInteraction;
use crate::light::{Group, Receiver, Target, power_heuristic};
use crate::material::Shading;
use crate::math::{LocalDir, PointWithError, Ray, Rgb, spawn_ray, spawn_segment};
use crate::sampling::{Use, VertexNumbers};
use crate::world::{Techniques, World};

/// The last scattering event of a path, if a light sample could have chosen the direction it took.
#[derive(Clone, Copy, Debug)]
pub struct Scatter {
    /// Where it happened.
    pub receiver: Receiver,
    /// Density of the direction, sr⁻¹.
    pub pdf: f32,
}

/// Emission of the surface at `vertex` towards where the path came from, weighted against the light sample at `last`.
/// `None`: the surface is none that emits.
pub fn emitted(world: &World, vertex: &SurfaceInteraction<'_>, last: Option<&Scatter>) -> Option<(Rgb, Group)> {
    let emitter = world.geometry.emitter(vertex)?;
    let radiance = world.lights.emitted(emitter, vertex.uv(), vertex.ng, vertex.wo);
    let weighted = match (last, world.techniques) {
        (Some(last), Techniques::Both) if radiance != Rgb::ZERO => {
            let light_pdf = world.lights.emitter_pdf(emitter, &last.receiver, vertex.point.p, vertex.ng);
            radiance * power_heuristic(last.pdf, light_pdf)
        }
        (Some(_), Techniques::Lights) => Rgb::ZERO,
        _ => radiance,
    };
    Some((weighted, world.lights.emitter_group(emitter)))
}

/// Radiance of each light at infinity that a path which left the scene along `direction` runs into, weighted likewise.
pub fn escaped(world: &World, direction: Vec3, last: Option<&Scatter>) -> impl Iterator<Item = (Rgb, Group)> {
    let weighted = last.filter(|_| world.techniques == Techniques::Both);
    let found = last.is_none() || world.techniques != Techniques::Lights;
    let lights =
        world.lights.escaped(direction, weighted.map(|last| &last.receiver), weighted.map_or(0.0, |last| last.pdf));
    lights.filter(move |_| found)
}

/// A vertex of a path, ready to scatter.
#[derive(Clone, Copy)]
pub struct Vertex<'a> {
    /// The surface there.
    pub surface: &'a SurfaceInteraction<'a>,
    /// What it does.
    pub shading: &'a Shading<'a>,
    /// Where the path came from, in the frame of `shading`.
    pub wo: LocalDir,
}

impl Vertex<'_> {
    /// The vertex as lights see it. A surface that transmits receives from both sides, which a normal of zero says.
    pub fn receiver(&self) -> Receiver {
        let n = match self.wo.cos_theta() {
            _ if self.shading.bsdf.is_transmissive() => Vec3::ZERO,
            below if below < 0.0 => -self.shading.frame.n,
            _ => self.shading.frame.n,
        };
        Receiver { p: self.surface.point.p, n }
    }
}

/// What a light sample sends to a vertex.
#[derive(Clone, Copy, Debug)]
pub struct DirectLight {
    /// Where it comes from, in the frame of the vertex's shading.
    pub wi: LocalDir,
    /// f·|cosθᵢ| of the whole BSDF, sr⁻¹.
    pub f: Rgb,
    /// Radiance over the density of the sample, sr, weighted against the BSDF sample: times `f` this is what the vertex
    /// sends along `wo`.
    pub incident: Rgb,
    /// The light's group.
    pub group: Group,
}

/// Samples a light for `vertex`: what it brings if nothing is on the ray. `None`: no light that the BSDF would send along
/// `wo`.
pub fn sample(world: &World, vertex: &Vertex<'_>, numbers: &VertexNumbers) -> Option<(DirectLight, Ray)> {
    let (u_select, u) = (numbers.d1(Use::LightSelect), numbers.d2(Use::Light));
    let light = world.lights.sample(&world.textures, &vertex.receiver(), u_select, u)?;
    let wi = vertex.shading.frame.to_local(light.wi);
    let (f, bsdf_pdf) = vertex.shading.bsdf.eval_pdf(vertex.wo, wi);
    if f == Rgb::ZERO {
        return None;
    }
    let (point, ng) = (vertex.surface.point, vertex.surface.ng);
    let segment = match light.target {
        Target::Surface { point: target, n } => spawn_segment(point, ng, target, n),
        Target::Point(p) => spawn_segment(point, ng, PointWithError::exact(p), Vec3::ZERO),
        Target::Infinite => spawn_ray(point, ng, light.wi),
    };
    let weight = match world.techniques {
        Techniques::Both if !light.delta => power_heuristic(light.pdf, bsdf_pdf),
        Techniques::Bsdfs if !light.delta => 0.0,
        _ => 1.0,
    };
    let incident = light.radiance * (weight / light.pdf);
    Some((DirectLight { wi, f, incident, group: light.group }, segment))
}
