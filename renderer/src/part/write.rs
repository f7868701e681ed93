//! Writing parts.

use std::fs::OpenOptions;
use std::io::{self, BufWriter, Write};
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
    file: BufWriter<std::fs::File>,
    bytes: u64,
}

impl Writer {
    /// Writes all that comes before the sums.
    pub fn begin(path: &Path, header: &Header) -> io::Result<Self> {
        let draft = Draft::create(path)?;
        let file = BufWriter::with_capacity(1 << 20, OpenOptions::new().write(true).open(draft.path())?);
        let mut writer = Self { draft, file, bytes: 0 };
        writer.put(&MAGIC)?;
        writer.put(&section::of_bytes(&serde_json::to_vec(header).map_err(io::Error::other)?))?;
        Ok(writer)
    }

    /// Writes a section for each of some tiles: what `store` appends.
    pub fn sections(&mut self, tiles: Range<usize>, store: impl Fn(usize, &mut Vec<u64>) + Sync) -> io::Result<()> {
        let encode = |batch: Range<usize>| -> Vec<Vec<u8>> {
            let of_tile = |words: &mut Vec<u64>, tile| {
                words.clear();
                store(tile, words);
                section::of_words(words)
            };
            batch.into_par_iter().map_init(Vec::new, of_tile).collect()
        };
        // A batch goes to the disk while the next one is made.
        let mut done: Vec<Vec<u8>> = Vec::new();
        for batch in batches(tiles) {
            let (next, written) = rayon::join(|| encode(batch), || self.put_all(&done));
            written?;
            done = next;
        }
        self.put_all(&done)
    }

    /// Writes the last section.
    pub fn end(mut self, epoch: &[u64]) -> io::Result<Written> {
        self.put(&section::of_words(epoch))?;
        self.file.flush()?;
        Ok(Written { draft: self.draft, bytes: self.bytes })
    }

    fn put_all(&mut self, sections: &[Vec<u8>]) -> io::Result<()> {
        sections.iter().try_for_each(|section| self.put(section))
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.bytes += bytes.len() as u64;
        self.file.write_all(bytes)
    }
}
