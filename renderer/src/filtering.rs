//! The filter at work on a frame: what it is told of the world, what it takes of the paths, what becomes of the film.
//!
//! The frame is filtered in blocks of samples, all pixels each. Records of a block are dropped once they have shared; cells
//! and what slots read stay until the end, when the film gets its filtered values.

mod blend;
mod settings;
mod tile;

use std::ops::Range;

use filter::talk::{self, Talk};
use filter::{Adaptive, Anchor, PathRecord};
use glam::Vec3;

pub use blend::Blend;
pub use settings::SettingError;
pub use tile::{Keep, Keeper, Nothing, Paths, Selection};

use crate::film::Film;
use crate::math::Rgb;
use crate::world::World;

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

/// What a filter did.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Report {
    /// [`Filtering::Talk`].
    Talk(talk::Report),
    /// [`Filtering::Adaptive`].
    Adaptive(filter::Report),
}

/// A frame's filter.
pub struct FrameFilter {
    sharing: Sharing,
    block: u64,
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
    /// A filter for `film`, which keeps split sums; `None` if there is to be none. `unit`: radiance of the order of the
    /// mean.
    ///
    /// # Errors
    /// A setting is out of its bounds.
    pub fn new(
        filtering: &Filtering,
        world: &World,
        film: &mut Film,
        unit: f32,
    ) -> Result<Option<Self>, talk::ParamsError> {
        let (low, high) = world.geometry.bounds();
        let anchor = Anchor { origin: world.camera.position().as_dvec3(), extent: f64::from(low.distance(high)) };
        let pixels = film.bounds().area();
        let block = block_spp(pixels);
        let sharing = match *filtering {
            Filtering::None => return Ok(None),
            Filtering::Talk(params, selection) => {
                let paths = usize::try_from(pixels * block).unwrap_or(usize::MAX);
                let talk = Talk::new(&talk::Params { unit, ..params }, &anchor, paths)?;
                Sharing::Talk(Box::new(talk), selection)
            }
            Filtering::Adaptive(params, blend) => {
                let params = filter::Params { unit, ..params };
                Sharing::Adaptive(Box::new(Adaptive::new(&params, &anchor, film.tiles().len())), blend)
            }
        };
        Ok(Some(Self { sharing, block }))
    }

    /// The vertex that paths are to be cut at.
    pub fn selection(&self) -> Selection {
        match self.sharing {
            Sharing::Talk(_, selection) => selection,
            Sharing::Adaptive(..) => Selection::Primary,
        }
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

    /// Gives the film its filtered values.
    pub fn finish(self, world: &World, film: &mut Film) -> Report {
        let expose = |radiance: Vec3| world.sensor.response * radiance;
        match self.sharing {
            Sharing::Talk(talk, _) => {
                let resolved = by_slot(film, talk.resolve());
                let value = |at| {
                    let sum = resolved[film.index(at)];
                    let prefix = film.split(at).map_or(glam::DVec3::ZERO, |split| split.prefix);
                    let sum = prefix + (sum.diffuse + sum.glossy).as_dvec3();
                    expose((sum / film.pixel(at).normalisation()).as_vec3())
                };
                let values: Vec<Rgb> = film.bounds().pixels().map(value).collect();
                film.set_filtered(&values);
                Report::Talk(talk.report())
            }
            Sharing::Adaptive(mut adaptive, blend) => {
                let resolved = by_slot(film, adaptive.resolve());
                let pixel = |at| blend::Pixel::new(film, at, &resolved[film.index(at)], expose);
                let bounds = film.bounds();
                let frame =
                    blend::Frame { width: bounds.width() as usize, pixels: bounds.pixels().map(pixel).collect() };
                film.set_filtered(&frame.blend(&blend));
                Report::Adaptive(adaptive.report())
            }
        }
    }
}

/// What each pixel of a film got, by its index.
fn by_slot<T: Clone + Default>(film: &Film, parts: Vec<Vec<(u32, T)>>) -> Vec<T> {
    let mut resolved = vec![T::default(); film.slots()];
    for (slot, value) in parts.into_iter().flatten() {
        resolved[slot as usize] = value;
    }
    resolved
}

/// Samples per pixel of a block in a frame of `pixels`.
fn block_spp(pixels: u64) -> u64 {
    let spp = (BLOCK_PATHS / pixels.max(1)).clamp(1, BLOCK_SPP);
    1 << spp.ilog2()
}
