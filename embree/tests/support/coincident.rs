//! A scene full of ties, and a digest of what a fixed set of rays hits in it.

use super::{Numbers, mesh};
use embree::{BuildQuality, CommittedScene, Device, Geometry, Ray, SceneBuilder, SceneOptions};
use glam::{Affine3A, Vec3};
use std::sync::Arc;

/// Triangles of all sizes, each of them there twice, in a shuffled order; a third of them overlap in one plane.
fn doubled(device: &Device, triangles: u32, seed: u64) -> Geometry {
    let mut numbers = Numbers(seed);
    let mut positions = Vec::new();
    for i in 0..triangles {
        let (center, size) = (numbers.cube(), 0.3 * numbers.next().powi(4) + 0.01);
        let flat = if i % 3 == 0 { Vec3::new(1.0, 1.0, 0.0) } else { Vec3::ONE };
        positions.extend((0..3).map(|_| (flat * (center + size * numbers.cube())).to_array()));
    }
    let mut indices: Vec<[u32; 3]> = (0..2 * triangles).map(|i| [0, 1, 2].map(|k| 3 * (i % triangles) + k)).collect();
    for i in (1..indices.len()).rev() {
        indices.swap(i, (numbers.next() * (i + 1) as f32) as usize);
    }
    mesh(device, positions, indices)
}

/// `copies` coincident meshes of doubled triangles, and as many coincident instances of a scene of such.
pub fn scene(device: &Device, quality: BuildQuality, triangles: u32, copies: u32) -> CommittedScene {
    let options = SceneOptions { quality, ..SceneOptions::default() };
    let mut object = SceneBuilder::new(device, options);
    let mut top = SceneBuilder::new(device, options);
    for _ in 0..copies {
        object.attach(doubled(device, triangles / 4, 7));
        top.attach(doubled(device, triangles, 1));
    }
    let object = Arc::new(object.commit().unwrap());
    for _ in 0..copies {
        let place = Affine3A::from_scale(Vec3::splat(0.75));
        top.attach(Geometry::instance(device, Arc::clone(&object), place).unwrap());
    }
    top.commit().unwrap()
}

/// Rays through the scene from all around, the same every time.
pub fn rays(count: usize) -> Vec<Ray> {
    let mut numbers = Numbers(99);
    (0..count)
        .map(|_| {
            let origin = 2.0 * numbers.cube();
            Ray::new(origin, numbers.cube() - origin)
        })
        .collect()
}

/// The bits of everything that a ray learns: the hit, and whether it is occluded.
pub type Answer = (Option<[u32; 9]>, bool);

pub fn answer(scene: &CommittedScene, ray: &Ray) -> Answer {
    let bits = |hit: embree::Hit| {
        let [x, y, z] = hit.ng.to_array().map(f32::to_bits);
        let instance = hit.instance.unwrap_or(u32::MAX);
        let [t, u, v] = [hit.t, hit.u, hit.v].map(f32::to_bits);
        [t, u, v, x, y, z, hit.geometry, hit.primitive, instance]
    };
    (scene.intersect(ray).map(bits), scene.occluded(&Ray { t_far: 1.0, ..*ray }))
}

pub fn answers(scene: &CommittedScene, rays: &[Ray]) -> Vec<Answer> {
    rays.iter().map(|ray| answer(scene, ray)).collect()
}
