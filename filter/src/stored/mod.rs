//! All that a filter holds between blocks, as words: to be stored, sent, and added to another filter's.
//!
//! Everything is a sum of integers, so adding is exact: any split of a frame's epochs over filters, added in any order,
//! resolves to the same bits as one filter that saw them all. What is written does not depend on who met a cell first.
//!
//! Sums are stored tree by tree, and of each tree part by part: a [`Branch`]. What slots sum up without a cell comes last,
//! part by part: [`Slots`]. In that order files of many filters can be read side by side and resolved by [`Merging`], which
//! holds the cells of one tree at a time.

mod branch;
mod merging;
mod slots;

use std::ops::Range;

use rayon::prelude::*;

pub use branch::Branch;
pub use merging::Merging;
pub use slots::Slots;

use crate::adaptive::{Adaptive, Params};
use crate::buckets::Buckets;
use crate::cell::Cell;
use crate::grid::{CellKey, LeafCell};
use crate::pairs::Pair;
use crate::sums::WideSums;
use crate::table::Table;

/// These words are not the sums of such a filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StoredError;

impl std::fmt::Display for StoredError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "these are not the sums of a filter with these settings")
    }
}

impl std::error::Error for StoredError {}

impl Params {
    /// Number of trees of cells at first vertices: those of diffuse lobes, then those of glossy ones.
    pub fn stored_trees(&self) -> usize {
        2 * self.trees as usize
    }
}

impl Adaptive {
    /// As [`Params::stored_trees`].
    pub fn stored_trees(&self) -> usize {
        self.params.stored_trees()
    }

    /// Orders what the last blocks have left, as [`Self::store_trees`] wants it.
    pub fn settle(&mut self) {
        self.parts.par_iter_mut().for_each(|part| part.pairs.settle());
    }

    /// Appends a part's share of each tree to the words of that tree, after [`Self::settle`]: of all at once, because the
    /// pairs of all trees lie together. The part has `slots`.
    ///
    /// # Panics
    /// If there is no such part, or there are not as many lists as [`Self::stored_trees`].
    pub fn store_trees(&self, part: usize, slots: &Range<u32>, words: &mut [Vec<u64>]) {
        assert_eq!(words.len(), self.stored_trees(), "lists of words");
        let part = &self.parts[part];
        let (settled, trees) = (part.pairs.settled(), words.len());
        let by_tree = Buckets::new(trees, settled.iter().map(|pair| pair.tree_of(trees) as u32));
        let (mut order, mut pairs) = (Order::default(), Vec::with_capacity(settled.len()));
        for (tree, (table, words)) in part.cells.iter().flatten().zip(words).enumerate() {
            order.store_cells(table, words);
            let renumbered = |at: &u32| {
                let pair = settled[*at as usize];
                pair.with_cell(order.numbers[pair.index()])
            };
            pairs.clear();
            pairs.extend(by_tree.get(tree).iter().map(renumbered));
            for same in pairs.chunk_by_mut(|a: &Pair, b: &Pair| a.slot() == b.slot()) {
                same.sort_unstable_by_key(|pair| pair.index());
            }
            branch::store_pairs(&pairs, slots, words);
        }
    }

    /// Adds what [`Self::store_trees`] appended for this part of another filter over the same frame.
    ///
    /// # Panics
    /// If there is no such part, or no such tree.
    pub fn add_tree(&mut self, tree: usize, part: usize, branch: &Branch) {
        let part = &mut self.parts[part];
        let trees = part.cells[0].len();
        let table = &mut part.cells[tree / trees][tree % trees];
        let add = |(key, sums): &(CellKey, WideSums)| {
            let cell = table.cell((*key).into());
            table.merge(cell, sums);
            cell
        };
        let numbers: Vec<u32> = branch.cells.iter().map(add).collect();
        part.pairs.absorb(branch.pairs.iter().map(|pair| pair.with_cell(numbers[pair.index()])));
        self.cells_changed();
    }

    /// Reads what [`Self::store_trees`] appended for this part of another filter, and adds it.
    ///
    /// # Errors
    /// There is no such share of a tree.
    ///
    /// # Panics
    /// If there is no such part, or no such tree.
    pub fn load_tree(
        &mut self,
        tree: usize,
        part: usize,
        slots: &Range<u32>,
        words: &[u64],
    ) -> Result<(), StoredError> {
        self.add_tree(tree, part, &Branch::read(&self.params, tree, slots, words)?);
        Ok(())
    }

    /// Appends what a part's slots sum up without a cell.
    ///
    /// # Panics
    /// If there is no such part.
    pub fn store_slots(&self, part: usize, slots: &Range<u32>, words: &mut Vec<u64>) {
        slots::store(&self.parts[part].pairs.own_sums(), slots, words);
    }

    /// Adds what [`Self::store_slots`] appended for this part of another filter over the same frame.
    ///
    /// # Panics
    /// If there is no such part.
    pub fn add_slots(&mut self, part: usize, slots: &Slots) {
        self.parts[part].pairs.absorb_own(&slots.0);
    }

    /// What second vertices share so far in the current epoch, in pieces that may be stored at once.
    pub fn epoch(&self) -> Vec<EpochPiece> {
        let pieces = self.second.iter().enumerate().flat_map(|(tree, second)| {
            second
                .cells
                .tables()
                .iter()
                .enumerate()
                .flat_map(|(shard, table)| pieces(tree, shard, table.len()))
                .collect::<Vec<_>>()
        });
        pieces.collect()
    }

    /// Appends one of [`Self::epoch`]. The order of its cells is that in which they were met: nothing depends on it.
    ///
    /// | words | what |
    /// |---|---|
    /// | 1 | tree |
    /// | 1 | number of cells |
    /// | 6 to 9 | of each: level and attributes; coordinates; 2 × Σ weight, + 1 if wide; Σ weight · radiance, of a wide cell in two words each, low and high |
    ///
    /// # Panics
    /// If paths were added since.
    pub fn store_epoch(&self, piece: &EpochPiece, words: &mut Vec<u64>) {
        let EpochPiece { tree, shard, cells } = piece;
        let table = self.second[*tree].cells.table(*shard);
        words.extend([*tree as u64, cells.len() as u64]);
        for cell in cells.clone() {
            let (leaf, sums) = (table.leaf(cell), table.sums(cell));
            let weight = sums.weight.min(u64::MAX >> 1) << 1;
            words.extend([leaf.upper(), leaf.lower()]);
            match sums.words() {
                Some([_, _, r, g, b, _]) => words.extend([weight, r, g, b]),
                None => {
                    words.push(weight | 1);
                    words.extend(sums.rgb.into_iter().flat_map(split));
                }
            }
        }
    }

    /// Goes on in the epoch of `next`, the next sample of the slots, to which [`Self::add_epoch`] adds what is known of it.
    pub fn begin_stored_epoch(&mut self, next: u64) {
        self.begin_block(next);
    }

    /// Adds what [`Self::store_epoch`] appended.
    ///
    /// # Errors
    /// There are no such sums; some of them may have been added.
    pub fn add_epoch(&mut self, words: &[u64]) -> Result<(), StoredError> {
        let mut words = Words(words);
        let [tree] = words.take()?;
        let tree = usize::try_from(tree).ok().and_then(|tree| self.second.get(tree)).ok_or(StoredError)?;
        for _ in 0..words.count(6)? {
            let [upper, lower, weight] = words.take()?;
            let cell = LeafCell::from_parts(upper, lower);
            let rgb = match weight & 1 {
                0 => words.take::<3>()?.map(u128::from),
                _ => {
                    let halves = words.take::<6>()?;
                    [0, 2, 4].map(|at| join(halves[at], halves[at + 1]))
                }
            };
            // Only what has weight has a mean.
            if weight < 2 || !cell.is_canonical() {
                return Err(StoredError);
            }
            tree.cells.merge(cell, &WideSums { weight: weight >> 1, rgb, ..WideSums::default() });
        }
        words.end()
    }

    /// Paths so far, and those of them that no cell could take.
    pub fn paths(&self) -> [u64; 2] {
        [self.report.paths, self.report.unfiltered]
    }

    /// Adds the counts of another filter.
    pub fn add_paths(&mut self, [paths, unfiltered]: [u64; 2]) {
        self.report.paths = self.report.paths.saturating_add(paths);
        self.report.unfiltered = self.report.unfiltered.saturating_add(unfiltered);
    }
}

/// A piece of what second vertices share in an epoch: some cells of a table.
#[derive(Clone, Debug)]
pub struct EpochPiece {
    tree: usize,
    shard: usize,
    cells: Range<u32>,
}

/// Cells of a piece: half a megabyte of words.
const PIECE: u32 = 1 << 13;

fn pieces(tree: usize, shard: usize, cells: u32) -> impl Iterator<Item = EpochPiece> {
    let piece = move |first: u32| EpochPiece { tree, shard, cells: first..cells.min(first.saturating_add(PIECE)) };
    (0..cells).step_by(PIECE as usize).map(piece)
}

/// The cells of a table by key.
#[derive(Default)]
struct Order {
    cells: Vec<(CellKey, u32)>,
    /// Their numbers in that order, by their numbers in the table.
    numbers: Vec<u32>,
}

impl Order {
    /// Appends a table's cells by key.
    fn store_cells<C: Cell>(&mut self, table: &Table<C>, words: &mut Vec<u64>) {
        self.cells.clear();
        self.cells.extend(table.keys().zip(0..));
        self.cells.sort_unstable_by_key(|(key, _)| *key);
        self.numbers.resize(self.cells.len(), 0);
        for ((_, cell), number) in self.cells.iter().zip(0..) {
            self.numbers[*cell as usize] = number;
        }
        branch::store_cells(self.cells.iter().map(|(key, cell)| (*key, table.sums(*cell))), words);
    }
}

/// Reads what [`branch::store_cells`] appended: by key, each once.
fn load_cells(words: &mut Words<'_>) -> Result<Vec<(CellKey, WideSums)>, StoredError> {
    let count = words.count(7)?;
    let mut cells = Vec::with_capacity(count);
    let mut last = 0;
    for _ in 0..count {
        let [low, high] = words.take()?;
        // No cell has only zeros for its key, so a step of 0 is never right.
        let step = Some(join(low, high)).filter(|step| *step > 0).ok_or(StoredError)?;
        last = step.checked_add(last).ok_or(StoredError)?;
        let key = CellKey::from_bits(last).ok_or(StoredError)?;
        cells.push((key, load_sums(words)?));
    }
    Ok(cells)
}

/// Reads what [`branch::store_sums`] appended: of cells with deposits, so that they have means.
fn load_sums(words: &mut Words<'_>) -> Result<WideSums, StoredError> {
    let [count] = words.take()?;
    let (weighted, wide, count) = (count & 1 != 0, count & 2 != 0, count >> 2);
    let weight = if weighted { words.take::<1>()?[0] } else { WideSums::plain_weight(count).ok_or(StoredError)? };
    if count == 0 || weight == 0 {
        return Err(StoredError);
    }
    let [r, g, b, square] = if wide {
        let halves = words.take::<8>()?;
        std::array::from_fn(|i| join(halves[2 * i], halves[2 * i + 1]))
    } else {
        words.take::<4>()?.map(u128::from)
    };
    Ok(WideSums { count, weight, rgb: [r, g, b], square })
}

fn split(x: u128) -> [u64; 2] {
    [x as u64, (x >> 64) as u64]
}

fn join(low: u64, high: u64) -> u128 {
    u128::from(low) | u128::from(high) << 64
}

/// Takes words off the front.
struct Words<'a>(&'a [u64]);

impl Words<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u64; N], StoredError> {
        let (first, rest) = self.0.split_first_chunk::<N>().ok_or(StoredError)?;
        self.0 = rest;
        Ok(*first)
    }

    /// A number of items of at least `size` words, so that no count asks for more than there is.
    fn count(&mut self, size: usize) -> Result<usize, StoredError> {
        let [count] = self.take()?;
        usize::try_from(count).ok().filter(|count| *count <= self.0.len() / size).ok_or(StoredError)
    }

    fn end(&self) -> Result<(), StoredError> {
        if self.0.is_empty() { Ok(()) } else { Err(StoredError) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Found by fuzzing: the counts of one cell, stored twice, added up to more than a count that is stored can be.
    #[test]
    fn a_cell_comes_once() {
        const KEY: [u64; 2] = [0x4c4c_4c4c_4c4c_4c4c, 0x4c4c_0004_4c4c_4c4c];
        let sums = [5, 1, 0, 0, 0, 0];
        let cells = |steps: &[[u64; 2]]| {
            let cells = steps.iter().flat_map(|step| [&step[..], &sums].concat());
            load_cells(&mut Words(&[steps.len() as u64].into_iter().chain(cells).collect::<Vec<_>>()))
        };
        assert_eq!(cells(&[KEY, [1, 0]]).map(|cells| cells.len()), Ok(2));
        assert_eq!(cells(&[KEY, [0, 0]]), Err(StoredError));
        // Attributes that no cell has: they would be cut off, and the key be another one's.
        assert_eq!(cells(&[KEY, [0, 1 << 40]]), Err(StoredError));
        assert_eq!(cells(&[KEY, [u64::MAX; 2]]), Err(StoredError));
    }
}
