//! The levels of a mip-mapped image and how they are stored.

use glam::{IVec2, Vec2};
use rayon::prelude::*;

use super::encoding::{f32_to_half, half_to_f32};
use super::image::{TexelData, Texels};

/// Texels of all levels, one after the other.
#[derive(Clone, Debug)]
pub(super) enum Storage {
    U8(Vec<u8>, Box<[f32; 256]>),
    Half(Vec<u16>),
    Float(Vec<f32>),
}

/// One level within its storage.
#[derive(Clone, Copy, Debug)]
pub(super) struct Level {
    /// Index of its first texel.
    pub start: usize,
    /// Columns.
    pub width: i32,
    /// Rows.
    pub height: i32,
}

/// Makes all levels of an image, each the mean of what it covers of the one before, in linear light.
///
/// # Panics
/// The image has no texels, or more than 2³¹ in a direction.
pub(super) fn build(texels: Texels) -> (Vec<Level>, Storage) {
    let levels = levels(texels.width, texels.height);
    let channels = texels.channels;
    let total = levels.last().map_or(0, |level| level.start + 1) * channels;
    let mut storage = Storage::with_capacity(texels, total);
    let mut finer: Option<Vec<f32>> = None;
    for pair in levels.windows(2) {
        let coarser = match &finer {
            None => shrink(&pair[0], &pair[1], channels, |index| storage.value(index)),
            Some(values) => shrink(&pair[0], &pair[1], channels, |index| values[index]),
        };
        storage.append(&coarser);
        finer = Some(coarser);
    }
    (levels, storage)
}

impl Level {
    pub fn size(&self) -> Vec2 {
        Vec2::new(self.width as f32, self.height as f32)
    }

    pub fn index(&self, texel: IVec2) -> usize {
        self.start + texel.y as usize * self.width as usize + texel.x as usize
    }
}

fn levels(width: usize, height: usize) -> Vec<Level> {
    assert!(width > 0 && height > 0, "an image without texels");
    let edge = |n: usize| i32::try_from(n).expect("images are narrower than 2^31 texels");
    let mut levels = vec![Level { start: 0, width: edge(width), height: edge(height) }];
    while let Some(last) = levels.last().filter(|level| level.width > 1 || level.height > 1) {
        let start = last.start + last.width as usize * last.height as usize;
        let next = Level { start, width: (last.width / 2).max(1), height: (last.height / 2).max(1) };
        levels.push(next);
    }
    levels
}

/// The coarser level: means over the area that each of its texels covers, exact also for odd sizes.
fn shrink(from: &Level, to: &Level, channels: usize, value: impl Fn(usize) -> f32 + Sync) -> Vec<f32> {
    let columns: Vec<_> = (0..to.width).map(|x| cover(x, from.width, to.width)).collect();
    let row = to.width as usize * channels;
    let mut out = vec![0.0; row * to.height as usize];
    out.par_chunks_mut(row).zip(0..to.height).for_each(|(out, y)| {
        let rows = cover(y, from.height, to.height);
        for (texel, column) in out.chunks_mut(channels).zip(&columns) {
            for (channel, mean) in texel.iter_mut().enumerate() {
                for &(y, wy) in covered(&rows) {
                    for &(x, wx) in covered(column) {
                        *mean += wx * wy * value((y * from.width as usize + x) * channels + channel);
                    }
                }
            }
        }
    });
    out
}

/// Without the third, which only odd sizes have.
fn covered(texels: &[(usize, f32); 3]) -> &[(usize, f32)] {
    if texels[2].1 > 0.0 { texels } else { &texels[..2] }
}

/// Which of `from` texels the `index`th of `to` covers, with weights that sum to 1. At most three: `to` = ⌊`from` / 2⌋.
fn cover(index: i32, from: i32, to: i32) -> [(usize, f32); 3] {
    let (index, from, to) = (index as usize, from as usize, to as usize);
    // In units of 1/to of a texel the ends are integers.
    let (begin, end) = (index * from, (index + 1) * from);
    let first = begin / to;
    std::array::from_fn(|i| {
        let texel = (first + i).min(from - 1);
        let (low, high) = (begin.max((first + i) * to), end.min((first + i + 1) * to));
        (texel, high.saturating_sub(low) as f32 / from as f32)
    })
}

impl Storage {
    fn with_capacity(texels: Texels, total: usize) -> Self {
        match texels.data {
            TexelData::U8(mut bytes) => {
                bytes.reserve_exact(total - bytes.len());
                Self::U8(bytes, texels.encoding.table())
            }
            TexelData::Half(mut halves) => {
                halves.reserve_exact(total - halves.len());
                Self::Half(halves)
            }
            TexelData::Float(mut floats) => {
                floats.reserve_exact(total - floats.len());
                Self::Float(floats)
            }
        }
    }

    fn value(&self, index: usize) -> f32 {
        match self {
            Self::U8(bytes, table) => table[usize::from(bytes[index])],
            Self::Half(halves) => half_to_f32(halves[index]),
            Self::Float(floats) => floats[index],
        }
    }

    fn append(&mut self, values: &[f32]) {
        match self {
            Self::U8(bytes, table) => bytes.par_extend(values.par_iter().map(|&value| nearest_byte(table, value))),
            Self::Half(halves) => halves.extend(values.iter().map(|&value| f32_to_half(value))),
            Self::Float(floats) => floats.extend_from_slice(values),
        }
    }
}

/// The byte whose value in the ascending table is nearest in the encoded sense: the code that decodes next to `value`.
fn nearest_byte(table: &[f32; 256], value: f32) -> u8 {
    let above = table.partition_point(|&entry| entry < value).min(255);
    let below = above.saturating_sub(1);
    if value - table[below] < table[above] - value { below as u8 } else { above as u8 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::description::Encoding;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_nearest_byte_is_the_nearest(value in 0.0_f32..1.0) {
            let table = Encoding::Srgb.table();
            let found = table[usize::from(nearest_byte(&table, value))];
            prop_assert!(table.iter().all(|entry| (entry - value).abs() >= (found - value).abs()));
        }
    }
}
