//! Shapes that Embree asks us to intersect.

use std::sync::Arc;

use embree::{UserGeometry, UserHit};
use glam::Vec3;

use crate::interaction::PatchMesh;
use crate::shape::{Shape, ShapeHit, patch};

/// One sphere, disk or cylinder.
pub(super) struct Quadric(pub Arc<Shape>);

impl UserGeometry for Quadric {
    fn len(&self) -> usize {
        1
    }

    fn bounds(&self, _primitive: u32) -> (Vec3, Vec3) {
        self.0.bounds()
    }

    fn intersect(&self, _primitive: u32, origin: Vec3, direction: Vec3, t_range: (f32, f32)) -> Option<UserHit> {
        let ShapeHit { t, u, v, local } = self.0.intersect(origin, direction, t_range)?;
        // In place of the normal goes the point, from which `interaction` computes everything.
        Some(UserHit { t, u, v, ng: local })
    }
}

/// Bilinear patches.
pub(super) struct Patches(pub Arc<PatchMesh>);

impl UserGeometry for Patches {
    fn len(&self) -> usize {
        self.0.indices.len()
    }

    fn bounds(&self, primitive: u32) -> (Vec3, Vec3) {
        patch::bounds(&self.0.corners(primitive))
    }

    fn intersect(&self, primitive: u32, origin: Vec3, direction: Vec3, t_range: (f32, f32)) -> Option<UserHit> {
        let ShapeHit { t, u, v, .. } = patch::intersect(&self.0.corners(primitive), origin, direction, t_range)?;
        Some(UserHit { t, u, v, ng: -direction })
    }
}
