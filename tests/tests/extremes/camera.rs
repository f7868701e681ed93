//! Lenses, fields of view and places of the camera at both ends.

use renderer::filtering::Filtering;

use super::support::{both, check_all, difference, diffuse, lamp, picture, pinhole, quad, refused, scene, sky};

fn white(camera: &str) -> String {
    scene(
        [16, 16],
        100_000,
        camera,
        &(sky(1.0) + &diffuse(1.0) + "Translate 0 0 9\nShape \"sphere\" \"float radius\" 2\n"),
    )
}

fn sees_white(case: &str, camera: &str) {
    for (mode, filtering) in both() {
        check_all(&format!("{case}, {mode}"), &picture(&white(camera), 16, filtering), 1.0, 1e-4);
    }
}

#[test]
fn a_field_of_view_of_1e_minus_6_degrees() {
    sees_white("fov 1e-6", &pinhole(1e-6));
}

#[test]
fn a_field_of_view_of_179_999_degrees() {
    sees_white("fov 179.999", &pinhole(179.999));
}

#[test]
fn fields_of_view_without_image_are_refused() {
    for fov in ["0", "180", "-10", "360", "nan"] {
        refused(
            &format!("fov {fov}"),
            &white(&format!("Camera \"perspective\" \"float fov\" {fov}")),
            &["scene.pbrt:5:"],
        );
    }
}

#[test]
fn a_field_of_view_shows_the_angle_it_says() {
    // A square of half side tan(fov/2) at distance 1 fills the view exactly, of 1.01 times that angle does not.
    for fov in [1e-3, 1.0, 90.0, 175.0] {
        let world = |share: f64| {
            let h = share * (0.5f64 * fov).to_radians().tan();
            lamp(1.0) + &quad([[-h, -h, 1.0], [-h, h, 1.0], [h, h, 1.0], [h, -h, 1.0]])
        };
        let shown =
            |share: f64| picture(&scene([64, 64], 1, &pinhole(fov), &world(share)), 16, Filtering::None).mean()[1];
        let (full, half) = (shown(1.0001), shown(0.5));
        println!("fov {fov}: {full:.5} and {half:.5} of the picture lit");
        assert!(full == 1.0 && (half - 0.25).abs() <= 1e-3);
    }
}

#[test]
fn a_lens_of_1e_minus_30_is_a_pinhole() {
    let world = sky(1.0) + &diffuse(0.5) + "Translate 0 0 9\nShape \"sphere\" \"float radius\" 2\n";
    let with =
        |lens: &str| picture(&scene([24, 24], 4, &format!("{} {lens}", pinhole(40.0)), &world), 16, Filtering::None);
    let worst = difference(&with("\"float lensradius\" 1e-30 \"float focaldistance\" 1"), &with(""));
    println!("lens of 1e-30: differs by {worst:.1e} from a pinhole");
    assert!(worst <= 1e-6);
}

#[test]
fn a_lens_of_1e6() {
    sees_white("lens of 10⁶", &format!("{} \"float lensradius\" 1e6 \"float focaldistance\" 9", pinhole(40.0)));
}

#[test]
fn focal_distances_at_both_ends() {
    for focus in ["1e-6", "1e30"] {
        let lens = format!("{} \"float lensradius\" 0.1 \"float focaldistance\" {focus}", pinhole(40.0));
        sees_white(&format!("focus at {focus}"), &lens);
    }
}

#[test]
fn a_camera_on_a_surface_sees_one_of_its_sides() {
    // In the plane of a lamp, looking along it and away from it: finite, and above it the sky.
    let plane = lamp(5.0) + &quad([[-9.0, 0.0, -9.0], [-9.0, 0.0, 9.0], [9.0, 0.0, 9.0], [9.0, 0.0, -9.0]]);
    for (mode, filtering) in both() {
        let image = picture(&scene([9, 9], 4, &pinhole(60.0), &(sky(1.0) + &plane)), 16, filtering);
        let odd = image.pixels.iter().filter(|pixel| pixel[1] != 1.0 && !(0.0..=5.0).contains(&pixel[1])).count();
        println!("{mode}: {odd} pixels show neither sky nor plane");
        assert_eq!(odd, 0);
    }
}

#[test]
fn an_orthographic_camera_of_1e6_and_1e_minus_6() {
    for half in ["1e6", "1e-6"] {
        let camera = format!("Camera \"orthographic\" \"float screenwindow\" [ -{half} {half} -{half} {half} ]");
        sees_white(&format!("orthographic, half a side of {half}"), &camera);
    }
}

#[test]
fn spherical_cameras_see_all_around() {
    for mapping in ["equalarea", "equirectangular"] {
        sees_white(mapping, &format!("Camera \"spherical\" \"string mapping\" \"{mapping}\""));
    }
}

#[test]
fn a_camera_that_looks_at_itself_is_refused() {
    refused("LookAt one point", &white(&format!("LookAt 1 2 3  1 2 3  0 1 0\n{}", pinhole(40.0))), &["scene.pbrt:5:"]);
    refused("up along the view", &white(&format!("LookAt 0 0 0  0 0 1  0 0 1\n{}", pinhole(40.0))), &["scene.pbrt:5:"]);
}

#[test]
fn a_camera_scaled_by_1e6_and_1e_minus_6_sees_the_same() {
    let world = sky(1.0) + &diffuse(0.5) + "Translate 0 0 9\nShape \"sphere\" \"float radius\" 2\n";
    let scaled = |s: &str| {
        picture(&scene([24, 24], 4, &format!("Scale {s} {s} {s}\n{}", pinhole(40.0)), &world), 16, Filtering::None)
    };
    let one = scaled("1");
    for s in ["1e6", "1e-6"] {
        let worst = difference(&scaled(s), &one);
        println!("camera scaled by {s}: differs by {worst:.1e}");
        assert!(worst <= 1e-4);
    }
}
