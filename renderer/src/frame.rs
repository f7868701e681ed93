//! A frame in the making: what it is, and all that its samples have added to it so far.

use std::fmt;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

use filter::PathRecord;
use filter::talk::Talk;
use glam::{DMat4, DVec3};

use crate::film::{self, AovSet, Film, Outputs};
use crate::filtering::{self, Filtering, FrameFilter, Surroundings};
use crate::integrator::Counters;
use crate::world::Bounds;

/// What of a frame depends on the scene and the job alone.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameDescription {
    /// Number of the frame in its sequence.
    pub number: i32,
    /// Seed of all randomness.
    pub seed: u64,
    /// Samples of each pixel that the whole frame has.
    pub spp: u64,
    /// Those of them that this job is to take.
    pub asked: Range<u64>,
    /// Hash of the scene's files: [`crate::scene::Scene::hash`].
    pub scene_hash: u64,
    /// Width and height of the whole frame.
    pub resolution: [u32; 2],
    /// Pixels around it that there is room for, on every side.
    pub overscan: u32,
    /// The pixels that are rendered; column and row [`Self::overscan`] are the frame's first.
    pub bounds: Bounds,
    /// Auxiliary outputs.
    pub aovs: AovSet,
    /// Names of the groups of lights, by their numbers.
    pub light_groups: Vec<Arc<str>>,
    /// Names that mattes may show, of objects and of materials; sorted, and empty where there are no such mattes.
    pub names: [Vec<Arc<str>>; 2],
    /// How the frame is filtered.
    pub filtering: Filtering,
    /// What a filter must know of the world.
    pub surroundings: Surroundings,
    /// What places are measured from, in the world of the scene file; not known of frames that were stored.
    pub origin: DVec3,
    /// Camera space from world space.
    pub camera_from_world: DMat4,
    /// Screen space, normalised to [0, 1]², from world space; `None` for a camera without such a space.
    pub ndc_from_world: Option<DMat4>,
    /// The output that the scene names.
    pub filename: Option<PathBuf>,
}

impl FrameDescription {
    /// All that two slices of a frame must share for their samples to belong to one picture, in words, one line each.
    pub fn settings(&self) -> Vec<(&'static str, String)> {
        let ([x0, x1], [y0, y1]) = (self.in_frame(0), self.in_frame(1));
        let filter = self.filtering.settings().into_iter().map(|(key, value)| format!(" {key}={value}"));
        let cells = match self.filtering {
            Filtering::None => "none".to_owned(),
            _ => self.surroundings.to_string(),
        };
        vec![
            ("version", env!("CARGO_PKG_VERSION").into()),
            ("scene", format!("{:016x}", self.scene_hash)),
            ("frame", self.number.to_string()),
            ("seed", self.seed.to_string()),
            ("samples per pixel", self.spp.to_string()),
            ("resolution", format!("{}x{}", self.resolution[0], self.resolution[1])),
            ("pixels", format!("{x0},{x1},{y0},{y1}")),
            ("overscan", self.overscan.to_string()),
            ("channels", self.aovs.iter().map(film::Aov::name).collect::<Vec<_>>().join(",")),
            ("filter", self.filtering.name().to_owned() + &filter.collect::<String>()),
            ("cells", cells),
        ]
    }

    /// What its film shows.
    pub fn outputs(&self) -> Outputs {
        let groups = if self.aovs.contains(film::Aov::Light) { self.light_groups.clone() } else { Vec::new() };
        Outputs { aovs: self.aovs, groups }
    }

    /// First and one past the last column (axis 0) or row (1) that is rendered, in the frame: less than 0 around it.
    pub fn in_frame(&self, axis: usize) -> [i64; 2] {
        [self.bounds.min, self.bounds.max].map(|corner| i64::from(corner[axis]) - i64::from(self.overscan))
    }

    /// An empty film for it.
    pub fn film(&self) -> Film {
        self.band_film(self.bounds)
    }

    /// An empty film for a band of it.
    pub fn band_film(&self, band: Bounds) -> Film {
        let filtered = self.filtering != Filtering::None;
        Film::new(self.resolution, band, self.outputs(), filtered).with_overscan(self.overscan)
    }

    /// Its rows of tiles, from the top.
    pub fn bands(&self) -> impl Iterator<Item = Bounds> + use<> {
        let Bounds { min, max } = self.bounds;
        let band = move |top: u32| Bounds { min: [min[0], top], max: [max[0], max[1].min(top + film::TILE)] };
        (min[1]..max[1]).step_by(film::TILE as usize).map(band)
    }

    /// Number of tiles of its film.
    pub fn tile_count(&self) -> usize {
        film::tile_count(self.bounds)
    }

    /// The first of [`Self::settings`] in which another frame differs: its name, and both values.
    pub fn difference(&self, other: &Self) -> Option<(&'static str, String, String)> {
        let mut pairs = self.settings().into_iter().zip(other.settings());
        pairs.find_map(|((name, mine), (_, others))| (mine != others).then_some((name, mine, others)))
    }
}

/// Numbers of samples: ranges without gaps between those that touch, in order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Samples(Vec<Range<u64>>);

impl Samples {
    /// Adds a range.
    ///
    /// # Errors
    /// Some of its samples are there already: which.
    pub fn insert(&mut self, range: Range<u64>) -> Result<(), Range<u64>> {
        if range.is_empty() {
            return Ok(());
        }
        let at = self.0.partition_point(|known| known.end <= range.start);
        if let Some(known) = self.0.get(at).filter(|known| known.start < range.end) {
            return Err(known.start.max(range.start)..known.end.min(range.end));
        }
        self.0.insert(at, range);
        self.0.dedup_by(|next, kept| {
            let touch = kept.end == next.start;
            if touch {
                kept.end = next.end;
            }
            touch
        });
        Ok(())
    }

    /// The ranges, in order.
    pub fn ranges(&self) -> &[Range<u64>] {
        &self.0
    }

    /// Number of samples.
    pub fn count(&self) -> u64 {
        self.0.iter().map(|range| range.end - range.start).sum()
    }

    /// The first samples of `whole` that are not there; empty if all are.
    pub fn missing(&self, whole: &Range<u64>) -> Range<u64> {
        let start = self.0.iter().fold(whole.start, |next, range| if range.contains(&next) { range.end } else { next });
        let end = self.0.iter().map(|range| range.start).find(|begin| *begin >= start).unwrap_or(whole.end);
        start.min(whole.end)..end.min(whole.end).max(start.min(whole.end))
    }
}

impl From<Range<u64>> for Samples {
    fn from(range: Range<u64>) -> Self {
        Self(if range.is_empty() { Vec::new() } else { vec![range] })
    }
}

impl fmt::Display for Samples {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ranges: Vec<String> = self.0.iter().map(|range| format!("{}:{}", range.start, range.end)).collect();
        f.write_str(&ranges.join(","))
    }
}

/// A frame with the samples that were taken so far.
pub struct Accumulation {
    /// What it is.
    pub description: FrameDescription,
    /// All sums of pixels.
    pub film: Film,
    /// All sums of the filter.
    pub filter: Option<FrameFilter>,
    /// The samples of each pixel that were taken.
    pub samples: Samples,
    /// Rays, and samples that were rejected.
    pub counters: Counters,
    /// Number of the first frame that the filter's averages know of, if it is an earlier one.
    since: Option<i32>,
}

/// What a frame leaves to the next one of its sequence where averages move: the talk's cells.
pub struct Past {
    talk: Box<Talk>,
    /// See [`FrameDescription::origin`].
    origin: DVec3,
    since: i32,
}

impl Past {
    /// Number of the first frame that averages know of.
    pub fn since(&self) -> i32 {
        self.since
    }
}

impl Accumulation {
    /// No sample yet.
    ///
    /// # Panics
    /// If the filter's settings are not valid, which is checked when a job is prepared.
    pub fn new(description: FrameDescription) -> Self {
        let film = description.film();
        let filter = FrameFilter::new(&description.filtering, &description.surroundings, &film)
            .expect("the settings of a frame's filter are valid");
        let (samples, counters) = (Samples::default(), Counters::default());
        Self { description, film, filter, samples, counters, since: None }
    }

    /// No sample yet, and a filter that goes on from the cells of the frame before.
    ///
    /// # Panics
    /// As [`Self::new`].
    pub fn following(description: FrameDescription, past: Past) -> Self {
        let Past { mut talk, origin, since } = past;
        talk.next_frame(description.surroundings.anchor.origin, origin - description.origin);
        let mut frame = Self::new(description);
        if let Some(filter) = &mut frame.filter {
            filter.follow(talk);
        }
        frame.since = Some(since);
        frame
    }

    /// Whether the samples that were asked for are there.
    pub fn complete(&self) -> bool {
        self.samples.missing(&self.description.asked).is_empty()
    }

    /// The first of the passes over the whole frame into which samples `rest` are cut.
    pub fn pass(&self, rest: &Range<u64>) -> Range<u64> {
        match &self.filter {
            Some(filter) => filter.block(rest),
            None => pass(rest, rest.start - self.description.asked.start, self.description.bounds.area()),
        }
    }

    /// Gives the film its filtered values, as of now. Nothing is lost: more samples may follow.
    pub fn develop(&mut self) -> Option<filtering::Report> {
        self.filter.as_mut().map(|filter| filter.develop(&self.description.surroundings, &mut self.film))
    }

    /// The same as if the block whose first samples left `records` had ended with them; the filter has not taken them, and
    /// will not have. A copy of it does, so this is for frames of few samples yet.
    ///
    /// # Panics
    /// If the filter cannot be stored: see [`FrameFilter::divisible`].
    pub fn develop_with(&mut self, samples: &Range<u64>, records: &[Vec<PathRecord>]) {
        let Some(filter) = &mut self.filter else { return };
        let Self { description, film, .. } = self;
        let mut copy = FrameFilter::new(&description.filtering, &description.surroundings, film)
            .ok()
            .flatten()
            .expect("the settings of a frame's filter are valid");
        filter.settle();
        let mut trees = vec![Vec::new(); filter.stored_trees()];
        let mut words = Vec::new();
        for tile in 0..film.tile_count() {
            let pixels = film::tile_slots(tile);
            trees.iter_mut().for_each(Vec::clear);
            filter.store_trees(tile, &pixels, &mut trees);
            for (tree, words) in trees.iter().enumerate() {
                copy.load_tree(tree, tile, &pixels, words).expect("a filter takes its own sums");
            }
            words.clear();
            filter.store_slots(tile, &pixels, &mut words);
            copy.load_slots(tile, &pixels, &words).expect("a filter takes its own sums");
        }
        copy.begin_stored_epoch(samples.start);
        for piece in filter.epoch(samples.start) {
            words.clear();
            filter.store_epoch(&piece, &mut words);
            copy.load_epoch(&words).expect("a filter takes its own sums");
        }
        copy.add(samples, records);
        copy.finish(&description.surroundings, film);
    }

    /// The same when no more samples follow: takes less memory. With it what the next frame is to go on from, if it is to.
    pub fn finish(&mut self) -> Option<(filtering::Report, Option<Past>)> {
        let Self { description, film, since, .. } = self;
        let (report, talk) = self.filter.take()?.finish(&description.surroundings, film);
        let past = talk.filter(|_| description.filtering.is_temporal()).map(|talk| Past {
            talk,
            origin: description.origin,
            since: since.unwrap_or(description.number),
        });
        Some((report, past))
    }
}

/// The next pass of samples `rest` when `done` are done: short ones first, so that a job that is stopped early has something,
/// then as long as [`PASS_SPP`] and [`PASS_PATHS`] let them. Where they are cut changes no bit.
fn pass(rest: &Range<u64>, done: u64, pixels: u64) -> Range<u64> {
    let longest = (PASS_PATHS / pixels.max(1)).clamp(1, PASS_SPP);
    rest.start..rest.end.min(rest.start.saturating_add(done.clamp(1, longest)))
}

/// The longest pass, in samples per pixel: so that the threads seldom wait for each other.
const PASS_SPP: u64 = 16;

/// Paths of a pass: a few seconds of work on two cores, so that a job that is asked to stop does.
const PASS_PATHS: u64 = 1 << 21;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_grow_up_to_a_limit() {
        let lengths = |count, pixels| {
            let (mut rest, mut lengths) = (0..count, Vec::new());
            while !rest.is_empty() {
                let pass = pass(&rest, rest.start, pixels);
                lengths.push(pass.end - pass.start);
                rest.start = pass.end;
            }
            lengths
        };
        assert_eq!(lengths(45, 1 << 16), [1, 1, 2, 4, 8, 16, 13]);
        assert_eq!(lengths(9, 1 << 19), [1, 1, 2, 4, 1]);
        assert_eq!(lengths(3, 1 << 30), [1, 1, 1]);
        assert_eq!(pass(&(u64::MAX - 1..u64::MAX), 50, 1), u64::MAX - 1..u64::MAX);
    }

    #[test]
    fn ranges_join_and_never_overlap() {
        let mut samples = Samples::default();
        for range in [4..8, 12..16, 0..4, 20..20] {
            samples.insert(range).unwrap();
        }
        assert_eq!(samples.ranges(), [0..8, 12..16]);
        assert_eq!((samples.count(), samples.to_string()), (12, "0:8,12:16".into()));
        assert_eq!(samples.insert(6..14), Err(6..8));
        assert_eq!(samples.insert(10..14), Err(12..14));
        assert_eq!(samples.missing(&(0..16)), 8..12);
        assert_eq!(samples.missing(&(0..20)), 8..12);
        samples.insert(8..12).unwrap();
        assert_eq!(samples.ranges(), std::slice::from_ref(&(0..16)));
        assert!(samples.missing(&(0..16)).is_empty() && samples.missing(&(3..9)).is_empty());
        assert_eq!(samples.missing(&(0..20)), 16..20);
        assert_eq!(Samples::default().missing(&(2..5)), 2..5);
    }
}
