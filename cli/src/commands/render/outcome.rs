//! What a render tells when it is done.

use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::Instant;

use renderer::error::Estimate;
use renderer::film::exr::Losses;
use renderer::render::Frame;

use super::reporter::Reporter;
use crate::args::RenderArguments;
use crate::exit::Failure;
use crate::metadata;
use crate::stats::{self, Filter, Memory, Primitives, Problems, Rays, Seconds, Stats};

/// A frame in its file.
pub struct Written {
    /// The frame.
    pub frame: Frame,
    /// What did not fit into the file.
    pub losses: Losses,
    /// What is known of the frame's error.
    pub error: Option<Estimate>,
}

/// What became of the image.
pub struct Outcome<'a> {
    /// Where it is.
    pub path: &'a Path,
    /// What is in it.
    pub written: Written,
    /// When its render began.
    pub begin: Instant,
    /// How long writing it took.
    pub write_seconds: f64,
}

impl<'a> Outcome<'a> {
    /// In numbers.
    pub fn stats(&self, arguments: &'a RenderArguments, reporter: &Reporter<'_>) -> Stats<'a> {
        let Written { frame, losses, error } = &self.written;
        let (film, description, statistics) = (&frame.film, &frame.description, &frame.statistics);
        let counters = &statistics.counters;
        let ([x0, x1], [y0, y1]) = (description.in_frame(0), description.in_frame(1));
        let queries = (counters.closest_hit_rays + counters.shadow_rays) as f64;
        Stats {
            version: env!("CARGO_PKG_VERSION"),
            scene: &arguments.scene,
            output: self.path,
            frame: description.number,
            complete: frame.complete(),
            resolution: film.resolution(),
            pixel_bounds: [x0, x1, y0, y1],
            samples: metadata::span(&frame.samples),
            seed: description.seed,
            threads: statistics.threads,
            seconds: Seconds {
                parse: statistics.parse_seconds,
                compile: statistics.compile_seconds,
                render: statistics.render_seconds,
                write: self.write_seconds,
                total: self.begin.elapsed().as_secs_f64(),
            },
            rays: Rays {
                camera: counters.camera_rays,
                closest_hit: counters.closest_hit_rays,
                shadow: counters.shadow_rays,
                per_second: if statistics.render_seconds > 0.0 { queries / statistics.render_seconds } else { 0.0 },
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

/// Sums up for people.
pub fn tell(stats: &Stats<'_>, frame: &Frame, reporter: &Reporter<'_>) {
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
    if stats.problems.rejected_samples > 0 {
        let share = 100.0 * stats.problems.rejected_samples as f64 / stats.rays.camera.max(1) as f64;
        log.warning(&format!(
            "{} samples ({share:.2e} %) were not finite or negative and count as black",
            stats.problems.rejected_samples
        ));
    }
    if stats.problems.values_beyond_half > 0 {
        log.warning(&format!("{} values were too large for 16 bits", stats.problems.values_beyond_half));
    }
    if let Some(filter) = &stats.filter {
        log.info(&filter.summary());
    }
    let [x0, x1, y0, y1] = stats.pixel_bounds;
    let seconds = &stats.seconds;
    let memory =
        stats.memory.peak_resident_bytes.map_or("unknown".into(), |bytes| format!("{:.2} GB", bytes as f64 / 1e9));
    log.info(&format!(
        "wrote {}: {} x {} pixels, {} samples each, in {:.2} s (parse {:.2}, build {:.2}, render {:.2}, write {:.2}) on \
         {} threads; {:.2} million rays a second; peak memory {memory}",
        stats.output.display(),
        x1 - x0,
        y1 - y0,
        end - start,
        seconds.total,
        seconds.parse,
        seconds.compile,
        seconds.render,
        seconds.write,
        stats.threads,
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
        return Err(Failure::Quality(format!("{rejected} samples had to be rejected (--strict)")));
    }
    Ok(())
}
