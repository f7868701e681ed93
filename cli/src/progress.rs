//! Progress: a bar for people, or lines for machines on standard output.

use std::io::{self, IsTerminal, Write};
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;

use crate::args::ProgressKind;
use crate::exit::Failure;
use crate::log::{Level, Log};
use crate::sanitise;

/// Machine lines are at least this far apart, and at least one per cent.
const INTERVAL: Duration = Duration::from_secs(1);
/// The bar's length: it moves in tenths of a per cent.
const BAR_LENGTH: u64 = 1000;

/// Shows how a job goes. Monotone, and at 100 % only when the output is in its place.
pub struct Progress<'a> {
    log: &'a Log,
    kind: Kind,
    /// How many images the job is to make.
    images: usize,
    state: Mutex<State>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Bar,
    Alf,
    OpenJd,
    Json,
    None,
}

struct State {
    machine: Box<dyn Write + Send>,
    bar: Option<ProgressBar>,
    start: Instant,
    last: Option<(u32, Instant)>,
    /// Images that are in their place.
    finished: usize,
}

/// A line of `--progress json`.
#[derive(Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
enum Event<'a> {
    Phase { phase: &'a str },
    Progress { percent: f64, elapsed_seconds: f64, remaining_seconds: Option<f64> },
    Diagnostic { severity: &'a str, message: &'a str },
    Image { path: &'a str },
    Failed { message: &'a str, exit_code: u8 },
    Finished { elapsed_seconds: f64, peak_memory_bytes: Option<u64> },
}

impl<'a> Progress<'a> {
    /// Progress of the kind that was asked for, on this program's own streams.
    pub fn new(kind: ProgressKind, images: usize, log: &'a Log) -> Self {
        let kind = match kind {
            ProgressKind::Auto if !io::stderr().is_terminal() => Kind::Alf,
            ProgressKind::Auto | ProgressKind::Bar => Kind::Bar,
            ProgressKind::Alf => Kind::Alf,
            ProgressKind::Openjd => Kind::OpenJd,
            ProgressKind::Json => Kind::Json,
            ProgressKind::None => Kind::None,
        };
        let progress = Self::on(kind, images, log, Box::new(io::stdout()));
        if kind == Kind::Bar && log.shows(Level::Info) {
            let bar = bar();
            log.set_bar(Some(bar.clone()));
            progress.state().bar = Some(bar);
        }
        progress
    }

    fn on(kind: Kind, images: usize, log: &'a Log, machine: Box<dyn Write + Send>) -> Self {
        let state = State { machine, bar: None, start: Instant::now(), last: None, finished: 0 };
        Self { log, kind, images, state: Mutex::new(state) }
    }

    /// A phase of the job begins.
    pub fn phase(&self, phase: &str) {
        let mut state = self.state();
        match self.kind {
            Kind::Bar => state.bar.iter().for_each(|bar| {
                bar.set_message(phase.to_owned());
                // What is left is judged by the pace of this phase.
                bar.reset_eta();
            }),
            Kind::OpenJd => state.line(&format!("openjd_status: {phase}")),
            Kind::Json => state.event(&Event::Phase { phase }),
            Kind::Alf | Kind::None => {}
        }
    }

    /// The share of the rendering of the current image that is done, in [0, 1].
    pub fn advance(&self, done: f64) {
        let mut state = self.state();
        let done = (state.finished as f64 + done) / self.images as f64;
        // Until the output is in its place, not all is done.
        if let Some(bar) = &state.bar {
            bar.set_position((done * BAR_LENGTH as f64).min(0.99 * BAR_LENGTH as f64) as u64);
        }
        let percent = ((done * 100.0) as u32).min(99);
        let now = Instant::now();
        if state.last.is_none_or(|(last, at)| percent > last && now - at >= INTERVAL) {
            state.last = Some((percent, now));
            let remaining = (done > 0.0).then(|| (now - state.start).as_secs_f64() * (1.0 - done) / done);
            self.show(&mut state, percent, remaining);
        }
    }

    /// A message about the scene, for those who read only the machine lines.
    pub fn diagnostic(&self, severity: &str, message: &str) {
        if self.kind == Kind::Json {
            self.state().event(&Event::Diagnostic { severity, message });
        }
    }

    /// `image` is in its place, and with the last one all is done.
    pub fn finish(&self, image: &Path, peak_memory: Option<u64>) {
        let mut state = self.state();
        state.finished += 1;
        let last = state.finished >= self.images;
        if last {
            self.close(&mut state);
            self.show(&mut state, 100, Some(0.0));
        }
        let shown = image.to_string_lossy();
        match self.kind {
            Kind::Alf => state.line(&format!("Image: {}", sanitise::one_line(&shown))),
            Kind::Json => state.event(&Event::Image { path: &shown }),
            Kind::Bar | Kind::OpenJd | Kind::None => {}
        }
        if last {
            self.last_words(&mut state, peak_memory);
        }
    }

    fn last_words(&self, state: &mut State, peak_memory: Option<u64>) {
        match self.kind {
            Kind::Alf => {
                if let Some(bytes) = peak_memory {
                    state.line(&format!("Peak Memory Usage: {:.2} GB", bytes as f64 / 1e9));
                }
                state.line("Finished Rendering");
            }
            Kind::Json => {
                let elapsed_seconds = state.start.elapsed().as_secs_f64();
                state.event(&Event::Finished { elapsed_seconds, peak_memory_bytes: peak_memory });
            }
            Kind::Bar | Kind::OpenJd | Kind::None => {}
        }
    }

    /// The job has failed.
    pub fn fail(&self, failure: &Failure) {
        self.close(&mut self.state());
        let message = failure.to_string();
        match self.kind {
            Kind::OpenJd => self.state().line(&format!("openjd_fail: {}", sanitise::one_line(&message))),
            Kind::Json => self.state().event(&Event::Failed { message: &message, exit_code: failure.code() }),
            Kind::Bar | Kind::Alf | Kind::None => {}
        }
    }

    /// Takes the bar away.
    fn close(&self, state: &mut State) {
        if let Some(bar) = state.bar.take() {
            bar.finish_and_clear();
            self.log.set_bar(None);
        }
    }

    fn show(&self, state: &mut State, percent: u32, remaining_seconds: Option<f64>) {
        match self.kind {
            Kind::Alf => state.line(&format!("ALF_PROGRESS {percent}%")),
            Kind::OpenJd => state.line(&format!("openjd_progress: {percent}.0")),
            Kind::Json => {
                let elapsed_seconds = state.start.elapsed().as_secs_f64();
                state.event(&Event::Progress { percent: percent.into(), elapsed_seconds, remaining_seconds });
            }
            Kind::Bar | Kind::None => {}
        }
    }

    fn state(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// One line, at once, as readers wait for it. A reader that has gone is no reason to stop rendering.
    fn line(&mut self, line: &str) {
        let text = format!("{line}\n");
        self.machine.write_all(text.as_bytes()).and_then(|()| self.machine.flush()).unwrap_or_default();
    }

    fn event(&mut self, event: &Event<'_>) {
        let line = serde_json::to_string(event).expect("an event is plain data with text keys");
        self.line(&line);
    }
}

fn bar() -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(BAR_LENGTH), ProgressDrawTarget::stderr());
    let style = ProgressStyle::with_template("{msg:10} [{bar:40}] {percent:>3} %  {elapsed} elapsed, {eta} left");
    if let Ok(style) = style {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.enable_steady_tick(Duration::from_millis(500));
    bar
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, mpsc};

    use super::*;

    struct Lines(mpsc::Sender<String>);

    impl Write for Lines {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.send(String::from_utf8(bytes.to_vec()).unwrap()).unwrap();
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn shown(kind: Kind, job: impl FnOnce(&Progress<'_>)) -> Vec<String> {
        let (sender, lines) = mpsc::channel();
        let log = Log::new(Level::Error);
        let progress = Progress::on(kind, 1, &log, Box::new(Lines(sender)));
        job(&progress);
        lines.try_iter().collect()
    }

    #[test]
    fn alf_lines_end_with_image_memory_and_the_last_word() {
        let lines = shown(Kind::Alf, |progress| {
            progress.phase("render");
            progress.advance(0.0);
            progress.advance(1.0);
            progress.finish(Path::new("a\nb.exr"), Some(1_234_000_000));
        });
        let expected = [
            "ALF_PROGRESS 0%\n",
            "ALF_PROGRESS 100%\n",
            "Image: a\\nb.exr\n",
            "Peak Memory Usage: 1.23 GB\n",
            "Finished Rendering\n",
        ];
        assert_eq!(lines, expected);
    }

    #[test]
    fn progress_waits_for_the_interval_and_for_a_per_cent() {
        let lines = shown(Kind::Alf, |progress| {
            let later = |progress: &Progress<'_>| {
                let mut state = progress.state();
                let (percent, at) = state.last.unwrap();
                state.last = Some((percent, at.checked_sub(INTERVAL).unwrap()));
            };
            progress.advance(0.10);
            progress.advance(0.20);
            later(progress);
            progress.advance(0.109);
            progress.advance(0.30);
            later(progress);
            progress.advance(0.25);
            progress.advance(1.0);
        });
        assert_eq!(lines, ["ALF_PROGRESS 10%\n", "ALF_PROGRESS 30%\n", "ALF_PROGRESS 99%\n"]);
    }

    #[test]
    fn a_failure_is_told_in_one_line() {
        let failure = Failure::Output("disk\nopenjd_progress: 100".into());
        let lines = shown(Kind::OpenJd, |progress| progress.fail(&failure));
        assert_eq!(lines, ["openjd_fail: disk\\nopenjd_progress: 100\n"]);
        let lines = shown(Kind::Json, |progress| progress.fail(&failure));
        let event: serde_json::Value = serde_json::from_str(&lines[0]).unwrap();
        assert_eq!((&event["event"], &event["exit_code"]), (&"failed".into(), &4.into()));
        assert!(shown(Kind::None, |progress| progress.fail(&failure)).is_empty());
    }

    #[test]
    fn threads_may_report_at_once() {
        let log = Log::new(Level::Error);
        let (sender, lines) = mpsc::channel();
        let progress = Arc::new(Progress::on(Kind::OpenJd, 1, &log, Box::new(Lines(sender))));
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| (0..=100).for_each(|k| progress.advance(f64::from(k) / 100.0)));
            }
        });
        assert_eq!(lines.try_iter().filter(|line| line == "openjd_progress: 0.0\n").count(), 1);
    }
}
