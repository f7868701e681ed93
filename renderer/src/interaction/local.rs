//! Hits in the space of the surface that was hit: that of the object if it is instanced, else the world's.

use embree::Hit;
use glam::{Vec2, Vec3, Vec3A};

use super::surface::{CurveSet, Mesh, PatchMesh};
use super::{Instance, TriangleTest};
use crate::math::{PointWithError, Ray, gamma, unit, unit_and_inverse_length};
use crate::scene::description::CurveKind;
use crate::shape::{Shape, SurfacePoint, patch};

/// A hit with what an instance has to transform. Vectors are aligned, so that arithmetic on them is one instruction.
pub(super) struct Local {
    pub p: Vec3A,
    /// Bound of the error of `p`, by coordinate.
    pub error: Vec3A,
    /// Distance along the normal that a spawned ray has to keep beyond the point's error.
    pub clearance: f32,
    /// How far the primitive reaches from the point, by coordinate.
    pub extent: Vec3A,
    /// Unit; the side does not matter if `ns` decides.
    pub ng: Vec3A,
    /// The interpolated normal, of any length; `None`: that of the surface.
    pub ns: Option<Vec3A>,
}

/// A hit in world space.
pub(super) struct Placed {
    pub point: PointWithError,
    pub ng: Vec3,
    pub ns: Vec3,
}

impl Local {
    /// Of a shape that is intersected in f64, so that rays need no more than the rounding of the point to clear it.
    fn of_shape(point: PointWithError, extent: Vec3, ng: Vec3, ns: Option<Vec3>) -> Self {
        Self {
            p: point.p.into(),
            error: point.error.into(),
            clearance: 0.0,
            extent: extent.into(),
            ng: ng.into(),
            ns: ns.map(Vec3A::from),
        }
    }

    /// Of a surface that is not instanced.
    #[inline]
    pub fn in_world(self) -> Placed {
        Placed::new(self.p, self.error + self.ng.abs() * self.clearance, self.ng, self.ns)
    }
}

impl Placed {
    /// `ng` unit; `ns` of any length.
    #[inline]
    pub fn new(p: Vec3A, error: Vec3A, ng: Vec3A, ns: Option<Vec3A>) -> Self {
        let (ng, ns) = match ns.and_then(unit_and_inverse_length) {
            Some((ns, _)) => (if ng.dot(ns) < 0.0 { -ng } else { ng }, ns),
            None => (ng, ng),
        };
        Self { point: PointWithError { p: p.into(), error: error.into() }, ng: ng.into(), ns: ns.into() }
    }
}

#[inline]
pub(super) fn triangle(mesh: &Mesh, hit: &Hit, flipped: bool, test: TriangleTest) -> Local {
    let indices = mesh.indices[hit.primitive as usize];
    let v = indices.map(|index| Vec3A::from_array(mesh.vertices[index as usize]));
    let b = [1.0 - hit.u - hit.v, hit.u, hit.v];
    let terms = [b[0] * v[0], b[1] * v[1], b[2] * v[2]];
    let p = terms[0] + terms[1] + terms[2];
    // Barycentric coordinates, products and sums of rounded operations.
    let error = gamma(7) * (terms[0].abs() + terms[1].abs() + terms[2].abs());
    // A triangle that was hit has a normal: zero divides by zero and misses.
    let n = unit_and_inverse_length(hit.ng.into()).map_or(Vec3A::Z, |(n, _)| n);
    let to = v.map(|vertex| vertex - p);
    let extent = to[0].abs().max(to[1].abs()).max(to[2].abs());
    let clearance = test.clearance(&to, extent, n, error);
    let ns = (!mesh.normals.is_empty()).then(|| {
        let [n0, n1, n2] = indices.map(|index| Vec3A::from(mesh.normals[index as usize]));
        b[0] * n0 + b[1] * n1 + b[2] * n2
    });
    let ng = if flipped { -n } else { n };
    Local { p, error, clearance, extent, ng, ns }
}

pub(super) fn patch(mesh: &PatchMesh, hit: &Hit, flipped: bool) -> Local {
    let corners = mesh.corners(hit.primitive);
    let SurfacePoint { point, n, .. } = patch::surface_point(&corners, hit.u, hit.v);
    let (low, high) = patch::bounds(&corners);
    let ns = (!mesh.normals.is_empty()).then(|| mesh.interpolate(hit.primitive, &mesh.normals, hit.u, hit.v));
    let n = if n == Vec3::ZERO { unit(hit.ng).unwrap_or(Vec3::Z) } else { n };
    Local::of_shape(point, high - low, if flipped { -n } else { n }, ns)
}

pub(super) fn quadric(shape: &Shape, hit: &Hit) -> Local {
    let surface = quadric_point(shape, hit.ng);
    let (low, high) = shape.bounds();
    Local::of_shape(surface.point, high - low, surface.n, None)
}

pub(super) fn quadric_derivatives(shape: &Shape, local: Vec3) -> Option<(Vec3, Vec3)> {
    let surface = quadric_point(shape, local);
    (surface.dpdu.cross(surface.dpdv) != Vec3::ZERO).then_some((surface.dpdu, surface.dpdv))
}

fn quadric_point(shape: &Shape, local: Vec3) -> SurfacePoint {
    match shape {
        Shape::Sphere(sphere) => sphere.surface_point(local),
        Shape::Disk(disk) => disk.surface_point(local),
        Shape::Cylinder(cylinder) => cylinder.surface_point(local),
        // Not made by `compile`: these are meshes.
        Shape::Triangle(_) | Shape::Patch(_) => {
            SurfacePoint { point: PointWithError::exact(local), n: Vec3::Z, dpdu: Vec3::X, dpdv: Vec3::Y }
        }
    }
}

/// A hit of a curve, in world space even if it is instanced: only the ray knows the point.
pub(super) fn curve(curves: &CurveSet, ray: &Ray, hit: &Hit, instance: Option<&Instance>) -> Local {
    let p = ray.at(hit.t);
    // t errs by the curve's own intersection, which ends at a few ulps of the numbers involved.
    let error = gamma(16) * (ray.origin.abs() + (ray.direction * hit.t).abs());
    let world = |v: Vec3| instance.map_or(v, |instance| instance.vector(v));
    let segment = hit.primitive as usize;
    let tangent = world(curves.segments.tangent(segment, hit.u));
    let ng = match curves.kind {
        CurveKind::Ribbon => {
            let n = instance.map_or(hit.ng, |instance| instance.normal(hit.ng));
            unit(n).unwrap_or(Vec3::Z)
        }
        CurveKind::Flat => facing(tangent, ray.direction),
        CurveKind::Cylinder => {
            let flat = facing(tangent, ray.direction);
            let side = unit(tangent.cross(flat)).unwrap_or(Vec3::ZERO);
            let centre = curves.segments.at(segment, hit.u);
            let origin = instance.map_or(centre.truncate(), |instance| instance.point(centre.truncate()));
            // From −1 at one edge to 1 at the other.
            let across = (p - origin).dot(side) / world(Vec3::splat(centre.w / 3.0_f32.sqrt())).length();
            let (sin, cos) = (across.clamp(-1.0, 1.0) * std::f32::consts::FRAC_PI_2).sin_cos();
            unit(flat * cos + side * sin).unwrap_or(flat)
        }
    };
    Local::of_shape(PointWithError { p, error }, Vec3::ZERO, ng, None)
}

/// The unit vector orthogonal to `tangent` that points back along `direction` as well as can be.
fn facing(tangent: Vec3, direction: Vec3) -> Vec3 {
    unit(tangent.cross(direction).cross(tangent)).map_or_else(|| unit(-direction).unwrap_or(Vec3::Z), |n| -n)
}

/// Linear interpolation over (u, v) of the values at p00, p10, p01, p11.
#[inline]
pub(super) fn bilinear(values: [Vec3; 4], uv: Vec2) -> Vec3 {
    values[0].lerp(values[1], uv.x).lerp(values[2].lerp(values[3], uv.x), uv.y)
}
