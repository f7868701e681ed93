//! The path loop.

use embree::Hit;
use glam::Vec3;

use super::direct::{self, DirectLight, Scatter, Vertex};
use super::{Counters, FirstHit, Queries, Recorder, Sample, roulette};
use crate::bsdf::BsdfSample;
use crate::camera::CameraRay;
use crate::interaction::SurfaceInteraction;
use crate::light::Group;
use crate::material::Shading;
use crate::math::{LocalDir, Ray, Rgb, spawn_ray};
use crate::sampling::{Dimension, Numbers, Use, VertexNumbers};
use crate::world::World;

/// Traces paths from their camera rays to their ends, by unidirectional path tracing with a light sample at every vertex.
///
/// Both ways to reach a light, by sampling the light and by sampling the BSDF, are weighted by the power heuristic.
/// `first_hit` asks for the auxiliary values of the first hit. What becomes of a path is a pure function of the world, its
/// camera ray and its numbers.
///
/// The paths go side by side, a stage of all of them before the next one: a path by itself would need more code from vertex
/// to vertex than the first cache holds, and fetch it again for every ray.
///
/// **Source**: \[Kajiya86\]; \[Veach97\] chapter 9 for the weights.
pub fn trace<'p, 'w: 'p, Q: Queries, R: Recorder + 'p>(
    world: &'w World,
    queries: &Q,
    begun: impl Iterator<Item = &'p mut Path<'w, R>>,
    first_hit: bool,
    counters: &mut Counters,
) {
    let mut paths = Vec::with_capacity(begun.size_hint().1.unwrap_or_default());
    paths.extend(begun);
    while !paths.is_empty() {
        // Where the paths go next, the light they run into there, and what is there.
        counters.closest_hit_rays += paths.len() as u64;
        paths.iter_mut().for_each(|path| path.hit = queries.intersect(&path.carried.ray));
        paths.retain_mut(|path| path.meet(world, first_hit));

        // Light that light samples bring, if nothing is in between.
        paths.iter_mut().for_each(|path| path.look(world));
        for place in paths.iter_mut().filter_map(|path| path.place.as_mut()) {
            let Some((_, segment)) = &place.light else { continue };
            counters.shadow_rays += 1;
            if queries.occluded(segment) {
                place.light = None;
            }
        }

        // The directions in which they go on.
        paths.retain_mut(|path| path.go_on(counters));
    }
}

/// A path in the making.
pub struct Path<'w, R> {
    carried: Carried<R>,
    numbers: Numbers,
    sample: Sample,
    /// What the ray has met.
    hit: Option<Hit>,
    /// Where that is; `None` also where the material lets the ray pass, as a mix with an interface may.
    place: Option<Place<'w>>,
}

/// A vertex of a path with all that is found out there.
struct Place<'w> {
    surface: SurfaceInteraction<'w>,
    shading: Shading<'w>,
    wo: LocalDir,
    numbers: VertexNumbers,
    /// What a light sample brings if nothing is on the ray.
    light: Option<(DirectLight, Ray)>,
}

impl Place<'_> {
    #[inline]
    fn vertex(&self) -> Vertex<'_> {
        Vertex { surface: &self.surface, shading: &self.shading, wo: self.wo }
    }
}

impl<'w, R: Recorder> Path<'w, R> {
    /// The path of a camera ray; `recorder` will see all that happens to it.
    pub fn new(camera: &CameraRay, numbers: Numbers, recorder: R) -> Self {
        let carried = Carried::new(camera, recorder);
        Self { carried, numbers, sample: Sample::default(), hit: None, place: None }
    }

    /// What a path that has been traced brings back, and its recorder.
    pub fn end(self) -> (Sample, R) {
        (Sample { radiance: self.carried.radiance, ..self.sample }, self.carried.recorder)
    }

    /// The light that the ray has run into, and what is there. Whether the path may scatter there or goes on as it is.
    fn meet(&mut self, world: &'w World, first_hit: bool) -> bool {
        let path = &mut self.carried;
        self.place = None;
        let Some(hit) = &self.hit else {
            path.escape(world);
            return false;
        };
        let surface = world.geometry.interaction(&path.ray, hit);
        path.advance(surface.t);
        let emitted = direct::emitted(world, &surface, path.last.as_ref());
        emitted.into_iter().for_each(|(radiance, group)| path.meets(radiance, group));
        let Some(mut shading) = world.shade(&surface, path.cone_radius) else {
            path.pass(&surface);
            return true;
        };
        if world.integrator.regularize && path.roughened {
            shading.bsdf = shading.bsdf.regularized();
        }
        let (wo, numbers) = (shading.frame.to_local(surface.wo), self.numbers.vertex(path.bounce));
        let vertex = self.place.insert(Place { surface, shading, wo, numbers, light: None }).vertex();
        if path.bounce == 0 {
            self.sample.alpha = 1.0;
            self.sample.first = if first_hit { vertex.first_hit(world, path.length) } else { FirstHit::default() };
        }
        path.recorder.see(&vertex);
        if path.bounce == world.integrator.max_depth {
            return false;
        }
        path.arrive(&vertex);
        true
    }

    /// Samples a light.
    fn look(&mut self, world: &World) {
        let Some(place) = self.place.as_mut().filter(|place| !place.shading.bsdf.is_specular()) else { return };
        place.light = direct::sample(world, &place.vertex(), &place.numbers);
    }

    /// Sends on what the light sample brings, and draws the direction in which the path goes on. Whether it does.
    fn go_on(&mut self, counters: &mut Counters) -> bool {
        let (path, Some(place)) = (&mut self.carried, &self.place) else { return true };
        let (vertex, numbers) = (place.vertex(), &place.numbers);
        place.light.iter().for_each(|(light, _)| path.receive(&vertex, light));
        let Some(next) = place.shading.bsdf.sample(place.wo, numbers.d1(Use::Lobe), numbers.d2(Use::Bsdf)) else {
            return false;
        };
        path.scatter(&vertex, &next);
        counters.scatterings += 1;

        let throughput = path.beta.max_element() * path.eta_scale;
        let u = || self.numbers.d1(Dimension::at(path.bounce, Use::Roulette));
        let worth = roulette::survive(throughput, path.bounce, u);
        worth.into_iter().for_each(|worth| path.survive(worth));
        worth.is_some()
    }
}

/// What a path carries from vertex to vertex.
struct Carried<R> {
    /// Radiance found so far, along the camera ray.
    radiance: Rgb,
    /// Product of f cosθ / pdf over the vertices so far.
    beta: Rgb,
    /// The ray to the next vertex.
    ray: Ray,
    /// Scattering events so far; interfaces do not count.
    bounce: u32,
    /// Length of the path so far.
    length: f32,
    /// The last scattering, `None` at the camera, after a delta lobe and behind an interface: no light sample could have
    /// gone this way.
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
    recorder: R,
}

/// A scattered path stands for this share of the lobe it was drawn from: sixteen paths through a pixel, each with a cone
/// of a sixteenth of 1/pdf, tile the lobe. Only texture filtering depends on it, and with other numbers of samples it is
/// a little blunter or sharper than it might be.
const LOBE_SHARE: f32 = 1.0 / 16.0;

impl<R: Recorder> Carried<R> {
    fn new(camera: &CameraRay, recorder: R) -> Self {
        Self {
            radiance: Rgb::ZERO,
            beta: Rgb::ONE,
            ray: camera.ray,
            bounce: 0,
            length: 0.0,
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
        self.length += distance;
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

    /// The ray goes on through a surface as if it were not there. To shadow rays it is there: no light sample could have seen
    /// what follows.
    #[inline]
    fn pass(&mut self, surface: &SurfaceInteraction<'_>) {
        self.ray = spawn_ray(surface.point, surface.ng, self.ray.direction);
        self.last = None;
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
    /// What auxiliary outputs show of the vertex, to which the path has the length `depth`.
    fn first_hit(&self, world: &World, depth: f32) -> FirstHit {
        FirstHit {
            albedo: self.shading.bsdf.albedo(self.wo),
            ns: self.shading.frame.n,
            ng: self.surface.ng,
            p: world.origin + self.surface.point.p.as_dvec3(),
            depth,
        }
    }
}

#[cfg(test)]
#[path = "path_tests.rs"]
mod tests;
