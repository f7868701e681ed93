//! What a render tells when it is done.

use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::Instant;

use renderer::error::Estimate;
use renderer::film::exr::Losses;
use renderer::integrator::Counters;
use renderer::render::Frame;

use super::reporter::Reporter;
use crate::args::RenderArguments;
use crate::exit::Failure;
use crate::metadata;
use crate::stats::{self, Filter, Memory, Primitives, Problems, Rays, Seconds, Stats, many};

/// A frame in its file.
pub struct Written {
    /// The frame.
    pub frame: Frame,
    /// What did not fit into the file.
    pub losses: Losses,
    /// What is known of the frame's error.
    pub error: Option<Estimate>,
    /// How long writing it took.
    pub seconds: f64,
}

/// What became of the image.
pub struct Outcome<'a> {
    /// Where it is.
    pub path: &'a Path,
    /// What is in it.
    pub written: Written,
    /// When its render began.
    pub begin: Instant,
}

impl<'a> Outcome<'a> {
    /// In numbers.
    pub fn stats(&self, arguments: &'a RenderArguments, reporter: &Reporter<'_>) -> Stats<'a> {
        let Written { frame, losses, error, seconds } = &self.written;
        let (film, description, statistics) = (&frame.film, &frame.description, &frame.statistics);
        let counters = &statistics.counters;
        let ([x0, x1], [y0, y1]) = (description.in_frame(0), description.in_frame(1));
        // Those of this run, whose seconds these are.
        let queries = |counters: &Counters| counters.closest_hit_rays + counters.shadow_rays;
        let traced = (queries(counters) - queries(&statistics.restored)) as f64;
        Stats {
            version: env!("CARGO_PKG_VERSION"),
            scene: &arguments.scene,
            output: self.path,
            frame: description.number,
            complete: frame.complete() || reporter.goal_reached(),
            resolution: film.resolution(),
            pixel_bounds: [x0, x1, y0, y1],
            samples: metadata::span(&frame.samples),
            seed: description.seed,
            threads: statistics.threads,
            seconds: Seconds {
                parse: statistics.parse_seconds,
                compile: statistics.compile_seconds,
                render: statistics.render_seconds,
                write: *seconds,
                total: self.begin.elapsed().as_secs_f64(),
            },
            rays: Rays {
                camera: counters.camera_rays,
                closest_hit: counters.closest_hit_rays,
                shadow: counters.shadow_rays,
                per_second: if statistics.render_seconds > 0.0 { traced / statistics.render_seconds } else { 0.0 },
            },
            primitives: Primitives { placed: statistics.primitives, unique: statistics.unique_primitives },
            memory: Memory {
                peak_resident_bytes: stats::peak_memory(),
                embree_bytes: statistics.embree_bytes,
                film_bytes: statistics.film_bytes,
            },
            filter: Filter::of(statistics),
            error: error.as_ref().map(stats::Error::of),
            goal_reached: reporter.goal_reached(),
            problems: Problems {
                warnings: reporter.warnings.load(Ordering::Relaxed),
                rejected_samples: counters.rejected_samples,
                negative_pixels: losses.clamped_negative,
                values_beyond_half: losses.clamped_half,
            },
        }
    }
}

/// What to say of the goals that the frame was to reach and did not.
fn missed(arguments: &RenderArguments, stats: &Stats<'_>) -> Vec<String> {
    let [start, end] = stats.samples;
    let goals = [
        ("relMSE (--target-error)", arguments.quality.target_error, stats.error.map(|error| error.relmse)),
        ("noise (--noise-threshold)", arguments.quality.noise_threshold, stats.error.map(|error| error.noise)),
    ];
    let missed = goals.into_iter().filter_map(|(what, goal, found)| {
        let goal = goal.filter(|goal| found.is_none_or(|found| found > *goal))?;
        let found = found.map_or("not known".to_owned(), |found| format!("about {}", stats::figure(found)));
        let taken = many(end - start, "sample was", "samples were");
        Some(format!(
            "the target {} of the {what} was not reached: {taken} taken, and it is {found}",
            stats::figure(goal)
        ))
    });
    if stats.goal_reached { Vec::new() } else { missed.collect() }
}

/// Sums up for people.
pub fn tell(arguments: &RenderArguments, stats: &Stats<'_>, frame: &Frame, reporter: &Reporter<'_>) {
    let log = reporter.log;
    let [start, end] = stats.samples;
    let asked = &frame.description.asked;
    if let Some(error) = &stats.error {
        log.info(&error.summary());
    }
    if stats.goal_reached {
        log.info(&format!("good enough with {} of {} samples per pixel", end - start, asked.end - asked.start));
    } else if !stats.complete {
        log.warning(&format!(
            "stopped early: {} of {} samples per pixel were taken{}",
            end - start,
            asked.end - asked.start,
            reporter.hint()
        ));
    }
    missed(arguments, stats).iter().for_each(|missed| log.warning(missed));
    if let Some(rejected) = stats::rejected(stats.problems.rejected_samples, stats.rays.camera) {
        log.warning(&rejected);
    }
    if stats.problems.values_beyond_half > 0 {
        let values = many(stats.problems.values_beyond_half, "value was", "values were");
        log.warning(&format!("{values} too large for 16 bits"));
    }
    if let Some(filter) = &stats.filter {
        log.info(&filter.summary());
    }
    let [x0, x1, y0, y1] = stats.pixel_bounds;
    let seconds = &stats.seconds;
    let memory =
        stats.memory.peak_resident_bytes.map_or("unknown".into(), |bytes| format!("{:.2} GB", bytes as f64 / 1e9));
    log.info(&format!(
        "wrote {}: {} x {} pixels, {} each, in {:.2} s (parse {:.2}, build {:.2}, render {:.2}, write {:.2}) on {}; {:.2} \
         million rays a second; peak memory {memory}",
        stats.output.display(),
        x1 - x0,
        y1 - y0,
        many(end - start, "sample", "samples"),
        seconds.total,
        seconds.parse,
        seconds.compile,
        seconds.render,
        seconds.write,
        many(stats.threads as u64, "thread", "threads"),
        stats.rays.per_second / 1e6,
    ));
}

/// Whether it is good enough.
///
/// # Errors
/// With `--strict`: it is not.
pub fn judge(arguments: &RenderArguments, stats: &Stats<'_>) -> Result<(), Failure> {
    let rejected = stats.problems.rejected_samples;
    if arguments.quality.strict && rejected > 0 {
        return Err(Failure::Quality(format!(
            "{} to be rejected (--strict)",
            many(rejected, "sample had", "samples had")
        )));
    }
    Ok(())
}
