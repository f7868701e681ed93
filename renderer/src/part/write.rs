//! Writing parts.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use super::header::Header;
use super::{MAGIC, PartError, batches, section, storable};
use crate::draft::Draft;
use crate::film::tile_slots;
use crate::frame::Accumulation;

/// A part that is written and has not got its name yet.
#[derive(Debug)]
pub struct Written {
    draft: Draft,
    bytes: u64,
}

impl Written {
    /// Waits until the bytes are on the disk, and gives the part its name; its bytes. It may take long and needs no more than
    /// the file, so it can be done beside other work.
    ///
    /// # Errors
    /// The system's: the name has what it had before.
    pub fn publish(self, path: &Path) -> Result<u64, PartError> {
        self.draft.publish().map(|()| self.bytes).map_err(failed(path))
    }
}

/// Writes a frame in the making, to be published as `path`. Until then nothing has that name, or what had it before.
///
/// # Errors
/// The filter cannot be stored; the folder is absent or not writable, or the disk is full.
pub fn write(frame: &mut Accumulation, path: &Path) -> Result<Written, PartError> {
    storable(&frame.description.filtering)?;
    if let Some(filter) = &mut frame.filter {
        filter.settle();
    }
    let written = || {
        let mut writer = Writer::begin(path, &header(frame))?;
        let tiles = frame.film.tile_count();
        if let Some(filter) = &frame.filter {
            for tree in 0..filter.stored_trees() {
                writer.sections(0..tiles, |tile, words| filter.store_tree(tree, tile, &tile_slots(tile), words))?;
            }
        }
        writer.sections(0..tiles, |tile, words| {
            let pixels = tile_slots(tile);
            frame.film.store(pixels.start as usize..pixels.end as usize, words);
            if let Some(filter) = &frame.filter {
                filter.store_slots(tile, &pixels, words);
            }
        })?;
        let mut words = Vec::new();
        if let Some(filter) = &frame.filter {
            let next = frame.samples.ranges().last().map_or(0, |range| range.end);
            filter.store_epoch(next, &mut words);
        }
        writer.end(&words)
    };
    written().map_err(failed(path))
}

fn header(frame: &Accumulation) -> Header {
    let paths = frame.filter.as_ref().map_or([0; 2], |filter| filter.paths());
    Header::new(&frame.description, &frame.samples, &frame.counters, paths)
}

/// What became of a file.
pub fn failed(path: &Path) -> impl Fn(io::Error) -> PartError {
    |why| PartError::File { what: "write", path: path.to_owned(), why }
}

/// A part that is being written.
pub struct Writer {
    draft: Draft,
    file: File,
    bytes: u64,
    /// Room for sections, to be used again: asking the system for it takes as long as filling it.
    room: Vec<Vec<u8>>,
}

/// Tiles of which a thread writes the sections into one piece of memory.
const GROUP: usize = 4;

/// Groups that are made while as many are on their way to the file: enough for many threads, at a tenth of a megabyte each.
const GROUPS: usize = 32;

impl Writer {
    /// Writes all that comes before the sums.
    pub fn begin(path: &Path, header: &Header) -> io::Result<Self> {
        let draft = Draft::create(path)?;
        let file = OpenOptions::new().write(true).open(draft.path())?;
        let mut writer = Self { draft, file, bytes: 0, room: Vec::new() };
        let mut first = MAGIC.to_vec();
        section::append_bytes(&mut first, &serde_json::to_vec(header).map_err(io::Error::other)?);
        writer.put(&[first])?;
        Ok(writer)
    }

    /// Writes a section for each of some tiles: what `store` appends.
    pub fn sections(&mut self, tiles: Range<usize>, store: impl Fn(usize, &mut Vec<u64>) + Sync) -> io::Result<()> {
        let encode = |words: &mut Vec<u64>, (bytes, tiles): (&mut Vec<u8>, Range<usize>)| {
            bytes.clear();
            for tile in tiles {
                words.clear();
                store(tile, words);
                section::append_words(bytes, words);
            }
        };
        // Some groups go to the disk while the next ones are made.
        let (mut next, mut done) = (std::mem::take(&mut self.room), Vec::new());
        for batch in batches(tiles, GROUPS * GROUP) {
            let groups: Vec<Range<usize>> = batches(batch, GROUP).collect();
            next.resize_with(groups.len(), Vec::new);
            let made = || next.par_iter_mut().zip(groups).for_each_init(Vec::new, encode);
            rayon::join(made, || self.put(&done)).1?;
            std::mem::swap(&mut next, &mut done);
        }
        self.put(&done)?;
        self.room = done;
        Ok(())
    }

    /// Writes the last section.
    pub fn end(mut self, epoch: &[u64]) -> io::Result<Written> {
        let mut last = Vec::new();
        section::append_words(&mut last, epoch);
        self.put(&[last])?;
        Ok(Written { draft: self.draft, bytes: self.bytes })
    }

    fn put(&mut self, pieces: &[Vec<u8>]) -> io::Result<()> {
        for bytes in pieces {
            self.bytes += bytes.len() as u64;
            self.file.write_all(bytes)?;
        }
        Ok(())
    }
}
