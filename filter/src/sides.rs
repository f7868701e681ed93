//! How large the cells are that slots read, for a map of what the filter did.

use std::collections::BTreeMap;

use crate::pairs::Pair;

/// Σ throughput · log₂ side and Σ throughput of the finest cells that the paths of a slot were put into, by slot. Integers:
/// no order changes a bit.
#[derive(Debug, Default)]
pub(crate) struct Sides(BTreeMap<u32, [i128; 2]>);

impl Sides {
    /// Adds what sorted pairs read, given the level of a pair's cell. There are `trees` trees of either kind, whose cells
    /// of a level differ by factors of 2^(1 / trees).
    pub fn add(&mut self, pairs: &[Pair], trees: u32, level: impl Fn(&Pair) -> i32) {
        for same in pairs.chunk_by(|a, b| a.order() == b.order()) {
            let throughput = |c: usize| same.iter().map(|pair| i128::from(pair.throughput()[c])).sum::<i128>().abs();
            let weight = throughput(0) + throughput(1) + throughput(2);
            let steps = i128::from(level(&same[0])) * i128::from(trees) + i128::from(same[0].tree());
            let sums = self.0.entry(same[0].slot()).or_default();
            *sums = [sums[0] + weight * steps, sums[1] + weight];
        }
    }

    /// The geometric mean of the sides, in the units of the anchor, by slot; slots without throughput are left out.
    pub fn mean(&self, trees: u32) -> Vec<(u32, f32)> {
        let lit = self.0.iter().filter(|(_, [_, weight])| *weight > 0);
        lit.map(|(slot, [steps, weight])| (*slot, (*steps as f64 / *weight as f64 / f64::from(trees)).exp2() as f32))
            .collect()
    }
}
