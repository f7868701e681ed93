//! All that a filter holds between blocks, as words: to be stored, sent, and added to another filter's.
//!
//! Everything is a sum of integers, so adding is exact: any split of a frame's epochs over filters, added in any order,
//! resolves to the same bits as one filter that saw them all. What is written does not depend on who met a cell first.

use std::ops::Range;

use crate::adaptive::Adaptive;
use crate::first::Part;
use crate::grid::CellKey;
use crate::pairs::{Own, Pair};
use crate::sums::WideSums;
use crate::table::{Key, Table};

/// These words are not the sums of such a filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StoredError;

impl std::fmt::Display for StoredError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "these are not the sums of a filter with these settings")
    }
}

impl std::error::Error for StoredError {}

impl Adaptive {
    /// Appends the sums of a part.
    ///
    /// # Panics
    /// If there is no such part.
    pub fn store_part(&mut self, part: usize, words: &mut Vec<u64>) {
        let Part { cells, pairs } = &mut self.parts[part];
        let trees = cells.iter().map(Vec::len).sum();
        let mut numbers = Vec::with_capacity(trees);
        for table in cells.iter().flatten() {
            numbers.push(store_cells(table, words));
        }
        let (pairs, own) = pairs.parts();
        let mut pairs: Vec<Pair> =
            pairs.iter().map(|pair| pair.with_cell(numbers[pair.tree_of(trees)][pair.index()])).collect();
        pairs.sort_unstable_by_key(Pair::order);
        words.push(pairs.len() as u64);
        words.extend(pairs.iter().flat_map(|pair| pair.to_words()));
        words.push(own.len() as u64);
        for (slot, own) in own {
            words.push(slot.into());
            words.extend(own.to_words().map(|x| x as u64));
        }
    }

    /// Adds what [`Self::store_part`] appended for this part of another filter over the same frame. The part has `slots`.
    ///
    /// # Errors
    /// There are no such sums; some of them may have been added.
    ///
    /// # Panics
    /// If there is no such part.
    pub fn load_part(&mut self, part: usize, slots: Range<u32>, words: &[u64]) -> Result<(), StoredError> {
        let mut words = Words(words);
        let Part { cells, pairs } = &mut self.parts[part];
        let trees = cells.iter().map(Vec::len).sum();
        let mut numbers = Vec::with_capacity(trees);
        for table in cells.iter_mut().flatten() {
            let mut own = Vec::new();
            load_cells(&mut words, |key, sums| {
                let cell = table.cell(key.into());
                table.merge(cell, sums);
                own.push(cell);
            })?;
            numbers.push(own);
        }
        let mut read = Vec::new();
        for _ in 0..words.count(3)? {
            let pair = Pair::from_words(words.take()?);
            let cells = numbers.get(pair.tree_of(trees)).filter(|_| slots.contains(&pair.slot())).ok_or(StoredError)?;
            read.push(pair.with_cell(*cells.get(pair.index()).ok_or(StoredError)?));
        }
        let mut own = Vec::new();
        for _ in 0..words.count(13)? {
            let [slot] = words.take()?;
            let slot = u32::try_from(slot).ok().filter(|slot| slots.contains(slot)).ok_or(StoredError)?;
            own.push((slot, Own::from_words(words.take::<12>()?.map(|x| x as i64))));
        }
        pairs.absorb(read.into_iter(), &own);
        self.cells_changed();
        words.end()
    }

    /// Appends what second vertices share so far in the current epoch.
    pub fn store_epoch(&self, words: &mut Vec<u64>) {
        for tree in &self.second {
            tree.cells.tables().iter().for_each(|table| {
                store_cells(table, words);
            });
        }
    }

    /// Goes on in the epoch of `next`, the next sample of the slots, with what [`Self::store_epoch`] appended.
    ///
    /// # Errors
    /// As for [`Self::load_part`].
    pub fn load_epoch(&mut self, next: u64, words: &[u64]) -> Result<(), StoredError> {
        self.begin_block(next);
        let mut words = Words(words);
        for tree in &self.second {
            for mut table in tree.cells.tables() {
                load_cells(&mut words, |key, sums| {
                    let cell = table.cell(key);
                    table.merge(cell, sums);
                })?;
            }
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

/// Set in a cell's count if its sums are of 128 bits.
const WIDE: u64 = 1 << 63;

/// Appends a table's cells by key; their numbers in that order, by their numbers in the table.
fn store_cells<K: Key>(table: &Table<K>, words: &mut Vec<u64>) -> Vec<u32> {
    let mut order: Vec<(CellKey, u32)> = table.keys().zip(0..).collect();
    order.sort_unstable();
    let mut numbers = vec![0; order.len()];
    words.push(order.len() as u64);
    for ((key, cell), number) in order.into_iter().zip(0..) {
        numbers[cell as usize] = number;
        let WideSums { count, weight, rgb: [r, g, b], square } = table.sums(cell);
        let wide = [r, g, b, square];
        words.extend(split(key.bits()));
        if wide.iter().all(|x| u64::try_from(*x).is_ok()) {
            words.extend([count, weight]);
            words.extend(wide.map(|x| x as u64));
        } else {
            words.extend([count | WIDE, weight]);
            words.extend(wide.into_iter().flat_map(split));
        }
    }
    numbers
}

/// Reads what [`store_cells`] appended.
fn load_cells(words: &mut Words<'_>, mut cell: impl FnMut(CellKey, &WideSums)) -> Result<(), StoredError> {
    let mut last = None;
    for _ in 0..words.count(8)? {
        let [low, high, count, weight] = words.take()?;
        let [r, g, b, square] = if count & WIDE == 0 {
            words.take::<4>()?.map(u128::from)
        } else {
            let halves = words.take::<8>()?;
            std::array::from_fn(|i| join(halves[2 * i], halves[2 * i + 1]))
        };
        let key = CellKey::from_bits(join(low, high)).ok_or(StoredError)?;
        // They come by key, each once: what is added up within one file could reach the bit that says how it is stored.
        if last.replace(key).is_some_and(|last| last >= key) {
            return Err(StoredError);
        }
        cell(key, &WideSums { count: count & !WIDE, weight, rgb: [r, g, b], square });
    }
    Ok(())
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

    /// Found by fuzzing: the counts of one cell, stored twice, added up to the bit that says how its sums are stored.
    #[test]
    fn a_cell_comes_once() {
        const KEY: u64 = 0x4c4c_4c4c_4c4c_4c4c;
        let cell = [KEY, KEY, 1, 1, 0, 0, 0, 0];
        let load = |count: u64, cells: &[u64]| load_cells(&mut Words(&[&[count], cells].concat()), |_, _| ());
        assert_eq!(load(1, &cell), Ok(()));
        assert_eq!(load(2, &[cell, cell].concat()), Err(StoredError));
    }
}
