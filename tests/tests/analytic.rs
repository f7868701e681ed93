//! Scenes whose one value is known in closed form: the derivation is in each scene's file.
#![allow(clippy::print_stdout, reason = "tests print the figures that they judge")]

use renderer::film::{Aov, AovSet};
use renderer::render::Job;
use renderer::world::Techniques;
use tests::render::{mean_and_error, own_scene, with_variance};
use tests::small::SceneFile;

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

/// Looks straight down at the origin, through a film so small that it is a point, with `depth` bounces at most.
fn down(from: f32, depth: u32, world: &str) -> String {
    format!(
        "Film \"rgb\" \"integer xresolution\" 4 \"integer yresolution\" 4\n\
         PixelFilter \"box\"\n\
         Integrator \"path\" \"integer maxdepth\" {depth}\n\
         LookAt 0 0 {from}  0 0 0  0 1 0\n\
         Camera \"orthographic\" \"float screenwindow\" [-0.001 0.001 -0.001 0.001]\n\
         WorldBegin\n{world}"
    )
}

fn small(scene: &SceneFile, spp: u64, techniques: Techniques) -> (f64, f64) {
    let job = Job { scene: scene.path(), spp: Some(spp), techniques, ..Job::default() };
    mean_and_error(&with_variance(&job).film)
}

/// Corners of a trapezoid of area 2.4 that the origin is in, in z = 0 and counter-clockwise from above.
const TRAPEZOID: &[u8] =
    b"ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n\
    -1 -1 0\n1 -1 0\n0.2 1 0\n-0.2 1 0\n4 0 1 2 3\n";

#[test]
fn a_power_is_that_of_a_whole_face() {
    // A face that emits 4π from one side has the radiance 4π/(πA). Flat quads are two triangles to the ray query alone.
    for (shape, area) in [
        ("\"disk\" \"float radius\" 1.1283791671", 4.0),
        ("\"bilinearmesh\" \"point3 P\" [-1 -1 0 1 -1 0 -1 1 0 1 1 0]", 4.0),
        ("\"plymesh\" \"string filename\" \"trapezoid.ply\"", 2.4),
        ("\"trianglemesh\" \"point3 P\" [-1 -1 0 1 -1 0 0 1 0]", 2.0),
    ] {
        let world = format!("AreaLightSource \"diffuse\" \"float power\" 12.566370614\nShape {shape}\n");
        let scene = SceneFile::new(&down(5.0, 0, &world)).with("trapezoid.ply", TRAPEZOID);
        let (mean, _) = small(&scene, 1, Techniques::Both);
        assert!((mean * area / 4.0 - 1.0).abs() < 1e-5, "{shape}: {mean} is not {}", 4.0 / area);
    }
}

/// A white floor, a disk of radiance 1 and radius 1 two above it, and between them one of a mix through which one gets in
/// `amount` of all cases, as if nothing were there. It is larger than all: no shadow ray gets past.
fn veiled(amount: f64) -> String {
    format!(
        "Material \"diffuse\" \"rgb reflectance\" [1 1 1]\nShape \"disk\" \"float radius\" 0.5\n\
         AttributeBegin\nMaterial \"diffuse\" \"rgb reflectance\" [0 0 0]\n\
         AreaLightSource \"diffuse\" \"rgb L\" [1 1 1]\nTranslate 0 0 2\nReverseOrientation\n\
         Shape \"disk\"\nAttributeEnd\n\
         MakeNamedMaterial \"nothing\" \"string type\" \"interface\"\n\
         MakeNamedMaterial \"black\" \"string type\" \"diffuse\" \"rgb reflectance\" [0 0 0]\n\
         MakeNamedMaterial \"mix\" \"string type\" \"mix\" \"string materials\" [\"black\" \"nothing\"]\n\
         \"float amount\" {amount}\n\
         NamedMaterial \"mix\"\nTranslate 0 0 1\nShape \"disk\" \"float radius\" 10\n"
    )
}

#[test]
fn light_behind_a_mix_with_nothing_is_as_strong_as_the_mix_lets_it_through() {
    // The floor sends on sin² of half the angle of the light's disk: 1/5.
    for (amount, techniques) in
        [1.0, 0.25].into_iter().flat_map(|a| [Techniques::Both, Techniques::Lights, Techniques::Bsdfs].map(|t| (a, t)))
    {
        let (mean, error) = small(&SceneFile::new(&down(0.5, 5, &veiled(amount))), 1024, techniques);
        println!("{amount} {techniques:?}: {mean:.5} ± {error:.5}");
        assert!((mean - 0.2 * amount).abs() <= Z * error + 1e-5, "{mean} ± {error}");
    }
}

#[test]
fn a_path_without_bounces_sees_through_nothing_and_what_it_has_met() {
    // From above the light, which is seen through the mix from half way.
    let up = down(0.5, 0, &veiled(1.0)).replace("0 0 0.5  0 0 0", "0 0 0.5  0 0 2");
    let (mean, _) = small(&SceneFile::new(&up), 1, Techniques::Both);
    assert_eq!(mean, 1.0, "a light behind an interface");
    let aovs = [Aov::GeometricNormal, Aov::Depth, Aov::Albedo, Aov::DenoiseAlbedo];
    for depth in [0, 5] {
        for (text, depth_seen, n) in [(up.clone(), 1.5, -1.0), (down(0.5, 0, &veiled(1.0)), 0.5, 1.0)] {
            let text = text.replace("\"integer maxdepth\" 0", &format!("\"integer maxdepth\" {depth}"));
            let job = Job { aovs: AovSet::from_iter(aovs), spp: Some(1), ..Job::default() };
            let image = SceneFile::new(&text).render(job).film.image();
            let at = |name: &str| image.values[image.channels.iter().position(|c| c.name == name).unwrap()];
            assert_eq!(at("A"), 1.0, "coverage with {depth} bounces");
            assert!((at("depth.Z") - depth_seen).abs() < 1e-6, "{} with {depth} bounces", at("depth.Z"));
            assert_eq!(at("Ng.Z"), n);
            let albedo = if n > 0.0 { 1.0 } else { 0.0 };
            assert_eq!((at("albedo.R"), at("denoise.albedo.R")), (albedo, albedo), "{depth} bounces");
        }
    }
}

#[test]
fn emitters_with_holes_light_by_what_is_left_of_them() {
    // Of a disk's light half is left. A ray that passes the front of a sphere may still meet its back, which two-sided
    // ones and those turned inside out show: a half, and half of a half.
    let disk = |alpha: &str| format!("ReverseOrientation\nShape \"disk\" {alpha}\n");
    let sphere = |alpha: &str| format!("Shape \"sphere\" {alpha}\n");
    let checks = "\"texture alpha\" \"checks\"";
    let half = "\"float alpha\" 0.5";
    let cases = [
        (disk(""), "false", 0.5),
        (disk(half), "false", 0.25),
        (disk(checks), "false", 0.25),
        (sphere(""), "false", 0.25),
        (sphere(half), "false", 0.125),
        (sphere(half), "true", 0.1875),
        (format!("ReverseOrientation\n{}", sphere(half)), "false", 0.0625),
    ];
    for (shape, two_sided, expected) in cases {
        // The disk is one above the floor, the sphere's centre two.
        let height = if shape.contains("disk") { 1 } else { 2 };
        let world = format!(
            "Texture \"checks\" \"float\" \"checkerboard\" \"float uscale\" 64 \"float vscale\" 64\n\
             Material \"diffuse\" \"rgb reflectance\" [1 1 1]\nShape \"disk\" \"float radius\" 0.5\n\
             Material \"diffuse\" \"rgb reflectance\" [0 0 0]\n\
             AreaLightSource \"diffuse\" \"rgb L\" [1 1 1] \"bool twosided\" {two_sided}\n\
             Translate 0 0 {height}\n{shape}"
        );
        let scene = SceneFile::new(&down(0.5, 1, &world));
        for techniques in [Techniques::Both, Techniques::Lights, Techniques::Bsdfs] {
            let (mean, error) = small(&scene, 4096, techniques);
            println!("{shape}{two_sided} {techniques:?}: {mean:.5} ± {error:.5}, expected {expected}");
            // Of the checks' borders, 64 across, a thousandth may be on one side more than on the other.
            assert!((mean - expected).abs() <= Z * error + 2e-3 * expected, "{shape} {techniques:?}: {mean} ± {error}");
        }
    }
}

#[test]
fn a_mix_by_direction_follows_the_surface_and_not_its_shading() {
    // White where the surface faces up, whatever vertex normals say: under a white sky it is as bright as that.
    let world = "LightSource \"infinite\" \"rgb L\" [1 1 1]\n\
        Texture \"d\" \"spectrum\" \"directionmix\" \"rgb tex1\" [1 1 1] \"rgb tex2\" [0 0 0] \"vector3 dir\" [0 0 1]\n\
        Material \"diffuse\" \"texture reflectance\" \"d\"\n\
        Shape \"trianglemesh\" \"point3 P\" [-1 -1 0 1 -1 0 0 1 0] \"normal N\" [0.8 0 0.6 0.8 0 0.6 0.8 0 0.6]\n";
    let (mean, error) = small(&SceneFile::new(&down(0.5, 1, world)), 64, Techniques::Both);
    assert!((mean - 1.0).abs() <= Z * error + 1e-5, "{mean} ± {error}");
}
