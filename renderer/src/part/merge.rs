//! Adding parts.

use std::ops::Range;
use std::path::Path;

use filter::{Branch, Params, Slots};
use rayon::prelude::*;

use super::header::Header;
use super::write::{Writer, failed};
use super::{BATCH, Part, PartError, Written, batches};
use crate::film::{Film, Tile, tile_slots};
use crate::filtering::{self, Filtering, Merging};
use crate::frame::{Accumulation, FrameDescription, Samples};
use crate::integrator::Counters;

/// Parts of one frame that share no sample.
pub struct Parts {
    /// The frame.
    pub description: FrameDescription,
    /// The samples of all of them.
    pub samples: Samples,
    counters: Counters,
    filter_paths: [u64; 2],
    parts: Vec<Part>,
}

/// The frame that parts add up to.
pub struct Merged {
    /// All sums, and the filtered image.
    pub film: Film,
    /// The frame.
    pub description: FrameDescription,
    /// The samples of all parts.
    pub samples: Samples,
    /// Rays, and samples that were rejected.
    pub counters: Counters,
    /// What the filter did.
    pub report: Option<filtering::Report>,
}

impl Parts {
    /// Parts to be added.
    ///
    /// # Errors
    /// There are none; two of them are of different frames or have the same samples; one ends within an epoch.
    pub fn new(parts: Vec<Part>) -> Result<Self, PartError> {
        let mut samples = Samples::default();
        for (at, part) in parts.iter().enumerate() {
            check(&parts[..at], part, &mut samples)?;
        }
        let mut description = parts.first().ok_or(PartError::None)?.description.clone();
        description.asked = 0..description.spp;
        let (mut counters, mut filter_paths) = (Counters::default(), [0u64; 2]);
        for part in &parts {
            counters += part.counters;
            filter_paths = [0, 1].map(|i| filter_paths[i].saturating_add(part.filter_paths[i]));
        }
        Ok(Self { description, samples, counters, filter_paths, parts })
    }

    /// The first samples of the frame that no part has.
    pub fn missing(&self) -> Option<Range<u64>> {
        Some(self.samples.missing(&self.description.asked)).filter(|missing| !missing.is_empty())
    }

    /// Adds them up, tree by tree and then tile by tile: the sums of pixels and one tree's cells are all that is ever held.
    ///
    /// # Errors
    /// A part is not whole, or damaged.
    pub fn develop(mut self) -> Result<Merged, PartError> {
        let tiles = self.description.tile_count();
        let surroundings = self.description.surroundings;
        let params = self.description.filtering.adaptive(&surroundings);
        let mut merging = Merging::new(&self.description.filtering, &surroundings, tiles, self.description.aovs);
        for (params, merging) in params.iter().zip(&mut merging) {
            for tree in 0..params.stored_trees() {
                let mut branches = Vec::with_capacity(tiles);
                for batch in batches(0..tiles) {
                    branches.extend(self.branches(params, tree, &batch)?);
                }
                merging.add_tree(branches);
            }
        }
        let mut film = self.description.film();
        let resolved = self.pixels(&mut film, |tile, slots| match &merging {
            Some(merging) => merging.resolve(tile, &slots),
            None => Vec::new(),
        })?;
        self.end()?;
        let report = merging.map(|merging| merging.finish(self.filter_paths, resolved, &surroundings, &mut film));
        let Self { description, samples, counters, .. } = self;
        Ok(Merged { film, description, samples, counters, report })
    }

    /// Adds them up one after the other, for whom it matters what the frame is after each: all sums are held.
    ///
    /// # Errors
    /// A part is not whole, or damaged.
    pub fn accumulate(self, mut then: impl FnMut(&mut Accumulation)) -> Result<Accumulation, PartError> {
        let mut frame = Accumulation::new(self.description);
        for mut part in self.parts {
            part.add_to(&mut frame)?;
            then(&mut frame);
        }
        Ok(frame)
    }

    /// Adds them up to one part, to be published as `path`: see [`super::write`].
    ///
    /// # Errors
    /// A part is not whole, or damaged; the sum cannot be written.
    pub fn write(mut self, path: &Path) -> Result<Written, PartError> {
        let header = Header::new(&self.description, &self.samples, &self.counters, self.filter_paths);
        let mut writer = Writer::begin(path, &header).map_err(failed(path))?;
        let tiles = self.description.tile_count();
        let params = self.description.filtering.adaptive(&self.description.surroundings);
        if let Some(params) = &params {
            for tree in 0..params.stored_trees() {
                for batch in batches(0..tiles) {
                    let branches = self.branches(params, tree, &batch)?;
                    let store = |tile: usize, words: &mut Vec<u64>| {
                        branches[tile - batch.start].store(&tile_slots(tile), words);
                    };
                    writer.sections(batch.clone(), store).map_err(failed(path))?;
                }
            }
        }
        let mut film = self.description.film();
        let slots = self.pixels(&mut film, |_, slots| slots)?;
        self.end()?;
        let store = |tile, words: &mut Vec<u64>| {
            let pixels = tile_slots(tile);
            film.store(pixels.start as usize..pixels.end as usize, words);
            if params.is_some() {
                slots[tile].store(&pixels, words);
            }
        };
        writer.sections(0..tiles, store).and_then(|()| writer.end(&[])).map_err(failed(path))
    }

    /// The sums of a batch's shares of a tree.
    fn branches(&mut self, params: &Params, tree: usize, batch: &Range<usize>) -> Result<Vec<Branch>, PartError> {
        let words = self.words(batch)?;
        let sum = |tile: usize| {
            let shares = self.parts.iter().zip(&words).map(|(part, words)| {
                Branch::read(params, tree, &tile_slots(tile), &words[tile - batch.start])
                    .map_err(|_| part.sections.damaged())
            });
            Ok(Branch::sum(shares.collect::<Result<_, _>>()?))
        };
        batch.clone().into_par_iter().map(sum).collect()
    }

    /// Adds the pixels of all parts to a film; what `then` makes of each tile and what the filter keeps of its pixels.
    fn pixels<T: Send>(
        &mut self,
        film: &mut Film,
        then: impl Fn(usize, Slots) -> T + Sync,
    ) -> Result<Vec<T>, PartError> {
        let filtered = self.description.filtering != Filtering::None;
        let mut done = Vec::with_capacity(film.tile_count());
        let mut tiles = film.tiles();
        let mut begin = 0;
        for tiles in tiles.chunks_mut(BATCH) {
            let batch = begin..begin + tiles.len();
            let words = self.words(&batch)?;
            let add = |(at, pixels): (usize, &mut Tile<'_>)| {
                let tile = batch.start + at;
                let mut sum = Slots::default();
                for (part, words) in self.parts.iter().zip(&words) {
                    let mut rest = words[at].as_slice();
                    let slots = pixels.load(&mut rest).and_then(|()| match filtered {
                        true => Slots::read(&tile_slots(tile), rest).ok(),
                        false => rest.is_empty().then(Slots::default),
                    });
                    sum.add(slots.ok_or_else(|| part.sections.damaged())?);
                }
                Ok(then(tile, sum))
            };
            let of_batch: Result<Vec<T>, PartError> = tiles.par_iter_mut().enumerate().map(add).collect();
            done.extend(of_batch?);
            begin = batch.end;
        }
        Ok(done)
    }

    /// The words of the next sections, a batch's, of every part.
    fn words(&mut self, batch: &Range<usize>) -> Result<Vec<Vec<Vec<u64>>>, PartError> {
        let words = |part: &mut Part| batch.clone().map(|_| part.sections.words()).collect();
        self.parts.par_iter_mut().map(words).collect()
    }

    /// Makes sure that all files end where they should.
    fn end(&mut self) -> Result<(), PartError> {
        for sections in self.parts.iter_mut().map(|part| &mut part.sections) {
            // Between epochs it is empty, and parts that end within one are not added.
            if !sections.words()?.is_empty() || sections.rest() > 0 {
                return Err(sections.damaged());
            }
        }
        Ok(())
    }
}

/// Makes sure that a part can be added to those before it, and adds its samples to theirs.
fn check(before: &[Part], part: &Part, samples: &mut Samples) -> Result<(), PartError> {
    let both = |other: &Part| [other.path.clone(), part.path.clone()];
    let description = &part.description;
    if let Some(first) = before.first() {
        if let Some((what, ours, theirs)) = first.description.difference(description) {
            return Err(PartError::Different { paths: both(first), what, values: [ours, theirs] });
        }
    }
    for range in part.samples.ranges() {
        if let Err(samples) = samples.insert(range.clone()) {
            let has = |other: &&Part| {
                other.samples.ranges().iter().any(|known| known.start < samples.end && samples.start < known.end)
            };
            // Its own ranges are apart, so it is another's.
            let other = before.iter().find(has).unwrap_or(part);
            return Err(PartError::Overlap { paths: both(other), samples });
        }
    }
    let (epoch, spp) = (description.filtering.epoch(), description.spp);
    let mut cuts = part.samples.ranges().iter().flat_map(|range| [range.start, range.end]);
    match cuts.find(|sample| sample % epoch != 0 && *sample != spp) {
        Some(end) => Err(PartError::Unfinished { path: part.path.clone(), end, epoch }),
        None => Ok(()),
    }
}
