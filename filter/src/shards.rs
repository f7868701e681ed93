//! Cells that paths from anywhere meet in: a table that threads add to at once.

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::buckets::Buckets;
use crate::grid::{CellKey, LeafCell};
use crate::sums::Deposit;
use crate::table::Table;

/// Shards by the upper bits of the hash, each behind a lock that is held for a batch.
#[derive(Debug)]
pub(crate) struct ShardedTable {
    shards: Vec<Mutex<Table<CellKey>>>,
}

/// Where a cell is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ShardedIndex {
    shard: u32,
    number: u32,
}

const SHARD_BITS: u32 = 6;

/// Number of shards: enough that a few dozen threads seldom meet, few enough that a batch per shard is worth a lock.
const SHARDS: usize = 1 << SHARD_BITS;

impl Default for ShardedTable {
    fn default() -> Self {
        Self { shards: (0..SHARDS).map(|_| Mutex::default()).collect() }
    }
}

impl ShardedTable {
    /// Adds deposits to their cells; places of the cells in the same order.
    pub fn add(&self, deposits: &[(LeafCell, Deposit)]) -> Vec<ShardedIndex> {
        let keys: Vec<CellKey> = deposits.iter().map(|(cell, _)| cell.key()).collect();
        let batches = Buckets::new(SHARDS, keys.iter().map(|key| (key.hash() >> (64 - SHARD_BITS)) as u32));
        let mut places = vec![ShardedIndex { shard: 0, number: 0 }; deposits.len()];
        for (shard, lock) in (0..).zip(&self.shards) {
            let batch = batches.get(shard as usize);
            if batch.is_empty() {
                continue;
            }
            let mut table = lock.lock().unwrap_or_else(PoisonError::into_inner);
            for &at in batch {
                let number = table.cell(keys[at as usize]);
                table.add(number, &deposits[at as usize].1);
                places[at as usize] = ShardedIndex { shard, number };
            }
        }
        places
    }

    /// The shards while nobody adds to them.
    pub fn tables(&self) -> Vec<MutexGuard<'_, Table<CellKey>>> {
        self.shards.iter().map(|shard| shard.lock().unwrap_or_else(PoisonError::into_inner)).collect()
    }

    /// Forgets all cells, and keeps the memory.
    pub fn clear(&self) {
        self.tables().iter_mut().for_each(|table| table.clear());
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.tables().iter().map(|table| table.bytes()).sum()
    }
}

impl ShardedIndex {
    /// The value of its cell among those of all.
    #[inline]
    pub fn of<T: Copy>(self, values: &[Vec<T>]) -> T {
        values[self.shard as usize][self.number as usize]
    }
}
