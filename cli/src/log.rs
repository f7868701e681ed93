//! Lines for people: on standard error, and all of them in the log file.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;

use indicatif::ProgressBar;

use crate::exit::Failure;
use crate::sanitise;

/// How important a line is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// The command fails.
    Error,
    /// The picture is not quite what was asked for.
    Warning,
    /// What a person who waits wants to know.
    Info,
    /// What a person who looks for a cause wants to know.
    Verbose,
}

/// Where lines for people go.
pub struct Log {
    shown: Level,
    file: Option<Mutex<File>>,
    bar: Mutex<Option<ProgressBar>>,
    start: Instant,
}

impl Log {
    /// A log that shows lines up to `shown` on standard error.
    pub fn new(shown: Level) -> Self {
        Self { shown, file: None, bar: Mutex::default(), start: Instant::now() }
    }

    /// Appends all lines from now on to a file, too.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn open_file(&mut self, path: Option<&Path>) -> Result<(), Failure> {
        if let Some(path) = path {
            let failure = |why| Failure::Output(format!("cannot write the log file \"{}\": {why}", path.display()));
            let file = File::options().create(true).append(true).open(path).map_err(failure)?;
            self.file = Some(Mutex::new(file));
        }
        Ok(())
    }

    /// A failure, which ends the command.
    pub fn error(&self, message: &str) {
        self.write(Level::Error, "Error: ", message);
    }

    /// One of several reasons for a failure.
    pub fn diagnostic(&self, message: &str) {
        self.write(Level::Error, "", message);
    }

    /// Something that the user should change or know to be different.
    pub fn warning(&self, message: &str) {
        self.write(Level::Warning, "", message);
    }

    /// What happens.
    pub fn info(&self, message: &str) {
        self.write(Level::Info, "", message);
    }

    /// Details of what happens.
    pub fn verbose(&self, message: &str) {
        self.write(Level::Verbose, "", message);
    }

    /// Whether lines of this level are shown on standard error.
    pub fn shows(&self, level: Level) -> bool {
        level <= self.shown
    }

    /// The progress bar that lines are printed above from now on.
    pub fn set_bar(&self, bar: Option<ProgressBar>) {
        *self.bar.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = bar;
    }

    /// Seconds since the program started.
    pub fn elapsed(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    fn write(&self, level: Level, prefix: &str, message: &str) {
        let mut text = String::from(prefix);
        for (index, line) in sanitise::lines(message).enumerate() {
            if index > 0 {
                text.push('\n');
            }
            text.push_str(&line);
        }
        text.push('\n');
        // There is nobody left to tell when the log itself cannot be written.
        if self.shows(level) {
            let bar = self.bar.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            let print = || io::stderr().lock().write_all(text.as_bytes()).unwrap_or_default();
            match &*bar {
                Some(bar) => bar.suspend(print),
                None => print(),
            }
        }
        if let Some(file) = &self.file {
            let mut file = file.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            let stamp = format!("[{:10.3}] {}: ", self.elapsed(), level.name());
            file.write_all(format!("{stamp}{}", text.strip_prefix("Error: ").unwrap_or(&text)).as_bytes())
                .unwrap_or_default();
        }
    }
}

impl Level {
    fn name(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Warning => "warning",
            Self::Info => "info",
            Self::Verbose => "verbose",
        }
    }
}
