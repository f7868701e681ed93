//! What the features of scenes cost: one JSON line each.
//!
//! `bench_features [WIDTHxHEIGHT [SPP [ROUNDS]]]`
//!
//! Each feature is added to a room of triangles twice: defined but used by nothing, which should cost nothing, and in use.
//! The price is the processor time of tracing over that of the room alone, on one thread; every round renders all variants one
//! after the other, and the median over the rounds of each one's ratio to its own round's room is told, so that a machine that
//! slows down does so for all. Never a test: it only prints.
#![forbid(unsafe_code)]
#![allow(clippy::print_stdout)]

use std::fs;

use renderer::render::{Job, Prepared, Unobserved, prepare, thread_pool, trace};
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
    Feature { name: "auxiliary channels", unused: FILM, used: "Film \"gbuffer\"", at: FILM },
    Feature { name: "clamping", unused: FILM, used: "Film \"rgb\" \"float maxcomponentvalue\" 10", at: FILM },
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
    let text = |at: usize, otherwise: &str| arguments.get(at).map_or(otherwise.to_owned(), String::clone);
    let (size, spp, rounds) = (text(0, "160x120"), text(1, "64"), text(2, "9"));
    let (width, height) = size.split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
    let (size, spp, rounds): ([u32; 2], u64, usize) =
        ([width.parse()?, height.parse()?], spp.parse()?, rounds.parse()?);

    let base = room(size, 1.0, 1.0, PLAIN);
    let variant = |feature: &Feature, change: &str| match feature.at {
        WORLD => base.replacen(WORLD, &format!("{WORLD}AttributeBegin\n{change}AttributeEnd\n"), 1),
        at => base.replacen(at, change, 1),
    };
    let image = image();
    let scene = |text: &str| SceneFile::new(text).with("image.ppm", &image);
    let mut scenes = vec![scene(&base)];
    for feature in &FEATURES {
        assert!(base.contains(feature.at), "the room has no {}", feature.at);
        scenes.extend([feature.unused, feature.used].map(|change| scene(&variant(feature, change))));
    }
    let mut ratios = vec![Vec::new(); scenes.len()];
    for _ in 0..rounds.max(1) {
        // The first of a round would pay for what the last one has left in the caches.
        seconds(&scenes[0], spp)?;
        let seconds = scenes.iter().map(|scene| seconds(scene, spp)).collect::<Result<Vec<f64>, Failure>>()?;
        ratios.iter_mut().zip(&seconds).for_each(|(ratios, x)| ratios.push(x / seconds[0]));
    }
    let price = |of: usize| {
        let mut sorted = ratios[of].clone();
        sorted.sort_unstable_by(f64::total_cmp);
        100.0 * (sorted[sorted.len() / 2] - 1.0)
    };
    for (i, feature) in FEATURES.iter().enumerate() {
        let line = serde_json::json!({
            "feature": feature.name,
            "unused_percent": price(2 * i + 1),
            "used_percent": price(2 * i + 2),
            "rounds": rounds,
        });
        println!("{line}");
    }
    Ok(())
}

/// A square image of 64 × 64 pixels, blue enough to be normals.
fn image() -> Vec<u8> {
    let mut bytes = b"P6\n64 64\n255\n".to_vec();
    bytes.extend((0..64u8).flat_map(|y| (0..64u8).flat_map(move |x| [120 + x / 4, 120 + y / 4, 250])));
    bytes
}

/// Processor time of tracing, of the one thread that does it.
fn seconds(scene: &SceneFile, spp: u64) -> Result<f64, Failure> {
    let job = Job { scene: scene.path(), spp: Some(spp), seed: Some(1), threads: 1, ..Job::default() };
    let traced = || -> Result<f64, Failure> {
        let prepared: Prepared = prepare(&job, &Unobserved)?;
        let start = processor_seconds()?;
        trace(prepared, None, None, &Unobserved).develop();
        Ok(processor_seconds()? - start)
    };
    thread_pool(1)?.install(traced)
}

/// Seconds that the calling thread has run, to the nanosecond.
fn processor_seconds() -> Result<f64, Failure> {
    let text = fs::read_to_string("/proc/thread-self/schedstat")?;
    let nanoseconds: u64 = text.split_whitespace().next().ok_or("an empty schedstat")?.parse()?;
    Ok(nanoseconds as f64 * 1e-9)
}
