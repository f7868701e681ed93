//! Where a vertex falls: nested cubic cells, shifted differently in each of several trees.

use glam::{DVec3, Mat3, Vec3};

use crate::hash::mix64;

/// What all cells are measured from. Anchored to the camera, so that neither the scene's scale nor its distance from the
/// origin changes which vertices meet: positions are differenced in f64, sides are powers of two times the footprint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// The camera's place, world space.
    pub origin: DVec3,
    /// A length of the order of the scene, world units; only its power of two counts. The trees' shifts scale with it.
    pub extent: f64,
}

/// A cell: exact, so that two cells are never taken for one.
///
/// From the top: level (16 bits, biased), attributes (48), Morton code of the cell's three
/// coordinates in two's complement (63). Sorted, the
/// cells of a level come together, among them those of equal attributes, and among them siblings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CellKey(u128);

/// Bits of each coordinate of a cell.
const COORDINATE_BITS: u32 = 21;
/// A coordinate's bits.
const COORDINATE: u64 = (1 << COORDINATE_BITS) - 1;
/// Bits of the level in a key.
const LEVEL_BITS: u32 = 16;
const LEVEL_BIAS: i32 = 1 << 14;

impl CellKey {
    /// A cell of a level, by its coordinates in ±2²⁰.
    #[cfg(test)]
    pub fn new(level: i32, attributes: u64, cell: [i32; 3]) -> Self {
        let [x, y, z] = cell.map(|x| spread(x as u64));
        let level = (level + LEVEL_BIAS) as u16;
        Self(u128::from(level) << 112 | u128::from(attributes & ATTRIBUTES) << 64 | u128::from(x | y << 1 | z << 2))
    }

    /// log₂ of the cell's side, in units of its tree.
    #[inline]
    pub fn level(self) -> i32 {
        (self.0 >> 112) as i32 - LEVEL_BIAS
    }

    /// The cell of twice the side that holds this one. The order of cells is kept, so siblings are neighbours.
    #[inline]
    pub fn parent(self) -> Self {
        let morton = self.0 as u64;
        // An arithmetic shift of each coordinate: the three signs stay on top.
        let halved = morton >> 3 | morton & SIGNS;
        Self(((self.0 >> 64 << 64) + (1 << 112)) | u128::from(halved))
    }

    /// The cell of `level` that holds this one, which is no coarser.
    #[inline]
    pub fn ancestor(self, level: i32) -> Self {
        let up = (level - self.level()) as u32;
        let morton = self.0 as u64;
        // As in `parent`, all at once: what comes in from above is the signs, over and over.
        let gone = 3 * up.min(COORDINATE_BITS);
        let signs = (morton >> (3 * (COORDINATE_BITS - 1))) * EVERY_THIRD;
        let shifted = morton >> gone | signs & !(MORTON >> gone) & MORTON;
        Self(((self.0 >> 64 << 64) + (u128::from(up) << 112)) | u128::from(shifted))
    }

    /// Well mixed bits.
    #[inline]
    pub fn hash(self) -> u64 {
        mix64(self.0 as u64 ^ mix64((self.0 >> 64) as u64))
    }

    /// From [`Self::bits`]; `None` where no cell has these: levels are exponents of f64.
    pub fn from_bits(bits: u128) -> Option<Self> {
        let key = Self(bits);
        let level = key.level().abs() < LEAF_LEVEL_BIAS;
        let attributes = key.upper() << LEVEL_BITS >> LEVEL_BITS <= LEAF_ATTRIBUTES;
        (level && attributes && key.lower() <= MORTON).then_some(key)
    }

    /// Level and attributes.
    #[inline]
    pub fn upper(self) -> u64 {
        (self.0 >> 64) as u64
    }

    /// The code of the coordinates.
    #[inline]
    pub fn lower(self) -> u64 {
        self.0 as u64
    }

    /// All bits.
    pub fn bits(self) -> u128 {
        self.0
    }
}

/// The signs of the three coordinates in a Morton code.
const SIGNS: u64 = 7 << (3 * (COORDINATE_BITS - 1));

/// All bits of a Morton code.
const MORTON: u64 = (1 << (3 * COORDINATE_BITS)) - 1;

/// One bit of three in a Morton code, that of the first coordinate.
const EVERY_THIRD: u64 = MORTON / 7;

/// Attributes that fit in a key.
#[cfg(test)]
const ATTRIBUTES: u64 = (1 << 48) - 1;

/// Puts two zeros between the lower 21 bits of a number.
#[inline]
fn spread(x: u64) -> u64 {
    let mut x = x & COORDINATE;
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

/// Undoes [`spread`], whatever is in the bits between.
#[inline]
fn gather(x: u64) -> u64 {
    let mut x = x & 0x1249_2492_4924_9249;
    x = (x | x >> 2) & 0x10c3_0c30_c30c_30c3;
    x = (x | x >> 4) & 0x100f_00f0_0f00_f00f;
    x = (x | x >> 8) & 0x001f_0000_ff00_00ff;
    x = (x | x >> 16) & 0x001f_0000_0000_ffff;
    (x | x >> 32) & COORDINATE
}

/// One tree of nested cells.
///
/// Trees differ in where their cells' borders lie at every level, and in the sides of their cells by less than two, so
/// that the mean over trees shows no borders. Sides are `scale` × 2^level.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    /// World position of the corner of all cells.
    corner: DVec3,
    inverse_scale: f64,
    /// Finest level of which the scene is no more than 2²⁰ cells wide, so that all of it has cells.
    finest: i32,
    /// Turns normals before they are told apart.
    turn: Mat3,
}

impl Grid {
    /// Tree `index` of `count`.
    pub fn new(anchor: &Anchor, index: u32, count: u32) -> Self {
        // Above the largest cells, so that every level's borders are shifted at random; a power of two, so that a scene
        // scaled by one keeps its cells.
        let reach = 2f64.powi(exponent_of(anchor.extent) - 2);
        // From 1 on, for 0 is mixed to 0: a border through the camera, on which walls like to lie.
        let random = |axis: u64| (mix64((u64::from(index) << 2 | axis) + 1) >> 11) as f64 / (1u64 << 53) as f64;
        let shift = DVec3::new(random(0), random(1), random(2)) * reach;
        let scale = 2f64.powf(f64::from(index) / f64::from(count));
        let finest = exponent_of(anchor.extent) + 3 - COORDINATE_BITS as i32;
        // The borders between normals lie elsewhere in each tree too, so that round things show no seams. Turned by at
        // most 24°, the axes of the world stay far from all of them.
        let axes = [Vec3::ONE, Vec3::new(1.0, -1.0, -1.0), Vec3::new(-1.0, 1.0, -1.0), Vec3::new(-1.0, -1.0, 1.0)];
        let angle = 24f64 * f64::from(index + 1) / f64::from(count);
        let turn = Mat3::from_axis_angle(axes[index as usize % 4].normalize(), angle.to_radians() as f32);
        Self { corner: anchor.origin - shift, inverse_scale: scale.recip(), finest, turn }
    }

    /// Finest level of cells, in this tree and all others of the anchor.
    pub fn finest(&self) -> i32 {
        self.finest
    }

    /// The finest cells of places, which know [`Self::finest`]; none for those outside the extent.
    pub fn leaves(&self, places: &Places, leaves: &mut Vec<LeafCell>) {
        // Loops without branches over arrays: the compiler makes vector instructions of them.
        let length = places.upper.len();
        let mut cells = [NO_CELL; Places::MOST];
        let [x, y, z] = places.p.each_ref().map(|x| &x[..length]);
        let [corner_x, corner_y, corner_z] = self.corner.to_array();
        for ((cell, scale), ((x, y), z)) in cells.iter_mut().zip(&places.inverse_side).zip(x.iter().zip(y).zip(z)) {
            let scale = self.inverse_scale * scale;
            let [x, y, z] = [(x - corner_x) * scale, (y - corner_y) * scale, (z - corner_z) * scale];
            // ±2²⁰ cells: further away than any footprint is small. The borders are whole, so this holds for the floor too.
            let inside = |x: f64| (-HALF..HALF).contains(&x);
            let within = inside(x) & inside(y) & inside(z);
            let found = floor(x) | floor(y) << COORDINATE_BITS | floor(z) << (2 * COORDINATE_BITS);
            *cell = if within { found } else { NO_CELL };
        }
        let mut facings = [0; Places::MOST];
        let [x, y, z] = places.n.each_ref().map(|x| &x[..length]);
        for (out, ((x, y), z)) in facings.iter_mut().zip(x.iter().zip(y).zip(z)) {
            *out = facing(self.turn * Vec3::new(*x, *y, *z));
        }
        leaves.clear();
        leaves.extend(
            (places.upper.iter().zip(&facings).zip(&cells))
                .map(|((upper, facing), cell)| LeafCell { upper: upper | u64::from(*facing), cell: *cell }),
        );
    }
}

/// A coordinate of cells is in ± this.
const HALF: f64 = (1u32 << (COORDINATE_BITS - 1)) as f64;

/// Bits of an attribute that say which way a surface faces.
const FACING_BITS: u32 = 3;

/// The bits of ⌊x⌋ that a coordinate has, for x in ±2²⁰.
#[inline]
fn floor(x: f64) -> u64 {
    // So large that the units of its sum with x are the lowest bits: there are no vector instructions for a conversion.
    const LARGE: f64 = 1.5 * (1u64 << 52) as f64;
    let sum = x + LARGE;
    let rounded_up = sum - LARGE > x;
    sum.to_bits().wrapping_sub(u64::from(rounded_up)) & COORDINATE
}

/// A cell by its coordinates: quicker to make than a [`CellKey`], and as exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeafCell {
    /// Level, biased, and below it attributes: [`Self::UPPER_BITS`], as many as those of vertices need.
    upper: u64,
    /// Coordinates, one after the other.
    cell: u64,
}

/// Attributes of vertices: a surface, a bin, and the facing.
const LEAF_ATTRIBUTE_BITS: u32 = 24 + 8 + FACING_BITS;
const LEAF_ATTRIBUTES: u64 = (1 << LEAF_ATTRIBUTE_BITS) - 1;
/// Bits of levels, which are exponents of f64 and a few less.
const LEAF_LEVEL_BITS: u32 = 13;
const LEAF_LEVEL_BIAS: i32 = 1 << (LEAF_LEVEL_BITS - 1);

impl LeafCell {
    /// Bits of [`Self::upper`].
    pub const UPPER_BITS: u32 = LEAF_LEVEL_BITS + LEAF_ATTRIBUTE_BITS;
    /// All of them.
    pub const UPPER: u64 = (1 << Self::UPPER_BITS) - 1;

    /// From [`Self::upper`] and [`Self::lower`].
    #[inline]
    pub fn from_parts(upper: u64, lower: u64) -> Self {
        Self { upper, cell: lower }
    }

    /// Level and attributes.
    #[inline]
    pub fn upper(&self) -> u64 {
        self.upper
    }

    /// Coordinates, 63 bits.
    #[inline]
    pub fn lower(&self) -> u64 {
        self.cell
    }

    /// Level and attributes of a key. Of attributes that no vertex has, which only a damaged file can bring, some bits are
    /// lost.
    #[inline]
    pub fn upper_of(key: CellKey) -> u64 {
        upper(key.level(), key.upper())
    }

    /// The key of this level and these attributes, with the code of its coordinates.
    #[inline]
    pub fn key_of(upper: u64, code: u64) -> CellKey {
        let level = (upper >> LEAF_ATTRIBUTE_BITS) as i32 + LEVEL_BIAS - LEAF_LEVEL_BIAS;
        CellKey(u128::from((level as u64) << 48 | upper & LEAF_ATTRIBUTES) << 64 | u128::from(code))
    }

    /// Whether it is a cell.
    #[inline]
    pub fn exists(&self) -> bool {
        self.cell != NO_CELL
    }

    /// Whether it is a cell with nothing in the bits that no cell uses.
    pub fn is_canonical(&self) -> bool {
        self.upper <= Self::UPPER && self.cell <= MORTON
    }

    /// The cell of the same place for vertices of attributes that differ by `bin` in their lower bits, which are 0 here.
    #[inline]
    pub fn with_bin(self, bin: u8) -> Self {
        Self { upper: self.upper | u64::from(bin) << FACING_BITS, ..self }
    }

    /// The cell's key.
    #[inline]
    pub fn key(&self) -> CellKey {
        let [x, y, z] = [0, 1, 2].map(|axis| spread(self.cell >> (axis * COORDINATE_BITS)));
        Self::key_of(self.upper, x | y << 1 | z << 2)
    }

    /// Bits that differ between the cells of a neighbourhood: good enough for a small table.
    #[inline]
    pub fn quick_hash(&self) -> u64 {
        let mixed = self.cell.wrapping_mul(0xd6e8_feb8_6659_fd93) ^ self.upper;
        let mixed = (mixed ^ mixed >> 32).wrapping_mul(0xff51_afd7_ed55_8ccd);
        mixed ^ mixed >> 32
    }
}

/// Coordinates of no cell: those have 63 bits.
const NO_CELL: u64 = u64::MAX;

impl From<CellKey> for LeafCell {
    fn from(key: CellKey) -> Self {
        let [x, y, z] = [0, 1, 2].map(|axis| gather(key.0 as u64 >> axis));
        let cell = x | y << COORDINATE_BITS | z << (2 * COORDINATE_BITS);
        Self { upper: Self::upper_of(key), cell }
    }
}

/// See [`LeafCell::upper`].
#[inline]
fn upper(level: i32, attributes: u64) -> u64 {
    let level = (level + LEAF_LEVEL_BIAS) as u64 & ((1 << LEAF_LEVEL_BITS) - 1);
    level << LEAF_ATTRIBUTE_BITS | attributes & LEAF_ATTRIBUTES
}

/// Vertices as grids see them, coordinate by coordinate.
#[derive(Clone, Debug, Default)]
pub struct Places {
    p: [Vec<f64>; 3],
    n: [Vec<f32>; 3],
    /// 2^-level.
    inverse_side: Vec<f64>,
    /// Level and attributes of their cells, without the facing.
    upper: Vec<u64>,
}

impl Places {
    /// Most places that [`Grid::leaves`] takes.
    pub const MOST: usize = 256;

    /// Forgets all.
    pub fn clear(&mut self) {
        self.p.iter_mut().for_each(Vec::clear);
        self.n.iter_mut().for_each(Vec::clear);
        self.inverse_side.clear();
        self.upper.clear();
    }

    /// A vertex at `p` that faces `n`, whose finest cells are more than `side` / 4 and at most `side` / 2 wide before the
    /// tree's scale, and of level `finest` at least. `attributes`: 32 bits that vertices must agree in to meet.
    #[inline]
    pub fn push(&mut self, p: [f32; 3], n: Vec3, side: f32, finest: i32, attributes: u64) {
        let level = (exponent_of(f64::from(side)) - 1).max(finest);
        self.p.iter_mut().zip(p).for_each(|(list, x)| list.push(x.into()));
        self.n.iter_mut().zip(n.to_array()).for_each(|(list, x)| list.push(x));
        self.inverse_side.push(power_of_two(-level));
        self.upper.push(upper(level, attributes << FACING_BITS));
    }
}

/// Which of the six faces of a cube `n` points to.
#[inline]
fn facing(n: Vec3) -> u32 {
    let a = n.abs();
    let (along_x, above) = ((a.x >= a.y) & (a.x >= a.z), a.y >= a.z);
    let (axis, component) = if above { (2, n.y) } else { (4, n.z) };
    let (axis, component) = if along_x { (0, n.x) } else { (axis, component) };
    axis + u32::from(component < 0.0)
}

/// ⌊log₂ x⌋ of a positive normal number.
#[inline]
pub(crate) fn exponent_of(x: f64) -> i32 {
    (x.to_bits() >> 52 & 0x7ff) as i32 - 1023
}

/// 2ᵉ for |e| < 1023.
#[inline]
pub(crate) fn power_of_two(e: i32) -> f64 {
    f64::from_bits(((1023 + e) as u64) << 52)
}

#[cfg(test)]
#[path = "grid_tests.rs"]
mod tests;
