//! From scene file to film. Read this first: every other module is one line of it.

use std::ops::Range;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use crate::compile::{self, CompileError};
use crate::film::{AovSet, Film, Tile, TilePixel};
use crate::filtering::{self, Filtering, FrameFilter, Keep, Keeper, Nothing, Paths, SettingError};
use crate::integrator::{self, AlphaTested, Counters, Opaque, Queries, Sample, Unrecorded};
use crate::sampling::{Dimension, Sampler};
use crate::scene::{self, Diagnostic};
use crate::world::{Techniques, World};

/// What to render, and what of the scene file to override.
#[derive(Clone, Debug, Default)]
pub struct Job {
    /// The scene file.
    pub scene: PathBuf,
    /// Samples per pixel; `None`: the file's.
    pub spp: Option<u64>,
    /// Seed of all randomness; `None`: the file's.
    pub seed: Option<u64>,
    /// Size of the frame; `None`: the file's.
    pub resolution: Option<[u32; 2]>,
    /// Part of the frame, x0 x1 y0 y1 in [0, 1].
    pub crop: Option<[f32; 4]>,
    /// Part of the frame, x0 x1 y0 y1 in pixels, upper ends exclusive. Wins over `crop`.
    pub pixel_bounds: Option<[i32; 4]>,
    /// The samples of each pixel to take; `None`: `0..spp`.
    pub sample_range: Option<Range<u64>>,
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
    /// Whether to stop: at the end of the pass, so that every pixel has the same samples.
    fn stop_requested(&self) -> bool {
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
    /// The filter does not take its settings.
    #[error(transparent)]
    Filter(#[from] SettingError),
}

fn count_errors(diagnostics: &[Diagnostic]) -> String {
    match diagnostics.iter().filter(|d| d.severity == scene::Severity::Error).count() {
        1 => "1 error".into(),
        n => format!("{n} errors"),
    }
}

/// A rendered frame.
pub struct Frame {
    /// All sums.
    pub film: Film,
    /// What was rendered, for the image's metadata.
    pub description: FrameDescription,
    /// What it took.
    pub statistics: Statistics,
}

/// What of a frame depends on the scene and the job alone.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameDescription {
    /// Seed of all randomness.
    pub seed: u64,
    /// The samples of each pixel that were taken.
    pub sample_range: Range<u64>,
    /// The samples of each pixel that were asked for.
    pub sample_range_asked: Range<u64>,
    /// Hash of the text of the scene's files.
    pub scene_hash: u64,
    /// Camera space from world space.
    pub camera_from_world: glam::DMat4,
    /// Screen space, normalised to [0, 1]², from world space; `None` for a camera without such a space.
    pub ndc_from_world: Option<glam::DMat4>,
    /// The output that the scene names.
    pub filename: Option<PathBuf>,
    /// How the frame is filtered.
    pub filtering: Filtering,
}

impl FrameDescription {
    /// Whether all samples were taken.
    pub fn complete(&self) -> bool {
        self.sample_range == self.sample_range_asked
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
    /// What will be rendered; no sample is taken yet.
    pub description: FrameDescription,
    /// Auxiliary outputs of the job and of the file.
    pub aovs: AovSet,
    /// Seconds so far.
    pub statistics: Statistics,
    /// Owns the BVH's memory.
    pub device: embree::Device,
}

/// Renders one job.
///
/// # Errors
/// A scene that cannot be read or built, a machine that cannot run it; nothing after the first sample.
pub fn render(job: &Job, observer: &dyn Observer) -> Result<Frame, RenderError> {
    let pool = thread_pool(job.threads)?;
    let prepared = pool.install(|| prepare(job, observer))?;
    check_memory(&prepared)?;
    Ok(pool.install(|| trace(prepared, job.time_limit, observer)))
}

/// Whether the system would give what a frame takes at least. It is asked for all at once, and gets it back untouched.
fn check_memory(prepared: &Prepared) -> Result<(), RenderError> {
    let bounds = prepared.world.sensor.bounds;
    let filter = match prepared.description.filtering {
        Filtering::None => 0,
        _ => Film::filter_memory(bounds) + bounds.area() * size_of::<filter::PathRecord>() as u64,
    };
    let bytes = Film::memory(bounds, prepared.aovs) + filter;
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
    observer.phase(Phase::Parse);
    let start = Instant::now();
    let (mut description, warnings) = scene::pbrt::load(&job.scene).map_err(RenderError::Scene)?;
    warnings.iter().for_each(|warning| observer.warning(warning));
    apply(job, &mut description);
    statistics.parse_seconds = start.elapsed().as_secs_f64();

    let seed = job.seed.unwrap_or(description.seed);
    let spp = job.spp.unwrap_or(description.spp).max(1);
    let asked = job.sample_range.clone().unwrap_or(0..spp);
    let spp = spp.max(asked.end);
    if asked.is_empty() {
        return Err(RenderError::EmptySampleRange(asked));
    }
    job.filtering.validate()?;
    let mut aovs = job.aovs;
    if description.film.gbuffer {
        aovs = AovSet::all();
    }

    observer.phase(Phase::Compile);
    let start = Instant::now();
    let device = embree::Device::new(&embree::DeviceOptions::default())?;
    let (world, warnings) =
        compile::origin::world(&mut description, &device, job.techniques).map_err(|errors| match errors {
            CompileError::Scene(diagnostics) => RenderError::Compile(diagnostics),
            CompileError::Embree(error) => RenderError::Embree(error),
        })?;
    warnings.iter().for_each(|warning| observer.warning(warning));
    statistics.compile_seconds = start.elapsed().as_secs_f64();
    statistics.embree_bytes = device.memory().peak;
    (statistics.primitives, statistics.unique_primitives) = world.geometry.primitive_counts();

    let ours_from_world = glam::DMat4::from_translation(-world.origin);
    let description = FrameDescription {
        seed,
        sample_range: asked.start..asked.start,
        sample_range_asked: asked,
        scene_hash: description.sources.hash(),
        camera_from_world: description.camera.world_from_camera.inverse().matrix() * ours_from_world,
        ndc_from_world: world.camera.ndc_from_world().map(|ndc_from_ours| ndc_from_ours * ours_from_world),
        filename: description.film.filename.clone(),
        filtering: job.filtering.settled(spp),
    };
    Ok(Prepared { world, description, aovs, statistics, device })
}

/// Traces all passes of a prepared job.
pub fn trace(prepared: Prepared, time_limit: Option<Duration>, observer: &dyn Observer) -> Frame {
    observer.phase(Phase::Render);
    let start = Instant::now();
    let over = || time_limit.is_some_and(|limit| start.elapsed() >= limit) || observer.stop_requested();
    let mut frame = match prepared.world.geometry.alpha_test(&prepared.world.textures) {
        None => trace_queries(&prepared, &Opaque(prepared.world.geometry.scene()), observer, &over),
        Some(alpha) => {
            let queries = AlphaTested { scene: prepared.world.geometry.scene(), alpha };
            trace_queries(&prepared, &queries, observer, &over)
        }
    };
    frame.statistics.render_seconds = start.elapsed().as_secs_f64();
    frame
}

/// Traces all passes, filtered or not.
fn trace_queries<Q: Queries + Sync>(
    prepared: &Prepared,
    queries: &Q,
    observer: &dyn Observer,
    over: &dyn Fn() -> bool,
) -> Frame {
    let Prepared { world, description, aovs, statistics, .. } = prepared;
    let (mut description, mut statistics) = (description.clone(), statistics.clone());
    let film = Film::new(world.sensor.resolution, world.sensor.bounds, *aovs);
    statistics.film_bytes = Film::memory(film.bounds(), *aovs);
    let asked = description.sample_range_asked.clone();
    let progress = Progress::new(&film, &asked, observer);
    let mut passes = Passes { world, queries, sampler: Sampler::new(description.seed), film, progress };
    let filter = passes.filter(&description.filtering);
    let mut done = |pass: &Range<u64>, counters: Counters| {
        statistics.counters += counters;
        statistics.passes += 1;
        description.sample_range.end = pass.end;
        over()
    };
    match filter {
        None => {
            for pass in self::passes(&asked) {
                let (counters, _) = passes.trace(&pass, || Nothing);
                if done(&pass, counters) {
                    break;
                }
            }
        }
        Some(mut filter) => {
            let (selection, mut filtering) = (filter.selection(), Duration::ZERO);
            for pass in filter.blocks(&asked) {
                let (counters, paths) = passes.trace(&pass, || Paths::new(selection));
                let start = Instant::now();
                filter.add(&pass, &paths.into_iter().map(|paths| paths.records).collect::<Vec<_>>());
                filtering += start.elapsed();
                if done(&pass, counters) {
                    break;
                }
            }
            let start = Instant::now();
            statistics.filter = Some(filter.finish(world, &mut passes.film));
            statistics.filter_seconds = (filtering + start.elapsed()).as_secs_f64();
        }
    }
    Frame { film: passes.film, description, statistics }
}

/// Cuts a range of samples into passes over the whole frame: short ones first, so that a job that is stopped early has
/// something, then of [`PASS_SPP`], so that the threads seldom wait for each other.
pub fn passes(range: &Range<u64>) -> impl Iterator<Item = Range<u64>> + use<> {
    let (mut next, end, mut length) = (range.start, range.end, 1);
    std::iter::from_fn(move || {
        let pass = next..end.min(next.saturating_add(length));
        next = pass.end;
        length = (2 * length).min(PASS_SPP);
        (!pass.is_empty()).then_some(pass)
    })
}

/// The longest pass, in samples per pixel.
const PASS_SPP: u64 = 16;

/// All that a pass over the frame needs.
struct Passes<'a, Q> {
    world: &'a World,
    queries: &'a Q,
    sampler: Sampler,
    film: Film,
    progress: Progress<'a>,
}

impl<Q: Queries + Sync> Passes<'_, Q> {
    /// The filter, and what the film must keep for it.
    fn filter(&mut self, filtering: &Filtering) -> Option<FrameFilter> {
        if *filtering == Filtering::None {
            return None;
        }
        let unit = self.unit();
        self.film.keep_split();
        FrameFilter::new(filtering, self.world, &mut self.film, unit).expect("`prepare` has checked the settings")
    }

    /// Traces samples `pass` of every pixel; what was kept of them, by tile.
    fn trace<K: Keeper>(&mut self, pass: &Range<u64>, keeper: impl Fn() -> K + Sync) -> (Counters, Vec<K>) {
        let first_hit = self.film.aovs().first_hit();
        let mut tiles = self.film.tiles();
        let traced: Vec<(Counters, K)> = tiles
            .par_iter_mut()
            .map(|tile| {
                let mut keeper = keeper();
                let counters = trace_tile(self.world, self.queries, tile, pass, &self.sampler, first_hit, &mut keeper);
                self.progress.add(counters.camera_rays);
                (counters, keeper)
            })
            .collect();
        let mut sum = Counters::default();
        let kept = traced.into_iter().map(|(counters, keeper)| {
            sum += counters;
            keeper
        });
        let kept = kept.collect();
        (sum, kept)
    }

    /// Radiance of the order of the frame's mean, from a few paths all over it: the same for every part of the frame's
    /// samples.
    fn unit(&self) -> f32 {
        let [width, height] = self.world.sensor.resolution;
        let (mut sum, mut lit) = (0.0, 0.0);
        for k in 0..PILOT_PATHS {
            // Rows and columns by two numbers without common structure.
            let at = self.sampler.pixel_sample([0, 0], k).d2(Dimension::FILM);
            let pixel = [(at.x * width as f32) as u32, (at.y * height as f32) as u32];
            let numbers = self.sampler.pixel_sample(pixel, u64::MAX - k);
            let film_point = glam::Vec2::new(pixel[0] as f32 + 0.5, pixel[1] as f32 + 0.5);
            let Some(camera) = self.world.camera.ray(film_point, numbers.d2(Dimension::LENS)) else { continue };
            let counters = &mut Counters::default();
            let sample =
                integrator::trace(self.world, self.queries, &camera, &numbers, false, &mut Unrecorded, counters);
            let radiance = f64::from(sample.radiance.element_sum() / 3.0);
            if radiance > 0.0 && radiance.is_finite() {
                sum += radiance;
                lit += 1.0;
            }
        }
        if lit > 0.0 { (sum / lit) as f32 } else { 1.0 }
    }
}

/// Paths that find the order of the frame's radiance, of which a power of two matters.
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
    tile.for_each(|TilePixel { at: [x, y], index: slot, pixel, mut auxiliary, mut split }| {
        for index in pass.clone() {
            let numbers = sampler.pixel_sample([x, y], index);
            let offset = world.filter.sample(numbers.d2(Dimension::FILM));
            let film_point = glam::Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + offset.offset;
            let mut recorder = keeper.recorder();
            let camera = world.camera.ray(film_point, numbers.d2(Dimension::LENS));
            let mut sample = camera.map_or_else(Sample::default, |camera| {
                integrator::trace(world, queries, &camera, &numbers, first_hit, &mut recorder, &mut counters)
            });
            if camera.is_none() {
                counters.camera_rays += 1;
            }
            let (mut exposed, mut exposure) = world.sensor.expose(sample.radiance);
            // A sensor's response may leave its gamut: negative is rejected only as radiance.
            if !exposed.is_finite() || sample.radiance.min_element() < 0.0 {
                counters.rejected_samples += 1;
                (exposed, exposure) = (glam::Vec3::ZERO, 0.0);
                recorder = keeper.recorder();
                sample.radiance = exposed;
            }
            pixel.add(exposed, sample.alpha, offset.weight);
            let split = split.as_deref_mut();
            let radiance = sample.radiance;
            keeper.keep(&recorder, Keep { slot, index, radiance, exposed, weight: offset.weight, exposure, split });
            if let Some(auxiliary) = auxiliary.as_deref_mut().filter(|_| sample.alpha > 0.0) {
                auxiliary.add(&sample.first);
            }
        }
    });
    counters
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
    fn new(film: &Film, samples: &Range<u64>, observer: &'a dyn Observer) -> Self {
        let total = film.bounds().area() as f64 * (samples.end - samples.start) as f64;
        let (done, told_permille, telling) = Default::default();
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
    if let Some(crop) = job.crop {
        description.film.crop_window = Some(crop);
        description.film.pixel_bounds = None;
    }
    if let Some(bounds) = job.pixel_bounds {
        description.film.pixel_bounds = Some(bounds);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_cover_the_range_once_and_in_order() {
        for range in [0..1, 0..100, 7..9, u64::MAX - 40..u64::MAX] {
            let mut next = range.start;
            for pass in passes(&range) {
                assert_eq!(pass.start, next);
                assert!(pass.end - pass.start <= PASS_SPP && !pass.is_empty());
                next = pass.end;
            }
            assert_eq!(next, range.end);
        }
    }
}
