//! How the program ends: exit codes that a render farm can act on.

use std::fmt;
use std::process::ExitCode;

/// Why a command did not succeed. The message is for the user and says what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Failure {
    /// Rendering itself failed. Trying again may help.
    Render(String),
    /// The command line asks for something impossible.
    Usage(String),
    /// The scene, one of its assets, or an input image cannot be read.
    Input(String),
    /// An output cannot be written.
    Output(String),
    /// The program was asked to stop. What there was of the picture is written; trying again makes the whole.
    Interrupted(String),
    /// All was done, but the result is not good enough.
    Quality(String),
}

impl Failure {
    /// The exit code, part of the program's interface. 2 is also clap's for a command line that cannot be parsed.
    pub fn code(&self) -> u8 {
        match self {
            Self::Render(_) => 1,
            Self::Usage(_) => 2,
            Self::Input(_) => 3,
            Self::Output(_) => 4,
            Self::Quality(_) => 5,
            Self::Interrupted(_) => INTERRUPTED,
        }
    }
}

/// The exit code of an interrupted job: EX_TEMPFAIL of sysexits.h, which batch systems can be told to requeue on.
pub const INTERRUPTED: u8 = 75;

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Self::Render(message)
        | Self::Usage(message)
        | Self::Input(message)
        | Self::Output(message)
        | Self::Interrupted(message)
        | Self::Quality(message)) = self;
        f.write_str(message)
    }
}

impl From<&Failure> for ExitCode {
    fn from(failure: &Failure) -> Self {
        Self::from(failure.code())
    }
}

/// The table of exit codes, for the help text.
pub const HELP: &str = "\
Exit codes:
  0   the output is complete
  1   rendering failed
  2   the command line is wrong
  3   the scene, an asset or an input image cannot be read
  4   an output cannot be written
  5   the result misses a threshold, or samples had to be rejected under --strict
  75  SIGINT or SIGTERM stopped the render; the image holds the samples up to then";
