//! Glass without difference, with a large one, nested and touching.

use renderer::filtering::Filtering;

use super::support::{
    Z, both, check_all, check_mean, difference, frame, job, lamp, picture, pinhole, quad, scene, sky,
};
use tests::render::mean_and_error;

fn glass(eta: f64, roughness: f64) -> String {
    format!("Material \"dielectric\" \"float eta\" {eta} \"float roughness\" {roughness}\n")
}

/// Smooth glass absorbs nothing: in a white environment it cannot be seen.
fn invisible(name: &str, world: &str) {
    let camera = format!("LookAt 0 0 -4  0 0 0  0 1 0\n{}", pinhole(32.0));
    for (mode, filtering) in both() {
        let rendered = frame(&scene([24, 24], 100_000, &camera, &(sky(1.0) + world)), job(32, filtering));
        check_mean(&format!("{name}, {mode}"), &rendered, 1.0, 1e-4);
    }
}

fn sphere(eta: f64, radius: f64) -> String {
    glass(eta, 0.0) + &format!("Shape \"sphere\" \"float radius\" {radius}\n")
}

#[test]
fn ior_1_is_invisible() {
    invisible("eta 1", &sphere(1.0, 1.0));
}

#[test]
fn ior_1_0001_is_invisible_in_white() {
    invisible("eta 1.0001", &sphere(1.0001, 1.0));
}

#[test]
fn ior_1000_is_invisible_in_white() {
    invisible("eta 1000", &sphere(1000.0, 1.0));
}

#[test]
fn ior_below_1_is_invisible_in_white() {
    invisible("eta 0.1", &sphere(0.1, 1.0));
}

#[test]
fn nested_glass_is_invisible_in_white() {
    invisible("three spheres", &(sphere(1.5, 1.0) + &sphere(1.2, 0.7) + &sphere(2.0, 0.3)));
}

#[test]
fn nested_glass_with_a_common_surface_is_invisible_in_white() {
    invisible("two coincident spheres", &(sphere(1.5, 1.0) + &sphere(1.3, 1.0)));
}

#[test]
fn touching_glass_is_invisible_in_white() {
    let moved = |x: f64, shape: String| format!("AttributeBegin\nTranslate {x} 0 0\n{shape}AttributeEnd\n");
    invisible("two spheres", &(moved(-0.5, sphere(1.5, 0.5)) + &moved(0.5, sphere(1.7, 0.5))));
}

#[test]
fn a_glass_cube_seen_at_a_corner_is_invisible_in_white() {
    // Faces, edges and the corner; rays that are reflected within meet a face at the angle of the first and leave there.
    let cube = glass(1.5, 0.0) + "Rotate 35.26439 1 0 0\nRotate 45 0 1 0\n" + &super::support::closed_box(0.6);
    invisible("a cube", &cube);
}

#[test]
fn slabs_a_millionth_apart_are_invisible_in_white() {
    let slab = |z0: f64, z1: f64, eta: f64| {
        let (half, middle, stretch) = (super::support::closed_box(1.0), 0.5 * (z0 + z1), 0.5 * (z1 - z0));
        format!("AttributeBegin\n{}Translate 0 0 {middle}\nScale 1 1 {stretch}\n{half}AttributeEnd\n", glass(eta, 0.0))
    };
    invisible("two slabs", &(slab(-0.5, 0.0, 1.5) + &slab(1e-6, 0.5, 1.8)));
}

#[test]
fn touching_glass_of_one_interface_is_invisible_in_white() {
    // Faces that coincide are one hit, not two, as in pbrt: where two media touch, the file describes their interface once,
    // with the ratio of the indices.
    let square = |z: f64| quad([[-9.0, -9.0, z], [9.0, -9.0, z], [9.0, 9.0, z], [-9.0, 9.0, z]]);
    let world = glass(1.5, 0.0)
        + &square(-0.5).replace("0 1 2 0 2 3", "0 2 1 0 3 2")
        + &glass(1.8 / 1.5, 0.0)
        + &square(0.0).replace("0 1 2 0 2 3", "0 2 1 0 3 2")
        + &glass(1.8, 0.0)
        + &square(0.5);
    let camera = format!("LookAt 0 0 -4  0 0 0  0 1 0\n{}", pinhole(32.0));
    let rendered = frame(&scene([24, 24], 100_000, &camera, &(sky(1.0) + &world)), job(32, Filtering::None));
    check_mean("three interfaces", &rendered, 1.0, 1e-4);
}

/// Light through a slab of index η with all its inner reflections: (1 − r)/(1 + r) with r = ((η − 1)/(η + 1))².
fn through_a_slab(eta: f64) {
    let square = |z: f64| quad([[-9.0, -9.0, z], [9.0, -9.0, z], [9.0, 9.0, z], [-9.0, 9.0, z]]);
    let mut world = glass(eta, 0.0);
    // Both faces, their normals outwards.
    world += &square(2.0);
    world += &square(1.0).replace("0 1 2 0 2 3", "0 2 1 0 3 2");
    world += "Material \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\n";
    world += &lamp(1.0).replace('\n', " \"bool twosided\" true\n");
    world += &square(3.0);
    let text = scene([8, 8], 100_000, &pinhole(0.1), &world);
    let r = ((eta - 1.0) / (eta + 1.0)).powi(2);
    check_mean(&format!("slab of eta {eta}"), &frame(&text, job(1024, Filtering::None)), (1.0 - r) / (1.0 + r), 1e-4);
}

#[test]
fn a_slab_of_1_5_transmits_what_fresnel_says() {
    through_a_slab(1.5);
}

#[test]
fn a_slab_of_1000_transmits_what_fresnel_says() {
    through_a_slab(1000.0);
}

/// A view with a pattern behind it, seen through `material`.
fn before_a_pattern(material: &str) -> String {
    let mut world =
        "Texture \"checks\" \"spectrum\" \"checkerboard\" \"float uscale\" 7 \"float vscale\" 7\n".to_owned();
    world += &sky(1.0);
    world += "AttributeBegin\nMaterial \"diffuse\" \"texture reflectance\" \"checks\"\n";
    world += "Shape \"bilinearmesh\" \"point3 P\" [ -3 -3 5  3 -3 5  -3 3 5  3 3 5 ]\nAttributeEnd\n";
    if !material.is_empty() {
        world += &format!("{material}Translate 0 0 3\nShape \"sphere\" \"float radius\" 1\n");
    }
    scene([32, 32], 100, &pinhole(40.0), &world)
}

#[test]
fn an_index_matched_interface_changes_nothing() {
    // Another number of bounces takes other random numbers: equal to the noise.
    let without = frame(&before_a_pattern(""), job(64, Filtering::None));
    let (a, ea) = mean_and_error(&without.film);
    for material in [glass(1.0, 0.0), glass(1.0, 0.5)] {
        let (b, eb) = mean_and_error(&frame(&before_a_pattern(&material), job(64, Filtering::None)).film);
        println!("{}: {b:.5} ± {eb:.5}, without it {a:.5} ± {ea:.5}", material.trim());
        assert!((a - b).abs() <= Z * ea.hypot(eb));
    }
}

#[test]
fn an_interface_without_material_changes_no_more_than_rounding() {
    for (mode, filtering) in both() {
        let without = picture(&before_a_pattern(""), 16, filtering);
        let with = picture(&before_a_pattern("Material \"interface\"\n"), 16, filtering);
        let worst = difference(&with, &without);
        println!("interface, {mode}: differs by {worst:.1e}");
        assert!(worst <= 2f64.powi(-14));
    }
}

#[test]
fn a_camera_inside_glass_sees_radiance_compressed() {
    // Radiance over η² is what an interface keeps: 1 outside is 1.5² inside.
    let text = scene([16, 16], 100_000, &pinhole(90.0), &(sky(1.0) + &sphere(1.5, 1.0)));
    check_mean("camera at the centre", &frame(&text, job(32, Filtering::None)), 2.25, 1e-4);
}

#[test]
fn glass_a_millionth_thick_is_still_two_surfaces() {
    let slab = format!("{}Scale 1 1 1e-6\n{}", glass(1.5, 0.0), super::support::closed_box(1.0));
    invisible("a pane of 1e-6", &slab);
}

#[test]
fn thin_glass_is_invisible_in_white() {
    for eta in [1.0, 1.0001, 1.5, 1000.0] {
        let world = format!("Material \"thindielectric\" \"float eta\" {eta}\nShape \"sphere\" \"float radius\" 1\n");
        let camera = format!("LookAt 0 0 -4  0 0 0  0 1 0\n{}", pinhole(32.0));
        let image = picture(&scene([16, 16], 100_000, &camera, &(sky(1.0) + &world)), 16, Filtering::None);
        check_all(&format!("thin eta {eta}"), &image, 1.0, 1e-4);
    }
}

#[test]
fn a_thousand_interfaces_change_nothing_and_end() {
    // Sheets between media, ten in each place, near and far: paths go through them all in a straight line.
    let sheet = |z: f64| {
        let far = 1e4;
        format!(
            "AttributeBegin\nMaterial \"interface\"\n{}AttributeEnd\n",
            quad([[-far, -far, z], [-far, far, z], [far, far, z], [far, -far, z]])
        )
    };
    let sheets: String = (1..=100).map(|i| sheet(0.01 * f64::from(i * i)).repeat(10)).collect();
    let world = |sheets: &str| {
        sky(1.0) + sheets + "Material \"diffuse\"\nTranslate 0 0 9\nShape \"sphere\" \"float radius\" 2\n"
    };
    let image = |sheets: &str| picture(&scene([16, 16], 4, &pinhole(40.0), &world(sheets)), 4, Filtering::None);
    let worst = difference(&image(&sheets), &image(""));
    println!("a thousand interfaces: differs by {worst:.1e}");
    assert!(worst <= 1e-4);
}
