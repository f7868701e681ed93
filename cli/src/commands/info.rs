//! `tessera info`: what a scene contains and what it takes to render it.

use std::fmt::Write;
use std::path::Path;
use std::sync::Mutex;

use renderer::film::Film;
use renderer::render::{self, Job, Observer, RenderError};
use renderer::scene::{Diagnostic, pbrt};
use serde::Serialize;

use super::print;
use crate::args::{InfoArguments, ReportFormat};
use crate::exit::Failure;
use crate::inventory::{Counts, Inventory};
use crate::job;
use crate::log::Log;
use crate::sanitise;
use crate::stats;

/// The answer.
#[derive(Serialize)]
struct Report<'a> {
    scene: &'a Path,
    #[serde(flatten)]
    inventory: Inventory,
    /// What building the scene found out; absent if it was not built.
    #[serde(flatten)]
    built: Option<Built>,
    /// What will not look as the scene asks.
    warnings: Vec<String>,
}

/// What only the built scene knows.
#[derive(Serialize)]
struct Built {
    /// The pixels that would be rendered, x0 x1 y0 y1, upper ends exclusive.
    pixel_bounds: [u32; 4],
    /// Triangles and other primitives, with every instance counted, and in memory.
    primitives: u64,
    unique_primitives: u64,
    seconds: Seconds,
    memory: Memory,
}

#[derive(Serialize)]
struct Seconds {
    parse: f64,
    build: f64,
}

/// Bytes.
#[derive(Serialize)]
struct Memory {
    /// Embree's acceleration structures.
    embree_bytes: u64,
    /// The film that a render of the whole frame would hold.
    film_bytes: u64,
    /// What rendering will take at its peak: what building took, or what is left of it and the film.
    total_bytes: Option<u64>,
}

/// Runs the command.
pub fn run(arguments: &InfoArguments, log: &Log) -> Result<(), Failure> {
    let (inventory, read_warnings) = match pbrt::load(&arguments.scene) {
        Ok((scene, warnings)) => (Inventory::of(&scene), warnings),
        Err(diagnostics) => return Err(job::scene_failure(&RenderError::Scene(diagnostics), log)),
    };
    let (built, warnings) = if arguments.parse_only {
        (None, read_warnings)
    } else {
        let (built, warnings) = build(arguments).map_err(|error| job::scene_failure(&error, log))?;
        (Some(built), warnings)
    };
    let warnings = warnings.iter().map(ToString::to_string).collect();
    let report = Report { scene: &arguments.scene, inventory, built, warnings };
    print(&match arguments.format {
        ReportFormat::Text => text(&report),
        ReportFormat::Json => {
            let json = serde_json::to_string_pretty(&report).expect("the report is plain data with text keys");
            json + "\n"
        }
    })
}

/// Keeps the warnings.
#[derive(Default)]
struct Warnings(Mutex<Vec<Diagnostic>>);

impl Observer for Warnings {
    fn warning(&self, warning: &Diagnostic) {
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(warning.clone());
    }
}

/// Builds the scene as for rendering.
fn build(arguments: &InfoArguments) -> Result<(Built, Vec<Diagnostic>), RenderError> {
    let threads = job::threads(arguments.threads, job::slurm().as_deref());
    let job = Job { scene: arguments.scene.clone(), threads, ..Job::default() };
    let observer = Warnings::default();
    let prepared = render::thread_pool(threads)?.install(|| render::prepare(&job, &observer))?;
    let bounds = prepared.world.sensor.bounds;
    let film_bytes = Film::memory(bounds, &prepared.description.outputs(), false);
    let statistics = &prepared.statistics;
    let total_bytes = stats::resident_memory().zip(stats::peak_memory());
    let built = Built {
        pixel_bounds: [bounds.min[0], bounds.max[0], bounds.min[1], bounds.max[1]],
        primitives: statistics.primitives,
        unique_primitives: statistics.unique_primitives,
        seconds: Seconds { parse: statistics.parse_seconds, build: statistics.compile_seconds },
        memory: Memory {
            embree_bytes: statistics.embree_bytes,
            film_bytes,
            total_bytes: total_bytes.map(|(resident, peak)| peak.max(resident + film_bytes)),
        },
    };
    Ok((built, observer.0.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner)))
}

/// The report for people. Names come from the scene, so each stays on its line.
fn text(report: &Report<'_>) -> String {
    let inventory = &report.inventory;
    let mut text = String::new();
    let mut row = |name: &str, value: &str| {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{name:<11} {}", sanitise::one_line(value));
    };
    let [width, height] = inventory.resolution;
    row("scene", &format!("{} ({})", report.scene.display(), many(inventory.files.len() as u64, "file")));
    row("frame", &format!("{width} x {height} pixels, {} samples each, seed {}", inventory.spp, inventory.seed));
    row("camera", &format!("{}, {} filter", inventory.camera, inventory.filter));
    row("paths", &format!("of at most {} scattering events", inventory.max_depth));
    row("shapes", &listed(&inventory.shapes));
    if inventory.objects + inventory.instances > 0 {
        row("instances", &format!("{} of {}", inventory.instances, many(inventory.objects, "object")));
    }
    row("materials", &listed(&inventory.materials));
    row("textures", &listed(&inventory.textures));
    row("lights", &listed(&inventory.lights));
    if !inventory.media.is_empty() {
        row("media", &inventory.media.join(", "));
    }
    row("needs", &if inventory.features.is_empty() { "nothing special".into() } else { inventory.features.join(", ") });
    row("assets", &many(inventory.assets.len() as u64, "file"));
    if let Some(built) = &report.built {
        row("primitives", &format!("{} in memory, {} with instances", built.unique_primitives, built.primitives));
        row("built in", &format!("{:.2} s, read in {:.2} s", built.seconds.build, built.seconds.parse));
        let megabytes = |bytes: u64| format!("{:.0} MB", bytes as f64 / 1e6);
        row(
            "memory",
            &format!(
                "{} in all, of which Embree {}, film {}",
                built.memory.total_bytes.map_or("unknown".into(), megabytes),
                megabytes(built.memory.embree_bytes),
                megabytes(built.memory.film_bytes),
            ),
        );
    }
    row("warnings", &if report.warnings.is_empty() { "none".into() } else { report.warnings.len().to_string() });
    for warning in &report.warnings {
        for line in sanitise::lines(warning) {
            let _ = writeln!(text, "  {line}");
        }
    }
    text
}

fn many(count: u64, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

/// `12 diffuse, 3 mix`, or `none`.
fn listed(counts: &Counts) -> String {
    if counts.is_empty() {
        return "none".into();
    }
    counts.iter().map(|(name, count)| format!("{count} {name}")).collect::<Vec<_>>().join(", ")
}
