//! Which slots read which cells: what is remembered of paths if they read at the end.

use glam::Vec3;

use super::key::Layer;
use super::table::Place;
use crate::packed::PackedRgb;

/// The lookups of one part's paths through one layer.
#[derive(Debug, Default)]
struct LayerReads {
    slots: Vec<(u32, PackedRgb)>,
    /// As many for each entry of `slots` as there are lookups.
    places: Vec<Place>,
}

/// The lookups of one part's paths.
#[derive(Debug, Default)]
pub struct Reads([LayerReads; 2]);

impl Reads {
    /// A path of `slot` reads `places`, from fine to coarse.
    pub fn push(&mut self, slot: u32, layer: Layer, throughput: PackedRgb, places: &[Place]) {
        let reads = &mut self.0[layer as usize];
        reads.slots.push((slot, throughput));
        reads.places.extend_from_slice(places);
    }

    /// All lookups: slot, layer, throughput, places.
    pub fn iter(&self) -> impl Iterator<Item = (u32, Layer, Vec3, &[Place])> {
        [Layer::Diffuse, Layer::Glossy].into_iter().zip(&self.0).flat_map(|(layer, reads)| {
            let lookups = reads.places.len() / reads.slots.len().max(1);
            reads
                .slots
                .iter()
                .zip(reads.places.chunks_exact(lookups.max(1)))
                .map(move |(&(slot, throughput), places)| (slot, layer, throughput.get(), places))
        })
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.0
            .iter()
            .map(|reads| {
                reads.slots.capacity() * size_of::<(u32, PackedRgb)>() + reads.places.capacity() * size_of::<Place>()
            })
            .sum()
    }
}
