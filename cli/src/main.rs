//! The program `tessera`.
//!
//! What was typed is in [`args`], what it means in [`job`]; each command is one file of [`commands`]. Standard output is
//! for machines, standard error for people.
#![forbid(unsafe_code)]

mod args;
mod checkpoint;
mod commands;
mod exit;
mod flip;
mod frame_name;
mod frames;
mod interrupt;
mod inventory;
mod job;
mod log;
mod metadata;
mod metric;
mod oidn;
mod output;
mod picture;
mod prices;
mod progress;
mod sanitise;
mod significance;
mod ssim;
mod stats;
mod study;
mod tone;

use std::panic::{self, AssertUnwindSafe};
use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let arguments = args::Arguments::parse();
    // A panic is a bug, and its message has been printed; for a farm it is a render that failed.
    match panic::catch_unwind(AssertUnwindSafe(|| commands::run(&arguments))) {
        Ok(Ok(())) => ExitCode::SUCCESS,
        Ok(Err(failure)) => ExitCode::from(&failure),
        Err(_) => ExitCode::from(&exit::Failure::Render(String::new())),
    }
}
