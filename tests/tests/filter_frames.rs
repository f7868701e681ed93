//! Whole frames with the adaptive filter, where the answer is exact: invariances, edge cases, sharpness.
#![allow(clippy::print_stdout, reason = "tests print the figures that they judge")]

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::Vec3;
use renderer::film::Film;
use renderer::filtering::{Filtering, Report};
use renderer::render::{self, Frame, Job, Observer};
use tests::small::{PLAIN, SceneFile, adaptive, average, bits, cavity, chequered, room, values, view};
use tests::synthetic::thorough;

const GLOSSY: &str = "Material \"coateddiffuse\" \"rgb reflectance\" [ 0.2 0.5 0.8 ] \"float roughness\" 0.2\n";

fn job(spp: u64, filtering: Filtering) -> Job {
    Job { spp: Some(spp), seed: Some(3), filtering, ..Job::default() }
}

fn differing(a: &Frame, b: &Frame) -> usize {
    bits(a).iter().zip(bits(b)).filter(|(a, b)| **a != *b).count()
}

/// What the filter counted, without the bytes, which depend on who allocates.
fn counts(frame: &Frame) -> filter::Report {
    match &frame.statistics.filter {
        Some(Report::Adaptive(report)) => filter::Report { bytes: 0, ..*report },
        _ => panic!("the frame is filtered"),
    }
}

#[test]
fn threads_change_no_bit() {
    let scene = SceneFile::new(&room([64, 48], 1.0, 1.0, GLOSSY));
    // Several blocks need more than 2²⁰ paths or 64 samples: the thorough variant has them.
    let (spp, repeats) = if thorough() { (130, 2) } else { (4, 4) };
    let one = scene.render(Job { threads: 1, ..job(spp, adaptive()) });
    let mut runs = 1;
    for _ in 0..repeats {
        for threads in [1, 2, 3, 5, 7, 16] {
            let many = scene.render(Job { threads, ..job(spp, adaptive()) });
            assert_eq!(differing(&one, &many), 0, "{threads} threads differ from one");
            assert_eq!(counts(&one), counts(&many), "{threads} threads count otherwise");
            runs += 1;
        }
    }
    println!("{runs} runs on 1, 2, 3, 5, 7, 16 threads, {spp} spp: same bits, same report");
}

/// Looks at given numbers of samples, and ends the frame at the last if it is to.
struct Looker {
    at: &'static [u64],
    stops: bool,
    looks: AtomicUsize,
}

impl Observer for Looker {
    fn next_look(&self) -> u64 {
        self.at.get(self.looks.load(Ordering::Relaxed)).copied().unwrap_or(u64::MAX)
    }

    fn look(&self, film: &Film, samples: u64) -> bool {
        assert!(film.filtered() && film.pixel([0, 0]).count() == samples && samples == self.next_look());
        self.looks.fetch_add(1, Ordering::Relaxed) + 1 == self.at.len() && self.stops
    }
}

#[test]
fn looks_in_mid_block_change_no_bit() {
    let scene = SceneFile::new(&room([64, 48], 1.0, 1.0, GLOSSY));
    let look = |at: &'static [u64], stops| {
        let looker = Looker { at, stops, looks: AtomicUsize::new(0) };
        let job = Job { scene: scene.path(), ..job(16, adaptive()) };
        let frame = render::render(&job, &looker).unwrap();
        assert_eq!(looker.looks.load(Ordering::Relaxed), at.len());
        frame
    };
    let whole = scene.render(job(16, adaptive()));
    // Blocks are of 4 samples.
    for at in [&[1][..], &[1, 2, 3], &[5, 7, 10]] {
        assert_eq!(differing(&whole, &look(at, false)), 0, "looked at {at:?}");
    }
    for at in [&[2][..], &[1, 7]] {
        let range = 0..at[at.len() - 1];
        let part = scene.render(Job { sample_range: Some(range.clone()), ..job(16, adaptive()) });
        let stopped = look(at, true);
        assert_eq!(stopped.samples.ranges(), std::slice::from_ref(&range));
        assert_eq!(differing(&part, &stopped), 0, "stopped after {range:?}");
    }
}

#[test]
fn scale_by_a_power_of_two_changes_no_bit() {
    let at = |scale: f32| SceneFile::new(&room([64, 48], scale, 1.0, GLOSSY));
    for filtering in [Filtering::None, adaptive()] {
        let one = at(1.0).render(job(8, filtering));
        for exponent in [-20, -1, 1, 20] {
            let other = at(2f32.powi(exponent)).render(job(8, filtering));
            let differ = differing(&one, &other);
            let name = if filtering == Filtering::None { "unfiltered" } else { "filtered" };
            println!("{name}, scaled by 2^{exponent}: {differ} of 3072 pixels differ (bound 0)");
            assert_eq!(differ, 0);
        }
    }
}

#[test]
fn what_is_far_from_everything_leaves_cells_as_they_are() {
    let text = room([64, 48], 1.0, 1.0, GLOSSY);
    let near = SceneFile::new(&text).render(job(8, adaptive()));
    // Behind the camera, where no path sees it: the room is closed.
    let far = |distance: f64| {
        let triangle =
            format!("Shape \"trianglemesh\" \"point3 P\" [ {distance} 0 0  {distance} 1 0  {distance} 0 1 ]\n");
        let frame = SceneFile::new(&(text.clone() + &triangle)).render(job(8, adaptive()));
        (counts(&frame).cells, frame)
    };
    for distance in [1e3, 1e6] {
        let (cells, _) = far(distance);
        println!("a triangle {distance} away: {cells} cells for {} (bound: a tenth)", counts(&near).cells);
        // Shifts of the order of the scene's size may be others, so borders lie elsewhere.
        assert!(10 * cells.abs_diff(counts(&near).cells) <= counts(&near).cells, "{distance}: {cells}");
    }
}

#[test]
fn light_by_a_power_of_two_changes_only_exponents() {
    let at = |light: f32| SceneFile::new(&room([64, 48], 1.0, light, GLOSSY)).render(job(8, adaptive()));
    let one = values(&at(1.0));
    for exponent in [-20, -3, 3, 20] {
        let light = 2f32.powi(exponent);
        let other = values(&at(light));
        let differ = one.pixels.iter().zip(&other.pixels).filter(|(a, b)| a.map(|x| x * light) != **b).count();
        println!("light of 2^{exponent}: {differ} of 3072 pixels differ (bound 0)");
        assert_eq!(differ, 0);
    }
}

/// Pixels that are not finite, and the largest difference from the unfiltered frame over its largest value.
fn compare(name: &str, scene: &SceneFile, spp: u64) -> (usize, f32) {
    let (filtered, plain) =
        (values(&scene.render(job(spp, adaptive()))), values(&scene.render(job(spp, Filtering::None))));
    let wild = filtered.pixels.iter().flatten().filter(|x| !x.is_finite()).count();
    let largest = plain.pixels.iter().flatten().copied().fold(f32::MIN_POSITIVE, f32::max);
    let difference = filtered.pixels.iter().flatten().zip(plain.pixels.iter().flatten());
    let worst = difference.map(|(a, b)| (a - b).abs() / largest).fold(0.0, f32::max);
    let mean = |image: &tests::image::RgbImage| image.mean().iter().sum::<f64>() / 3.0;
    println!(
        "{name}: {wild} values not finite, mean {:.5} of unfiltered {:.5}, largest difference {worst:.2e} of the largest value",
        mean(&filtered),
        mean(&plain)
    );
    (wild, worst)
}

#[test]
fn frames_with_nothing_to_filter_are_the_unfiltered_ones() {
    let pinhole = "Camera \"perspective\" \"float fov\" 60";
    let sky = view([20, 10], pinhole, "LightSource \"infinite\" \"rgb L\" [ 0.3 0.5 0.7 ]\n");
    let black_box = "Material \"diffuse\" \"rgb reflectance\" [ 0.5 0.5 0.5 ]\nShape \"sphere\" \"float radius\" 3\n";
    let dark = view([20, 10], pinhole, black_box);
    let empty = view([20, 10], pinhole, "");
    let lamps = "AreaLightSource \"diffuse\" \"rgb L\" [ 3 3 3 ] \"bool twosided\" true\n\
                 Material \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\nShape \"sphere\" \"float radius\" 3\n";
    let coal = view([20, 10], pinhole, lamps);
    for (name, text) in [("only sky", sky), ("no light", dark), ("no world", empty), ("zero albedo, all lamps", coal)] {
        let (wild, worst) = compare(name, &SceneFile::new(&text), 4);
        // Sums of the unfiltered frame and of the prefix alone are both in double precision.
        assert!(wild == 0 && worst <= 1e-6, "{name}: {wild}, {worst}");
    }
}

#[test]
fn single_pixels_and_single_paths_are_their_own() {
    // One path per cell group: nothing to share with. A packed path is off by 2⁻¹⁵, see the re-sum test.
    for (size, spp) in [([1, 1], 1), ([1, 1], 64), ([2, 1], 1), ([1, 3], 4)] {
        let scene = SceneFile::new(&room(size, 1.0, 1.0, PLAIN));
        let (wild, worst) = compare(&format!("{size:?} pixels, {spp} spp"), &scene, spp);
        assert_eq!(wild, 0);
        assert!(size != [1, 1] || spp > 1 || worst <= 1.0 / 32768.0, "one path is not its own");
    }
}

#[test]
fn cameras_without_distance_work() {
    let ground = "LightSource \"infinite\" \"rgb L\" [ 0.4 0.5 0.6 ]\n\
                  AttributeBegin\nTranslate 0 6 4\nAreaLightSource \"diffuse\" \"rgb L\" [ 20 20 20 ]\n\
                  Shape \"sphere\" \"float radius\" 0.5\nAttributeEnd\n\
                  Material \"diffuse\" \"rgb reflectance\" [ 0.5 0.6 0.7 ]\n";
    let floor =
        |z: f32| format!("{ground}Shape \"bilinearmesh\" \"point3 P\" [ -9 -9 {z} 9 -9 {z} -9 20 {z} 9 20 {z} ]\n");
    let inside = format!("{ground}Shape \"sphere\" \"float radius\" 20\n");
    let pinhole = "Camera \"perspective\" \"float fov\" 60";
    let orthographic = "Camera \"orthographic\" \"float screenwindow\" [ -2 2 -1.5 1.5 ]";
    let scenes = [
        ("orthographic camera", view([64, 48], orthographic, &floor(-1.0))),
        ("camera inside a sphere", view([64, 48], pinhole, &inside)),
        ("camera at 1e-6 of a floor", view([64, 48], pinhole, &floor(-1e-6))),
        ("camera in a floor", view([64, 48], pinhole, &floor(0.0))),
        (
            "camera inside a glowing block",
            room(
                [64, 48],
                1.0,
                1.0,
                &format!("{PLAIN}AreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ] \"bool twosided\" true\n"),
            )
            .replace("LookAt 0 -3.75 1  0 0 1", "LookAt 0.4 -0.3 0.3  0 0 0.4"),
        ),
    ];
    for (name, text) in scenes {
        let scene = SceneFile::new(&text);
        let spp = 16;
        let frame = scene.render(job(spp, adaptive()));
        let (filtered, plain) = (values(&frame), values(&scene.render(job(spp, Filtering::None))));
        let wild = filtered.pixels.iter().flatten().filter(|x| !x.is_finite()).count();
        let (a, b) = (filtered.mean()[1], plain.mean()[1]);
        println!("{name}: {wild} values not finite, energy {:.5} of unfiltered (bound 1 %)", a / b);
        assert_eq!(wild, 0);
        // At 3072 × 16 paths of relative deviation 1 or so the mean itself is uncertain by 0.5 %: twice that.
        assert!((a - b).abs() <= 0.01 * b);
    }
}

#[test]
fn lights_of_any_strength_leave_the_image_finite() {
    // Radiance whose square overflows single precision or vanishes there.
    for light in [1e-36f32, 1e-25, 1e20, 1e30, 1e36] {
        let scene = SceneFile::new(&room([32, 24], 1.0, light, GLOSSY));
        let (wild, _) = compare(&format!("light of {light:e}"), &scene, 8);
        assert_eq!(wild, 0);
        let image = values(&scene.render(job(8, adaptive())));
        let one = values(&SceneFile::new(&room([32, 24], 1.0, 1.0, GLOSSY)).render(job(8, adaptive())));
        let ratio = image.mean()[1] / f64::from(light) / one.mean()[1];
        println!("    brightness over that at 1: {ratio:.6} (bounds 0.99, 1.01)");
        assert!((0.99..=1.01).contains(&ratio));
    }
}

#[test]
fn scenes_far_from_the_origin_are_filtered_alike() {
    // A camera and a room moved by 10^k: vertices are single precision, so the picture itself goes to pieces at last; until
    // then the number of cells and the mean stay.
    let near = SceneFile::new(&room([64, 48], 1.0, 1.0, PLAIN)).render(job(8, adaptive()));
    let cells = |frame: &Frame| counts(frame).cells as f64;
    for k in 0..=4 {
        let by = 10f32.powi(k);
        let camera = "LookAt 0 -3.75 1  0 0 1  0 0 1";
        let moved = format!("LookAt {by} {} {}  {by} {by} {}  0 0 1", by - 3.75, by + 1.0, by + 1.0);
        let text = room([64, 48], 1.0, 1.0, PLAIN);
        assert!(text.contains(camera));
        let text = text.replace(camera, &moved).replace("WorldBegin", &format!("WorldBegin\nTranslate {by} {by} {by}"));
        let far = SceneFile::new(&text).render(job(8, adaptive()));
        let (mean, mean_near) = (values(&far).mean()[1], values(&near).mean()[1]);
        let ratio = cells(&far) / cells(&near);
        println!(
            "moved by 10^{k}: {:.4} of the cells (bound 0.5 %), {:.4} of the mean (bound 2 %)",
            ratio,
            mean / mean_near
        );
        assert!((ratio - 1.0).abs() <= 0.005 && (mean / mean_near - 1.0).abs() <= 0.02);
    }
}

#[test]
fn rendered_textures_keep_their_contrast() {
    // Checks of two and four pixels under an orthographic camera, lit through noise; black ones have no albedo at all.
    // (The texture's own filter leaves nothing of checks of one pixel: those are tested by formula.)
    let camera = "Camera \"orthographic\" \"float screenwindow\" [ -2 2 -1.5 1.5 ]";
    for (checks, dark) in [(32, 0.1), (16, 0.1), (32, 0.0)] {
        let world = format!(
            "AttributeBegin\nTranslate 0 0 4\nAreaLightSource \"diffuse\" \"rgb L\" [ 20 20 20 ]\n\
             Shape \"sphere\" \"float radius\" 1.5\nAttributeEnd\n\
             Texture \"checks\" \"spectrum\" \"checkerboard\" \"float uscale\" {checks} \"float vscale\" {} \
             \"rgb tex1\" [ 0.8 0.8 0.8 ] \"rgb tex2\" [ {dark} {dark} {dark} ]\n\
             Material \"diffuse\" \"texture reflectance\" \"checks\"\n\
             Shape \"bilinearmesh\" \"point3 P\" [ -2 3 -1.5  2 3 -1.5  -2 3 1.5  2 3 1.5 ]\n",
            checks * 3 / 4
        );
        let scene = SceneFile::new(&view([64, 48], camera, &world));
        let period = 64 / checks;
        let contrast = |filtering: Filtering| {
            let images: Vec<_> = (0..8).map(|seed| scene.values(16, seed, filtering)).collect();
            let image = average(&images);
            let (mut sum, mut light) = (0.0, 0.0);
            for (i, pixel) in image.pixels.iter().enumerate() {
                let sign = if (i % 64 / period + i / 64 / period) % 2 == 0 { 1.0 } else { -1.0 };
                sum += sign * f64::from(pixel[1]);
                light += f64::from(pixel[1]);
            }
            (sum / light).abs()
        };
        let (filtered, plain) = (contrast(adaptive()), contrast(Filtering::None));
        println!(
            "checks of {period} pixels, albedo 0.8 and {dark}: contrast {filtered:.4}, unfiltered {plain:.4}, MTF {:.4} \
             (bounds 0.99, 1.01)",
            filtered / plain
        );
        assert!(plain > 0.1, "the checks are not where the pixels are");
        assert!((0.99..=1.01).contains(&(filtered / plain)));
    }
}

#[test]
fn all_small_scenes_render() {
    // What the statistical tests rely on.
    for text in [cavity([32, 24]), chequered([32, 24], 0.1)] {
        let image = values(&SceneFile::new(&text).render(job(4, adaptive())));
        assert!(image.pixels.iter().all(|pixel| Vec3::from_array(*pixel).is_finite()));
        assert!(image.mean()[1] > 0.0);
    }
}
