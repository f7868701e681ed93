//! The commands, one file each.

mod compare;
mod denoise;
mod farm;
mod info;
mod merge;
mod preview;
mod render;
mod report;
mod study;

use std::io::{self, Write};

use crate::args::{Arguments, Command};
use crate::exit::Failure;
use crate::log::{Level, Log};
use crate::output;

/// Does what the command line says.
///
/// # Errors
/// Whatever keeps the command from succeeding; it has been reported.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let shown = match (arguments.log.quiet, arguments.log.verbose) {
        (true, _) => Level::Error,
        (false, true) => Level::Verbose,
        (false, false) => Level::Info,
    };
    let mut log = Log::new(shown);
    let log_file = arguments.log.log_file.as_deref();
    let spared = || {
        log_file
            .map_or(Ok(()), |log_file| arguments.command.inputs().try_for_each(|input| output::spare(log_file, input)))
    };
    let result = spared().and_then(|()| log.open_file(log_file)).and_then(|()| match &arguments.command {
        Command::Render(arguments) => render::run(arguments, &log),
        Command::Info(arguments) => info::run(arguments, &log),
        Command::Merge(arguments) => merge::run(arguments, &log),
        Command::Compare(arguments) => compare::run(arguments, &log),
        Command::Denoise(arguments) => denoise::run(arguments, &log),
        Command::Preview(arguments) => preview::run(arguments, &log),
        Command::Report(arguments) => report::run(arguments, &log),
        Command::Farm(arguments) => farm::run(arguments, &log),
        Command::Study(arguments) => study::run(arguments, &log),
    });
    result.inspect_err(|failure| log.error(&failure.to_string()))
}

/// Prints a command's answer on standard output. A reader that has seen enough is no failure.
fn print(answer: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(answer.as_bytes()).and_then(|()| out.flush()) {
        Err(why) if why.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::Output(format!("cannot write to standard output: {why}")))
        }
        _ => Ok(()),
    }
}
