//! What the cases share: small scenes as text, their frames, and what is said of them.

use std::path::Path;
use std::sync::Mutex;

use renderer::film::{Aov, AovSet};
use renderer::filtering::Filtering;
use renderer::render::{Frame, Job, Observer, render};
use renderer::scene::Diagnostic;
use tests::image::RgbImage;
use tests::render::{describe, mean_and_error};
use tests::small::{SceneFile, adaptive, values};

/// 4.4 standard errors: a correct renderer fails one such check in 10⁵, and the seed is fixed.
pub const Z: f64 = 4.4;

/// Rounding of a path of some tens of factors, each of a few operations: 10² · 2⁻²⁴, with room.
pub const ROUNDING: f64 = 2e-5;

/// Both ways to make a frame: with every pixel by itself, and with the filter of the defaults.
pub fn both() -> [(&'static str, Filtering); 2] {
    [("unfiltered", Filtering::None), ("filtered", adaptive())]
}

/// The filter as published, which must hold at the extremes as well.
pub fn talk() -> Filtering {
    Filtering::Talk(filter::talk::Params::default(), renderer::filtering::Selection::default())
}

/// A scene of which the size, the depth of paths and what stands before and in the world are given.
pub fn scene(size: [u32; 2], depth: u32, camera: &str, world: &str) -> String {
    format!(
        "Film \"rgb\" \"integer xresolution\" {} \"integer yresolution\" {}\n\
         PixelFilter \"box\" \"float xradius\" 0.5 \"float yradius\" 0.5\n\
         Sampler \"sobol\" \"integer pixelsamples\" 16\n\
         Integrator \"path\" \"integer maxdepth\" {depth}\n{camera}\nWorldBegin\n{world}\n",
        size[0], size[1]
    )
}

/// An environment of radiance 1, or what `level` says.
pub fn sky(level: f64) -> String {
    format!("LightSource \"infinite\" \"rgb L\" [ {level:e} {level:e} {level:e} ]\n")
}

/// A diffuse material.
pub fn diffuse(albedo: f64) -> String {
    format!("Material \"diffuse\" \"rgb reflectance\" [ {albedo} {albedo} {albedo} ]\n")
}

/// Emission of the shapes that follow.
pub fn lamp(level: f64) -> String {
    format!("AreaLightSource \"diffuse\" \"rgb L\" [ {level:e} {level:e} {level:e} ]\n")
}

/// A quadrilateral of four corners in order, facing (b − a) × (c − a).
pub fn quad(corners: [[f64; 3]; 4]) -> String {
    let p: Vec<String> = corners.iter().flatten().map(|x| format!("{x:e}")).collect();
    format!("Shape \"trianglemesh\" \"point3 P\" [ {} ] \"integer indices\" [ 0 1 2 0 2 3 ]\n", p.join(" "))
}

/// A closed box around the origin with sides of 2 · `half`, its normals outwards.
pub fn closed_box(half: f64) -> String {
    let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { half } else { -half });
    let p: Vec<String> = (0..8).flat_map(corner).map(|x| x.to_string()).collect();
    format!(
        "Shape \"trianglemesh\" \"point3 P\" [ {} ] \"integer indices\" [ 0 2 1  1 2 3   4 5 6  5 7 6   0 1 4  1 5 4   \
         2 6 3  3 6 7   0 4 2  2 4 6   1 3 5  3 7 5 ]\n",
        p.join(" ")
    )
}

/// A pinhole at the origin that looks along +z with y up.
pub fn pinhole(fov: f64) -> String {
    format!("Camera \"perspective\" \"float fov\" {fov}")
}

/// A size that `ci/test-extremes` sets, or a small one.
pub fn size(variable: &str, otherwise: u32) -> u32 {
    std::env::var(variable).ok().and_then(|size| size.parse().ok()).unwrap_or(otherwise)
}

/// A job of `spp` samples with one seed, and with variances, by which means are judged.
pub fn job(spp: u64, filtering: Filtering) -> Job {
    let aovs = AovSet::from_iter([Aov::Variance]);
    Job { spp: Some(spp), seed: Some(3), filtering, aovs, ..Job::default() }
}

/// Hears what is said.
#[derive(Default)]
struct Listener(Mutex<Vec<String>>);

impl Observer for Listener {
    fn warning(&self, warning: &Diagnostic) {
        self.0.lock().unwrap().push(warning.to_string());
    }
}

/// The frame with its warnings, or all messages of what keeps it from being one.
pub fn attempt(path: &Path, job: Job) -> Result<(Frame, Vec<String>), String> {
    let listener = Listener::default();
    let frame = render(&Job { scene: path.to_owned(), ..job }, &listener).map_err(|error| describe(&error))?;
    Ok((frame, listener.0.into_inner().unwrap()))
}

/// A frame that is as it must be: every value finite, no sample rejected.
///
/// # Panics
/// If it is not, or cannot be rendered.
pub fn frame(text: &str, job: Job) -> Frame {
    let file = SceneFile::new(text);
    let (frame, _) = attempt(&file.path(), job).unwrap_or_else(|messages| panic!("{messages}"));
    sound(&frame);
    frame
}

/// # Panics
/// If a value is not finite or a sample was rejected.
pub fn sound(frame: &Frame) {
    let wild = values(frame).pixels.iter().flatten().filter(|x| !x.is_finite()).count();
    assert_eq!(wild, 0, "values that are not finite");
    assert_eq!(frame.statistics.counters.rejected_samples, 0, "rejected samples");
}

/// As [`frame`], the picture alone.
pub fn picture(text: &str, spp: u64, filtering: Filtering) -> RgbImage {
    values(&frame(text, job(spp, filtering)))
}

/// Says and checks that the mean over an unfiltered frame is `expected`, to its standard error and `rounding`.
///
/// # Panics
/// If it is not.
pub fn check_mean(case: &str, frame: &Frame, expected: f64, rounding: f64) {
    let (mean, error) = mean_and_error(&frame.film);
    println!("{case}: mean {mean:.6e} ± {error:.1e}, expected {expected:.6e}");
    assert!(
        (mean - expected).abs() <= Z * error + rounding * expected.abs(),
        "{case}: {mean} ± {error} is not {expected}"
    );
}

/// Checks that all values are `expected` to a relative `bound`.
///
/// # Panics
/// If they are not.
pub fn check_all(case: &str, image: &RgbImage, expected: f64, bound: f64) {
    let worst = image.pixels.iter().flatten().map(|&x| (f64::from(x) / expected - 1.0).abs()).fold(0.0, f64::max);
    println!("{case}: all {} values are {expected:e} to {worst:.1e} (bound {bound:.0e})", 3 * image.pixels.len());
    assert!(worst <= bound, "{case}: off by {worst}");
}

/// The largest difference over the largest value.
pub fn difference(a: &RgbImage, b: &RgbImage) -> f64 {
    let largest = b.pixels.iter().flatten().copied().fold(f32::MIN_POSITIVE, f32::max);
    let differences = a.pixels.iter().flatten().zip(b.pixels.iter().flatten()).map(|(a, b)| (a - b).abs() / largest);
    f64::from(differences.fold(0.0, f32::max))
}

/// Checks that the scene is refused, with a message that holds all of `parts`: the place and what is wrong there.
///
/// # Panics
/// If it renders, or says something else.
pub fn refused(case: &str, text: &str, parts: &[&str]) {
    let file = SceneFile::new(text);
    refused_file(case, &file.path(), job(1, Filtering::None), parts);
}

/// As [`refused`], of a job for a file.
///
/// # Panics
/// As [`refused`].
pub fn refused_file(case: &str, path: &Path, job: Job, parts: &[&str]) {
    let messages = attempt(path, job).err().unwrap_or_else(|| panic!("{case}: rendered"));
    println!("{case}: {}", messages.lines().nth(1).unwrap_or(&messages));
    for part in parts {
        assert!(messages.contains(part), "{case}: no \"{part}\" in\n{messages}");
    }
}

/// Checks that the scene renders with a warning that holds `part`; the frame.
///
/// # Panics
/// If it does not, or is silent.
pub fn warned(case: &str, text: &str, part: &str) -> Frame {
    let file = SceneFile::new(text);
    let (frame, warnings) =
        attempt(&file.path(), job(4, Filtering::None)).unwrap_or_else(|messages| panic!("{messages}"));
    sound(&frame);
    println!("{case}: {}", warnings.first().map_or("no warning", |warning| warning.lines().next().unwrap_or("")));
    assert!(warnings.iter().any(|warning| warning.contains(part)), "{case}: no \"{part}\" in {warnings:?}");
    frame
}

/// Checks that each of `cases` is a sound frame or refused at a line of its file. Prints which.
///
/// # Panics
/// If it is neither.
pub fn survives(group: &str, cases: &[(&str, String)]) {
    for ((case, world), (mode, filtering)) in cases.iter().flat_map(|case| both().map(|mode| (case, mode))) {
        let file = SceneFile::new(&scene([6, 6], 8, &pinhole(60.0), world));
        match attempt(&file.path(), job(4, filtering)) {
            Ok((frame, warnings)) => {
                sound(&frame);
                let said = warnings.first().and_then(|text| text.lines().next()).unwrap_or("");
                println!("{group}, {case}, {mode}: mean {:.4e} {said}", values(&frame).mean()[1]);
            }
            Err(messages) => {
                println!("{group}, {case}: {}", messages.lines().nth(1).unwrap_or(&messages));
                assert!(messages.contains("scene.pbrt:"), "{group}, {case}: no place in {messages}");
            }
        }
    }
}
