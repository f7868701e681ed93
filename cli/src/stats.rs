//! What a render took, as a JSON file.

use std::path::{Path, PathBuf};

use renderer::error::Estimate;
use renderer::filtering::Report;
use renderer::render::Statistics;
use serde::{Serialize, Serializer};

/// The file of `--stats`. Keys are part of the program's interface: they may be added to, not renamed.
#[derive(Clone, Debug, Serialize)]
pub struct Stats<'a> {
    /// Version of the program.
    pub version: &'static str,
    /// The scene file.
    #[serde(serialize_with = "shown_path")]
    pub scene: &'a Path,
    /// The image.
    #[serde(serialize_with = "shown_path")]
    pub output: &'a Path,
    /// Frame number.
    pub frame: i32,
    /// Whether all samples were taken, or a goal was reached without.
    pub complete: bool,
    /// Size of the whole frame.
    pub resolution: [u32; 2],
    /// The pixels that were rendered, x0 x1 y0 y1, upper ends exclusive.
    pub pixel_bounds: [i64; 4],
    /// The samples that were taken of each pixel, upper end exclusive.
    pub samples: [u64; 2],
    /// Seed.
    pub seed: u64,
    /// Threads that traced.
    pub threads: usize,
    /// Times.
    pub seconds: Seconds,
    /// What was traced.
    pub rays: Rays,
    /// Geometry.
    pub primitives: Primitives,
    /// Memory.
    pub memory: Memory,
    /// The path space filter; `null` without one.
    pub filter: Option<Filter>,
    /// What the renderer knows of the frame's error; `null` if it does not.
    pub error: Option<Error>,
    /// Whether `--target-error` or `--noise-threshold` ended the render.
    pub goal_reached: bool,
    /// What was not as it should be.
    pub problems: Problems,
}

/// The frame's own estimate of its error.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Error {
    /// Expected relMSE of the best 99.9 % of the pixels.
    pub relmse: f64,
    /// Its 95 % interval.
    pub interval: [f64; 2],
    /// Mean standard error of the pixels over their mean.
    pub noise: f64,
}

impl Error {
    /// Of the renderer's.
    pub fn of(estimate: &Estimate) -> Self {
        Self { relmse: estimate.relmse, interval: estimate.interval, noise: estimate.noise }
    }

    /// One line for people.
    pub fn summary(&self) -> String {
        let [low, high] = self.interval;
        format!(
            "estimated relMSE {} (95 %: {} to {}), noise {:.2} %",
            figure(self.relmse),
            figure(low),
            figure(high),
            100.0 * self.noise
        )
    }
}

/// A count with its noun.
pub fn many(count: u64, one: &str, more: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { more })
}

/// What to say of samples that were rejected, of so many camera rays.
pub fn rejected(samples: u64, camera_rays: u64) -> Option<String> {
    let share = 100.0 * samples as f64 / camera_rays.max(1) as f64;
    let samples = (samples > 0).then(|| many(samples, "sample was", "samples were"))?;
    Some(format!("{samples} ({share:.2e} %) not finite or negative, which counts as black"))
}

/// A path in JSON, with marks for what is not UTF-8: a name of a file need not be.
pub fn shown_path<P: AsRef<Path>, S: Serializer>(path: &P, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&path.as_ref().display())
}

/// Paths as by [`shown_path`].
pub fn shown_paths<S: Serializer>(paths: &[PathBuf], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(paths.iter().map(|path| path.to_string_lossy()))
}

/// A number of bytes, as people read it.
pub fn size(bytes: u64) -> String {
    match bytes as f64 {
        bytes if bytes >= 1e9 => format!("{:.2} GB", bytes / 1e9),
        bytes if bytes >= 1e6 => format!("{:.1} MB", bytes / 1e6),
        bytes => format!("{:.1} kB", bytes / 1e3),
    }
}

/// A figure to three digits, as people read it.
pub fn figure(x: f64) -> String {
    if x != 0.0 && !(0.01..1e4).contains(&x.abs()) {
        return format!("{x:.2e}");
    }
    let decimals = if x == 0.0 { 0.0 } else { 2.0 - x.abs().log10().floor() };
    format!("{x:.*}", decimals.max(0.0) as usize)
}

/// Wall-clock seconds of the phases.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Seconds {
    /// Reading the scene's files.
    pub parse: f64,
    /// Building the world.
    pub compile: f64,
    /// Tracing.
    pub render: f64,
    /// Writing the image.
    pub write: f64,
    /// From the start of the program.
    pub total: f64,
}

/// Numbers of rays.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Rays {
    /// Paths begun.
    pub camera: u64,
    /// Queries for the closest hit, camera rays included.
    pub closest_hit: u64,
    /// Queries for any hit.
    pub shadow: u64,
    /// All queries in a second of rendering.
    pub per_second: f64,
}

/// Numbers of triangles and other primitives.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Primitives {
    /// Instances counted each time they are placed.
    pub placed: u64,
    /// In memory.
    pub unique: u64,
}

/// Bytes.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Memory {
    /// Largest resident set of the process; `null` if the system does not say.
    pub peak_resident_bytes: Option<u64>,
    /// What Embree held at most.
    pub embree_bytes: u64,
    /// The film.
    pub film_bytes: u64,
}

/// What the path space filter did.
#[derive(Clone, Debug, Serialize)]
pub struct Filter {
    /// Which filter.
    pub name: &'static str,
    /// Wall-clock seconds, without what noting paths for the filter costs while they are traced.
    pub seconds: f64,
    /// Those over the seconds of rendering.
    pub share: f64,
    /// Paths with a vertex to share.
    pub paths: u64,
    /// Cells at the end.
    pub cells: u64,
    /// Bytes held from pass to pass.
    pub bytes: u64,
    /// Paths that kept their own light since no cell could take it. Of the talk's: lobes of paths.
    pub unfiltered: u64,
    /// What only one filter has.
    #[serde(flatten)]
    pub particular: Particular,
}

/// What only one filter has to say.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Particular {
    /// The adaptive filter.
    Adaptive {
        /// Cells of second vertices, in the last pass.
        second_cells: u64,
        /// Pairs of a pixel and a cell that it reads.
        pairs: u64,
    },
    /// The talk's.
    Talk {
        /// Slots of the table.
        slots: u64,
        /// Share of them with a cell.
        occupancy: f64,
        /// Cells by slots looked at to find them: entry i for i + 1.
        probes: Vec<u64>,
        /// Lobes of paths, each of which asks for a cell.
        lobes: u64,
        /// Share of lobes for which there was no slot.
        unresolved_share: f64,
        /// Cells that gave way to others.
        evicted: u64,
    },
}

impl Filter {
    /// Of a render; `None` if it was not filtered.
    pub fn of(statistics: &Statistics) -> Option<Self> {
        let seconds = statistics.filter_seconds;
        let share = if statistics.render_seconds > 0.0 { seconds / statistics.render_seconds } else { 0.0 };
        Some(match statistics.filter.as_ref()? {
            Report::Adaptive(report) => Self {
                name: "adaptive",
                seconds,
                share,
                paths: report.paths,
                cells: report.cells,
                bytes: report.bytes,
                unfiltered: report.unfiltered,
                particular: Particular::Adaptive { second_cells: report.second_cells, pairs: report.pairs },
            },
            Report::Talk(report) => Self {
                name: "talk",
                seconds,
                share,
                paths: report.paths,
                cells: report.cells,
                bytes: report.bytes,
                unfiltered: report.unresolved + report.rejected + report.placeless,
                particular: Particular::Talk {
                    slots: report.slots,
                    occupancy: report.occupancy(),
                    probes: report.probes.clone(),
                    lobes: report.lobes,
                    unresolved_share: report.unresolved_share(),
                    evicted: report.evicted,
                },
            },
        })
    }

    /// One line for people.
    pub fn summary(&self) -> String {
        let detail = match &self.particular {
            Particular::Adaptive { pairs, .. } => format!("{pairs} pairs of pixel and cell"),
            Particular::Talk { occupancy, unresolved_share, .. } => {
                let [occupancy, unresolved] = [occupancy, unresolved_share].map(|share| 100.0 * share);
                format!("table {occupancy:.1} % full, {unresolved:.2} % unresolved")
            }
        };
        format!(
            "filter {}: {:.2} s, {:.1} % of rendering, beside what noting paths for it costs while they are traced; {} paths shared \
             {} cells; {detail}; {:.1} MB; {} unfiltered",
            self.name,
            self.seconds,
            100.0 * self.share,
            self.paths,
            self.cells,
            self.bytes as f64 / 1e6,
            self.unfiltered,
        )
    }
}

/// Counts of what was not as it should be.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Problems {
    /// Messages that the picture is not quite what the scene asks for.
    pub warnings: u64,
    /// Samples that came out not finite or negative, and count as black.
    pub rejected_samples: u64,
    /// Pixels that negative lobes of the pixel filter had made negative, written as 0.
    pub negative_pixels: u64,
    /// Values too large for 16 bits, written as the largest that fits.
    pub values_beyond_half: u64,
}

/// Largest resident set of this process so far, bytes.
pub fn peak_memory() -> Option<u64> {
    status("VmHWM:")
}

/// Resident set of this process now, bytes.
pub fn resident_memory() -> Option<u64> {
    status("VmRSS:")
}

/// Seconds that all processors have spent on this process so far; 0 if the system does not say.
pub fn processor_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    parse_processor_seconds(&text).unwrap_or(0.0)
}

/// Of `/proc/PID/stat`, fields 14 and 15, in hundredths of a second: proc(5). The name before them may hold anything, but
/// ends with the last parenthesis.
fn parse_processor_seconds(text: &str) -> Option<f64> {
    let mut fields = text.rsplit_once(')')?.1.split_whitespace().skip(11);
    let mut ticks = || fields.next()?.parse::<f64>().ok();
    Some((ticks()? + ticks()?) / 100.0)
}

fn status(key: &str) -> Option<u64> {
    parse_status(&std::fs::read_to_string("/proc/self/status").ok()?, key)
}

/// A size in the text of `/proc/PID/status`, which gives them in units of 1024 bytes: proc(5).
fn parse_status(text: &str, key: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    let kilobytes: u64 = line.trim().strip_suffix(" kB")?.parse().ok()?;
    kilobytes.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rejected_samples_are_told_with_their_share() {
        assert_eq!(rejected(0, 100), None);
        assert!(rejected(1, 100).unwrap().starts_with("1 sample was (1.00e0 %) not finite"));
        assert!(rejected(3, 0).unwrap().starts_with("3 samples were"));
    }

    #[test]
    fn memory_is_read_from_the_status_file() {
        let text = "Name:\tVmHWM: 7 kB\nVmPeak:\t  999 kB\nVmHWM:\t    2048 kB\nVmRSS:\tnone\n";
        assert_eq!(parse_status(text, "VmHWM:"), Some(2 << 20));
        assert_eq!(parse_status(text, "VmRSS:"), None);
        assert_eq!(parse_status(text, "VmSwap:"), None);
        // In this order: other tests take memory in between.
        let resident = resident_memory();
        assert!(peak_memory() >= resident);
    }

    #[test]
    fn figures_have_three_digits() {
        for (x, text) in
            [(1.3, "1.30"), (0.0123, "0.0123"), (123.4, "123"), (0.0071, "7.10e-3"), (2e5, "2.00e5"), (0.0, "0")]
        {
            assert_eq!(figure(x), text);
        }
        assert_eq!([1_000, 2_500_000, 8_000_000_000].map(size), ["1.0 kB", "2.5 MB", "8.00 GB"]);
    }

    #[test]
    fn processor_time_is_user_and_system() {
        let text = "7 (a b) c) S 1 7 7 0 -1 4194560 1 2 3 4 250 50 0 0 20 0 1 0 9 8";
        assert_eq!(parse_processor_seconds(text), Some(3.0));
        assert_eq!(parse_processor_seconds("7"), None);
        assert!(processor_seconds() >= 0.0);
    }
}
