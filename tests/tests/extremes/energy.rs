//! Long paths: nothing is gained or lost over ten thousand bounces.

use renderer::filtering::Filtering;
use renderer::render::Job;
use renderer::world::Techniques;
use tests::small::{adaptive, values};

use super::support::{ROUNDING, check_all, check_mean, closed_box, diffuse, frame, job, lamp, pinhole, scene, sky};

/// A closed box that emits 1 and reflects `albedo`, with paths of `depth` scatterings.
fn glowing_box(albedo: f64, depth: u32) -> String {
    let emission = "AreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ] \"bool twosided\" true\n";
    scene([4, 4], depth, &pinhole(80.0), &(diffuse(albedo) + emission + &closed_box(1.0)))
}

#[test]
fn albedo_1_over_10_000_bounces_keeps_energy_to_1e_minus_4() {
    // Without light samples each bounce finds exactly 1: the sum is 1 + 10⁴, in f32 with a rounding per bounce.
    let job = Job { techniques: Techniques::Bsdfs, ..job(4, Filtering::None) };
    let image = values(&frame(&glowing_box(1.0, 10_000), job));
    check_all("10⁴ bounces", &image, 10_001.0, 1e-4);
}

#[test]
fn albedo_1_over_10_000_bounces_with_light_samples() {
    let rendered = frame(&glowing_box(1.0, 10_000), job(4, Filtering::None));
    check_mean("10⁴ bounces, both techniques", &rendered, 10_001.0, 1e-4);
}

#[test]
fn albedo_1_over_10_000_bounces_filtered() {
    let image = values(&frame(&glowing_box(1.0, 10_000), job(4, adaptive())));
    let plain = values(&frame(&glowing_box(1.0, 10_000), job(4, Filtering::None)));
    let ratio = image.mean()[1] / plain.mean()[1];
    println!("filtered: {ratio:.6} of the unfiltered energy");
    // What is stored in 16 bits, first vertex and second.
    assert!((ratio - 1.0).abs() <= 2.0 * 2f64.powi(-15));
}

#[test]
fn albedo_0_shows_emission_alone() {
    for filtering in [Filtering::None, adaptive()] {
        check_all("albedo 0", &values(&frame(&glowing_box(0.0, 10_000), job(4, filtering))), 1.0, 2f64.powi(-15));
    }
}

#[test]
fn albedo_0_999_converges_to_a_thousand() {
    // Roulette ends these paths after a thousand bounces or so: 1/(1 − a).
    check_mean("albedo 0.999", &frame(&glowing_box(0.999, 1_000_000), job(64, Filtering::None)), 1000.0, 1e-4);
}

#[test]
fn depth_0_shows_lights_alone() {
    check_all("depth 0", &values(&frame(&glowing_box(1.0, 0), job(4, Filtering::None))), 1.0, 0.0);
}

#[test]
fn the_largest_depth_ends() {
    check_mean("depth 2³¹ − 1", &frame(&glowing_box(0.5, i32::MAX as u32), job(64, Filtering::None)), 2.0, ROUNDING);
}

#[test]
fn thousands_of_total_reflections_keep_energy() {
    // Within a block of glass of 2 × 10⁴ × 10⁴ that is looked along: thousands of total reflections before the light comes
    // from the sky behind its far end, or after more of them from behind the near one. All of it arrives, times η².
    let glass = "Material \"dielectric\" \"float eta\" 1.5\nScale 1 1e4 1e4\n";
    let camera = format!("LookAt 0 0 0  0.5 0.2 0.8  0 1 0\n{}", pinhole(5.0));
    let text = scene([8, 8], 1_000_000, &camera, &(sky(1.0) + glass + &closed_box(1.0)));
    check_mean("total reflections", &frame(&text, job(16, Filtering::None)), 2.25, 1e-3);
}

#[test]
fn paths_that_nothing_absorbs_end() {
    // Without a rule of their own these would go on for 2³¹ bounces: minutes for each.
    let job = job(1, Filtering::None);
    let mirror = "Material \"conductor\" \"rgb reflectance\" [ 1 1 1 ]\nShape \"sphere\" \"float radius\" 3\n";
    for world in [diffuse(1.0) + &closed_box(1.0), mirror.to_owned()] {
        let image = values(&frame(&scene([2, 1], i32::MAX as u32, &pinhole(80.0), &world), job.clone()));
        assert!(image.pixels.iter().flatten().all(|&x| x == 0.0), "light from nowhere");
    }
}

#[test]
fn paths_that_are_made_to_end_lose_no_light() {
    // A white box of 2³ with a black lamp of a ten thousandth of its surface. Every path ends there, one in five after more
    // bounces than pass without roulette: radiance 1 everywhere.
    let sphere = "Translate 0 0.5 0.5\nShape \"sphere\" \"float radius\" 0.0138\n";
    let within = format!("AttributeBegin\n{}{}{sphere}AttributeEnd\n", diffuse(0.0), lamp(1.0));
    let world = within + &diffuse(1.0) + &closed_box(1.0);
    let text = scene([4, 4], i32::MAX as u32, &pinhole(80.0), &world);
    check_mean("caught", &frame(&text, job(16, Filtering::None)), 1.0, ROUNDING);
}

#[test]
fn a_sphere_of_light_that_is_its_own_mirror_keeps_energy() {
    // A sphere that shines inwards and reflects half: 1 + 1/2 + 1/4 + …, though rounding puts half of its points outside.
    for (radius, centre) in [(1.0, [0.0; 3]), (1.0, [3.0, -700.0, 0.3]), (0.013, [0.3, 0.2, 0.1])] {
        let [x, y, z] = centre;
        let emission = "AreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ] \"bool twosided\" true\n";
        let camera = format!("LookAt {x} {y} {z}  {x} {y} {}  0 1 0\n{}", z + 1.0, pinhole(80.0));
        let world =
            format!("{}{emission}Translate {x} {y} {z}\nShape \"sphere\" \"float radius\" {radius}\n", diffuse(0.5));
        for techniques in [Techniques::Both, Techniques::Lights] {
            let job = Job { techniques, ..job(64, Filtering::None) };
            let rendered = frame(&scene([8, 8], 100, &camera, &world), job);
            check_mean(&format!("radius {radius} at {centre:?}, {techniques:?}"), &rendered, 2.0, ROUNDING);
        }
    }
}
