//! From scene file to film. Read this first: every other module is one line of it.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use filter::{Anchor, PathRecord};
use rayon::prelude::*;

use crate::camera::rendered_pixels;
use crate::compile::names::Names;
use crate::compile::{self, CompileError};
use crate::film::cryptomatte::id;
use crate::film::{self, AovSet, Film, Seen, Taken, Tile};
use crate::filtering::{self, Filtering, FrameFilter, Keep, Keeper, Nothing, SettingError, Surroundings, Watching};
use crate::frame::{Accumulation, FrameDescription, Past, Samples};
use crate::integrator::{self, AlphaTested, Counters, Ids, Opaque, Path, Queries, Recorder, Sample, Unrecorded};
use crate::sampling::{Dimension, Sampler};
use crate::scene::{self, Diagnostic};
use crate::world::{Techniques, World};

/// What to render, and what of the scene file to override.
#[derive(Clone, Debug, Default)]
pub struct Job {
    /// The scene file.
    pub scene: PathBuf,
    /// Where the files are that it names.
    pub path_map: scene::PathMap,
    /// Samples per pixel of the whole frame; `None`: the file's.
    pub spp: Option<u64>,
    /// Seed of all randomness; `None`: the file's.
    pub seed: Option<u64>,
    /// Number of the frame in a sequence, which the seed is mixed with; `None`: there is no sequence.
    pub frame: Option<i32>,
    /// The seed is the same in all frames.
    pub lock_seed: bool,
    /// Size of the frame; `None`: the file's.
    pub resolution: Option<[u32; 2]>,
    /// Pixels to render around the frame on every side.
    pub overscan: u32,
    /// Part of the frame, x0 x1 y0 y1 in [0, 1].
    pub crop: Option<[f32; 4]>,
    /// Part of the frame, x0 x1 y0 y1 in pixels, upper ends exclusive. Wins over `crop`.
    pub pixel_bounds: Option<[i32; 4]>,
    /// The samples of each pixel to take; `None`: `0..spp`.
    pub sample_range: Option<Range<u64>>,
    /// Take one of so many slices of the samples, which the filter's epochs bound; from 0.
    pub slice: Option<Slice>,
    /// Threads that render; 0: as many as there are.
    pub threads: usize,
    /// Auxiliary outputs, besides those that the file asks for.
    pub aovs: AovSet,
    /// Stop at the end of the pass in which this time is over.
    pub time_limit: Option<Duration>,
    /// How lights are found: a diagnostic.
    pub techniques: Techniques,
    /// How the frame is filtered.
    pub filtering: Filtering,
}

/// One of several slices of a frame's samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slice {
    /// Which, from 0.
    pub index: u64,
    /// How many.
    pub count: u64,
}

impl Slice {
    /// The samples of the slice, of `spp` in epochs ([`Filtering::slice_unit`]) that are not cut.
    ///
    /// # Errors
    /// There are fewer epochs than slices, or there is no such slice.
    pub fn samples(self, spp: u64, epoch: u64) -> Result<Range<u64>, RenderError> {
        let Self { index, count } = self;
        let epochs = spp.div_ceil(epoch);
        if index >= count || count > epochs {
            return Err(RenderError::Slice { slice: self, spp, epoch: epoch.min(spp), epochs });
        }
        let first = |k: u64| (u128::from(epochs) * u128::from(k) / u128::from(count)) as u64;
        let border = |k: u64| first(k).saturating_mul(epoch);
        Ok(border(index)..border(index + 1).min(spp))
    }
}

/// What a job is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Reading the scene's files.
    Parse,
    /// Building the world from them.
    Compile,
    /// Tracing paths.
    Render,
}

/// Who is told how a job goes. Called from any thread.
pub trait Observer: Sync {
    /// The picture will not be quite what the scene asks for.
    fn warning(&self, _warning: &Diagnostic) {}
    /// A phase begins.
    fn phase(&self, _phase: Phase) {}
    /// The share of the samples that is done, in [0, 1], monotone.
    fn progress(&self, _done: f64) {}
    /// A pass is done: every pixel has the same samples, and what there is may be stored or looked at.
    fn pass_done(&self, _frame: &mut Accumulation) {}
    /// Whether to stop: at the end of the pass.
    fn stop_requested(&self) -> bool {
        false
    }
    /// Whether the frame may be gone on with later, to the same bytes: a limit of time then ends it between blocks only.
    fn goes_on(&self) -> bool {
        false
    }
    /// Number of samples per pixel at which [`Self::look`] is to be called, even if a pass does not end there.
    fn next_look(&self) -> u64 {
        u64::MAX
    }
    /// Every pixel has so many samples, and the film is filtered if it is to be: whether the frame ends here.
    fn look(&self, _film: &Film, _samples: u64) -> bool {
        false
    }
}

/// An observer that does not look.
pub struct Unobserved;

impl Observer for Unobserved {}

/// What a job cannot go on from.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The scene's files are wrong; warnings are among the messages.
    #[error("the scene cannot be read: {}", count_errors(.0))]
    Scene(Vec<Diagnostic>),
    /// The scene cannot be built; warnings are among the messages.
    #[error("the scene cannot be built: {}", count_errors(.0))]
    Compile(Vec<Diagnostic>),
    /// Embree does not start.
    #[error("Embree cannot be used: {0}")]
    Embree(#[from] embree::Error),
    /// OpenImageIO does not take its settings.
    #[error("OpenImageIO cannot be used: {0}")]
    OpenImageIo(#[from] oiio::Error),
    /// No threads.
    #[error("cannot start {threads} render threads: {why}")]
    Threads {
        /// How many were asked for.
        threads: usize,
        /// What the system says.
        why: rayon::ThreadPoolBuildError,
    },
    /// No pixels to render.
    #[error("{option} leaves no pixel of the frame of {} x {} pixels to render", size[0], size[1])]
    EmptyWindow {
        /// What was asked for.
        option: &'static str,
        /// The frame, in pixels.
        size: [u32; 2],
    },
    /// Nothing to do.
    #[error("the sample range {}:{} is empty; the first number must be less than the second", .0.start, .0.end)]
    EmptySampleRange(Range<u64>),
    /// The frame is larger than the machine.
    #[error(
        "a frame of {} x {} pixels takes {} GB at least, more than there is memory: render parts of it with --crop or \
         --pixel-bounds, with fewer auxiliary outputs, or with --filter none",
        size[0], size[1], bytes.div_ceil(1_000_000_000)
    )]
    Memory {
        /// The part that is to be rendered, in pixels.
        size: [u32; 2],
        /// What its sums take.
        bytes: u64,
    },
    /// There is no such slice.
    #[error(
        "there is no slice {}/{}: slices count from 0, and {spp} samples that share by {epoch} make at most {epochs}; \
         take fewer slices or more samples{}", slice.index, slice.count, shorter_epoch(*slice, *spp, *epoch)
    )]
    Slice {
        /// The slice.
        slice: Slice,
        /// Samples of the frame.
        spp: u64,
        /// Samples that share.
        epoch: u64,
        /// So many times.
        epochs: u64,
    },
    /// More than sums hold.
    #[error("{0} samples per pixel are more than one job can take, {most}; ask for fewer, or for a sample range", most = film::MOST_TERMS)]
    TooManySamples(u64),
    /// The filter does not take its settings.
    #[error(transparent)]
    Filter(#[from] SettingError),
}

/// What else makes so many slices, if samples share: an epoch that slices have whole numbers of.
fn shorter_epoch(slice: Slice, spp: u64, epoch: u64) -> String {
    match (spp / slice.count.max(1)).checked_ilog2() {
        Some(power) if 1 << power < epoch => format!(
            ", or --filter-set epoch={},growing=off: samples share with fewer others, for a little more noise",
            1u64 << power
        ),
        _ => String::new(),
    }
}

fn count_errors(diagnostics: &[Diagnostic]) -> String {
    match diagnostics.iter().filter(|d| d.severity == scene::Severity::Error).count() {
        1 => "1 error".into(),
        n => format!("{n} errors"),
    }
}

/// A rendered frame.
pub struct Frame {
    /// All sums, and the filtered image.
    pub film: Film,
    /// What was rendered, for the image's metadata.
    pub description: FrameDescription,
    /// The samples of each pixel that were taken.
    pub samples: Samples,
    /// What it took.
    pub statistics: Statistics,
    /// What the next frame of a sequence is to go on from.
    pub past: Option<Past>,
}

impl Frame {
    /// Whether all samples that were asked for were taken.
    pub fn complete(&self) -> bool {
        self.samples.missing(&self.description.asked).is_empty()
    }
}

/// What a job took.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Seconds of reading.
    pub parse_seconds: f64,
    /// Seconds of building.
    pub compile_seconds: f64,
    /// Seconds of tracing.
    pub render_seconds: f64,
    /// Threads that traced.
    pub threads: usize,
    /// Passes over the frame.
    pub passes: u64,
    /// Rays and samples.
    pub counters: Counters,
    /// Those of them that an earlier run had traced.
    pub restored: Counters,
    /// Bytes that Embree held, at most.
    pub embree_bytes: u64,
    /// Bytes of the film.
    pub film_bytes: u64,
    /// Triangles and other primitives, with every instance counted.
    pub primitives: u64,
    /// Of those, the ones in memory.
    pub unique_primitives: u64,
    /// Seconds of filtering, of those of rendering.
    pub filter_seconds: f64,
    /// What the filter did.
    pub filter: Option<filtering::Report>,
}

/// A scene that is read and built, with what of the job it decides.
pub struct Prepared {
    /// The world.
    pub world: World,
    /// What will be rendered.
    pub description: FrameDescription,
    /// Seconds so far.
    pub statistics: Statistics,
    /// Owns the BVH's memory.
    pub device: embree::Device,
    /// Ids of the names of objects and materials, where a matte shows them.
    ids: Option<Ids>,
}

/// Renders one job.
///
/// # Errors
/// A scene that cannot be read or built, a machine that cannot run it; nothing after the first sample.
pub fn render(job: &Job, observer: &dyn Observer) -> Result<Frame, RenderError> {
    let pool = thread_pool(job.threads)?;
    let prepared = pool.install(|| prepare(job, observer))?;
    check_memory(&prepared)?;
    Ok(pool.install(|| trace(prepared, None, job.time_limit, observer).develop()))
}

/// Bytes that a frame takes at least, besides its world: sums of pixels, and one path for each of them if it is filtered.
pub fn least_memory(prepared: &Prepared) -> u64 {
    let FrameDescription { bounds, filtering, .. } = &prepared.description;
    let filtered = *filtering != Filtering::None;
    let records = if filtered { bounds.area() * size_of::<filter::PathRecord>() as u64 } else { 0 };
    Film::memory(*bounds, &prepared.description.outputs(), filtered) + records
}

/// Whether the system would give what a frame takes at least. It is asked for all at once, and gets it back untouched.
///
/// # Errors
/// It would not.
pub fn check_memory(prepared: &Prepared) -> Result<(), RenderError> {
    let (bytes, bounds) = (least_memory(prepared), prepared.description.bounds);
    let fits = usize::try_from(bytes).is_ok_and(|bytes| Vec::<u8>::new().try_reserve_exact(bytes).is_ok());
    if fits { Ok(()) } else { Err(RenderError::Memory { size: [bounds.width(), bounds.height()], bytes }) }
}

/// The threads of a job.
///
/// # Errors
/// When the system gives none.
pub fn thread_pool(threads: usize) -> Result<rayon::ThreadPool, RenderError> {
    let builder = rayon::ThreadPoolBuilder::new().num_threads(threads).thread_name(|index| format!("render-{index}"));
    builder.build().map_err(|why| RenderError::Threads { threads, why })
}

/// Reads and builds the scene of a job.
///
/// # Errors
/// All that is wrong with the scene, not the first of it.
pub fn prepare(job: &Job, observer: &dyn Observer) -> Result<Prepared, RenderError> {
    let mut statistics = Statistics { threads: rayon::current_num_threads(), ..Statistics::default() };
    // Images are read by our own threads, one each: OpenImageIO's pool would only contend with them.
    oiio::set_threads(1)?;
    let mut description = described(job, &mut statistics, observer)?;

    let seed = job.seed.unwrap_or(description.seed);
    let seed = if job.lock_seed { seed } else { job.frame.map_or(seed, |frame| seed_of_frame(seed, frame)) };
    let spp = job.spp.unwrap_or(description.spp).max(1);
    let spp = job.sample_range.as_ref().map_or(spp, |range| spp.max(range.end));
    job.filtering.validate()?;
    let filtering = job.filtering.settled(spp);
    let asked = samples(job, spp, &filtering)?;
    let aovs = if description.film.gbuffer { job.aovs.union(AovSet::gbuffer()) } else { job.aovs };

    let (world, device) = built(job, &mut description, &mut statistics, observer)?;

    let mattes = [film::Aov::CryptoObject, film::Aov::CryptoMaterial].map(|aov| aovs.contains(aov));
    let names = mattes.contains(&true).then(|| Names::new(&description, &world.geometry));
    let ids = names.as_ref().map(ids);
    let names = names.unwrap_or_default();
    let manifest = |(shown, names): (bool, &[Arc<str>])| if shown { sorted(names) } else { Vec::new() };
    let named = [(mattes[0], &names.objects[..]), (mattes[1], &names.materials[..])];

    let ours_from_world = glam::DMat4::from_translation(-world.origin);
    let (low, high) = world.geometry.bounds();
    let mut description = FrameDescription {
        number: job.frame.unwrap_or(1),
        seed,
        spp,
        asked,
        scene_hash: description.hash(),
        resolution: world.sensor.resolution,
        overscan: world.sensor.overscan,
        bounds: world.sensor.bounds,
        aovs,
        light_groups: world.lights.groups().to_vec(),
        names: [manifest(named[0]), manifest(named[1])],
        filtering,
        surroundings: Surroundings {
            anchor: Anchor { origin: world.camera.position().as_dvec3(), extent: f64::from(low.distance(high)) },
            unit: 1.0,
            response: world.sensor.response,
        },
        origin: world.origin,
        camera_from_world: description.camera.world_from_camera.inverse().matrix() * ours_from_world,
        ndc_from_world: world.camera.ndc_from_world().map(|ndc_from_ours| ndc_from_ours * ours_from_world),
        filename: description.film.filename.clone(),
    };
    if description.filtering != Filtering::None {
        let pilot = match world.geometry.alpha_test(&world.textures) {
            None => Pilot::new(&world, &Opaque(world.geometry.scene()), seed),
            Some(alpha) => Pilot::new(&world, &AlphaTested { scene: world.geometry.scene(), alpha }, seed),
        };
        let Surroundings { unit, anchor, .. } = &mut description.surroundings;
        *unit = pilot.unit;
        anchor.extent = anchor.extent.min(pilot.extent);
    }
    Ok(Prepared { world, description, statistics, device, ids })
}

/// The scene as its files and the job describe it.
fn described(
    job: &Job,
    statistics: &mut Statistics,
    observer: &dyn Observer,
) -> Result<scene::description::Scene, RenderError> {
    observer.phase(Phase::Parse);
    let start = Instant::now();
    let (mut description, warnings) =
        scene::pbrt::load_mapped(&job.scene, &job.path_map).map_err(RenderError::Scene)?;
    warnings.iter().for_each(|warning| observer.warning(warning));
    apply(job, &mut description);
    check_window(job, &description.film)?;
    statistics.parse_seconds = start.elapsed().as_secs_f64();
    Ok(description)
}

/// The samples that a job asks of a frame of `spp`.
fn samples(job: &Job, spp: u64, filtering: &Filtering) -> Result<Range<u64>, RenderError> {
    let asked = match job.slice {
        Some(slice) => slice.samples(spp, filtering.slice_unit())?,
        None => job.sample_range.clone().unwrap_or(0..spp),
    };
    if asked.is_empty() {
        return Err(RenderError::EmptySampleRange(asked));
    }
    match asked.end - asked.start {
        ..=film::MOST_TERMS => Ok(asked),
        // As many as time allows, which is not so many.
        _ if job.time_limit.is_some() => Ok(asked.start..asked.start + film::MOST_TERMS),
        count => Err(RenderError::TooManySamples(count)),
    }
}

/// The world of a description, and the device that its geometry lives on.
fn built(
    job: &Job,
    description: &mut scene::description::Scene,
    statistics: &mut Statistics,
    observer: &dyn Observer,
) -> Result<(World, embree::Device), RenderError> {
    observer.phase(Phase::Compile);
    let start = Instant::now();
    let device = embree::Device::new(&embree::DeviceOptions::default())?;
    let (world, warnings) =
        compile::origin::world(description, &device, job.techniques).map_err(|errors| match errors {
            CompileError::Scene(diagnostics) => RenderError::Compile(diagnostics),
            CompileError::Embree(error) => RenderError::Embree(error),
        })?;
    warnings.iter().for_each(|warning| observer.warning(warning));
    statistics.compile_seconds = start.elapsed().as_secs_f64();
    statistics.embree_bytes = device.memory().peak;
    (statistics.primitives, statistics.unique_primitives) = world.geometry.primitive_counts();
    Ok((world, device))
}

/// The ids of names.
fn ids(names: &Names) -> Ids {
    let names_of = names.objects.iter().zip(&names.materials);
    let surfaces = names_of.map(|(object, material)| [id(object), id(material)]).collect();
    Ids { surfaces, instances: names.instances.clone() }
}

/// Each name once.
fn sorted(names: &[Arc<str>]) -> Vec<Arc<str>> {
    names.iter().cloned().collect::<BTreeSet<_>>().into_iter().collect()
}

/// The seed of one frame of a sequence.
///
/// **Source**: the finaliser of SplitMix64 \[Steele14\].
fn seed_of_frame(seed: u64, frame: i32) -> u64 {
    let mut bits = (i64::from(frame) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ bits >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ bits >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    seed ^ bits ^ bits >> 31
}

/// Traces all passes of a prepared job that `begun` does not hold yet.
///
/// # Panics
/// If `begun` is another frame.
pub fn trace(
    prepared: Prepared,
    begun: Option<Accumulation>,
    time_limit: Option<Duration>,
    observer: &dyn Observer,
) -> Traced {
    observer.phase(Phase::Render);
    let start = Instant::now();
    let mut frame = begun.unwrap_or_else(|| Accumulation::new(prepared.description.clone()));
    assert_eq!(frame.description.difference(&prepared.description), None, "another frame was begun");
    frame.description = prepared.description;
    let clock = Clock { start, limit: time_limit, done: frame.samples.count() };
    let Prepared { world, mut statistics, ids, .. } = prepared;
    statistics.restored = frame.counters;
    let ids = ids.as_ref();
    let last = match world.geometry.alpha_test(&world.textures) {
        None => {
            trace_passes(&world, &Opaque(world.geometry.scene()), ids, &mut frame, &mut statistics, observer, &clock)
        }
        Some(alpha) => {
            let queries = AlphaTested { scene: world.geometry.scene(), alpha };
            trace_passes(&world, &queries, ids, &mut frame, &mut statistics, observer, &clock)
        }
    };
    // The filter is largest at the end, and by then nobody needs the scene any more.
    drop(world);
    if let (Some(filter), Some((block, records))) = (&mut frame.filter, last) {
        let start = Instant::now();
        filter.add_last(&block, records);
        statistics.filter_seconds += start.elapsed().as_secs_f64();
        observer.pass_done(&mut frame);
    }
    statistics.film_bytes = frame.film.bytes();
    statistics.counters = frame.counters;
    statistics.render_seconds = start.elapsed().as_secs_f64();
    Traced { frame, statistics }
}

/// A frame whose samples are taken.
pub struct Traced {
    /// All that they added up to.
    pub frame: Accumulation,
    /// What it took.
    pub statistics: Statistics,
}

impl Traced {
    /// The frame with its sums alone, where nobody looks at an image.
    pub fn undeveloped(self) -> Frame {
        let Self { frame, statistics } = self;
        Frame { film: frame.film, description: frame.description, samples: frame.samples, statistics, past: None }
    }

    /// The frame's image, filtered if it is to be.
    pub fn develop(self) -> Frame {
        let Self { mut frame, mut statistics } = self;
        let start = Instant::now();
        let (report, past) = frame.finish().unzip();
        statistics.filter = report;
        let seconds = start.elapsed().as_secs_f64();
        statistics.filter_seconds += seconds;
        statistics.render_seconds += seconds;
        let past = past.flatten();
        Frame { film: frame.film, description: frame.description, samples: frame.samples, statistics, past }
    }
}

/// The samples of a block, and its paths by tile.
type Block = (Range<u64>, Vec<Vec<PathRecord>>);

/// Traces all passes, filtered or not. The last block of a filtered frame is left to be added to the filter; the observer is
/// to be told of it then.
fn trace_passes<Q: Queries + Sync>(
    world: &World,
    queries: &Q,
    ids: Option<&Ids>,
    frame: &mut Accumulation,
    statistics: &mut Statistics,
    observer: &dyn Observer,
    clock: &Clock,
) -> Option<Block> {
    let mut rest = frame.samples.missing(&frame.description.asked);
    let progress = Progress::new(&frame.film, &frame.description.asked, rest.start, observer);
    let passes = Passes { world, queries, sampler: Sampler::new(frame.description.seed), ids, progress };
    let over = || clock.is_over() || observer.stop_requested();
    while !rest.is_empty() && (frame.samples.count() == 0 || !over()) {
        let pass = frame.pass(&rest);
        let last;
        (rest.start, last) = passes.trace_pass(&pass, frame, statistics, observer, clock);
        statistics.passes += 1;
        if let Some(records) = last {
            return Some((pass.start..rest.start, records));
        }
        observer.pass_done(frame);
        if rest.start < pass.end {
            break;
        }
        if rest.is_empty() {
            // What was stored of a frame may have gaps.
            rest = frame.samples.missing(&frame.description.asked);
        }
    }
    None
}

/// All that a pass over the frame needs.
struct Passes<'a, Q> {
    world: &'a World,
    queries: &'a Q,
    sampler: Sampler,
    /// See [`Prepared::ids`].
    ids: Option<&'a Ids>,
    progress: Progress<'a>,
}

impl<Q: Queries + Sync> Passes<'_, Q> {
    /// Traces a pass, or as much of it as the observer wants or there is time for; the first sample that was not traced, and
    /// the paths of the last block of a filtered frame.
    fn trace_pass(
        &self,
        pass: &Range<u64>,
        frame: &mut Accumulation,
        statistics: &mut Statistics,
        observer: &dyn Observer,
        clock: &Clock,
    ) -> (u64, Option<Vec<Vec<PathRecord>>>) {
        let mut records = frame.filter.as_mut().map(FrameFilter::room).unwrap_or_default();
        let divisible = frame.filter.as_ref().is_none_or(FrameFilter::divisible);
        let open = frame.filter.as_ref().is_none_or(|filter| filter.is_open() && !observer.goes_on());
        let mut next = pass.start;
        loop {
            let done = frame.samples.count();
            let look = if divisible { first_look(&(next..pass.end), done, observer.next_look()) } else { pass.end };
            let end = if open { look.min(next.saturating_add(clock.affords(done))) } else { look };
            let counters = self.add(&(next..end), frame, &mut records);
            frame.counters += counters;
            frame.samples.insert(next..end).expect("passes do not overlap");
            next = end;
            if next == pass.end {
                break;
            }
            if next < look {
                if clock.is_over() {
                    break;
                }
                continue;
            }
            frame.develop_with(&(pass.start..next), &records);
            if observer.look(&frame.film, frame.samples.count()) {
                break;
            }
        }
        let Some(filter) = &mut frame.filter else { return (next, None) };
        if next == frame.description.asked.end {
            return (next, Some(records));
        }
        let start = Instant::now();
        filter.add(&(pass.start..next), &records);
        filter.set_room(records);
        statistics.filter_seconds += start.elapsed().as_secs_f64();
        (next, None)
    }

    /// Adds samples of every pixel to the film, and what a filter is to have of them to `records`, by tile.
    fn add(&self, samples: &Range<u64>, frame: &mut Accumulation, records: &mut Vec<Vec<PathRecord>>) -> Counters {
        let Some(filter) = &frame.filter else {
            let nothing = (0..frame.film.tile_count()).map(|_| Nothing).collect();
            return self.watch(samples, &mut frame.film, nothing).0;
        };
        let keepers = filter.keepers(std::mem::take(records), samples);
        let (counters, paths) = self.watch(samples, &mut frame.film, keepers);
        *records = paths.into_iter().map(|paths| paths.records).collect();
        counters
    }

    /// Traces samples `pass` of every pixel, looking aside if the film wants it, with a keeper for each tile: they are
    /// returned.
    fn watch<K: Keeper>(&self, pass: &Range<u64>, film: &mut Film, keepers: Vec<K>) -> (Counters, Vec<K>) {
        if !film.aside() {
            return self.trace(pass, film, keepers);
        }
        let groups = film.outputs().groups.len();
        let watching = keepers.into_iter().map(|keeper| Watching { keeper, groups, ids: self.ids });
        let (counters, kept) = self.trace(pass, film, watching.collect());
        (counters, kept.into_iter().map(|watching| watching.keeper).collect())
    }

    /// Traces samples `pass` of every pixel.
    fn trace<K: Keeper>(&self, pass: &Range<u64>, film: &mut Film, mut keepers: Vec<K>) -> (Counters, Vec<K>) {
        let first_hit = film.first_hit();
        let mut tiles = film.tiles();
        let counters = (&mut tiles, &mut keepers).into_par_iter().map(|(tile, keeper)| {
            let counters = trace_tile(self.world, self.queries, tile, pass, &self.sampler, first_hit, keeper);
            self.progress.add(counters.camera_rays);
            counters
        });
        let counters: Vec<Counters> = counters.collect();
        let mut sum = Counters::default();
        counters.into_iter().for_each(|counters| sum += counters);
        (sum, keepers)
    }
}

/// The time that rendering may take.
struct Clock {
    start: Instant,
    limit: Option<Duration>,
    /// Samples per pixel that there were at the start.
    done: u64,
}

impl Clock {
    fn is_over(&self) -> bool {
        self.limit.is_some_and(|limit| self.start.elapsed() >= limit)
    }

    /// How many more samples per pixel there will be time for, now that there are `samples`; at least one.
    fn affords(&self, samples: u64) -> u64 {
        let Some(limit) = self.limit else { return u64::MAX };
        let taken = self.start.elapsed();
        let per_sample = taken.as_secs_f64() / samples.saturating_sub(self.done) as f64;
        // With none to go by that is infinite, and what it affords is one.
        ((limit.saturating_sub(taken).as_secs_f64() / per_sample) as u64).max(1)
    }
}

/// Where to end the next piece of `rest` when `done` samples are done and somebody wants to look at `look`.
///
/// Not at all if what is left then is less than an eighth of the samples: it changes little, and to look in mid-pass costs
/// a copy of the filter.
fn first_look(rest: &Range<u64>, done: u64, look: u64) -> u64 {
    let end = rest.start.saturating_add(look.saturating_sub(done).max(1));
    if end < rest.end && (rest.end - end).saturating_mul(8) > look { end } else { rest.end }
}

/// What a few paths all over the frame find, the same for every part of the frame's samples.
struct Pilot {
    /// Radiance of the order of the frame's mean.
    unit: f32,
    /// A length of the order of what is seen, which a thing that is far from everything does not change: four times the
    /// median distance to the first hit. Infinite if nothing is hit.
    extent: f64,
}

impl Pilot {
    fn new<Q: Queries>(world: &World, queries: &Q, seed: u64) -> Self {
        let sampler = Sampler::new(seed);
        let [width, height] = world.sensor.resolution;
        let (mut sum, mut lit) = (0.0, 0.0);
        let mut distances = Vec::new();
        for k in 0..PILOT_PATHS {
            // Rows and columns by two numbers without common structure.
            let at = sampler.pixel_sample([0, 0], k).d2(Dimension::FILM);
            let pixel = [(at.x * width as f32) as u32, (at.y * height as f32) as u32];
            let numbers = sampler.pixel_sample(pixel, u64::MAX - k);
            let film_point = glam::Vec2::new(pixel[0] as f32 + 0.5, pixel[1] as f32 + 0.5);
            let Some(camera) = world.camera.ray(film_point, numbers.d2(Dimension::LENS)) else { continue };
            let mut path = Path::new(&camera, numbers, Unrecorded);
            integrator::trace(world, queries, std::iter::once(&mut path), true, &mut Counters::default());
            let (sample, _) = path.end();
            distances.extend((sample.first.depth > 0.0).then_some(sample.first.depth));
            let radiance = f64::from(sample.radiance.element_sum() / 3.0);
            if radiance > 0.0 && radiance.is_finite() {
                sum += radiance;
                lit += 1.0;
            }
        }
        distances.sort_unstable_by(f32::total_cmp);
        let median = distances.get(distances.len() / 2).map_or(f64::INFINITY, |distance| f64::from(*distance));
        Self { unit: if lit > 0.0 { (sum / lit) as f32 } else { 1.0 }, extent: 4.0 * median }
    }
}

/// Paths that find the orders of the frame's radiance and distances, of which a power of two matters.
const PILOT_PATHS: u64 = 512;

/// Traces samples `pass` of every pixel of one tile.
pub fn trace_tile<Q: Queries, K: Keeper>(
    world: &World,
    queries: &Q,
    tile: &mut Tile<'_>,
    pass: &Range<u64>,
    sampler: &Sampler,
    first_hit: bool,
    keeper: &mut K,
) -> Counters {
    let mut counters = Counters::default();
    let mut samples = tile.numbers().flat_map(|pixel| pass.clone().map(move |index| (pixel, index)));
    let mut begun = Vec::with_capacity(ABREAST);
    loop {
        let next = samples.by_ref().take(ABREAST);
        begun.extend(next.map(|(pixel, index)| Begun::new(world, sampler, pixel, tile.at(pixel), index, keeper)));
        if begun.is_empty() {
            return counters;
        }
        counters.camera_rays += begun.len() as u64;
        let paths = begun.iter_mut().filter_map(|begun| begun.path.as_mut());
        integrator::trace(world, queries, paths, first_hit, &mut counters);
        begun.drain(..).for_each(|begun| begun.add(world, tile, keeper, &mut counters));
    }
}

/// Paths that a thread traces side by side: enough that a stage of all of them is worth fetching its code for, and few
/// enough that they stay in the first caches.
const ABREAST: usize = 16;

/// A sample that is being taken.
struct Begun<'w, R> {
    /// The pixel's number in its tile.
    pixel: u32,
    /// The sample's number in the pixel.
    index: u64,
    /// Of the pixel filter.
    weight: f32,
    /// `None`: the camera sees nothing there.
    path: Option<Path<'w, R>>,
}

impl<'w, R: Recorder> Begun<'w, R> {
    fn new<K: Keeper<Recorder = R>>(
        world: &World,
        sampler: &Sampler,
        pixel: u32,
        at: [u32; 2],
        index: u64,
        keeper: &K,
    ) -> Self {
        let [x, y] = world.sensor.in_frame(at);
        let numbers = sampler.pixel_sample([x as u32, y as u32], index);
        let offset = world.filter.sample(numbers.d2(Dimension::FILM));
        let film_point = glam::Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + offset.offset;
        let camera = world.camera.ray(film_point, numbers.d2(Dimension::LENS));
        let path = camera.map(|camera| Path::new(&camera, numbers, keeper.recorder()));
        Self { pixel, index, weight: offset.weight, path }
    }

    /// Adds what the path has brought to its pixel.
    fn add<K: Keeper<Recorder = R>>(self, world: &World, tile: &mut Tile<'_>, keeper: &mut K, counters: &mut Counters) {
        let Self { pixel, index, weight, path } = self;
        let mut pixel = tile.pixel(pixel);
        let (sample, mut recorder) = path.map_or_else(|| (Sample::default(), keeper.recorder()), Path::end);
        let mut found = sample.radiance;
        let (mut radiance, mut exposure) = world.sensor.expose(found);
        // A sensor's response may leave its gamut: negative is rejected only as radiance.
        if !radiance.is_finite() || found.min_element() < 0.0 {
            counters.rejected_samples += 1;
            (found, radiance, exposure) = (glam::Vec3::ZERO, glam::Vec3::ZERO, 0.0);
            recorder = keeper.recorder();
        }
        let kept = Keep { slot: pixel.index, index, radiance: found, weight, share: exposure };
        let prefix = keeper.keep(&recorder, kept) * exposure;
        let film_from_scene = world.sensor.response * exposure;
        let seen = keeper.aside(&recorder).map(|aside| Seen { aside, film_from_scene });
        pixel.add(&Taken { index, radiance, alpha: sample.alpha, weight, prefix, first: &sample.first, seen });
    }
}

/// Counts camera rays over all threads and tells the observer, seldom enough that counting costs nothing.
struct Progress<'a> {
    observer: &'a dyn Observer,
    total: f64,
    done: AtomicU64,
    told_permille: AtomicU64,
    telling: AtomicBool,
}

impl<'a> Progress<'a> {
    /// Of `samples`, of which those before `next` are done.
    fn new(film: &Film, samples: &Range<u64>, next: u64, observer: &'a dyn Observer) -> Self {
        let pixels = film.bounds().area();
        let total = pixels as f64 * (samples.end - samples.start) as f64;
        let done = AtomicU64::new(pixels.saturating_mul(next - samples.start));
        let (told_permille, telling) = Default::default();
        Self { observer, total, done, told_permille, telling }
    }

    fn add(&self, rays: u64) {
        let done = (self.done.fetch_add(rays, Ordering::Relaxed) + rays) as f64 / self.total;
        let permille = (done * 1000.0) as u64;
        // One thread tells at a time, and only more than was told before: the observer sees a monotone sequence.
        if permille > self.told_permille.load(Ordering::Relaxed) && !self.telling.swap(true, Ordering::Acquire) {
            if permille > self.told_permille.load(Ordering::Relaxed) {
                self.told_permille.store(permille, Ordering::Relaxed);
                self.observer.progress(done);
            }
            self.telling.store(false, Ordering::Release);
        }
    }
}

/// Lets the job's overrides stand in for what the file says.
fn apply(job: &Job, description: &mut scene::Scene) {
    if let Some(resolution) = job.resolution {
        description.film.resolution = resolution;
        description.film.pixel_bounds = None;
    }
    description.film.overscan = job.overscan;
    if let Some(crop) = job.crop {
        description.film.crop_window = Some(crop);
        description.film.pixel_bounds = None;
    }
    if let Some(bounds) = job.pixel_bounds {
        description.film.pixel_bounds = Some(bounds);
    }
}

/// Makes sure that a window which the job gives, not the scene, holds pixels.
fn check_window(job: &Job, film: &scene::description::Film) -> Result<(), RenderError> {
    let option = match (job.pixel_bounds, job.crop) {
        (Some(_), _) => "--pixel-bounds",
        (None, Some(_)) => "--crop",
        (None, None) => return Ok(()),
    };
    match rendered_pixels(film.resolution, film.overscan, film.crop_window, film.pixel_bounds) {
        Some(_) => Ok(()),
        None => Err(RenderError::EmptyWindow { option, size: film.resolution }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_are_whole_epochs_and_make_the_whole() {
        for (spp, epoch) in [(16, 4), (30, 4), (7, 1), (64, 64), (1, 4), (u64::MAX, 8)] {
            for count in [1, 2, 3, 7] {
                let slices: Result<Vec<_>, _> =
                    (0..count).map(|index| Slice { index, count }.samples(spp, epoch)).collect();
                let Ok(slices) = slices else {
                    assert!(spp.div_ceil(epoch) < count);
                    continue;
                };
                assert_eq!((slices[0].start, slices[slices.len() - 1].end), (0, spp));
                assert!(slices.iter().all(|slice| !slice.is_empty() && slice.start % epoch == 0));
                assert!(slices.windows(2).all(|pair| pair[0].end == pair[1].start));
            }
        }
        assert!(Slice { index: 2, count: 2 }.samples(16, 4).is_err());
    }

    #[test]
    fn a_refused_slice_is_told_of_an_epoch_that_makes_it() {
        for (spp, epoch, count, shorter) in
            [(512, 64, 16, Some(32)), (100, 8, 16, Some(4)), (8, 4, 4, Some(2)), (4, 4, 8, None), (7, 1, 9, None)]
        {
            let slice = Slice { index: 0, count };
            let refusal = slice.samples(spp, epoch).unwrap_err().to_string();
            let told = shorter.map(|shorter| format!("epoch={shorter},"));
            assert_eq!(refusal.contains("epoch="), told.is_some(), "{refusal}");
            if let Some((told, shorter)) = told.zip(shorter) {
                assert!(refusal.contains(&told) && slice.samples(spp, shorter).is_ok(), "{refusal}");
            }
        }
    }

    #[test]
    fn looks_divide_passes_while_samples_are_few() {
        // As asked; at least a sample; the whole pass; no eighth of the samples left.
        assert_eq!(first_look(&(0..16), 0, 2), 2);
        assert_eq!(first_look(&(2..16), 2, 1), 3);
        assert_eq!(first_look(&(4..8), 4, u64::MAX), 8);
        assert_eq!(first_look(&(96..112), 96, 105), 112);
        assert_eq!(first_look(&(96..128), 96, 105), 105);
        // Of a slice that begins at sample 32.
        assert_eq!(first_look(&(34..48), 2, 4), 36);
    }

    #[test]
    fn seeds_of_frames_differ() {
        let mut seeds: Vec<u64> = (-500..500).map(|frame| seed_of_frame(7, frame)).collect();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), 1000);
    }
}
