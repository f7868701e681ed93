//! What thousands of bounces do to a path.

use glam::Vec2;

use super::*;
use crate::compile;
use crate::integrator::Opaque;
use crate::sampling::Sampler;
use crate::scene::pbrt;
use crate::world::Techniques;

/// The camera is within a tetrahedron of glass so dense that nearly all of its light is mirrored for good.
const SCENE: &str = r#"
    Film "rgb" "integer xresolution" 4 "integer yresolution" 4
    Integrator "path" "integer maxdepth" 10000
    LookAt 0.1 0.05 0.02  1 0.4 0.3  0 0 1
    Camera "perspective"
    WorldBegin
    Material "dielectric" "float eta" 1000 "float roughness" 0
    Shape "trianglemesh" "point3 P" [ 1 1.1 0.9  -1.2 -1 1  -1 1 -0.8  1 -0.9 -1 ]
        "integer indices" [ 0 2 1  0 1 3  0 3 2  1 2 3 ]
"#;

/// Keeps the largest difference of the squared length of wo from 1.
#[derive(Default)]
struct Lengths {
    arrivals: u32,
    worst: f32,
}

impl Recorder for &mut Lengths {
    fn arrive(&mut self, vertex: &Vertex<'_>, _: f32) {
        self.arrivals += 1;
        self.worst = self.worst.max((vertex.wo.vec().length_squared() - 1.0).abs());
    }
    fn receive(&mut self, _: &Vertex<'_>, _: &DirectLight) {}
    fn scatter(&mut self, _: &Vertex<'_>, _: &BsdfSample) {}
    fn survive(&mut self, _: f32) {}
    fn meets(&mut self, _: Rgb, _: Group) {}
}

#[test]
fn directions_stay_unit_over_10_000_mirrors() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("glass.pbrt");
    std::fs::write(&file, SCENE).unwrap();
    let (scene, _) = pbrt::load(&file).unwrap();
    let device = embree::Device::new(&embree::DeviceOptions::default()).unwrap();
    let (world, _) = compile::world(&scene, &device, Techniques::default()).unwrap();
    let queries = Opaque(world.geometry.scene());
    let mut lengths = Lengths::default();
    for k in 0..16 {
        let numbers = Sampler::new(1).pixel_sample([0, 0], k);
        let camera = world.camera.ray(4.0 * numbers.d2(Dimension::FILM), Vec2::splat(0.5)).unwrap();
        let mut path = Path::new(&camera, numbers, &mut lengths);
        trace(&world, &queries, std::iter::once(&mut path), false, &mut Counters::default());
    }
    assert!(lengths.arrivals > 100_000, "{} bounces", lengths.arrivals);
    // Into a frame and out of it each coordinate is a sum of three products, of 2⁻²⁴ each: 18 · 2⁻²⁴ of the squared length
    // at most, whatever the bounce. They would add up if neither `unit` nor the interaction, for its wo, renormalised.
    assert!(lengths.worst < 18.0 / (1 << 24) as f32, "{}", lengths.worst);
}
