//! Adding parts.

use std::ops::Range;
use std::path::Path;

use filter::{Branch, Params, Slots};
use rayon::prelude::*;

use super::header::Header;
use super::section::Unread;
use super::write::{Writer, failed};
use super::{Part, PartError, Written, batch_length, batches, runs};
use crate::film::{Film, Image, Tile, tile_slots};
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

/// The image that parts of a filtered frame add up to.
pub struct Merged {
    /// The filtered image.
    pub image: Image,
    /// The frame.
    pub description: FrameDescription,
    /// The samples of all parts.
    pub samples: Samples,
    /// Rays, and samples that were rejected.
    pub counters: Counters,
    /// What the filter did.
    pub report: filtering::Report,
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

    /// Adds the parts of a filtered frame up to its image, tree by tree and then band by band: the cells of one tree, and
    /// later what the pixels show, are all that is ever held.
    ///
    /// # Errors
    /// A part is not whole, or damaged.
    ///
    /// # Panics
    /// If the frame is not filtered.
    pub fn develop(mut self) -> Result<Merged, PartError> {
        let description = self.description.clone();
        let FrameDescription { filtering, surroundings, bounds, aovs, .. } = &description;
        let merging = Merging::new(filtering, surroundings, *bounds, *aovs);
        let (mut merging, params) = merging.zip(filtering.adaptive(surroundings)).expect("a filtered frame");
        for tree in 0..params.stored_trees() {
            for piece in self.pieces(0..description.tile_count()) {
                merging.add(self.branches(&params, tree, &piece)?);
            }
            merging.end_tree();
        }
        let mut image: Option<Image> = None;
        let mut first = 0;
        for band in description.bands() {
            let mut film = description.band_film(band);
            let slots = self.pixels(first, &mut film, |_, slots| slots)?;
            merging.band(first, &slots, &mut film);
            first += slots.len();
            match &mut image {
                Some(image) => image.append(film.image()),
                None => image = Some(film.image().with_room_for(*bounds)),
            }
        }
        self.end()?;
        let mut image = image.expect("a frame has pixels");
        let report = merging.finish(self.filter_paths, &mut image);
        let Self { samples, counters, .. } = self;
        Ok(Merged { image, description, samples, counters, report })
    }

    /// Adds the parts of a frame up to all its sums.
    ///
    /// # Errors
    /// A part is not whole, or damaged.
    pub fn sum(mut self) -> Result<Accumulation, PartError> {
        if self.description.filtering != Filtering::None {
            return self.accumulate(|_| ());
        }
        let mut frame = Accumulation::new(self.description.clone());
        self.pixels(0, &mut frame.film, |_, _| ())?;
        self.end()?;
        (frame.samples, frame.counters) = (self.samples, self.counters);
        Ok(frame)
    }

    /// Adds them up one after the other, for whom it matters what the frame is after each: all sums are held.
    ///
    /// # Errors
    /// A part is not whole, or damaged.
    pub fn accumulate(self, mut then: impl FnMut(&mut Accumulation)) -> Result<Accumulation, PartError> {
        let mut frame = Accumulation::new(self.description);
        for mut part in self.parts {
            let pieces = part.add_to(&mut frame)?;
            part.end(pieces)?;
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
        let description = self.description.clone();
        let params = description.filtering.adaptive(&description.surroundings);
        let mut first = 0;
        for band in description.bands() {
            let mut film = description.band_film(band);
            let tiles = first..first + film.tile_count();
            // Of each tree, tile by tile.
            let mut trees: Vec<Vec<Branch>> = Vec::new();
            if let Some(params) = &params {
                for tree in 0..params.stored_trees() {
                    let pieces = self.pieces(tiles.clone()).map(|piece| self.branches(params, tree, &piece));
                    trees.push(pieces.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect());
                }
            }
            let slots = self.pixels(first, &mut film, |_, slots| slots)?;
            let store = |tile: usize, runs: &mut [Vec<u64>]| {
                let (words, of_trees) = runs.split_last_mut().expect("the run of the pixels");
                let (pixels, own) = (tile_slots(tile), tile_slots(tile - first));
                of_trees.iter_mut().zip(&trees).for_each(|(words, tree)| tree[tile - first].store(&pixels, words));
                film.store(own.start as usize..own.end as usize, words);
                if params.is_some() {
                    slots[tile - first].store(&pixels, words);
                }
            };
            writer.batch(tiles.clone(), trees.len() + 1, store).map_err(failed(path))?;
            first = tiles.end;
        }
        self.end()?;
        writer.end(0, |_, _| {}).map_err(failed(path))
    }

    /// Tiles in pieces of batches, of which the sections of all parts, ten kilobytes each, fit into a few megabytes.
    fn pieces(&self, tiles: Range<usize>) -> impl Iterator<Item = Range<usize>> + use<> {
        let length = (256 / self.parts.len()).clamp(1, 64);
        batches(tiles, batch_length(&self.description)).flat_map(move |batch| batches(batch, length))
    }

    /// The sums of the shares that some tiles have of a tree.
    fn branches(&mut self, params: &Params, tree: usize, tiles: &Range<usize>) -> Result<Vec<Branch>, PartError> {
        let unread = self.unread(tree, tiles)?;
        let sum = |tile: usize| {
            let share = |(part, unread): (&Part, &Vec<Unread>)| {
                let words = unread[tile - tiles.start].words();
                let share = words.and_then(|words| Branch::read(params, tree, &tile_slots(tile), &words).ok());
                share.ok_or_else(|| part.sections.damaged())
            };
            Ok(Branch::sum(self.parts.iter().zip(&unread).map(share).collect::<Result<_, _>>()?))
        };
        tiles.clone().into_par_iter().map(sum).collect()
    }

    /// Adds the pixels of all parts to a film whose first tile is the frame's tile `first`; what `then` makes of each tile and
    /// of what the filter keeps of its pixels.
    fn pixels<T: Send>(
        &mut self,
        first: usize,
        film: &mut Film,
        then: impl Fn(usize, Slots) -> T + Sync,
    ) -> Result<Vec<T>, PartError> {
        let filtered = self.description.filtering != Filtering::None;
        let mut done = Vec::with_capacity(film.tile_count());
        let mut tiles = film.tiles();
        let run = runs(&self.description) - 1;
        for piece in self.pieces(first..first + tiles.len()) {
            let unread = self.unread(run, &piece)?;
            let add = |(tile, pixels): (usize, &mut Tile<'_>)| {
                let mut sum = Slots::default();
                for (part, unread) in self.parts.iter().zip(&unread) {
                    let words = unread[tile - piece.start].words();
                    let slots = words.and_then(|words| {
                        let mut rest = words.as_slice();
                        pixels.load(&mut rest)?;
                        match filtered {
                            true => Slots::read(&tile_slots(tile), rest).ok(),
                            false => rest.is_empty().then(Slots::default),
                        }
                    });
                    sum.add(slots.ok_or_else(|| part.sections.damaged())?);
                }
                Ok(then(tile, sum))
            };
            let tiles = &mut tiles[piece.start - first..piece.end - first];
            let of_piece: Result<Vec<T>, PartError> = piece.clone().into_par_iter().zip(tiles).map(add).collect();
            done.extend(of_piece?);
        }
        Ok(done)
    }

    /// The sections of some tiles in a run, of every part. Within a batch those before were read last.
    fn unread(&mut self, run: usize, tiles: &Range<usize>) -> Result<Vec<Vec<Unread>>, PartError> {
        let length = batch_length(&self.description);
        let unread = |part: &mut Part| {
            if tiles.start % length == 0 {
                part.go_to(tiles.start / length, run)?;
            }
            tiles.clone().map(|_| part.sections.unread()).collect()
        };
        self.parts.iter_mut().map(unread).collect()
    }

    /// Makes sure that all files end where they should.
    fn end(&mut self) -> Result<(), PartError> {
        for part in &mut self.parts {
            let pieces = part.pieces()?;
            part.end(pieces)?;
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
    let mut cuts = part.samples.ranges().iter().flat_map(|range| [range.start, range.end]);
    match cuts.find(|sample| !description.filtering.begins_epoch(*sample) && *sample != description.spp) {
        Some(end) => {
            let epoch = description.filtering.epoch(end);
            Err(PartError::Unfinished { path: part.path.clone(), end, epoch: epoch.end - epoch.start })
        }
        None => Ok(()),
    }
}
