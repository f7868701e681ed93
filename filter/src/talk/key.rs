//! From a vertex to the two hashes of its cell: jitter, level of detail, quantisation.

use glam::{DVec3, Vec2, Vec3};

use super::params::{Jitter, LevelOfDetail, Params};
use super::random::Random;
use crate::grid::{Anchor, exponent_of, power_of_two};
use crate::hash::mix64;
use crate::record::Vertex;

/// What a path passed through at its first vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// The diffuse lobe: the base of a layered material.
    Diffuse = 0,
    /// All others.
    Glossy = 1,
}

/// A cell, by two independent hashes of what describes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Key {
    /// Where the search begins, as a share of the table: all 64 bits count.
    pub home: u64,
    /// What tells the cell from others in its slots.
    pub verification: u64,
}

/// What two vertices must agree in to meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Cell {
    position: [i64; 3],
    /// log₂ of the side, relative to the scene's extent.
    level: i32,
    /// Normal, surface, direction, layer.
    attributes: u64,
}

impl Cell {
    fn key(&self, verification_bits: u32) -> Key {
        let words = [
            self.position[0] as u64,
            self.position[1] as u64,
            self.position[2] as u64,
            self.level as u64,
            self.attributes,
        ];
        // The first is quick: one multiplication a word. The second mixes after every word, with another constant at its
        // beginning, so that what meets in one hash is as likely as any other to meet in the other.
        const FACTORS: [u64; 5] = [
            0x9e37_79b9_7f4a_7c15,
            0xc2b2_ae3d_27d4_eb4f,
            0x1656_67b1_9e37_79f9,
            0xd6e8_feb8_6659_fd93,
            0xa076_1d64_78bd_642f,
        ];
        let sum =
            words.iter().zip(FACTORS).fold(0u64, |sum, (&word, factor)| sum.wrapping_add(word.wrapping_mul(factor)));
        let chain = words.iter().fold(0x27d4_eb2f_1656_67c5, |hash, &word| mix64(hash ^ word));
        Key { home: mix64(sum), verification: chain >> (64 - verification_bits) }
    }
}

/// How vertices find their cells in a frame.
#[derive(Clone, Copy, Debug)]
pub struct Locator {
    params: Params,
    /// The corner of all cells, world space.
    corner: DVec3,
    /// What distances are measured from, world space.
    eye: DVec3,
    /// log₂ of the scene's extent.
    extent: i32,
}

/// Distances to the eye below 2⁻²⁰ of the scene's extent count as that: at the eye itself there is no level.
const NEAREST: i32 = -20;

/// Beyond this many cells from the corner an f64 no longer tells cells apart.
const FARTHEST: f64 = (1u64 << 52) as f64;

/// Uses of random numbers. A point in the disk takes as many as it needs, so it comes last.
const NORMAL: u64 = 0;
const POSITION: u64 = 1;

impl Locator {
    /// Cells are fixed to the anchor, and stay when the eye moves.
    pub fn new(params: &Params, anchor: &Anchor, eye: DVec3) -> Self {
        let extent = exponent_of(anchor.extent);
        // Surfaces along the axes through the eye's place, or through a place that the scene was built around, would fall
        // on borders, where rounding alone decides. A shift at random by more than any cell puts them inside. It is a
        // power of two times constants, so a scene scaled by one keeps its cells.
        let random = |axis: u64| (mix64(axis) >> 11) as f64 / (1u64 << 53) as f64;
        let shift = DVec3::new(random(1), random(2), random(3)) * power_of_two(extent + 2);
        Self { params: *params, corner: anchor.origin - shift, eye, extent }
    }

    /// The keys of the cells that a path deposits to, from fine to coarse. False, and none, if the vertex has no place in
    /// a grid: it is no vertex, or too far away for its cell's side.
    #[inline]
    pub fn keys(&self, vertex: &Vertex, layer: Layer, random: Random, keys: &mut Vec<Key>) -> bool {
        if !vertex.exists() {
            return false;
        }
        let (p, n) = (Vec3::from_array(vertex.p).as_dvec3(), vertex.n.get());
        let (t, b) = n.any_orthonormal_pair();
        let offset = self.offset(random);
        let tangential = (t * offset.x + b * offset.y).as_dvec3();
        let attributes = self.attributes(vertex, n, t, b, layer, random);
        let own = self.level(vertex, p, p);
        let finer = if layer == Layer::Glossy { f64::from(self.params.glossy_finer) } else { 1.0 };
        let before = keys.len();
        for above in 0..self.params.lookups as i32 {
            // The level is that of the jittered place, so that its borders are jittered as those of cells are.
            let jittered = p + tangential * (self.side(own + above) / finer);
            let level = self.level(vertex, p, jittered) + above;
            let position = (jittered - self.corner) * (finer / self.side(level));
            if !position.is_finite() || position.abs().max_element() >= FARTHEST {
                keys.truncate(before);
                return false;
            }
            let position = position.to_array().map(|x| x.floor() as i64);
            let level =
                if matches!(self.params.level, LevelOfDetail::Fixed { .. }) { above } else { level - self.extent };
            keys.push(Cell { position, level, attributes }.key(self.params.verification_bits));
        }
        true
    }

    /// Side of a diffuse cell, world units.
    #[inline]
    fn side(&self, level: i32) -> f64 {
        let (LevelOfDetail::Fixed { side } | LevelOfDetail::Distance { side } | LevelOfDetail::Footprint { side }) =
            self.params.level;
        f64::from(side) * power_of_two(level)
    }

    /// Level of detail at `place`, near the vertex's own place `p`.
    #[inline]
    fn level(&self, vertex: &Vertex, p: DVec3, place: DVec3) -> i32 {
        let distance = |p: DVec3| (p - self.eye).length().max(power_of_two(self.extent + NEAREST));
        match self.params.level {
            LevelOfDetail::Fixed { .. } => 0,
            LevelOfDetail::Distance { .. } => exponent_of(distance(place)),
            LevelOfDetail::Footprint { .. } => {
                // A footprint grows with the length of the path. Seen directly that is the distance to the eye; elsewhere
                // it grows by about as much, if in another direction.
                let ratio = if place == p { 1.0 } else { (distance(place) / distance(p)).clamp(0.5, 2.0) };
                exponent_of(f64::from(vertex.footprint.get()) * ratio)
            }
        }
    }

    /// Where the jitter moves a vertex in its tangent plane, in sides of its cell.
    #[inline]
    fn offset(&self, random: Random) -> Vec2 {
        let centred = |use_: u64| 2.0 * random.point(use_) - 1.0;
        match self.params.jitter {
            Jitter::None => Vec2::ZERO,
            Jitter::Square { radius } => radius * centred(POSITION),
            Jitter::Disk { radius } => {
                // By rejection: exact, and without functions that differ between machines. It ends: each try is within
                // with a chance of π/4, and 64 in a row are not with one of 10⁻⁴³.
                let inside = (POSITION..POSITION + 64).map(centred).find(|point| point.length_squared() <= 1.0);
                radius * inside.unwrap_or(Vec2::ZERO)
            }
        }
    }

    #[inline]
    fn attributes(&self, vertex: &Vertex, n: Vec3, t: Vec3, b: Vec3, layer: Layer, random: Random) -> u64 {
        let params = &self.params;
        let mut attributes = 0;
        if params.normal_bins > 0 {
            // A cube's face is 2 wide and touches the sphere of normals in its middle.
            let bin = 2.0 / params.normal_bins as f32;
            let offset = (2.0 * random.point(NORMAL) - 1.0) * (params.normal_jitter * bin);
            attributes = u64::from(normal_bin(n + t * offset.x + b * offset.y, params.normal_bins));
        }
        if params.surface {
            attributes |= u64::from(vertex.surface()) << 20;
        }
        if layer == Layer::Glossy {
            if params.direction {
                attributes |= u64::from(vertex.bin()) << 44;
            }
            if params.layers {
                attributes |= 1 << 52;
            }
        }
        attributes
    }
}

/// Bin of a direction on a cube around it, each face with `bins` × `bins`. Less than 6 · 255², 19 bits.
#[inline]
fn normal_bin(n: Vec3, bins: u32) -> u32 {
    let a = n.abs();
    let (axis, major, others) = if a.x >= a.y && a.x >= a.z {
        (0, n.x, Vec2::new(n.y, n.z))
    } else if a.y >= a.z {
        (1, n.y, Vec2::new(n.z, n.x))
    } else {
        (2, n.z, Vec2::new(n.x, n.y))
    };
    let face = 2 * axis + u32::from(major < 0.0);
    let on_face = (others / major.abs() * 0.5 + 0.5) * bins as f32;
    let [u, v] = on_face.to_array().map(|x| (x as u32).min(bins - 1));
    (face * bins + u) * bins + v
}

#[cfg(test)]
#[path = "key_tests.rs"]
mod tests;
