//! A part's share of a tree.

use std::ops::Range;

use super::{StoredError, Words, load_cells, split};
use crate::adaptive::Params;
use crate::grid::CellKey;
use crate::pairs::Pair;
use crate::sums::WideSums;

/// A part's share of one tree of first vertices: its cells, and which slots read them.
///
/// | words | what |
/// |---|---|
/// | 1 | number of cells |
/// | 7 to 12 | of each, by rising key: step from the last key, low and high; 4 × deposits, + 1 if weighted, + 2 if wide; Σ weight if weighted, which else is 2¹⁶ each; Σ weight · radiance; Σ weight · luminance². A wide cell's last four sums have two words each, low and high |
/// | 1 | number of pairs |
/// | 5 | of each, by slot and cell: step from the last slot, or at first from that of the part; step from the slot's last cell, or at first from 0; throughput |
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Branch {
    /// By key, each once.
    pub(super) cells: Vec<(CellKey, WideSums)>,
    /// By slot and cell, with indices of `cells`.
    pub(super) pairs: Vec<Pair>,
}

impl Branch {
    /// Reads what [`crate::Adaptive::store_trees`] or [`Self::store`] appended for a part with these slots.
    ///
    /// # Errors
    /// There is no such share of a tree.
    pub fn read(params: &Params, tree: usize, slots: &Range<u32>, words: &[u64]) -> Result<Self, StoredError> {
        let mut words = Words(words);
        let cells = load_cells(&mut words)?;
        let count = words.count(5)?;
        let mut pairs = Vec::with_capacity(count);
        let (mut slot, mut cell) = (u64::from(slots.start), 0u64);
        for _ in 0..count {
            let [slot_step, cell_step, r, g, b] = words.take()?;
            let base = if slot_step == 0 { cell } else { 0 };
            slot = slot.checked_add(slot_step).filter(|slot| *slot < slots.end.into()).ok_or(StoredError)?;
            cell = base.checked_add(cell_step).filter(|cell| *cell < cells.len() as u64).ok_or(StoredError)?;
            let narrow = |x: u64| i32::try_from(x as i64).map_err(|_| StoredError);
            let throughput = [narrow(r)?, narrow(g)?, narrow(b)?];
            let pair = Pair::of_tree(slot as u32, tree, params.stored_trees(), cell as u32, throughput);
            pairs.push(pair.ok_or(StoredError)?);
        }
        words.end()?;
        Ok(Self { cells, pairs })
    }

    /// The sum of several filters' shares of the same tree and part.
    pub fn sum(mut branches: Vec<Self>) -> Self {
        if branches.len() == 1 {
            return branches.swap_remove(0);
        }
        // The sorts are stable ones, which find the sorted runs and merge them.
        let keys = |(branch, which): (&Self, u32)| -> Vec<_> {
            (branch.cells.iter().zip(0..)).map(|((key, _), at)| (*key, which, at)).collect()
        };
        let mut order: Vec<(CellKey, u32, u32)> = branches.iter().zip(0..).flat_map(keys).collect();
        order.sort_by_key(|(key, ..)| *key);
        let mut numbers: Vec<Vec<u32>> = branches.iter().map(|branch| vec![0; branch.cells.len()]).collect();
        let mut cells: Vec<(CellKey, WideSums)> = Vec::with_capacity(order.len());
        for (key, branch, at) in order {
            let sums = &branches[branch as usize].cells[at as usize].1;
            match cells.last_mut() {
                Some((last, sum)) if *last == key => sum.merge(sums),
                _ => cells.push((key, *sums)),
            }
            numbers[branch as usize][at as usize] = cells.len() as u32 - 1;
        }
        let renumbered = branches
            .iter()
            .zip(&numbers)
            .flat_map(|(branch, numbers)| branch.pairs.iter().map(|pair| pair.with_cell(numbers[pair.index()])));
        let mut pairs: Vec<Pair> = renumbered.collect();
        pairs.sort_by_key(Pair::order);
        Pair::unite(&mut pairs);
        // There was room for all that was read, of which most is the same from part to part.
        cells.shrink_to_fit();
        pairs.shrink_to_fit();
        Self { cells, pairs }
    }

    /// Appends the share, of a part with these slots, as [`crate::Adaptive::store_trees`] does.
    pub fn store(&self, slots: &Range<u32>, words: &mut Vec<u64>) {
        store_cells(self.cells.iter().copied(), words);
        store_pairs(&self.pairs, slots, words);
    }
}

/// Appends cells, which come by key.
pub(super) fn store_cells(cells: impl ExactSizeIterator<Item = (CellKey, WideSums)>, words: &mut Vec<u64>) {
    words.reserve(8 * cells.len());
    words.push(cells.len() as u64);
    let mut last = 0;
    for (key, sums) in cells {
        words.extend(split(key.bits() - last));
        last = key.bits();
        store_sums(&sums, words);
    }
}

/// Appends the sums of a cell.
#[inline]
pub(super) fn store_sums(sums: &WideSums, words: &mut Vec<u64>) {
    let weighted = WideSums::plain_weight(sums.count) != Some(sums.weight);
    let count = sums.count.min(u64::MAX >> 2) << 2 | u64::from(weighted);
    // Whatever fits into 63 bits, as nearly all does, need not be split.
    match sums.words() {
        Some([_, _, r, g, b, square]) if !weighted => words.extend_from_slice(&[count, r, g, b, square]),
        Some([_, weight, r, g, b, square]) => words.extend_from_slice(&[count, weight, r, g, b, square]),
        None => {
            words.push(count | 2);
            words.extend(weighted.then_some(sums.weight));
            let [r, g, b] = sums.rgb;
            words.extend([r, g, b, sums.square].into_iter().flat_map(split));
        }
    }
}

/// Appends pairs, which come by slot and cell.
pub(super) fn store_pairs(pairs: &[Pair], slots: &Range<u32>, words: &mut Vec<u64>) {
    words.reserve(1 + 5 * pairs.len());
    words.push(pairs.len() as u64);
    let (mut slot, mut cell) = (slots.start, 0);
    for pair in pairs {
        let slot_step = pair.slot() - slot;
        if slot_step > 0 {
            (slot, cell) = (pair.slot(), 0);
        }
        let [r, g, b] = pair.throughput().map(|x| i64::from(x) as u64);
        words.extend_from_slice(&[slot_step.into(), (pair.index() - cell) as u64, r, g, b]);
        cell = pair.index();
    }
}
