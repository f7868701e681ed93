//! `tessera info`: what a scene contains and what it takes to render it.

use std::fmt::Write;
use std::path::Path;
use std::sync::Mutex;

use renderer::film::Film;
use renderer::filtering::Filtering;
use renderer::light::Selection;
use renderer::render::{self, Job, Observer, RenderError};
use renderer::scene::{Diagnostic, pbrt};
use renderer::world::World;
use serde::Serialize;

use super::print;
use crate::args::{InfoArguments, ReportFormat};
use crate::exit::Failure;
use crate::inventory::{Counts, Inventory, LENS};
use crate::job;
use crate::log::{Level, Log};
use crate::prices::{self, Price};
use crate::sanitise;
use crate::stats;

/// The answer.
#[derive(Serialize)]
struct Report<'a> {
    #[serde(serialize_with = "stats::shown_path")]
    scene: &'a Path,
    #[serde(flatten)]
    inventory: Inventory,
    /// What its features cost where `ci/bench-features` measured them.
    prices: Vec<Price>,
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
    follows: Follows,
}

/// What of the renderer the scene makes use of; the rest costs it nothing.
#[derive(Serialize)]
struct Follows {
    /// What Embree's queries are prepared to meet.
    queries: String,
    /// Whether hits are tested against alpha masks; if not, the path loop is one that was compiled without.
    alpha_tests: bool,
    /// Dimensions of the sampler that count: at the camera two on the film and two on a lens, and at each vertex one for the
    /// choice of a light, two for a place on it, one for a lobe, two for a direction and one for roulette.
    camera_numbers: u32,
    vertex_numbers: u32,
    /// How lights are chosen.
    light_sampler: String,
    light_tree_bytes: u64,
    /// Images that textures look at, with their smaller versions.
    texture_bytes: u64,
}

impl Follows {
    fn of(world: &World, lens: bool) -> Self {
        let lights = world.lights.selection();
        let sampled = lights.bounded + lights.infinite;
        Self {
            queries: world.geometry.scene().features().to_string(),
            alpha_tests: world.geometry.alpha_test(&world.textures).is_some(),
            camera_numbers: if lens { 4 } else { 2 },
            vertex_numbers: 4 + if sampled > 0 { 2 } else { 0 } + u32::from(sampled > 1),
            light_sampler: light_sampler(&lights),
            light_tree_bytes: lights.tree_bytes as u64,
            texture_bytes: world.textures.bytes() as u64,
        }
    }
}

/// How a light is chosen, in words.
fn light_sampler(lights: &Selection) -> String {
    let bounded = match lights.bounded {
        0 => None,
        1 => Some("the one light, without a choice".to_owned()),
        count => Some(format!("a tree over {count} lights")),
    };
    let infinite = (lights.infinite > 0).then(|| many(lights.infinite as u64, "environment"));
    let unsampled = (lights.unsampled > 0)
        .then(|| format!("{} left to BSDF samples", many(lights.unsampled as u64, "environment")));
    let all: Vec<String> = [bounded, infinite, unsampled].into_iter().flatten().collect();
    if all.is_empty() { "none".into() } else { all.join(", ") }
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
    /// What the adaptive filter takes besides, at least: its channels and one path of each pixel. Cells come to it.
    filter_bytes: u64,
    /// What rendering without a filter will take at its peak: what building took, or what is left of it and the film.
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
        let lens = inventory.features.contains(&LENS);
        let (built, warnings) = build(arguments, lens).map_err(|error| job::scene_failure(&error, log))?;
        (Some(built), warnings)
    };
    let warnings = warnings.iter().map(ToString::to_string).collect();
    let prices = prices::of(&inventory.features);
    let report = Report { scene: &arguments.scene, inventory, prices, built, warnings };
    print(&match arguments.format {
        ReportFormat::Text => text(&report, log.shows(Level::Verbose)),
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
fn build(arguments: &InfoArguments, lens: bool) -> Result<(Built, Vec<Diagnostic>), RenderError> {
    let threads = job::threads(arguments.threads, job::slurm().as_deref());
    let job = Job { scene: arguments.scene.clone(), threads, ..Job::default() };
    let observer = Warnings::default();
    let mut prepared = render::thread_pool(threads)?.install(|| render::prepare(&job, &observer))?;
    let bounds = prepared.world.sensor.bounds;
    let film_bytes = Film::memory(bounds, &prepared.description.outputs(), false);
    let plain = render::least_memory(&prepared);
    prepared.description.filtering = Filtering::named("adaptive").expect("the filter of renders that name none");
    let filter_bytes = render::least_memory(&prepared) - plain;
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
            filter_bytes,
            total_bytes: total_bytes.map(|(resident, peak)| peak.max(resident + film_bytes)),
        },
        follows: Follows::of(&prepared.world, lens),
    };
    Ok((built, observer.0.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner)))
}

/// The report for people. Names come from the scene, so each stays on its line.
/// Verbose: with how costs were measured.
fn text(report: &Report<'_>, verbose: bool) -> String {
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
    if !report.prices.is_empty() {
        row("costs", &format!("{} more work where they are seen", prices::in_words(&report.prices)));
        if verbose {
            let unused = prices::unused().max(0.0);
            row(
                "",
                &format!(
                    "measured by ci/bench-features in a small room; what is not used costs at most {unused:.2} % each"
                ),
            );
        }
    }
    row("assets", &many(inventory.assets.len() as u64, "file"));
    if let Some(built) = &report.built {
        row("primitives", &format!("{} in memory, {} with instances", built.unique_primitives, built.primitives));
        row("built in", &format!("{:.2} s, read in {:.2} s", built.seconds.build, built.seconds.parse));
        let follows = &built.follows;
        let alpha = if follows.alpha_tests { "with alpha tests" } else { "compiled without alpha tests" };
        row("queries", &format!("for {}; {alpha}", follows.queries));
        row("light by", &follows.light_sampler);
        row(
            "sampler",
            &format!("{} dimensions at the camera, {} at each vertex", follows.camera_numbers, follows.vertex_numbers),
        );
        let megabytes = |bytes: u64| match bytes {
            0 => "nothing".to_owned(),
            1..1_000_000 => format!("{:.1} kB", bytes as f64 / 1e3),
            _ => format!("{:.0} MB", bytes as f64 / 1e6),
        };
        row(
            "memory",
            &format!(
                "{} in all, of which Embree {}, film {}, image textures {}, light tree {}; the filter takes {} more at least, and \
                 more with the samples",
                built.memory.total_bytes.map_or("unknown".into(), megabytes),
                megabytes(built.memory.embree_bytes),
                megabytes(built.memory.film_bytes),
                megabytes(follows.texture_bytes),
                megabytes(follows.light_tree_bytes),
                megabytes(built.memory.filter_bytes),
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
