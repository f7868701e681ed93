//! What a hit refers to: the data of surfaces.

use std::sync::Arc;

use embree::{TriangleIndices, VertexBuffer};
use glam::{Vec2, Vec3};

use super::Alpha;
use super::local::bilinear;
use crate::math::gamma;
use crate::scene::Span;
use crate::scene::description::{CurveKind, MaterialId};
use crate::shape::curve::Segments;
use crate::shape::{Shape, patch, triangle};

/// One surface: primitives that share a material.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Its primitives, in world space or, of an object, in the object's.
    pub primitives: Primitives,
    /// Its material.
    pub material: MaterialId,
    /// Number of its first primitive's emitter, if it emits; the others follow.
    pub first_emitter: Option<u32>,
    /// Probability of a hit being real; `None`: all are.
    pub alpha: Option<Alpha>,
    /// Normals without vertex normals point to the side from which the primitives are wound clockwise.
    pub flipped: bool,
    /// Where it was described.
    pub span: Span,
}

/// The primitives of a surface.
#[derive(Clone, Debug)]
pub enum Primitives {
    /// Triangles.
    Triangles(Mesh),
    /// Bilinear patches.
    Patches(Arc<PatchMesh>),
    /// One sphere, disk or cylinder.
    Quadric(Arc<Shape>),
    /// Curve segments.
    Curves(CurveSet),
}

/// A triangle mesh. Positions and indices are shared with the ray query's geometry.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Positions.
    pub vertices: VertexBuffer,
    /// Vertices of each triangle.
    pub indices: TriangleIndices,
    /// Per vertex, of any length, or empty.
    pub normals: Vec<Vec3>,
    /// Per vertex, or empty.
    pub uvs: Vec<Vec2>,
    /// Per vertex, or empty.
    pub tangents: Vec<Vec3>,
    /// Triangles from this one on are halves of quads: p00 p10 p11, then p00 p11 p01.
    pub first_quad_half: u32,
}

/// A mesh of bilinear patches.
#[derive(Clone, Debug, Default)]
pub struct PatchMesh {
    /// Positions.
    pub vertices: Vec<Vec3>,
    /// Corners p00 p10 p01 p11 of each patch.
    pub indices: Vec<[u32; 4]>,
    /// Per vertex, of any length, or empty.
    pub normals: Vec<Vec3>,
    /// Per vertex, or empty.
    pub uvs: Vec<Vec2>,
}

/// Curves of one kind.
#[derive(Clone, Debug)]
pub struct CurveSet {
    /// Cross section.
    pub kind: CurveKind,
    /// The segments.
    pub segments: Arc<Segments>,
}

impl Primitives {
    /// Whether these are curves.
    #[inline]
    pub fn is_curve(&self) -> bool {
        matches!(self, Self::Curves(_))
    }

    /// How many.
    pub fn len(&self) -> usize {
        match self {
            Self::Triangles(mesh) => mesh.indices.len(),
            Self::Patches(mesh) => mesh.indices.len(),
            Self::Quadric(_) => 1,
            Self::Curves(curves) => curves.segments.len(),
        }
    }

    /// None.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Texture coordinates at the parameters of a hit.
    #[inline]
    pub fn uv(&self, primitive: u32, parameters: Vec2) -> Vec2 {
        match self {
            Self::Triangles(mesh) => {
                let [uv0, uv1, uv2] = mesh.uv(primitive);
                (1.0 - parameters.x - parameters.y) * uv0 + parameters.x * uv1 + parameters.y * uv2
            }
            Self::Patches(mesh) => match mesh.uv(primitive) {
                None => parameters,
                Some(uv) => bilinear(uv.map(|uv| uv.extend(0.0)), parameters).truncate(),
            },
            Self::Quadric(_) => parameters,
            Self::Curves(curves) => {
                let [start, end] = curves.segments.u[primitive as usize];
                // Across, ray-facing curves count from −1 to 1, ribbons from 0.
                let v = if curves.kind == CurveKind::Ribbon { parameters.y } else { 0.5 + 0.5 * parameters.y };
                Vec2::new(start + (end - start) * parameters.x, v)
            }
        }
    }

    /// A mesh's own tangent at the parameters of a hit.
    pub fn vertex_tangent(&self, primitive: u32, parameters: Vec2) -> Option<Vec3> {
        let Self::Triangles(mesh) = self else { return None };
        if mesh.tangents.is_empty() {
            return None;
        }
        let [t0, t1, t2] = mesh.indices[primitive as usize].map(|index| mesh.tangents[index as usize]);
        Some((1.0 - parameters.x - parameters.y) * t0 + parameters.x * t1 + parameters.y * t2)
    }
}

impl Mesh {
    /// Positions of a triangle.
    #[inline]
    pub fn triangle(&self, primitive: u32) -> [Vec3; 3] {
        self.indices[primitive as usize].map(|index| Vec3::from_array(self.vertices[index as usize]))
    }

    /// Texture coordinates of a triangle's vertices.
    #[inline]
    pub fn uv(&self, primitive: u32) -> [Vec2; 3] {
        if !self.uvs.is_empty() {
            return self.indices[primitive as usize].map(|index| self.uvs[index as usize]);
        }
        let second_half = primitive >= self.first_quad_half && (primitive - self.first_quad_half) % 2 == 1;
        if second_half { [Vec2::ZERO, Vec2::ONE, Vec2::Y] } else { triangle::DEFAULT_UV }
    }

    /// Vertex normals of a triangle.
    pub fn normals(&self, primitive: u32) -> Option<[Vec3; 3]> {
        let of = |index| self.normals[index as usize];
        (!self.normals.is_empty()).then(|| self.indices[primitive as usize].map(of))
    }

    /// ∂p/∂u and ∂p/∂v: the linear map that takes differences of texture coordinates to those of positions.
    pub fn derivatives(&self, primitive: u32) -> Option<(Vec3, Vec3)> {
        let [p0, p1, p2] = self.triangle(primitive);
        let [uv0, uv1, uv2] = self.uv(primitive);
        let (e1, e2, d1, d2) = (p1 - p0, p2 - p0, uv1 - uv0, uv2 - uv0);
        let (a, b) = (d1.x * d2.y, d1.y * d2.x);
        let determinant = a - b;
        // Differences and products of rounded numbers: what is within their error is zero.
        if determinant.abs() <= gamma(4) * (a.abs() + b.abs()) {
            return None;
        }
        let scale = determinant.recip();
        let (dpdu, dpdv) = ((e1 * d2.y - e2 * d1.y) * scale, (e2 * d1.x - e1 * d2.x) * scale);
        (dpdu.is_finite() && dpdv.is_finite()).then_some((dpdu, dpdv))
    }
}

impl PatchMesh {
    /// Corners of a patch.
    #[inline]
    pub fn corners(&self, primitive: u32) -> patch::Corners {
        self.indices[primitive as usize].map(|index| self.vertices[index as usize])
    }

    /// Texture coordinates of a patch's corners.
    pub fn uv(&self, primitive: u32) -> Option<[Vec2; 4]> {
        (!self.uvs.is_empty()).then(|| self.indices[primitive as usize].map(|index| self.uvs[index as usize]))
    }

    /// Vertex normals of a patch.
    pub fn normals(&self, primitive: u32) -> Option<[Vec3; 4]> {
        let of = |index| self.normals[index as usize];
        (!self.normals.is_empty()).then(|| self.indices[primitive as usize].map(of))
    }

    /// Bilinear interpolation of values per vertex.
    pub(super) fn interpolate(&self, primitive: u32, values: &[Vec3], u: f32, v: f32) -> Vec3 {
        bilinear(self.indices[primitive as usize].map(|index| values[index as usize]), Vec2::new(u, v))
    }

    /// ∂p/∂u and ∂p/∂v, by the texture coordinates if there are any.
    pub fn derivatives(&self, primitive: u32, parameters: Vec2) -> Option<(Vec3, Vec3)> {
        let surface = patch::surface_point(&self.corners(primitive), parameters.x, parameters.y);
        let (e1, e2) = (surface.dpdu, surface.dpdv);
        let Some([uv00, uv10, uv01, uv11]) = self.uv(primitive) else { return Some((e1, e2)) };
        let (d1, d2) = ((uv10 - uv00).lerp(uv11 - uv01, parameters.y), (uv01 - uv00).lerp(uv11 - uv10, parameters.x));
        let (a, b) = (d1.x * d2.y, d1.y * d2.x);
        let determinant = a - b;
        // As for triangles; the interpolation adds two operations.
        (determinant.abs() > gamma(6) * (a.abs() + b.abs()))
            .then(|| ((e1 * d2.y - e2 * d1.y) / determinant, (e2 * d1.x - e1 * d2.x) / determinant))
    }
}
