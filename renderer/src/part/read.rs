//! Reading one part.

use std::path::{Path, PathBuf};

use super::header::Header;
use super::section::Sections;
use super::{MAGIC, PartError, batch_length, batches, runs, unfinished};
use crate::film::{Film, tile_slots};
use crate::filtering::Filtering;
use crate::frame::{Accumulation, FrameDescription, Samples};
use crate::integrator::Counters;

/// A part of which the header is read.
pub struct Part {
    /// The file.
    pub path: PathBuf,
    /// The frame it is of.
    pub description: FrameDescription,
    /// The samples it has.
    pub samples: Samples,
    pub(super) counters: Counters,
    pub(super) filter_paths: [u64; 2],
    pub(super) sections: Sections,
    /// Where the first batch begins.
    first: u64,
    /// Where the runs of batches begin, and the last one ends, of those that were gone to.
    batches: Vec<Vec<u64>>,
}

impl Part {
    /// Opens a part and reads what it says of itself.
    ///
    /// # Errors
    /// The file cannot be read, or is no part of this version, or its header is damaged.
    pub fn open(path: &Path) -> Result<Self, PartError> {
        let (mut sections, magic): (_, [u8; MAGIC.len()]) = match Sections::open(path) {
            Err(PartError::Truncated(path)) => return Err(PartError::Foreign(path)),
            opened => opened?,
        };
        let [name @ .., version] = magic;
        if name != MAGIC[..7] {
            return Err(PartError::Foreign(path.to_owned()));
        }
        if version != MAGIC[7] {
            return Err(PartError::Version { path: path.to_owned(), version });
        }
        let header: Header = serde_json::from_slice(&sections.bytes()?).map_err(|_| sections.damaged())?;
        let (description, samples) = header.description().zip(header.samples()).ok_or_else(|| sections.damaged())?;
        let version = env!("CARGO_PKG_VERSION");
        if header.version != version {
            let (what, theirs, ours) = ("program version", header.version, version.to_owned());
            return Err(PartError::Mismatch { path: path.to_owned(), what, theirs, ours });
        }
        // Before anybody makes room for the frame: its pixels are all in the file, at half a byte a word at least.
        let FrameDescription { bounds, filtering, .. } = &description;
        let words = Film::stored_words(*bounds, &description.outputs(), *filtering != Filtering::None);
        if words / 2 > sections.rest() {
            return Err(PartError::Truncated(path.to_owned()));
        }
        let (counters, filter_paths) = (header.counters(), header.filter_paths);
        let (path, first) = (path.to_owned(), sections.position());
        Ok(Self { path, description, samples, counters, filter_paths, sections, first, batches: Vec::new() })
    }

    /// The part as a frame to go on with.
    ///
    /// # Errors
    /// [`PartError`]: it is not whole, or damaged.
    pub fn begin(mut self) -> Result<Accumulation, PartError> {
        let mut frame = Accumulation::new(self.description.clone());
        let mut pieces = self.add_to(&mut frame)?;
        let next = unfinished(&self.description, &self.samples);
        if let Some((filter, next)) = frame.filter.as_mut().zip(next) {
            filter.begin_stored_epoch(next);
            for _ in 0..std::mem::take(&mut pieces) {
                let words = self.sections.words()?;
                filter.load_epoch(&words).map_err(|_| self.sections.damaged())?;
            }
        }
        self.end(pieces)?;
        Ok(frame)
    }

    /// Adds the part's sums to those of a frame that it belongs to, and that has none of its samples; in how many sections
    /// that follow it is what the filter shares within an epoch.
    pub(super) fn add_to(&mut self, frame: &mut Accumulation) -> Result<u64, PartError> {
        let mut tiles = frame.film.tiles();
        let trees = runs(&self.description) - 1;
        for (number, batch) in batches(0..tiles.len(), batch_length(&self.description)).enumerate() {
            self.go_to(number, 0)?;
            let sections = &mut self.sections;
            if let Some(filter) = &mut frame.filter {
                for (tree, tile) in (0..trees).flat_map(|tree| batch.clone().map(move |tile| (tree, tile))) {
                    let words = sections.words()?;
                    filter.load_tree(tree, tile, &tile_slots(tile), &words).map_err(|_| sections.damaged())?;
                }
            }
            for tile in batch {
                let words = sections.words()?;
                let mut rest = words.as_slice();
                tiles[tile].load(&mut rest).ok_or_else(|| sections.damaged())?;
                match &mut frame.filter {
                    Some(filter) => {
                        filter.load_slots(tile, &tile_slots(tile), rest).map_err(|_| sections.damaged())?;
                    }
                    None if rest.is_empty() => {}
                    None => return Err(sections.damaged()),
                }
            }
        }
        if let Some(filter) = &mut frame.filter {
            filter.add_paths(self.filter_paths);
        }
        for range in self.samples.ranges() {
            frame.samples.insert(range.clone()).map_err(|_| self.sections.damaged())?;
        }
        frame.counters += self.counters;
        self.pieces()
    }

    /// Goes to a run of a batch, of which those before were gone to before.
    pub(super) fn go_to(&mut self, batch: usize, run: usize) -> Result<(), PartError> {
        if batch == self.batches.len() {
            let begin = self.batches.last().map_or(self.first, |runs| runs[runs.len() - 1]);
            self.sections.go_to(begin)?;
            let lengths = self.sections.words()?;
            let mut begins = vec![self.sections.position()];
            for length in &lengths {
                begins.extend(begins[begins.len() - 1].checked_add(*length));
            }
            if lengths.len() != runs(&self.description) || begins.len() != lengths.len() + 1 {
                return Err(self.sections.damaged());
            }
            self.batches.push(begins);
        }
        self.sections.go_to(self.batches[batch][run])
    }

    /// Reads, after the last run, how many sections are left.
    pub(super) fn pieces(&mut self) -> Result<u64, PartError> {
        let end = self.batches.last().map_or(self.first, |runs| runs[runs.len() - 1]);
        match *self.sections.words()? {
            [pieces] if self.sections.position() > end => Ok(pieces),
            _ => Err(self.sections.damaged()),
        }
    }

    /// Makes sure that nothing is left: of so many sections none, and no bytes.
    pub(super) fn end(&self, sections: u64) -> Result<(), PartError> {
        if sections == 0 && self.sections.rest() == 0 { Ok(()) } else { Err(self.sections.damaged()) }
    }
}
