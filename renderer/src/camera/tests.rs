use std::f32::consts::{FRAC_1_SQRT_2, PI};

use glam::{DMat4, DVec3};
use proptest::prelude::*;

use super::*;
use crate::math::Transform;

fn description(kind: CameraKind) -> description::Camera {
    description::Camera {
        world_from_camera: Transform::default(),
        kind,
        lens_radius: 0.0,
        focal_distance: 1.0e6,
        screen_window: None,
        frame_aspect_ratio: None,
        span: Span::default(),
    }
}

fn perspective(fov: f32) -> description::Camera {
    description(CameraKind::Perspective { fov })
}

const CENTRE: Vec2 = Vec2::splat(0.5);

fn ray(camera: &Camera, x: f32, y: f32) -> CameraRay {
    camera.ray(Vec2::new(x, y), CENTRE).unwrap()
}

#[track_caller]
fn assert_near(a: Vec3, b: Vec3) {
    assert!((a - b).length() < 1e-6 * (1.0 + b.length()), "{a} is not {b}");
}

/// 90° across the shorter side of 8 × 4 pixels: the screen is [-2, 2] × [-1, 1] at distance 1, so the pixel centres lie
/// at −2 + (i + ½)/2 and 1 − (j + ½)/2.
#[test]
fn perspective_rays_go_through_the_pixel_centres() {
    let camera = Camera::build(&perspective(90.0), [8, 4]).unwrap();
    assert_near(ray(&camera, 4.0, 2.0).ray.direction, Vec3::Z);
    assert_near(ray(&camera, 0.5, 0.5).ray.direction, Vec3::new(-1.75, 0.75, 1.0).normalize());
    assert_near(ray(&camera, 7.5, 3.5).ray.direction, Vec3::new(1.75, -0.75, 1.0).normalize());
    assert_eq!(ray(&camera, 0.5, 0.5).ray.origin, Vec3::ZERO);
    // The middle of the upper edge is half the angle of view from the axis; so it is at the side of an upright frame.
    assert_near(ray(&camera, 4.0, 0.0).ray.direction, Vec3::new(0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2));
    let upright = Camera::build(&perspective(90.0), [4, 8]).unwrap();
    assert_near(ray(&upright, 4.0, 4.0).ray.direction, Vec3::new(FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2));
    assert_near(ray(&upright, 2.0, 0.0).ray.direction, Vec3::new(0.0, 2.0, 1.0).normalize());
}

#[test]
fn screen_window_and_frame_aspect_ratio_set_the_extent() {
    let window = description::Camera { screen_window: Some([0.0, 0.5, -0.25, 0.75]), ..perspective(90.0) };
    let camera = Camera::build(&window, [8, 4]).unwrap();
    assert_near(ray(&camera, 0.0, 0.0).ray.direction, Vec3::new(0.0, 0.75, 1.0).normalize());
    assert_near(ray(&camera, 8.0, 4.0).ray.direction, Vec3::new(0.5, -0.25, 1.0).normalize());
    // An aspect ratio other than the resolution's stretches the pixels.
    let wide = description::Camera { frame_aspect_ratio: Some(3.0), ..perspective(90.0) };
    let camera = Camera::build(&wide, [8, 8]).unwrap();
    assert_near(ray(&camera, 8.0, 0.0).ray.direction, Vec3::new(3.0, 1.0, 1.0).normalize());
}

#[test]
fn orthographic_rays_are_parallel() {
    let camera = Camera::build(&description(CameraKind::Orthographic), [8, 4]).unwrap();
    for (x, y, origin) in [(0.5, 0.5, Vec3::new(-1.75, 0.75, 0.0)), (8.0, 4.0, Vec3::new(2.0, -1.0, 0.0))] {
        let ray = ray(&camera, x, y);
        assert_near(ray.ray.origin, origin);
        assert_eq!((ray.ray.direction, ray.spread, ray.radius), (Vec3::Z, 0.0, 0.25));
    }
}

#[test]
fn spherical_rays_see_every_direction() {
    let camera = Camera::build(&description(CameraKind::Spherical { equal_area: false }), [8, 4]).unwrap();
    assert_near(ray(&camera, 0.0, 2.0).ray.direction, Vec3::X);
    assert_near(ray(&camera, 2.0, 2.0).ray.direction, Vec3::Z);
    assert_near(ray(&camera, 4.0, 0.0).ray.direction, Vec3::Y);
    assert_near(ray(&camera, 6.0, 3.0).ray.direction, Vec3::new(0.0, -FRAC_1_SQRT_2, -FRAC_1_SQRT_2));
    let camera = Camera::build(&description(CameraKind::Spherical { equal_area: true }), [8, 8]).unwrap();
    assert_near(ray(&camera, 4.0, 4.0).ray.direction, Vec3::Y);
    assert_near(ray(&camera, 8.0, 4.0).ray.direction, Vec3::X);
    assert_near(ray(&camera, 4.0, 8.0).ray.direction, Vec3::Z);
    // Beyond the edge lies the edge's other half: no gap, and no direction that is not unit.
    assert_near(ray(&camera, 8.5, 3.0).ray.direction, ray(&camera, 7.5, 5.0).ray.direction);
}

#[test]
fn the_transform_places_and_turns_the_camera() {
    // Looks along −x from (1, 2, 3) with z up: as pbrt's LookAt 1 2 3  0 2 3  0 0 1.
    let columns = [DVec3::Y, DVec3::Z, DVec3::NEG_X].map(|axis| axis.extend(0.0));
    let matrix = DMat4::from_cols(columns[0], columns[1], columns[2], DVec3::new(1.0, 2.0, 3.0).extend(1.0));
    let camera = description::Camera { world_from_camera: Transform::new(matrix), ..perspective(90.0) };
    let camera = Camera::build(&camera, [8, 4]).unwrap();
    let corner = ray(&camera, 8.0, 0.0);
    assert_near(corner.ray.origin, Vec3::new(1.0, 2.0, 3.0));
    assert_near(corner.ray.direction, Vec3::new(-1.0, 2.0, 1.0).normalize());
}

proptest! {
    /// All rays of one film point meet in one point of the focal plane, wherever they start on the lens.
    #[test]
    fn rays_through_the_lens_meet_in_focus(
        x in 0.0f32..64.0, y in 0.0f32..48.0, u in 0.0f32..1.0, v in 0.0f32..1.0, focus in 0.5f32..50.0,
        orthographic: bool,
    ) {
        let kind = if orthographic { CameraKind::Orthographic } else { CameraKind::Perspective { fov: 40.0 } };
        let pinhole = Camera::build(&perspective(40.0), [64, 48]).unwrap();
        let lens = description::Camera { lens_radius: 0.1, focal_distance: focus, ..description(kind) };
        let camera = Camera::build(&lens, [64, 48]).unwrap();
        let through = camera.ray(Vec2::new(x, y), Vec2::new(u, v)).unwrap().ray;
        prop_assert!(through.origin.length() <= 0.1 * 1.000_001 && through.origin.z == 0.0);
        prop_assert!((through.direction.length() - 1.0).abs() < 1e-6);
        let expected = if orthographic {
            Vec3::new((x / 64.0 * 2.0 - 1.0) * 64.0 / 48.0, 1.0 - y / 48.0 * 2.0, focus)
        } else {
            let direction = ray(&pinhole, x, y).ray.direction;
            direction * (focus / direction.z)
        };
        let met = through.at(focus / through.direction.z);
        prop_assert!((met - expected).length() < 1e-5 * (1.0 + focus), "{met} {expected}");
    }

    /// Every point of a ray projects to the film point that the ray came from.
    #[test]
    fn the_metadata_matrix_undoes_the_camera(
        x in 0.0f32..64.0, y in 0.0f32..48.0, t in 0.5f32..20.0, orthographic: bool,
    ) {
        let kind = if orthographic { CameraKind::Orthographic } else { CameraKind::Perspective { fov: 40.0 } };
        let mut matrix = DMat4::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 1.0) * DMat4::from_scale(DVec3::splat(1.5));
        matrix.w_axis = DVec3::new(3.0, -2.0, 7.0).extend(1.0);
        let camera = description::Camera {
            world_from_camera: Transform::new(matrix), screen_window: Some([-0.5, 2.0, -1.0, 0.75]), ..description(kind)
        };
        let camera = Camera::build(&camera, [64, 48]).unwrap();
        let seen = camera.ndc_from_world().unwrap().project_point3(ray(&camera, x, y).ray.at(t).as_dvec3());
        prop_assert!((seen.x * 64.0 - f64::from(x)).abs() < 1e-2, "{seen}");
        prop_assert!((seen.y * 48.0 - f64::from(y)).abs() < 1e-2, "{seen}");
        prop_assert!(seen.z > 0.0);
    }

    /// The cone is half the side of a square with the pixel's solid angle, measured here by finite differences, under
    /// any linear map of the camera.
    #[test]
    fn the_cone_has_the_solid_angle_of_the_pixel(
        x in 8.0f32..56.0, y in 8.0f32..40.0, stretch in 0.3f64..3.0, shear in -0.5f64..0.5, which in 0usize..3,
        radius in prop_oneof![Just(0.0f32), Just(0.2)],
    ) {
        let kind = [
            CameraKind::Perspective { fov: 60.0 },
            CameraKind::Spherical { equal_area: false },
            CameraKind::Spherical { equal_area: true },
        ][which];
        let mut matrix = DMat4::from_scale(DVec3::new(2.0, 2.0 * stretch, -2.0));
        matrix.x_axis.z = shear;
        let camera = description::Camera {
            world_from_camera: Transform::new(matrix), lens_radius: radius, focal_distance: 3.0, ..description(kind)
        };
        let camera = Camera::build(&camera, [64, 48]).unwrap();
        let lens = Vec2::new(0.2, 0.9);
        let at = |x, y| camera.ray(Vec2::new(x, y), lens).unwrap();
        // Central differences of a tenth of a pixel: relative error O(h²) of the pixel's angle, below 1e-3 here.
        let dx = (at(x + 0.1, y).ray.direction - at(x - 0.1, y).ray.direction) / 0.2;
        let dy = (at(x, y + 0.1).ray.direction - at(x, y - 0.1).ray.direction) / 0.2;
        let solid_angle = dx.cross(dy).length();
        let cone = at(x, y);
        // Not across the folds of the equal-area square: its middle lines, and the lines between their ends.
        let fold = (x - 32.0).abs() / 32.0 + (y - 24.0).abs() / 24.0 - 1.0;
        prop_assume!(solid_angle > 1e-6 && (x - 32.0).abs() > 0.5 && (y - 24.0).abs() > 0.5 && fold.abs() > 0.02);
        let ratio = (2.0 * cone.spread).powi(2) / solid_angle;
        prop_assert!((ratio - 1.0).abs() < 5e-2, "{ratio} {kind:?}");
        prop_assert_eq!(cone.radius, 0.0);
    }
}

#[test]
fn an_orthographic_cone_has_the_width_of_the_pixel_in_the_world() {
    let scale = Transform::new(DMat4::from_scale(DVec3::new(3.0, 3.0, 5.0)));
    let camera = description::Camera { world_from_camera: scale, ..description(CameraKind::Orthographic) };
    let camera = Camera::build(&camera, [10, 10]).unwrap();
    assert!((ray(&camera, 1.0, 1.0).radius - 0.5 * 0.2 * 3.0).abs() < 1e-6);
}

#[test]
fn all_pixels_of_a_spherical_camera_together_cover_the_sphere() {
    for equal_area in [false, true] {
        let camera = Camera::build(&description(CameraKind::Spherical { equal_area }), [64, 32]).unwrap();
        let total: f32 = (0..64 * 32)
            .map(|k| (2.0 * ray(&camera, (k % 64) as f32 + 0.5, (k / 64) as f32 + 0.5).spread).powi(2))
            .sum();
        // The midpoint rule over 32 rows of sinθ is off by π²/(24·32²).
        assert!((total / (4.0 * PI) - 1.0).abs() < 1e-3, "{total}");
    }
}

#[test]
fn what_yields_no_image_is_an_error() {
    let singular = Transform::new(DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0)));
    let mut projective = DMat4::IDENTITY;
    projective.z_axis.w = 1.0;
    let projective = Transform::new(projective);
    let bad = [
        perspective(0.0),
        perspective(180.0),
        perspective(f32::NAN),
        description::Camera { screen_window: Some([1.0, 1.0, -1.0, 1.0]), ..perspective(90.0) },
        description::Camera { frame_aspect_ratio: Some(-1.0), ..perspective(90.0) },
        description::Camera { lens_radius: f32::NAN, ..perspective(90.0) },
        description::Camera { lens_radius: 0.1, focal_distance: 0.0, ..perspective(90.0) },
        description::Camera { world_from_camera: singular, ..perspective(90.0) },
        description::Camera { world_from_camera: projective, ..perspective(90.0) },
    ];
    for camera in bad {
        assert!(Camera::build(&camera, [8, 4]).is_err(), "{camera:?}");
    }
    assert!(Camera::build(&perspective(90.0), [8, 0]).is_err());
}
