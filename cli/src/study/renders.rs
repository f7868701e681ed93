//! The renders of a study, each kept as an EXR with a JSON file beside it: what is there is not done again.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use renderer::error::{self, Goal};
use renderer::film::AovSet;
use renderer::film::exr;
use renderer::filtering::Filtering;
use renderer::frame::Accumulation;
use renderer::render::{self, Job, Observer, RenderError};
use renderer::scene::pbrt;
use serde::{Deserialize, Serialize};

use super::plan::{Plan, REFERENCE_SEED, Render};
use crate::args::StudyArguments;
use crate::exit::Failure;
use crate::interrupt::Interrupt;
use crate::job;
use crate::log::Log;
use crate::metadata;
use crate::output::OutputFile;
use crate::picture::Picture;
use crate::progress::Progress;
use crate::stats;

/// What is known of a finished render besides its picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// All that decides the picture, and the program's version.
    pub key: String,
    /// Wall-clock seconds of tracing and filtering.
    pub seconds: f64,
    /// Seconds of all processors in the same time.
    pub cpu_seconds: f64,
    /// Threads.
    pub threads: usize,
    /// relMSE as the render itself estimates it; `None` with too few samples to tell.
    #[serde(default)]
    pub estimate: Option<f64>,
}

/// A finished render.
#[derive(Clone, Debug)]
pub struct Done {
    /// Which.
    pub render: Render,
    /// What it took.
    pub record: Record,
    /// Its picture.
    pub path: PathBuf,
}

/// All that a study renders, done.
pub struct Renders {
    /// In the plan's order.
    pub done: Vec<Done>,
    /// The reference's halves.
    pub reference: [Picture; 2],
}

/// Does what of the plan is not there yet.
pub struct Studio<'a> {
    arguments: &'a StudyArguments,
    folder: PathBuf,
    /// Hash of the scene's text.
    scene: u64,
    progress: &'a Progress<'a>,
    interrupt: Interrupt,
    log: &'a Log,
    /// Samples of the whole plan, and those that are done.
    total: f64,
    done: f64,
}

impl<'a> Studio<'a> {
    /// Prepares the folder, and reads the scene to know it again.
    ///
    /// # Errors
    /// The folder cannot be made; the scene cannot be read.
    pub fn new(arguments: &'a StudyArguments, progress: &'a Progress<'a>, log: &'a Log) -> Result<Self, Failure> {
        let folder = arguments.output.join("renders");
        let failure = |why| Failure::Output(format!("cannot make the folder \"{}\": {why}", folder.display()));
        fs::create_dir_all(&folder).map_err(failure)?;
        let (scene, warnings) =
            pbrt::load(&arguments.scene).map_err(|errors| job::scene_failure(&RenderError::Scene(errors), log))?;
        warnings.iter().for_each(|warning| log.warning(&warning.to_string()));
        let interrupt = Interrupt::default();
        if let Err(why) = interrupt.listen() {
            log.warning(&format!("signals will end the study at once: {why}"));
        }
        let scene = scene.hash();
        Ok(Self { arguments, folder, scene, progress, interrupt, log, total: 0.0, done: 0.0 })
    }

    /// Does all.
    ///
    /// # Errors
    /// As `tessera render`; an interruption.
    pub fn run(mut self, plan: &Plan) -> Result<Renders, Failure> {
        let spp = plan.renders.iter().map(|render| render.spp).chain(plan.reference.iter().flatten().copied());
        self.total = spp.sum::<u64>() as f64;
        let mut done = Vec::new();
        for &render in &plan.renders {
            let setting = &plan.settings[render.setting];
            let name = render.name(&plan.settings);
            let (record, path) = self.render(&name, setting.filtering, render.spp, render.seed)?;
            done.push(Done { render, record, path });
        }
        let reference = match self.arguments.reference.as_slice() {
            [a, b] => [Picture::read(a, None)?, Picture::read(b, None)?],
            _ => [self.half(plan, 0)?, self.half(plan, 1)?],
        };
        Ok(Renders { done, reference })
    }

    /// A half of the reference: the mean of its parts.
    fn half(&mut self, plan: &Plan, half: usize) -> Result<Picture, Failure> {
        let (mut sum, mut total): (Option<Picture>, f32) = (None, 0.0);
        for (part, &spp) in (0..).zip(&plan.reference[half]) {
            let name = format!("reference.{}.{part}-{spp:06}", ["a", "b"][half]);
            let seed = REFERENCE_SEED + 2 * part + half as u64;
            let (_, path) = self.render(&name, Filtering::None, spp, seed)?;
            let picture = Picture::read(&path, None)?;
            total += spp as f32;
            let share = spp as f32 / total;
            let mean =
                |(mean, new): (&mut [f32; 3], &[f32; 3])| (0..3).for_each(|c| mean[c] += share * (new[c] - mean[c]));
            match &mut sum {
                None => sum = Some(picture),
                Some(sum) => sum.pixels.iter_mut().zip(&picture.pixels).for_each(mean),
            }
        }
        sum.ok_or_else(|| Failure::Usage("the reference has no samples".into()))
    }

    /// A picture, rendered now if it is not there.
    fn render(&mut self, name: &str, filtering: Filtering, spp: u64, seed: u64) -> Result<(Record, PathBuf), Failure> {
        let path = self.folder.join(format!("{name}.exr"));
        let key = self.key(&filtering, spp, seed);
        let record = match kept(&path, &key) {
            Some(record) => record,
            None => self.render_now(name, &path, &key, filtering, spp, seed)?,
        };
        self.done += spp as f64;
        self.progress.advance(self.done / self.total);
        Ok((record, path))
    }

    fn render_now(
        &self,
        name: &str,
        path: &Path,
        key: &str,
        filtering: Filtering,
        spp: u64,
        seed: u64,
    ) -> Result<Record, Failure> {
        self.log.verbose(&format!("rendering {name}"));
        self.progress.phase("render");
        let file = OutputFile::prepare(&path.with_extension("json"))?;
        let job = Job {
            scene: self.arguments.scene.clone(),
            spp: Some(spp),
            seed: Some(seed),
            resolution: self.arguments.resolution.map(|size| size.0),
            threads: job::threads(self.arguments.threads, job::slurm().as_deref()),
            aovs: AovSet::default(),
            filtering,
            ..Job::default()
        };
        let watch = Watch {
            studio: self,
            spp: spp as f64,
            errors: error::Watch::new(Goal::default()),
            spent: Mutex::default(),
        };
        let pool = render::thread_pool(job.threads).map_err(|error| job::scene_failure(&error, self.log))?;
        let prepared =
            pool.install(|| render::prepare(&job, &watch)).map_err(|error| job::scene_failure(&error, self.log))?;
        render::check_memory(&prepared).map_err(|error| job::scene_failure(&error, self.log))?;
        let (start, clock) = (Instant::now(), stats::processor_seconds());
        let mut frame = pool.install(|| render::trace(prepared, None, None, &watch).develop());
        let spent = *watch.spent.lock().unwrap_or_else(PoisonError::into_inner);
        let seconds = start.elapsed().as_secs_f64() - spent[0];
        let cpu_seconds = stats::processor_seconds() - clock - spent[1];
        if !frame.complete() {
            return Err(Failure::Interrupted(
                "interrupted; what was finished is kept, and the same command goes on from there".into(),
            ));
        }
        let estimate = pool.install(|| watch.errors.finish(&mut frame.film)).map(|estimate| estimate.relmse);
        let attributes = vec![("Software".to_owned(), oiio::Attribute::Text(job::software()))];
        exr::write(&frame.film, attributes, path).map_err(|error| Failure::Output(error.to_string()))?;
        let threads = frame.statistics.threads;
        let record = Record { key: key.to_owned(), seconds, cpu_seconds, threads, estimate };
        let text = serde_json::to_string_pretty(&record).expect("a record is plain data with text keys");
        file.write((text + "\n").as_bytes())?;
        Ok(record)
    }

    fn key(&self, filtering: &Filtering, spp: u64, seed: u64) -> String {
        let size = self.arguments.resolution.map_or("the scene's size".to_owned(), |size| format!("{:?}", size.0));
        let filter = metadata::filter_settings(filtering);
        format!("{} scene {:016x} {size} spp {spp} seed {seed} filter {filter}", job::software(), self.scene)
    }
}

/// What is known of a render that is there, if it is the one that is wanted.
fn kept(path: &Path, key: &str) -> Option<Record> {
    let text = fs::read_to_string(path.with_extension("json")).ok()?;
    let record: Record = serde_json::from_str(&text).ok()?;
    (record.key == key && path.is_file()).then_some(record)
}

/// Tells how far the study is while a render of it goes on, and looks at the render's error. The scene's warnings have been
/// shown.
struct Watch<'a> {
    studio: &'a Studio<'a>,
    spp: f64,
    errors: error::Watch,
    /// Seconds, and those of all processors, that the looks took: a render that nobody looks at does without.
    spent: Mutex<[f64; 2]>,
}

impl Observer for Watch<'_> {
    fn progress(&self, done: f64) {
        self.studio.progress.advance((self.studio.done + done * self.spp) / self.studio.total);
    }

    fn pass_done(&self, frame: &mut Accumulation) {
        let (start, clock) = (Instant::now(), stats::processor_seconds());
        self.errors.pass_done(frame);
        let mut spent = self.spent.lock().unwrap_or_else(PoisonError::into_inner);
        spent[0] += start.elapsed().as_secs_f64();
        spent[1] += stats::processor_seconds() - clock;
    }

    fn stop_requested(&self) -> bool {
        self.studio.interrupt.requested()
    }
}
