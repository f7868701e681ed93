//! The command line of `study`.

use std::path::PathBuf;

use clap::Args;

use super::{FilterKind, ProgressKind, Resolution, samples, setting};

/// Options of `study`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Examples:
  What does the filter gain in this scene, and what does an error of 1 % cost?
    tessera study kitchen/scene-v4.pbrt -o kitchen-study --resolution 320x180

  Is a filter of finer cells worth it?
    tessera study scene.pbrt -o study --filter adaptive --variant fine=adaptive,leaf=2 --spp 4,16,64

The folder gets index.html, which needs nothing else, study.csv, study.json, and all renders. Those that are there \
already are not rendered again, so a study that was interrupted goes on, and one with more budgets or seeds grows.

Exit codes: as those of render; 75 when interrupted.")]
pub struct StudyArguments {
    /// The scene, a pbrt-v4 file
    pub scene: PathBuf,
    /// The folder to write; it is made if it is not there
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Budgets: samples per pixel
    #[arg(long, value_name = "N,...", value_delimiter = ',', default_value = "1,4,16,64,256")]
    #[arg(value_parser = samples)]
    pub spp: Vec<u64>,
    /// Filters to compare
    #[arg(long, value_name = "KIND,...", value_enum, value_delimiter = ',', default_value = "none,talk,adaptive")]
    pub filter: Vec<FilterKind>,
    /// One more setting to compare: its name, its filter, and what is set otherwise, as render's --filter-set
    #[arg(long, value_name = "NAME=KIND[,KEY=VALUE...]", value_parser = variant)]
    pub variant: Vec<Variant>,
    /// Renders of each setting at budgets of up to 16 samples, by independent seeds; larger budgets have fewer, but two
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u64).range(2..=64))]
    pub seeds: u64,
    /// Two independent references, EXR files of this scene at this size, instead of rendering them
    #[arg(long, value_name = "A.exr,B.exr", value_delimiter = ',', conflicts_with = "reference_spp")]
    pub reference: Vec<PathBuf>,
    /// Samples per pixel of each half of the reference [default: four times the largest budget]
    #[arg(long, value_name = "N", value_parser = samples)]
    pub reference_spp: Option<u64>,
    /// Errors, as relMSE, whose price is wanted; the first is recommended for
    #[arg(long, value_name = "X,...", value_delimiter = ',', default_value = "0.01,0.1,0.001", value_parser = target)]
    pub target: Vec<f64>,
    /// Measure time by the processors' clocks, for machines that do other work besides: seconds of all threads over
    /// their number
    #[arg(long)]
    pub cpu_time: bool,
    /// Size of the whole frame in pixels [default: the scene's]
    #[arg(long, value_name = "WxH")]
    pub resolution: Option<Resolution>,
    /// Threads; 0: SLURM_CPUS_PER_TASK, else as many as this process may use
    #[arg(short, long, value_name = "N", default_value_t = 0)]
    pub threads: usize,
    /// How progress is shown
    #[arg(long, value_name = "KIND", value_enum, default_value_t)]
    pub progress: ProgressKind,
}

/// A named setting.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variant {
    /// Its name, which is part of file names.
    pub name: String,
    /// Its filter.
    pub filter: FilterKind,
    /// What of it is set.
    pub set: Vec<(String, String)>,
}

fn variant(text: &str) -> Result<Variant, String> {
    let wrong = || "expected a name and a filter, such as fine=adaptive,leaf=2".to_owned();
    let (name, rest) = text.split_once('=').ok_or_else(wrong)?;
    if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '.') {
        return Err(format!("\"{name}\" would be part of file names: use letters, digits, _ and . only"));
    }
    let mut parts = rest.split(',');
    let filter = match parts.next() {
        Some("none") => FilterKind::None,
        Some("talk") => FilterKind::Talk,
        Some("adaptive") => FilterKind::Adaptive,
        _ => return Err(wrong()),
    };
    Ok(Variant { name: name.to_owned(), filter, set: parts.map(setting).collect::<Result<_, _>>()? })
}

fn target(text: &str) -> Result<f64, String> {
    let target = text.parse().ok().filter(|x: &f64| *x > 0.0 && x.is_finite());
    target.ok_or_else(|| "expected a number above 0, such as 0.01".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variants_have_a_name_a_filter_and_settings() {
        let found = variant("fine=adaptive,leaf=2,trees=8").unwrap();
        assert_eq!((found.name.as_str(), found.filter, found.set.len()), ("fine", FilterKind::Adaptive, 2));
        assert_eq!(variant("plain=none").unwrap().set, []);
        for bad in ["", "fine", "=none", "a/b=none", "fine=other", "fine=adaptive,leaf"] {
            assert!(variant(bad).is_err(), "{bad}");
        }
        assert!(target("0").is_err() && target("nan").is_err() && target("0.01").is_ok());
    }
}
