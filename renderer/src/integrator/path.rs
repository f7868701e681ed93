//! The path loop.

use glam::Vec3;

use super::direct::{self, DirectLight, Scatter, Vertex};
use super::{Counters, FirstHit, Queries, Recorder, Sample, roulette};
use crate::bsdf::BsdfSample;
use crate::camera::CameraRay;
use crate::light::Group;
use crate::math::{Ray, Rgb, spawn_ray};
use crate::sampling::{Dimension, Numbers, Use};
use crate::world::World;

/// Radiance along one camera ray, by unidirectional path tracing with a light sample at every vertex.
///
/// Both ways to reach a light, by sampling the light and by sampling the BSDF, are weighted by the power heuristic.
/// `first_hit` asks for the auxiliary values of the first hit; `recorder` sees all that happens. The result is a pure
/// function of the world, the camera ray and the numbers.
///
/// **Source**: \[Kajiya86\]; \[Veach97\] chapter 9 for the weights.
pub fn trace<Q: Queries, R: Recorder>(
    world: &World,
    queries: &Q,
    camera: &CameraRay,
    numbers: &Numbers,
    first_hit: bool,
    recorder: &mut R,
    counters: &mut Counters,
) -> Sample {
    let mut path = Path::new(camera, recorder);
    let mut sample = Sample::default();
    counters.camera_rays += 1;
    loop {
        // Where the path goes next, and the light it runs into there.
        counters.closest_hit_rays += 1;
        let Some(hit) = queries.intersect(&path.ray) else {
            path.escape(world);
            break;
        };
        let surface = world.geometry.interaction(&path.ray, &hit);
        path.advance(surface.t);
        let emitted = direct::emitted(world, &surface, path.last.as_ref());
        emitted.into_iter().for_each(|(radiance, group)| path.meets(radiance, group));
        if path.bounce == world.integrator.max_depth {
            break;
        }

        // What is there; an interface between media is nothing.
        let Some(mut shading) = world.shade(&surface, path.cone_radius) else {
            path.ray = spawn_ray(surface.point, surface.ng, path.ray.direction);
            continue;
        };
        if world.integrator.regularize && path.roughened {
            shading.bsdf = shading.bsdf.regularized();
        }
        let vertex = Vertex { wo: shading.frame.to_local(surface.wo), surface: &surface, shading: &shading };
        if path.bounce == 0 {
            sample.alpha = 1.0;
            sample.first = if first_hit { vertex.first_hit(world) } else { FirstHit::default() };
        }

        // Light that a light sample brings, and the direction in which the path goes on.
        path.arrive(&vertex);
        let at_vertex = numbers.vertex(path.bounce);
        if !vertex.shading.bsdf.is_specular() {
            let light = direct::sample(world, queries, &vertex, &at_vertex, counters);
            light.iter().for_each(|light| path.receive(&vertex, light));
        }
        let Some(next) = vertex.shading.bsdf.sample(vertex.wo, at_vertex.d1(Use::Lobe), at_vertex.d2(Use::Bsdf)) else {
            break;
        };
        path.scatter(&vertex, &next);
        counters.scatterings += 1;

        let throughput = path.beta.max_element() * path.eta_scale;
        let u = || numbers.d1(Dimension::at(path.bounce, Use::Roulette));
        let Some(worth) = roulette::survive(throughput, path.bounce, u) else { break };
        path.survive(worth);
    }
    sample.radiance = path.radiance;
    sample
}

/// What a path carries from vertex to vertex.
struct Path<'r, R> {
    /// Radiance found so far, along the camera ray.
    radiance: Rgb,
    /// Product of f cosθ / pdf over the vertices so far.
    beta: Rgb,
    /// The ray to the next vertex.
    ray: Ray,
    /// Scattering events so far; interfaces do not count.
    bounce: u32,
    /// The last scattering, `None` at the camera and after a delta lobe: no light sample could have gone this way.
    last: Option<Scatter>,
    /// Product of η² over the refractions so far, undoing their scaling of radiance.
    eta_scale: f32,
    /// Some lobe so far was not a delta: regularisation may begin.
    roughened: bool,
    /// Radius of the cone of rays that this path stands for, at the current vertex, in world units.
    cone_radius: f32,
    /// Growth of that radius per unit of distance.
    cone_spread: f32,
    /// Half the side of a pixel at the length of the path so far, as if every scattering had been a reflection.
    reach: f32,
    /// Growth of that per unit of distance.
    pixel_spread: f32,
    /// Is told of everything.
    recorder: &'r mut R,
}

/// A scattered path stands for this share of the lobe it was drawn from: sixteen paths through a pixel, each with a cone
/// of a sixteenth of 1/pdf, tile the lobe. Only texture filtering depends on it, and with other numbers of samples it is
/// a little blunter or sharper than it might be.
const LOBE_SHARE: f32 = 1.0 / 16.0;

impl<'r, R: Recorder> Path<'r, R> {
    fn new(camera: &CameraRay, recorder: &'r mut R) -> Self {
        Self {
            radiance: Rgb::ZERO,
            beta: Rgb::ONE,
            ray: camera.ray,
            bounce: 0,
            last: None,
            eta_scale: 1.0,
            roughened: false,
            cone_radius: camera.radius,
            cone_spread: camera.spread,
            reach: camera.radius,
            pixel_spread: camera.spread,
            recorder,
        }
    }

    /// The ray has met a surface at `distance`.
    #[inline]
    fn advance(&mut self, distance: f32) {
        self.cone_radius += self.cone_spread * distance;
        self.reach += self.pixel_spread * distance;
    }

    /// The ray has run into light.
    #[inline]
    fn meets(&mut self, radiance: Rgb, group: Group) {
        self.radiance += self.beta * radiance;
        self.recorder.meets(radiance, group);
    }

    /// The ray has left the scene.
    #[inline]
    fn escape(&mut self, world: &World) {
        let last = self.last;
        direct::escaped(world, self.ray.direction, last.as_ref())
            .for_each(|(radiance, group)| self.meets(radiance, group));
    }

    /// The path is at a surface that scatters.
    #[inline]
    fn arrive(&mut self, vertex: &Vertex<'_>) {
        self.recorder.arrive(vertex, 2.0 * self.reach);
    }

    /// A light sample brings light to `vertex`.
    #[inline]
    fn receive(&mut self, vertex: &Vertex<'_>, light: &DirectLight) {
        self.radiance += self.beta * (light.f * light.incident);
        self.recorder.receive(vertex, light);
    }

    /// The path has survived a roulette, and stands for those that did not.
    #[inline]
    fn survive(&mut self, worth: f32) {
        self.beta *= worth;
        self.recorder.survive(worth);
    }

    /// Goes on from `vertex` in the direction of `next`.
    fn scatter(&mut self, vertex: &Vertex<'_>, next: &BsdfSample) {
        let wi = unit(vertex.shading.frame.to_world(next.wi));
        self.beta *= next.weight;
        self.recorder.scatter(vertex, next);
        self.ray = spawn_ray(vertex.surface.point, vertex.surface.ng, wi);
        self.bounce += 1;
        if next.transmission {
            self.eta_scale *= next.eta * next.eta;
        }
        if next.specular {
            self.last = None;
            return;
        }
        self.last = Some(Scatter { receiver: vertex.receiver(), pdf: next.pdf });
        self.roughened = true;
        // A cone of solid angle Ω has the spread √(Ω/π) for small Ω; capped at that of half a right angle.
        let spread = (LOBE_SHARE / (std::f32::consts::PI * next.pdf)).sqrt().min(1.0);
        self.cone_spread = self.cone_spread.max(spread);
    }
}

/// A nearly unit vector made unit, by a step of Newton's method for 1/√x at x ≈ 1. A mirror keeps the length of what it
/// mirrors but for rounding, which would add up over the thousands of bounces within dense glass.
#[inline]
fn unit(v: Vec3) -> Vec3 {
    v * (1.5 - 0.5 * v.length_squared())
}

impl Vertex<'_> {
    /// What auxiliary outputs show of the vertex.
    fn first_hit(&self, world: &World) -> FirstHit {
        FirstHit {
            albedo: self.shading.bsdf.albedo(self.wo),
            ns: self.shading.frame.n,
            ng: self.surface.ng,
            p: world.origin + self.surface.point.p.as_dvec3(),
            depth: self.surface.t,
        }
    }
}

#[cfg(test)]
#[path = "path_tests.rs"]
mod tests;
