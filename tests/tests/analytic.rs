//! Scenes whose one value is known in closed form: the derivation is in each scene's file.
#![allow(clippy::print_stdout, reason = "tests print the figures that they judge")]

use renderer::render::Job;
use renderer::world::Techniques;
use tests::render::{mean_and_error, own_scene, with_variance};

/// As in the furnace test.
const Z: f64 = 4.4;

fn value(scene: &str, techniques: Techniques) -> (f64, f64) {
    let job = Job { scene: own_scene(scene), techniques, ..Job::default() };
    mean_and_error(&with_variance(&job).film)
}

fn check(scene: &str, techniques: Techniques, expected: f64) {
    let (mean, error) = value(scene, techniques);
    println!("{scene} {techniques:?}: {mean:.6} ± {error:.6}, expected {expected:.6}");
    // 2e-5: the film is not a point, see the scenes.
    assert!((mean - expected).abs() <= Z * error + 2e-5 * expected, "{scene}: {mean} ± {error} is not {expected}");
}

#[test]
fn irradiance_of_simple_lights_is_that_of_the_textbook() {
    check("analytic/point-light.pbrt", Techniques::Both, 0.040_743_7);
    for techniques in [Techniques::Both, Techniques::Lights, Techniques::Bsdfs] {
        check("analytic/sphere-light.pbrt", techniques, 0.1125);
        check("analytic/square-light.pbrt", techniques, 1.939_442_5);
    }
}
