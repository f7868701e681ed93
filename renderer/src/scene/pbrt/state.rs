//! The graphics state: what the directives before it have set for the next shape, light or camera.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DMat4, DVec3};

use super::param::Param;
use crate::math::Transform;
use crate::scene::description::MediumId;
use crate::spectrum::RgbSpace;

/// The current transform at the start and at the end of the shutter.
pub(super) type Transforms = [Transform; 2];

/// What `AttributeBegin` saves and `AttributeEnd` restores.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) transforms: Transforms,
    /// Which of them the transform directives act on.
    pub(super) active: [bool; 2],
    pub(super) reverse_orientation: bool,
    pub(super) color_space: RgbSpace,
    /// Index into the reader's table of materials.
    pub(super) material: u32,
    /// Index of the `AreaLightSource` in force.
    pub(super) area_light: Option<u32>,
    /// Inside and outside.
    pub(super) media: [Option<MediumId>; 2],
    /// What `Attribute` has set, shared until it changes.
    pub(super) attributes: Arc<Attributes>,
}

impl Default for State {
    fn default() -> Self {
        Self {
            transforms: Transforms::default(),
            active: [true, true],
            reverse_orientation: false,
            color_space: RgbSpace::Srgb,
            material: 0,
            area_light: None,
            media: [None, None],
            attributes: Arc::default(),
        }
    }
}

/// Parameters set by `Attribute`, by what they are for.
#[derive(Clone, Debug, Default)]
pub(super) struct Attributes {
    pub(super) shape: Vec<Param>,
    pub(super) light: Vec<Param>,
    pub(super) material: Vec<Param>,
    pub(super) medium: Vec<Param>,
    pub(super) texture: Vec<Param>,
}

impl Attributes {
    /// The names of the targets.
    pub(super) const TARGETS: [&'static str; 5] = ["shape", "light", "material", "medium", "texture"];

    /// The parameters for a target by its name.
    pub(super) fn target(&mut self, name: &str) -> Option<&mut Vec<Param>> {
        match name {
            "shape" => Some(&mut self.shape),
            "light" => Some(&mut self.light),
            "material" => Some(&mut self.material),
            "medium" => Some(&mut self.medium),
            "texture" => Some(&mut self.texture),
            _ => None,
        }
    }
}

impl State {
    /// Replaces the active transforms.
    pub(super) fn set(&mut self, transform: Transform) {
        for (current, _) in self.transforms.iter_mut().zip(self.active).filter(|&(_, active)| active) {
            *current = transform;
        }
    }

    /// Multiplies the active transforms from the right: the new one acts first.
    pub(super) fn concat(&mut self, transform: Transform) {
        for (current, _) in self.transforms.iter_mut().zip(self.active).filter(|&(_, active)| active) {
            *current = *current * transform;
        }
    }

    /// Whether start and end differ.
    pub(super) fn moves(&self) -> bool {
        self.transforms[0].matrix() != self.transforms[1].matrix()
    }
}

/// Coordinate systems by name.
pub(super) type CoordinateSystems = HashMap<String, Transforms>;

/// `Translate`.
pub(super) fn translate([x, y, z]: [f64; 3]) -> Transform {
    let by = DVec3::new(x, y, z);
    Transform::with_inverse(DMat4::from_translation(by), DMat4::from_translation(-by))
}

/// `Scale`. `None` if a factor is zero.
pub(super) fn scale(factors: [f64; 3]) -> Option<Transform> {
    let by = DVec3::from(factors);
    invertible(Transform::with_inverse(DMat4::from_scale(by), DMat4::from_scale(by.recip())))
}

/// `Rotate`, in degrees. `None` if the axis has no length.
pub(super) fn rotate([degrees, x, y, z]: [f64; 4]) -> Option<Transform> {
    let axis = DVec3::new(x, y, z).try_normalize()?;
    let matrix = DMat4::from_axis_angle(axis, degrees.to_radians());
    invertible(Transform::with_inverse(matrix, matrix.transpose()))
}

/// `Transform` and `ConcatTransform`: 16 numbers, column by column. `None` if there is no inverse.
pub(super) fn matrix(columns: [f64; 16]) -> Option<Transform> {
    invertible(Transform::new(DMat4::from_cols_array(&columns)))
}

/// `LookAt`: camera from world, with the camera looking along +z, its x axis to the right of the picture in a
/// left-handed frame. `None` if eye and target coincide or `up` is along the view.
pub(super) fn look_at(v: [f64; 9]) -> Option<Transform> {
    let eye = DVec3::new(v[0], v[1], v[2]);
    let view = (DVec3::new(v[3], v[4], v[5]) - eye).try_normalize()?;
    let right = DVec3::new(v[6], v[7], v[8]).try_normalize()?.cross(view).try_normalize()?;
    let up = view.cross(right);
    let world_from_camera = DMat4::from_cols(right.extend(0.0), up.extend(0.0), view.extend(0.0), eye.extend(1.0));
    invertible(Transform::new(world_from_camera).inverse())
}

fn invertible(transform: Transform) -> Option<Transform> {
    transform.is_invertible().then_some(transform)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn look_at_puts_the_eye_at_the_origin_and_the_target_on_z() {
        let camera_from_world = look_at([1.0, 2.0, 3.0, 1.0, 2.0, 8.0, 0.0, 1.0, 0.0]).unwrap();
        assert_eq!(camera_from_world.point(Vec3::new(1.0, 2.0, 3.0)), Vec3::ZERO);
        assert_eq!(camera_from_world.point(Vec3::new(1.0, 2.0, 8.0)), Vec3::new(0.0, 0.0, 5.0));
        // Looking along +z with y up, +x is on the right: the frame is left-handed.
        assert_eq!(camera_from_world.vector(Vec3::X), Vec3::X);
        assert!(look_at([0.0; 9]).is_none());
        assert!(look_at([0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0]).is_none());
    }

    #[test]
    fn rotations_are_right_handed_in_degrees() {
        let quarter = rotate([90.0, 0.0, 0.0, 2.0]).unwrap();
        assert!((quarter.point(Vec3::X) - Vec3::Y).length() < 1e-6);
        assert!((quarter.inverse().point(Vec3::Y) - Vec3::X).length() < 1e-6);
        assert!(rotate([90.0, 0.0, 0.0, 0.0]).is_none());
    }

    #[test]
    fn a_matrix_is_read_column_by_column() {
        let mut columns = [0.0; 16];
        columns[0] = 1.0;
        columns[5] = 1.0;
        columns[10] = 1.0;
        columns[15] = 1.0;
        columns[12] = 7.0;
        assert_eq!(matrix(columns).unwrap().point(Vec3::ZERO), Vec3::new(7.0, 0.0, 0.0));
        assert!(matrix([0.0; 16]).is_none());
        assert!(scale([1.0, 0.0, 1.0]).is_none());
    }

    #[test]
    fn only_active_transforms_change() {
        let mut state = State { active: [false, true], ..State::default() };
        state.concat(translate([1.0, 0.0, 0.0]));
        assert!(state.moves());
        assert_eq!(state.transforms[0].point(Vec3::ZERO), Vec3::ZERO);
        assert_eq!(state.transforms[1].point(Vec3::ZERO), Vec3::X);
        state.active = [true, true];
        state.set(Transform::default());
        assert!(!state.moves());
    }
}
