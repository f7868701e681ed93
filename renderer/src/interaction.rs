//! From a hit to the surface there: point with error bound, normals, texture coordinates, tangents, footprint.
//!
//! [`Geometry`] is the committed scene with the table of its surfaces. [`Geometry::interaction`] computes what every path
//! vertex needs and no more; tangents, texture coordinates and footprints are methods of [`SurfaceInteraction`], for the
//! materials that ask.

mod alpha;
mod footprint;
pub mod instance;
mod local;
mod rounding;
#[cfg(test)]
mod self_intersection;
pub mod surface;
#[cfg(test)]
mod tests;

use std::ops::Range;

use embree::{CommittedScene, Hit};
use glam::{Vec2, Vec3};

pub use alpha::{Alpha, AlphaTest};
pub use instance::Instance;
pub use rounding::TriangleTest;
pub use surface::{CurveSet, Mesh, PatchMesh, Primitives, Surface};

use crate::math::{PointWithError, Ray};
use crate::scene::description::MaterialId;
use crate::texture::Textures;

/// Everything that rays can meet.
#[derive(Debug)]
pub struct Geometry {
    scene: CommittedScene,
    surfaces: Vec<Surface>,
    instances: Vec<Instance>,
    /// Surfaces that are not instanced: geometry numbers of the scene up to here are theirs, beyond are instances.
    placed: u32,
    triangle_test: TriangleTest,
}

/// A point where a path meets a surface. World space throughout.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceInteraction<'g> {
    /// The point.
    pub point: PointWithError,
    /// Unit geometric normal. On the side of `ns` where a mesh has normals; else where the winding puts it, flipped by
    /// `reverse_orientation ^ swaps_handedness`.
    pub ng: Vec3,
    /// Unit shading normal, on the side of `ng`.
    pub ns: Vec3,
    /// Unit direction back along the ray.
    pub wo: Vec3,
    /// Distance from the ray's origin.
    pub t: f32,
    /// Index of the surface in its [`Geometry`].
    pub geometry: u32,
    /// Number of the triangle, patch or curve segment within the surface.
    pub primitive: u32,
    /// Parameters of the primitive, as the ray query gave them.
    parameters: Vec2,
    /// Quadrics: the point in the quadric's own space. Curves: the tangent. Others: not used.
    local: Vec3,
    surface: &'g Surface,
    instance: Option<&'g Instance>,
}

impl Geometry {
    /// Geometry numbers of `scene` are those of `surfaces` first, then those of `instances`; an instance's scene numbers
    /// its geometry as the surfaces that follow [`Instance::first_surface`].
    pub(crate) fn new(
        scene: CommittedScene,
        surfaces: Vec<Surface>,
        mut instances: Vec<Instance>,
        placed: u32,
        triangle_test: TriangleTest,
    ) -> Self {
        (0..).zip(&mut instances).for_each(|(number, instance)| instance.number = number);
        Self { scene, surfaces, instances, placed, triangle_test }
    }

    /// For ray queries.
    pub fn scene(&self) -> &CommittedScene {
        &self.scene
    }

    /// Lower and upper corner of a box around everything; for an empty scene, the origin.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let (low, high) = self.scene.bounds();
        if low.cmple(high).all() { (low, high) } else { (Vec3::ZERO, Vec3::ZERO) }
    }

    /// All surfaces, first those that are not instanced.
    pub fn surfaces(&self) -> &[Surface] {
        &self.surfaces
    }

    /// Placed copies of objects.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// The test that hits must pass; `None` if every hit is real.
    pub fn alpha_test<'w>(&'w self, textures: &'w Textures) -> Option<AlphaTest<'w>> {
        self.scene.has_filtered_geometry().then_some(AlphaTest { geometry: self, textures })
    }

    /// Number of triangles, patches, quadrics and curve segments: with every instance counted, and in memory.
    pub fn primitive_counts(&self) -> (u64, u64) {
        let count = |surfaces: &[Surface]| surfaces.iter().map(|s| s.primitives.len() as u64).sum::<u64>();
        let placed = &self.surfaces[self.placed()];
        let instanced = self.instanced().map(|object| count(&self.surfaces[object]));
        (count(placed) + instanced.sum::<u64>(), count(&self.surfaces))
    }

    /// Indices of the surfaces that are not instanced.
    pub fn placed(&self) -> Range<usize> {
        0..self.placed as usize
    }

    /// Indices of the surfaces of each instance's object.
    pub fn instanced(&self) -> impl Iterator<Item = Range<usize>> {
        // An object's surfaces end where the next object's begin.
        let mut ends: Vec<usize> = self.instances.iter().map(|i| i.first_surface as usize).collect();
        ends.push(self.surfaces.len());
        ends.sort_unstable();
        let object = move |first: usize| first..ends[ends.partition_point(|&end| end <= first)];
        self.instances.iter().map(move |instance| object(instance.first_surface as usize))
    }

    /// The surface at a hit of `ray`.
    ///
    /// **Source** of the points: \[Pharr23\] section 6.8; of their errors: `rounding`.
    #[inline(always)]
    pub fn interaction(&self, ray: &Ray, hit: &Hit) -> SurfaceInteraction<'_> {
        let (geometry, instance) = self.locate(hit);
        let surface = &self.surfaces[geometry as usize];
        let length = ray.direction.length();
        let wo = ray.direction * -length.recip();
        let local = match &surface.primitives {
            Primitives::Triangles(mesh) => local::triangle(mesh, hit, surface.flipped, self.triangle_test),
            Primitives::Patches(mesh) => local::patch(mesh, hit, surface.flipped),
            Primitives::Quadric(shape) => local::quadric(shape, hit),
            Primitives::Curves(curves) => local::curve(curves, ray, hit, instance),
        };
        let placed = match instance {
            Some(instance) if !surface.primitives.is_curve() => instance.apply(&local),
            _ => local.in_world(),
        };
        SurfaceInteraction {
            point: placed.point,
            ng: placed.ng,
            ns: placed.ns,
            wo,
            t: hit.t * length,
            geometry,
            primitive: hit.primitive,
            parameters: Vec2::new(hit.u, hit.v),
            local: hit.ng,
            surface,
            instance,
        }
    }

    /// Material of the surface at a vertex.
    #[inline]
    pub fn material(&self, vertex: &SurfaceInteraction<'_>) -> MaterialId {
        vertex.surface.material
    }

    /// Number of the emitter at a vertex; `None` if the surface does not emit.
    #[inline]
    pub fn emitter(&self, vertex: &SurfaceInteraction<'_>) -> Option<u32> {
        vertex.surface.first_emitter.map(|first| first + vertex.primitive)
    }

    /// Index of the surface that was hit, and the instance it belongs to.
    #[inline]
    fn locate(&self, hit: &Hit) -> (u32, Option<&Instance>) {
        match hit.instance {
            None => (hit.geometry, None),
            Some(number) => {
                let instance = &self.instances[(number - self.placed) as usize];
                (instance.first_surface + hit.geometry, Some(instance))
            }
        }
    }
}

impl SurfaceInteraction<'_> {
    /// Index of the instance that it belongs to.
    #[inline]
    pub fn instance(&self) -> Option<u32> {
        self.instance.map(|instance| instance.number)
    }

    /// Number of the surface in the object that is instanced, or else in the [`Geometry`].
    #[inline]
    pub fn number_in_object(&self) -> u32 {
        self.geometry - self.instance.map_or(0, |instance| instance.first_surface)
    }

    /// Texture coordinates.
    #[inline]
    pub fn uv(&self) -> Vec2 {
        self.surface.primitives.uv(self.primitive, self.parameters)
    }

    /// Tangents for shading: the change of the point with u and v, and where those say nothing (no texture coordinates, a
    /// pole) two tangents orthogonal to the normal. A mesh's own tangents take the place of the former.
    pub fn tangents(&self) -> (Vec3, Vec3) {
        let own = self.surface.primitives.vertex_tangent(self.primitive, self.parameters);
        if let Some(tangent) = own.map(|tangent| self.vector(tangent)).filter(|t| self.ns.cross(*t) != Vec3::ZERO) {
            return (tangent, self.ns.cross(tangent));
        }
        self.derivatives().unwrap_or_else(|| self.ng.any_orthonormal_pair())
    }

    /// ∂p/∂u and ∂p/∂v; `None` where the parameters do not span the tangent plane.
    pub fn derivatives(&self) -> Option<(Vec3, Vec3)> {
        // Curves are in world space already.
        let (dpdu, dpdv) = match &self.surface.primitives {
            Primitives::Triangles(mesh) => mesh.derivatives(self.primitive)?,
            Primitives::Patches(mesh) => mesh.derivatives(self.primitive, self.parameters)?,
            Primitives::Quadric(shape) => local::quadric_derivatives(shape, self.local)?,
            Primitives::Curves(curves) => {
                let tangent = self.vector(curves.segments.tangent(self.primitive as usize, self.parameters.x));
                let u = curves.segments.u[self.primitive as usize];
                let width = 2.0 * curves.segments.at(self.primitive as usize, self.parameters.x).w;
                return Some((tangent / (u[1] - u[0]), self.ng.cross(tangent).normalize_or_zero() * width));
            }
        };
        Some((self.vector(dpdu), self.vector(dpdv)))
    }

    /// A tangent from the surface's space to the world's.
    #[inline]
    fn vector(&self, v: Vec3) -> Vec3 {
        self.instance.map_or(v, |instance| instance.vector(v))
    }
}
