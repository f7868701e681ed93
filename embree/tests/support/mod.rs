//! Small scenes and rays for the tests.
#![allow(dead_code)] // each test file uses a part

pub mod coincident;

use embree::{Device, DeviceOptions, Geometry, Ray, TriangleIndices, UserGeometry, UserHit, VertexBuffer};
use glam::Vec3;

/// A device as the renderer opens it.
pub fn device() -> Device {
    Device::new(&DeviceOptions::default()).expect("this machine has AVX2")
}

/// A mesh of the given triangles.
pub fn mesh(device: &Device, positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Geometry {
    let vertices = VertexBuffer::new(positions).unwrap();
    let triangles = TriangleIndices::new(triangles, vertices.len()).unwrap();
    Geometry::triangles(device, vertices, triangles).unwrap()
}

/// The triangle (0,0), (1,0), (0,1) at height `z`, facing up.
pub fn triangle(device: &Device, z: f32) -> Geometry {
    mesh(device, vec![[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]], vec![[0, 1, 2]])
}

/// A ray straight down on (x, y) from height 10.
pub fn down(x: f32, y: f32) -> Ray {
    Ray::new(Vec3::new(x, y, 10.0), -Vec3::Z)
}

/// Whether two values agree to a few roundings: Embree's robust test divides by an approximate reciprocal.
pub fn close(a: f32, b: f32) -> bool {
    (a - b).abs() <= 4.0 * f32::EPSILON * a.abs().max(b.abs())
}

/// Spheres of one radius, hit from outside and inside.
pub struct Spheres {
    pub centers: Vec<Vec3>,
    pub radius: f32,
}

impl UserGeometry for Spheres {
    fn len(&self) -> usize {
        self.centers.len()
    }

    fn bounds(&self, primitive: u32) -> (Vec3, Vec3) {
        let center = self.centers[primitive as usize];
        (center - Vec3::splat(self.radius), center + Vec3::splat(self.radius))
    }

    fn intersect(&self, primitive: u32, origin: Vec3, direction: Vec3, range: (f32, f32)) -> Option<UserHit> {
        let o = (origin - self.centers[primitive as usize]).as_dvec3();
        let d = direction.as_dvec3();
        let (a, b, c) = (d.dot(d), o.dot(d), o.dot(o) - f64::from(self.radius).powi(2));
        let root = (b * b - a * c).sqrt();
        let roots = [(-b - root) / a, (-b + root) / a].map(|t| t as f32);
        let t = roots.into_iter().find(|&t| range.0 <= t && t <= range.1)?;
        let ng = (o + f64::from(t) * d).as_vec3();
        Some(UserHit { t, u: ng.x, v: ng.y, ng })
    }
}

/// A small reproducible generator (SplitMix64), so that the tests need no crate for it.
pub struct Numbers(pub u64);

impl Numbers {
    /// In [0, 1).
    pub fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 * 2.0_f32.powi(-24)
    }

    /// In [-1, 1)³.
    pub fn cube(&mut self) -> Vec3 {
        Vec3::from_array(std::array::from_fn(|_| 2.0 * self.next() - 1.0))
    }
}
