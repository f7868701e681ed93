//! One shape of the description as primitives in their place: pure data, so that shapes are read in parallel.

use embree::{TriangleIndices, VertexBuffer};
use glam::{DMat3, Vec2, Vec3};

use super::quads;
use crate::interaction::{Mesh, PatchMesh};
use crate::math::Transform;
use crate::scene::description::{BilinearMesh, CurveKind, Shape, ShapeKind, TriangleMesh};
use crate::scene::ply;
use crate::shape::curve::Segments;
use crate::shape::{self, Cylinder, Disk, Patch, Sphere, Triangle, loop_subdivision};

/// What a shape turned out to be.
#[derive(Default)]
pub(super) struct Loaded {
    pub parts: Vec<Part>,
    /// What does not look as described.
    pub notes: Vec<String>,
    /// Faces without area, which are left out.
    pub degenerate: usize,
}

/// Primitives of one kind.
pub(super) enum Part {
    Triangles(Mesh),
    Patches(PatchMesh),
    Quadric(shape::Shape),
    Curves(CurveKind, Segments),
}

/// Reads a shape and moves it to its place. If it `emits`, every primitive that is left can be an emitter.
///
/// # Errors
/// What is wrong with the shape, as a sentence that needs no more than its place in the scene file.
pub(super) fn load(shape: &Shape, emits: bool) -> Result<Loaded, String> {
    let mut loader = Loader { shape, loaded: Loaded::default() };
    let (place, reverse) = (&shape.world_from_shape, shape.reverse_orientation);
    if !place.is_invertible() {
        return Err("the transform of this shape is singular: it has no volume or numbers that are not finite".into());
    }
    let quadric = |shape: Option<shape::Shape>| {
        shape
            .map(Part::Quadric)
            .ok_or_else(|| "this shape has no surface: check its radii, heights and phimax".to_owned())
    };
    let part = match &shape.kind {
        ShapeKind::Triangles(mesh) => return loader.finish(mesh.clone(), &[]),
        ShapeKind::Bilinear(mesh) => return loader.bilinear(mesh),
        ShapeKind::Ply { path, .. } => {
            let named = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
            let mesh = ply::read(path).map_err(|error| named(&error))?;
            if mesh.polygons > 0 {
                let note = "faces of more than four corners are cut into fans, right for convex ones only";
                loader.loaded.notes.push(format!("{}: {} {note}", path.display(), mesh.polygons));
            }
            loader.loaded.degenerate += mesh.degenerate;
            return loader.finish(mesh.triangles, &mesh.quads).map_err(|error| named(&error));
        }
        ShapeKind::Loop { levels, mesh } => {
            let mesh = loop_subdivision::subdivide(mesh, *levels).map_err(|error| error.to_string())?;
            return loader.finish(mesh, &[]);
        }
        &ShapeKind::Sphere { radius, z_min, z_max, phi_max } => {
            let sphere = Sphere::new(place, reverse, radius, [z_min, z_max], phi_max);
            quadric(sphere.map(|sphere| shape::Shape::Sphere(sphere.into())))?
        }
        &ShapeKind::Disk { height, radius, inner_radius, phi_max } => {
            let disk = Disk::new(place, reverse, height, radius, inner_radius, phi_max);
            quadric(disk.map(|disk| shape::Shape::Disk(disk.into())))?
        }
        &ShapeKind::Cylinder { radius, z_min, z_max, phi_max } => {
            let cylinder = Cylinder::new(place, reverse, radius, [z_min, z_max], phi_max);
            quadric(cylinder.map(|cylinder| shape::Shape::Cylinder(cylinder.into())))?
        }
        ShapeKind::Curve(curve) => {
            if emits {
                loader.loaded.notes.push("curves do not emit: drawn without emission".into());
            }
            let mut segments = Segments::default();
            segments.push(curve, place).map_err(|error| error.to_string())?;
            Part::Curves(curve.kind, segments)
        }
    };
    loader.loaded.parts.push(part);
    Ok(loader.loaded)
}

/// Whether a mesh's normals, where it has none at its vertices, are flipped.
pub(super) fn flipped(shape: &Shape) -> bool {
    shape.reverse_orientation != shape.world_from_shape.swaps_handedness()
}

struct Loader<'s> {
    shape: &'s Shape,
    loaded: Loaded,
}

impl Loader<'_> {
    /// A mesh in shape space, with quads over the same vertices.
    fn finish(mut self, mut mesh: TriangleMesh, quads: &[[u32; 4]]) -> Result<Loaded, String> {
        self.place(&mut mesh)?;
        check(&mesh.indices, mesh.positions.len(), "triangle")?;
        check(quads, mesh.positions.len(), "quad")?;
        let (positions, given) = (&mesh.positions, mesh.indices.len());
        mesh.indices.retain(|&triangle| has_area(triangle.map(|index| positions[index as usize])));
        self.loaded.degenerate += given - mesh.indices.len();
        let flat = |&quad: &[u32; 4]| quads::flat_halves(quad.map(|index| positions[index as usize])).is_some();
        let (flat, curved): (Vec<_>, Vec<_>) = quads.iter().partition(|quad| flat(quad));
        self.parts(mesh, flat, curved)
    }

    fn bilinear(mut self, mesh: &BilinearMesh) -> Result<Loaded, String> {
        let BilinearMesh { indices, positions, normals, uvs } = mesh.clone();
        let mut mesh = TriangleMesh { indices: Vec::new(), positions, normals, uvs, tangents: Vec::new() };
        self.place(&mut mesh)?;
        check(&indices, mesh.positions.len(), "patch")?;
        // Two triangles interpolate as the patch does only where everything is affine.
        let affine = |&quad: &[u32; 4]| quads::is_affine(quad, &mesh.positions, &mesh.normals, &mesh.uvs);
        let (flat, curved): (Vec<_>, Vec<_>) = indices.into_iter().partition(affine);
        self.parts(mesh, flat, curved)
    }

    /// The triangles of `mesh`, those of flat quads behind them, and patches.
    fn parts(mut self, mut mesh: TriangleMesh, flat: Vec<[u32; 4]>, curved: Vec<[u32; 4]>) -> Result<Loaded, String> {
        if !curved.is_empty() {
            let (vertices, normals, uvs) = (mesh.positions.clone(), mesh.normals.clone(), mesh.uvs.clone());
            self.patches(PatchMesh { vertices, indices: curved, normals, uvs });
        }
        let first_quad_half = if flat.is_empty() { u32::MAX } else { mesh.indices.len() as u32 };
        mesh.indices.extend(flat.iter().flat_map(|quad| quads::HALVES.map(|half| half.map(|corner| quad[corner]))));
        if !mesh.indices.is_empty() {
            let TriangleMesh { positions, indices, normals, uvs, tangents } = mesh;
            let vertices = into_vertices(positions)?;
            let indices = TriangleIndices::new(indices, vertices.len()).map_err(|error| error.to_string())?;
            let mesh = Mesh { vertices, indices, normals, uvs, tangents, first_quad_half };
            self.loaded.parts.push(Part::Triangles(mesh));
        }
        Ok(self.loaded)
    }

    /// Adds a mesh of patches without those that have no area.
    fn patches(&mut self, mut mesh: PatchMesh) {
        let given = mesh.indices.len();
        let vertices = &mesh.vertices;
        mesh.indices
            .retain(|&patch| Patch::new(patch.map(|index| vertices[index as usize]), None, None, false).is_some());
        self.loaded.degenerate += given - mesh.indices.len();
        if !mesh.indices.is_empty() {
            self.loaded.parts.push(Part::Patches(mesh));
        }
    }

    /// Moves a mesh from shape space to its place.
    fn place(&mut self, mesh: &mut TriangleMesh) -> Result<(), String> {
        let place = &self.shape.world_from_shape;
        let count = mesh.positions.len();
        for (name, length) in
            [("normals", mesh.normals.len()), ("uvs", mesh.uvs.len()), ("tangents", mesh.tangents.len())]
        {
            if length != 0 && length != count {
                return Err(format!("the mesh has {count} vertices but {length} {name}"));
            }
        }
        if *place != Transform::default() {
            mesh.positions.iter_mut().for_each(|p| *p = place.point(*p));
            mesh.tangents.iter_mut().for_each(|tangent| *tangent = place.vector(*tangent));
        }
        let normal_matrix = DMat3::from_mat4(place.inverse().matrix()).transpose();
        let sign = if self.shape.reverse_orientation { -1.0 } else { 1.0 };
        if *place != Transform::default() || sign < 0.0 {
            mesh.normals.iter_mut().for_each(|n| *n = (normal_matrix * n.as_dvec3() * sign).as_vec3());
        }
        // Not finite counts as not given: the surface's own normal, the origin of the texture.
        let normals = clear(&mut mesh.normals, |n| n.is_finite(), Vec3::ZERO);
        let uvs = clear(&mut mesh.uvs, |uv| uv.is_finite(), Vec2::ZERO);
        clear(&mut mesh.tangents, |tangent| tangent.is_finite(), Vec3::ZERO);
        for (name, count) in [("normals", normals), ("texture coordinates", uvs)] {
            if count > 0 {
                self.loaded.notes.push(format!("{count} {name} of the mesh are not finite: they are taken as 0"));
            }
        }
        Ok(())
    }
}

fn clear<T: Copy>(values: &mut [T], sound: impl Fn(&T) -> bool, otherwise: T) -> usize {
    values.iter_mut().filter(|value| !sound(value)).map(|value| *value = otherwise).count()
}

fn check<const N: usize>(indices: &[[u32; N]], vertices: usize, face: &str) -> Result<(), String> {
    for (number, corners) in indices.iter().enumerate() {
        if let Some(index) = corners.iter().find(|&&index| index as usize >= vertices) {
            return Err(format!("{face} {number} names vertex {index}, but there are {vertices}, from 0"));
        }
    }
    Ok(())
}

/// As the ray query takes them. The vector is reused: both elements are three numbers.
fn into_vertices(positions: Vec<Vec3>) -> Result<VertexBuffer, String> {
    VertexBuffer::new(positions.into_iter().map(|p| p.to_array()).collect()).map_err(|error| error.to_string())
}

/// Whether a triangle can emit. Those that are not finite are kept, to be reported with their vertex.
fn has_area(p: [Vec3; 3]) -> bool {
    !p.iter().all(|p| p.is_finite()) || Triangle::new(p, None, None, false).is_some()
}
