//! Between the renderer, which tells what it does, and those who want to know.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use renderer::error::Watch;
use renderer::film::{Film, exr};
use renderer::frame::Accumulation;
use renderer::part;
use renderer::render::{Observer, Phase, RenderError};
use renderer::scene::{Diagnostic, Severity};

use crate::checkpoint::Checkpoints;
use crate::exit::Failure;
use crate::interrupt::Interrupt;
use crate::job;
use crate::log::Log;
use crate::metadata;
use crate::output::OutputFile;
use crate::progress::Progress;
use crate::stats;

/// Warnings beyond this many are only counted, unless details are asked for.
const WARNINGS_SHOWN: u64 = 20;

/// Passes on what the renderer says.
pub struct Reporter<'a> {
    /// Where to tell people.
    pub log: &'a Log,
    /// Where to tell machines.
    pub progress: &'a Progress<'a>,
    /// How many there were.
    pub warnings: AtomicU64,
    /// Whether the render is to stop.
    pub interrupt: &'a Interrupt,
    /// What is kept on the way.
    pub checkpoints: Checkpoints<'a>,
    /// How much memory may be in use.
    pub memory: MemoryLimit,
    /// What is written.
    pub output: &'a OutputFile,
    /// Who looks at the frame's error.
    pub watch: Option<Watch>,
    /// How it is written.
    pub encoding: &'a exr::Encoding,
}

/// How much memory may be in use.
pub struct MemoryLimit {
    bytes: Option<u64>,
    reached: AtomicBool,
}

impl MemoryLimit {
    /// So many bytes, if there is a limit.
    pub fn new(bytes: Option<u64>) -> Self {
        Self { bytes, reached: AtomicBool::new(false) }
    }

    /// Refuses what will not fit: `more` bytes than there are now.
    ///
    /// # Errors
    /// What to do about it.
    pub fn check(&self, more: u64) -> Result<(), Failure> {
        let least = stats::resident_memory().unwrap_or_default() + more;
        match self.bytes.filter(|limit| least > *limit) {
            Some(limit) => Err(Failure::Render(format!(
                "the frame takes {} at least, and --memory-limit is {}: raise it, or render parts of the frame with \
                 --crop, with fewer auxiliary outputs, or with --filter none",
                stats::size(least),
                stats::size(limit)
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
        self.hindered() || self.goal_reached()
    }

    fn goes_on(&self) -> bool {
        self.checkpoints.wanted()
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
    pub fn hindered(&self) -> bool {
        self.interrupt.requested() || self.memory.reached.load(Ordering::Relaxed)
    }

    /// Whether the frame is as good as it was asked to be.
    pub fn goal_reached(&self) -> bool {
        self.watch.as_ref().is_some_and(Watch::reached)
    }

    /// What is to be said where samples are missing: how to go on, if anything was kept for that.
    pub fn hint(&self) -> &'static str {
        if self.checkpoints.kept() { "; the same command goes on from the checkpoint" } else { "" }
    }

    /// Why the render ends before its time.
    pub fn hindrance(&self) -> Failure {
        const UP_TO_NOW: &str = "the output holds the samples up to now";
        if !self.interrupt.requested() {
            return Failure::Render(format!("--memory-limit is reached; {UP_TO_NOW}"));
        }
        Failure::Interrupted(format!("interrupted; {UP_TO_NOW}{}", self.hint()))
    }

    /// Writes what there is of the output.
    fn snapshot(&self, frame: &mut Accumulation) {
        let path = self.output.target();
        let written = if job::is_part(path) {
            let written = part::write(frame, path).and_then(|written| written.publish(path));
            written.map(drop).map_err(|error| error.to_string())
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
    pub fn failure(&self, error: RenderError) -> Failure {
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
            RenderError::EmptyWindow { .. }
            | RenderError::EmptySampleRange(_)
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
