//! Parts: frames in the making as files, to be added to others or gone on with. `docs/parts.md` has the format in full.
//!
//! | bytes | what |
//! |---|---|
//! | 8 | `TSRpart` and the version of this format |
//! | section | header: JSON, UTF-8 |
//! | a section a tile | words: the sums of the tile's pixels (`Film::store`), then those of the filter (`FrameFilter::store`) |
//! | section | words: what the filter shares within an epoch that is not over; none between epochs |
//!
//! A section is its length in bytes (u64), the CRC-32 of its bytes (u32), and the bytes. Numbers are little-endian, words
//! are u64. Everything that is added is an integer, so any order of additions gives the same bits, and what is written
//! depends on neither the machine nor the number of threads. Sections are read one by one: adding a part takes little
//! memory besides the sum.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DMat4, DVec3, Mat3};
use serde::{Deserialize, Serialize};

use crate::film::{AovSet, Film, exr};
use crate::filtering::{Filtering, Surroundings};
use crate::frame::{Accumulation, FrameDescription, Samples};
use crate::integrator::Counters;
use crate::world::Bounds;

/// The first bytes; the last is the version.
const MAGIC: [u8; 8] = *b"TSRpart\x01";

/// What keeps a part from being written, read or added.
#[derive(Debug, thiserror::Error)]
pub enum PartError {
    /// The system says why.
    #[error("cannot {what} {}: {why}", path.display())]
    File {
        /// What was tried.
        what: &'static str,
        /// The file.
        path: PathBuf,
        /// The reason.
        why: io::Error,
    },
    /// Something else.
    #[error("{} is not a part: it does not begin as one", .0.display())]
    Foreign(PathBuf),
    /// Of another format.
    #[error("{} is a part of version {version}, and this program reads {}; render it again with this one", path.display(), MAGIC[7])]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        version: u8,
    },
    /// Cut off.
    #[error("{} is not whole: it ends too early", .0.display())]
    Truncated(PathBuf),
    /// Bits were changed.
    #[error("{} is damaged: its checksums do not match", .0.display())]
    Damaged(PathBuf),
    /// Of another frame.
    #[error("{} belongs to another picture: its {what} is \"{theirs}\" instead of \"{ours}\"", path.display())]
    Mismatch {
        /// The file.
        path: PathBuf,
        /// What differs.
        what: &'static str,
        /// The value in the file.
        theirs: String,
        /// The value that was expected.
        ours: String,
    },
    /// Samples are there already.
    #[error("{} has samples {}:{} that another part has too", path.display(), samples.start, samples.end)]
    Overlap {
        /// The file.
        path: PathBuf,
        /// The samples.
        samples: std::ops::Range<u64>,
    },
    /// It ends where others cannot go on.
    #[error(
        "{} ends at sample {end}, within {epoch} that share with each other: finish it with --resume before it is added to \
         others", path.display()
    )]
    Unfinished {
        /// The file.
        path: PathBuf,
        /// Its last sample and one.
        end: u64,
        /// Length of an epoch.
        epoch: u64,
    },
    /// Its filter cannot be taken apart.
    #[error("a frame with the filter \"{0}\" cannot be stored in parts; use --filter adaptive or none")]
    Filter(&'static str),
}

/// What a part says of itself.
#[derive(Serialize, Deserialize)]
struct Header {
    version: String,
    number: i32,
    seed: u64,
    spp: u64,
    asked: [u64; 2],
    samples: Vec<[u64; 2]>,
    scene_hash: u64,
    resolution: [u32; 2],
    pixels: [[u32; 2]; 2],
    aovs: Vec<String>,
    light_groups: Vec<String>,
    names: [Vec<String>; 2],
    filter: String,
    settings: Vec<(String, String)>,
    origin: [f64; 3],
    extent: f64,
    unit: f32,
    response: [f32; 9],
    camera_from_world: [f64; 16],
    ndc_from_world: Option<[f64; 16]>,
    filename: Option<PathBuf>,
    counters: [u64; 5],
    filter_paths: [u64; 2],
}

impl Header {
    fn of(frame: &Accumulation) -> Self {
        let description = &frame.description;
        let FrameDescription { surroundings, bounds, .. } = description;
        let counters = &frame.counters;
        Self {
            version: env!("CARGO_PKG_VERSION").into(),
            number: description.number,
            seed: description.seed,
            spp: description.spp,
            asked: [description.asked.start, description.asked.end],
            samples: frame.samples.ranges().iter().map(|range| [range.start, range.end]).collect(),
            scene_hash: description.scene_hash,
            resolution: description.resolution,
            pixels: [bounds.min, bounds.max],
            aovs: description.aovs.iter().map(|aov| aov.name().into()).collect(),
            light_groups: texts(&description.light_groups),
            names: [0, 1].map(|named| texts(&description.names[named])),
            filter: description.filtering.name().into(),
            settings: description.filtering.settings().into_iter().map(|(key, value)| (key.into(), value)).collect(),
            origin: surroundings.anchor.origin.to_array(),
            extent: surroundings.anchor.extent,
            unit: surroundings.unit,
            response: surroundings.response.to_cols_array(),
            camera_from_world: description.camera_from_world.to_cols_array(),
            ndc_from_world: description.ndc_from_world.map(|matrix| matrix.to_cols_array()),
            filename: description.filename.clone(),
            counters: [
                counters.camera_rays,
                counters.closest_hit_rays,
                counters.shadow_rays,
                counters.scatterings,
                counters.rejected_samples,
            ],
            filter_paths: frame.filter.as_ref().map_or([0; 2], |filter| filter.paths()),
        }
    }

    /// The frame of the part; `None` if there is none like this.
    fn description(&self) -> Option<FrameDescription> {
        let [min, max] = self.pixels;
        let within = |axis: usize| min[axis] < max[axis] && max[axis] <= self.resolution[axis];
        let small = u64::from(self.resolution[0]).checked_mul(self.resolution[1].into())? <= i32::MAX as u64;
        let mut aovs = AovSet::default();
        let known = self.aovs.iter().all(|name| aovs.insert(name));
        let mut filtering = Filtering::named(&self.filter)?;
        for (key, value) in &self.settings {
            // What has no meaning with the other settings is refused, and is not needed.
            let _ = filtering.set(key, value);
        }
        let valid = filtering.validate().is_ok() && self.unit > 0.0 && self.unit.is_finite();
        (within(0) && within(1) && small && known && valid).then(|| FrameDescription {
            number: self.number,
            seed: self.seed,
            spp: self.spp,
            asked: self.asked[0]..self.asked[1],
            scene_hash: self.scene_hash,
            resolution: self.resolution,
            bounds: Bounds { min, max },
            aovs,
            light_groups: shared(&self.light_groups),
            names: [0, 1].map(|named| shared(&self.names[named])),
            filtering,
            surroundings: Surroundings {
                anchor: filter::Anchor { origin: DVec3::from_array(self.origin), extent: self.extent },
                unit: self.unit,
                response: Mat3::from_cols_array(&self.response),
            },
            camera_from_world: DMat4::from_cols_array(&self.camera_from_world),
            ndc_from_world: self.ndc_from_world.map(|matrix| DMat4::from_cols_array(&matrix)),
            filename: self.filename.clone(),
        })
    }

    fn samples(&self) -> Option<Samples> {
        let mut samples = Samples::default();
        let mut valid = true;
        for &[start, end] in &self.samples {
            valid &= start < end && samples.insert(start..end).is_ok();
        }
        valid.then_some(samples)
    }

    fn counters(&self) -> Counters {
        let [camera_rays, closest_hit_rays, shadow_rays, scatterings, rejected_samples] = self.counters;
        Counters { camera_rays, closest_hit_rays, shadow_rays, scatterings, rejected_samples }
    }
}

/// Whether frames of this filter can be stored.
///
/// # Errors
/// [`PartError::Filter`].
pub fn storable(filtering: &Filtering) -> Result<(), PartError> {
    match filtering {
        Filtering::None | Filtering::Adaptive(..) => Ok(()),
        Filtering::Talk(..) => Err(PartError::Filter(filtering.name())),
    }
}

/// Writes a frame in the making to `path`; its bytes. Like an image, it appears under its name when it is whole.
///
/// # Errors
/// The filter cannot be stored; the folder is absent or not writable, or the disk is full: then there is no new file, and an
/// old one is untouched.
pub fn write(frame: &mut Accumulation, path: &Path) -> Result<u64, PartError> {
    storable(&frame.description.filtering)?;
    let error = |why| PartError::File { what: "write", path: path.to_owned(), why };
    let part = exr::part_path(path).map_err(error)?;
    let written = File::create(&part)
        .and_then(|file| {
            let mut writer = BufWriter::with_capacity(1 << 20, file);
            let bytes = write_sections(frame, &mut writer)?;
            writer.flush()?;
            Ok(bytes)
        })
        .and_then(|bytes| exr::publish(&part, path).map(|()| bytes))
        .map_err(error);
    if written.is_err() {
        // The message that matters is the first one.
        let _ = std::fs::remove_file(&part);
    }
    written
}

fn write_sections(frame: &mut Accumulation, writer: &mut impl Write) -> io::Result<u64> {
    writer.write_all(&MAGIC)?;
    let header = serde_json::to_vec(&Header::of(frame)).map_err(io::Error::other)?;
    let mut bytes = MAGIC.len() as u64 + write_section(writer, &header)?;
    let (mut words, mut section) = (Vec::new(), Vec::new());
    let mut put = |words: &mut Vec<u64>, writer: &mut _| {
        section.clear();
        section.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        words.clear();
        write_section(writer, &section)
    };
    for tile in 0..frame.film.tile_count() {
        frame.film.store(Film::tile_slots(tile), &mut words);
        if let Some(filter) = &mut frame.filter {
            filter.store(tile, &mut words);
        }
        bytes += put(&mut words, writer)?;
    }
    if let Some(filter) = &frame.filter {
        let next = frame.samples.ranges().last().map_or(0, |range| range.end);
        filter.store_epoch(next, &mut words);
    }
    Ok(bytes + put(&mut words, writer)?)
}

fn texts(names: &[Arc<str>]) -> Vec<String> {
    names.iter().map(|name| name.to_string()).collect()
}

fn shared(names: &[String]) -> Vec<Arc<str>> {
    names.iter().map(|name| name.as_str().into()).collect()
}

fn write_section(writer: &mut impl Write, bytes: &[u8]) -> io::Result<u64> {
    writer.write_all(&(bytes.len() as u64).to_le_bytes())?;
    writer.write_all(&crc32fast::hash(bytes).to_le_bytes())?;
    writer.write_all(bytes)?;
    Ok(12 + bytes.len() as u64)
}

/// A part of which the header is read.
pub struct Part {
    /// The file.
    pub path: PathBuf,
    /// The frame it is of.
    pub description: FrameDescription,
    /// The samples it has.
    pub samples: Samples,
    counters: Counters,
    filter_paths: [u64; 2],
    reader: BufReader<File>,
    /// Bytes that are not read yet, so that no length asks for more memory than there are bytes.
    rest: u64,
}

impl Part {
    /// Opens a part and reads what it says of itself.
    ///
    /// # Errors
    /// The file cannot be read, or is no part of this version, or its header is damaged.
    pub fn open(path: &Path) -> Result<Self, PartError> {
        let error = |why| PartError::File { what: "read", path: path.to_owned(), why };
        let file = File::open(path).map_err(error)?;
        let mut rest = file.metadata().map_err(error)?.len();
        let mut reader = BufReader::with_capacity(1 << 20, file);
        let mut magic = [0; MAGIC.len()];
        match reader.read_exact(&mut magic) {
            Err(why) if why.kind() != io::ErrorKind::UnexpectedEof => return Err(error(why)),
            Err(_) => return Err(PartError::Foreign(path.to_owned())),
            Ok(()) if magic[..7] != MAGIC[..7] => return Err(PartError::Foreign(path.to_owned())),
            Ok(()) if magic[7] != MAGIC[7] => {
                return Err(PartError::Version { path: path.to_owned(), version: magic[7] });
            }
            Ok(()) => rest -= magic.len() as u64,
        }
        let header = read_section(&mut reader, &mut rest, path)?;
        let damaged = || PartError::Damaged(path.to_owned());
        let header: Header = serde_json::from_slice(&header).map_err(|_| damaged())?;
        let (description, samples) = header.description().zip(header.samples()).ok_or_else(damaged)?;
        let version = env!("CARGO_PKG_VERSION");
        if header.version != version {
            let (what, theirs, ours) = ("program version", header.version, version.to_owned());
            return Err(PartError::Mismatch { path: path.to_owned(), what, theirs, ours });
        }
        // Before anybody makes room for the frame: its pixels are all in the file.
        let FrameDescription { bounds, filtering, .. } = &description;
        if Film::stored_bytes(*bounds, &description.outputs(), *filtering != Filtering::None) > rest {
            return Err(PartError::Truncated(path.to_owned()));
        }
        let (counters, filter_paths) = (header.counters(), header.filter_paths);
        Ok(Self { path: path.to_owned(), description, samples, counters, filter_paths, reader, rest })
    }

    /// The part as a frame to go on with.
    ///
    /// # Errors
    /// [`PartError`]: it is not whole, or damaged.
    pub fn begin(self) -> Result<Accumulation, PartError> {
        let mut frame = Accumulation::new(self.description.clone());
        self.read_into(&mut frame, true)?;
        Ok(frame)
    }

    /// Adds the part's samples to a frame.
    ///
    /// # Errors
    /// The part is of another frame, has samples that the frame has already, or ends within an epoch: then nothing was added.
    /// It is not whole, or damaged: then some of it was.
    pub fn add_to(self, frame: &mut Accumulation) -> Result<(), PartError> {
        if let Some((what, ours, theirs)) = frame.description.difference(&self.description) {
            return Err(PartError::Mismatch { path: self.path, what, theirs, ours });
        }
        let mut samples = frame.samples.clone();
        for range in self.samples.ranges() {
            samples.insert(range.clone()).map_err(|samples| PartError::Overlap { path: self.path.clone(), samples })?;
        }
        let (epoch, spp) = (frame.description.filtering.epoch(), frame.description.spp);
        let whole = |sample: u64| sample % epoch == 0 || sample == spp;
        let cuts = self.samples.ranges().iter().flat_map(|range| [range.start, range.end]);
        if let Some(end) = cuts.into_iter().find(|sample| !whole(*sample)) {
            return Err(PartError::Unfinished { path: self.path, end, epoch });
        }
        self.read_into(frame, false)
    }

    fn read_into(mut self, frame: &mut Accumulation, epoch: bool) -> Result<(), PartError> {
        let damaged = || PartError::Damaged(self.path.clone());
        let mut read = || {
            let bytes = read_section(&mut self.reader, &mut self.rest, &self.path)?;
            if bytes.len() % 8 != 0 {
                return Err(damaged());
            }
            let word = |chunk: &[u8]| chunk.iter().rev().fold(0, |word, &byte| word << 8 | u64::from(byte));
            Ok(bytes.chunks_exact(8).map(word).collect::<Vec<u64>>())
        };
        for tile in 0..frame.film.tile_count() {
            let words = read()?;
            let mut cells = words.as_slice();
            frame.film.load(Film::tile_slots(tile), &mut cells).ok_or_else(damaged)?;
            match &mut frame.filter {
                Some(filter) => filter.load(tile, Film::tile_slots(tile), cells).map_err(|_| damaged())?,
                None if cells.is_empty() => {}
                None => return Err(damaged()),
            }
        }
        let words = read()?;
        if let Some(filter) = frame.filter.as_mut().filter(|_| epoch) {
            let next = self.samples.ranges().last().map_or(0, |range| range.end);
            filter.load_epoch(next, &words).map_err(|_| damaged())?;
        }
        if self.rest > 0 {
            return Err(damaged());
        }
        if let Some(filter) = &mut frame.filter {
            filter.add_paths(self.filter_paths);
        }
        for range in self.samples.ranges() {
            frame.samples.insert(range.clone()).map_err(|_| damaged())?;
        }
        frame.counters += self.counters;
        Ok(())
    }
}

/// Reads a section and checks it.
fn read_section(reader: &mut impl Read, rest: &mut u64, path: &Path) -> Result<Vec<u8>, PartError> {
    let failed = |why: io::Error| match why.kind() {
        io::ErrorKind::UnexpectedEof => PartError::Truncated(path.to_owned()),
        _ => PartError::File { what: "read", path: path.to_owned(), why },
    };
    let (mut length, mut crc) = ([0; 8], [0; 4]);
    reader.read_exact(&mut length).map_err(failed)?;
    reader.read_exact(&mut crc).map_err(failed)?;
    let length = u64::from_le_bytes(length);
    let after = rest.checked_sub(12).and_then(|rest| rest.checked_sub(length));
    *rest = after.ok_or_else(|| PartError::Truncated(path.to_owned()))?;
    let mut bytes = vec![0; length as usize];
    reader.read_exact(&mut bytes).map_err(failed)?;
    if crc32fast::hash(&bytes) != u32::from_le_bytes(crc) {
        return Err(PartError::Damaged(path.to_owned()));
    }
    Ok(bytes)
}
