//! The same scene, seed and samples give the same bits, whoever renders them and in whatever order.

use std::path::Path;

use renderer::film::AovSet;
use renderer::render::{Frame, Job};
use tests::render::{add, own_scene, run};
use tests::shared;

/// Every bit of the image.
fn bits(frame: &Frame) -> Vec<u32> {
    frame.film.image().values.iter().map(|value| value.to_bits()).collect()
}

fn job(scene: &Path, threads: usize) -> Job {
    Job {
        scene: scene.to_owned(),
        spp: Some(6),
        resolution: Some([96, 64]),
        threads,
        aovs: AovSet::all(),
        ..Job::default()
    }
}

fn check(scene: &Path) {
    let one = run(&job(scene, 1));
    for threads in [2, 3, 5] {
        let many = run(&job(scene, threads));
        assert!(bits(&one) == bits(&many), "{}: {threads} threads differ from one", scene.display());
        assert_eq!(one.statistics.counters, many.statistics.counters);
    }
    let again = run(&job(scene, 1));
    assert!(bits(&one) == bits(&again), "{}: a second run differs from the first", scene.display());
}

#[test]
fn coincident_surfaces_look_alike_for_any_number_of_threads() {
    check(&own_scene("determinism/coincident.pbrt"));
}

#[test]
fn scenes_of_others_look_alike_for_any_number_of_threads() {
    for name in ["kitchen", "living-room", "bmw-m6"] {
        if let Some(scene) = shared::scene(name) {
            check(&scene);
        }
    }
}

#[test]
fn a_crop_shows_the_pixels_of_the_whole() {
    let scene = own_scene("determinism/coincident.pbrt");
    let whole = run(&job(&scene, 2));
    let part = run(&Job { pixel_bounds: Some([17, 60, 9, 44]), ..job(&scene, 2) });
    for y in 9..44 {
        for x in 17..60 {
            assert_eq!(whole.film.pixel([x, y]), part.film.pixel([x, y]), "pixel {x}, {y}");
        }
    }
}

#[test]
fn a_sample_range_has_the_samples_of_the_whole() {
    let scene = own_scene("determinism/coincident.pbrt");
    let whole = run(&job(&scene, 2));
    for order in [[0..1, 1..4, 4..6], [4..6, 0..1, 1..4]] {
        let [mut sum, rest @ ..] = order.map(|range| run(&Job { sample_range: Some(range), ..job(&scene, 2) }));
        rest.iter().for_each(|part| add(&mut sum.film, &part.film));
        assert!(bits(&whole) == bits(&sum), "slices do not add up to the whole");
    }
}
