//! Owen-scrambled Sobol' numbers as a pure function of seed, pixel, sample and dimension.

use std::array::from_fn;

use glam::Vec2;

use super::hash::{mix64, nested_hash};

/// The source of all the random numbers of a render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampler {
    key: u64,
}

impl Sampler {
    /// The numbers of a render with this seed. Different seeds give independent numbers.
    pub fn new(seed: u64) -> Self {
        Self { key: mix64(seed ^ GOLDEN) }
    }

    /// The numbers of one sample of one pixel, which is one path.
    ///
    /// Any `sample` is valid. Even and odd samples are two sequences with scrambles of their own, so that they are
    /// independent halves whose difference tells the error of their mean. Each aligned block of 2³³ samples is two stratified
    /// sets of its own.
    #[inline]
    pub fn pixel_sample(&self, pixel: [u32; 2], sample: u64) -> Numbers {
        let pixel_key = mix64(self.key ^ (u64::from(pixel[1]) << 32 | u64::from(pixel[0])));
        let (half, index) = (sample & 1, sample >> 1);
        let key = mix64(pixel_key ^ (index >> 32 << 1 | half));
        Numbers { key, reversed_index: (index as u32).reverse_bits() }
    }
}

/// The uniform numbers of one path: a pure function of the dimension asked for.
///
/// For one pixel, the first 2ᵏ even samples, and each further aligned 2ᵏ of them, and likewise the odd ones, are stratified in every elementary interval
/// of area 2⁻ᵏ of each pair. Different dimensions are independent, by an Owen-shuffled index and Owen-scrambled digits
/// of their own. A dimension is meant to be asked for one pair or one number.
///
/// **Source**: \[Burley20\] "Practical Hash-based Owen Scrambling", padding in section 5.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Numbers {
    key: u64,
    reversed_index: u32,
}

impl Numbers {
    /// One number in [0, 1): a multiple of 2⁻²⁴.
    #[inline]
    pub fn d1(&self, dimension: Dimension) -> f32 {
        unit(self.bits(dimension))
    }

    /// [`Self::d1`] with all its 32 bits, as an integer: for choosing among so many that 24 bits are too coarse.
    #[inline]
    pub fn bits(&self, dimension: Dimension) -> u32 {
        let seeds = self.seeds(dimension);
        let index = nested_hash(self.reversed_index, seeds as u32).reverse_bits();
        // The first Sobol' dimension is the index with reversed bits, so its scramble is the nested hash of the index.
        nested_hash(index, (seeds >> 32) as u32).reverse_bits()
    }

    /// A point in [0, 1)²: multiples of 2⁻²⁴. Its x is what [`Self::d1`] of the same dimension is.
    #[inline]
    pub fn d2(&self, dimension: Dimension) -> Vec2 {
        let seeds = self.seeds(dimension);
        let index = nested_hash(self.reversed_index, seeds as u32).reverse_bits();
        let x = nested_hash(index, (seeds >> 32) as u32);
        let y = nested_hash(second_sobol_reversed(index), third_seed(seeds));
        let both = (u64::from(x) << 32 | u64::from(y)).reverse_bits();
        Vec2::new(unit(both as u32), unit((both >> 32) as u32))
    }

    /// The numbers that every vertex needs, all at once: what [`Self::d1`] and [`Self::d2`] say of its dimensions.
    // Not inlined: the compiler takes each step for all lanes as vectors, but only as long as it sees no lane that nobody
    // looks at.
    #[inline(never)]
    pub fn vertex(&self, bounce: u32) -> VertexNumbers {
        let first = Dimension::at(bounce, Use::LightSelect).0;
        let seeds: [u64; LANES] = from_fn(|lane| self.seeds(Dimension(first.wrapping_add(lane as u32))));
        let index = seeds.map(|seeds| nested_hash(self.reversed_index, seeds as u32).reverse_bits());
        let x: [u32; LANES] = from_fn(|lane| nested_hash(index[lane], (seeds[lane] >> 32) as u32));
        let y: [u32; LANES] = from_fn(|lane| nested_hash(second_sobol_reversed(index[lane]), third_seed(seeds[lane])));
        let number = |digits: u32| unit(digits.reverse_bits());
        VertexNumbers { x: x.map(number), y: y.map(number) }
    }

    #[inline]
    fn seeds(&self, dimension: Dimension) -> u64 {
        // An odd multiple of the dimension keeps neighbours far apart: this is the generator SplitMix64.
        mix64(self.key.wrapping_add(u64::from(dimension.0).wrapping_mul(GOLDEN)))
    }
}

/// 2⁶⁴ / golden ratio, made odd.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// A third seed from the two of a dimension: the upper half of the product depends on all of their bits.
#[inline]
const fn third_seed(seeds: u64) -> u32 {
    (seeds.wrapping_mul(GOLDEN) >> 32) as u32
}

/// Uses that every vertex has: all before [`Use::Roulette`].
const LANES: usize = Use::Roulette as usize;

/// The numbers that every vertex of a path needs: see [`Use`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VertexNumbers {
    x: [f32; LANES],
    y: [f32; LANES],
}

impl VertexNumbers {
    /// [`Numbers::d1`] of a use, which is not the roulette.
    #[inline]
    pub fn d1(&self, what: Use) -> f32 {
        self.x[what as usize]
    }

    /// [`Numbers::d2`] of a use, which is not the roulette.
    #[inline]
    pub fn d2(&self, what: Use) -> Vec2 {
        Vec2::new(self.x[what as usize], self.y[what as usize])
    }
}

/// The second Sobol' dimension with reversed bits (bit j is the digit of 2^-(j+1)).
///
/// Its generator matrix is Pascal's triangle mod 2: digit j is the sum of the index bits k with C(k, j) odd, which by
/// Lucas' theorem are those whose k has all bits of j. Sums over supersets take one step per bit of k.
#[inline]
const fn second_sobol_reversed(index: u32) -> u32 {
    let mut v = index;
    v ^= (v >> 1) & 0x5555_5555;
    v ^= (v >> 2) & 0x3333_3333;
    v ^= (v >> 4) & 0x0f0f_0f0f;
    v ^= (v >> 8) & 0x00ff_00ff;
    v ^ (v >> 16)
}

/// The upper 24 bits as a fraction: exact in `f32`, at most 1 − 2⁻²⁴.
#[inline]
fn unit(bits: u32) -> f32 {
    const SCALE: f32 = 1.0 / (1 << 24) as f32;
    (bits >> 8) as f32 * SCALE
}

/// What a number is used for. Two uses never share a dimension.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Dimension(u32);

/// Uses of numbers at each vertex of a path. The first four are drawn together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Use {
    /// Which light (one number).
    LightSelect,
    /// Where on the light (a pair).
    Light,
    /// Which lobe of the BSDF (one number).
    Lobe,
    /// Which direction within the lobe (a pair).
    Bsdf,
    /// Whether the path goes on (one number).
    Roulette,
}

impl Dimension {
    /// Where on the film, within the pixel filter (a pair).
    pub const FILM: Self = Self(0);
    /// Where on the lens (a pair).
    pub const LENS: Self = Self(1);

    /// Dimensions kept for the camera and for each vertex; more than are used, so that a new use renumbers no old one.
    const STRIDE: u32 = 8;

    /// The dimension of a use at vertex `bounce` of the path, 0 being the first that the camera sees.
    #[inline]
    pub const fn at(bounce: u32, what: Use) -> Self {
        Self((bounce.wrapping_add(1)).wrapping_mul(Self::STRIDE).wrapping_add(what as u32))
    }
}

#[cfg(test)]
#[path = "sampler_tests.rs"]
mod tests;
