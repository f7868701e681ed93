//! What the features of scenes cost: one JSON line each.
//!
//! `bench_features [WIDTHxHEIGHT [SPP]]`
//!
//! Each feature is added to a room of triangles twice: defined but used by nothing, which should cost nothing, and in use.
//! The price is the number of instructions of tracing over that of the room alone. Valgrind counts those of [`counted`], in one
//! process of one thread that renders every variant. Such a count is the same on a busy machine and on every run, as no time
//! is; what it does not see is what a cache misses. Never a test: it only prints.
#![forbid(unsafe_code)]
#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::process::Command;

use renderer::render::{Job, Prepared, Traced, Unobserved, prepare, thread_pool, trace};
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
    let counts = arguments.first().is_some_and(|first| first == RENDER);
    let text = |at: usize, otherwise: &str| {
        arguments.get(at + usize::from(counts)).map_or(otherwise.to_owned(), String::clone)
    };
    let (size, spp) = (text(0, "48x36"), text(1, "16"));
    if counts { render_all(&size, spp.parse()?) } else { tell(&size, &spp) }
}

/// The first argument of the process whose instructions are counted.
const RENDER: &str = "render";

/// Renders the room twice, to see that the count is the same, then with every feature unused and used.
fn render_all(size: &str, spp: u64) -> Result<(), Failure> {
    let (width, height) = size.split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
    let base = room([width.parse()?, height.parse()?], 1.0, 1.0, PLAIN);
    let variant = |feature: &Feature, change: &str| match feature.at {
        WORLD => base.replacen(WORLD, &format!("{WORLD}AttributeBegin\n{change}AttributeEnd\n"), 1),
        at => base.replacen(at, change, 1),
    };
    let mut texts = vec![base.clone(), base.clone()];
    for feature in &FEATURES {
        assert!(base.contains(feature.at), "the room has no {}", feature.at);
        texts.extend([feature.unused, feature.used].map(|change| variant(feature, change)));
    }
    let image = image();
    let pool = thread_pool(1)?;
    for text in texts {
        let scene = SceneFile::new(&text).with("image.ppm", &image);
        let job = Job { scene: scene.path(), spp: Some(spp), seed: Some(1), threads: 1, ..Job::default() };
        pool.install(|| prepare(&job, &Unobserved).map(|prepared| drop(counted(prepared))))?;
    }
    Ok(())
}

/// What is counted: all that happens between a world and a frame.
#[inline(never)]
fn counted(prepared: Prepared) -> Traced {
    trace(prepared, None, None, &Unobserved)
}

/// A square image of 64 × 64 pixels, blue enough to be normals.
fn image() -> Vec<u8> {
    let mut bytes = b"P6\n64 64\n255\n".to_vec();
    bytes.extend((0..64u8).flat_map(|y| (0..64u8).flat_map(move |x| [120 + x / 4, 120 + y / 4, 250])));
    bytes
}

/// Counts what [`render_all`] does, and prints it.
fn tell(size: &str, spp: &str) -> Result<(), Failure> {
    let counts = instructions(size, spp)?;
    if counts.len() != 2 + 2 * FEATURES.len() {
        return Err(format!("valgrind counted {} frames", counts.len()).into());
    }
    let percent = |count: u64| (1e5 * (count as f64 / counts[0] as f64 - 1.0)).round() / 1e3;
    eprintln!("the room takes {} instructions, the same room again {:+.3} %", counts[0], percent(counts[1]));
    for (feature, counts) in FEATURES.iter().zip(counts[2..].chunks_exact(2)) {
        let (unused, used) = (percent(counts[0]), percent(counts[1]));
        println!("{}", serde_json::json!({"feature": feature.name, "unused_percent": unused, "used_percent": used}));
    }
    Ok(())
}

/// Instructions of each call of [`counted`], after which callgrind writes a profile.
fn instructions(size: &str, spp: &str) -> Result<Vec<u64>, Failure> {
    let folder = tempfile::tempdir()?;
    let profile = folder.path().join("profile");
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--toggle-collect=*::counted", "--dump-after=*::counted"])
        .arg(format!("--callgrind-out-file={}", profile.display()))
        .arg(std::env::current_exe()?)
        .args([RENDER, size, spp])
        .output()
        .map_err(|why| format!("cannot run valgrind, which counts instructions: {why}; install it"))?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into());
    }
    // Numbered from 1 in the order of the calls.
    let sections = (1..).map(|call| profile.with_extension(call.to_string())).take_while(|section| section.exists());
    sections.map(|section| Ok(summary(&std::fs::read_to_string(section)?)?.parse()?)).collect()
}

/// The sum that a section of a profile says.
fn summary(section: &str) -> Result<&str, &'static str> {
    section.lines().find_map(|line| line.strip_prefix("summary: ")).ok_or("callgrind's profile has no summary")
}
