//! The film: exact per-pixel sums of samples, and the image they make.
//!
//! A sample belongs to one pixel (filter importance sampling), and a pixel's samples are added in the order of their
//! numbers whichever thread renders it, so the sums depend on neither threads nor tiles nor the cut into passes.

pub mod exr;
mod image;
mod pixel;

pub use image::{Channel, Image};
pub use pixel::{Auxiliary, Pixel, Split};

use crate::math::Rgb;
use crate::world::Bounds;

/// Side of the square tiles that threads work on, in pixels: 256 pixels of a few paths each are some milliseconds of
/// work, far above the cost of handing out a tile and far below that of a frame.
pub const TILE: u32 = 16;

/// Auxiliary outputs, by the names a user gives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AovSet {
    /// `albedo.{R,G,B}`: hemispherical reflectance at the first hit.
    pub albedo: bool,
    /// `N.{X,Y,Z}`: shading normal at the first hit, world space.
    pub normal: bool,
    /// `Ng.{X,Y,Z}`: geometric normal at the first hit, world space.
    pub geometric_normal: bool,
    /// `P.{X,Y,Z}`: position of the first hit, world space.
    pub position: bool,
    /// `depth.Z`: distance of the first hit from the camera ray's origin.
    pub depth: bool,
    /// `variance.{R,G,B}`: variance of one sample.
    pub variance: bool,
    /// `sampleCount`.
    pub sample_count: bool,
}

impl AovSet {
    /// Every name that [`Self::insert`] knows.
    pub const NAMES: [&'static str; 7] = ["albedo", "N", "Ng", "P", "depth", "variance", "sampleCount"];

    /// All of them.
    pub fn all() -> Self {
        let mut set = Self::default();
        for name in Self::NAMES {
            set.insert(name);
        }
        set
    }

    /// Adds the output `name`; false if there is none of that name.
    pub fn insert(&mut self, name: &str) -> bool {
        let flag = match name {
            "albedo" => &mut self.albedo,
            "N" => &mut self.normal,
            "Ng" => &mut self.geometric_normal,
            "P" => &mut self.position,
            "depth" => &mut self.depth,
            "variance" => &mut self.variance,
            "sampleCount" => &mut self.sample_count,
            _ => return false,
        };
        *flag = true;
        true
    }

    /// Whether any output needs to know the first hit.
    pub fn first_hit(&self) -> bool {
        self.albedo || self.normal || self.geometric_normal || self.position || self.depth
    }
}

/// Sums of all samples of a frame.
#[derive(Clone, Debug)]
pub struct Film {
    resolution: [u32; 2],
    bounds: Bounds,
    aovs: AovSet,
    tiles: [u32; 2],
    /// Tile by tile, [`TILE`]² pixels each, so that a tile is one contiguous piece that one thread owns.
    pixels: Vec<Pixel>,
    /// In the same order; empty unless [`AovSet::first_hit`].
    auxiliary: Vec<Auxiliary>,
    /// In the same order; empty unless the frame is filtered.
    split: Vec<Split>,
    /// In the same order: what the filter makes of the pixels, film RGB. Empty until then.
    filtered: Vec<Rgb>,
}

/// One tile of a film, exclusively held by a thread.
pub struct Tile<'a> {
    /// The tile's pixels within the film's bounds, in the order of their sums below.
    origin: [u32; 2],
    bounds: Bounds,
    /// Index of the first pixel in its film.
    first: u32,
    pixels: &'a mut [Pixel],
    auxiliary: &'a mut [Auxiliary],
    split: &'a mut [Split],
}

/// A pixel of a tile.
pub struct TilePixel<'a> {
    /// Column and row in the frame.
    pub at: [u32; 2],
    /// Its number within the film.
    pub index: u32,
    /// Its sums.
    pub pixel: &'a mut Pixel,
    /// Its first-hit sums, if they are kept.
    pub auxiliary: Option<&'a mut Auxiliary>,
    /// Its sums for the filter, if they are kept.
    pub split: Option<&'a mut Split>,
}

impl Tile<'_> {
    /// Calls `visit` for each pixel of the tile that is within the film.
    pub fn for_each(&mut self, mut visit: impl FnMut(TilePixel<'_>)) {
        let mut auxiliary = self.auxiliary.iter_mut();
        let mut split = self.split.iter_mut();
        for (offset, pixel) in (0..).zip(self.pixels.iter_mut()) {
            let (auxiliary, split) = (auxiliary.next(), split.next());
            let at = [self.origin[0] + offset % TILE, self.origin[1] + offset / TILE];
            if at[0] < self.bounds.max[0] && at[1] < self.bounds.max[1] {
                visit(TilePixel { at, index: self.first + offset, pixel, auxiliary, split });
            }
        }
    }
}

impl Film {
    /// An empty film of `resolution` of which the pixels in `bounds` are rendered.
    pub fn new(resolution: [u32; 2], bounds: Bounds, aovs: AovSet) -> Self {
        let tiles = [bounds.width().div_ceil(TILE), bounds.height().div_ceil(TILE)];
        let count = tiles[0] as usize * tiles[1] as usize * (TILE * TILE) as usize;
        let auxiliary = if aovs.first_hit() { vec![Auxiliary::default(); count] } else { Vec::new() };
        let pixels = vec![Pixel::default(); count];
        Self { resolution, bounds, aovs, tiles, pixels, auxiliary, split: Vec::new(), filtered: Vec::new() }
    }

    /// From now on keeps the sums that a filter needs.
    pub fn keep_split(&mut self) {
        self.split = vec![Split::default(); self.pixels.len()];
    }

    /// Bytes that a film of this shape holds.
    pub fn memory(bounds: Bounds, aovs: AovSet) -> u64 {
        let pixels =
            u64::from(bounds.width().next_multiple_of(TILE)) * u64::from(bounds.height().next_multiple_of(TILE));
        let first_hit = if aovs.first_hit() { size_of::<Auxiliary>() } else { 0 };
        pixels * (size_of::<Pixel>() + first_hit) as u64
    }

    /// Bytes that it holds besides for a filter.
    pub fn filter_memory(bounds: Bounds) -> u64 {
        Self::memory(bounds, AovSet::default()) / size_of::<Pixel>() as u64
            * (size_of::<Split>() + size_of::<Rgb>()) as u64
    }

    /// Width and height of the whole frame.
    pub fn resolution(&self) -> [u32; 2] {
        self.resolution
    }

    /// The pixels that are rendered.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// The auxiliary outputs that are kept.
    pub fn aovs(&self) -> AovSet {
        self.aovs
    }

    /// All tiles, each independently mutable.
    pub fn tiles(&mut self) -> Vec<Tile<'_>> {
        let (bounds, across) = (self.bounds, self.tiles[0]);
        let mut auxiliary = self.auxiliary.chunks_mut((TILE * TILE) as usize);
        let mut split = self.split.chunks_mut((TILE * TILE) as usize);
        self.pixels
            .chunks_mut((TILE * TILE) as usize)
            .zip(0u32..)
            .map(|(pixels, index)| Tile {
                origin: [bounds.min[0] + index % across * TILE, bounds.min[1] + index / across * TILE],
                bounds,
                first: index * TILE * TILE,
                pixels,
                auxiliary: auxiliary.next().unwrap_or_default(),
                split: split.next().unwrap_or_default(),
            })
            .collect()
    }

    /// Sums of the pixel at `[x, y]`, which must lie in the bounds.
    pub fn pixel(&self, at: [u32; 2]) -> &Pixel {
        &self.pixels[self.index(at)]
    }

    /// First-hit sums of the pixel at `[x, y]`, if they are kept.
    pub fn auxiliary(&self, at: [u32; 2]) -> Option<&Auxiliary> {
        self.auxiliary.get(self.index(at))
    }

    /// The filter's sums of the pixel at `[x, y]`, if they are kept.
    pub fn split(&self, at: [u32; 2]) -> Option<&Split> {
        self.split.get(self.index(at))
    }

    /// Sets what the filter makes of all pixels, film RGB, row by row over the bounds.
    pub fn set_filtered(&mut self, values: &[Rgb]) {
        self.filtered = vec![Rgb::ZERO; self.pixels.len()];
        for (value, at) in values.iter().zip(self.bounds.pixels()) {
            let index = self.index(at);
            self.filtered[index] = *value;
        }
    }

    /// Value of the pixel at `[x, y]`, film RGB: filtered if the frame is.
    pub fn value(&self, at: [u32; 2]) -> glam::DVec3 {
        self.filtered.get(self.index(at)).map_or_else(|| self.pixel(at).mean(), |value| value.as_dvec3())
    }

    /// One past the largest index of a pixel.
    pub fn slots(&self) -> usize {
        self.pixels.len()
    }

    /// Index of the pixel at `[x, y]`, as [`TilePixel::index`].
    pub fn index(&self, [x, y]: [u32; 2]) -> usize {
        assert!((self.bounds.min[0]..self.bounds.max[0]).contains(&x), "column {x} is outside the film");
        assert!((self.bounds.min[1]..self.bounds.max[1]).contains(&y), "row {y} is outside the film");
        let (x, y) = (x - self.bounds.min[0], y - self.bounds.min[1]);
        let tile = (y / TILE * self.tiles[0] + x / TILE) as usize;
        tile * (TILE * TILE) as usize + (y % TILE * TILE + x % TILE) as usize
    }

    /// Mean radiance over all pixels, film RGB.
    pub fn mean(&self) -> Rgb {
        let sum: glam::DVec3 = self.bounds.pixels().map(|at| self.value(at)).sum();
        (sum / self.bounds.area().max(1) as f64).as_vec3()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_each_pixel_of_the_bounds_once() {
        let bounds = Bounds { min: [5, 3], max: [40, 21] };
        let mut film = Film::new([50, 30], bounds, AovSet::all());
        for mut tile in film.tiles() {
            tile.for_each(|TilePixel { at: [x, y], pixel, auxiliary, .. }| {
                pixel.add(Rgb::splat((100 * y + x) as f32), 1.0, 1.0);
                assert!(auxiliary.is_some());
            });
        }
        for y in 3..21 {
            for x in 5..40 {
                assert_eq!(film.pixel([x, y]).mean().x, f64::from(100 * y + x));
                assert_eq!(film.pixel([x, y]).count, 1);
            }
        }
    }

    #[test]
    fn every_aov_name_is_known_and_no_other() {
        assert!(AovSet::NAMES.iter().all(|name| AovSet::default().insert(name)));
        assert!(!AovSet::default().insert("Depth"));
    }
}
