//! Measuring a scene from another place than its file does.

use glam::{DMat4, DVec3};

use super::description::{Camera, Instance, Light, Mapping, Mapping2D, Scene, Shape, Texture, TextureKind};
use crate::math::Transform;

impl Scene {
    /// From now on world space has its origin at `place` of what was world space, its axes as they were. [`Scene::origin`]
    /// keeps where the file's own origin is. Transforms are in `f64`, so nothing is lost by it.
    pub fn move_origin(&mut self, place: DVec3) {
        self.origin += place;
        let there = DMat4::from_translation(place);
        let ours_from_old = Transform::with_inverse(DMat4::from_translation(-place), there);
        let Camera { world_from_camera, .. } = &mut self.camera;
        let placed = self.shapes.iter_mut().map(|Shape { world_from_shape, .. }| world_from_shape);
        let instances = self.instances.iter_mut().map(|Instance { world_from_object, .. }| world_from_object);
        let lights = self.lights.iter_mut().map(|Light { world_from_light, .. }| world_from_light);
        for transform in placed.chain(instances).chain(lights).chain([world_from_camera]) {
            *transform = ours_from_old * *transform;
        }
        let textures = self.textures.iter_mut().filter_map(|Texture { kind, .. }| texture_from_world(kind));
        for transform in textures {
            *transform = *transform * ours_from_old.inverse();
        }
    }
}

/// The transform of a texture that looks at places rather than at the coordinates of a surface.
fn texture_from_world(kind: &mut TextureKind) -> Option<&mut Transform> {
    match kind {
        TextureKind::Fbm { texture_from_world, .. }
        | TextureKind::Wrinkled { texture_from_world, .. }
        | TextureKind::Windy { texture_from_world }
        | TextureKind::Marble { texture_from_world, .. }
        | TextureKind::Checkerboard { mapping: Mapping::Three(texture_from_world), .. } => Some(texture_from_world),
        TextureKind::Checkerboard { mapping: Mapping::Two(mapping), .. }
        | TextureKind::Bilerp { mapping, .. }
        | TextureKind::Dots { mapping, .. } => mapped(mapping),
        TextureKind::Image(image) => mapped(&mut image.mapping),
        _ => None,
    }
}

fn mapped(mapping: &mut Mapping2D) -> Option<&mut Transform> {
    match mapping {
        Mapping2D::Uv { .. } => None,
        Mapping2D::Spherical(transform) | Mapping2D::Cylindrical(transform) => Some(transform),
        Mapping2D::Planar { texture_from_world, .. } => Some(texture_from_world),
    }
}
