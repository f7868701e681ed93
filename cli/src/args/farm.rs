//! The command line of `tessera farm`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use crate::frames::Frames;

const HELP: &str = "\
Examples:
  Frames 1 to 48 in four slices each, as a job for Deadline Cloud or openjd-cli:
    tessera farm openjd shot.####.pbrt -o out/shot.####.exr --frames 1-48 --slices 4 -- --spp 512 > job.template.yaml

  The same for Slurm: writes job/render.sbatch, job/merge.sbatch and job/submit
    tessera farm slurm shot.####.pbrt -o out/shot.####.exr --frames 1-48 --slices 4 --folder job -- --spp 512
    job/submit --partition=render --time=2:00:00

Each frame is rendered as slices of its samples, on as many machines, and merged. The merged frame is that of one machine, \
byte for byte. What stands after -- is given to every \"tessera render\".";

/// Options of `farm`.
#[derive(Clone, Debug, Args)]
#[command(after_help = HELP)]
pub struct FarmArguments {
    /// For which engine.
    #[command(subcommand)]
    pub engine: FarmEngine,
}

/// What hands the work out.
#[derive(Clone, Debug, Subcommand)]
pub enum FarmEngine {
    /// Print a job template of Open Job Description, which openjd-cli and AWS Deadline Cloud run
    Openjd(OpenjdArguments),
    /// Write batch scripts for Slurm, and one that submits them
    Slurm(SlurmArguments),
}

/// Options of `farm openjd`.
#[derive(Clone, Debug, Args)]
pub struct OpenjdArguments {
    /// What is rendered.
    #[command(flatten)]
    pub sequence: SequenceArguments,
    /// Folder of parts and checkpoints; every task must reach it
    #[arg(long, value_name = "DIR", default_value = "parts")]
    pub parts: PathBuf,
    /// Frames that a task takes, one after the other. More than one needs an engine with the extension TASK_CHUNKING
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub chunk: u32,
}

/// Options of `farm slurm`.
#[derive(Clone, Debug, Args)]
pub struct SlurmArguments {
    /// What is rendered.
    #[command(flatten)]
    pub sequence: SequenceArguments,
    /// Folder to write the scripts to; parts, checkpoints and logs will be in it too, so every machine must reach it
    #[arg(long, value_name = "DIR")]
    pub folder: PathBuf,
    /// How often the slices of a frame are tried again while some of them fail
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(0..=9))]
    pub retries: u32,
}

/// What is rendered, and how it is cut.
#[derive(Clone, Debug, Args)]
pub struct SequenceArguments {
    /// The scene, a pbrt-v4 file. #### or %04d in its name become the frame number
    pub scene: PathBuf,
    /// The images, *.exr. #### or %04d in the name become the frame number
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Frames: 1-10, 1-10:2 or 1-10x2, 1..10, lists of these
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub frames: Frames,
    /// Slices that each frame is cut into: about 8 at most, and fewer below 32 samples, unless --filter-set epoch=N after --
    /// makes more
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub slices: u32,
    /// Processors that a task asks for [default: the engine's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub cpus: Option<u32>,
    /// How much work a task may lose when its machine dies: a time (90s, 5m) or passes (16p)
    #[arg(long, value_name = "INTERVAL", default_value = "5m")]
    pub checkpoint_interval: String,
    /// Name of the job [default: the output's]
    #[arg(long, value_name = "NAME")]
    pub name: Option<String>,
    /// This program, as the farm's machines find it [default: for Slurm where it is here, for OpenJD "tessera" on their PATH]
    #[arg(long, value_name = "PATH")]
    pub program: Option<String>,
    /// Options for every "tessera render": --spp, --filter, --aov, ...
    #[arg(last = true, value_name = "RENDER OPTIONS")]
    pub options: Vec<String>,
}
