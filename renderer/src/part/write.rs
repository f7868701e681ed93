//! Writing parts.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use super::header::Header;
use super::{MAGIC, PartError, batch_length, batches, runs, section, storable, unfinished};
use crate::draft::Draft;
use crate::film::tile_slots;
use crate::frame::{Accumulation, FrameDescription};

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
        let Accumulation { film, filter, .. } = &*frame;
        writer.batches(&frame.description, |tile, runs| {
            let pixels = tile_slots(tile);
            let (words, trees) = runs.split_last_mut().expect("the run of the pixels");
            film.store(pixels.start as usize..pixels.end as usize, words);
            if let Some(filter) = filter {
                filter.store_trees(tile, &pixels, trees);
                filter.store_slots(tile, &pixels, words);
            }
        })?;
        match filter.as_ref().zip(unfinished(&frame.description, &frame.samples)) {
            Some((filter, next)) => {
                let epoch = filter.epoch(next);
                writer.end(epoch.len(), |piece, words| filter.store_epoch(&epoch[piece], words))
            }
            None => writer.end(0, |_, _| {}),
        }
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
    room: Vec<Group>,
}

/// Sections of some tiles that lie together: by run.
type Group = Vec<Vec<u8>>;

/// Tiles of which a thread makes the sections: a megabyte of sums, which stay in the cache while all trees are stored.
const GROUP: usize = 2;

/// Pieces of an epoch that are made at once: some tens of megabytes.
const PIECES: usize = 64;

impl Writer {
    /// Writes all that comes before the sums.
    pub fn begin(path: &Path, header: &Header) -> io::Result<Self> {
        let draft = Draft::create(path)?;
        let file = OpenOptions::new().write(true).open(draft.path())?;
        let mut writer = Self { draft, file, bytes: 0, room: Vec::new() };
        let mut first = MAGIC.to_vec();
        section::append_bytes(&mut first, &serde_json::to_vec(header).map_err(io::Error::other)?);
        writer.put(&first)?;
        Ok(writer)
    }

    /// Writes all batches of a frame's tiles: what `store` appends for a tile to the words of each run.
    pub fn batches(
        &mut self,
        description: &FrameDescription,
        store: impl Fn(usize, &mut [Vec<u64>]) + Sync,
    ) -> io::Result<()> {
        // A batch goes to the disk while the next one is made.
        let (mut next, mut done) = (std::mem::take(&mut self.room), Vec::new());
        for batch in batches(0..description.tile_count(), batch_length(description)) {
            let made = || encode(&mut next, runs(description), batch, &store);
            rayon::join(made, || self.put_batch(&done)).1?;
            std::mem::swap(&mut next, &mut done);
        }
        self.put_batch(&done)?;
        self.room = done;
        Ok(())
    }

    /// Writes one batch, likewise.
    pub fn batch(
        &mut self,
        tiles: Range<usize>,
        runs: usize,
        store: impl Fn(usize, &mut [Vec<u64>]) + Sync,
    ) -> io::Result<()> {
        let mut groups = std::mem::take(&mut self.room);
        encode(&mut groups, runs, tiles, store);
        self.put_batch(&groups)?;
        self.room = groups;
        Ok(())
    }

    /// Writes the last sections: of `pieces` pieces of an epoch what `store` appends.
    pub fn end(mut self, pieces: usize, store: impl Fn(usize, &mut Vec<u64>) + Sync) -> io::Result<Written> {
        let mut count = Vec::new();
        section::append_words(&mut count, &[pieces as u64]);
        self.put(&count)?;
        let mut groups = std::mem::take(&mut self.room);
        for batch in batches(0..pieces, PIECES) {
            encode(&mut groups, 1, batch, |piece, words| store(piece, &mut words[0]));
            groups.iter().flatten().try_for_each(|sections| self.put(sections))?;
        }
        Ok(Written { draft: self.draft, bytes: self.bytes })
    }

    /// Writes the lengths of the runs of a batch, and the runs.
    fn put_batch(&mut self, groups: &[Group]) -> io::Result<()> {
        let Some(runs) = groups.first().map(Vec::len) else { return Ok(()) };
        let length = |run: usize| groups.iter().map(|group| group[run].len() as u64).sum();
        let mut lengths = Vec::new();
        section::append_words(&mut lengths, &(0..runs).map(length).collect::<Vec<u64>>());
        self.put(&lengths)?;
        (0..runs).try_for_each(|run| groups.iter().try_for_each(|group| self.put(&group[run])))
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.bytes += bytes.len() as u64;
        self.file.write_all(bytes)
    }
}

/// Makes the sections of some tiles, run by run: what `store` appends to the words of each.
fn encode(groups: &mut Vec<Group>, runs: usize, tiles: Range<usize>, store: impl Fn(usize, &mut [Vec<u64>]) + Sync) {
    let of_groups: Vec<Range<usize>> = batches(tiles, GROUP).collect();
    groups.resize_with(of_groups.len(), Vec::new);
    let encode = |words: &mut Vec<Vec<u64>>, (group, tiles): (&mut Group, Range<usize>)| {
        words.resize_with(runs, Vec::new);
        group.resize_with(runs, Vec::new);
        group.iter_mut().for_each(Vec::clear);
        for tile in tiles {
            words.iter_mut().for_each(Vec::clear);
            store(tile, words);
            group.iter_mut().zip(words.iter()).for_each(|(bytes, words)| section::append_words(bytes, words));
        }
    };
    groups.par_iter_mut().zip(of_groups).for_each_init(Vec::new, encode);
}
