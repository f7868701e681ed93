//! A light is never in its own shadow: a segment that ends on a surface does not meet that surface.
#![allow(clippy::print_stdout, reason = "tests print the figures that they judge")]

use embree::{Device, DeviceOptions, Geometry, SceneBuilder, SceneOptions, TriangleIndices, VertexBuffer};
use glam::{Vec2, Vec3};
use renderer::integrator::{Opaque, Queries};
use renderer::math::{PointWithError, spawn_segment, warp};
use renderer::sampling::{Dimension, Numbers, Sampler, Use};
use renderer::shape::Shape;
use renderer::shape::triangle::Triangle;

/// A point in the cube [-1, 1]³, from two pairs of numbers.
fn point(numbers: &Numbers, bounce: u32) -> Vec3 {
    let a = numbers.d2(Dimension::at(bounce, Use::Light));
    let b = numbers.d2(Dimension::at(bounce, Use::Bsdf));
    2.0 * Vec3::new(a.x, a.y, b.x) - Vec3::ONE
}

#[test]
fn segments_to_a_triangle_do_not_meet_it() {
    let device = Device::new(&DeviceOptions::default()).unwrap();
    let sampler = Sampler::new(7);
    let (mut asked, mut wrong) = (0u32, 0u32);
    for triangle in 0..200 {
        let numbers = sampler.pixel_sample([0, 0], triangle);
        let p = [0, 1, 2].map(|k| point(&numbers, k));
        let Some(light) = Triangle::new(p, None, None, false) else { continue };
        let vertices = VertexBuffer::new(p.map(|v| v.to_array()).to_vec()).unwrap();
        let indices = TriangleIndices::new(vec![[0, 1, 2]], 3).unwrap();
        let mut builder = SceneBuilder::new(&device, SceneOptions { robust: false, ..SceneOptions::default() });
        builder.attach(Geometry::triangles(&device, vertices, indices).unwrap());
        let scene = builder.commit().unwrap();
        let shape = Shape::Triangle(light);
        for k in 0..500u64 {
            let numbers = sampler.pixel_sample([1, triangle as u32], k);
            let distance = 10f32.powi((k % 4) as i32);
            let from = warp::uniform_sphere(numbers.d2(Dimension::FILM)) * distance * 2.0;
            let Some(sample) = shape.sample(from, numbers.d2(Dimension::LENS)) else { continue };
            let segment = spawn_segment(PointWithError::exact(from), Vec3::ZERO, sample.point, sample.n);
            asked += 1;
            wrong += u32::from(Opaque(&scene).occluded(&segment));
            assert_ne!(Vec2::ZERO, segment.direction.truncate(), "a segment without length");
        }
    }
    println!("{wrong} of {asked} segments met the surface that they end on");
    assert!(asked > 90_000);
    assert_eq!(wrong, 0);
}
