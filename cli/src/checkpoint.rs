//! Checkpoints: what there is of a frame, stored now and then, and gone on with after a machine has died.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use renderer::frame::{Accumulation, FrameDescription};
use renderer::part::{self, Part, PartError};

use crate::args::{CheckpointArguments, Resume};
use crate::exit::Failure;
use crate::log::Log;
use crate::output::OutputFile;

/// When a checkpoint is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interval {
    /// After this time.
    Time(Duration),
    /// After this many passes over the frame.
    Passes(u64),
}

/// The checkpoints of one frame.
pub struct Checkpoints<'a> {
    path: Option<PathBuf>,
    interval: Interval,
    resume: Resume,
    log: &'a Log,
    state: Mutex<State>,
}

struct State {
    /// When the last one was written.
    last: Instant,
    /// Passes since then.
    passes: u64,
    /// Whether the file holds samples of this frame.
    stored: bool,
    publishing: Option<Publishing>,
}

/// A checkpoint on its way to the disk, while the render goes on.
struct Publishing {
    what: String,
    thread: JoinHandle<(Result<u64, PartError>, Duration)>,
}

impl<'a> Checkpoints<'a> {
    /// Those that the command line asks for, in a file that was prepared.
    ///
    /// # Errors
    /// The file is something else, which is not written over.
    pub fn new(arguments: &CheckpointArguments, file: Option<OutputFile>, log: &'a Log) -> Result<Self, Failure> {
        let path = file.map(|file| file.target().to_owned());
        if let Some(path) = path.as_deref().filter(|path| std::fs::metadata(path).is_ok_and(|file| file.len() > 0)) {
            if let Err(why @ PartError::Foreign(_)) = Part::open(path) {
                return Err(Failure::Input(format!("{why}; give --checkpoint a file of its own")));
            }
        }
        let state = Mutex::new(State { last: Instant::now(), passes: 0, stored: false, publishing: None });
        Ok(Self { path, interval: arguments.checkpoint_interval, resume: arguments.resume, log, state })
    }

    /// What an earlier run has left of this frame.
    ///
    /// # Errors
    /// There is another frame's, or one that cannot be read. With `--resume require`: there is nothing, or nothing whole.
    pub fn begin(&self, description: &FrameDescription) -> Result<Option<Accumulation>, Failure> {
        let Some(path) = self.path.as_deref().filter(|_| self.resume != Resume::Never) else { return Ok(None) };
        if !path.exists() {
            return match self.resume {
                Resume::Require => Err(Failure::Input(format!(
                    "--resume require: there is no checkpoint \"{}\" to go on from",
                    path.display()
                ))),
                Resume::Auto | Resume::Never => Ok(None),
            };
        }
        match stored(path, description) {
            Ok(frame) => {
                self.state().stored = true;
                self.log.info(&format!("going on from {}: samples {} are there", path.display(), frame.samples));
                Ok(Some(frame))
            }
            // Nobody has any more use for it.
            Err(why @ (PartError::Damaged(_) | PartError::Truncated(_))) if self.resume == Resume::Auto => {
                self.log.warning(&format!("{why}; rendering from the start"));
                Ok(None)
            }
            Err(why) => Err(Failure::Input(format!(
                "{why}; it is left as it is: give --resume never to start over, or --checkpoint another file"
            ))),
        }
    }

    /// Writes a checkpoint if it is time, and none is on its way.
    pub fn pass_done(&self, frame: &mut Accumulation) {
        let due = {
            let mut state = self.state();
            state.passes += 1;
            let due = match self.interval {
                Interval::Time(interval) => state.last.elapsed() >= interval,
                Interval::Passes(interval) => state.passes >= interval,
            };
            due && state.publishing.as_ref().is_none_or(|publishing| publishing.thread.is_finished())
        };
        // At the end there is the picture itself.
        if due && !frame.complete() {
            self.write(frame);
        }
    }

    /// Writes a checkpoint, where there is to be one, and lets it find its way to the disk. That it cannot be written is no
    /// reason to stop.
    pub fn write(&self, frame: &mut Accumulation) {
        let Some(path) = &self.path else { return };
        self.wait();
        let start = Instant::now();
        match part::write(frame, path) {
            Ok(written) => {
                let what = format!(
                    "checkpoint {} of samples {}, written in {:.2} s",
                    path.display(),
                    frame.samples,
                    start.elapsed().as_secs_f64()
                );
                let path = path.clone();
                let thread = std::thread::spawn(move || {
                    let start = Instant::now();
                    (written.publish(&path), start.elapsed())
                });
                self.state().publishing = Some(Publishing { what, thread });
            }
            Err(why) => self.failed(&why),
        }
        let mut state = self.state();
        (state.last, state.passes) = (Instant::now(), 0);
    }

    /// Waits for the checkpoint that is on its way, if one is, and tells what became of it.
    pub fn wait(&self) {
        let Some(Publishing { what, thread }) = self.state().publishing.take() else { return };
        // A thread that only waits for the system does not panic.
        match thread.join() {
            Ok((Ok(bytes), time)) => {
                self.state().stored = true;
                self.log.verbose(&format!(
                    "{what}: {:.1} MB, on the disk {:.2} s later",
                    bytes as f64 / 1e6,
                    time.as_secs_f64()
                ));
            }
            Ok((Err(why), _)) => self.failed(&why),
            Err(_) => self.log.warning(&format!("{what}: lost on its way to the disk; the render goes on")),
        }
    }

    fn failed(&self, why: &PartError) {
        self.log.warning(&format!("no checkpoint: {why}; the render goes on"));
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether there are any.
    pub fn wanted(&self) -> bool {
        self.path.is_some()
    }

    /// Whether the same command will find samples of this frame.
    pub fn kept(&self) -> bool {
        self.wait();
        self.resume != Resume::Never && self.state().stored
    }

    /// The picture is there: what was stored on the way to it is of no use any more.
    pub fn clear(&self) {
        self.wait();
        if let Some(path) = &self.path {
            // There may be none.
            let _ = std::fs::remove_file(path);
        }
    }
}

impl Drop for Checkpoints<'_> {
    fn drop(&mut self) {
        self.wait();
    }
}

/// What is stored of a frame.
fn stored(path: &Path, description: &FrameDescription) -> Result<Accumulation, PartError> {
    let part = Part::open(path)?;
    let mismatch =
        |what, ours: String, theirs: String| PartError::Mismatch { path: path.to_owned(), what, theirs, ours };
    if let Some((what, ours, theirs)) = description.difference(&part.description) {
        return Err(mismatch(what, ours, theirs));
    }
    let range = |range: &std::ops::Range<u64>| format!("{}:{}", range.start, range.end);
    if part.description.asked != description.asked {
        return Err(mismatch("sample range", range(&description.asked), range(&part.description.asked)));
    }
    part.begin()
}
