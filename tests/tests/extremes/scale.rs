//! The same scene at other sizes, places and strengths of light.

use renderer::filtering::Filtering;
use tests::render::mean_and_error;
use tests::small::{bits, values};

use super::support::{ROUNDING, Z, both, check_mean, closed_box, diffuse, frame, job, lamp, pinhole, scene, sky};

/// Every kind of shape and light, with a lens; all lengths times `s`, so intensities times s².
fn everything(s: f64) -> String {
    let at = |p: [f64; 3]| format!("{:e} {:e} {:e}", p[0] * s, p[1] * s, p[2] * s);
    let l = |x: f64| format!("{:e}", x * s);
    let camera = format!(
        "LookAt {}  {}  0 0 1\nCamera \"perspective\" \"float fov\" 42 \"float lensradius\" {} \"float focaldistance\" {}",
        at([0.0, -6.0, 3.0]),
        at([0.0, 0.0, 0.5]),
        l(0.05),
        l(6.0)
    );
    let moved = |p: [f64; 3], shape: String| format!("AttributeBegin\nTranslate {}\n{shape}AttributeEnd\n", at(p));
    let mut world = diffuse(0.6);
    world += &format!(
        "Shape \"bilinearmesh\" \"point3 P\" [ {}  {}  {}  {} ]\n",
        at([-3.0, -3.0, 0.0]),
        at([3.0, -3.0, 0.0]),
        at([-3.0, 3.0, 0.0]),
        at([3.0, 3.0, 0.25])
    );
    world += "Material \"coateddiffuse\" \"rgb reflectance\" [ 0.2 0.5 0.8 ] \"float roughness\" 0.2\n";
    world += &moved([-1.5, 0.0, 0.6], format!("Shape \"sphere\" \"float radius\" {}\n", l(0.5)));
    world += "Material \"conductor\" \"float roughness\" 0.1\n";
    world += &moved(
        [0.0, 0.5, 0.5],
        format!(
            "Shape \"cylinder\" \"float radius\" {} \"float zmin\" {} \"float zmax\" {}\n",
            l(0.4),
            l(-0.4),
            l(0.4)
        ),
    );
    world += "Material \"dielectric\" \"float eta\" 1.5\n";
    world += &moved([1.5, -0.5, 0.6], format!("Shape \"sphere\" \"float radius\" {}\n", l(0.5)));
    world += &diffuse(0.3);
    world += &moved([1.5, 1.0, 0.5], format!("Shape \"disk\" \"float radius\" {}\n", l(0.5)));
    world += &format!(
        "Shape \"curve\" \"point3 P\" [ {}  {}  {}  {} ] \"string type\" \"cylinder\" \"float width\" {}\n",
        at([-2.0, -1.0, 0.0]),
        at([-1.0, -1.5, 1.0]),
        at([0.0, -1.0, 0.5]),
        at([0.5, -1.5, 0.5]),
        l(0.1)
    );
    world += &format!(
        "AttributeBegin\nIdentity\nObjectBegin \"tile\"\nShape \"trianglemesh\" \"point3 P\" [ {}  {}  {} ]\nObjectEnd\nAttributeEnd\n",
        at([0.0, 0.0, 0.0]),
        at([1.0, 0.0, 0.0]),
        at([0.0, 1.0, 0.5])
    );
    world += &moved([-1.0, 1.0, 0.5], "Rotate 30 0 0 1\nObjectInstance \"tile\"\n".into());
    let strength = 4.0 * s * s;
    world += &moved(
        [1.0, -2.0, 3.0],
        format!("LightSource \"point\" \"rgb I\" [ {strength:e} {strength:e} {strength:e} ]\n"),
    );
    world += &lamp(5.0);
    world += &moved([-1.0, 0.0, 3.0], format!("Rotate 180 1 0 0\nShape \"disk\" \"float radius\" {}\n", l(0.4)));
    world += &moved([2.0, 2.0, 2.0], format!("Shape \"sphere\" \"float radius\" {}\n", l(0.2)));
    world += &sky(0.1);
    scene([48, 32], 6, &camera, &world)
}

fn bit_identical(exponent: i32) {
    for (name, filtering) in both() {
        let one = bits(&frame(&everything(1.0), job(8, filtering)));
        let other = bits(&frame(&everything(2f64.powi(exponent)), job(8, filtering)));
        let differ = one.iter().zip(&other).filter(|(a, b)| a != b).count();
        println!("{name}, scaled by 2^{exponent}: {differ} of {} pixels differ (bound 0)", one.len());
        assert_eq!(differ, 0);
    }
}

#[test]
fn scale_by_2_to_the_20_changes_no_bit() {
    bit_identical(20);
}

#[test]
fn scale_by_2_to_the_minus_20_changes_no_bit() {
    bit_identical(-20);
}

/// The mean over a frame that is scaled by a number that is no power of two: other roundings, the same picture.
fn same_mean(scale: f64) {
    let (one, error) = mean_and_error(&frame(&everything(1.0), job(16, Filtering::None)).film);
    let (other, other_error) = mean_and_error(&frame(&everything(scale), job(16, Filtering::None)).film);
    println!("scaled by {scale:e}: mean {other:.6} of {one:.6} ± {error:.6}");
    // The same numbers draw nearly the same paths, so this is far on the safe side.
    assert!((one - other).abs() <= Z * error.hypot(other_error));
}

#[test]
fn scale_by_a_million_keeps_the_picture() {
    same_mean(1e6);
}

#[test]
fn scale_by_a_millionth_keeps_the_picture() {
    same_mean(1e-6);
}

/// A closed furnace with its camera, moved by `by` in all coordinates.
fn furnace(by: f64, half: f64) -> String {
    let camera = format!(
        "LookAt {} {} {}  {} {} {}  0 1 0\n{}",
        by + 0.1 * half,
        by + 0.2 * half,
        by - 0.3 * half,
        by + 0.4 * half,
        by + 0.1 * half,
        by + half,
        pinhole(80.0)
    );
    let emission = "AreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ] \"bool twosided\" true\n";
    let world = format!("{}{emission}Translate {by} {by} {by}\n{}", diffuse(0.5), closed_box(half));
    scene([16, 16], 1000, &camera, &world)
}

#[test]
fn a_furnace_far_away_keeps_its_light() {
    // 1 + a + a² + … = 2, without a ray that leaves the box, up to 10⁷ times its half side away.
    for k in 0..=7 {
        let by = 10f64.powi(k);
        check_mean(&format!("moved by 10^{k}"), &frame(&furnace(by, 1.0), job(32, Filtering::None)), 2.0, ROUNDING);
    }
}

#[test]
fn a_furnace_far_away_keeps_its_light_filtered() {
    for k in 0..=7 {
        let image = values(&frame(&furnace(10f64.powi(k), 1.0), job(32, tests::small::adaptive())));
        let mean = image.mean()[1];
        let (_, error) = mean_and_error(&frame(&furnace(1.0, 1.0), job(32, Filtering::None)).film);
        println!("filtered, moved by 10^{k}: mean {mean:.6}, expected 2 ± {error:.6}");
        // A path that is stored in 16 bits is off by 2⁻¹⁵; the filter moves light between pixels, not away.
        assert!((mean - 2.0).abs() <= Z * error + 2.0 * 2f64.powi(-15));
    }
}

#[test]
fn everything_far_away_looks_the_same() {
    // The shapes are given about the origin and moved by a transform: numbers of the file itself have 24 bits.
    let one = frame(&everything(1.0), job(16, Filtering::None));
    let (mean, error) = mean_and_error(&one.film);
    for k in 1..=7 {
        let by = 10f64.powi(k);
        let camera = format!("LookAt {by} {} {}  {by} {by} {}", by - 6.0, by + 3.0, by + 0.5);
        let text = everything(1.0).replace("LookAt 0e0 -6e0 3e0  0e0 0e0 5e-1", &camera);
        let text = text.replace("WorldBegin\n", &format!("WorldBegin\nTranslate {by} {by} {by}\n"));
        assert!(text.contains(&camera));
        let other = frame(&text, job(16, Filtering::None));
        let (moved, _) = mean_and_error(&other.film);
        // Pixels whose paths took other ways: of so many samples some are within rounding of an edge.
        let limit = 0.05 * values(&one).mean()[1] as f32;
        let pairs = values(&one).pixels.into_iter().zip(values(&other).pixels);
        let differ = pairs.filter(|(a, b)| (a[1] - b[1]).abs() > limit).count();
        println!("moved by 10^{k}: mean {moved:.6} of {mean:.6} ± {error:.6}, {differ} of 1536 pixels differ by 5 %");
        assert!((mean - moved).abs() <= Z * error && differ <= 30);
    }
}

#[test]
fn a_straggler_does_not_coarsen_what_is_seen() {
    // The furnace at 10⁷ in a scene that reaches from there to 3 · 10⁷.
    let text = furnace(1e7, 1.0) + "Translate 2e7 2e7 2e7\nShape \"sphere\" \"float radius\" 1\n";
    check_mean("furnace at 10⁷, straggler at 3 · 10⁷", &frame(&text, job(32, Filtering::None)), 2.0, ROUNDING);
}

#[test]
fn positions_and_matrices_are_those_of_the_file() {
    // A floor seen from above at 10⁷, where the renderer measures from another origin than the file.
    let by = 1e7;
    let camera = format!("LookAt {by} {by} {}  {by} {by} {by}  0 1 0\n{}", by + 5.0, pinhole(1e-3));
    let floor = "Shape \"bilinearmesh\" \"point3 P\" [ -9 -9 0  9 -9 0  -9 9 0  9 9 0 ]\n";
    let text = scene([2, 2], 1, &camera, &format!("{}Translate {by} {by} {by}\n{floor}", sky(1.0)));
    let mut aovs = renderer::film::AovSet::default();
    aovs.insert("P");
    let rendered = frame(&text, renderer::render::Job { aovs, ..job(4, Filtering::None) });
    let sum = rendered.film.layer(renderer::film::Layer::Position, [1, 1]).expect("positions were asked for");
    let p = sum / rendered.film.pixel([1, 1]).hits() as f64;
    let eye = rendered.description.camera_from_world.project_point3(glam::DVec3::new(by, by, by + 5.0));
    let ndc = rendered.description.ndc_from_world.expect("a perspective").project_point3(glam::DVec3::splat(by));
    println!("first hit at {p}, the eye in its own space at {eye}, the target on the screen at {ndc}");
    // The view is 10⁻⁴ wide; matrices of numbers of 10⁷ in f64 are off by 10⁻⁹.
    assert!((p - glam::DVec3::splat(by)).length() <= 1e-3);
    assert!(eye.length() <= 1e-6);
    // A pixel is 10⁻⁵ of the distance and the camera's place is rounded to f32 from where the world begins.
    assert!((ndc.truncate() - glam::DVec2::splat(0.5)).length() <= 0.1);
}

#[test]
fn the_published_filter_far_away_keeps_the_light() {
    for k in [0, 4, 7] {
        let image = values(&frame(&furnace(10f64.powi(k), 1.0), job(32, super::support::talk())));
        let mean = image.mean()[1];
        println!("talk, moved by 10^{k}: mean {mean:.6}, expected 2");
        // As unfiltered, see above: 8192 paths whose sum deviates by about 1.
        assert!((mean - 2.0).abs() <= Z / 8192f64.sqrt());
    }
}
