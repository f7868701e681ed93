//! Spawned rays against the real ray query: none may meet the primitive that it leaves.

use std::sync::Arc;

use embree::{CommittedScene, Device, DeviceOptions, Hit, SceneBuilder, SceneOptions, TriangleIndices, VertexBuffer};
use glam::{Affine3A, Mat3, Quat, Vec3};

use super::surface::{Mesh, Primitives, Surface};
use super::{Geometry, Instance, TriangleTest};
use crate::math::{Ray, spawn_ray, warp};
use crate::scene::description::MaterialId;
use crate::shape::testing::{Points, random_vec3};

/// exp₂ of a uniform number between the exponents.
fn log_uniform(points: &mut Points, low: f32, high: f32) -> f32 {
    (low + (high - low) * points.unit()).exp2()
}

fn random_unit(points: &mut Points) -> Vec3 {
    loop {
        let v = random_vec3(points);
        if (0.01..1.0).contains(&v.length_squared()) {
            return v.normalize();
        }
    }
}

/// A triangle of size 2^±20 around `size`, up to 2^17 ≈ 1.3e5 of the unit from the origin, with an aspect ratio up to 1e5.
fn random_triangle(points: &mut Points, sizes: [f32; 2], offsets: [f32; 2]) -> [Vec3; 3] {
    let size = log_uniform(points, sizes[0], sizes[1]);
    let centre = random_unit(points) * log_uniform(points, offsets[0], offsets[1]);
    let along = random_unit(points);
    let across = along.any_orthonormal_vector();
    let height = log_uniform(points, -16.6, 0.0);
    let mut p =
        [centre, centre + along * size, centre + (along * (points.unit() * 1.4 - 0.2) + across * height) * size];
    let turn = (points.unit() * 3.0) as usize % 3;
    p.rotate_left(turn);
    p
}

/// One scene with a few triangles as one mesh, instanced by each of the transforms or not at all.
fn geometry(device: &Device, triangles: &[[Vec3; 3]], transforms: &[Affine3A], test: TriangleTest) -> Geometry {
    let options = SceneOptions { robust: test == TriangleTest::Watertight, ..SceneOptions::default() };
    let vertices = VertexBuffer::new(triangles.as_flattened().iter().map(|p| p.to_array()).collect()).unwrap();
    let indices = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let indices = TriangleIndices::new(indices, vertices.len()).unwrap();
    let mesh = Mesh {
        vertices: vertices.clone(),
        indices: indices.clone(),
        normals: vec![],
        uvs: vec![],
        tangents: vec![],
        first_quad_half: u32::MAX,
    };
    let mut scene = SceneBuilder::new(device, options);
    scene.attach(embree::Geometry::triangles(device, vertices, indices).unwrap().with_hit_filter());
    let mut scene = scene.commit().unwrap();
    let mut instances = Vec::new();
    if !transforms.is_empty() {
        let object = Arc::new(scene);
        let mut top = SceneBuilder::new(device, options);
        for &transform in transforms {
            top.attach(embree::Geometry::instance(device, Arc::clone(&object), transform).unwrap());
            instances.push(Instance::new(transform, 0).unwrap());
        }
        scene = top.commit().unwrap();
    }
    let surface = Surface {
        primitives: Primitives::Triangles(mesh),
        material: MaterialId(0),
        first_emitter: None,
        alpha: None,
        flipped: false,
        span: Default::default(),
    };
    let placed = u32::from(transforms.is_empty());
    Geometry::new(scene, vec![surface], instances, placed, test)
}

/// The hit of one triangle alone.
fn hit_of(scene: &CommittedScene, ray: &Ray, primitive: u32, instance: Option<u32>) -> Option<Hit> {
    let query = embree::Ray { t_far: ray.t_max, ..embree::Ray::new(ray.origin, ray.direction) };
    let own = |hit: &Hit| hit.primitive == primitive && hit.instance == instance;
    scene.intersect_filtered(&query, &own)
}

/// Spawned rays and self hits: `rays` from each of a few points of every triangle.
fn self_hits(geometry: &Geometry, triangles: &[[Vec3; 3]], transforms: &[Affine3A], rays: usize) -> (usize, usize) {
    let mut points = Points::new(99);
    let (mut spawned, mut self_hits) = (0, 0);
    let instances = transforms.len().max(1) as u32;
    for (primitive, number) in (0..triangles.len() as u32).flat_map(|p| (0..instances).map(move |i| (p, i))) {
        let instance = (!transforms.is_empty()).then_some(number);
        let to_world = |p: Vec3| instance.map_or(p, |number| transforms[number as usize].transform_point3(p));
        let [p0, p1, p2] = triangles[primitive as usize].map(to_world);
        let size = (p1 - p0).length().max((p2 - p0).length());
        for _ in 0..4 {
            let b = warp::uniform_triangle(points.square());
            let target = p0 * b.x + p1 * b.y + p2 * (1.0 - b.x - b.y);
            let away = (random_unit(&mut points) + (p1 - p0).cross(p2 - p0).normalize_or_zero()).normalize();
            let origin = target + away * size * log_uniform(&mut points, -1.0, 4.0);
            let ray = Ray::new(origin, target - origin);
            let Some(hit) = hit_of(geometry.scene(), &ray, primitive, instance) else { continue };
            let vertex = geometry.interaction(&ray, &hit);
            for _ in 0..rays {
                let tangent = vertex.ng.cross(random_unit(&mut points)).normalize();
                // From straight up to within the tangent plane, to both sides.
                let cos = log_uniform(&mut points, -30.0, 0.0) * if points.unit() < 0.5 { -1.0 } else { 1.0 };
                let direction = tangent * (1.0 - cos * cos).sqrt() + vertex.ng * cos;
                let leaving = spawn_ray(vertex.point, vertex.ng, direction);
                spawned += 1;
                self_hits += usize::from(hit_of(geometry.scene(), &leaving, primitive, instance).is_some());
            }
        }
    }
    (spawned, self_hits)
}

/// Checks all of the triangles, a few per scene so that rays do not see many others.
fn check(triangles: &[[Vec3; 3]], transforms: &[Affine3A], rays: usize, least: usize) {
    let device = Device::new(&DeviceOptions::default()).unwrap();
    for test in [TriangleTest::Fast, TriangleTest::Watertight] {
        let counts = triangles.chunks(8).map(|triangles| {
            let geometry = geometry(&device, triangles, transforms, test);
            self_hits(&geometry, triangles, transforms, rays)
        });
        let (spawned, self_hits) = counts.fold((0, 0), |sum, count| (sum.0 + count.0, sum.1 + count.1));
        assert!(spawned >= least, "only {spawned} rays");
        assert_eq!(self_hits, 0, "self hits of {spawned} rays with {test:?}");
    }
}

fn triangles(count: usize, sizes: [f32; 2], offsets: [f32; 2]) -> Vec<[Vec3; 3]> {
    let mut points = Points::new(5);
    (0..count).map(|_| random_triangle(&mut points, sizes, offsets)).collect()
}

#[test]
fn no_spawned_ray_meets_its_own_triangle() {
    check(&triangles(2000, [-20.0, 20.0], [-20.0, 17.0]), &[], 100, 500_000);
}

#[test]
fn no_spawned_ray_meets_its_own_instanced_triangle() {
    let mut points = Points::new(17);
    let mut transform = |i| {
        let mut turn = || Mat3::from_quat(Quat::from_axis_angle(random_unit(&mut points), 2.0));
        let (before, after) = (turn(), turn());
        let scale = Vec3::from_array(std::array::from_fn(|_| log_uniform(&mut points, -4.0, 4.0)));
        let m = after * Mat3::from_diagonal(if i % 2 == 0 { scale } else { -scale }) * before;
        Affine3A::from_mat3_translation(m, random_unit(&mut points) * log_uniform(&mut points, 0.0, 17.0))
    };
    let transforms: Vec<Affine3A> = (0..8).map(&mut transform).collect();
    check(&triangles(400, [-4.0, 4.0], [-4.0, 4.0]), &transforms, 30, 200_000);
}
