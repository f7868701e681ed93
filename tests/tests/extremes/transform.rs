//! Transforms that are singular, mirrored, or of any size.

use renderer::filtering::Filtering;
use tests::render::mean_and_error;
use tests::small::values;

use super::support::{
    Z, attempt, both, check_all, difference, diffuse, frame, job, lamp, picture, pinhole, refused, scene, sky, sound,
};
use tests::small::SceneFile;

const OBJECT: &str = "ObjectBegin \"wedge\"\nShape \"trianglemesh\" \"point3 P\" [ -1 -1 0  1 -1 0  -1 1 0.5  1 1 0.2 ] \
                      \"integer indices\" [ 0 2 1  1 2 3 ]\nObjectEnd\n";

fn instance(transform: &str) -> String {
    let world = sky(0.2)
        + "LightSource \"point\" \"rgb I\" [ 30 30 30 ] \"point3 from\" [ 1 2 0 ]\n"
        + &diffuse(0.5)
        + OBJECT
        + &format!("Translate 0 0 5\n{transform}\nObjectInstance \"wedge\"\n");
    scene([24, 24], 3, &pinhole(50.0), &world)
}

#[test]
fn singular_instances_are_refused() {
    for (case, transform) in [
        ("scale of 0", "Scale 1 0 1"),
        ("a flat matrix", "ConcatTransform [ 1 0 0 0  0 1 0 0  0 1 0 0  0 0 0 1 ]"),
        ("a rotation about nothing", "Rotate 30 0 0 0"),
        ("scale of 1e-40", "Scale 1e-40 1e-40 1e-40"),
        ("scale of 1e38", "Scale 1e38 1e38 1e38\nScale 1e38 1e38 1e38"),
    ] {
        refused(case, &instance(transform), &["scene.pbrt:1"]);
    }
}

#[test]
fn flat_instances_are_lit_or_refused() {
    for axes in ["1 1 F", "1 F 1", "F 1 1", "F F 1", "F F F", "1e20 1 F"] {
        let mut refusals = 0;
        for exponent in 1..=39 {
            let scale = axes.replace('F', &format!("1e-{exponent}"));
            let text = instance(&format!("Scale {scale}\nRotate 40 1 2 3"));
            match attempt(&SceneFile::new(&text).path(), job(4, Filtering::None)) {
                Ok((frame, _)) => sound(&frame),
                Err(messages) => {
                    assert!(messages.contains("scene.pbrt:"), "{messages}");
                    refusals += 1;
                }
            }
        }
        println!("Scale {axes}: {refusals} refused");
    }
}

#[test]
fn singular_shapes_are_refused() {
    for (case, transform) in [
        ("scale of 0", "Scale 1 0 1"),
        ("scale of NaN", "Scale nan 1 1"),
        ("scale of 1e-40", "Scale 1e-30 1e-30 1e-30\nScale 1e-30 1e-30 1e-30"),
    ] {
        let text = scene([8, 8], 3, &pinhole(50.0), &(sky(1.0) + transform + "\nShape \"sphere\"\n"));
        let file = SceneFile::new(&text);
        match attempt(&file.path(), job(4, Filtering::None)) {
            Err(messages) => {
                println!("{case}: {}", messages.lines().nth(1).unwrap_or(""));
                assert!(messages.contains("scene.pbrt:"));
            }
            // Far smaller than anything that a ray could meet, except from its middle, where the camera is.
            Ok((frame, _)) => sound(&frame),
        }
    }
}

#[test]
fn mirrored_instances_are_mirrored_pictures() {
    for (mode, filtering) in both() {
        let direct = |text: String| text.replace("maxdepth\" 3", "maxdepth\" 1").replace(&sky(0.2), "");
        let one = picture(&direct(instance("Rotate 20 1 0 0")), 16, filtering);
        // The same geometry with the vertices mirrored in the object, placed by a mirror. Without the sky and in direct
        // light, which needs no random numbers.
        let object = OBJECT.replace("-1 -1 0  1 -1 0  -1 1 0.5  1 1 0.2", "1 -1 0  -1 -1 0  1 1 0.5  -1 1 0.2");
        let twice = instance("Rotate 20 1 0 0\nScale -1 1 1").replace(OBJECT, &object);
        assert!(twice.contains("1 -1 0  -1 -1 0"));
        let worst = difference(&picture(&direct(twice), 16, filtering), &one);
        println!("mirrored twice, {mode}: differs by {worst:.1e}");
        assert!(worst <= 1e-4);
    }
}

#[test]
fn mirrored_glass_keeps_inside_and_outside() {
    // Of a mesh the mirror turns the winding as well, which is undone: inside is inside. Of a quadric it turns the normal, as
    // in pbrt, unless ReverseOrientation turns it back. The radiance within glass is that outside times η².
    let ball = "ReverseOrientation\nShape \"sphere\" \"float radius\" 1\n".to_owned();
    for (name, shape) in [("box", super::support::closed_box(1.0)), ("sphere, reversed", ball)] {
        let glass = format!("Material \"dielectric\" \"float eta\" 1.5\nScale -1 1 1\n{shape}");
        let text = scene(
            [16, 16],
            100_000,
            "LookAt 0 0 0  0 0 1  0 1 0\nCamera \"perspective\" \"float fov\" 40",
            &(sky(1.0) + &glass),
        );
        let (mean, error) = mean_and_error(&frame(&text, job(16, Filtering::None)).film);
        println!("camera inside a mirrored {name} of glass: {mean:.5} ± {error:.5}, expected 2.25");
        assert!((mean - 2.25).abs() <= Z * error + 1e-4);
    }
}

#[test]
fn instances_scaled_by_1e12_and_back_are_the_object() {
    let one = picture(&instance(""), 16, Filtering::None);
    for s in [1e6, 1e-6, 1e12, 1e-12] {
        let object = format!(
            "ObjectBegin \"wedge\"\nScale {0:e} {0:e} {0:e}\nShape \"trianglemesh\" \"point3 P\" [ -1 -1 0  1 -1 0  -1 1 0.5  1 1 0.2 ] \
             \"integer indices\" [ 0 2 1  1 2 3 ]\nObjectEnd\n",
            s
        );
        let text = instance(&format!("Scale {0:e} {0:e} {0:e}", 1.0 / s)).replace(OBJECT, &object);
        assert!(text.contains(&object));
        let worst = difference(&picture(&text, 16, Filtering::None), &one);
        println!("object scaled by {s:e} and back: differs by {worst:.1e}");
        assert!(worst <= 1e-4);
    }
}

#[test]
fn instances_of_1_to_1e6_keep_their_light() {
    // Stretched by 10⁶ along one axis and seen by an eye that is as well: white in white.
    let world = sky(1.0)
        + &diffuse(1.0)
        + "ObjectBegin \"ball\"\nShape \"sphere\" \"float radius\" 1\nObjectEnd\n\
                 Translate 0 0 5\nRotate 33 1 2 3\nScale 1 1e-6 1\nObjectInstance \"ball\"\n";
    for (mode, filtering) in both() {
        check_all(
            &format!("flattened ball, {mode}"),
            &picture(&scene([24, 24], 100, &pinhole(30.0), &world), 16, filtering),
            1.0,
            1e-4,
        );
    }
}

#[test]
fn a_hundred_transforms_and_their_inverses_are_nothing() {
    let there: String =
        (1..=100).map(|i| format!("Rotate {i} 1 {i} 2\nScale 1.1 0.9 1.2\nTranslate {i} 1 0\n")).collect();
    let back: String = (1..=100)
        .rev()
        .map(|i| format!("Translate -{i} -1 0\nScale {} {} {}\nRotate -{i} 1 {i} 2\n", 1.0 / 1.1, 1.0 / 0.9, 1.0 / 1.2))
        .collect();
    let worst = difference(
        &picture(&instance(&(there + &back)), 16, Filtering::None),
        &picture(&instance(""), 16, Filtering::None),
    );
    println!("100 transforms there and back: differs by {worst:.1e}");
    assert!(worst <= 1e-3);
}

#[test]
fn mirrored_lamps_shine_to_their_own_side() {
    // A disk emits along its normal, which a mirror of z turns around.
    let seen = |transform: &str| {
        let world = format!("Translate 0 0 3\n{transform}\n{}Shape \"disk\" \"float radius\" 9\n", lamp(1.0));
        values(&frame(&scene([8, 8], 1, &pinhole(40.0), &world), job(4, Filtering::None))).mean()[1]
    };
    let (plain, turned, mirrored) = (seen(""), seen("Rotate 180 1 0 0"), seen("Scale 1 1 -1"));
    println!("lamp {plain}, turned {turned}, mirrored {mirrored}");
    assert_eq!(plain + turned, 1.0);
    // As pbrt has it: the normal is transformed and flipped with the handedness, so a mirror leaves the side.
    assert!(mirrored == 0.0 || mirrored == 1.0);
}
