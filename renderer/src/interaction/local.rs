//! Hits in the space of the surface that was hit: that of the object if it is instanced, else the world's.

use embree::Hit;
use glam::{Vec2, Vec3};

use super::surface::{CurveSet, Mesh, PatchMesh};
use super::{Instance, TriangleTest};
use crate::math::{PointWithError, Ray, gamma};
use crate::scene::description::CurveKind;
use crate::shape::{Shape, SurfacePoint, patch};

/// A hit with what an instance has to transform.
pub(super) struct Local {
    pub point: PointWithError,
    /// Distance along the normal that a spawned ray has to keep beyond the point's error.
    pub clearance: f32,
    /// How far the primitive reaches from the point, by coordinate.
    pub extent: Vec3,
    /// Unit; the side does not matter if `ns` decides.
    pub ng: Vec3,
    /// The interpolated normal, of any length; `None`: that of the surface.
    pub ns: Option<Vec3>,
}

/// A hit in world space.
pub(super) struct Placed {
    pub point: PointWithError,
    pub ng: Vec3,
    pub ns: Vec3,
}

impl Local {
    /// Of a surface that is not instanced.
    #[inline]
    pub fn in_world(self) -> Placed {
        let error = self.point.error + self.ng.abs() * self.clearance;
        Placed::new(PointWithError { p: self.point.p, error }, self.ng, self.ns)
    }
}

impl Placed {
    /// `ng` unit; `ns` of any length.
    #[inline]
    pub fn new(point: PointWithError, ng: Vec3, ns: Option<Vec3>) -> Self {
        match ns.and_then(unit) {
            Some(ns) => Self { point, ng: if ng.dot(ns) < 0.0 { -ng } else { ng }, ns },
            None => Self { point, ng, ns: ng },
        }
    }
}

/// `v` normalised, also where its squared length would leave the range of `f32`; `None` for zero and non-finite.
#[inline]
pub(super) fn unit(v: Vec3) -> Option<Vec3> {
    let squared = v.length_squared();
    if (f32::MIN_POSITIVE..=f32::MAX).contains(&squared) {
        return Some(v / squared.sqrt());
    }
    let scaled = v.as_dvec3();
    let length = scaled.length();
    (length > 0.0 && length.is_finite()).then(|| (scaled / length).as_vec3())
}

#[inline]
pub(super) fn triangle(mesh: &Mesh, hit: &Hit, flipped: bool, test: TriangleTest) -> Local {
    let indices = mesh.indices[hit.primitive as usize];
    let v = indices.map(|index| Vec3::from_array(mesh.vertices[index as usize]));
    let b = Vec3::new(1.0 - hit.u - hit.v, hit.u, hit.v);
    let terms = [b.x * v[0], b.y * v[1], b.z * v[2]];
    let p = terms[0] + terms[1] + terms[2];
    // Barycentric coordinates, products and sums of rounded operations.
    let error = gamma(7) * (terms[0].abs() + terms[1].abs() + terms[2].abs());
    // A triangle that was hit has a normal: zero divides by zero and misses.
    let n = unit(hit.ng).unwrap_or(Vec3::Z);
    let to = v.map(|vertex| vertex - p);
    let extent = to[0].abs().max(to[1].abs()).max(to[2].abs());
    let clearance = test.clearance(&to, extent, n, error);
    let ns = (!mesh.normals.is_empty()).then(|| {
        let [n0, n1, n2] = indices.map(|index| mesh.normals[index as usize]);
        b.x * n0 + b.y * n1 + b.z * n2
    });
    let ng = if flipped { -n } else { n };
    Local { point: PointWithError { p, error }, clearance, extent, ng, ns }
}

pub(super) fn patch(mesh: &PatchMesh, hit: &Hit, flipped: bool) -> Local {
    let corners = mesh.corners(hit.primitive);
    let SurfacePoint { point, n, .. } = patch::surface_point(&corners, hit.u, hit.v);
    let (low, high) = patch::bounds(&corners);
    let ns = (!mesh.normals.is_empty()).then(|| mesh.interpolate(hit.primitive, &mesh.normals, hit.u, hit.v));
    let n = if n == Vec3::ZERO { unit(hit.ng).unwrap_or(Vec3::Z) } else { n };
    // The patch is intersected in f64, so rays need no more than the rounding of p to clear it.
    Local { point, clearance: 0.0, extent: high - low, ng: if flipped { -n } else { n }, ns }
}

pub(super) fn quadric(shape: &Shape, hit: &Hit) -> Local {
    let surface = quadric_point(shape, hit.ng);
    let (low, high) = shape.bounds();
    Local { point: surface.point, clearance: 0.0, extent: high - low, ng: surface.n, ns: None }
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
    Local { point: PointWithError { p, error }, clearance: 0.0, extent: Vec3::ZERO, ng, ns: None }
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
