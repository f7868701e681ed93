//! The filter at work on a frame: what it is told of the world, what it takes of the paths, what becomes of the film.
//!
//! The frame is filtered in blocks of samples, all pixels each. Records of a block are dropped once their second vertices
//! have shared; cells and pairs of pixel and cell stay until the end, when the film gets its filtered values.

mod blend;
mod tile;

use std::ops::Range;

use filter::{Adaptive, Anchor, PathRecord, Resolved};
use glam::Vec3;

pub use blend::Blend;
pub use tile::{Keep, Keeper, Nothing, Paths};

use crate::film::Film;
use crate::math::Rgb;
use crate::world::World;

/// How a frame is filtered.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Filtering {
    /// Not at all.
    #[default]
    None,
    /// By cells as fine as the samples can tell apart.
    Adaptive(filter::Params, Blend),
}

/// A frame's filter.
pub struct FrameFilter {
    adaptive: Adaptive,
    blend: Blend,
    block: u64,
}

/// Paths of a block: enough that the cells of second vertices hold more than a handful of paths each, few enough that
/// the records, 100 bytes each, stay within some hundred megabytes. A power of two, as samples per pixel of a block are.
const BLOCK_PATHS: u64 = 1 << 20;

/// Most samples per pixel of a block, for small images.
const BLOCK_SPP: u64 = 64;

impl FrameFilter {
    /// A filter for `film`, which keeps split sums. `unit`: radiance of the order of the mean.
    pub fn new(params: &filter::Params, blend: &Blend, world: &World, film: &mut Film, unit: f32) -> Self {
        let (low, high) = world.geometry.bounds();
        let anchor = Anchor { origin: world.camera.position().as_dvec3(), extent: f64::from(low.distance(high)) };
        let params = filter::Params { unit, ..*params };
        let adaptive = Adaptive::new(&params, &anchor, film.tiles().len());
        Self { adaptive, blend: *blend, block: block_spp(film.bounds().area()) }
    }

    /// Cuts a range of samples into blocks. Borders are multiples of the block's length, so that ranges that begin and
    /// end at such have the blocks of the whole.
    pub fn blocks(&self, range: &Range<u64>) -> impl Iterator<Item = Range<u64>> + use<> {
        let (mut next, end, length) = (range.start, range.end, self.block);
        std::iter::from_fn(move || {
            let block = next..end.min((next / length).saturating_add(1).saturating_mul(length));
            next = block.end;
            (!block.is_empty()).then_some(block)
        })
    }

    /// Adds a block of paths, by tile.
    pub fn add(&mut self, records: &[Vec<PathRecord>]) {
        self.adaptive.add(records);
    }

    /// Gives the film its filtered values.
    pub fn finish(mut self, world: &World, film: &mut Film) -> filter::Report {
        let bounds = film.bounds();
        let mut resolved = vec![Resolved::default(); film.slots()];
        for (slot, value) in self.adaptive.resolve().into_iter().flatten() {
            resolved[slot as usize] = value;
        }
        let expose = |radiance: Vec3| world.sensor.response * radiance;
        let frame = blend::Frame {
            width: bounds.width() as usize,
            pixels: bounds.pixels().map(|at| blend::Pixel::new(film, at, &resolved[film.index(at)], expose)).collect(),
        };
        let values: Vec<Rgb> = frame.blend(&self.blend);
        film.set_filtered(&values);
        self.adaptive.report()
    }
}

/// Samples per pixel of a block in a frame of `pixels`.
fn block_spp(pixels: u64) -> u64 {
    let spp = (BLOCK_PATHS / pixels.max(1)).clamp(1, BLOCK_SPP);
    1 << spp.ilog2()
}
