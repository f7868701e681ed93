//! Loaded shapes → numbered surfaces, emitters and Embree scenes, in the order of the description.

use std::sync::Arc;

use embree::{CommittedScene, Device, Geometry, SceneBuilder, SceneOptions};
use glam::{Affine3A, Vec4};
use rayon::prelude::*;

use super::load::{self, Part};
use super::{Loading, Messages, user};
use crate::interaction::{Alpha, CurveSet, Instance, Mesh, PatchMesh, Primitives, Surface};
use crate::light::Emitter;
use crate::scene::description::{self, AreaLightId, CurveKind};
use crate::shape::{Patch, Shape, Triangle};

/// The tables under construction.
pub(super) struct Assembly<'d> {
    device: &'d Device,
    options: SceneOptions,
    surfaces: Vec<Surface>,
    emitters: Vec<Emitter>,
}

/// An object's scene, and the index of its first surface.
pub(super) struct Object {
    scene: Arc<CommittedScene>,
    first_surface: u32,
}

impl<'d> Assembly<'d> {
    pub fn new(device: &'d Device, options: SceneOptions) -> Self {
        Self { device, options, surfaces: Vec::new(), emitters: Vec::new() }
    }

    /// Numbers the surfaces of shapes; the result holds their geometry in the same order.
    pub fn surfaces(&mut self, shapes: Vec<Loading<'_>>, messages: &mut Messages) -> Vec<Geometry> {
        let mut geometries = Vec::new();
        for Loading { shape, alpha, emits, parts } in shapes {
            for part in parts {
                let (geometry, primitives) = match self.geometry(part) {
                    Ok(made) => made,
                    Err(error) => {
                        messages.error(shape.span, error.to_string());
                        continue;
                    }
                };
                let flipped = load::flipped(shape);
                let light = shape.area_light.filter(|_| emits);
                let first_emitter =
                    light.and_then(|light| self.emitters(&primitives, light, shape, alpha.as_ref(), messages));
                geometries.push(if alpha.is_some() { geometry.with_hit_filter() } else { geometry });
                self.surfaces.push(Surface {
                    primitives,
                    material: shape.material,
                    first_emitter,
                    alpha: alpha.clone(),
                    flipped,
                    span: shape.span,
                });
            }
        }
        geometries
    }

    /// The scenes of objects, by their numbers; `None` for those without anything in them.
    pub fn objects(
        &mut self,
        objects: Vec<Vec<Loading<'_>>>,
        messages: &mut Messages,
    ) -> Result<Vec<Option<Object>>, embree::Error> {
        let mut numbered = Vec::with_capacity(objects.len());
        for shapes in objects {
            let first_surface = self.surfaces.len() as u32;
            numbered.push((first_surface, self.surfaces(shapes, messages)));
        }
        numbered
            .into_par_iter()
            .map(|(first_surface, geometries)| {
                if geometries.is_empty() {
                    return Ok(None);
                }
                let scene = Arc::new(self.committed(geometries)?);
                Ok(Some(Object { scene, first_surface }))
            })
            .collect()
    }

    /// Places objects.
    pub fn instances<'o>(
        &self,
        instances: &[description::Instance],
        objects: &'o [Option<Object>],
        messages: &mut Messages,
    ) -> Vec<(Instance, &'o Object)> {
        let mut placed = Vec::with_capacity(instances.len());
        for instance in instances {
            let Some(object) = &objects[instance.object.index()] else { continue };
            let world_from_object = Affine3A::from_mat4(instance.world_from_object.matrix_f32());
            // Both in f64 and in the f32 of the ray query.
            let sound = world_from_object.inverse().is_finite();
            match Instance::new(world_from_object, object.first_surface).filter(|_| sound) {
                Some(instance) => placed.push((instance, object)),
                None => {
                    messages.error(
                        instance.span,
                        "the transform of this instance is singular or has numbers that are not finite",
                    );
                }
            }
        }
        placed
    }

    /// The scene of everything: surfaces first, then instances.
    pub fn commit(
        self,
        mut geometries: Vec<Geometry>,
        instances: &[(Instance, &Object)],
    ) -> Result<(Vec<Surface>, Vec<Emitter>, CommittedScene), embree::Error> {
        for (instance, object) in instances {
            let scene = Arc::clone(&object.scene);
            geometries.push(Geometry::instance(self.device, scene, instance.world_from_object())?);
        }
        let scene = self.committed(geometries)?;
        Ok((self.surfaces, self.emitters, scene))
    }

    fn committed(&self, geometries: Vec<Geometry>) -> Result<CommittedScene, embree::Error> {
        let mut builder = SceneBuilder::new(self.device, self.options);
        for geometry in geometries {
            builder.attach(geometry);
        }
        builder.commit()
    }

    fn geometry(&self, part: Part) -> Result<(Geometry, Primitives), embree::Error> {
        let device = self.device;
        Ok(match part {
            Part::Triangles(mesh) => {
                let geometry = Geometry::triangles(device, mesh.vertices.clone(), mesh.indices.clone())?;
                (geometry, Primitives::Triangles(mesh))
            }
            Part::Patches(mesh) => {
                let mesh = Arc::new(mesh);
                let geometry = Geometry::user(device, Arc::new(user::Patches(Arc::clone(&mesh))))?;
                (geometry, Primitives::Patches(mesh))
            }
            Part::Quadric(shape) => {
                let shape = Arc::new(shape);
                let geometry = Geometry::user(device, Arc::new(user::Quadric(Arc::clone(&shape))))?;
                (geometry, Primitives::Quadric(shape))
            }
            Part::Curves(kind, segments) => {
                let control = segments.control.iter().map(Vec4::to_array).collect();
                let normals: Vec<[f32; 3]> = segments.normals.iter().map(|n| n.to_array()).collect();
                let first = (0..segments.len() as u32).map(|segment| 4 * segment).collect();
                let (embree_kind, normals) = match kind {
                    CurveKind::Ribbon => (embree::CurveKind::NormalOrientedBezier, Some(normals)),
                    CurveKind::Flat | CurveKind::Cylinder => (embree::CurveKind::FlatBezier, None),
                };
                let geometry = Geometry::curves(device, embree_kind, control, first, normals)?;
                (geometry, Primitives::Curves(CurveSet { kind, segments: Arc::new(segments) }))
            }
        })
    }

    /// One emitter per primitive, and the number of the first; `None` for what does not emit.
    fn emitters(
        &mut self,
        primitives: &Primitives,
        light: AreaLightId,
        shape: &description::Shape,
        alpha: Option<&Alpha>,
        messages: &mut Messages,
    ) -> Option<u32> {
        let (first, flipped) = (self.emitters.len(), load::flipped(shape));
        let mut emit = |shapes: &mut dyn Iterator<Item = Option<Shape>>| {
            let shapes = shapes.flatten().map(|shape| if alpha.is_some() { shape.with_holes() } else { shape });
            let emitter = |shape: Shape| Emitter {
                face_area: shape.area(),
                shape,
                alpha: alpha.map(|alpha| alpha.value.clone()),
                light,
            };
            self.emitters.extend(shapes.map(emitter));
        };
        match primitives {
            Primitives::Triangles(mesh) => {
                emit(&mut triangles(mesh, flipped));
                join_halves(self.emitters.get_mut(first + mesh.first_quad_half as usize..).unwrap_or_default());
            }
            Primitives::Patches(mesh) => emit(&mut patches(mesh, flipped)),
            Primitives::Quadric(shape) => emit(&mut std::iter::once(Some((**shape).clone()))),
            Primitives::Curves(_) => return None,
        }
        // The numbers of emitters are those of primitives: `load` keeps none that cannot emit.
        if self.emitters.len() - first != primitives.len() {
            messages.error(shape.span, "an emitting face of this shape has no area");
        }
        Some(first as u32)
    }
}

/// Tells the halves of quads how large their quads are.
fn join_halves(halves: &mut [Emitter]) {
    for quad in halves.chunks_exact_mut(2) {
        let area = quad[0].face_area + quad[1].face_area;
        quad.iter_mut().for_each(|half| half.face_area = area);
    }
}

fn triangles(mesh: &Mesh, flipped: bool) -> impl Iterator<Item = Option<Shape>> + '_ {
    (0..mesh.indices.len() as u32).map(move |primitive| {
        let (p, uv, normals) = (mesh.triangle(primitive), mesh.uv(primitive), mesh.normals(primitive));
        Triangle::new(p, Some(uv), normals, flipped).map(Shape::Triangle)
    })
}

fn patches(mesh: &PatchMesh, flipped: bool) -> impl Iterator<Item = Option<Shape>> + '_ {
    (0..mesh.indices.len() as u32).map(move |primitive| {
        let (corners, uv, normals) = (mesh.corners(primitive), mesh.uv(primitive), mesh.normals(primitive));
        Patch::new(corners, uv, normals, flipped).map(|patch| Shape::Patch(patch.into()))
    })
}
