//! `tessera merge`: parts of a frame's samples become the frame.

use std::path::Path;
use std::time::Instant;

use renderer::error::{Goal, Watch};
use renderer::film::{Aov, exr};
use renderer::filtering::Filtering;
use renderer::frame::{Accumulation, Samples};
use renderer::part::{self, Part, PartError};
use renderer::render::{Statistics, Traced};

use crate::args::MergeArguments;
use crate::exit::Failure;
use crate::job;
use crate::log::Log;
use crate::metadata;
use crate::output::OutputFile;

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
    let parts = arguments.parts.iter().map(|path| Part::open(path)).collect::<Result<Vec<_>, _>>().map_err(refused)?;
    let missing = check(&parts)?;
    let encoding = job::encoding(&arguments.encoding);
    parts.first().map_or(Ok(()), |part| job::check_encoding(&encoding, part.description.aovs))?;
    if let Some(missing) = missing.filter(|_| !to_part && !arguments.partial) {
        return Err(Failure::Input(format!(
            "samples {}:{} of {} are in none of the parts; add the part that has them, or give --partial for an image of \
             what there is",
            missing.start, missing.end, parts[0].description.spp
        )));
    }
    let count = parts.len();
    let mut frame: Option<Accumulation> = None;
    let watch = watch(&parts);
    for part in parts {
        log.verbose(&format!("adding {}: samples {}", part.path.display(), part.samples));
        let frame = frame.get_or_insert_with(|| {
            let mut description = part.description.clone();
            description.asked = 0..description.spp;
            Accumulation::new(description)
        });
        part.add_to(frame).map_err(refused)?;
        if let Some(watch) = watch.as_ref().filter(|_| !to_part) {
            pool.install(|| watch.pass_done(frame));
        }
    }
    let mut frame = frame.ok_or_else(|| Failure::Usage("there are no parts to merge".into()))?;
    if to_part {
        part::write(&mut frame, file.target()).map_err(|error| Failure::Output(error.to_string()))?;
        tell(log, output, count, &frame.samples, start);
        return Ok(());
    }
    let statistics = Statistics { counters: frame.counters, ..Statistics::default() };
    let mut frame = pool.install(|| Traced { frame, statistics }.develop());
    let error = watch.and_then(|watch| watch.finish(&mut frame.film));
    if let Err(error) = oiio::set_threads(pool.current_num_threads()) {
        log.verbose(&format!("{error}; its default stays"));
    }
    let attributes = metadata::of_frame(&frame, error.as_ref(), arguments.provenance);
    exr::write_as(&frame.film, attributes, &encoding, file.target())
        .map_err(|error| Failure::Output(error.to_string()))?;
    tell(log, output, count, &frame.samples, start);
    Ok(())
}

/// Who looks at the frame's error. Without a filter the sums tell it as they do in a render of the whole; with one the frame
/// is compared with what it was after some of the parts, if somebody asks.
fn watch(parts: &[Part]) -> Option<Watch> {
    let description = &parts.first()?.description;
    let asked = description.filtering == Filtering::None || description.aovs.contains(Aov::Error);
    asked.then(|| Watch::new(Goal::default()))
}

/// Makes sure that all parts are of one frame and share no sample, before any of them is read; the first samples that none
/// has.
fn check(parts: &[Part]) -> Result<Option<std::ops::Range<u64>>, Failure> {
    let Some(first) = parts.first() else { return Ok(None) };
    let mut samples = Samples::default();
    for (at, part) in parts.iter().enumerate() {
        if let Some((what, ours, theirs)) = first.description.difference(&part.description) {
            return Err(Failure::Input(format!(
                "{} and {} are of different pictures: their {what} is \"{ours}\" and \"{theirs}\"",
                first.path.display(),
                part.path.display()
            )));
        }
        for range in part.samples.ranges() {
            let Err(both) = samples.insert(range.clone()) else { continue };
            let has = |other: &&Part| {
                other.samples.ranges().iter().any(|known| known.start < both.end && both.start < known.end)
            };
            let other = parts[..at].iter().find(has).unwrap_or(first);
            return Err(Failure::Input(format!(
                "{} and {} both have samples {}:{}; leave one of them out",
                other.path.display(),
                part.path.display(),
                both.start,
                both.end
            )));
        }
    }
    Ok(Some(samples.missing(&(0..first.description.spp))).filter(|missing| !missing.is_empty()))
}

fn refused(error: PartError) -> Failure {
    Failure::Input(error.to_string())
}

fn tell(log: &Log, output: &Path, count: usize, samples: &Samples, start: Instant) {
    log.info(&format!(
        "wrote {}: samples {samples} of {count} parts, in {:.2} s",
        output.display(),
        start.elapsed().as_secs_f64()
    ));
}
