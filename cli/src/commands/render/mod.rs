//! `tessera render`: from a scene file to an image file.

mod outcome;
mod reporter;

use std::iter;
use std::path::Path;
use std::sync::atomic::AtomicU64;
use std::time::Instant;

use oiio::Attribute;
use rayon::ThreadPool;
use renderer::error::{Goal, Watch};
use renderer::film::Aov;
use renderer::film::exr::{self, Losses};
use renderer::filtering::Filtering;
use renderer::frame::{Accumulation, FrameDescription, Past, Samples};
use renderer::part::{self, Part};
use renderer::render::{self, Job, Traced};

use self::outcome::{Outcome, Written};
use self::reporter::{MemoryLimit, Reporter};
use crate::args::{FilterKind, RenderArguments};
use crate::checkpoint::Checkpoints;
use crate::exit::Failure;
use crate::interrupt::Interrupt;
use crate::job;
use crate::log::Log;
use crate::metadata;
use crate::output::OutputFile;
use crate::progress::Progress;
use crate::stats;

/// Runs the command.
pub fn run(arguments: &RenderArguments, log: &Log) -> Result<(), Failure> {
    let frames: Vec<_> = match &arguments.frames {
        Some(frames) => frames.numbers().iter().copied().map(Some).collect(),
        None => vec![arguments.frame],
    };
    let progress = Progress::new(arguments.run.progress, frames.len(), log);
    sequence(arguments, &frames, log, &progress).inspect_err(|failure| progress.fail(failure))
}

/// Frames one after the other, each as if it were alone unless averages move from one to the next.
fn sequence(
    arguments: &RenderArguments,
    frames: &[Option<i32>],
    log: &Log,
    progress: &Progress<'_>,
) -> Result<(), Failure> {
    if let Some(frames) = &arguments.frames {
        let outputs =
            iter::once(&arguments.output).chain(&arguments.channels.stats).chain(&arguments.checkpoint.checkpoint);
        outputs.into_iter().try_for_each(|output| job::distinct(output, frames.numbers()))?;
        job::check_scenes(&arguments.scene, frames.numbers())?;
    } else if arguments.frame.is_none() {
        job::check_scene(&arguments.scene)?;
    }
    if arguments.filter.filter != FilterKind::None {
        warn_of_unfiltered(&arguments.channels.aov, log);
    }
    let interrupt = Interrupt::default();
    if let Err(why) = interrupt.listen() {
        log.warning(&format!("signals will end the render without an image: {why}"));
    }
    let mut past = None;
    for &frame in frames {
        if interrupt.requested() {
            return Err(Failure::Interrupted("interrupted between two frames".into()));
        }
        let mut arguments = arguments.clone();
        arguments.frame = frame;
        arguments.scene = frame.map_or(arguments.scene.clone(), |frame| job::named(&arguments.scene, frame));
        past = render(&arguments, past, log, progress, &interrupt)?;
    }
    Ok(())
}

/// Says that channels of light are another picture than the one beside them.
fn warn_of_unfiltered(aovs: &[String], log: &Log) {
    let light = [Aov::Direct, Aov::Indirect, Aov::Emission, Aov::Light].map(Aov::name);
    let asked = |name: &&str| aovs.iter().any(|aov| aov == "all" || aov == name);
    let unfiltered: Vec<&str> = light.into_iter().filter(asked).collect();
    if !unfiltered.is_empty() {
        log.warning(&format!(
            "R G B is filtered, {} {} not: they sum to the image of --filter none",
            unfiltered.join(", "),
            if unfiltered.len() == 1 { "is" } else { "are" }
        ));
    }
}

/// Renders a frame, on from what the one before it left, and returns what it leaves itself.
fn render(
    arguments: &RenderArguments,
    past: Option<Past>,
    log: &Log,
    progress: &Progress<'_>,
    interrupt: &Interrupt,
) -> Result<Option<Past>, Failure> {
    let begin = Instant::now();
    job::check_samples(arguments)?;
    job::check_outputs(arguments)?;
    let filtering = job::filtering(&arguments.filter, job::is_open(arguments))?;
    job::check_sequence(arguments, &filtering)?;
    let path = job::output(arguments)?;
    let named = |path: &Path| job::named(path, arguments.frame.unwrap_or(1));
    let checkpoint = arguments.checkpoint.checkpoint.as_deref().map(named);
    if job::is_part(&path) || checkpoint.is_some() {
        part::storable(&filtering).map_err(|error| Failure::Usage(error.to_string()))?;
    }
    let encoding = job::encoding(&arguments.channels.encoding);
    let output = OutputFile::prepare(&path)?;
    let stats_file = arguments.channels.stats.as_deref().map(|path| OutputFile::prepare(&named(path))).transpose()?;
    let checkpoint = checkpoint.as_deref().map(OutputFile::prepare).transpose()?;
    apart(&output, checkpoint.as_ref(), stats_file.as_ref())?;
    // Checkpoints look themselves at what they would take the place of.
    iter::once(&output).chain(&stats_file).try_for_each(|output| output.spare([&*arguments.scene]))?;
    let checkpoints = Checkpoints::new(&arguments.checkpoint, checkpoint, log)?;

    let job = job(arguments, filtering);
    log.verbose(&format!("{}, OpenImageIO {}, {} threads", job::software(), oiio::version(), job.threads));
    let reporter = Reporter {
        log,
        progress,
        warnings: AtomicU64::new(0),
        interrupt,
        checkpoints,
        memory: MemoryLimit::new(arguments.run.memory_limit),
        output: &output,
        watch: watch(arguments, &job),
        encoding: &encoding,
    };
    let pool = render::thread_pool(job.threads).map_err(|error| reporter.failure(error))?;
    let prepared = pool.install(|| render::prepare(&job, &reporter)).map_err(|error| reporter.failure(error))?;
    job::check_encoding(&encoding, prepared.description.aovs)?;
    if arguments.checkpoint.skip_existing && is_complete(&path, &prepared.description, &goal(arguments)) {
        log.info(&format!("{} is there and complete: nothing to do", path.display()));
        progress.finish(&path, stats::peak_memory());
        return Ok(None);
    }
    render::check_memory(&prepared).map_err(|error| reporter.failure(error))?;
    reporter.memory.check(render::least_memory(&prepared))?;
    let stored = reporter.checkpoints.begin(&prepared.description)?;
    let followed = past.map(|past| Accumulation::following(prepared.description.clone(), past));
    let begun = stored.or(followed);
    let mut traced = pool.install(|| render::trace(prepared, begun, job.time_limit, &reporter));
    let finished = traced.frame.complete() || reporter.goal_reached();
    let stopped = reporter.hindered() && !finished;
    if !finished {
        // Whatever ends the render, a limit of time too, the same command goes on from here.
        pool.install(|| reporter.checkpoints.write(&mut traced.frame));
    }

    progress.phase("write");
    let mut written = if job::is_part(&path) {
        write_part(traced, &pool, &output)?
    } else {
        write_image(traced, &pool, &reporter, &goal(arguments), arguments.channels.provenance)?
    };
    let past = written.frame.past.take();
    let outcome = Outcome { path: &path, written, begin };
    let stats = outcome.stats(arguments, &reporter);
    if let Some(file) = stats_file {
        let text = serde_json::to_string_pretty(&stats).expect("statistics are plain data with text keys");
        file.write((text + "\n").as_bytes())?;
    }
    if stopped {
        outcome::tell(arguments, &stats, &outcome.written.frame, &reporter);
        return Err(reporter.hindrance());
    }
    if finished {
        reporter.checkpoints.clear();
    }
    progress.finish(&path, stats.memory.peak_resident_bytes);
    outcome::tell(arguments, &stats, &outcome.written.frame, &reporter);
    outcome::judge(arguments, &stats)?;
    Ok(past)
}

/// Writes the sums.
fn write_part(mut traced: Traced, pool: &ThreadPool, output: &OutputFile) -> Result<Written, Failure> {
    let start = Instant::now();
    let written = pool.install(|| part::write(&mut traced.frame, output.target()));
    let published = written.and_then(|written| written.publish(output.target()));
    published.map_err(|error| Failure::Output(error.to_string()))?;
    let seconds = start.elapsed().as_secs_f64();
    Ok(Written { frame: traced.undeveloped(), losses: Losses::default(), error: None, seconds })
}

/// Writes the image.
fn write_image(
    traced: Traced,
    pool: &ThreadPool,
    reporter: &Reporter<'_>,
    goal: &Goal,
    provenance: bool,
) -> Result<Written, Failure> {
    // The renderer allows OpenImageIO no threads beside its own; the file at the end may have all.
    if let Err(error) = oiio::set_threads(pool.current_num_threads()) {
        reporter.log.verbose(&format!("{error}; its default stays"));
    }
    let mut frame = pool.install(|| traced.develop());
    // The filter's last work is part of rendering.
    let start = Instant::now();
    let error = reporter.watch.as_ref().and_then(|watch| watch.finish(&mut frame.film));
    let provenance = provenance.then_some(&frame.statistics);
    let mut attributes = metadata::of_frame(&frame.description, &frame.samples, error.as_ref(), provenance);
    attributes.extend(frame.past.as_ref().map(metadata::of_past));
    if reporter.goal_reached() && !frame.complete() {
        metadata::add_reached(&mut attributes, goal);
    }
    let losses = exr::write_as(&frame.film, attributes, reporter.encoding, reporter.output.target())
        .map_err(|error| Failure::Output(error.to_string()))?;
    Ok(Written { frame, losses, error, seconds: start.elapsed().as_secs_f64() })
}

/// Makes sure that no file is written over another of the same frame.
fn apart(output: &OutputFile, checkpoint: Option<&OutputFile>, statistics: Option<&OutputFile>) -> Result<(), Failure> {
    let files = [(Some(output), "--output"), (checkpoint, "--checkpoint"), (statistics, "--stats")];
    for (one, (file, option)) in files.iter().enumerate() {
        for (other, other_option) in &files[one + 1..] {
            if let Some((file, _)) = file.zip(*other).filter(|(file, other)| file.is(other)) {
                let path = file.target().display();
                return Err(Failure::Usage(format!("{option} and {other_option} are both \"{path}\": name two files")));
            }
        }
    }
    Ok(())
}

/// Whether there is an image or a part of this very frame that lacks no sample of those that are asked for, or an image that
/// was good enough without.
fn is_complete(path: &Path, description: &FrameDescription, goal: &Goal) -> bool {
    let samples = Samples::from(description.asked.clone());
    if job::is_part(path) {
        return Part::open(path)
            .is_ok_and(|part| part.samples == samples && description.difference(&part.description).is_none());
    }
    let [range, others @ ..] = metadata::identity(description, &samples);
    let has = |image: &oiio::Image, (name, value): &(&str, Attribute)| image.attribute(name) == Some(value);
    let enough = metadata::reached(goal);
    let same = |image: oiio::Image| {
        others.iter().all(|other| has(&image, other))
            && (has(&image, &range) || enough.as_ref().is_some_and(|enough| has(&image, enough)))
    };
    oiio::read(path).is_ok_and(same)
}

fn job(arguments: &RenderArguments, filtering: Filtering) -> Job {
    Job {
        scene: arguments.scene.clone(),
        path_map: arguments.paths.map(),
        spp: arguments.quality.spp,
        seed: arguments.quality.seed,
        frame: arguments.frame,
        lock_seed: arguments.quality.lock_seed,
        resolution: arguments.frame_area.resolution.map(|size| size.0),
        overscan: arguments.frame_area.overscan,
        crop: arguments.frame_area.crop,
        pixel_bounds: arguments.frame_area.pixel_bounds,
        sample_range: arguments.quality.sample_range.clone(),
        slice: arguments.quality.slice,
        threads: job::threads(arguments.run.threads, job::slurm().as_deref()),
        aovs: job::aovs(&arguments.channels.aov),
        time_limit: arguments.quality.time_limit,
        filtering,
        ..Job::default()
    }
}

/// When the frame is good enough.
fn goal(arguments: &RenderArguments) -> Goal {
    Goal { relmse: arguments.quality.target_error, noise: arguments.quality.noise_threshold }
}

/// Who looks at the frame's error. It costs nothing but where there is a filter, which then is evaluated when the number of
/// samples doubles: only if somebody asks.
fn watch(arguments: &RenderArguments, job: &Job) -> Option<Watch> {
    let goal = goal(arguments);
    let asked = job.aovs.contains(Aov::Error) || goal != Goal::default();
    (asked || job.filtering == Filtering::None).then(|| Watch::new(goal))
}
