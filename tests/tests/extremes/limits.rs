//! Parameters at both ends of their range and beyond: a sound frame, or a message at a line.

use renderer::filtering::Filtering;
use tests::small::{SceneFile, values};

use super::support::{
    attempt, check_all, check_mean, diffuse, frame, job, lamp, picture, pinhole, quad, refused, scene, sky, sound,
    survives,
};

/// Numbers that no parameter expects.
const ODD: [&str; 9] = ["0", "-1", "1e-38", "1e-30", "1e-6", "1e6", "1e30", "3e38", "nan"];

/// A sphere in front of the camera.
const BALL: &str = "Translate 0 0 5\nShape \"sphere\" \"float radius\" 2\n";

/// One case for each odd number.
fn with_odd(text: impl Fn(&str) -> String) -> Vec<(&'static str, String)> {
    ODD.iter().map(|&value| (value, sky(1.0) + &text(value))).collect()
}

#[test]
fn quadrics_of_any_radius() {
    for (shape, name) in [
        ("sphere", "radius"),
        ("disk", "radius"),
        ("cylinder", "radius"),
        ("disk", "innerradius"),
        ("sphere", "phimax"),
    ] {
        survives(
            &format!("{shape} {name}"),
            &with_odd(|x| format!("{}Translate 0 0 5\nShape \"{shape}\" \"float {name}\" {x}\n", diffuse(0.5))),
        );
    }
}

#[test]
fn emitting_quadrics_of_any_radius() {
    for shape in ["sphere", "disk", "cylinder"] {
        survives(
            &format!("emitting {shape}"),
            &with_odd(|x| {
                let floor = quad([[-9.0, -1.0, -9.0], [-9.0, -1.0, 9.0], [9.0, -1.0, 9.0], [9.0, -1.0, -9.0]]);
                format!("{}{floor}Translate 0 0 5\n{}Shape \"{shape}\" \"float radius\" {x}\n", diffuse(0.5), lamp(1.0))
            }),
        );
    }
}

#[test]
fn curves_of_any_width_and_form() {
    let curve =
        |points: &str, more: &str| format!("{}Shape \"curve\" \"point3 P\" [ {points} ] {more}\n", diffuse(0.5));
    for kind in ["flat", "cylinder", "ribbon"] {
        let normals = if kind == "ribbon" { "\"normal N\" [ 0 0 1 0 1 0 ]" } else { "" };
        let text = |points: &str, width: &str| {
            curve(points, &format!("\"string type\" \"{kind}\" \"float width\" {width} {normals}"))
        };
        survives(kind, &with_odd(|x| text("-1 0 3 0 1 3 1 -1 3 2 0 3", x)));
        survives(
            kind,
            &[
                ("of one point", sky(1.0) + &text("0 0 3 0 0 3 0 0 3 0 0 3", "0.1")),
                ("straight at the camera", sky(1.0) + &text("0 0 1 0 0 2 0 0 3 0 0 4", "0.1")),
                ("there and back", sky(1.0) + &text("-1 0 3 1 0 3 -1 0 3 1 0 3", "0.1")),
                ("of 1e30", sky(1.0) + &text("-1e30 0 3 0 1e30 3 1 -1 3 2 0 1e30", "0.1")),
            ],
        );
    }
}

#[test]
fn patches_that_collapse_or_cross() {
    let patch = |p: &str| sky(1.0) + &diffuse(0.5) + &format!("Shape \"bilinearmesh\" \"point3 P\" [ {p} ]\n");
    survives(
        "bilinear patch",
        &[
            ("of one point", patch("0 0 3 0 0 3 0 0 3 0 0 3")),
            ("of a line", patch("-1 0 3 1 0 3 -1 0 3 1 0 3")),
            ("of a triangle", patch("-1 0 3 1 0 3 0 1 3 0 1 3")),
            ("crossed", patch("-1 -1 3 1 1 3 -1 1 4 1 -1 4")),
            ("of 1e12", patch("-1e12 0 3 1e12 0 3 -1e12 1e12 3 1e12 1e12 1e12")),
            ("nearly flat", patch("-1 -1 3 1 -1 3 -1 1 3 1 1 3.0000002")),
        ],
    );
}

#[test]
fn subdivision_without_end_is_refused() {
    let mesh = "\"point3 P\" [ -1 -1 3 1 -1 3 0 1 3 0 0 4 ] \"integer indices\" [ 0 1 2 0 3 1 1 3 2 2 3 0 ]";
    for levels in ["-1", "30", "1000", "2147483647"] {
        refused(
            &format!("{levels} levels"),
            &scene([4, 4], 2, &pinhole(60.0), &format!("Shape \"loopsubdiv\" \"integer levels\" {levels} {mesh}\n")),
            &["scene.pbrt:"],
        );
    }
}

#[test]
fn noise_of_any_octaves_ends() {
    for octaves in ["0", "1", "100", "2147483647", "-5"] {
        for class in ["fbm", "wrinkled", "marble"] {
            let kind = if class == "marble" { "spectrum" } else { "float" };
            let used = if class == "marble" {
                "Material \"diffuse\" \"texture reflectance\" \"n\"\n"
            } else {
                "Material \"conductor\" \"texture roughness\" \"n\"\n"
            };
            let world =
                sky(1.0) + &format!("Texture \"n\" \"{kind}\" \"{class}\" \"integer octaves\" {octaves}\n{used}{BALL}");
            survives(&format!("{class} of {octaves} octaves"), &[("", world)]);
        }
    }
}

#[test]
fn procedural_textures_with_odd_numbers() {
    for (class, name) in [("fbm", "roughness"), ("wrinkled", "roughness")] {
        survives(
            class,
            &with_odd(|x| {
                format!(
                    "Texture \"n\" \"float\" \"{class}\" \"float {name}\" {x}\n\
             Material \"conductor\" \"texture roughness\" \"n\"\n{BALL}"
                )
            }),
        );
    }
    survives(
        "marble",
        &with_odd(|x| {
            format!(
                "Texture \"n\" \"spectrum\" \"marble\" \"float scale\" {x} \"float variation\" {x}\nMaterial \"diffuse\" \"texture reflectance\" \"n\"\n{BALL}"
            )
        }),
    );
    survives(
        "dots",
        &with_odd(|x| {
            format!(
                "Texture \"n\" \"spectrum\" \"dots\" \"float uscale\" {x} \"float vdelta\" {x}\n\
             Material \"diffuse\" \"texture reflectance\" \"n\"\n{BALL}"
            )
        }),
    );
    survives(
        "texture space",
        &with_odd(|x| {
            format!(
                "AttributeBegin\nScale {x} {x} {x}\nTexture \"n\" \"float\" \"windy\"\nAttributeEnd\n\
             Material \"conductor\" \"texture roughness\" \"n\"\n{BALL}"
            )
        }),
    );
    survives(
        "bump",
        &with_odd(|x| {
            format!(
                "Texture \"n\" \"float\" \"wrinkled\"\nTexture \"d\" \"float\" \"scale\" \"texture tex\" \"n\" \"float scale\" {x}\n\
             Material \"diffuse\" \"texture displacement\" \"d\"\n{BALL}"
            )
        }),
    );
}

#[test]
fn materials_with_odd_numbers() {
    for (material, name) in [
        ("dielectric", "eta"),
        ("dielectric", "roughness"),
        ("thindielectric", "eta"),
        ("conductor", "roughness"),
        ("coateddiffuse", "eta"),
        ("coateddiffuse", "thickness"),
        ("coateddiffuse", "roughness"),
        ("coateddiffuse", "g"),
        ("coatedconductor", "thickness"),
        ("coatedconductor", "interface.eta"),
        ("coatedconductor", "conductor.roughness"),
        ("diffusetransmission", "scale"),
    ] {
        survives(
            &format!("{material} {name}"),
            &with_odd(|x| format!("Material \"{material}\" \"float {name}\" {x}\n{BALL}")),
        );
    }
    for (material, name) in [
        ("diffuse", "reflectance"),
        ("conductor", "reflectance"),
        ("conductor", "k"),
        ("conductor", "eta"),
        ("coateddiffuse", "reflectance"),
        ("coateddiffuse", "albedo"),
        ("diffusetransmission", "transmittance"),
    ] {
        survives(
            &format!("{material} {name}"),
            &with_odd(|x| format!("Material \"{material}\" \"rgb {name}\" [ {x} {x} {x} ]\n{BALL}")),
        );
    }
}

#[test]
fn albedos_above_1_add_no_energy() {
    for material in ["diffuse", "coateddiffuse"] {
        let text = format!("Material \"{material}\" \"rgb reflectance\" [ 9 9 9 ]\n{BALL}");
        let image = picture(&scene([12, 12], 1000, &pinhole(60.0), &(sky(1.0) + &text)), 16, Filtering::None);
        let most = image.pixels.iter().flatten().copied().fold(0.0, f32::max);
        println!("{material} of albedo 9: at most {most:.5}");
        assert!(most <= 1.0 + 1e-4);
    }
}

#[test]
fn lights_with_odd_numbers() {
    for (light, name) in [
        ("spot", "coneangle"),
        ("spot", "conedeltaangle"),
        ("spot", "scale"),
        ("spot", "power"),
        ("point", "scale"),
        ("point", "power"),
        ("distant", "illuminance"),
        ("infinite", "illuminance"),
        ("infinite", "scale"),
    ] {
        survives(
            &format!("{light} {name}"),
            &with_odd(|x| format!("LightSource \"{light}\" \"float {name}\" {x}\n{}{BALL}", diffuse(0.5))),
        );
    }
    survives("blackbody", &with_odd(|x| format!("LightSource \"point\" \"blackbody I\" {x}\n{}{BALL}", diffuse(0.5))));
    survives(
        "area light power",
        &with_odd(|x| format!("{}AreaLightSource \"diffuse\" \"float power\" {x}\n{BALL}", diffuse(0.5))),
    );
    survives(
        "spot far away",
        &with_odd(|x| {
            format!("LightSource \"spot\" \"point3 from\" [ 0 0 {x} ] \"point3 to\" [ 0 0 5 ]\n{}{BALL}", diffuse(0.5))
        }),
    );
}

#[test]
fn spectra_that_are_odd() {
    survives(
        "spectrum",
        &[
            ("of nothing", "LightSource \"point\" \"spectrum I\" [ ]\n".to_owned() + BALL),
            ("of one wavelength", "LightSource \"point\" \"spectrum I\" [ 500 1 ]\n".to_owned() + BALL),
            ("backwards", "LightSource \"point\" \"spectrum I\" [ 700 1 400 1 ]\n".to_owned() + BALL),
            ("twice the same", "LightSource \"point\" \"spectrum I\" [ 500 1 500 2 ]\n".to_owned() + BALL),
            ("negative", "LightSource \"point\" \"spectrum I\" [ 400 -1 700 -1 ]\n".to_owned() + BALL),
            ("of odd length", "LightSource \"point\" \"spectrum I\" [ 400 1 700 ]\n".to_owned() + BALL),
            ("beyond sight", "LightSource \"point\" \"spectrum I\" [ 1e6 1 1e7 1 ]\n".to_owned() + BALL),
            ("of 1e38", "LightSource \"point\" \"spectrum I\" [ 400 1e38 700 1e38 ]\n".to_owned() + BALL),
            ("unknown", "LightSource \"point\" \"spectrum I\" \"glass-of-wine\"\n".to_owned() + BALL),
        ],
    );
}

/// Changes what stands before the world.
fn options(group: &str, old: &str, new: impl Fn(&str) -> String) {
    for value in ODD {
        let text = scene([6, 6], 4, &pinhole(60.0), &(sky(1.0) + &diffuse(0.5) + BALL)).replace(old, &new(value));
        let file = SceneFile::new(&text);
        match attempt(&file.path(), job(4, Filtering::None)) {
            Ok((frame, _)) => {
                sound(&frame);
                println!("{group} {value}: mean {:.4e}", values(&frame).mean()[1]);
            }
            Err(messages) => {
                println!("{group} {value}: {}", messages.lines().nth(1).unwrap_or(&messages));
                assert!(messages.contains("scene.pbrt:"), "no place in {messages}");
            }
        }
    }
}

#[test]
fn pixel_filters_with_odd_numbers() {
    for (filter, name) in [
        ("box", "xradius"),
        ("triangle", "xradius"),
        ("gaussian", "sigma"),
        ("gaussian", "yradius"),
        ("mitchell", "B"),
        ("mitchell", "xradius"),
        ("sinc", "tau"),
        ("sinc", "xradius"),
    ] {
        options(&format!("{filter} {name}"), "PixelFilter \"box\" \"float xradius\" 0.5 \"float yradius\" 0.5", |x| {
            format!("PixelFilter \"{filter}\" \"float {name}\" {x}")
        });
    }
}

#[test]
fn films_with_odd_numbers() {
    for name in ["iso", "maxcomponentvalue", "whitebalance", "exposuretime"] {
        options(&format!("film {name}"), "Film \"rgb\"", |x| format!("Film \"rgb\" \"float {name}\" {x}"));
    }
    options("crop", "Film \"rgb\"", |x| format!("Film \"rgb\" \"float cropwindow\" [ 0 {x} 0 1 ]"));
}

#[test]
fn cameras_with_odd_numbers() {
    let old = "Camera \"perspective\" \"float fov\" 60";
    for name in ["fov", "lensradius", "focaldistance", "frameaspectratio", "shutterclose"] {
        options(&format!("camera {name}"), old, |x| {
            format!("Camera \"perspective\" \"float lensradius\" 0.1 \"float {name}\" {x}")
                .replace("\"float lensradius\" 0.1 \"float lensradius\"", "\"float lensradius\"")
        });
    }
    options("screen window", old, |x| format!("Camera \"orthographic\" \"float screenwindow\" [ -{x} {x} -1 1 ]"));
    options("camera scale", old, |x| format!("Scale {x} {x} {x}\n{old}"));
    options("camera place", old, |x| format!("LookAt {x} 0 0  0 0 5  0 1 0\n{old}"));
}

#[test]
fn objects_that_double_thirty_times_are_refused() {
    let mut world = "ObjectBegin \"o0\"\nShape \"sphere\"\nObjectEnd\n".to_owned();
    for i in 1..=30 {
        world += &format!(
            "ObjectBegin \"o{i}\"\nObjectInstance \"o{}\"\nTranslate 1 0 0\nObjectInstance \"o{}\"\nObjectEnd\n",
            i - 1,
            i - 1
        );
    }
    refused("2³⁰ spheres", &scene([4, 4], 2, &pinhole(60.0), &(world + "ObjectInstance \"o30\"\n")), &["scene.pbrt:"]);
}

#[test]
fn alpha_at_both_ends() {
    let wall = "Shape \"bilinearmesh\" \"point3 P\" [ -9 -9 1  9 -9 1  -9 9 1  9 9 1 ]";
    for (alpha, expected) in [("0", 1.0), ("1", 0.5), ("2", 0.5), ("-1", 1.0)] {
        let text = scene(
            [6, 6],
            4,
            &pinhole(60.0),
            &(sky(1.0) + &diffuse(0.5) + &format!("{wall} \"float alpha\" {alpha}\n")),
        );
        check_all(&format!("alpha {alpha}"), &picture(&text, 4, Filtering::None), expected, 1e-6);
    }
    // White sheets that are half there, one behind the other, in a white environment: white.
    let sheet = |z: u32| {
        let p = format!("-900 -900 {z}  900 -900 {z}  -900 900 {z}  900 900 {z}");
        format!("Shape \"bilinearmesh\" \"point3 P\" [ {p} ] \"float alpha\" 0.5\n")
    };
    let sheets: String = (1..=100).map(sheet).collect();
    let text = scene([6, 6], 1_000_000, &pinhole(60.0), &(sky(1.0) + &diffuse(1.0) + &sheets));
    check_mean("a hundred sheets", &frame(&text, job(4, Filtering::None)), 1.0, 1e-3);
}

#[test]
fn written_images_of_any_radiance_are_finite() {
    let folder = tempfile::tempdir().unwrap();
    for level in [1e-30, 1e12, 1e30] {
        let world = lamp(level) + &quad([[-1.0, -1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, -1.0, 1.0]]);
        let aovs = renderer::film::AovSet::all();
        let rendered = frame(
            &scene([8, 8], 4, &pinhole(100.0), &world),
            renderer::render::Job { aovs, ..job(4, Filtering::None) },
        );
        let image = rendered.film.image();
        let depth = image.channels.iter().position(|channel| channel.name == "depth.Z").unwrap();
        // Where nothing is, it is infinitely far.
        let wild = image
            .values
            .iter()
            .enumerate()
            .filter(|(i, x)| !x.is_finite() && i % image.channels.len() != depth)
            .count();
        let losses = renderer::film::exr::write(&rendered.film, Vec::new(), &folder.path().join("a.exr")).unwrap();
        let read = tests::image::read_exr(&folder.path().join("a.exr"));
        let largest = read.pixels.iter().flatten().copied().fold(0.0, f32::max);
        println!(
            "radiance {level:e}: {wild} values not finite, largest in the file {largest:e}, {} clamped",
            losses.clamped_half
        );
        assert_eq!(wild, 0);
        assert!(largest.is_finite() && (level < 65504.0) == (losses.clamped_half == 0));
    }
}
