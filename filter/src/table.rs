//! Cells by their keys.

use std::collections::BTreeMap;

use crate::grid::{CellKey, LeafCell};
use crate::sums::{Deposit, Sums, WideSums};

/// What cells are found by.
pub(crate) trait Key: Copy + Eq {
    /// Bits that differ between keys.
    fn hash(&self) -> u64;
    /// The key that cells are sorted by.
    fn cell_key(&self) -> CellKey;
}

impl Key for CellKey {
    #[inline]
    fn hash(&self) -> u64 {
        CellKey::hash(*self)
    }
    #[inline]
    fn cell_key(&self) -> CellKey {
        *self
    }
}

impl Key for LeafCell {
    #[inline]
    fn hash(&self) -> u64 {
        self.quick_hash()
    }
    #[inline]
    fn cell_key(&self) -> CellKey {
        self.key()
    }
}

/// A cell, 64 bytes.
#[derive(Clone, Copy, Debug)]
struct Cell<K> {
    key: K,
    sums: Sums,
}

/// Cells found by key: open addressing with linear probing over full keys. It grows, so no cell is ever refused, and
/// nothing depends on who came first but the cells' numbers, which no result may depend on.
#[derive(Debug)]
pub(crate) struct Table<K> {
    /// Number of the cell plus one, 0 for none; a power of two of slots, at most half of them taken.
    slots: Vec<u32>,
    cells: Vec<Cell<K>>,
    /// What did not fit into cells, by their numbers.
    wide: BTreeMap<u32, WideSums>,
}

impl<K> Default for Table<K> {
    fn default() -> Self {
        Self { slots: Vec::new(), cells: Vec::new(), wide: BTreeMap::new() }
    }
}

impl<K: Key> Table<K> {
    /// A table of cells that are all different.
    pub fn from_cells(cells: Vec<(K, WideSums)>) -> Self {
        let mut table = Self { cells: Vec::with_capacity(cells.len()), ..Self::default() };
        for ((key, sums), number) in cells.into_iter().zip(0..) {
            table.cells.push(Cell { key, sums: Sums::default() });
            table.merge(number, &sums);
        }
        table
    }

    /// Number of the cell of `key`, which is made if there is none.
    #[inline]
    pub fn cell(&mut self, key: K) -> u32 {
        if 2 * self.cells.len() >= self.slots.len() {
            self.grow();
        }
        let mask = self.slots.len() - 1;
        let mut at = key.hash() as usize & mask;
        loop {
            match self.slots[at] {
                0 => break,
                number if self.cells[number as usize - 1].key == key => return number - 1,
                _ => at = (at + 1) & mask,
            }
        }
        if self.cells.len() == self.cells.capacity() {
            // Most of the filter's memory is in these lists: they grow by a quarter where doubling would waste half.
            self.cells.reserve_exact((self.cells.len() / 4).max(16));
        }
        self.cells.push(Cell { key, sums: Sums::default() });
        self.slots[at] = self.cells.len() as u32;
        self.cells.len() as u32 - 1
    }

    #[cold]
    fn grow(&mut self) {
        // Twice as long, or as long as it takes where there never were slots.
        let length = (2 * self.slots.len()).max(2 * (self.cells.len() + 1)).max(64).next_power_of_two();
        self.slots = vec![0; length];
        for (cell, number) in self.cells.iter().zip(1..) {
            let mut at = cell.key.hash() as usize & (length - 1);
            while self.slots[at] != 0 {
                at = (at + 1) & (length - 1);
            }
            self.slots[at] = number;
        }
    }

    /// Adds a deposit to a cell.
    #[inline]
    pub fn add(&mut self, cell: u32, deposit: &Deposit) {
        if !self.cells[cell as usize].sums.add(deposit) {
            self.widen(cell).add(deposit);
        }
    }

    /// Adds sums to a cell.
    pub fn merge(&mut self, cell: u32, sums: &WideSums) {
        let fits = Sums::try_from(sums).is_ok_and(|sums| self.cells[cell as usize].sums.merge(&sums));
        if !fits {
            self.widen(cell).merge(sums);
        }
    }

    /// Moves a cell's sums to its wide ones, and returns those.
    #[cold]
    fn widen(&mut self, cell: u32) -> &mut WideSums {
        let sums = std::mem::take(&mut self.cells[cell as usize].sums);
        let wide = self.wide.entry(cell).or_default();
        wide.merge(&(&sums).into());
        wide
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// All keys, in the order of their cells' numbers.
    pub fn keys(&self) -> impl Iterator<Item = CellKey> + '_ {
        self.cells.iter().map(|cell| cell.key.cell_key())
    }

    /// Key of a cell.
    pub fn key(&self, cell: u32) -> CellKey {
        self.cells[cell as usize].key.cell_key()
    }

    /// Sums of a cell.
    pub fn sums(&self, cell: u32) -> WideSums {
        let mut sums = WideSums::from(&self.cells[cell as usize].sums);
        if let Some(wide) = self.wide.get(&cell) {
            sums.merge(wide);
        }
        sums
    }

    /// Forgets all cells, and keeps the memory.
    pub fn clear(&mut self) {
        self.slots.fill(0);
        self.cells.clear();
        self.wide.clear();
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.slots.capacity() * size_of::<u32>() + self.cells.capacity() * size_of::<Cell<K>>()
    }
}
