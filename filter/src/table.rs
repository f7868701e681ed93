//! Cells by their keys.

use std::collections::BTreeMap;

use crate::cell::Cell;
use crate::grid::{CellKey, LeafCell};
use crate::sums::{Deposit, WideSums};

/// Cells are allocated by so many: they never move, and a table of a few hundred wastes little.
const CHUNK: usize = 16;

/// Cells found by key: open addressing with linear probing over full keys. It grows, so no cell is ever refused, and
/// nothing depends on who came first but the cells' numbers, which no result may depend on.
#[derive(Debug)]
pub(crate) struct Table<C> {
    /// 0 for none, or in the lower bits, as many as index this list, the number of the cell plus one, and above them the
    /// hash of its key: what another cell has taken is passed over without a look at that cell. A power of two of slots,
    /// at most three quarters of them taken.
    slots: Vec<u32>,
    chunks: Vec<Box<[C; CHUNK]>>,
    len: usize,
    /// What did not fit into cells, by their numbers.
    wide: BTreeMap<u32, WideSums>,
}

impl<C> Default for Table<C> {
    fn default() -> Self {
        Self { slots: Vec::new(), chunks: Vec::new(), len: 0, wide: BTreeMap::new() }
    }
}

impl<C: Cell> Table<C> {
    /// Number of the cell of `key`, which is made if there is none.
    #[inline]
    pub fn cell(&mut self, key: LeafCell) -> u32 {
        self.cell_of_hash(key, key.quick_hash() as u32)
    }

    /// The same when the hash is known.
    #[inline]
    pub fn cell_of_hash(&mut self, key: LeafCell, hash: u32) -> u32 {
        if 4 * self.len >= 3 * self.slots.len() {
            self.grow();
        }
        let mask = (self.slots.len() - 1) as u32;
        let mut at = hash & mask;
        loop {
            let slot = self.slots[at as usize];
            if slot == 0 {
                return self.make(key, at, hash & !mask);
            }
            if (slot ^ hash) & !mask == 0 {
                let number = (slot & mask) - 1;
                if self.at(number).is(&key) {
                    return number;
                }
            }
            at = (at + 1) & mask;
        }
    }

    /// Brings the table into the cache, all of it in the order of its memory: much sooner done than one cell after the
    /// other when they are looked for.
    pub fn warm(&self) {
        const LINE: usize = 64 / size_of::<u32>();
        let slots = self.slots.iter().step_by(LINE).fold(0, |sum, slot| sum ^ slot);
        let cells = self.cells().fold(0, |sum, cell| sum ^ cell.key().quick_hash());
        std::hint::black_box((slots, cells));
    }

    /// Makes a cell, to be found by a slot.
    fn make(&mut self, key: LeafCell, slot: u32, tag: u32) -> u32 {
        let number = self.push(key);
        self.slots[slot as usize] = tag | (number + 1);
        number
    }

    /// Makes a cell that no slot finds yet.
    fn push(&mut self, key: LeafCell) -> u32 {
        if self.len == CHUNK * self.chunks.len() {
            self.chunks.push(Box::new([C::default(); CHUNK]));
        }
        let number = self.len as u32;
        self.len += 1;
        *self.at_mut(number) = C::new(key);
        number
    }

    #[cold]
    fn grow(&mut self) {
        let length = (2 * self.slots.len()).max(32);
        let mask = length as u32 - 1;
        self.slots = vec![0; length];
        for number in 0..self.len as u32 {
            let hash = self.at(number).key().quick_hash() as u32;
            let mut at = hash & mask;
            while self.slots[at as usize] != 0 {
                at = (at + 1) & mask;
            }
            self.slots[at as usize] = hash & !mask | (number + 1);
        }
    }

    #[inline]
    fn at(&self, cell: u32) -> &C {
        &self.chunks[cell as usize / CHUNK][cell as usize % CHUNK]
    }

    #[inline]
    fn at_mut(&mut self, cell: u32) -> &mut C {
        &mut self.chunks[cell as usize / CHUNK][cell as usize % CHUNK]
    }

    /// Adds a deposit to a cell.
    #[inline]
    pub fn add(&mut self, cell: u32, deposit: &Deposit) {
        if !self.at_mut(cell).add(deposit) {
            self.widen(cell).add(deposit);
        }
    }

    /// Adds sums to a cell.
    pub fn merge(&mut self, cell: u32, sums: &WideSums) {
        if !self.at_mut(cell).merge(sums) {
            self.widen(cell).merge(sums);
        }
    }

    /// Moves a cell's sums to its wide ones, and returns those.
    #[cold]
    fn widen(&mut self, cell: u32) -> &mut WideSums {
        let narrow = self.at_mut(cell);
        let sums = narrow.sums();
        *narrow = C::new(narrow.key());
        let wide = self.wide.entry(cell).or_default();
        wide.merge(&sums);
        wide
    }

    fn cells(&self) -> impl Iterator<Item = &C> + '_ {
        self.chunks.iter().flat_map(|chunk| chunk.iter()).take(self.len)
    }

    /// All keys, in the order of their cells' numbers.
    pub fn keys(&self) -> impl Iterator<Item = CellKey> + '_ {
        self.cells().map(|cell| cell.key().key())
    }

    /// Number of cells.
    pub fn len(&self) -> u32 {
        self.len as u32
    }

    /// What a cell is found by.
    pub fn leaf(&self, cell: u32) -> LeafCell {
        self.at(cell).key()
    }

    /// Key of a cell.
    pub fn key(&self, cell: u32) -> CellKey {
        self.at(cell).key().key()
    }

    /// Sums of a cell, see [`Cell::sums`].
    pub fn sums(&self, cell: u32) -> WideSums {
        let mut sums = self.at(cell).sums();
        if !self.wide.is_empty() {
            if let Some(wide) = self.wide.get(&cell) {
                sums.merge(wide);
            }
        }
        sums
    }

    /// Forgets all cells, and keeps the memory.
    pub fn clear(&mut self) {
        self.slots.fill(0);
        self.len = 0;
        self.wide.clear();
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let chunk = size_of::<Box<[C; CHUNK]>>() * self.chunks.capacity();
        self.slots.capacity() * size_of::<u32>() + self.chunks.len() * CHUNK * size_of::<C>() + chunk
    }
}
