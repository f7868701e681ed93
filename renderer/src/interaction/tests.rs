use glam::{Affine3A, Vec2, Vec3};

use super::surface::{Mesh, Primitives, Surface};
use super::{Geometry, SurfaceInteraction, TriangleTest};
use crate::math::{PointWithError, Ray};
use crate::scene::description::MaterialId;
use crate::shape::testing::{Points, random_vec3};

fn triangle(positions: [Vec3; 3], uvs: Vec<Vec2>) -> Geometry {
    let device = embree::Device::new(&Default::default()).unwrap();
    let vertices = embree::VertexBuffer::new(positions.map(|p| p.to_array()).to_vec()).unwrap();
    let indices = embree::TriangleIndices::new(vec![[0, 1, 2]], 3).unwrap();
    let mut scene = embree::SceneBuilder::new(&device, embree::SceneOptions { robust: false, ..Default::default() });
    scene.attach(embree::Geometry::triangles(&device, vertices.clone(), indices.clone()).unwrap());
    let mesh = Mesh { vertices, indices, normals: vec![], uvs, tangents: vec![], first_quad_half: u32::MAX };
    let surface = Surface {
        primitives: Primitives::Triangles(mesh),
        material: MaterialId(0),
        first_emitter: None,
        alpha: None,
        flipped: false,
        span: Default::default(),
    };
    Geometry::new(scene.commit().unwrap(), vec![surface], vec![], 1, TriangleTest::Fast)
}

fn hit<'g>(geometry: &'g Geometry, ray: &Ray) -> SurfaceInteraction<'g> {
    let hit = geometry.scene().intersect(&embree::Ray::new(ray.origin, ray.direction)).unwrap();
    geometry.interaction(ray, &hit)
}

const POSITIONS: [Vec3; 3] = [Vec3::new(-3.0, -2.0, 0.0), Vec3::new(4.0, -1.0, 0.5), Vec3::new(0.0, 5.0, -0.5)];

fn uvs() -> Vec<Vec2> {
    vec![Vec2::new(0.1, 0.9), Vec2::new(1.3, 0.4), Vec2::new(0.2, -0.6)]
}

#[test]
fn the_footprint_is_where_a_narrow_cone_meets_the_plane() {
    let geometry = triangle(POSITIONS, uvs());
    let origin = Vec3::new(2.0, 3.0, 4.0);
    let ray = Ray::new(origin, -origin.normalize());
    let vertex = hit(&geometry, &ray);
    let radius = 1e-3 * vertex.t;
    let at = vertex.texture_point(radius);
    // Points around the ellipse lie on the plane and, seen from the origin, at the cone's angle.
    for k in 0..16 {
        let (sin, cos) = (k as f32 * 0.4).sin_cos();
        let p = vertex.point.p + 0.5 * (at.dpdx * cos + at.dpdy * sin);
        assert!((p - vertex.point.p).dot(vertex.ng).abs() < 1e-6 * vertex.t);
        let distance = (p - origin).cross(ray.direction).length();
        assert!((distance / radius - 1.0).abs() < 5e-3, "{distance} instead of {radius}");
    }
    // Texture coordinates change as they do between two hits.
    for (dp, duv) in [(at.dpdx, at.duvdx), (at.dpdy, at.duvdy)] {
        let there = hit(&geometry, &Ray::new(origin, vertex.point.p + dp - origin));
        assert!((there.uv() - vertex.uv() - duv).length() < 1e-5, "{} {duv}", there.uv() - vertex.uv());
    }
}

#[test]
fn a_grazing_footprint_ends_at_the_eye() {
    let geometry = triangle(POSITIONS, uvs());
    let n = (POSITIONS[1] - POSITIONS[0]).cross(POSITIONS[2] - POSITIONS[0]).normalize();
    let inside = (POSITIONS[0] + POSITIONS[1] + POSITIONS[2]) / 3.0;
    for cos in [1.0, 1e-2, 1e-4] {
        let away = (n * cos + n.any_orthonormal_vector()).normalize();
        let vertex = hit(&geometry, &Ray::new(inside + away * 2.0, -away));
        for radius in [0.0, 1e-6, 0.1, 10.0] {
            let at = vertex.texture_point(radius);
            assert!(at.dpdx.length() <= 2.0 * vertex.t.max(radius) * 1.001, "{} at {cos}", at.dpdx.length());
            assert!(at.dpdy.is_finite() && at.duvdx.is_finite() && at.duvdy.is_finite());
        }
    }
}

#[test]
fn without_texture_coordinates_that_vary_tangents_are_arbitrary_but_orthogonal() {
    let geometry = triangle(POSITIONS, vec![Vec2::splat(0.3); 3]);
    let vertex = hit(&geometry, &Ray::new(Vec3::new(0.0, 0.0, 9.0), Vec3::NEG_Z));
    assert!(vertex.derivatives().is_none());
    let (s, t) = vertex.tangents();
    assert!(s.dot(vertex.ng).abs() < 1e-6 && t.dot(vertex.ng).abs() < 1e-6 && s.dot(t).abs() < 1e-6);
    assert_eq!(vertex.texture_point(0.1).duvdx, Vec2::ZERO);
    // A mesh without any has those of a triangle of its own.
    let geometry = triangle(POSITIONS, vec![]);
    let vertex = hit(&geometry, &Ray::new(Vec3::new(0.0, 0.0, 9.0), Vec3::NEG_Z));
    let (dpdu, dpdv) = vertex.derivatives().unwrap();
    assert!((dpdu - (POSITIONS[1] - POSITIONS[0])).length() < 1e-5);
    assert!((dpdv - (POSITIONS[2] - POSITIONS[1])).length() < 1e-5);
}

#[test]
fn the_error_box_holds_the_exact_point_of_the_parameters() {
    let mut points = Points::new(2);
    for _ in 0..200 {
        let far = random_vec3(&mut points) * 1e4;
        let p: [Vec3; 3] = std::array::from_fn(|_| far + random_vec3(&mut points));
        let n = (p[1] - p[0]).cross(p[2] - p[0]);
        if n.length() < 1e-2 {
            continue;
        }
        let geometry = triangle(p, vec![]);
        let origin = (p[0] + p[1] + p[2]) / 3.0 + n.normalize() * 3.0;
        let ray = embree::Ray::new(origin, -n);
        let Some(hit) = geometry.scene().intersect(&ray) else { continue };
        let PointWithError { p: rounded, error } = geometry.interaction(&Ray::new(origin, -n), &hit).point;
        let (u, v) = (f64::from(hit.u), f64::from(hit.v));
        let exact = p[0].as_dvec3() * (1.0 - u - v) + p[1].as_dvec3() * u + p[2].as_dvec3() * v;
        assert!((rounded.as_dvec3() - exact).abs().cmple(error.as_dvec3()).all());
        // Tight enough to be of use: some 20 ulps of the coordinates, and of the triangle's size.
        let scale = rounded.abs().max_element() + 3.0;
        assert!(error.max_element() < 20.0 * f32::EPSILON * scale, "{error} at {rounded}");
    }
    let identity = super::Instance::new(Affine3A::IDENTITY, 0).unwrap();
    assert_eq!(identity.normal(Vec3::X), Vec3::X);
    assert!(super::Instance::new(Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0)), 0).is_none());
}
