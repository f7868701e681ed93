//! Checkpoints: what there is of a frame, stored now and then, and gone on with after a machine has died.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
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
    /// When the last one was written, and passes since then.
    last: Mutex<(Instant, u64)>,
}

impl<'a> Checkpoints<'a> {
    /// Those that the command line asks for; makes sure that they can be written.
    ///
    /// # Errors
    /// They cannot.
    pub fn new(arguments: &CheckpointArguments, path: Option<PathBuf>, log: &'a Log) -> Result<Self, Failure> {
        path.as_deref().map(OutputFile::prepare).transpose()?;
        let last = Mutex::new((Instant::now(), 0));
        Ok(Self { path, interval: arguments.checkpoint_interval, resume: arguments.resume, log, last })
    }

    /// What an earlier run has left of this frame.
    ///
    /// # Errors
    /// With `--resume require`: there is nothing, or nothing of this frame.
    pub fn begin(&self, description: &FrameDescription) -> Result<Option<Accumulation>, Failure> {
        let Some(path) = self.path.as_deref().filter(|_| self.resume != Resume::Never) else { return Ok(None) };
        if self.resume == Resume::Auto && !path.exists() {
            return Ok(None);
        }
        match stored(path, description) {
            Ok(frame) => {
                self.log.info(&format!("going on from {}: samples {} are there", path.display(), frame.samples));
                Ok(Some(frame))
            }
            Err(why) if self.resume == Resume::Auto => {
                self.log.warning(&format!("{why}; rendering from the start"));
                Ok(None)
            }
            Err(why) => Err(Failure::Input(why.to_string())),
        }
    }

    /// Writes a checkpoint if it is time.
    pub fn pass_done(&self, frame: &mut Accumulation) {
        let due = {
            let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
            last.1 += 1;
            match self.interval {
                Interval::Time(interval) => last.0.elapsed() >= interval,
                Interval::Passes(interval) => last.1 >= interval,
            }
        };
        // At the end there is the picture itself.
        if due && !frame.complete() {
            self.write(frame);
        }
    }

    /// Writes a checkpoint, where there is to be one. That it cannot be written is no reason to stop.
    pub fn write(&self, frame: &mut Accumulation) {
        let Some(path) = &self.path else { return };
        let start = Instant::now();
        match part::write(frame, path) {
            Ok(bytes) => self.log.verbose(&format!(
                "checkpoint {} of samples {}: {:.1} MB in {:.2} s",
                path.display(),
                frame.samples,
                bytes as f64 / 1e6,
                start.elapsed().as_secs_f64()
            )),
            Err(why) => self.log.warning(&format!("no checkpoint: {why}; the render goes on")),
        }
        *self.last.lock().unwrap_or_else(PoisonError::into_inner) = (Instant::now(), 0);
    }

    /// Whether there are any.
    pub fn wanted(&self) -> bool {
        self.path.is_some()
    }

    /// The picture is there: what was stored on the way to it is of no use any more.
    pub fn clear(&self) {
        if let Some(path) = &self.path {
            // There may be none.
            let _ = std::fs::remove_file(path);
        }
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
