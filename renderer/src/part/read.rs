//! Reading one part.

use std::path::{Path, PathBuf};

use super::header::Header;
use super::section::Sections;
use super::{MAGIC, PartError};
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
        Ok(Self { path: path.to_owned(), description, samples, counters, filter_paths, sections })
    }

    /// The part as a frame to go on with.
    ///
    /// # Errors
    /// [`PartError`]: it is not whole, or damaged.
    pub fn begin(mut self) -> Result<Accumulation, PartError> {
        let mut frame = Accumulation::new(self.description.clone());
        let epoch = self.add_to(&mut frame)?;
        if let Some(filter) = &mut frame.filter {
            let next = self.samples.ranges().last().map_or(0, |range| range.end);
            filter.load_epoch(next, &epoch).map_err(|_| self.sections.damaged())?;
        }
        Ok(frame)
    }

    /// Adds the part's sums to those of a frame that it belongs to, and that has none of its samples; what the filter shares
    /// within an epoch.
    pub(super) fn add_to(&mut self, frame: &mut Accumulation) -> Result<Vec<u64>, PartError> {
        let sections = &mut self.sections;
        let tiles = frame.film.tile_count();
        if let Some(filter) = &mut frame.filter {
            for (tree, tile) in (0..filter.stored_trees()).flat_map(|tree| (0..tiles).map(move |tile| (tree, tile))) {
                let words = sections.words()?;
                filter.load_tree(tree, tile, &tile_slots(tile), &words).map_err(|_| sections.damaged())?;
            }
            filter.add_paths(self.filter_paths);
        }
        for (tile, mut pixels) in frame.film.tiles().into_iter().enumerate() {
            let words = sections.words()?;
            let mut rest = words.as_slice();
            pixels.load(&mut rest).ok_or_else(|| sections.damaged())?;
            match &mut frame.filter {
                Some(filter) => {
                    filter.load_slots(tile, &tile_slots(tile), rest).map_err(|_| sections.damaged())?;
                }
                None if rest.is_empty() => {}
                None => return Err(sections.damaged()),
            }
        }
        let epoch = sections.words()?;
        if sections.rest() > 0 {
            return Err(sections.damaged());
        }
        for range in self.samples.ranges() {
            frame.samples.insert(range.clone()).map_err(|_| sections.damaged())?;
        }
        frame.counters += self.counters;
        Ok(epoch)
    }
}
