//! `tessera merge`: parts of a frame's samples become the frame.

use std::time::Instant;

use rayon::ThreadPool;
use renderer::error::{Goal, Watch};
use renderer::film::{Aov, exr};
use renderer::filtering::Filtering;
use renderer::frame::FrameDescription;
use renderer::integrator::Counters;
use renderer::part::{Merged, Part, PartError, Parts};
use renderer::render::{Frame, Statistics, Traced};

use crate::args::MergeArguments;
use crate::exit::Failure;
use crate::job;
use crate::log::Log;
use crate::metadata;
use crate::output::OutputFile;
use crate::stats;

/// Runs the command.
pub fn run(arguments: &MergeArguments, log: &Log) -> Result<(), Failure> {
    let Some(frames) = &arguments.frames else { return merge(arguments, log) };
    job::distinct(&arguments.output, frames.numbers())?;
    for &frame in frames.numbers() {
        let mut arguments = arguments.clone();
        for path in arguments.parts.iter_mut().chain([&mut arguments.output]) {
            *path = job::named(path, frame);
        }
        merge(&arguments, log)?;
    }
    Ok(())
}

/// Merges the parts of one frame.
fn merge(arguments: &MergeArguments, log: &Log) -> Result<(), Failure> {
    let output = &arguments.output;
    let to_part = job::is_part(output);
    if !to_part {
        job::require_extension(output, "exr", "parts become an OpenEXR image, or with .part one part")?;
    }
    let file = OutputFile::prepare(output)?;
    let pool = renderer::render::thread_pool(job::threads(arguments.threads, job::slurm().as_deref()))
        .map_err(|error| Failure::Render(error.to_string()))?;

    let start = Instant::now();
    let parts = arguments.parts.iter().map(|path| Part::open(path)).collect::<Result<Vec<_>, _>>().map_err(failure)?;
    let count = parts.len();
    for part in &parts {
        log.verbose(&format!("{}: samples {}", part.path.display(), part.samples));
    }
    let parts = Parts::new(parts).map_err(failure)?;
    let samples = parts.samples.to_string();
    if to_part {
        let written = pool.install(|| parts.write(file.target()));
        written.and_then(|written| written.publish(file.target())).map_err(failure)?;
    } else {
        develop(arguments, parts, &pool, &file, log)?;
    }
    log.info(&format!(
        "wrote {}: samples {samples} of {count} parts, in {:.2} s; peak memory {}",
        output.display(),
        start.elapsed().as_secs_f64(),
        stats::peak_memory().map_or("unknown".into(), |bytes| format!("{:.2} GB", bytes as f64 / 1e9))
    ));
    Ok(())
}

/// Adds parts up to an image.
fn develop(
    arguments: &MergeArguments,
    parts: Parts,
    pool: &ThreadPool,
    file: &OutputFile,
    log: &Log,
) -> Result<(), Failure> {
    let encoding = job::encoding(&arguments.encoding);
    job::check_encoding(&encoding, parts.description.aovs)?;
    if let Some(missing) = parts.missing().filter(|_| !arguments.partial) {
        return Err(Failure::Input(format!(
            "samples {}:{} of {} are in none of the parts; add the part that has them, or give --partial for an image of \
             what there is",
            missing.start, missing.end, parts.description.spp
        )));
    }
    let sums = pool.install(|| add_up(parts)).map_err(failure)?;
    let Counters { rejected_samples, camera_rays, .. } = sums.counters();
    if let Some(rejected) = stats::rejected(rejected_samples, camera_rays) {
        log.warning(&rejected);
    }
    if let Err(error) = oiio::set_threads(pool.current_num_threads()) {
        log.verbose(&format!("{error}; its default stays"));
    }
    let provenance = |statistics| Some(statistics).filter(|_| arguments.provenance);
    let written = match sums {
        Sums::Image(merged) => {
            let Merged { image, description, samples, counters, .. } = *merged;
            let statistics = Statistics { counters, ..Statistics::default() };
            let attributes = metadata::of_frame(&description, &samples, None, provenance(&statistics));
            exr::write_image(&image, attributes, &encoding, file.target())
        }
        Sums::Frame(mut frame, watch) => {
            let error = watch.finish(&mut frame.film);
            if let Some(error) = &error {
                log.info(&stats::Error::of(error).summary());
            }
            let Frame { film, description, samples, statistics, .. } = &*frame;
            let attributes = metadata::of_frame(description, samples, error.as_ref(), provenance(statistics));
            exr::write_as(film, attributes, &encoding, file.target())
        }
    };
    written.map(drop).map_err(|error| Failure::Output(error.to_string()))
}

/// What parts add up to.
enum Sums {
    /// A filtered image.
    Image(Box<Merged>),
    /// All sums, and who has looked at their error.
    Frame(Box<Frame>, Watch),
}

impl Sums {
    /// Rays, and samples that were rejected.
    fn counters(&self) -> Counters {
        match self {
            Self::Image(merged) => merged.counters,
            Self::Frame(frame, _) => frame.statistics.counters,
        }
    }
}

/// Adds parts up. Without a filter the sums tell the error as they do in a render of the whole; with one the frame is
/// compared with what it was after some of the parts, if somebody asks: then all sums are held.
fn add_up(parts: Parts) -> Result<Sums, PartError> {
    let FrameDescription { filtering, aovs, .. } = &parts.description;
    if *filtering != Filtering::None && !aovs.contains(Aov::Error) {
        return Ok(Sums::Image(Box::new(parts.develop()?)));
    }
    let watch = Watch::new(Goal::default());
    let frame = match filtering {
        Filtering::None => parts.sum()?,
        _ => parts.accumulate(|frame| watch.pass_done(frame))?,
    };
    let statistics = Statistics { counters: frame.counters, ..Statistics::default() };
    Ok(Sums::Frame(Box::new(Traced { frame, statistics }.develop()), watch))
}

/// What is wrong with a part is wrong with the input, unless it is the one to be written.
fn failure(error: PartError) -> Failure {
    match error {
        PartError::File { what: "write", .. } => Failure::Output(error.to_string()),
        PartError::None => Failure::Usage(error.to_string()),
        _ => Failure::Input(error.to_string()),
    }
}
