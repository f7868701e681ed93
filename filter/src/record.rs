//! The boundary: what a renderer says of a path.

use glam::{Vec2, Vec3};

use crate::packed::{PackedFootprint, PackedNormal, PackedRgb, octahedral};

/// A vertex that other paths' vertices may be near to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Vertex {
    /// Position, world space.
    pub p: [f32; 3],
    /// Unit normal on the side from which the path arrived, world space.
    pub n: PackedNormal,
    /// Side of the square on the surface that the path's pixel covers if surfaces on the way are flat and mirrors: the
    /// camera ray's cone at the length of the path so far. World units.
    pub footprint: PackedFootprint,
    /// What may share cells, 24 bits: vertices with different numbers never do. [`Vertex::NONE`]: there is no vertex.
    /// In the upper 8 bits a number that only glossy cells tell apart, such as a bin of the direction of reflection.
    surface_and_bin: u32,
}

impl Vertex {
    /// The surface of a vertex that is not there.
    pub const NONE: u32 = 0xff_ffff;

    /// A vertex on `surface`, of which the lower 24 bits count.
    pub fn new(p: Vec3, n: Vec3, footprint: f32, surface: u32, bin: u8) -> Self {
        // The number that says "none" is lent to no surface: it shares that of another, as any two 2²⁴ apart do.
        let surface = (surface & Self::NONE).min(Self::NONE - 1);
        Self {
            p: p.to_array(),
            n: PackedNormal::new(n),
            footprint: PackedFootprint::new(footprint),
            surface_and_bin: surface | u32::from(bin) << 24,
        }
    }

    /// No vertex, but a number.
    pub fn none(bin: u8) -> Self {
        Self { surface_and_bin: Self::NONE | u32::from(bin) << 24, ..Self::default() }
    }

    /// Whether there is a vertex, and one that has a place in a grid.
    pub fn exists(&self) -> bool {
        self.surface() != Self::NONE && Vec3::from_array(self.p).is_finite() && self.footprint.get() > 0.0
    }

    /// What may share cells.
    pub fn surface(&self) -> u32 {
        self.surface_and_bin & Self::NONE
    }

    /// What only glossy cells tell apart.
    pub fn bin(&self) -> u8 {
        (self.surface_and_bin >> 24) as u8
    }
}

/// Which of 16 parts of the sphere a unit direction points to: equal squares of its octahedral map.
pub fn direction_bin(direction: Vec3) -> u8 {
    let p = (octahedral(direction) * 2.0 + 2.0).clamp(Vec2::ZERO, Vec2::splat(3.0));
    p.x as u8 | (p.y as u8) << 2
}

/// The part of a path that passes through one lobe of its first vertex.
///
/// It brings `throughput × (rest + transfer × suffix)` to the slot, products by channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Lobe {
    /// From the lobe to the slot, with the pixel filter's weight, so of either sign. For a diffuse lobe it holds the albedo.
    pub throughput: PackedRgb,
    /// Radiance that arrives in the lobe (divided by albedo for a diffuse one) not by way of the second vertex's diffuse
    /// lobe.
    pub rest: PackedRgb,
    /// From the second vertex's diffuse lobe to this one, with the albedo there.
    pub transfer: PackedRgb,
}

/// A path as the filter sees it: one path's share of a slot (a pixel, say), cut at two vertices.
///
/// The first vertex is the first that is not a mirror or smooth glass; the second is the first diffuse one behind it. What
/// the path brings to its slot is
///
/// prefix + diffuse.throughput (diffuse.rest + diffuse.transfer suffix)
///        + glossy.throughput (glossy.rest + glossy.transfer suffix),
///
/// of which the prefix (light that met no selected vertex) stays with the renderer. All radiance is *local*: nothing was
/// ever divided by a throughput, so a path that was lucky to arrive cannot blow up a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct PathRecord {
    /// Where the path's light goes: the caller's number.
    pub slot: u32,
    /// The first selected vertex.
    pub first: Vertex,
    /// The second; its `bin` is the number of the path's sample within the slot, modulo 256.
    pub second: Vertex,
    /// Through the diffuse lobe of the first vertex, if it has one.
    pub diffuse: Lobe,
    /// Through its other lobes.
    pub glossy: Lobe,
    /// Radiance that arrives in the diffuse lobe of the second vertex, over its albedo.
    pub suffix: PackedRgb,
}

impl Default for PathRecord {
    fn default() -> Self {
        let (first, second) = (Vertex::none(0), Vertex::none(0));
        Self { slot: 0, first, second, diffuse: Lobe::default(), glossy: Lobe::default(), suffix: PackedRgb::default() }
    }
}

impl Lobe {
    /// What arrives in the lobe when `suffix` arrives at the second vertex.
    pub fn incident(&self, suffix: Vec3) -> Vec3 {
        self.rest.get() + self.transfer.get() * suffix
    }

    /// Whether nothing can come of it.
    pub fn is_black(&self) -> bool {
        self.throughput == PackedRgb::default()
    }
}

impl PathRecord {
    /// Number of the path's sample within its slot, modulo 256.
    pub fn sample(&self) -> u8 {
        self.second.bin()
    }

    /// Sets [`Self::sample`].
    pub fn set_sample(&mut self, sample: u8) {
        self.second.surface_and_bin = self.second.surface() | u32::from(sample) << 24;
    }

    /// Whether the sample is an odd one: even and odd samples are two independent halves of a slot.
    pub fn odd(&self) -> bool {
        self.sample() % 2 == 1
    }

    /// What the path brings to its slot by way of the selected vertices, unfiltered. With the prefix this is the path's
    /// contribution, to 2⁻¹⁵ of its largest channel (five packed factors, 2⁻¹⁸ each).
    pub fn unfiltered(&self) -> Vec3 {
        let suffix = self.suffix.get();
        self.diffuse.throughput.get() * self.diffuse.incident(suffix)
            + self.glossy.throughput.get() * self.glossy.incident(suffix)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_a_hundred_bytes() {
        assert_eq!(size_of::<PathRecord>(), 100);
    }

    #[test]
    fn a_record_without_vertices_brings_nothing() {
        let record = PathRecord::default();
        assert!(!record.first.exists() && !record.second.exists());
        assert_eq!(record.unfiltered(), Vec3::ZERO);
    }

    #[test]
    fn no_surface_number_reads_as_none() {
        for surface in [0, 1, 0xff_fffe, 0xff_ffff, u32::MAX] {
            assert!(Vertex::new(Vec3::ONE, Vec3::Z, 1.0, surface, 255).exists(), "{surface}");
        }
    }

    #[test]
    fn vertices_without_a_place_do_not_exist() {
        for (p, footprint) in [(Vec3::NAN, 1.0), (Vec3::INFINITY, 1.0), (Vec3::ZERO, 0.0), (Vec3::ZERO, f32::NAN)] {
            assert!(!Vertex::new(p, Vec3::Z, footprint, 0, 0).exists());
        }
    }
}
