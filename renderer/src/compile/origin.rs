//! Scenes far from the origin of their file, where `f32` is coarse: built around another one.

use embree::Device;
use glam::{DVec3, Vec3};

use super::CompileError;
use crate::scene::{Diagnostic, Scene};
use crate::world::{Techniques, World};

/// A scene that would lose three bits of its coordinates or more is worth building twice.
const WORTH_MOVING: f32 = 8.0;

/// As [`super::world`], of a scene whose origin is moved first if that makes its coordinates much smaller.
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

/// The point of the scene next to the camera, if the scene's coordinates measured from there are much smaller.
fn better_origin(world: &World) -> Option<DVec3> {
    let (low, high) = world.geometry.bounds();
    let place = world.camera.position().clamp(low, high);
    let farthest = |from: Vec3| (low - from).abs().max((high - from).abs()).max_element();
    (farthest(Vec3::ZERO) > WORTH_MOVING * farthest(place)).then(|| place.as_dvec3())
}
