//! Scenes far from the origin of their file, where `f32` is coarse: built around another one.

use embree::Device;
use glam::{DVec3, Vec2, Vec3};

use super::CompileError;
use crate::scene::{Diagnostic, Scene};
use crate::world::{Techniques, World};

/// Coordinates of what is seen that are so many times larger than they need be are worth building the scene twice: ten of
/// their 24 bits say nothing then. Up to 10⁵ no image shows it.
const WORTH_MOVING: f32 = 1024.0;

/// Rays along each side of the frame that find out what is seen.
const RAYS: u8 = 8;

/// As [`super::world`], of a scene whose origin is moved first if that makes the coordinates of what is seen much
/// smaller.
///
/// The errors of hit points, which rays must clear, are in proportion to coordinates: a room of 2 m at 10⁷ m would leak.
/// Most scenes are built once, as they are: where they are, and how large, is known only then.
///
/// # Errors
/// As [`super::world`].
pub fn world(
    scene: &mut Scene,
    device: &Device,
    techniques: Techniques,
) -> Result<(World, Vec<Diagnostic>), CompileError> {
    let built = super::world(scene, device, techniques)?;
    let Some(place) = better_origin(&built.0) else { return Ok(built) };
    drop(built);
    scene.move_origin(place);
    super::world(scene, device, techniques)
}

/// The point of the scene next to the camera, if the coordinates of what is seen are much smaller measured from there.
fn better_origin(world: &World) -> Option<DVec3> {
    let (low, high) = world.geometry.bounds();
    let place = world.camera.position().clamp(low, high);
    let coordinate = |v: Vec3| v.abs().max_element();
    seen(world).any(|p| coordinate(p) > WORTH_MOVING * coordinate(p - place)).then(|| place.as_dvec3())
}

/// Points that the camera sees, over all of the frame.
fn seen(world: &World) -> impl Iterator<Item = Vec3> + '_ {
    let size = Vec2::new(world.sensor.resolution[0] as f32, world.sensor.resolution[1] as f32);
    let places = (0..RAYS).flat_map(|y| (0..RAYS).map(move |x| Vec2::new(f32::from(x), f32::from(y)) + 0.5));
    places.filter_map(move |at| {
        let ray = world.camera.ray(size * at / f32::from(RAYS), Vec2::splat(0.5))?.ray;
        let query = embree::Ray { origin: ray.origin, direction: ray.direction, t_near: 0.0, t_far: ray.t_max };
        Some(ray.at(world.geometry.scene().intersect(&query)?.t))
    })
}
