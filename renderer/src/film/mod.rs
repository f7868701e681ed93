//! The film: exact per-pixel sums of samples, and the image they make.
//!
//! A sample belongs to one pixel (filter importance sampling), and sums have the same bits whatever the order of their terms,
//! so a film depends on neither threads nor tiles nor the cut into passes, and films of slices of a frame's samples add up
//! to that of all of them.

mod aov;
pub mod cryptomatte;
pub mod exr;
mod image;
mod matte;
mod pixel;
mod sum;

pub use aov::{Aov, AovSet, FilterMap, Layer, Outputs};
pub use image::{Channel, Image};
pub use matte::{Matte, Named};
pub use pixel::{Pixel, Seen, Taken, normalisation};
pub use sum::{MOST_TERMS, Sum};

use std::ops::Range;

use glam::DVec3;

use crate::math::Rgb;
use crate::world::Bounds;

/// Side of the square tiles that threads work on, in pixels: 256 pixels of a few paths each are some milliseconds of
/// work, far above the cost of handing out a tile and far below that of a frame.
pub const TILE: u32 = 16;

/// Sums of all samples of a frame.
#[derive(Clone, Debug)]
pub struct Film {
    resolution: [u32; 2],
    /// Column and row that are the frame's first.
    overscan: u32,
    bounds: Bounds,
    outputs: Outputs,
    tiles: [u32; 2],
    /// Tile by tile, [`TILE`]² pixels each, so that a tile is one contiguous piece that one thread owns.
    pixels: Vec<Pixel>,
    /// What is summed up besides.
    layers: Vec<Layer>,
    /// Sums of the layers of a tile's pixels, pixel by pixel in the same order. Empty while all of them are zero, as that of
    /// prefixes is where nothing that shines is seen straight on.
    sums: Vec<Vec<Sum<3>>>,
    /// What names are kept of.
    named: Vec<Named>,
    /// Names in a pixel, pixel by pixel in the same order.
    mattes: Vec<Matte>,
    /// In the same order: what the filter makes of the pixels, film RGB. Empty until then.
    filtered: Vec<Rgb>,
    /// In the same order: what the filter tells of the pixels, by [`FilterMap`]. Empty until it does.
    maps: [Vec<f32>; 2],
    /// In the same order: standard errors of the pixels. Empty until they are known.
    errors: Vec<Rgb>,
}

/// One tile of a film, exclusively held by a thread.
pub struct Tile<'a> {
    /// The tile's pixels within the film's bounds, in the order of their sums below.
    origin: [u32; 2],
    bounds: Bounds,
    /// Index of the first pixel in its film.
    first: u32,
    pixels: &'a mut [Pixel],
    layers: &'a [Layer],
    sums: &'a mut Vec<Sum<3>>,
    named: &'a [Named],
    mattes: &'a mut [Matte],
}

/// A pixel of a tile.
pub struct TilePixel<'a> {
    /// Column and row in the frame.
    pub at: [u32; 2],
    /// Its number within the film.
    pub index: u32,
    pixel: &'a mut Pixel,
    layers: &'a [Layer],
    /// Of its tile.
    sums: &'a mut Vec<Sum<3>>,
    /// Where in them its own begin.
    first_sum: usize,
    named: &'a [Named],
    mattes: &'a mut [Matte],
}

impl TilePixel<'_> {
    /// Adds a sample.
    #[inline]
    pub fn add(&mut self, taken: &Taken<'_>) {
        self.pixel.add(taken);
        for (at, layer) in (self.first_sum..).zip(self.layers) {
            if !layer.first_hit() || taken.alpha > 0.0 {
                let term = layer.term(taken);
                if term != [0.0; 3] {
                    present(self.sums, self.layers.len())[at].add(term);
                }
            }
        }
        if let Some(ids) = taken.seen.and_then(|seen| seen.aside.seen()) {
            for (named, matte) in self.named.iter().zip(self.mattes.iter_mut()) {
                matte.add(ids[*named as usize], pixel::quanta(taken.alpha * taken.weight));
            }
        }
    }
}

/// Pixels of a tile.
const TILE_PIXELS: usize = (TILE * TILE) as usize;

/// The sums of so many layers of a tile, which are made if they are not there.
#[inline]
fn present(sums: &mut Vec<Sum<3>>, layers: usize) -> &mut [Sum<3>] {
    if sums.is_empty() {
        *sums = vec![Sum::default(); TILE_PIXELS * layers];
    }
    sums
}

impl Tile<'_> {
    /// Calls `visit` for each pixel of the tile that is within the film.
    pub fn for_each(&mut self, mut visit: impl FnMut(TilePixel<'_>)) {
        self.numbers().for_each(|number| visit(self.pixel(number)));
    }

    /// The numbers of the tile's pixels that are within the film.
    pub fn numbers(&self) -> impl Iterator<Item = u32> + use<> {
        let (origin, end) = (self.origin, self.bounds.max);
        (0..self.pixels.len() as u32).filter(move |&number| {
            let [x, y] = place(origin, number);
            x < end[0] && y < end[1]
        })
    }

    /// Column and row in the frame of the pixel of this number.
    pub fn at(&self, number: u32) -> [u32; 2] {
        place(self.origin, number)
    }

    /// The pixel of this number.
    pub fn pixel(&mut self, number: u32) -> TilePixel<'_> {
        let (i, named) = (number as usize, self.named.len());
        TilePixel {
            at: place(self.origin, number),
            index: self.first + number,
            pixel: &mut self.pixels[i],
            layers: self.layers,
            sums: self.sums,
            first_sum: i * self.layers.len(),
            named: self.named,
            mattes: &mut self.mattes[i * named..][..named],
        }
    }
}

/// Column and row of a pixel by its number in the tile that begins at `origin`.
fn place(origin: [u32; 2], number: u32) -> [u32; 2] {
    [origin[0] + number % TILE, origin[1] + number / TILE]
}

impl Tile<'_> {
    /// Takes what [`Film::store`] appended for the tile's pixels off the front, and adds their samples. `None`, with some of
    /// them added, where no film has such words.
    pub fn load(&mut self, words: &mut &[u64]) -> Option<()> {
        let layers = self.layers.len();
        let mut mattes = self.mattes.chunks_exact_mut(self.named.len().max(1));
        for (index, pixel) in self.pixels.iter_mut().enumerate() {
            pixel.merge(&Pixel::load(words)?);
            for at in index * layers..(index + 1) * layers {
                let sum = Sum::load(words)?;
                if sum != Sum::default() {
                    present(self.sums, layers)[at].merge(&sum);
                }
            }
            for matte in mattes.next().unwrap_or_default() {
                matte.merge(&Matte::load(words)?);
            }
        }
        Some(())
    }
}

/// Number of tiles that cover these pixels, along both axes.
fn tiles(bounds: Bounds) -> [u32; 2] {
    [bounds.width().div_ceil(TILE), bounds.height().div_ceil(TILE)]
}

/// Indices of a tile's pixels.
pub fn tile_slots(tile: usize) -> Range<u32> {
    const PIXELS: u32 = TILE * TILE;
    tile as u32 * PIXELS..(tile as u32 + 1) * PIXELS
}

/// Number of tiles of a film of these pixels.
pub fn tile_count(bounds: Bounds) -> usize {
    tiles(bounds).map(|count| count as usize).iter().product()
}

/// Bytes of a matte of one name besides the matte itself, with what the allocator keeps of its own.
const MATTE_ENTRY: usize = 32;

impl Film {
    /// An empty film of `resolution` of which the pixels in `bounds` are rendered. A `filtered` one keeps what a filter
    /// needs.
    pub fn new(resolution: [u32; 2], bounds: Bounds, outputs: impl Into<Outputs>, filtered: bool) -> Self {
        let outputs = outputs.into();
        let (tiles, count) = (tiles(bounds), tile_count(bounds) * TILE_PIXELS);
        let layers = outputs.layers(filtered);
        let (pixels, sums) = (vec![Pixel::default(); count], vec![Vec::new(); tile_count(bounds)]);
        let named = outputs.mattes();
        let mattes = vec![Matte::default(); count * named.len()];
        let (filtered, maps, errors) = (Vec::new(), [Vec::new(), Vec::new()], Vec::new());
        let overscan = 0;
        Self {
            resolution,
            overscan,
            bounds,
            outputs,
            tiles,
            pixels,
            layers,
            sums,
            named,
            mattes,
            filtered,
            maps,
            errors,
        }
    }

    /// The same with room for so many pixels around the frame: columns and rows count from there.
    pub fn with_overscan(self, overscan: u32) -> Self {
        Self { overscan, ..self }
    }

    /// Bytes that a film of this shape holds if all of its layers are seen in all tiles.
    pub fn memory(bounds: Bounds, outputs: &Outputs, filtered: bool) -> u64 {
        let pixels =
            u64::from(bounds.width().next_multiple_of(TILE)) * u64::from(bounds.height().next_multiple_of(TILE));
        let result = if filtered { size_of::<Rgb>() } else { 0 };
        let result = result + outputs.mattes().len() * (size_of::<Matte>() + MATTE_ENTRY);
        pixels * (size_of::<Pixel>() + outputs.layers(filtered).len() * size_of::<Sum<3>>() + result) as u64
    }

    /// Bytes that it holds, filtered values included where there are layers for them.
    pub fn bytes(&self) -> u64 {
        let result = if self.layers.contains(&Layer::Prefix) { size_of::<Rgb>() } else { 0 };
        let of_pixel = size_of::<Pixel>() + result + self.named.len() * (size_of::<Matte>() + MATTE_ENTRY);
        let sums: usize = self.sums.iter().map(|sums| sums.capacity() * size_of::<Sum<3>>()).sum();
        (self.pixels.len() * of_pixel + sums) as u64
    }

    /// Width and height of the whole frame.
    pub fn resolution(&self) -> [u32; 2] {
        self.resolution
    }

    /// Column and row that are the frame's first.
    pub fn overscan(&self) -> u32 {
        self.overscan
    }

    /// The pixels that are rendered.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// What it shows besides radiance.
    pub fn outputs(&self) -> &Outputs {
        &self.outputs
    }

    /// Number of tiles.
    pub fn tile_count(&self) -> usize {
        tile_count(self.bounds)
    }

    /// All tiles, each independently mutable.
    pub fn tiles(&mut self) -> Vec<Tile<'_>> {
        let (bounds, across, layers) = (self.bounds, self.tiles[0], self.layers.as_slice());
        let named = self.named.as_slice();
        let mut mattes = self.mattes.chunks_mut(TILE_PIXELS * named.len().max(1));
        (self.pixels.chunks_mut(TILE_PIXELS).zip(&mut self.sums))
            .zip(0u32..)
            .map(|((pixels, sums), index)| Tile {
                origin: [bounds.min[0] + index % across * TILE, bounds.min[1] + index / across * TILE],
                bounds,
                first: index * TILE * TILE,
                pixels,
                layers,
                sums,
                named,
                mattes: mattes.next().unwrap_or_default(),
            })
            .collect()
    }

    /// Sums of the pixel at `[x, y]`, which must lie in the bounds.
    pub fn pixel(&self, at: [u32; 2]) -> &Pixel {
        &self.pixels[self.index(at)]
    }

    /// A layer's sum of the pixel at `[x, y]`, if it is kept.
    pub fn layer(&self, layer: Layer, at: [u32; 2]) -> Option<DVec3> {
        let which = self.layers.iter().position(|kept| *kept == layer)?;
        let (tile, pixel) = (self.index(at) / TILE_PIXELS, self.index(at) % TILE_PIXELS);
        let sum = self.sums[tile].get(pixel * self.layers.len() + which);
        Some(sum.map_or(DVec3::ZERO, |sum| DVec3::from_array(sum.value())))
    }

    /// Names in the pixel at `[x, y]`, if they are kept.
    pub fn matte(&self, named: Named, at: [u32; 2]) -> Option<&Matte> {
        let which = self.named.iter().position(|kept| *kept == named)?;
        Some(&self.mattes[self.index(at) * self.named.len() + which])
    }

    /// Whether samples' first hits are looked at.
    pub fn first_hit(&self) -> bool {
        self.layers.iter().any(|layer| layer.first_hit())
    }

    /// Whether paths are watched for more than their radiance and their first hits.
    pub fn aside(&self) -> bool {
        !self.named.is_empty() || self.layers.iter().any(|layer| layer.aside())
    }

    /// Sets what the filter makes of all pixels, film RGB, row by row over the bounds.
    pub fn set_filtered(&mut self, values: &[Rgb]) {
        self.filtered = vec![Rgb::ZERO; self.pixels.len()];
        for (value, at) in values.iter().zip(self.bounds.pixels()) {
            let index = self.index(at);
            self.filtered[index] = *value;
        }
    }

    /// Sets what the filter tells of pixels, by their indices.
    pub fn set_map(&mut self, map: FilterMap, values: Vec<f32>) {
        self.maps[map as usize] = values;
    }

    /// What the filter tells of the pixel at `[x, y]`, if it did.
    pub fn map(&self, map: FilterMap, at: [u32; 2]) -> Option<f32> {
        self.maps[map as usize].get(self.index(at)).copied()
    }

    /// Value of the pixel at `[x, y]`, film RGB: filtered if the frame is.
    pub fn value(&self, at: [u32; 2]) -> glam::DVec3 {
        self.filtered.get(self.index(at)).map_or_else(|| self.pixel(at).mean(), |value| value.as_dvec3())
    }

    /// Whether the film has filtered values.
    pub fn filtered(&self) -> bool {
        !self.filtered.is_empty()
    }

    /// Sets the standard errors of all pixels, film RGB, row by row over the bounds.
    pub fn set_errors(&mut self, errors: &[Rgb]) {
        self.errors = vec![Rgb::ZERO; self.pixels.len()];
        for (error, at) in errors.iter().zip(self.bounds.pixels()) {
            let index = self.index(at);
            self.errors[index] = *error;
        }
    }

    /// Standard error of the pixel at `[x, y]`, film RGB; 0 while it is not known.
    pub fn error(&self, at: [u32; 2]) -> Rgb {
        self.errors.get(self.index(at)).copied().unwrap_or(Rgb::ZERO)
    }

    /// Words that a film of this shape is stored as, without names.
    pub fn stored_words(bounds: Bounds, outputs: &Outputs, filtered: bool) -> u64 {
        let pixels =
            u64::from(bounds.width().next_multiple_of(TILE)) * u64::from(bounds.height().next_multiple_of(TILE));
        pixels * (Pixel::WORDS + outputs.layers(filtered).len() * Sum::<3>::WORDS + outputs.mattes().len()) as u64
    }

    /// Appends the words of the pixels `range`, by their indices, to be stored.
    pub fn store(&self, range: Range<usize>, words: &mut Vec<u64>) {
        let (layers, named) = (self.layers.len(), self.named.len());
        for index in range {
            self.pixels[index].store(words);
            match self.sums[index / TILE_PIXELS].get(index % TILE_PIXELS * layers..) {
                Some(sums) if !sums.is_empty() => sums[..layers].iter().for_each(|sum| sum.store(words)),
                _ => (0..layers).for_each(|_| Sum::<3>::default().store(words)),
            }
            self.mattes[index * named..(index + 1) * named].iter().for_each(|matte| matte.store(words));
        }
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
        tile * TILE_PIXELS + (y % TILE * TILE + x % TILE) as usize
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
    use crate::integrator::FirstHit;

    fn taken(index: u64, radiance: Rgb) -> Taken<'static> {
        const FIRST: FirstHit = FirstHit { depth: 2.0, ..FirstHit::NOTHING };
        Taken { index, radiance, alpha: 1.0, weight: 1.0, prefix: 0.5 * radiance, first: &FIRST, seen: None }
    }

    #[test]
    fn tiles_cover_each_pixel_of_the_bounds_once() {
        let bounds = Bounds { min: [5, 3], max: [40, 21] };
        let mut film = Film::new([50, 30], bounds, AovSet::all(), true);
        for mut tile in film.tiles() {
            tile.for_each(|mut pixel| {
                let [x, y] = pixel.at;
                pixel.add(&taken(0, Rgb::splat((100 * y + x) as f32)));
            });
        }
        for at in bounds.pixels() {
            let value = f64::from(100 * at[1] + at[0]);
            assert_eq!(film.pixel(at).mean().x, value);
            assert_eq!(film.pixel(at).count(), 1);
            assert_eq!(film.layer(Layer::Prefix, at).unwrap().x, 0.5 * value);
            assert_eq!(film.layer(Layer::Depth, at).unwrap().x, 2.0);
        }
    }

    #[test]
    fn layers_are_kept_where_they_are_seen() {
        let bounds = Bounds::full([64, 16]);
        let mut film = Film::new([64, 16], bounds, AovSet::default(), true);
        let empty = film.bytes();
        for mut tile in film.tiles() {
            tile.for_each(|mut pixel| {
                let lit = pixel.at == [20, 3];
                pixel.add(&Taken { prefix: if lit { Rgb::ONE } else { Rgb::ZERO }, ..taken(0, Rgb::ONE) });
            });
        }
        assert_eq!(film.bytes() - empty, (TILE_PIXELS * size_of::<Sum<3>>()) as u64);
        assert!(film.bytes() < Film::memory(bounds, film.outputs(), true));
        for at in bounds.pixels() {
            assert_eq!(film.layer(Layer::Prefix, at).unwrap().x, f64::from(u8::from(at == [20, 3])));
        }
        // What is stored does not tell, and loading it leaves out what is empty too.
        let (mut words, mut again) = (Vec::new(), Film::new([64, 16], bounds, AovSet::default(), true));
        film.store(0..film.slots(), &mut words);
        assert_eq!(words.len() as u64, Film::stored_words(bounds, film.outputs(), true));
        let mut rest = words.as_slice();
        again.tiles().iter_mut().for_each(|tile| tile.load(&mut rest).unwrap());
        assert!(rest.is_empty() && again.bytes() == film.bytes());
        assert_eq!(again.layer(Layer::Prefix, [20, 3]), Some(DVec3::ONE));
    }

    #[test]
    fn stored_films_add_up() {
        let bounds = Bounds::full([20, 3]);
        let film = |samples: std::ops::Range<u64>| {
            let mut film = Film::new([20, 3], bounds, AovSet::all(), true);
            for mut tile in film.tiles() {
                tile.for_each(|mut pixel| {
                    let brightness = pixel.at[0] as f32 * 0.1;
                    samples.clone().for_each(|k| pixel.add(&taken(k, Rgb::splat(brightness / (k + 1) as f32))));
                });
            }
            film
        };
        let words = |film: &Film| {
            let mut words = Vec::new();
            film.store(0..film.slots(), &mut words);
            words
        };
        let whole = words(&film(0..9));
        let load = |film: &mut Film, words: &[u64]| {
            let mut words = words;
            film.tiles().iter_mut().try_for_each(|tile| tile.load(&mut words))
        };
        let mut sum = film(4..9);
        load(&mut sum, &words(&film(0..4))).unwrap();
        assert!(words(&sum) == whole);
        assert_eq!(load(&mut film(0..1), &whole[1..]), None);
    }
}
