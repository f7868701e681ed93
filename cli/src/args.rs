//! The command line as it was typed. What it means is [`crate::job`]'s.

use std::iter;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Args, Parser, Subcommand, ValueEnum};
use renderer::film::{Aov, AovSet, exr};
use renderer::render::Slice;

use crate::checkpoint::Interval;
use crate::exit;
use crate::frames::Frames;

mod farm;
mod paths;
mod settings;
mod study;

pub use farm::{FarmArguments, FarmEngine, OpenjdArguments, SequenceArguments, SlurmArguments};
pub use paths::PathArguments;
pub use study::StudyArguments;

/// Renders pbrt-v4 scenes by path tracing.
#[derive(Debug, Parser)]
#[command(name = "tessera", version, max_term_width = 100, after_help = exit::HELP, arg_required_else_help = true)]
#[command(subcommand_required = true)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Where to report.
    #[command(flatten)]
    pub log: LogArguments,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a scene to an OpenEXR image
    Render(Box<RenderArguments>),
    /// Say what a scene contains and what it takes to render it
    Info(InfoArguments),
    /// Add parts of a frame's samples up to the frame
    Merge(MergeArguments),
    /// Hand a sequence of frames to a farm: job files for Open Job Description or Slurm
    Farm(FarmArguments),
    /// Measure how far an image is from a reference
    Compare(CompareArguments),
    /// Denoise an image with Intel Open Image Denoise, into another file
    Denoise(DenoiseArguments),
    /// Turn an image into a PNG for looking at
    Preview(PreviewArguments),
    /// Show what a render took as a page, from its statistics
    Report(ReportArguments),
    /// Measure what time buys: a scene over budgets and settings, as one page
    Study(StudyArguments),
}

impl Command {
    /// The files that it reads, by their names on the command line.
    pub fn inputs(&self) -> impl Iterator<Item = &Path> {
        let files = match self {
            Self::Render(arguments) => vec![&arguments.scene],
            Self::Info(arguments) => vec![&arguments.scene],
            Self::Merge(arguments) => arguments.parts.iter().collect(),
            Self::Farm(_) => Vec::new(),
            Self::Compare(CompareArguments { image, reference, second_reference, .. }) => {
                [image, reference].into_iter().chain(second_reference).collect()
            }
            Self::Denoise(arguments) => vec![&arguments.image],
            Self::Preview(arguments) => vec![&arguments.image],
            Self::Report(arguments) => vec![&arguments.stats],
            Self::Study(arguments) => iter::once(&arguments.scene).chain(&arguments.reference).collect(),
        };
        files.into_iter().map(PathBuf::as_path)
    }
}

/// Options of every command.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Log")]
pub struct LogArguments {
    /// Show details, on standard error
    #[arg(short, long, global = true)]
    pub verbose: bool,
    /// Show nothing but errors on standard error
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Append all log lines, details included, to a file
    #[arg(long, global = true, value_name = "FILE")]
    pub log_file: Option<PathBuf>,
}

const RENDER_HELP: &str = "\
Examples:
  Draft at a quarter of the samples, half the size:
    tessera render kitchen/scene-v4.pbrt -o draft.exr --spp 64 --resolution 640x360

  Every second frame of a shot, with the channels that denoisers and compositors want:
    tessera render shot.####.pbrt -o out/shot.####.exr --frames 1-48x2 --aov albedo,N,depth

  The second of four slices of a frame's samples, to be added to the others by \"tessera merge\":
    tessera render shot.pbrt -o out/shot.1.part --spp 1024 --slice 1/4 --progress alf

  A long frame on a machine that may die; the same command goes on from where it was:
    tessera render shot.pbrt -o shot.exr --spp 4096 --checkpoint shot.checkpoint --checkpoint-interval 10m

  As good as ten minutes allow:
    tessera render shot.pbrt -o shot.exr --spp 100000 --time-limit 10m

  Without the filter, and with the one of the 2018 talk and cells twice as wide as usual:
    tessera render shot.pbrt -o plain.exr --filter none
    tessera render shot.pbrt -o talk.exr --filter talk --filter-set side=16

The same scene, seed and samples give the same file, byte for byte, on any number of threads; only a time limit makes \
the number of samples depend on the machine. The file appears under its name only when it is complete. Its date is that \
of the environment variable SOURCE_DATE_EPOCH, else 1970; --provenance writes the real one.

SIGINT (Ctrl-C) and SIGTERM end the render after the current pass over the frame: checkpoint and image are written with \
the samples so far, the image's metadata says tessera/complete = 0, and the exit code is 75. A second signal ends the \
program at once. SIGHUP and SIGUSR1 write checkpoint and image of the samples so far, and the render goes on.

Standard output carries lines for machines only (--progress), standard error lines for people.";

/// Options of `render`.
#[derive(Clone, Debug, Args)]
#[command(after_long_help = format!("{RENDER_HELP}\n\n{}", exit::HELP), after_help = "--help says more, with examples.")]
pub struct RenderArguments {
    /// The scene, a pbrt-v4 file. With --frame or --frames, #### or %04d in its name become the frame number
    pub scene: PathBuf,
    /// The image to write, *.exr, or *.part for "tessera merge". #### or %04d in its name become the frame number
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Number of the frame, for the output's name; the seed is mixed with it [default: 1, and the seed as it is]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub frame: Option<i32>,
    /// Several frames one after the other: 1-10, 1-10:2 or 1-10x2, 1..10, lists of these
    #[arg(long, value_name = "LIST", allow_hyphen_values = true, conflicts_with = "frame")]
    pub frames: Option<Frames>,

    /// How good the picture gets.
    #[command(flatten)]
    pub quality: QualityArguments,
    /// How samples share what they find.
    #[command(flatten)]
    pub filter: FilterArguments,
    /// Which pixels are rendered.
    #[command(flatten)]
    pub frame_area: FrameArguments,
    /// What is written.
    #[command(flatten)]
    pub channels: ChannelArguments,
    /// What is kept on the way.
    #[command(flatten)]
    pub checkpoint: CheckpointArguments,
    /// How it runs.
    #[command(flatten)]
    pub run: RunArguments,
    /// Where the scene's files are.
    #[command(flatten)]
    pub paths: PathArguments,
}

/// What is kept on the way.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Checkpoints")]
pub struct CheckpointArguments {
    /// Store the sums so far in this file now and then, and when stopped; deleted when the output is complete
    #[arg(long, value_name = "FILE")]
    pub checkpoint: Option<PathBuf>,
    /// How often: 5m, 100s, or 16p for every 16 passes over the frame
    #[arg(long, value_name = "TIME", value_parser = interval, default_value = "5m", requires = "checkpoint")]
    pub checkpoint_interval: Interval,
    /// Whether to go on from the checkpoint
    #[arg(long, value_name = "WHEN", value_enum, default_value_t, requires = "checkpoint")]
    pub resume: Resume,
    /// Do not render what is there, complete, of the same scene and settings
    #[arg(long)]
    pub skip_existing: bool,
}

/// Whether to go on from a checkpoint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Resume {
    /// If there is one; if it is of another picture, fail
    #[default]
    Auto,
    /// Never: render from the start, and write over what is there
    Never,
    /// Always: without one of this frame, fail
    Require,
}

/// How good the picture gets.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Quality")]
pub struct QualityArguments {
    /// Samples per pixel [default: the scene's]
    #[arg(long, value_name = "N", value_parser = samples)]
    pub spp: Option<u64>,
    /// Take only samples A to B - 1 of each pixel
    #[arg(long, value_name = "A:B", value_parser = sample_range)]
    pub sample_range: Option<Range<u64>>,
    /// Take slice I of N of the samples, I from 0. Slices are whole epochs of the filter: about 8 at most, and fewer below 32
    /// samples, unless --filter-set epoch=N makes more
    #[arg(long, value_name = "I/N", value_parser = slice, conflicts_with = "sample_range")]
    pub slice: Option<Slice>,
    /// Seed of the random numbers [default: the scene's]
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Do not mix the seed with the frame's number: noise stands still over a sequence
    #[arg(long)]
    pub lock_seed: bool,
    /// Stop rendering after this long and write what there is: 90, 90s, 10m, 1.5h
    #[arg(long, value_name = "TIME", value_parser = duration)]
    pub time_limit: Option<Duration>,
    /// Stop when the estimated relMSE of the frame's best 99.9 % of pixels is at most this; --spp is the most that is taken
    #[arg(long, value_name = "X", value_parser = threshold)]
    pub target_error: Option<f64>,
    /// Stop when the mean standard error of the pixels is at most this share of the mean; --spp is the most that is taken
    #[arg(long, value_name = "X", value_parser = threshold)]
    pub noise_threshold: Option<f64>,
    /// Exit with 5 if a sample had to be rejected because it was not a number
    #[arg(long)]
    pub strict: bool,
}

/// How samples share what they find.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Filter")]
pub struct FilterArguments {
    /// Path space filter: paths that meet near each other share what they find. With --sample-range they share within the
    /// range only
    #[arg(long, value_name = "KIND", value_enum, default_value_t)]
    pub filter: FilterKind,
    /// Settings of the filter; "help" lists them all
    #[arg(long, value_name = "KEY=VALUE,...", value_delimiter = ',', value_parser = settings::SettingParser)]
    pub filter_set: Vec<(String, String)>,
    /// Weight of earlier frames in a moving average over the frames of --frames, in [0, 1): with --filter talk
    #[arg(long, value_name = "ALPHA", value_parser = alpha)]
    pub temporal: Option<f32>,
}

/// Which path space filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum FilterKind {
    /// Every pixel by itself
    None,
    /// Cells of one size, as in the talk of 2018: a fixed blur, whose bias stays however many samples there are
    Talk,
    /// Cells as fine as the samples can tell apart, down to no filter at all
    #[default]
    Adaptive,
}

impl FilterKind {
    /// As the renderer names it.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Talk => "talk",
            Self::Adaptive => "adaptive",
        }
    }
}

/// Which pixels are rendered.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Frame")]
pub struct FrameArguments {
    /// Size of the whole frame in pixels [default: the scene's]
    #[arg(long, value_name = "WxH")]
    pub resolution: Option<Resolution>,
    /// Render so many pixels around the frame too: the image's data window grows, its display window does not
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(..=16384))]
    pub overscan: u32,
    /// Render part of the frame, given by fractions of its size: x from the left, y from the top
    #[arg(long, value_name = "X0,X1,Y0,Y1", value_parser = crop, conflicts_with = "pixel_bounds")]
    pub crop: Option<[f32; 4]>,
    /// Render part of the frame, given in pixels: from X0 to X1 - 1, Y0 to Y1 - 1
    #[arg(long, value_name = "X0,X1,Y0,Y1", value_parser = pixel_bounds, allow_hyphen_values = true)]
    pub pixel_bounds: Option<[i32; 4]>,
}

/// What is written.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Output")]
pub struct ChannelArguments {
    /// Auxiliary channels to write besides R G B A, or "all", which is all but the standard error of the pixels, "error". Those
    /// of light (direct, indirect, emission, light) are not filtered: they sum to the image of --filter none
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = aov_names())]
    pub aov: Vec<String>,
    /// Known, to be refused with a reason.
    #[arg(long, hide = true)]
    pub denoise: bool,
    /// How it is stored.
    #[command(flatten)]
    pub encoding: EncodingArguments,
    /// Write counts, times and memory to a JSON file
    #[arg(long, value_name = "FILE")]
    pub stats: Option<PathBuf>,
    /// Record host, date, time and memory in the image: files then differ from run to run
    #[arg(long)]
    pub provenance: bool,
}

/// How images are stored.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Output")]
pub struct EncodingArguments {
    /// Compression of the image: all but dwaa keep every bit
    #[arg(long, value_name = "KIND", value_enum, default_value_t)]
    pub compression: CompressionKind,
    /// Layers to store in 16 bits: names of --aov, "rgba", or "all" but mattes
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = layer_names(false))]
    pub half: Vec<String>,
    /// Layers to store in 32 bits: names of --aov, "rgba", or "all" [default: all but rgba]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = layer_names(true))]
    pub float: Vec<String>,
}

/// Compression of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum CompressionKind {
    /// Deflate of 16 rows
    #[default]
    Zip,
    /// Deflate of single rows: quick for compositors that read by rows
    Zips,
    /// Wavelets: small for noisy pictures
    Piz,
    /// Lossy, and much smaller; not with Cryptomatte
    Dwaa,
    /// None
    None,
}

/// How it runs.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Run")]
pub struct RunArguments {
    /// Threads; 0: SLURM_CPUS_PER_TASK, else as many as this process may use
    #[arg(short, long, value_name = "N", default_value_t = 0)]
    pub threads: usize,
    /// Stop at the end of the pass in which more memory than this is in use, and write what there is: 500M, 8G
    #[arg(long, value_name = "SIZE", value_parser = size)]
    pub memory_limit: Option<u64>,
    /// How progress is shown
    #[arg(long, value_name = "KIND", value_enum, default_value_t)]
    pub progress: ProgressKind,
}

/// How progress is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ProgressKind {
    /// A bar on a terminal, else alf
    #[default]
    Auto,
    /// A bar, on standard error
    Bar,
    /// Lines "ALF_PROGRESS 42%", as Tractor, Deadline and Afanasy read them
    Alf,
    /// Lines "openjd_progress: 42.0", as Open Job Description reads them
    Openjd,
    /// One JSON object a line
    Json,
    /// Nothing
    None,
}

/// Options of `info`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Example:
  tessera info scene.pbrt --format json | jq .memory.total_bytes

The scene is read and built as for rendering, so whatever would keep it from rendering is reported here, with exit \
code 3.")]
pub struct InfoArguments {
    /// The scene, a pbrt-v4 file
    pub scene: PathBuf,
    /// How the answer is printed
    #[arg(long, value_name = "KIND", value_enum, default_value_t)]
    pub format: ReportFormat,
    /// Only read the files: no geometry is built, no mesh and no texture is opened
    #[arg(long)]
    pub parse_only: bool,
    /// Threads; 0: SLURM_CPUS_PER_TASK, else as many as this process may use
    #[arg(short, long, value_name = "N", default_value_t = 0)]
    pub threads: usize,
}

/// How an answer is printed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ReportFormat {
    /// For people
    #[default]
    Text,
    /// One JSON object
    Json,
}

/// Options of `compare`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Figures, of image I against reference R, over all pixels and the three channels:
  relMSE        mean of (I - R)² / (R² + 0.01 m²), m being the channel's mean in R; at the end of the line without the \
                worst thousandth of the pixels, which is what renders estimate of themselves and end at (--target-error)
  RMSE          root of the mean of (I - R)²
  mean ratio    mean of I over mean of R, a channel each
  blocks        median over 32 x 32 pixel blocks of the difference between the blocks' means, relative to R's
  SSIM          structural similarity of tone-mapped luminance, 1 where they look the same
  PSNR          peak signal over noise of tone-mapped values, dB
  HDR-FLIP      mean of what an eye sees when the images flip, at the exposures where it sees most; 0 to 1
  predicted     relMSE that the image's own layer \"error\" stands for, and what is measured, with its 95 % interval
  z             difference of mean luminance in standard errors, of the frame and of its 8 x 8 blocks; p is the \
probability that noise alone makes a block as bad. It needs a layer \"error\" in the image, takes the \
reference's from such or from two of them, and needs pixels that are independent of each other: it is left out where the image or the reference says that \
it was filtered

Examples:
  tessera compare out.exr reference.exr -o difference.exr --max-relmse 0.02 || echo too noisy
  tessera compare out.exr half-a.exr --second-reference half-b.exr

Exit codes: 0 compared and within all thresholds; 3 an image cannot be read, or the sizes differ; 5 over a threshold, \
or pixels are not finite.")]
pub struct CompareArguments {
    /// The image
    pub image: PathBuf,
    /// The reference it is measured against
    pub reference: PathBuf,
    /// Another reference, independent of the first: the squares of relMSE become products of the differences from both,
    /// in which the references' own noise cancels; all else is against their mean
    #[arg(long, value_name = "FILE")]
    pub second_reference: Option<PathBuf>,
    /// Write the difference: |I - R| in R G B, I - R in signed.R signed.G signed.B
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Compare the channels of this layer (as albedo or N) instead of R G B
    #[arg(long, value_name = "NAME")]
    pub layer: Option<String>,
    /// How the answer is printed
    #[arg(long, value_name = "KIND", value_enum, default_value_t)]
    pub format: ReportFormat,
    /// Exit with 5 if the relMSE of all pixels is above this
    #[arg(long, value_name = "X", value_parser = threshold)]
    pub max_relmse: Option<f64>,
    /// Exit with 5 if the relMSE of the best 99.9 % of the pixels, at which --target-error aims, is above this
    #[arg(long, value_name = "X", value_parser = threshold)]
    pub max_relmse_best: Option<f64>,
    /// Exit with 5 if a channel's mean ratio is further than this from 1
    #[arg(long, value_name = "X", value_parser = threshold)]
    pub max_mean_difference: Option<f64>,
    /// Exit with 5 if the median difference of blocks is above this
    #[arg(long, value_name = "X", value_parser = threshold)]
    pub max_block_difference: Option<f64>,
}

/// Options of `merge`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Parts are what \"tessera render --slice I/N -o NAME.part\" writes, on any machines. Added in any order they give, bit for \
bit, the image that one machine renders in one run. Parts of different pictures, samples that two parts have, and samples \
that none has are refused.

Example:
  for i in 0 1 2 3; do tessera render shot.pbrt --spp 64 --slice $i/4 -o shot.$i.part; done
  tessera merge shot.*.part -o shot.exr

Exit codes: 0 the output is complete; 3 a part cannot be read or does not fit the others; 4 the output cannot be written")]
pub struct MergeArguments {
    /// The parts. With --frames, #### or %04d in their names and the output's become the frame number
    #[arg(required = true, value_name = "PART")]
    pub parts: Vec<PathBuf>,
    /// What to write: *.exr for the image, *.part for one part in place of several
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Merge several frames one after the other: 1-10, 1-10:2 or 1-10x2, 1..10, lists of these
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub frames: Option<Frames>,
    /// Make an image of what there is even if samples are missing
    #[arg(long)]
    pub partial: bool,
    /// Record host, date and memory in the image: files then differ from run to run
    #[arg(long)]
    pub provenance: bool,
    /// How the image is stored.
    #[command(flatten)]
    pub encoding: EncodingArguments,
    /// Threads; 0: SLURM_CPUS_PER_TASK, else as many as this process may use
    #[arg(short, long, value_name = "N", default_value_t = 0)]
    pub threads: usize,
}

/// Options of `denoise`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Example:
  tessera render scene.pbrt -o noisy.exr --filter none --aov denoise.albedo,denoise.N
  tessera denoise noisy.exr -o clean.exr")]
pub struct DenoiseArguments {
    /// The noisy image; its layers denoise.albedo and denoise.N, or else albedo and N, guide the denoiser
    pub image: PathBuf,
    /// The denoised image, *.exr: R G B A and metadata, another file than the noisy one
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// The program oidnDenoise [default: OIDN_DENOISE, else the one on the PATH]
    #[arg(long, value_name = "FILE")]
    pub oidn: Option<PathBuf>,
}

/// Options of `report`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Example:
  tessera render scene.pbrt -o a.exr --stats a.json
  tessera report a.json -o a.html")]
pub struct ReportArguments {
    /// The statistics that `render --stats` wrote
    pub stats: PathBuf,
    /// The page, *.html: one file with everything in it
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// The image to show [default: the one that the statistics name]
    #[arg(long, value_name = "FILE")]
    pub picture: Option<PathBuf>,
}

/// Options of `preview`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Example:
  tessera preview out.exr -o out.png --exposure 1.5")]
pub struct PreviewArguments {
    /// The image, of any format, taken to be linear unless it has 8 bits
    pub image: PathBuf,
    /// The PNG to write
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Exposure in stops: each doubles the light
    #[arg(long, value_name = "EV", default_value_t = 0.0, allow_negative_numbers = true)]
    pub exposure: f32,
    /// How light becomes display values
    #[arg(long, value_name = "KIND", value_enum, default_value_t)]
    pub tone: Tone,
    /// Show the channels of this layer (as albedo or N) instead of R G B. Data is scaled: directions from -1..1 to black..white,
    /// depth, P, sampleCount, variance, error and filter.* from their range
    #[arg(long, value_name = "NAME")]
    pub layer: Option<String>,
}

/// How light becomes display values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Tone {
    /// A film-like curve that keeps highlights
    #[default]
    Filmic,
    /// The sRGB transfer function, cut off at 1
    Srgb,
}

/// Width and height in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resolution(pub [u32; 2]);

impl FromStr for Resolution {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || "expected width x height in pixels, such as 1280x720".to_owned();
        let (width, height) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
        let size = [width, height].map(|side| side.trim().parse().ok().filter(|&side: &u32| side > 0));
        let [Some(width), Some(height)] = size else { return Err(wrong()) };
        if width.max(height) > LONGEST_SIDE {
            return Err(format!("{width}x{height} is longer than an image file can be: {LONGEST_SIDE} pixels a side"));
        }
        if u64::from(width) * u64::from(height) > i32::MAX as u64 {
            return Err(format!("{width}x{height} has more pixels than an image file holds"));
        }
        Ok(Self([width, height]))
    }
}

/// What OpenImageIO writes as OpenEXR at most, pixels.
const LONGEST_SIDE: u32 = 1 << 20;

/// Layers whose format may be chosen, all of them by [`ALL`]; ids take 32 bits.
fn layer_names(mattes: bool) -> PossibleValuesParser {
    PossibleValuesParser::new(layers(mattes).chain([ALL]))
}

/// The layers of an image, with mattes or without.
pub fn layers(mattes: bool) -> impl Iterator<Item = &'static str> {
    let aovs = Aov::ALL.into_iter().filter(move |aov| mattes || !aov.is_matte()).map(Aov::name);
    std::iter::once(exr::RADIANCE).chain(aovs)
}

/// What stands for all layers.
pub const ALL: &str = "all";

fn aov_names() -> PossibleValuesParser {
    let names = AovSet::names().chain(["all"]).map(PossibleValue::from);
    // Known, to be refused with a reason.
    PossibleValuesParser::new(names.chain([PossibleValue::new(MOTION).hide(true)]))
}

/// The output that compositors know and tessera has not.
pub const MOTION: &str = "motion";

fn samples(text: &str) -> Result<u64, String> {
    text.parse().ok().filter(|samples| *samples > 0).ok_or_else(|| "expected a number of samples, 1 or more".to_owned())
}

fn sample_range(text: &str) -> Result<Range<u64>, String> {
    let wrong = || "expected first:end, such as 0:64 for the first 64 samples".to_owned();
    let (start, end) = text.split_once(':').ok_or_else(wrong)?;
    let (start, end) = (start.parse().map_err(|_| wrong())?, end.parse().map_err(|_| wrong())?);
    if start >= end {
        return Err(format!("{start}:{end} holds no sample: the end must be above the start"));
    }
    Ok(start..end)
}

fn slice(text: &str) -> Result<Slice, String> {
    let wrong = || "expected slice/slices, such as 0/4 for the first of four".to_owned();
    let (index, count) = text.split_once('/').ok_or_else(wrong)?;
    let (index, count) = (index.parse().map_err(|_| wrong())?, count.parse().map_err(|_| wrong())?);
    if index >= count {
        return Err(format!("there is no slice {index} of {count}: they count from 0"));
    }
    Ok(Slice { index, count })
}

fn interval(text: &str) -> Result<Interval, String> {
    if let Some(passes) = text.strip_suffix('p') {
        let passes = passes.parse().ok().filter(|passes| *passes > 0);
        return passes
            .map(Interval::Passes)
            .ok_or_else(|| "expected a number of passes above 0, such as 16p".to_owned());
    }
    duration(text).map(Interval::Time)
}

fn size(text: &str) -> Result<u64, String> {
    let wrong = || "expected a number of bytes above 0, such as 500M, 8G or 1.5T".to_owned();
    let (number, unit) = text.split_at(text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len()));
    let exponent = ["", "K", "M", "G", "T"].iter().position(|known| *known == unit).ok_or_else(wrong)?;
    let bytes = number.parse::<f64>().map_err(|_| wrong())? * 1e3f64.powi(exponent as i32);
    (1.0..1e18).contains(&bytes).then_some(bytes as u64).ok_or_else(wrong)
}

fn duration(text: &str) -> Result<Duration, String> {
    let wrong = || "expected a time above 0, such as 90, 90s, 10m or 1.5h".to_owned();
    let (number, unit) = text.split_at(text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len()));
    let seconds = match unit {
        "" | "s" => 1.0,
        "m" => 60.0,
        "h" => 3600.0,
        _ => return Err(wrong()),
    };
    let number: f64 = number.parse().map_err(|_| wrong())?;
    Duration::try_from_secs_f64(number * seconds).ok().filter(|time| !time.is_zero()).ok_or_else(wrong)
}

fn four<T: FromStr>(text: &str) -> Option<[T; 4]> {
    let numbers: Vec<T> = text.split(',').map(|number| number.trim().parse().ok()).collect::<Option<_>>()?;
    numbers.try_into().ok()
}

fn crop(text: &str) -> Result<[f32; 4], String> {
    let crop: [f32; 4] = four(text).ok_or("expected four numbers, such as 0.25,0.75,0,0.5")?;
    let [x0, x1, y0, y1] = crop;
    let within = |a: f32, b: f32| 0.0 <= a && a < b && b <= 1.0;
    if !(within(x0, x1) && within(y0, y1)) {
        return Err("expected 0 <= X0 < X1 <= 1 and 0 <= Y0 < Y1 <= 1".into());
    }
    Ok(crop)
}

fn pixel_bounds(text: &str) -> Result<[i32; 4], String> {
    let bounds: [i32; 4] = four(text).ok_or("expected four whole numbers, such as 0,64,0,32")?;
    let [x0, x1, y0, y1] = bounds;
    if x0 >= x1 || y0 >= y1 {
        return Err("expected X0 < X1 and Y0 < Y1".into());
    }
    Ok(bounds)
}

fn setting(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("expected KEY=VALUE, such as trees=8")?;
    Ok((key.trim().to_owned(), value.trim().to_owned()))
}

fn alpha(text: &str) -> Result<f32, String> {
    let alpha = text.parse().ok().filter(|alpha| (0.0..1.0).contains(alpha));
    alpha.ok_or_else(|| "expected a number of at least 0 and less than 1".to_owned())
}

fn threshold(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|x: &f64| *x >= 0.0).ok_or_else(|| "expected a number of 0 or more".to_owned())
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_definition_is_consistent() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn times_have_units() {
        for (text, seconds) in [("90", 90.0), ("90s", 90.0), ("1.5m", 90.0), ("2h", 7200.0), ("0.25", 0.25)] {
            assert_eq!(duration(text).unwrap().as_secs_f64(), seconds, "{text}");
        }
        for bad in ["", "m", "-1s", "0", "10 minutes", "1d", "nan", "inf", "1e400"] {
            assert!(duration(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn resolutions_ranges_and_windows_are_checked() {
        assert_eq!("640x360".parse(), Ok(Resolution([640, 360])));
        assert_eq!("1048576x1".parse(), Ok(Resolution([1 << 20, 1])));
        for bad in ["640", "0x9", "640x", "x", "-1x2", "1.5x2", "99999x99999", "640x360x2", "1048577x1", "1x1048577"] {
            assert!(bad.parse::<Resolution>().is_err(), "{bad}");
        }
        assert_eq!(sample_range("16:48"), Ok(16..48));
        for bad in ["", "5", "5:5", "6:5", ":5", "5:", "-1:5", "0:x"] {
            assert!(sample_range(bad).is_err(), "{bad}");
        }
        assert_eq!(slice("1/4"), Ok(Slice { index: 1, count: 4 }));
        assert!(["4/4", "1", "-1/2", "0/0", "a/b"].iter().all(|bad| slice(bad).is_err()));
        assert_eq!((size("500M"), size("1.5G"), size("7")), (Ok(500_000_000), Ok(1_500_000_000), Ok(7)));
        assert!(["", "G", "0", "-1G", "1Q", "nan", "1e40"].iter().all(|bad| size(bad).is_err()));
        assert_eq!(interval("16p"), Ok(Interval::Passes(16)));
        assert_eq!(interval("1.5m"), Ok(Interval::Time(Duration::from_secs(90))));
        assert!(["0p", "p", "x", "-1p"].iter().all(|bad| interval(bad).is_err()));
        assert_eq!(crop("0.25, 0.75,0,1"), Ok([0.25, 0.75, 0.0, 1.0]));
        for bad in ["0,1,0", "0,1,0,1.1", "0.5,0.5,0,1", "1,0,0,1", "nan,1,0,1", "a,b,c,d"] {
            assert!(crop(bad).is_err(), "{bad}");
        }
        assert_eq!(pixel_bounds("-4,64,0,32"), Ok([-4, 64, 0, 32]));
        assert!(pixel_bounds("4,4,0,32").is_err() && pixel_bounds("0,4,0,3.5").is_err());
        assert!(threshold("-1").is_err() && threshold("nan").is_err() && threshold("0.02").is_ok());
    }

    #[test]
    fn messages_name_the_flag_and_what_it_takes() {
        for (flags, words) in [
            (&["--spp", "0"][..], ["--spp", "1 or more"]),
            (&["--resolution", "640"], ["--resolution", "1280x720"]),
            (&["--pixel-bounds", "0,0,0,1"], ["--pixel-bounds", "X0 < X1"]),
            (&["--sample-range", "4:4"], ["4:4", "no sample"]),
            (&["--time-limit", "soon"], ["--time-limit", "10m"]),
            (&["--aov", "albedo,beauty"], ["beauty", "sampleCount"]),
            (&["--progress", "loud"], ["loud", "openjd"]),
            (&["--threads", "many"], ["--threads", "many"]),
            (&["--crop", "0,1,0,1", "--pixel-bounds", "0,1,0,1"], ["--crop", "--pixel-bounds"]),
            (&["-v", "-q"], ["--verbose", "--quiet"]),
        ] {
            let line = ["tessera", "render", "a.pbrt", "-o", "a.exr"].iter().chain(flags);
            let error = Arguments::try_parse_from(line).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            let message = error.to_string();
            assert!(words.iter().all(|word| message.contains(word)), "{flags:?}: {message}");
        }
    }

    #[test]
    fn a_flag_of_every_command_may_stand_anywhere() {
        for line in [["tessera", "-v", "info", "a.pbrt"], ["tessera", "info", "a.pbrt", "-v"]] {
            assert!(Arguments::try_parse_from(line).unwrap().log.verbose);
        }
    }
}
