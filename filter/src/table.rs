//! Cells by their keys.

use std::collections::BTreeMap;
use std::sync::Mutex;

use crate::grid::{CellKey, LeafCell};
use crate::sums::{Deposit, Sums, WideSums};

/// What cells are found by.
pub(crate) trait Key: Copy + Eq {
    /// Bits that differ between keys.
    fn hash(&self) -> u64;
}

impl Key for CellKey {
    #[inline]
    fn hash(&self) -> u64 {
        CellKey::hash(*self)
    }
}

impl Key for LeafCell {
    #[inline]
    fn hash(&self) -> u64 {
        self.quick_hash()
    }
}

/// A cell; with a [`CellKey`] 64 bytes, a cache line.
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
        self.cells.push(Cell { key, sums: Sums::default() });
        self.slots[at] = self.cells.len() as u32;
        self.cells.len() as u32 - 1
    }

    #[cold]
    fn grow(&mut self) {
        let length = (2 * self.slots.len()).max(64);
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
    #[inline]
    pub fn merge(&mut self, cell: u32, sums: &Sums) {
        if !self.cells[cell as usize].sums.merge(sums) {
            self.widen(cell).merge(&sums.into());
        }
    }

    /// Adds sums of any size to a cell.
    pub fn merge_wide(&mut self, cell: u32, sums: &WideSums) {
        self.wide.entry(cell).or_default().merge(sums);
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

    /// All cells with their sums, in the order of their numbers.
    pub fn cells(&self) -> impl Iterator<Item = (K, WideSums)> + '_ {
        self.cells.iter().zip(0u32..).map(|(cell, number)| {
            let mut sums = WideSums::from(&cell.sums);
            if let Some(wide) = self.wide.get(&number) {
                sums.merge(wide);
            }
            (cell.key, sums)
        })
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

/// A table that threads add to at once: shards by the upper bits of the hash, each behind a lock that is held for a batch.
#[derive(Debug)]
pub(crate) struct ShardedTable {
    shards: Vec<Mutex<Table<CellKey>>>,
}

/// Where a cell is: shard in the lower bits, number above.
pub(crate) type CellIndex = u32;

const SHARD_BITS: u32 = 6;

/// Number of shards: enough that a few dozen threads seldom meet, few enough that a batch per shard is worth a lock.
const SHARDS: usize = 1 << SHARD_BITS;

/// Keys with their numbers in the order of their shards, each shard's in the order they came.
struct ByShard {
    keys: Vec<(CellKey, u32)>,
    /// Where each shard's begin, and the end.
    begins: [u32; SHARDS + 1],
}

impl ByShard {
    /// By counting.
    fn new(unsorted: Vec<(CellKey, u32)>) -> Self {
        let shards: Vec<u8> = unsorted.iter().map(|(key, _)| shard_of(*key) as u8).collect();
        let mut begins = [0; SHARDS + 1];
        for &shard in &shards {
            begins[usize::from(shard) + 1] += 1;
        }
        for shard in 0..SHARDS {
            begins[shard + 1] += begins[shard];
        }
        let mut next = begins;
        let mut keys = vec![(CellKey::default(), 0); unsorted.len()];
        for (item, shard) in unsorted.into_iter().zip(shards) {
            let at = &mut next[usize::from(shard)];
            keys[*at as usize] = item;
            *at += 1;
        }
        Self { keys, begins }
    }

    /// Visits the shards that have keys.
    fn for_each(&self, mut visit: impl FnMut(usize, &[(CellKey, u32)])) {
        for (shard, range) in self.begins.windows(2).enumerate() {
            let batch = &self.keys[range[0] as usize..range[1] as usize];
            if !batch.is_empty() {
                visit(shard, batch);
            }
        }
    }
}

#[inline]
fn shard_of(key: CellKey) -> usize {
    (key.hash() >> (64 - SHARD_BITS)) as usize
}

#[inline]
fn place(shard: usize, number: u32) -> CellIndex {
    assert!(number >> (32 - SHARD_BITS) == 0, "too many cells: the frame is too large for the filter");
    number << SHARD_BITS | shard as u32
}

impl Default for ShardedTable {
    fn default() -> Self {
        Self { shards: (0..SHARDS).map(|_| Mutex::default()).collect() }
    }
}

impl ShardedTable {
    /// Adds deposits to their cells, where they have one; places of the cells in the same order.
    ///
    /// # Panics
    /// As [`Self::merge`].
    pub fn add(&self, deposits: &[Option<(LeafCell, Deposit)>], places: &mut [Option<CellIndex>]) {
        let keys = deposits.iter().zip(0..).filter_map(|(deposit, at)| deposit.map(|(cell, _)| (cell.key(), at)));
        ByShard::new(keys.collect()).for_each(|shard, batch| {
            let mut table = self.lock(shard);
            for &(key, at) in batch {
                let Some((_, deposit)) = &deposits[at as usize] else { continue };
                let number = table.cell(key);
                table.add(number, deposit);
                places[at as usize] = Some(place(shard, number));
            }
        });
    }

    fn lock(&self, shard: usize) -> std::sync::MutexGuard<'_, Table<CellKey>> {
        self.shards[shard].lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// Adds all cells of `local`, whose cell i is then at `indices[i]` here.
    ///
    /// # Panics
    /// If a shard comes to hold 2²⁶ cells, 4 GiB.
    pub fn merge(&self, local: &Table<LeafCell>, indices: &mut Vec<CellIndex>) {
        indices.clear();
        indices.resize(local.cells.len(), 0);
        let keys = local.cells.iter().zip(0..).map(|(cell, at)| (cell.key.key(), at));
        ByShard::new(keys.collect()).for_each(|shard, batch| {
            let mut table = self.lock(shard);
            for &(key, at) in batch {
                let number = table.cell(key);
                table.merge(number, &local.cells[at as usize].sums);
                if let Some(wide) = local.wide.get(&at) {
                    table.merge_wide(number, wide);
                }
                indices[at as usize] = place(shard, number);
            }
        });
    }

    /// Adds sums to the cell of `key`; its place.
    pub fn add_sums(&mut self, key: CellKey, sums: &WideSums) -> CellIndex {
        let shard = shard_of(key);
        let mut table = self.lock(shard);
        let number = table.cell(key);
        match Sums::try_from(sums) {
            Ok(sums) => table.merge(number, &sums),
            Err(_) => table.merge_wide(number, sums),
        }
        place(shard, number)
    }

    /// All cells with their sums and places, by shard.
    pub fn cells(&mut self) -> impl Iterator<Item = (CellIndex, CellKey, WideSums)> + '_ {
        self.shards.iter_mut().zip(0u32..).flat_map(|(shard, at)| {
            let table = shard.get_mut().unwrap_or_else(std::sync::PoisonError::into_inner);
            table.cells().zip(0u32..).map(move |((key, sums), number)| (number << SHARD_BITS | at, key, sums))
        })
    }

    /// Number of cells.
    pub fn len(&mut self) -> usize {
        self.tables().map(|table| table.len()).sum()
    }

    /// Forgets all cells, and keeps the memory.
    pub fn clear(&mut self) {
        self.tables().for_each(Table::clear);
    }

    /// Bytes held.
    pub fn bytes(&mut self) -> usize {
        self.tables().map(|table| table.bytes()).sum()
    }

    fn tables(&mut self) -> impl Iterator<Item = &mut Table<CellKey>> {
        self.shards.iter_mut().map(|shard| shard.get_mut().unwrap_or_else(std::sync::PoisonError::into_inner))
    }
}

/// A value per cell of a [`ShardedTable`].
#[derive(Debug, Default)]
pub(crate) struct PerCell<T> {
    shards: Vec<Vec<T>>,
}

impl<T: Copy + Default> PerCell<T> {
    /// Default values for all cells of `table`.
    pub fn new(table: &mut ShardedTable) -> Self {
        Self { shards: table.tables().map(|table| vec![T::default(); table.len()]).collect() }
    }

    /// The value at a place.
    #[inline]
    pub fn get(&self, index: CellIndex) -> T {
        self.shards[index as usize % SHARDS][index as usize / SHARDS]
    }

    /// Sets the value at a place.
    #[inline]
    pub fn set(&mut self, index: CellIndex, value: T) {
        self.shards[index as usize % SHARDS][index as usize / SHARDS] = value;
    }
}
