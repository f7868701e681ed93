//! The filter at work on a frame: what it is told of the world, what it takes of the paths, what becomes of the film.
//!
//! The frame is filtered in blocks of samples, all pixels each. Records of a block are dropped once they have shared; cells
//! and what slots read stay until the end, when the film gets its filtered values.

mod blend;
mod explain;
mod settings;
mod tile;

use std::ops::Range;

use filter::talk::{self, Talk};
use filter::{Adaptive, Anchor, Branch, EpochPiece, PathRecord, Resolved, Slots, StoredError};
use glam::{Mat3, Vec3};
use rayon::prelude::*;

pub use blend::Blend;
pub use explain::Explanation;
pub use settings::SettingError;
pub use tile::{Keep, Keeper, Nothing, Paths, Selection, Watching};

use crate::film::{Aov, AovSet, Film, FilterMap, Image, Layer, TILE, tile_count, tile_slots};
use crate::math::Rgb;
use crate::world::Bounds;

/// How a frame is filtered.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Filtering {
    /// Not at all.
    #[default]
    None,
    /// As published, by cells of one size.
    Talk(talk::Params, Selection),
    /// By cells as fine as the samples can tell apart.
    Adaptive(filter::Params, Blend),
}

impl Filtering {
    /// With what depends on the frame's samples per pixel decided: leaves of [`AUTO`] and reads of 0, see
    /// [`filter::Params::for_samples`], and an epoch of 0, which becomes an eighth of them, a power of two and at least
    /// [`SHORTEST_EPOCH`]. Of a growing frame `spp` is the most that there may be, and these are for its first epoch, of
    /// [`FIRST_EPOCH`] samples.
    ///
    /// Ranges of whole epochs are filtered alike on one machine and on several, so the epoch is the trade between how much
    /// second vertices share and how many slices a frame can be cut into. Measured against one epoch over all samples, an
    /// eighth loses about a tenth of the gain at 16 samples and a fifth at 256.
    pub fn settled(mut self, spp: u64) -> Self {
        if let Self::Adaptive(params, _) = &mut self {
            let measured = filter::Params::for_samples(if params.growing { spp.min(FIRST_EPOCH) } else { spp });
            for (leaf, measured) in [(&mut params.leaf, measured.leaf), (&mut params.second_leaf, measured.second_leaf)]
            {
                *leaf = if *leaf == AUTO { measured } else { *leaf };
            }
            if params.reads == 0 {
                params.reads = measured.reads;
            }
            if params.epoch == 0 {
                params.epoch = if params.growing { FIRST_EPOCH } else { 1 << (spp / 8).max(SHORTEST_EPOCH).ilog2() };
            }
        }
        self
    }

    /// Settings of the adaptive filter, if it is the one.
    pub fn adaptive(&self, surroundings: &Surroundings) -> Option<filter::Params> {
        match self {
            Self::Adaptive(params, _) => Some(filter::Params { unit: surroundings.unit, ..*params }),
            Self::None | Self::Talk(..) => None,
        }
    }

    /// Whether averages move from frame to frame of a sequence, which then follow from each other.
    pub fn is_temporal(&self) -> bool {
        matches!(self, Self::Talk(talk::Params { temporal: Some(_), .. }, _))
    }

    /// The samples that share with a sample: a slice of a frame that has one of them has all.
    pub fn epoch(&self, sample: u64) -> Range<u64> {
        match self {
            Self::None => sample..sample.saturating_add(1),
            Self::Talk(..) => 0..u64::MAX,
            Self::Adaptive(params, _) => params.epoch(sample),
        }
    }

    /// Whether a sample shares with none before it.
    pub fn begins_epoch(&self, sample: u64) -> bool {
        self.epoch(sample).start == sample
    }

    /// Slices of a frame begin and end at multiples of so many samples.
    pub fn slice_unit(&self) -> u64 {
        match self {
            Self::Adaptive(params, _) if params.growing => u64::MAX,
            _ => self.epoch(0).end,
        }
    }
}

/// Width of leaves that [`Filtering::settled`] decides.
const AUTO: f32 = 0.0;

/// Shortest epoch that is chosen without being asked for, samples per pixel.
const SHORTEST_EPOCH: u64 = 4;

/// The first epoch where it is not known how many there will be, samples per pixel.
const FIRST_EPOCH: u64 = 16;

/// What a filter did.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Report {
    /// [`Filtering::Talk`].
    Talk(talk::Report),
    /// [`Filtering::Adaptive`].
    Adaptive(filter::Report),
}

/// What a filter must know of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surroundings {
    /// What cells are measured from.
    pub anchor: Anchor,
    /// Radiance of the order of the frame's mean; only its power of two counts.
    pub unit: f32,
    /// What turns scene RGB into film RGB.
    pub response: Mat3,
}

impl std::fmt::Display for Surroundings {
    /// What cells depend on, in words: of lengths and radiance the power of two counts.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Anchor { origin, extent } = self.anchor;
        let [x, y, z] = origin.to_array();
        // By their bits: a logarithm would take the number below a power of two for that power.
        let exponent = |length: f64| (length.to_bits() >> 52 & 0x7ff) as i32 - 1023;
        let (size, unit) = (exponent(extent), exponent(self.unit.into()));
        write!(f, "from {x} {y} {z}, of size 2^{size}, in units of 2^{unit}")
    }
}

/// A frame's filter.
pub struct FrameFilter {
    sharing: Sharing,
    /// Radiance that the cells' sums are too coarse for, see [`COARSE`].
    coarse: f32,
    blocks: Blocks,
    /// Memory of the records of the last block, by tile: asking the system for it again would cost as much as a tenth of
    /// the filter's work.
    room: Vec<Vec<PathRecord>>,
}

enum Sharing {
    Talk(Box<Talk>, Selection),
    Adaptive(Box<Adaptive>, Blend),
}

/// Paths of a block: enough that the cells of second vertices hold more than a handful of paths each, few enough that
/// the records, 100 bytes each, stay within some hundred megabytes. A power of two, as samples per pixel of a block are.
const BLOCK_PATHS: u64 = 1 << 20;

/// Most samples per pixel of a block, for small images.
const BLOCK_SPP: u64 = 64;

impl FrameFilter {
    /// A filter for `film`; `None` if there is to be none.
    ///
    /// # Errors
    /// A setting is out of its bounds.
    pub fn new(
        filtering: &Filtering,
        surroundings: &Surroundings,
        film: &Film,
    ) -> Result<Option<Self>, talk::ParamsError> {
        let (anchor, unit) = (&surroundings.anchor, surroundings.unit);
        let pixels = film.bounds().area();
        let block = block_spp(pixels);
        let sharing = match *filtering {
            Filtering::None => return Ok(None),
            Filtering::Talk(params, selection) => {
                let paths = usize::try_from(pixels * block).unwrap_or(usize::MAX);
                let talk = Talk::new(&talk::Params { unit, ..params }, anchor, paths)?;
                Sharing::Talk(Box::new(talk), selection)
            }
            Filtering::Adaptive(params, blend) => {
                let params = filter::Params { unit, ..params };
                Sharing::Adaptive(Box::new(Adaptive::new(&params, anchor, film.tile_count())), blend)
            }
        };
        let blocks = Blocks { length: block, filtering: *filtering };
        Ok(Some(Self { sharing, coarse: unit * COARSE, blocks, room: vec![Vec::new(); film.tile_count()] }))
    }

    /// Goes on from the cells of another frame's talk.
    pub fn follow(&mut self, earlier: Box<Talk>) {
        if let Sharing::Talk(talk, _) = &mut self.sharing {
            *talk = earlier;
        }
    }

    /// Room for the records of a block, by tile, to be given back with [`Self::set_room`].
    pub fn room(&mut self) -> Vec<Vec<PathRecord>> {
        std::mem::take(&mut self.room)
    }

    /// Takes records that were added, for their memory.
    pub fn set_room(&mut self, mut records: Vec<Vec<PathRecord>>) {
        records.iter_mut().for_each(Vec::clear);
        self.room = records;
    }

    /// What keeps the paths of some samples of every pixel, beside the records of those before, by tile.
    pub fn keepers(&self, records: Vec<Vec<PathRecord>>, samples: &Range<u64>) -> Vec<Paths> {
        let selection = match self.sharing {
            Sharing::Talk(_, selection) => selection,
            Sharing::Adaptive(..) => Selection::Primary,
        };
        let most = (TILE * TILE) as usize * (samples.end - samples.start) as usize;
        let keeper = |records: Vec<PathRecord>| Paths { records, selection, most };
        records.into_iter().map(keeper).collect()
    }

    /// The first of the blocks into which samples `rest` are cut.
    pub fn block(&self, rest: &Range<u64>) -> Range<u64> {
        self.blocks.first(rest)
    }

    /// Whether the film can be developed with only some samples of a block.
    pub fn divisible(&self) -> bool {
        matches!(self.sharing, Sharing::Adaptive(..))
    }

    /// Whether the frame may end anywhere, if nothing is added to it later: then no block needs to be whole.
    pub fn is_open(&self) -> bool {
        matches!(self.blocks.filtering, Filtering::Adaptive(params, _) if params.growing)
    }

    /// Adds the paths of a block, by tile.
    pub fn add(&mut self, block: &Range<u64>, records: &[Vec<PathRecord>]) {
        match &mut self.sharing {
            Sharing::Talk(talk, _) => talk.add(records),
            Sharing::Adaptive(adaptive, _) => {
                adaptive.begin_block(block.start);
                adaptive.add(records);
            }
        }
    }

    /// The same of the last block of a frame, whose records nobody needs any more.
    pub fn add_last(&mut self, block: &Range<u64>, records: Vec<Vec<PathRecord>>) {
        match &mut self.sharing {
            Sharing::Talk(..) => self.add(block, &records),
            Sharing::Adaptive(adaptive, _) => {
                adaptive.begin_block(block.start);
                adaptive.add_last(records, self.blocks.filtering.begins_epoch(block.end));
            }
        }
    }

    /// Number of trees of cells, which are stored one by one.
    pub fn stored_trees(&self) -> usize {
        match &self.sharing {
            Sharing::Adaptive(adaptive, _) => adaptive.stored_trees(),
            Sharing::Talk(..) => 0,
        }
    }

    /// Makes ready for [`Self::store_trees`].
    pub fn settle(&mut self) {
        if let Sharing::Adaptive(adaptive, _) = &mut self.sharing {
            adaptive.settle();
        }
    }

    /// Appends the share that a tile with these pixels has of each tree to the words of that tree.
    pub fn store_trees(&self, tile: usize, pixels: &Range<u32>, words: &mut [Vec<u64>]) {
        if let Sharing::Adaptive(adaptive, _) = &self.sharing {
            adaptive.store_trees(tile, pixels, words);
        }
    }

    /// Appends what the filter keeps of a tile's pixels besides.
    pub fn store_slots(&self, tile: usize, pixels: &Range<u32>, words: &mut Vec<u64>) {
        if let Sharing::Adaptive(adaptive, _) = &self.sharing {
            adaptive.store_slots(tile, pixels, words);
        }
    }

    /// Adds what [`Self::store_trees`] appended for a tree.
    ///
    /// # Errors
    /// There are no such sums.
    pub fn load_tree(
        &mut self,
        tree: usize,
        tile: usize,
        pixels: &Range<u32>,
        words: &[u64],
    ) -> Result<(), StoredError> {
        match &mut self.sharing {
            Sharing::Adaptive(adaptive, _) => adaptive.load_tree(tree, tile, pixels, words),
            Sharing::Talk(..) => Err(StoredError),
        }
    }

    /// Adds what [`Self::store_slots`] appended.
    ///
    /// # Errors
    /// As for [`Self::load_tree`].
    pub fn load_slots(&mut self, tile: usize, pixels: &Range<u32>, words: &[u64]) -> Result<(), StoredError> {
        match &mut self.sharing {
            Sharing::Adaptive(adaptive, _) => {
                adaptive.add_slots(tile, &Slots::read(pixels, words)?);
                Ok(())
            }
            Sharing::Talk(..) => Err(StoredError),
        }
    }

    /// What samples share with those to come, of which `next` is the first, in pieces that may be stored at once; nothing
    /// between epochs.
    pub fn epoch(&self, next: u64) -> Vec<EpochPiece> {
        match &self.sharing {
            Sharing::Adaptive(adaptive, _) if !self.blocks.filtering.begins_epoch(next) => adaptive.epoch(),
            _ => Vec::new(),
        }
    }

    /// Appends a piece of [`Self::epoch`].
    pub fn store_epoch(&self, piece: &EpochPiece, words: &mut Vec<u64>) {
        if let Sharing::Adaptive(adaptive, _) = &self.sharing {
            adaptive.store_epoch(piece, words);
        }
    }

    /// Makes ready for [`Self::load_epoch`], which then adds what is known of the epoch of `next`, the next sample.
    pub fn begin_stored_epoch(&mut self, next: u64) {
        if let Sharing::Adaptive(adaptive, _) = &mut self.sharing {
            adaptive.begin_stored_epoch(next);
        }
    }

    /// Adds what [`Self::store_epoch`] appended.
    ///
    /// # Errors
    /// As for [`Self::load_tree`].
    pub fn load_epoch(&mut self, words: &[u64]) -> Result<(), StoredError> {
        match &mut self.sharing {
            Sharing::Adaptive(adaptive, _) => adaptive.add_epoch(words),
            Sharing::Talk(..) => Err(StoredError),
        }
    }

    /// Paths so far, and those of them that no cell could take.
    pub fn paths(&self) -> [u64; 2] {
        match &self.sharing {
            Sharing::Adaptive(adaptive, _) => adaptive.paths(),
            Sharing::Talk(..) => [0; 2],
        }
    }

    /// Adds the counts of a filter whose sums were added.
    pub fn add_paths(&mut self, paths: [u64; 2]) {
        if let Sharing::Adaptive(adaptive, _) = &mut self.sharing {
            adaptive.add_paths(paths);
        }
    }

    /// Gives the film its filtered values, as of now.
    pub fn develop(&mut self, surroundings: &Surroundings, film: &mut Film) -> Report {
        match &mut self.sharing {
            Sharing::Talk(talk, _) => talk_into(film, talk, expose(surroundings)),
            Sharing::Adaptive(adaptive, blend) => {
                let resolved = adaptive.resolve();
                if film.outputs().aovs.contains(Aov::FilterCell) {
                    film.set_map(FilterMap::Cell, by_slot(film, 0, adaptive.cell_sides()));
                }
                blend_into(film, resolved, blend, self.coarse, expose(surroundings));
                Report::Adaptive(adaptive.report())
            }
        }
    }

    /// The same at the end, and the talk, whose cells the next frame of a sequence may go on from. The memory of the adaptive
    /// filter is given back before it is needed for the blend.
    pub fn finish(mut self, surroundings: &Surroundings, film: &mut Film) -> (Report, Option<Box<Talk>>) {
        self.room = Vec::new();
        match self.sharing {
            Sharing::Talk(talk, _) => (talk_into(film, &talk, expose(surroundings)), Some(talk)),
            Sharing::Adaptive(mut adaptive, blend) => {
                if film.outputs().aovs.contains(Aov::FilterCell) {
                    film.set_map(FilterMap::Cell, by_slot(film, 0, adaptive.cell_sides()));
                }
                let (resolved, report) = adaptive.finish();
                blend_into(film, resolved, &blend, self.coarse, expose(surroundings));
                (Report::Adaptive(report), None)
            }
        }
    }
}

/// A frame's filter that is resolved from stored sums, tree by tree, and then band by band.
pub struct Merging {
    sums: filter::Merging,
    blend: Blend,
    surroundings: Surroundings,
    bounds: Bounds,
    /// Of all bands so far.
    rows: Vec<Vec<blend::Pixel>>,
}

impl Merging {
    /// A filter of a frame of these pixels and outputs; `None` if it has no filter, or one that cannot be stored.
    pub fn new(filtering: &Filtering, surroundings: &Surroundings, bounds: Bounds, aovs: AovSet) -> Option<Self> {
        let Filtering::Adaptive(_, blend) = *filtering else { return None };
        let measured = aovs.contains(Aov::FilterCell);
        let sums = filter::Merging::new(&filtering.adaptive(surroundings)?, tile_count(bounds), TILE * TILE, measured);
        Some(Self { sums, blend, surroundings: *surroundings, bounds, rows: Vec::new() })
    }

    /// Adds the next tiles of a tree: trees in their order, all tiles of each.
    pub fn add(&mut self, branches: Vec<Branch>) {
        self.sums.add(branches);
    }

    /// Ends a tree.
    pub fn end_tree(&mut self) {
        self.sums.end_tree();
    }

    /// Takes the next band of the frame, once all trees were added: a film of some rows of tiles, and what the filter keeps
    /// of its pixels, by tile. The film gets its maps, but for what is only known of all pixels.
    pub fn band(&mut self, first_tile: usize, slots: &[Slots], film: &mut Film) {
        let tiles = first_tile..first_tile + slots.len();
        let base = tile_slots(first_tile).start;
        let aovs = film.outputs().aovs;
        if aovs.contains(Aov::FilterCell) {
            let sides = tiles.clone().map(|tile| self.sums.cell_sides(tile).unwrap_or_default());
            film.set_map(FilterMap::Cell, by_slot(film, base, sides.collect()));
        }
        if aovs.contains(Aov::FilterBlend) {
            film.set_map(FilterMap::Blend, vec![0.0; film.slots()]);
        }
        let of_tile = |(tile, slots): (usize, &Slots)| self.sums.resolve(tile, slots);
        let resolved: Vec<Vec<Resolved>> = tiles.into_par_iter().zip(slots).map(of_tile).collect();
        let resolved = resolved.concat();
        // Room for all, but not before the trees are done with theirs.
        self.rows.reserve_exact(self.bounds.height() as usize - self.rows.len());
        let expose = expose(&self.surroundings);
        self.rows.par_extend(
            (film.bounds().min[1]..film.bounds().max[1])
                .into_par_iter()
                .map(|y| blend_row(film, y, |at| &resolved[film.index(at)], expose)),
        );
    }

    /// Gives the image of all bands its filtered values. `paths` are as [`FrameFilter::paths`] counts them.
    pub fn finish(self, paths: [u64; 2], image: &mut Image) -> Report {
        let Self { sums, blend, surroundings, bounds, rows } = self;
        let report = Report::Adaptive(sums.report(paths));
        drop(sums);
        let frame = blend::Frame { width: bounds.width() as usize, rows };
        let (values, shares) = blended(frame, &blend, surroundings.unit * COARSE, expose(&surroundings));
        image.set_radiance(&values);
        image.set_channel(Aov::FilterBlend.name(), &shares);
        report
    }
}

/// Film RGB of scene RGB.
fn expose(surroundings: &Surroundings) -> impl Fn(Vec3) -> Vec3 + Copy + Send + Sync + use<> {
    let response = surroundings.response;
    move |radiance| response * radiance
}

/// All that is to be blended of row `y`, given what each pixel got.
fn blend_row<'r>(
    film: &Film,
    y: u32,
    resolved: impl Fn([u32; 2]) -> &'r Resolved,
    expose: impl Fn(Vec3) -> Vec3,
) -> Vec<blend::Pixel> {
    let columns = film.bounds().min[0]..film.bounds().max[0];
    columns.map(|x| blend::Pixel::new(film, [x, y], resolved([x, y]), &expose)).collect()
}

/// The values of the pixels, and the shares of their own, unfiltered ones.
fn blended(frame: blend::Frame, blend: &Blend, coarse: f32, expose: impl Fn(Vec3) -> Vec3) -> (Vec<Rgb>, Vec<f32>) {
    let (mut values, mut shares) = frame.blend(blend);
    let coarse = expose(Vec3::splat(coarse)).max_element();
    // At the other end, sums of what fits singly need not fit.
    let usable = |value: Rgb| value.is_finite() && value.max_element() >= coarse;
    (&mut values, &mut shares).into_par_iter().enumerate().for_each(|(at, (value, share))| {
        if !usable(*value) {
            (*value, *share) = (frame.at(at).own(), 1.0);
        }
    });
    (values, shares)
}

/// Gives the film what the talk's cells averaged.
fn talk_into(film: &mut Film, talk: &Talk, expose: impl Fn(Vec3) -> Vec3) -> Report {
    let resolved = by_slot(film, 0, talk.resolve());
    let value = |at| {
        let sum = resolved[film.index(at)];
        let prefix = film.layer(Layer::Prefix, at).unwrap_or_default();
        let sum = prefix + (sum.diffuse + sum.glossy).as_dvec3();
        expose((sum / film.pixel(at).normalisation()).as_vec3())
    };
    let values: Vec<Rgb> = film.bounds().pixels().map(value).collect();
    film.set_filtered(&values);
    Report::Talk(talk.report())
}

/// Gives the film its filtered values from what each slot got.
fn blend_into(
    film: &mut Film,
    resolved: Vec<Vec<(u32, Resolved)>>,
    blend: &Blend,
    coarse: f32,
    expose: impl Fn(Vec3) -> Vec3 + Copy + Send + Sync,
) {
    let Bounds { min, max } = film.bounds();
    let width = film.bounds().width() as usize;
    let across = width.div_ceil(TILE as usize);
    // By rows of tiles, and what a tile got is dropped when its pixels have it: so there are pieces of memory that those of
    // the filter leave room for.
    let mut tiles = resolved.into_iter();
    let bands: Vec<Vec<_>> =
        (min[1]..max[1]).step_by(TILE as usize).map(|_| tiles.by_ref().take(across).collect()).collect();
    let rows = bands.into_par_iter().enumerate().flat_map_iter(|(band, tiles)| {
        let base = (band * across) as u32 * TILE * TILE;
        let mut resolved = vec![Resolved::default(); across * (TILE * TILE) as usize];
        tiles.into_iter().flatten().for_each(|(slot, value)| resolved[(slot - base) as usize] = value);
        let top = min[1] + band as u32 * TILE;
        let row = |y| blend_row(film, y, |at| &resolved[film.index(at) - base as usize], expose);
        (top..max[1].min(top + TILE)).map(row).collect::<Vec<_>>()
    });
    let frame = blend::Frame { width, rows: rows.collect() };
    let (values, shares) = blended(frame, blend, coarse, expose);
    film.set_filtered(&values);
    if film.outputs().aovs.contains(Aov::FilterBlend) {
        let mut by_index = vec![0.0; film.slots()];
        film.bounds().pixels().zip(shares).for_each(|(at, share)| by_index[film.index(at)] = share);
        film.set_map(FilterMap::Blend, by_index);
    }
}

/// How samples are cut into blocks: they do not cross epochs, and within an epoch borders are multiples of a length, so
/// that ranges of whole epochs have the blocks of the whole.
#[derive(Clone, Copy, Debug)]
struct Blocks {
    length: u64,
    filtering: Filtering,
}

impl Blocks {
    fn first(self, rest: &Range<u64>) -> Range<u64> {
        let epoch = self.filtering.epoch(rest.start);
        let rest_of_length = self.length - (rest.start - epoch.start) % self.length;
        rest.start..rest.end.min(epoch.end).min(rest.start.saturating_add(rest_of_length))
    }
}

/// Cells hold multiples of 2⁻³⁰ of the frame's unit, so below 2⁻²⁰ of it values are off by 2⁻¹¹ and more, and at last read as
/// black: in the shade of a frame in which something is a million times as bright, pixels keep their own values.
const COARSE: f32 = 1.0 / (1 << 20) as f32;

/// What each pixel of a film got, by its index: of tiles whose slots are numbered from `base`.
fn by_slot<T: Clone + Default + Send>(film: &Film, base: u32, parts: Vec<Vec<(u32, T)>>) -> Vec<T> {
    let mut resolved = vec![T::default(); film.slots()];
    // A tile's pixels are numbered one after the other.
    let tiles = resolved.par_chunks_mut((TILE * TILE) as usize).zip(parts).enumerate();
    tiles.for_each(|(tile, (resolved, part))| {
        let first = base + tile_slots(tile).start;
        part.into_iter().for_each(|(slot, value)| resolved[(slot - first) as usize] = value);
    });
    resolved
}

/// Samples per pixel of a block in a frame of `pixels`.
fn block_spp(pixels: u64) -> u64 {
    let spp = (BLOCK_PATHS / pixels.max(1)).clamp(1, BLOCK_SPP);
    1 << spp.ilog2()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_told_apart_by_powers_of_two_and_the_camera() {
        let words = |x: f64, extent: f64, unit: f32| {
            let anchor = Anchor { origin: glam::DVec3::new(x, 0.0, 0.0), extent };
            Surroundings { anchor, unit, response: Mat3::IDENTITY }.to_string()
        };
        let one = words(1.0, 1024.0, 1024.0);
        assert_eq!(one, words(1.0, 2047.0, 2047.0));
        assert_ne!(one, words(1.0, 1024.0 - 1e-12, 1024.0));
        assert_ne!(one, words(1.0, 1024.0, 1024.0 - 1e-4));
        assert_ne!(one, words(1.0 + 1e-15, 1024.0, 1024.0));
    }

    #[test]
    fn an_epoch_is_an_eighth_of_the_samples_unless_told() {
        let epoch = |spp, told| {
            let params = filter::Params { epoch: told, ..filter::Params::default() };
            Filtering::Adaptive(params, Blend::default()).settled(spp).slice_unit()
        };
        for (spp, expected) in [(1, 4), (16, 4), (64, 8), (100, 8), (256, 32), (u64::MAX, 1 << 60)] {
            assert_eq!(epoch(spp, 0), expected, "{spp}");
        }
        assert_eq!(epoch(256, 12), 12);
    }

    #[test]
    fn leaves_are_measured_unless_told() {
        let leaves = |filtering: Filtering| match filtering.settled(4096) {
            Filtering::Adaptive(params, _) => [params.leaf, params.second_leaf],
            _ => unreachable!("the adaptive filter"),
        };
        let mut filtering = Filtering::named("adaptive").unwrap();
        assert_eq!(leaves(filtering), [1.0, 1.0]);
        filtering.set("leaf", "7").unwrap();
        assert_eq!(leaves(filtering), [7.0, 1.0]);
        assert_eq!(leaves(filtering.settled(4096)), [7.0, 1.0]);
    }

    #[test]
    fn where_samples_are_not_known_settings_are_those_of_the_first_epoch() {
        let settled = |spp: u64, settings: &[&str]| {
            let mut filtering = Filtering::named("adaptive").unwrap();
            settings.iter().for_each(|key| filtering.set(key, "on").unwrap());
            filtering.settled(spp)
        };
        let (known, growing) = (settled(16, &[]), settled(4096, &["growing"]));
        let different =
            known.settings().into_iter().zip(growing.settings()).filter(|(known, growing)| known != growing);
        assert_eq!(
            different.map(|(_, growing)| growing).collect::<Vec<_>>(),
            [("epoch", "16".to_owned()), ("growing", "on".to_owned())]
        );
        assert_eq!(growing, settled(100, &["growing"]));
        // Unless it is known that there are fewer.
        assert!(settled(2, &["growing"]).settings().contains(&("reads", "4".to_owned())));
    }

    #[test]
    fn blocks_of_an_epoch_are_those_of_any_range_of_epochs() {
        for (length, epoch, growing) in
            [(4, 16, false), (4, 6, false), (16, 4, false), (1, 1, false), (8, 0, false), (4, 6, true), (16, 3, true)]
        {
            let params = filter::Params { epoch, growing, ..filter::Params::default() };
            let filtering = Filtering::Adaptive(params, Blend::default());
            let blocks = |mut rest: Range<u64>| {
                std::iter::from_fn(move || {
                    let block = Blocks { length, filtering }.first(&rest);
                    rest.start = block.end;
                    (!block.is_empty()).then_some(block)
                })
            };
            let whole: Vec<_> = blocks(0..48).collect();
            assert!(whole.iter().all(|block| params.epoch(block.start) == params.epoch(block.end - 1)), "{whole:?}");
            assert_eq!(whole.iter().map(|block| block.end - block.start).sum::<u64>(), 48);
            for cut in (0..48).filter(|sample| filtering.begins_epoch(*sample)) {
                let parts: Vec<_> = blocks(0..cut).chain(blocks(cut..48)).collect();
                assert_eq!(parts, whole, "cut at {cut}");
            }
        }
    }
}
