//! `tessera farm`: a sequence as jobs for engines that others wrote.
//!
//! A job is frames × slices of samples, then a merge of each frame. Every task may be run again at any time: it goes on from
//! its checkpoint, and what is done is skipped.

mod openjd;
mod slurm;

use std::ffi::OsStr;
use std::path::Path;

use clap::{Parser, ValueEnum};
use renderer::filtering::Filtering;
use renderer::render::Slice;
use renderer::{part, scene};

use crate::args::{
    Arguments, Command, CompressionKind, EncodingArguments, FarmArguments, FarmEngine, RenderArguments,
    SequenceArguments,
};
use crate::exit::Failure;
use crate::job;
use crate::log::Log;

/// Between the request to stop and the end, so that a task can store what it has.
const NOTICE_SECONDS: u32 = 90;

/// Runs the command.
pub fn run(arguments: &FarmArguments, log: &Log) -> Result<(), Failure> {
    match &arguments.engine {
        FarmEngine::Openjd(arguments) => super::print(&openjd::template(arguments, log)?),
        FarmEngine::Slurm(arguments) => slurm::write(arguments, log),
    }
}

/// A sequence to be rendered, checked.
struct Sequence<'a> {
    arguments: &'a SequenceArguments,
    /// Of the job, and with which the names of parts begin.
    name: String,
    scene: Place<'a>,
    output: Place<'a>,
    /// How the images are stored, as options of a merge.
    encoding: Vec<String>,
}

/// Where a file is.
struct Place<'a> {
    folder: &'a str,
    file: &'a str,
}

/// What the words of a task stand for, in the engine's notation.
struct Task<'a> {
    scene: &'a str,
    parts: &'a str,
    frames: &'a str,
    slice: &'a str,
    progress: &'a str,
}

impl<'a> Sequence<'a> {
    /// # Errors
    /// What no farm could render: frames without names of their own, options that a render would refuse.
    fn new(arguments: &'a SequenceArguments, log: &Log) -> Result<Self, Failure> {
        job::require_extension(&arguments.output, "exr", "the parts of a frame are merged to an OpenEXR image")?;
        let (scene, output) = (Place::of(&arguments.scene)?, Place::of(&arguments.output)?);
        job::distinct(&arguments.output, arguments.frames.numbers())?;
        // A pattern of frame numbers is of no use in a job's name.
        let stem = output.file.rsplit_once('.').map_or(output.file, |(stem, _)| stem);
        let stem = stem.trim_end_matches(|c: char| c == '#' || c == '%' || c.is_ascii_digit() || c == 'd');
        let stem = stem.trim_end_matches(['.', '_', '-']);
        let name = arguments.name.as_deref().unwrap_or(if stem.is_empty() { "tessera" } else { stem });
        // Both engines make file names of it.
        let harmless = |c: char| if c.is_alphanumeric() || "._-".contains(c) { c } else { '_' };
        let name: String = name.trim_start_matches('-').chars().map(harmless).take(100).collect();
        if name.is_empty() {
            return Err(Failure::Usage(
                "--name: nothing of it is left for a file's name; use letters or digits".into(),
            ));
        }
        let mut sequence = Self { arguments, name, scene, output, encoding: Vec::new() };
        let render = sequence.parse()?;
        sequence.check(&render, log)?;
        sequence.encoding = encoding(&render.channels.encoding);
        Ok(sequence)
    }

    /// The words after the program's name that render one slice of frames.
    fn render(&self, task: &Task<'_>) -> Vec<String> {
        let part = self.part(task.parts, task.slice);
        let slice = format!("{}/{}", task.slice, self.arguments.slices);
        let checkpoint = format!("{part}.checkpoint");
        [
            "render",
            task.scene,
            "-o",
            &part,
            "--frames",
            task.frames,
            "--slice",
            &slice,
            "--checkpoint",
            &checkpoint,
            "--checkpoint-interval",
            &self.arguments.checkpoint_interval,
            "--resume",
            "auto",
            "--skip-existing",
            "--progress",
            task.progress,
        ]
        .map(str::to_owned)
        .into()
    }

    /// The words after the program's name that merge frames.
    fn merge(&self, parts: &str, frames: &str, output: &str) -> Vec<String> {
        let mut words: Vec<_> = ["merge", "--frames", frames, "-o", output].map(str::to_owned).into();
        words.extend_from_slice(&self.encoding);
        words.extend((0..self.arguments.slices).map(|slice| self.part(parts, &slice.to_string())));
        words
    }

    fn part(&self, parts: &str, slice: &str) -> String {
        format!("{parts}/{}.####.s{slice}of{}.part", self.name, self.arguments.slices)
    }

    /// Makes sure before anything is handed out that renders take the options and parts can be merged.
    fn check(&self, render: &RenderArguments, log: &Log) -> Result<(), Failure> {
        let refuse = |option, why| Err(Failure::Usage(format!("{option} cannot be given to slices: {why}")));
        let quality = &render.quality;
        for (given, option) in [
            (quality.time_limit.is_some(), "--time-limit"),
            (quality.target_error.is_some(), "--target-error"),
            (quality.noise_threshold.is_some(), "--noise-threshold"),
        ] {
            if given {
                return refuse(option, "a slice that stops early leaves a gap which no merge can fill");
            }
        }
        if render.channels.stats.is_some() {
            return refuse("--stats", "all slices of a frame would write the same file");
        }
        job::check_outputs(render)?;
        job::check_encoding(&job::encoding(&render.channels.encoding), job::aovs(&render.channels.aov))?;
        let filtering = job::filtering(&render.filter, false)?;
        part::storable(&filtering).map_err(|why| Failure::Usage(why.to_string()))?;
        job::check_sequence(render, &filtering)?;
        self.check_slices(render, &filtering, log)
    }

    /// What the command line of a render comes to.
    fn parse(&self) -> Result<RenderArguments, Failure> {
        let task = Task { scene: "scene.pbrt", parts: "parts", frames: "1", slice: "0", progress: "none" };
        let words = self.render(&task);
        let typed = ["tessera"].into_iter().chain(words.iter().chain(&self.arguments.options).map(String::as_str));
        let parsed = Arguments::try_parse_from(typed).map_err(|why| {
            let message = why.to_string();
            let message = message.split("\n\nUsage:").next().unwrap_or_default();
            let message = message.strip_prefix("error: ").unwrap_or(message);
            Failure::Usage(format!("the options after -- cannot be given to every render: {}", message.trim_end()))
        })?;
        let Command::Render(render) = parsed.command else { unreachable!("the first word is \"render\"") };
        Ok(*render)
    }

    /// Makes sure that the samples make so many slices, as far as that is known here.
    fn check_slices(&self, render: &RenderArguments, filtering: &Filtering, log: &Log) -> Result<(), Failure> {
        let count = u64::from(self.arguments.slices);
        if count == 1 {
            return Ok(());
        }
        let Some(spp) = render.quality.spp.or_else(|| self.spp_of_scene(render)) else {
            log.warning(&format!(
                "the scene cannot be read here: whether its samples make {count} slices the tasks will find out; --spp after -- \
                 says how many samples there are"
            ));
            return Ok(());
        };
        let epoch = filtering.settled(spp).slice_unit();
        let sizes =
            (0..count).map(|index| Slice { index, count }.samples(spp, epoch).map(|range| range.end - range.start));
        let sizes: Vec<u64> = sizes.collect::<Result<_, _>>().map_err(|why| Failure::Usage(why.to_string()))?;
        if let Some(uneven) = uneven(&sizes, epoch) {
            log.warning(&uneven);
        }
        Ok(())
    }

    /// Samples that the scene of the first frame asks for, if it is to be read here.
    fn spp_of_scene(&self, render: &RenderArguments) -> Option<u64> {
        let first = *self.arguments.frames.numbers().first()?;
        let scene = job::named(&self.arguments.scene, first);
        let (scene, _) = scene::pbrt::load_mapped(&scene, &render.paths.map()).ok()?;
        Some(scene.spp.max(1))
    }
}

/// How images are stored, in words of the command line: it is the merge that writes them.
fn encoding(arguments: &EncodingArguments) -> Vec<String> {
    let compression = arguments.compression.to_possible_value().expect("every kind has a name");
    let words = [
        ("--compression", vec![compression.get_name().to_owned()]),
        ("--half", arguments.half.clone()),
        ("--float", arguments.float.clone()),
    ];
    let given = words.into_iter().filter(|(option, names)| {
        !names.is_empty() && (*option != "--compression" || arguments.compression != CompressionKind::default())
    });
    given.flat_map(|(option, names)| [option.to_owned(), names.join(",")]).collect()
}

/// What to say where slices are not nearly alike, so that machines wait for others.
fn uneven(sizes: &[u64], epoch: u64) -> Option<String> {
    let (least, most) = (sizes.iter().min()?, sizes.iter().max()?);
    let few = sizes.iter().filter(|size| *size == least).count();
    (4 * (most - least) > *most).then(|| {
        format!(
            "the slices are not alike: {few} of {} {} {least} samples, the largest {most}; slices are whole epochs of {epoch} \
             samples, the last of which may be shorter",
            sizes.len(),
            if few == 1 { "has" } else { "have" },
        )
    })
}

impl<'a> Place<'a> {
    /// # Errors
    /// Engines pass on text in lines, so the path must be such.
    fn of(path: &'a Path) -> Result<Self, Failure> {
        let text = plain(path)?;
        let name = path.file_name().and_then(OsStr::to_str);
        let Some(file) = name else {
            return Err(Failure::Usage(format!("\"{}\" has no file name", path.display())));
        };
        let folder = match path.parent().and_then(Path::to_str) {
            None | Some("") => ".",
            Some(folder) => folder,
        };
        debug_assert!(text.ends_with(file));
        Ok(Self { folder, file })
    }
}

/// The path as one line of text.
///
/// # Errors
/// It is none.
fn plain(path: &Path) -> Result<&str, Failure> {
    path.to_str().filter(|text| !text.contains(char::is_control)).ok_or_else(|| {
        Failure::Usage(format!("\"{}\" has characters that no job file can carry; rename it", path.display()))
    })
}

/// A word that a shell reads as `text`.
fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "%+,-./:=@_".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Level;

    pub const QUIET: fn() -> Log = || Log::new(Level::Error);

    /// What `farm` does with a command line.
    pub fn parsed(words: &[&str]) -> FarmArguments {
        let typed = ["tessera", "farm"].iter().chain(words);
        match Arguments::try_parse_from(typed).unwrap().command {
            Command::Farm(arguments) => arguments,
            other => panic!("{other:?}"),
        }
    }

    fn refusal(words: &[&str]) -> String {
        let FarmEngine::Openjd(arguments) = parsed(words).engine else { panic!("not openjd") };
        Sequence::new(&arguments.sequence, &QUIET()).err().expect("a refusal").to_string()
    }

    #[test]
    fn names_are_of_the_output_and_harmless() {
        for (output, flags, name) in [
            ("out/shot.####.exr", &[][..], "shot"),
            ("out/shot_%04d.exr", &[], "shot"),
            ("####.exr", &[], "tessera"),
            ("a b'c.%d.exr", &[], "a_b_c"),
            ("x.####.exr", &["--name=--über/\"shot\""], "über__shot_"),
        ] {
            let words = [&["openjd", "a.pbrt", "-o", output, "--frames", "1-2"], flags].concat();
            let FarmEngine::Openjd(arguments) = parsed(&words).engine else { panic!("not openjd") };
            assert_eq!(Sequence::new(&arguments.sequence, &QUIET()).ok().unwrap().name, name, "{output}");
        }
    }

    #[test]
    fn images_are_stored_by_the_merge_as_asked_for() {
        let base = ["openjd", "a.pbrt", "-o", "a.####.exr", "--frames", "1-2", "--", "--spp", "8"];
        let merge = |options: &[&str]| {
            let FarmEngine::Openjd(arguments) = parsed(&[&base, options].concat()).engine else { panic!("not openjd") };
            let words = Sequence::new(&arguments.sequence, &QUIET()).ok().unwrap().merge("parts", "1", "a.exr");
            words.join(" ")
        };
        let found = merge(&["--compression", "piz", "--half", "albedo,N", "--float", "rgba", "--aov", "albedo,N"]);
        assert!(found.contains(" a.exr --compression piz --half albedo,N --float rgba parts/"), "{found}");
        assert!(!merge(&[]).contains("--compression") && !merge(&[]).contains("--half"));
    }

    #[test]
    fn what_no_farm_could_render_is_refused_before_it_is_handed_out() {
        let base = ["openjd", "a.pbrt", "-o", "a.####.exr", "--frames", "1-2", "--"];
        for (options, words) in [
            (&["--sppp", "3"][..], &["--sppp"][..]),
            (&["--spp", "0"], &["--spp"]),
            (&["--slice", "0/2"], &["--slice", "multiple times"]),
            (&["--filter-set", "cells=2"], &["--filter-set"]),
            (&["--time-limit", "3m"], &["--time-limit", "gap"]),
            (&["--target-error", "0.01"], &["--target-error", "gap"]),
            (&["--noise-threshold", "0.01"], &["--noise-threshold", "gap"]),
            (&["--filter", "talk"], &["talk", "parts"]),
            (&["--filter", "talk", "--temporal", "0.8"], &["talk", "parts"]),
            (&["--aov", "motion"], &["motion"]),
            (&["--stats", "a.json"], &["--stats"]),
            (&["--compression", "dwaa", "--aov", "CryptoObject"], &["dwaa"]),
            (&["-o", "b.exr"], &["--output"]),
        ] {
            let refusal = refusal(&[&base, options].concat());
            assert!(words.iter().all(|word| refusal.contains(word)), "{options:?}: {refusal}");
        }
        let sliced = |slices, options: &[&str]| refusal(&[&base[..6], &["--slices", slices, "--"], options].concat());
        assert!(sliced("16", &["--spp", "512"]).contains("at most 8"));
        assert!(sliced("4", &["--spp", "8"]).contains("epoch=2"));
        assert!(sliced("9", &["--spp", "8", "--filter", "none"]).contains("at most 8"));
        assert!(refusal(&["openjd", "a.pbrt", "-o", "a.exr", "--frames", "1-2"]).contains("####"));
        assert!(refusal(&["openjd", "a.pbrt", "-o", "a.exr", "--frames", "1", "--name", "-"]).contains("--name"));
        assert!(refusal(&["openjd", "a.pbrt", "-o", "a.png", "--frames", "1"]).contains(".exr"));
        assert!(refusal(&["openjd", "a\nb.pbrt", "-o", "a.exr", "--frames", "1"]).contains("rename"));
    }

    #[test]
    fn slices_that_others_wait_for_are_told() {
        let told = |sizes: &[u64]| uneven(sizes, 8).unwrap_or_default();
        let text = told(&[8, 16, 16, 12]);
        assert!(text.contains("1 of 4 has 8 samples") && text.contains("largest 16") && text.contains("epochs of 8"));
        assert!(told(&[2, 2, 3]).contains("2 of 3 have 2"));
        assert!([&[170, 171, 171][..], &[64; 8], &[30, 40]].into_iter().all(|sizes| told(sizes).is_empty()));
    }
}
