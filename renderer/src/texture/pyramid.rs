//! An image with its coarser levels, and the filtered look-up in it.
//!
//! This is our own rather than OpenImageIO's texture system for two reasons.
//!
//! Correctness: texels are decoded before they are filtered. OpenImageIO filters what the file stores, which darkens
//! sRGB images, and would want a linear copy of each file.
//!
//! Speed: there is no cache to consult. Nanoseconds per look-up in 2048 × 2048 RGB bytes, from
//! `cargo run --release -p renderer --example textures` and `-p oiio --example lookups` on one and the same EPYC core,
//! the same on two at once; neighbouring texels one after the other, and anywhere, where memory dominates:
//!
//! | filter | ours, neighbours | ours, anywhere | OpenImageIO, neighbours | OpenImageIO, anywhere |
//! |---|---|---|---|---|
//! | nearest texel | 15 | 34 | 67–69 | 240–320 |
//! | bilinear | 27 | 40–146 | 97–101 | 280–430 |
//! | trilinear | 52 | 128–165 | 111–147 | 280–410 |
//! | along the footprint | 160–240 | 670 | 161–197 | 330–530 |
//!
//! Bytes stay bytes on all levels, with a table of their linear values, and halves stay halves: an image takes 4/3 of
//! the size it has when loaded.

use std::path::Path;

use glam::{IVec2, Vec2};

use super::encoding::half_to_f32;
use super::image::{Channels, Texels, load_texels};
use super::levels::{Level, Storage, build};
use crate::math::Rgb;
use crate::scene::description::{Encoding, TextureFilter, Wrap};

/// Largest ratio of the axes of the ellipse that [`TextureFilter::Ewa`] covers, pbrt's default.
const MAX_ANISOTROPY: f32 = 8.0;

/// A mip-mapped image. Level 0 is the image; each further one has half the width and height, down to one texel.
#[derive(Clone, Debug)]
pub struct Pyramid {
    texels: Storage,
    channels: usize,
    levels: Vec<Level>,
}

/// How far a look-up reaches: s and t change by `dx` from one pixel to the next in x, by `dy` in y.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Footprint {
    /// Per pixel in x.
    pub dx: Vec2,
    /// Per pixel in y.
    pub dy: Vec2,
}

impl Pyramid {
    /// Builds the levels, each the mean of what it covers of the one before, in linear light.
    ///
    /// # Panics
    /// The image has no texels, or more than 2³¹ in a direction.
    pub fn new(texels: Texels) -> Self {
        let channels = texels.channels;
        let (levels, texels) = build(texels);
        Self { texels, channels, levels }
    }

    /// Loads an image for look-ups. `encoding` as for [`load_texels`]: a normal map is [`Encoding::Linear`].
    ///
    /// # Errors
    /// The file cannot be read; the message names it.
    pub fn load(path: &Path, channels: Channels, encoding: Option<Encoding>) -> Result<Self, String> {
        load_texels(path, channels, encoding).map(Self::new)
    }

    /// Columns and rows of the image.
    pub fn size(&self) -> [usize; 2] {
        [self.levels[0].width as usize, self.levels[0].height as usize]
    }

    /// Bytes that the texels take.
    pub fn bytes(&self) -> usize {
        match &self.texels {
            Storage::U8(bytes, _) => bytes.len(),
            Storage::Half(halves) => 2 * halves.len(),
            Storage::Float(floats) => 4 * floats.len(),
        }
    }

    /// The value of all texels, if they are equal.
    pub fn constant(&self) -> Option<Rgb> {
        fn all<T: PartialEq>(items: &[T], channels: usize) -> bool {
            items.chunks_exact(channels).all(|texel| texel == &items[..channels])
        }
        let [width, height] = self.size();
        let image = ..width * height * self.channels;
        let constant = match &self.texels {
            Storage::U8(bytes, _) => all(&bytes[image], self.channels),
            Storage::Half(halves) => all(&halves[image], self.channels),
            Storage::Float(floats) => all(&floats[image], self.channels),
        };
        constant.then(|| self.texel(0))
    }

    /// The mean of the image, as far as the storage of the last level can tell.
    pub fn top(&self) -> Rgb {
        self.point(Vec2::splat(0.5), self.levels.len() - 1, Wrap::Clamp)
    }

    /// The filtered value around `st`: (0, 0) is the upper left corner of the image, (1, 1) the lower right one.
    ///
    /// The level is that of pbrt: its texels are as wide as twice the largest derivative. Of wraps all but `Black` show
    /// the coarsest level wherever they are asked.
    ///
    /// **Source**: \[Pharr23\] section 10.4.3.
    #[inline]
    pub fn filter(&self, st: Vec2, footprint: &Footprint, filter: TextureFilter, wrap: Wrap) -> Rgb {
        if filter == TextureFilter::Ewa {
            return self.ewa(st, footprint, wrap);
        }
        let extent = self.extent(2.0 * footprint.dx.abs().max(footprint.dy.abs()).max_element());
        let Some(level) = self.level(extent) else { return self.top() };
        match filter {
            TextureFilter::Point => self.point(st, level, wrap),
            TextureFilter::Trilinear if level > 0 => {
                let fraction = extent.log2() - level as f32;
                let (fine, coarse) = (self.bilinear_at(st, level, wrap), self.bilinear_at(st, level + 1, wrap));
                fine + (coarse - fine) * fraction.clamp(0.0, 1.0)
            }
            _ => self.bilinear_at(st, level, wrap),
        }
    }

    /// Bilinear at the finest level. As all look-ups here: t grows downwards, as rows do.
    #[inline]
    pub fn bilinear(&self, st: Vec2, wrap: Wrap) -> Rgb {
        self.bilinear_at(st, 0, wrap)
    }

    /// `width` in texels of the finest level.
    fn extent(&self, width: f32) -> f32 {
        width * self.levels[0].width.max(self.levels[0].height) as f32
    }

    /// ⌊log2 extent⌋, at least 0; `None` if the coarsest level is the one.
    #[inline]
    fn level(&self, extent: f32) -> Option<usize> {
        // The exponent of a float is the floor of its logarithm. Not a number counts as no footprint.
        let level = if extent >= 2.0 { (extent.to_bits() >> 23) as usize - 127 } else { 0 };
        (level + 1 < self.levels.len() || level == 0).then_some(level)
    }

    #[inline]
    fn point(&self, st: Vec2, level: usize, wrap: Wrap) -> Rgb {
        let level = &self.levels[level];
        let st = into_range(st, wrap) * level.size();
        let texel = wrap_texel(floor(st), level, wrap);
        texel.map_or(Rgb::ZERO, |index| self.texel(index))
    }

    #[inline]
    fn bilinear_at(&self, st: Vec2, level: usize, wrap: Wrap) -> Rgb {
        let level = &self.levels[level];
        let st = into_range(st, wrap) * level.size() - 0.5;
        let corner = floor(st);
        let fraction = st - corner.as_vec2();
        let rest = 1.0 - fraction;
        let weights = [rest.x * rest.y, fraction.x * rest.y, rest.x * fraction.y, fraction.x * fraction.y];
        if corner.x >= 0 && corner.y >= 0 && corner.x + 1 < level.width && corner.y + 1 < level.height {
            let first = level.index(corner);
            let below = first + level.width as usize;
            return self.weighted(&[first, first + 1, below, below + 1], &weights);
        }
        self.bilinear_across_edge(corner, weights, level, wrap)
    }

    #[cold]
    fn bilinear_across_edge(&self, corner: IVec2, mut weights: [f32; 4], level: &Level, wrap: Wrap) -> Rgb {
        let mut indices = [0; 4];
        for (i, step) in [IVec2::ZERO, IVec2::X, IVec2::Y, IVec2::ONE].into_iter().enumerate() {
            match wrap_texel(corner + step, level, wrap) {
                Some(index) => indices[i] = index,
                None => weights[i] = 0.0,
            }
        }
        self.weighted(&indices, &weights)
    }

    /// Elliptically weighted average over the texels within the footprint.
    ///
    /// **Source**: \[Heckbert89\]; \[Pharr23\] section 10.4.4.
    fn ewa(&self, st: Vec2, footprint: &Footprint, wrap: Wrap) -> Rgb {
        let (a, b) = (footprint.dx, footprint.dy);
        let (longer, mut shorter) = if a.length_squared() < b.length_squared() { (b, a) } else { (a, b) };
        let mut minor = shorter.length();
        let least = longer.length() / MAX_ANISOTROPY;
        if minor < least && minor > 0.0 {
            shorter *= least / minor;
            minor = least;
        }
        let extent = self.extent(minor);
        if minor.is_nan() || minor == 0.0 || !longer.is_finite() {
            return self.bilinear_at(st, 0, wrap);
        }
        let Some(level) = self.level(extent) else { return self.top() };
        let fraction = extent.max(1.0).log2() - level as f32;
        let fine = self.ellipse(st, longer, shorter, level, wrap);
        if level + 1 >= self.levels.len() {
            return fine;
        }
        let coarse = self.ellipse(st, longer, shorter, level + 1, wrap);
        fine + (coarse - fine) * fraction.clamp(0.0, 1.0)
    }

    fn ellipse(&self, st: Vec2, longer: Vec2, shorter: Vec2, level: usize, wrap: Wrap) -> Rgb {
        let level = &self.levels[level];
        let size = level.size();
        let centre = into_range(st, wrap) * size - 0.5;
        let (p, q) = (longer * size, shorter * size);
        // The implicit ellipse A s² + B s t + C t² < 1; 1 is added so that it never falls between the texels.
        let (a, b, c) = (p.y * p.y + q.y * q.y + 1.0, -2.0 * (p.x * p.y + q.x * q.y), p.x * p.x + q.x * q.x + 1.0);
        let scale = 1.0 / (a * c - b * b * 0.25);
        let (a, b, c) = (a * scale, b * scale, c * scale);
        let determinant = 4.0 * a * c - b * b;
        let reach = 2.0 / determinant * Vec2::new((determinant * c).sqrt(), (determinant * a).sqrt());
        // No part of the footprint counts beyond one period; this bounds the work for any input.
        let reach = reach.min(size * 0.5 + 1.0);
        let (low, high) = ((centre - reach).ceil().as_ivec2(), (centre + reach).floor().as_ivec2());
        let (mut sum, mut weights) = (Rgb::ZERO, 0.0);
        for y in low.y..=high.y {
            for x in low.x..=high.x {
                let d = Vec2::new(x as f32, y as f32) - centre;
                let r2 = a * d.x * d.x + b * d.x * d.y + c * d.y * d.y;
                if r2 < 1.0 {
                    let weight = (-2.0 * r2).exp() - (-2.0_f32).exp();
                    weights += weight;
                    if let Some(index) = wrap_texel(IVec2::new(x, y), level, wrap) {
                        sum += weight * self.texel(index);
                    }
                }
            }
        }
        if weights > 0.0 { sum / weights } else { self.bilinear_at(st, 0, wrap) }
    }

    #[inline]
    fn texel(&self, index: usize) -> Rgb {
        self.weighted(&[index], &[1.0])
    }

    /// Sum of texels by weight.
    #[inline]
    fn weighted<const N: usize>(&self, indices: &[usize; N], weights: &[f32; N]) -> Rgb {
        match &self.texels {
            Storage::U8(bytes, table) => sum(bytes, self.channels, indices, weights, |b| table[usize::from(b)]),
            Storage::Half(halves) => sum(halves, self.channels, indices, weights, half_to_f32),
            Storage::Float(floats) => sum(floats, self.channels, indices, weights, |f| f),
        }
    }
}

#[inline]
fn sum<T: Copy, const N: usize>(
    items: &[T],
    channels: usize,
    indices: &[usize; N],
    weights: &[f32; N],
    decode: impl Fn(T) -> f32,
) -> Rgb {
    let mut total = Rgb::ZERO;
    if channels == 1 {
        for i in 0..N {
            total.x += weights[i] * decode(items[indices[i]]);
        }
        return Rgb::splat(total.x);
    }
    for i in 0..N {
        let texel = &items[3 * indices[i]..][..3];
        total += weights[i] * Rgb::new(decode(texel[0]), decode(texel[1]), decode(texel[2]));
    }
    total
}

/// ⌊v⌋, saturating; not a number becomes 0. Faster than `Vec2::floor`, which without SSE4.1 is a call.
#[inline]
fn floor(v: Vec2) -> IVec2 {
    let truncated = v.as_ivec2();
    let above = truncated.as_vec2().cmpgt(v);
    truncated.saturating_sub(IVec2::new(i32::from(above.x), i32::from(above.y)))
}

/// Brings a coordinate near [0, 1], where it fits an integer on every level. Not a number becomes 0.
#[inline]
fn into_range(st: Vec2, wrap: Wrap) -> Vec2 {
    match wrap {
        Wrap::Repeat => {
            let fraction = st - floor(st).as_vec2();
            // What saturated has no fraction; neither have infinity and what is no number.
            let valid = fraction.cmpge(Vec2::ZERO) & fraction.cmple(Vec2::ONE);
            Vec2::select(valid, fraction, Vec2::ZERO)
        }
        // Beyond these limits nothing changes any more: black stays black, and the edge texel the edge texel.
        Wrap::Black | Wrap::Clamp => {
            Vec2::select(st.is_nan_mask(), Vec2::ZERO, st).clamp(Vec2::splat(-2.0), Vec2::splat(3.0))
        }
        Wrap::OctahedralSphere => Vec2::select(st.is_nan_mask(), Vec2::ZERO, st).clamp(Vec2::ZERO, Vec2::ONE),
    }
}

/// Index of the texel that stands for `texel`, which may lie beyond the edges; `None`: black.
fn wrap_texel(texel: IVec2, level: &Level, wrap: Wrap) -> Option<usize> {
    let size = IVec2::new(level.width, level.height);
    let inside = match wrap {
        _ if texel.cmpge(IVec2::ZERO).all() && texel.cmplt(size).all() => texel,
        Wrap::Repeat => texel.rem_euclid(size),
        Wrap::Clamp => texel.clamp(IVec2::ZERO, size - 1),
        Wrap::Black => return None,
        Wrap::OctahedralSphere => octahedral(texel, size),
    };
    Some(level.index(inside))
}

/// Across an edge of the equal-area octahedral square its other half follows, mirrored.
///
/// **Source**: \[Clarberg08\] section 4.
fn octahedral(texel: IVec2, size: IVec2) -> IVec2 {
    let mut p = texel;
    if p.x < 0 || p.x >= size.x {
        p = IVec2::new(if p.x < 0 { -1 - p.x } else { 2 * size.x - 1 - p.x }, size.y - 1 - p.y);
    }
    if p.y < 0 || p.y >= size.y {
        p = IVec2::new(size.x - 1 - p.x, if p.y < 0 { -1 - p.y } else { 2 * size.y - 1 - p.y });
    }
    // Further than one width away only on levels of a texel or two.
    p.clamp(IVec2::ZERO, size - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::image::TexelData;
    use proptest::prelude::*;

    const FILTERS: [TextureFilter; 4] =
        [TextureFilter::Point, TextureFilter::Bilinear, TextureFilter::Trilinear, TextureFilter::Ewa];
    const WRAPS: [Wrap; 4] = [Wrap::Repeat, Wrap::Black, Wrap::Clamp, Wrap::OctahedralSphere];

    fn texels(width: usize, height: usize, channels: usize, data: TexelData) -> Texels {
        let (space, flaws) = Default::default();
        Texels { width, height, channels, data, encoding: Encoding::Srgb, alpha: false, space, flaws }
    }

    fn floats(width: usize, height: usize, value: impl Fn(usize, usize) -> f32) -> Pyramid {
        let data = (0..width * height).map(|i| value(i % width, i / width)).collect();
        Pyramid::new(texels(width, height, 1, TexelData::Float(data)))
    }

    fn square(width: f32) -> Footprint {
        Footprint { dx: Vec2::new(width, 0.0), dy: Vec2::new(0.0, width) }
    }

    #[test]
    fn every_level_keeps_the_mean_also_for_odd_sizes() {
        for (width, height) in [(1, 1), (8, 8), (5, 3), (7, 1), (1, 9), (13, 6)] {
            let value = |x: usize, y: usize| ((x * 7 + y * 5) % 11) as f32;
            let pyramid = floats(width, height, value);
            let mean = (0..width * height).map(|i| value(i % width, i / width)).sum::<f32>() / (width * height) as f32;
            // Each level rounds a sum of at most nine terms.
            assert!((pyramid.top().x - mean).abs() < 1e-5 * mean.max(1.0), "{width} x {height}");
        }
    }

    #[test]
    fn bilinear_meets_texels_and_middles() {
        let pyramid = floats(4, 4, |x, y| x as f32 + 10.0 * y as f32);
        let at = |x: f32, y: f32| pyramid.bilinear(Vec2::new((x + 0.5) / 4.0, (y + 0.5) / 4.0), Wrap::Clamp).x;
        assert_eq!((at(0.0, 0.0), at(3.0, 2.0), at(1.5, 2.0), at(1.5, 0.5)), (0.0, 23.0, 21.5, 6.5));
        assert_eq!((at(-4.0, 0.0), at(9.0, 9.0)), (0.0, 33.0));
        let repeated = pyramid.bilinear(Vec2::new(1.0, 0.125), Wrap::Repeat).x;
        assert_eq!(repeated, 1.5, "between columns 3 and 0");
        let black = pyramid.bilinear(Vec2::new(1.0, 0.125), Wrap::Black).x;
        assert_eq!(black, 1.5, "between column 3 and black");
    }

    #[test]
    fn floors_are_floors() {
        for x in [0.0, -0.0, 0.5, -0.5, 1.0, -1.0, 7.999, -8.001, 1.0e9, -1.0e9, 1.0e-30, -1.0e-30] {
            assert_eq!(floor(Vec2::new(x, -x)).as_vec2(), Vec2::new(x, -x).floor(), "{x}");
        }
        assert_eq!(floor(Vec2::new(f32::NAN, f32::INFINITY)), IVec2::new(0, i32::MAX));
        assert_eq!(floor(Vec2::NEG_INFINITY), IVec2::MIN);
    }

    #[test]
    fn the_octahedral_wrap_crosses_to_the_mirrored_half() {
        let size = IVec2::splat(4);
        for (beyond, inside) in
            [((-1, 0), (0, 3)), ((4, 1), (3, 2)), ((1, -1), (2, 0)), ((2, 4), (1, 3)), ((-1, -1), (3, 3))]
        {
            assert_eq!(octahedral(beyond.into(), size), inside.into(), "{beyond:?}");
        }
    }

    #[test]
    fn levels_are_those_of_pbrt() {
        // Columns of level n are 2^n wide blocks with their own values.
        let pyramid = floats(64, 64, |x, y| ((x + y) % 2) as f32);
        for filter in FILTERS {
            // A footprint of more than a texel sees the mean of the checks, one of less than half does not.
            let value = pyramid.filter(Vec2::new(0.3, 0.7), &square(4.0 / 64.0), filter, Wrap::Repeat).x;
            assert!((value - 0.5).abs() < 1e-6, "{filter:?}");
            let sharp = pyramid.filter(Vec2::new(0.5 / 64.0, 0.5 / 64.0), &square(0.1 / 64.0), filter, Wrap::Repeat).x;
            assert!(sharp < 0.45, "{filter:?} {sharp}");
        }
        for (extent, level) in [(0.0, Some(0)), (1.99, Some(0)), (2.0, Some(1)), (7.9, Some(2)), (63.0, Some(5))] {
            assert_eq!(pyramid.level(extent), level);
        }
        assert_eq!((pyramid.level(64.0), pyramid.level(f32::INFINITY), pyramid.level(f32::NAN)), (None, None, Some(0)));
    }

    #[test]
    fn trilinear_is_continuous_between_levels() {
        let pyramid = floats(32, 32, |x, y| (x * y) as f32);
        let at =
            |width: f32| pyramid.filter(Vec2::new(0.4, 0.4), &square(width), TextureFilter::Trilinear, Wrap::Clamp).x;
        for border in [1.0_f32 / 32.0, 2.0 / 32.0, 4.0 / 32.0] {
            let (below, above) = (at(border * 0.9999), at(border * 1.0001));
            assert!((below - above).abs() < 1e-3 * above, "{border}: {below} {above}");
        }
    }

    #[test]
    fn ewa_blurs_along_the_longer_axis() {
        // Stripes: their mean along x, themselves along y.
        let pyramid = floats(64, 64, |x, _| (x % 2) as f32);
        let along = Footprint { dx: Vec2::new(6.0 / 64.0, 0.0), dy: Vec2::new(0.0, 1.0 / 64.0) };
        let across = Footprint { dx: Vec2::new(0.2 / 64.0, 0.0), dy: Vec2::new(0.0, 1.5 / 64.0) };
        let at = |footprint| pyramid.filter(Vec2::new(10.5 / 64.0, 0.5), footprint, TextureFilter::Ewa, Wrap::Repeat).x;
        assert!((at(&along) - 0.5).abs() < 0.05, "{}", at(&along));
        assert!(at(&across) < 0.3, "{}", at(&across));
    }

    #[test]
    fn bytes_and_halves_are_decoded_before_they_are_averaged() {
        let bytes = Pyramid::new(texels(2, 1, 3, TexelData::U8(vec![0, 128, 255, 255, 128, 255])));
        let middle = bytes.bilinear(Vec2::new(0.5, 0.5), Wrap::Clamp);
        assert!((middle - Rgb::new(0.5, 0.215_860_5, 1.0)).length() < 1e-6);
        // The coarsest level holds the byte next to 0.5 in light: 188.
        assert!((bytes.top() - Rgb::new(0.502_886_5, 0.215_860_5, 1.0)).length() < 1e-6);
        assert_eq!(bytes.bytes(), 9);
        let halves = Pyramid::new(texels(2, 1, 1, TexelData::Half(vec![0x3c00, 0x4400])));
        assert_eq!((halves.top().x, halves.bilinear(Vec2::new(0.25, 0.5), Wrap::Clamp).x), (2.5, 1.0));
    }

    proptest! {
        #[test]
        fn a_constant_image_stays_constant_and_nothing_is_out_of_range(
            s: f32, t: f32, a: f32, b: f32, c: f32, d: f32, width in 1_usize..9, height in 1_usize..9,
        ) {
            let pyramid = floats(width, height, |_, _| 0.75);
            prop_assert_eq!(pyramid.constant(), Some(Rgb::splat(0.75)));
            let footprint = Footprint { dx: Vec2::new(a, b), dy: Vec2::new(c, d) };
            for filter in FILTERS {
                for wrap in WRAPS {
                    let value = pyramid.filter(Vec2::new(s, t), &footprint, filter, wrap).x;
                    let expected = if wrap == Wrap::Black { 0.0..=0.750_01 } else { 0.749_99..=0.750_01 };
                    prop_assert!(expected.contains(&value), "{filter:?} {wrap:?} {value}");
                }
            }
        }

    }
}
