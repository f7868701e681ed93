//! What the features of scenes cost: one JSON line each.
//!
//! `bench_features [WIDTHxHEIGHT [SPP]]`
//!
//! Each feature is added to a room of triangles twice: defined but used by nothing, which should cost nothing, and in use.
//! The price is the number of instructions of tracing `SPP` samples of each pixel over that of the room alone. Valgrind counts
//! them in a process of one thread, with `SPP` samples and with twice as many: what they differ by is tracing alone. Such a
//! count is the same on a busy machine and on every run, as no time is; what it does not see is what a cache misses. Never a
//! test: it only prints.
#![forbid(unsafe_code)]
#![allow(clippy::print_stdout)]

use std::path::PathBuf;
use std::process::Command;

use renderer::render::{Job, Unobserved, prepare, thread_pool, trace};
use tests::small::{PLAIN, SceneFile, room};

/// A change of the room's text.
struct Feature {
    name: &'static str,
    /// Defined, used by nothing.
    unused: &'static str,
    /// In use.
    used: &'static str,
    /// Where: what they stand in for, or, of [`WORLD`], follow.
    at: &'static str,
}

const WORLD: &str = "WorldBegin\n";
const BLOCK: &str = PLAIN;
const CAMERA: &str = "\"float fov\" 40";
const FILM: &str = "Film \"rgb\"";
const INTEGRATOR: &str = "Integrator \"path\"";

const CHECKS: &str = "Texture \"t\" \"spectrum\" \"checkerboard\" \"rgb tex1\" [ 0.6 0.6 0.7 ] \"rgb tex2\" [ 0.6 0.6 0.71 ]\n\
                      Material \"diffuse\" \"rgb reflectance\" [ 0.6 0.6 0.7 ]\n";
const CHECKED: &str = "Texture \"t\" \"spectrum\" \"checkerboard\" \"rgb tex1\" [ 0.6 0.6 0.7 ] \"rgb tex2\" [ 0.6 0.6 0.71 ]\n\
                       Material \"diffuse\" \"texture reflectance\" \"t\"\n";

const FEATURES: [Feature; 17] = [
    Feature {
        name: "instances",
        unused: "ObjectBegin \"o\"\nShape \"trianglemesh\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 ]\nObjectEnd\n",
        used: "ObjectBegin \"o\"\nShape \"trianglemesh\" \"point3 P\" [ 0 0 0 0.1 0 0 0 0.1 0 ]\nObjectEnd\n\
               Translate 0 0 1\nObjectInstance \"o\"\n",
        at: WORLD,
    },
    Feature {
        name: "alpha masks",
        unused: "Shape \"trianglemesh\" \"point3 P\" [ 0 0 1 0.1 0 1 0 0.1 1 ] \"float alpha\" 0\n",
        used: "Shape \"trianglemesh\" \"point3 P\" [ 0 0 1 0.1 0 1 0 0.1 1 ] \"float alpha\" 0.5\n",
        at: WORLD,
    },
    Feature {
        name: "quadrics",
        unused: "ObjectBegin \"o\"\nShape \"sphere\"\nObjectEnd\n",
        used: "Translate 0 0 1\nShape \"sphere\" \"float radius\" 0.1\n",
        at: WORLD,
    },
    Feature {
        name: "curves",
        unused: "ObjectBegin \"o\"\nShape \"curve\" \"point3 P\" [ 0 0 0 0 0 1 0 1 1 1 1 1 ]\nObjectEnd\n",
        used: "Shape \"curve\" \"point3 P\" [ 0 0 1 0 0 1.1 0 0.1 1.1 0.1 0.1 1.1 ] \"float width\" 0.02\n",
        at: WORLD,
    },
    Feature { name: "procedural textures", unused: CHECKS, used: CHECKED, at: BLOCK },
    Feature {
        name: "image textures",
        unused: "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"image.ppm\"\n\
                 Material \"diffuse\" \"rgb reflectance\" [ 0.6 0.6 0.7 ]\n",
        used: "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"image.ppm\"\n\
               Material \"diffuse\" \"texture reflectance\" \"t\"\n",
        at: BLOCK,
    },
    Feature {
        name: "normal maps",
        unused: "Material \"diffuse\" \"string normalmap\" \"image.ppm\"\n\
                 Material \"diffuse\" \"rgb reflectance\" [ 0.6 0.6 0.7 ]\n",
        used: "Material \"diffuse\" \"rgb reflectance\" [ 0.6 0.6 0.7 ] \"string normalmap\" \"image.ppm\"\n",
        at: BLOCK,
    },
    Feature {
        name: "bump maps",
        unused: "Texture \"d\" \"float\" \"wrinkled\"\nMaterial \"diffuse\" \"texture displacement\" \"d\"\n\
                 Material \"diffuse\" \"rgb reflectance\" [ 0.6 0.6 0.7 ]\n",
        used: "Texture \"d\" \"float\" \"wrinkled\"\nMaterial \"diffuse\" \"rgb reflectance\" [ 0.6 0.6 0.7 ] \
               \"texture displacement\" \"d\"\n",
        at: BLOCK,
    },
    Feature {
        name: "coats",
        unused: "Material \"coateddiffuse\"\nMaterial \"diffuse\" \"rgb reflectance\" [ 0.6 0.6 0.7 ]\n",
        used: "Material \"coateddiffuse\" \"rgb reflectance\" [ 0.6 0.6 0.7 ] \"float roughness\" 0.1\n",
        at: BLOCK,
    },
    Feature {
        name: "several lights",
        unused: "LightSource \"infinite\" \"rgb L\" [ 0 0 0 ]\n",
        used: "LightSource \"infinite\" \"rgb L\" [ 0.1 0.1 0.1 ]\n",
        at: WORLD,
    },
    Feature {
        name: "image environment",
        unused: "LightSource \"infinite\" \"rgb L\" [ 0 0 0 ]\n",
        used: "LightSource \"infinite\" \"string filename\" \"image.ppm\" \"float scale\" 0.1\n",
        at: WORLD,
    },
    Feature {
        name: "bilinear patches",
        unused: "ObjectBegin \"o\"\nShape \"bilinearmesh\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 1 1 0 ]\nObjectEnd\n",
        used: "Shape \"bilinearmesh\" \"point3 P\" [ 0 0 1 0.1 0 1 0 0.1 1 0.1 0.1 1.1 ]\n",
        at: WORLD,
    },
    // Nothing defines them but their use.
    Feature { name: "auxiliary channels", unused: FILM, used: "Film \"gbuffer\"", at: FILM },
    Feature {
        name: "clamping",
        unused: "Film \"rgb\" \"float maxcomponentvalue\" 1e30",
        used: "Film \"rgb\" \"float maxcomponentvalue\" 10",
        at: FILM,
    },
    Feature {
        name: "regularisation",
        unused: "Integrator \"path\" \"bool regularize\" false",
        used: "Integrator \"path\" \"bool regularize\" true",
        at: INTEGRATOR,
    },
    Feature {
        name: "depth of field",
        unused: "\"float fov\" 40 \"float lensradius\" 0",
        used: "\"float fov\" 40 \"float lensradius\" 0.02 \"float focaldistance\" 4",
        at: CAMERA,
    },
    Feature {
        name: "participating media",
        unused: "MakeNamedMedium \"m\" \"string type\" \"homogeneous\"\n",
        used: "MakeNamedMedium \"m\" \"string type\" \"homogeneous\"\nMediumInterface \"m\" \"\"\nMaterial \"interface\"\n\
               Shape \"trianglemesh\" \"point3 P\" [ 0 0 1 0.1 0 1 0 0.1 1 ]\n",
        at: WORLD,
    },
];

type Failure = Box<dyn std::error::Error + Send + Sync>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [first, scene, spp] = &arguments[..] {
        if first == TRACE {
            return trace_alone(scene.into(), spp.parse()?);
        }
    }
    let text = |at: usize, otherwise: &str| arguments.get(at).map_or(otherwise.to_owned(), String::clone);
    let (size, spp) = (text(0, "32x24"), text(1, "16").parse()?);
    let (width, height) = size.split_once('x').ok_or("the size is WIDTHxHEIGHT")?;

    let base = room([width.parse()?, height.parse()?], 1.0, 1.0, PLAIN);
    let variant = |feature: &Feature, change: &str| match feature.at {
        WORLD => base.replacen(WORLD, &format!("{WORLD}AttributeBegin\n{change}AttributeEnd\n"), 1),
        at => base.replacen(at, change, 1),
    };
    let image = image();
    let count = |text: &str| instructions(&SceneFile::new(text).with("image.ppm", &image), spp);
    let room = count(&base)? as f64;
    for feature in &FEATURES {
        assert!(base.contains(feature.at), "the room has no {}", feature.at);
        let price = |change: &str| -> Result<f64, Failure> {
            let percent = 100.0 * (count(&variant(feature, change))? as f64 / room - 1.0);
            Ok((percent * 1000.0).round() / 1000.0)
        };
        let (unused, used) = (price(feature.unused)?, price(feature.used)?);
        println!("{}", serde_json::json!({"feature": feature.name, "unused_percent": unused, "used_percent": used}));
    }
    Ok(())
}

/// A square image of 64 × 64 pixels, blue enough to be normals.
fn image() -> Vec<u8> {
    let mut bytes = b"P6\n64 64\n255\n".to_vec();
    bytes.extend((0..64u8).flat_map(|y| (0..64u8).flat_map(move |x| [120 + x / 4, 120 + y / 4, 250])));
    bytes
}

/// The first argument of the process whose instructions are counted.
const TRACE: &str = "trace";

/// Traces `spp` samples of each pixel of a scene on one thread.
fn trace_alone(scene: PathBuf, spp: u64) -> Result<(), Failure> {
    let job = Job { scene, spp: Some(spp), seed: Some(1), threads: 1, ..Job::default() };
    thread_pool(1)?.install(|| -> Result<(), Failure> {
        trace(prepare(&job, &Unobserved)?, None, None, &Unobserved).develop();
        Ok(())
    })
}

/// Instructions of tracing `spp` samples of each pixel.
fn instructions(scene: &SceneFile, spp: u64) -> Result<u64, Failure> {
    let (once, twice) = (process_instructions(scene, spp)?, process_instructions(scene, 2 * spp)?);
    twice.checked_sub(once).ok_or_else(|| "more samples took fewer instructions".into())
}

/// Instructions of a process that does nothing else.
fn process_instructions(scene: &SceneFile, spp: u64) -> Result<u64, Failure> {
    let output = Command::new("valgrind")
        .args(["--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"])
        .args([std::env::current_exe()?, TRACE.into(), scene.path(), spp.to_string().into()])
        .output()
        .map_err(|why| format!("cannot run valgrind, which counts instructions: {why}; install it"))?;
    let said = String::from_utf8_lossy(&output.stderr);
    let count = said.lines().find_map(|line| line.split_once("I refs:").or(line.split_once("I   refs:")));
    let (_, count) =
        count.filter(|_| output.status.success()).ok_or_else(|| format!("valgrind counted nothing:\n{said}"))?;
    Ok(count.replace(',', "").trim().parse()?)
}
