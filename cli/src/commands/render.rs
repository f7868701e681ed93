//! `tessera render`: from a scene file to an image file.

use std::iter;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

use renderer::error::{Estimate, Goal, Watch};
use renderer::film::exr::{self, Losses};
use renderer::film::{Aov, AovSet, Film};
use renderer::filtering::Filtering;
use renderer::frame::{Accumulation, FrameDescription, Samples};
use renderer::part::{self, Part};
use renderer::render::{self, Frame, Job, Observer, Phase, RenderError};
use renderer::scene::{Diagnostic, Severity};

use crate::args::RenderArguments;
use crate::checkpoint::Checkpoints;
use crate::exit::Failure;
use crate::interrupt::Interrupt;
use crate::job;
use crate::log::Log;
use crate::metadata;
use crate::output::OutputFile;
use crate::progress::Progress;
use crate::stats::{self, Filter, Memory, Primitives, Problems, Rays, Seconds, Stats};

/// Warnings beyond this many are only counted, unless details are asked for.
const WARNINGS_SHOWN: u64 = 20;

/// Runs the command.
pub fn run(arguments: &RenderArguments, log: &Log) -> Result<(), Failure> {
    let frames: Vec<_> = match &arguments.frames {
        Some(frames) => frames.numbers().iter().copied().map(Some).collect(),
        None => vec![arguments.frame],
    };
    let progress = Progress::new(arguments.run.progress, frames.len(), log);
    sequence(arguments, &frames, log, &progress).inspect_err(|failure| progress.fail(failure))
}

/// Frames one after the other, each as if it were alone.
fn sequence(
    arguments: &RenderArguments,
    frames: &[Option<i32>],
    log: &Log,
    progress: &Progress<'_>,
) -> Result<(), Failure> {
    if let Some(frames) = &arguments.frames {
        let outputs = iter::once(&arguments.output).chain(&arguments.channels.stats);
        outputs.into_iter().try_for_each(|output| job::distinct(output, frames.numbers()))?;
    }
    let interrupt = Interrupt::default();
    if let Err(why) = interrupt.listen() {
        log.warning(&format!("signals will end the render without an image: {why}"));
    }
    for &frame in frames {
        if interrupt.requested() {
            return Err(Failure::Interrupted("interrupted between two frames".into()));
        }
        let mut arguments = arguments.clone();
        arguments.frame = frame;
        arguments.scene = frame.map_or(arguments.scene.clone(), |frame| job::named(&arguments.scene, frame));
        render(&arguments, log, progress, &interrupt)?;
    }
    Ok(())
}

fn render(
    arguments: &RenderArguments,
    log: &Log,
    progress: &Progress<'_>,
    interrupt: &Interrupt,
) -> Result<(), Failure> {
    let begin = Instant::now();
    job::check_samples(arguments)?;
    let filtering = job::filtering(&arguments.filter)?;
    let path = job::output(arguments)?;
    if job::is_part(&path) {
        part::storable(&filtering).map_err(|error| Failure::Usage(error.to_string()))?;
    }
    let encoding = job::encoding(&arguments.channels.encoding);
    let output = OutputFile::prepare(&path)?;
    let named = |path: &Path| job::named(path, arguments.frame.unwrap_or(1));
    let stats_file = arguments.channels.stats.as_deref().map(|path| OutputFile::prepare(&named(path))).transpose()?;
    let checkpoint = arguments.checkpoint.checkpoint.as_deref().map(named);
    if checkpoint.is_some() {
        part::storable(&filtering).map_err(|error| Failure::Usage(error.to_string()))?;
    }
    let checkpoints = Checkpoints::new(&arguments.checkpoint, checkpoint, log)?;

    let job = job(arguments, filtering);
    log.verbose(&format!("{}, OpenImageIO {}, {} threads", job::software(), oiio::version(), job.threads));
    let watch = watch(arguments, &job);
    let reporter = Reporter {
        log,
        progress,
        warnings: AtomicU64::new(0),
        interrupt,
        checkpoints,
        memory: MemoryLimit { bytes: arguments.run.memory_limit, reached: AtomicBool::new(false) },
        output: &output,
        watch,
        encoding: &encoding,
    };
    let pool = render::thread_pool(job.threads).map_err(|error| reporter.failure(error))?;
    let prepared = pool.install(|| render::prepare(&job, &reporter)).map_err(|error| reporter.failure(error))?;
    job::check_encoding(&encoding, prepared.description.aovs)?;
    if arguments.checkpoint.skip_existing && is_complete(&path, &prepared.description) {
        log.info(&format!("{} is there and complete: nothing to do", path.display()));
        progress.finish(&path, stats::peak_memory());
        return Ok(());
    }
    render::check_memory(&prepared).map_err(|error| reporter.failure(error))?;
    reporter.memory.check(render::least_memory(&prepared))?;
    let begun = reporter.checkpoints.begin(&prepared.description)?;
    let mut traced = pool.install(|| render::trace(prepared, begun, job.time_limit, &reporter));
    let stopped = reporter.hindered() && !traced.frame.complete();
    if stopped {
        reporter.checkpoints.write(&mut traced.frame);
    }

    progress.phase("write");
    let start = Instant::now();
    library_threads(job.threads, log);
    let mut losses = Losses::default();
    let mut error = None;
    let frame = if job::is_part(&path) {
        part::write(&mut traced.frame, output.target()).map_err(|error| Failure::Output(error.to_string()))?;
        traced.undeveloped()
    } else {
        let mut frame = pool.install(|| traced.develop());
        error = reporter.watch.as_ref().and_then(|watch| watch.finish(&mut frame.film));
        frame
    };
    if !job::is_part(&path) {
        let attributes = metadata::of_frame(&frame, error.as_ref(), arguments.channels.provenance);
        losses = exr::write_as(&frame.film, attributes, &encoding, output.target())
            .map_err(|error| Failure::Output(error.to_string()))?;
    }
    let outcome = Outcome { path: &path, losses, error, begin, write_seconds: start.elapsed().as_secs_f64() };

    let stats = outcome.stats(arguments, &frame, &reporter);
    if let Some(file) = stats_file {
        let text = serde_json::to_string_pretty(&stats).expect("statistics are plain data with text keys");
        file.write((text + "\n").as_bytes())?;
    }
    if stopped && !reporter.interrupt.requested() {
        tell(&stats, &frame, log);
        return Err(Failure::Render("--memory-limit is reached; the output holds the samples up to now".into()));
    }
    if stopped {
        tell(&stats, &frame, log);
        let kept = if reporter.checkpoints.wanted() { "; the same command goes on from the checkpoint" } else { "" };
        return Err(Failure::Interrupted(format!("interrupted; the output holds the samples up to now{kept}")));
    }
    if stats.complete {
        reporter.checkpoints.clear();
    }
    progress.finish(&path, stats.memory.peak_resident_bytes);
    tell(&stats, &frame, log);
    judge(arguments, &stats)
}

/// Whether there is an image or a part of this very frame that lacks no sample of those that are asked for.
fn is_complete(path: &Path, description: &FrameDescription) -> bool {
    let samples = Samples::from(description.asked.clone());
    if job::is_part(path) {
        return Part::open(path)
            .is_ok_and(|part| part.samples == samples && description.difference(&part.description).is_none());
    }
    let same = |image: oiio::Image| {
        metadata::identity(description, &samples).iter().all(|(name, value)| image.attribute(name) == Some(value))
    };
    oiio::read(path).is_ok_and(same)
}

fn job(arguments: &RenderArguments, filtering: Filtering) -> Job {
    let mut aovs = AovSet::default();
    for name in &arguments.channels.aov {
        if name == "all" {
            aovs = AovSet::all();
        } else {
            aovs.insert(name);
        }
    }
    Job {
        scene: arguments.scene.clone(),
        spp: arguments.quality.spp,
        seed: arguments.quality.seed,
        frame: arguments.frame,
        lock_seed: arguments.quality.lock_seed,
        resolution: arguments.frame_area.resolution.map(|size| size.0),
        crop: arguments.frame_area.crop,
        pixel_bounds: arguments.frame_area.pixel_bounds,
        sample_range: arguments.quality.sample_range.clone(),
        slice: arguments.quality.slice,
        threads: job::threads(arguments.run.threads, job::slurm().as_deref()),
        aovs,
        time_limit: arguments.quality.time_limit,
        filtering,
        ..Job::default()
    }
}

/// Who looks at the frame's error. It costs nothing but where there is a filter, which then is evaluated when the number of
/// samples doubles: only if somebody asks.
fn watch(arguments: &RenderArguments, job: &Job) -> Option<Watch> {
    let goal = Goal { relmse: arguments.quality.target_error, noise: arguments.quality.noise_threshold };
    let asked = job.aovs.contains(Aov::Error) || goal != Goal::default();
    (asked || job.filtering == Filtering::None).then(|| Watch::new(goal))
}

/// OpenImageIO's own threads: the renderer allows it none beside its own; the file at the end may have all.
fn library_threads(threads: usize, log: &Log) {
    if let Err(error) = oiio::set_threads(threads) {
        log.verbose(&format!("{error}; its default stays"));
    }
}

/// Passes on what the renderer says.
struct Reporter<'a> {
    log: &'a Log,
    progress: &'a Progress<'a>,
    warnings: AtomicU64,
    interrupt: &'a Interrupt,
    checkpoints: Checkpoints<'a>,
    memory: MemoryLimit,
    output: &'a OutputFile,
    watch: Option<Watch>,
    encoding: &'a exr::Encoding,
}

/// How much memory may be in use.
struct MemoryLimit {
    bytes: Option<u64>,
    reached: AtomicBool,
}

impl MemoryLimit {
    /// Refuses what will not fit: `more` bytes than there are now.
    fn check(&self, more: u64) -> Result<(), Failure> {
        let least = stats::resident_memory().unwrap_or_default() + more;
        match self.bytes.filter(|limit| least > *limit) {
            Some(limit) => Err(Failure::Render(format!(
                "the frame takes {:.2} GB at least, and --memory-limit is {:.2} GB: raise it, or render parts of the frame with \
                 --crop, with fewer auxiliary outputs, or with --filter none",
                least as f64 / 1e9,
                limit as f64 / 1e9
            ))),
            None => Ok(()),
        }
    }

    /// A pass is done.
    fn look(&self) {
        if let Some(limit) = self.bytes {
            let over = stats::resident_memory().is_some_and(|bytes| bytes > limit);
            self.reached.fetch_or(over, Ordering::Relaxed);
        }
    }
}

impl Observer for Reporter<'_> {
    fn warning(&self, warning: &Diagnostic) {
        let text = warning.to_string();
        self.progress.diagnostic("warning", &text);
        match self.warnings.fetch_add(1, Ordering::Relaxed) {
            0..WARNINGS_SHOWN => self.log.warning(&text),
            WARNINGS_SHOWN => {
                self.log.warning("more warnings follow; --verbose or --log-file has them");
                self.log.verbose(&text);
            }
            _ => self.log.verbose(&text),
        }
    }

    fn phase(&self, phase: Phase) {
        let name = match phase {
            Phase::Parse => "parse",
            Phase::Compile => "build",
            Phase::Render => "render",
        };
        self.log.verbose(&format!("{name} after {:.3} s", self.log.elapsed()));
        self.progress.phase(name);
        if phase == Phase::Render {
            self.progress.advance(0.0);
        }
    }

    fn progress(&self, done: f64) {
        self.progress.advance(done);
    }

    fn pass_done(&self, frame: &mut Accumulation) {
        self.memory.look();
        if self.interrupt.snapshot_requested() {
            self.checkpoints.write(frame);
            self.snapshot(frame);
        } else if !self.interrupt.requested() {
            self.checkpoints.pass_done(frame);
        }
        if let Some(watch) = &self.watch {
            watch.pass_done(frame);
        }
    }

    fn stop_requested(&self) -> bool {
        self.hindered() || self.watch.as_ref().is_some_and(Watch::reached)
    }

    fn next_look(&self) -> u64 {
        self.watch.as_ref().map_or(u64::MAX, Watch::next_look)
    }

    fn look(&self, film: &Film, samples: u64) -> bool {
        self.watch.as_ref().is_some_and(|watch| watch.look(film, samples))
    }
}

impl Reporter<'_> {
    /// Whether something other than success ends the render.
    fn hindered(&self) -> bool {
        self.interrupt.requested() || self.memory.reached.load(Ordering::Relaxed)
    }

    /// Writes what there is of the output.
    fn snapshot(&self, frame: &mut Accumulation) {
        let path = self.output.target();
        let written = if job::is_part(path) {
            part::write(frame, path).map(drop).map_err(|error| error.to_string())
        } else {
            frame.develop();
            let attributes = metadata::of_accumulation(frame);
            exr::write_as(&frame.film, attributes, self.encoding, path).map(drop).map_err(|error| error.to_string())
        };
        match written {
            Ok(()) => self.log.info(&format!("snapshot of samples {} in {}", frame.samples, path.display())),
            Err(why) => self.log.warning(&format!("no snapshot: {why}; the render goes on")),
        }
    }

    /// Shows all that is wrong with a scene, and says what that means for the command.
    fn failure(&self, error: RenderError) -> Failure {
        let summary = error.to_string();
        match error {
            RenderError::Scene(diagnostics) | RenderError::Compile(diagnostics) => {
                for diagnostic in &diagnostics {
                    match diagnostic.severity {
                        Severity::Warning => self.warning(diagnostic),
                        Severity::Error => {
                            let text = diagnostic.to_string();
                            self.progress.diagnostic("error", &text);
                            self.log.diagnostic(&text);
                        }
                    }
                }
                Failure::Input(summary)
            }
            RenderError::EmptySampleRange(_)
            | RenderError::TooManySamples(_)
            | RenderError::Slice { .. }
            | RenderError::Filter(_) => Failure::Usage(summary),
            RenderError::Embree(_)
            | RenderError::OpenImageIo(_)
            | RenderError::Threads { .. }
            | RenderError::Memory { .. } => Failure::Render(summary),
        }
    }
}

/// What became of the image.
struct Outcome<'a> {
    path: &'a Path,
    losses: Losses,
    error: Option<Estimate>,
    begin: Instant,
    write_seconds: f64,
}

impl<'a> Outcome<'a> {
    fn stats(&self, arguments: &'a RenderArguments, frame: &Frame, reporter: &Reporter<'_>) -> Stats<'a> {
        let (film, description, statistics) = (&frame.film, &frame.description, &frame.statistics);
        let counters = &statistics.counters;
        let bounds = film.bounds();
        let ([x0, y0], [x1, y1]) = (bounds.min, bounds.max);
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
            error: self.error.as_ref().map(stats::Error::of),
            goal_reached: reporter.watch.as_ref().is_some_and(Watch::reached),
            problems: Problems {
                warnings: reporter.warnings.load(Ordering::Relaxed),
                rejected_samples: counters.rejected_samples,
                negative_pixels: self.losses.clamped_negative,
                values_beyond_half: self.losses.clamped_half,
            },
        }
    }
}

/// Sums up for people.
fn tell(stats: &Stats<'_>, frame: &Frame, log: &Log) {
    let [start, end] = stats.samples;
    let asked = &frame.description.asked;
    if let Some(error) = &stats.error {
        log.info(&error.summary());
    }
    if stats.goal_reached {
        log.info(&format!("good enough with {} of {} samples per pixel", end - start, asked.end - asked.start));
    } else if !stats.complete {
        log.warning(&format!(
            "stopped early: {} of {} samples per pixel were taken",
            end - start,
            asked.end - asked.start
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

fn judge(arguments: &RenderArguments, stats: &Stats<'_>) -> Result<(), Failure> {
    let rejected = stats.problems.rejected_samples;
    if arguments.quality.strict && rejected > 0 {
        return Err(Failure::Quality(format!("{rejected} samples had to be rejected (--strict)")));
    }
    Ok(())
}
