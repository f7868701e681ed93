//! What the command line means.

use std::path::{Path, PathBuf};

use oiio::Compression;
use renderer::film::AovSet;
use renderer::film::exr::Encoding;
use renderer::filtering::{Filtering, SettingError};
use renderer::render::RenderError;
use renderer::scene::Severity;

use crate::args::{
    self, CompressionKind, EncodingArguments, FilterArguments, FilterKind, MOTION, QualityArguments, RenderArguments,
};
use crate::exit::Failure;
use crate::frame_name;
use crate::log::Log;

/// This program and its version, for the metadata of files.
pub fn software() -> String {
    format!("tessera {}", env!("CARGO_PKG_VERSION"))
}

/// The image that a render writes: its name with the frame number in it.
///
/// # Errors
/// The name is not that of an OpenEXR file.
pub fn output(arguments: &RenderArguments) -> Result<PathBuf, Failure> {
    if !is_part(&arguments.output) {
        let why =
            "a render is written as OpenEXR, or with .part for \"tessera merge\"; \"tessera preview\" makes a PNG";
        require_extension(&arguments.output, "exr", why)?;
    }
    Ok(named(&arguments.output, arguments.frame.unwrap_or(1)))
}

/// Whether a file is to hold sums instead of an image.
pub fn is_part(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("part"))
}

/// The name of an output of frame `frame`.
pub fn named(path: &Path, frame: i32) -> PathBuf {
    frame_name::with_frame(path, frame)
}

/// Makes sure that frames do not overwrite each other.
///
/// # Errors
/// Two frames have the same name.
pub fn distinct(output: &Path, frames: &[i32]) -> Result<(), Failure> {
    match *frames {
        [first, second, ..] if named(output, first) == named(output, second) => Err(Failure::Usage(format!(
            "all frames would be written to \"{}\": put #### where their number belongs in the file's name",
            output.display()
        ))),
        _ => Ok(()),
    }
}

/// Makes sure that a scene file for each frame is not asked for without a frame.
///
/// # Errors
/// It is.
pub fn check_scene(scene: &Path) -> Result<(), Failure> {
    if scene.exists() || named(scene, 0) == scene {
        return Ok(());
    }
    Err(Failure::Input(format!(
        "there is no scene \"{}\": give --frame N or --frames LIST, which the frame number in its name is of",
        scene.display()
    )))
}

/// Makes sure that every frame has a scene, before the first is rendered.
///
/// # Errors
/// The scenes that are missing.
pub fn check_scenes(scene: &Path, frames: &[i32]) -> Result<(), Failure> {
    let scenes = frames.iter().map(|&frame| named(scene, frame));
    let missing: Vec<PathBuf> = scenes.filter(|scene| !scene.exists()).collect();
    match &*missing {
        [] => Ok(()),
        [first] => Err(Failure::Input(format!("there is no scene \"{}\": nothing was rendered", first.display()))),
        [first, .., last] => Err(Failure::Input(format!(
            "{} of {} scenes are missing, from \"{}\" to \"{}\": nothing was rendered",
            missing.len(),
            frames.len(),
            first.display(),
            last.display()
        ))),
    }
}

/// Makes sure that a name ends as the kind of file that will be written.
///
/// # Errors
/// It ends otherwise; `why` says what to do.
pub fn require_extension(path: &Path, extension: &str, why: &str) -> Result<(), Failure> {
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case(extension)) {
        return Ok(());
    }
    Err(Failure::Usage(format!("the output \"{}\" does not end in .{extension}: {why}", path.display())))
}

/// Makes sure that a slice lies within the samples that are asked for, and that a part of a frame will be whole.
///
/// # Errors
/// It does not.
pub fn check_samples(arguments: &RenderArguments) -> Result<(), Failure> {
    match (&arguments.quality.sample_range, arguments.quality.spp) {
        (Some(range), Some(spp)) if range.end > spp => Err(Failure::Usage(format!(
            "--sample-range {}:{} reaches beyond the {spp} samples of --spp",
            range.start, range.end
        ))),
        _ => check_slice(arguments),
    }
}

/// Makes sure that a slice to be merged gets all its samples: no other has them.
fn check_slice(arguments: &RenderArguments) -> Result<(), Failure> {
    let quality = &arguments.quality;
    if quality.slice.is_none() || !is_part(&arguments.output) {
        return Ok(());
    }
    let refuse = |option, but| {
        Err(Failure::Usage(format!(
            "{option} cannot be given to a slice: one that stops early leaves a gap which no merge can fill{but}"
        )))
    };
    if quality.target_error.is_some() || quality.noise_threshold.is_some() {
        return refuse("--target-error or --noise-threshold", "");
    }
    if quality.time_limit.is_some() && arguments.checkpoint.checkpoint.is_none() {
        return refuse("--time-limit", "; with --checkpoint the same command goes on");
    }
    Ok(())
}

/// The outputs that are named, with what "all" stands for besides.
pub fn aovs(names: &[String]) -> AovSet {
    let all = names.iter().any(|name| name == args::ALL);
    let mut aovs = if all { AovSet::all() } else { AovSet::default() };
    for name in names {
        aovs.insert(name);
    }
    aovs
}

/// Makes sure that there is something to show in all channels.
///
/// # Errors
/// There is not.
pub fn check_outputs(arguments: &RenderArguments) -> Result<(), Failure> {
    if arguments.channels.denoise {
        let text = "a render is not denoised as it is written: \"tessera denoise frame.exr -o clean.exr\" makes another file of it";
        return Err(Failure::Usage(text.into()));
    }
    if arguments.channels.aov.iter().any(|name| name == MOTION) {
        return Err(Failure::Usage(
            "--aov motion: nothing moves in a frame, as motion within the shutter is not rendered and frames of a sequence \
             do not know of each other; leave it out rather than have zeros written"
                .into(),
        ));
    }
    Ok(())
}

/// Whether how many samples the frame will have is decided while it is rendered, once and for all: what is to be added to
/// other slices or gone on with is a part of a frame of which that is known.
pub fn is_open(arguments: &RenderArguments) -> bool {
    let QualityArguments { target_error, noise_threshold, time_limit, sample_range, slice, .. } = &arguments.quality;
    let cut = sample_range.is_some() || slice.is_some() || is_part(&arguments.output);
    let limited = time_limit.is_some() && arguments.checkpoint.checkpoint.is_none();
    !cut && (target_error.is_some() || noise_threshold.is_some() || limited)
}

/// How the frame is to be filtered. `open`: [`is_open`].
///
/// # Errors
/// Settings that the filter does not have or does not take.
pub fn filtering(arguments: &FilterArguments, open: bool) -> Result<Filtering, Failure> {
    let growing = ("growing".to_owned(), "on".to_owned());
    let before = (open && arguments.filter == FilterKind::Adaptive).then_some(growing);
    let Some(alpha) = arguments.temporal else {
        return filter(arguments.filter, &[before.as_slice(), &*arguments.filter_set].concat());
    };
    if arguments.filter != FilterKind::Talk {
        return Err(Failure::Usage(
            "--temporal moves the averages of --filter talk over the frames of a sequence; other filters take every frame by \
             itself"
                .into(),
        ));
    }
    let temporal = ("temporal".to_owned(), alpha.to_string());
    filter(arguments.filter, &[&[temporal], &*arguments.filter_set].concat())
}

/// Makes sure that frames which follow from each other are rendered one after the other, all of them.
///
/// # Errors
/// They are not.
pub fn check_sequence(arguments: &RenderArguments, filtering: &Filtering) -> Result<(), Failure> {
    let fail = |what: &str| {
        Err(Failure::Usage(format!(
            "a moving average (--temporal) goes over the frames of one command, in their order: {what}"
        )))
    };
    match filtering.is_temporal() {
        true if arguments.frames.is_none() => fail("name them with --frames"),
        true if arguments.checkpoint.skip_existing => fail("--skip-existing would leave out what others follow from"),
        _ => Ok(()),
    }
}

/// A filter with settings.
///
/// # Errors
/// Settings that the filter does not have or does not take.
pub fn filter(kind: FilterKind, set: &[(String, String)]) -> Result<Filtering, Failure> {
    let mut filtering = Filtering::named(kind.name()).expect("every kind of the command line has a filter");
    let usage = |error: SettingError| match error {
        SettingError::Unknown { .. } => {
            Failure::Usage(format!("--filter-set: {error}; --filter-set help says what they mean"))
        }
        _ => Failure::Usage(format!("--filter-set: {error}")),
    };
    for (key, value) in set {
        filtering.set(key, value).map_err(usage)?;
    }
    filtering.validate().map_err(usage)?;
    Ok(filtering)
}

/// Shows all that is wrong with a scene, and says what that means for the command.
pub fn scene_failure(error: &RenderError, log: &Log) -> Failure {
    match error {
        RenderError::Scene(diagnostics) | RenderError::Compile(diagnostics) => {
            for diagnostic in diagnostics {
                match diagnostic.severity {
                    Severity::Warning => log.warning(&diagnostic.to_string()),
                    Severity::Error => log.diagnostic(&diagnostic.to_string()),
                }
            }
            Failure::Input(error.to_string())
        }
        RenderError::Embree(_)
        | RenderError::OpenImageIo(_)
        | RenderError::Threads { .. }
        | RenderError::Memory { .. }
        | RenderError::EmptyWindow { .. }
        | RenderError::EmptySampleRange(_)
        | RenderError::TooManySamples(_)
        | RenderError::Slice { .. }
        | RenderError::Filter(_) => Failure::Render(error.to_string()),
    }
}

/// How many threads to run: what was typed; else what Slurm gave the task; else what the affinity mask and the control
/// group leave to this process.
pub fn threads(typed: usize, slurm: Option<&str>) -> usize {
    if typed > 0 {
        return typed;
    }
    let granted = slurm.and_then(|text| text.trim().parse().ok()).filter(|&threads| threads > 0);
    granted.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, std::num::NonZero::get))
}

/// A hash that tells settings apart. Not one that withstands an adversary.
///
/// **Source**: FNV-1a, 64 bits.
pub fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// What Slurm gives the task, as [`threads`] takes it.
pub fn slurm() -> Option<String> {
    std::env::var("SLURM_CPUS_PER_TASK").ok()
}

/// The date that goes into files, as EXIF writes it, in UTC: of SOURCE_DATE_EPOCH, else of the Unix epoch, so that the
/// same job gives the same bytes.
pub fn date(source_date_epoch: Option<&str>) -> String {
    let seconds = source_date_epoch.and_then(|text| text.trim().parse().ok()).unwrap_or(0);
    exif_date(seconds)
}

/// Seconds since 1970 as `YYYY:MM:DD HH:MM:SS`.
///
/// **Source**: \[Hinnant13\], "days to civil".
pub fn exif_date(seconds: u64) -> String {
    let (days, second) = (seconds / 86_400, seconds % 86_400);
    // Years from March, in eras of 400: the leap day comes last.
    let since = days + 719_468;
    let (era, day_of_era) = (since / 146_097, since % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    let year = 400 * era + year_of_era + u64::from(month <= 2);
    format!("{year:04}:{month:02}:{day:02} {:02}:{:02}:{:02}", second / 3600, second / 60 % 60, second % 60)
}

/// How an image is to be stored.
pub fn encoding(arguments: &EncodingArguments) -> Encoding {
    let compression = match arguments.compression {
        CompressionKind::Zip => Compression::Zip,
        CompressionKind::Zips => Compression::Zips,
        CompressionKind::Piz => Compression::Piz,
        CompressionKind::Dwaa => Compression::Dwaa,
        CompressionKind::None => Compression::None,
    };
    // What is said of a layer by its name is heeded before what is said of all; 16 bits come first otherwise.
    let named = |names: &[String], others: &[String], mattes| -> Vec<String> {
        let all = names.iter().any(|name| name == args::ALL);
        let rest = args::layers(mattes).filter(|layer| all && !others.iter().any(|other| other == layer));
        names.iter().filter(|name| *name != args::ALL).cloned().chain(rest.map(str::to_owned)).collect()
    };
    let (half, float) = (&arguments.half, &arguments.float);
    Encoding { compression, half: named(half, float, false), float: named(float, half, true) }
}

/// Refuses to damage what is to be stored.
///
/// # Errors
/// Ids would not survive.
pub fn check_encoding(encoding: &Encoding, aovs: AovSet) -> Result<(), Failure> {
    if encoding.damages(aovs) {
        let text = "--compression dwaa alters the ids of Cryptomatte: choose zip, zips, piz or none, or write the mattes to a \
                    file of their own";
        return Err(Failure::Usage(text.into()));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use renderer::film::Aov;

    use super::*;

    #[test]
    fn threads_are_typed_or_granted_or_counted() {
        assert_eq!(threads(3, Some("5")), 3);
        assert_eq!(threads(0, Some("5")), 5);
        let counted = std::thread::available_parallelism().unwrap().get();
        for none in [None, Some(""), Some("0"), Some("-2"), Some("all")] {
            assert_eq!(threads(0, none), counted, "{none:?}");
        }
    }

    #[test]
    fn what_is_named_beside_all_is_not_lost() {
        let aovs = |names: &[&str]| aovs(&names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>());
        for names in [["error", "all"], ["all", "error"]] {
            assert!(aovs(&names).contains(Aov::Error) && aovs(&names).contains(Aov::Albedo), "{names:?}");
        }
        assert!(!aovs(&["all"]).contains(Aov::Error) && !aovs(&["error"]).contains(Aov::Albedo));
    }

    /// Vectors of the algorithm's authors.
    #[test]
    fn hashes_are_fnv_1a() {
        assert_eq!(hash(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(hash(b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(hash(b"foobar"), 0x8594_4171_f739_67e8);
    }

    /// The dates are those that `date -u -d @N` prints.
    #[test]
    fn dates_are_civil() {
        for (seconds, date) in [
            (0, "1970:01:01 00:00:00"),
            (951_782_399, "2000:02:28 23:59:59"),
            (951_782_400, "2000:02:29 00:00:00"),
            (1_709_251_199, "2024:02:29 23:59:59"),
            (1_709_251_200, "2024:03:01 00:00:00"),
            (1_735_689_599, "2024:12:31 23:59:59"),
            (4_107_542_400, "2100:03:01 00:00:00"),
        ] {
            assert_eq!(exif_date(seconds), date);
        }
        assert_eq!(date(None), "1970:01:01 00:00:00");
        assert_eq!(date(Some("x")), "1970:01:01 00:00:00");
        assert_eq!(date(Some("951782400")), "2000:02:29 00:00:00");
    }
}
