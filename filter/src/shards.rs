//! Cells that paths from anywhere meet in: a table that threads add to at once.

use std::sync::{Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

use crate::buckets::Buckets;
use crate::cell::MeanCell;
use crate::grid::LeafCell;
use crate::sums::{Deposit, Quantum, WideSums};
use crate::table::Table;

/// Radiance of each cell of each shard.
pub(crate) type Means = Vec<Vec<[f32; 3]>>;

/// Shards by the upper bits of the hash, each behind a lock that is held for a batch.
#[derive(Debug)]
pub(crate) struct ShardedTable {
    shards: Vec<Mutex<Table<MeanCell>>>,
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
    /// Adds deposits to their cells; says by the number of the deposit where those are, in any order.
    pub fn add(&self, deposits: &[(LeafCell, Deposit)], mut found: impl FnMut(usize, ShardedIndex)) {
        let hashes: Vec<u64> = deposits.iter().map(|(cell, _)| cell.quick_hash()).collect();
        let batches = Buckets::new(SHARDS, hashes.iter().map(|hash| shard_of(*hash)));
        for (shard, lock) in (0..).zip(&self.shards) {
            let batch = batches.get(shard as usize);
            if batch.is_empty() {
                continue;
            }
            let mut table = lock.lock().unwrap_or_else(PoisonError::into_inner);
            for &at in batch {
                let (cell, deposit) = &deposits[at as usize];
                let number = table.cell_of_hash(*cell, hashes[at as usize] as u32);
                table.add(number, deposit);
                found(at as usize, ShardedIndex { shard, number });
            }
        }
    }

    /// The shards while nobody adds to them.
    pub fn tables(&self) -> Vec<MutexGuard<'_, Table<MeanCell>>> {
        self.shards.iter().map(|shard| shard.lock().unwrap_or_else(PoisonError::into_inner)).collect()
    }

    /// A shard while nobody adds to it.
    pub fn table(&self, shard: usize) -> MutexGuard<'_, Table<MeanCell>> {
        self.shards[shard].lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The mean radiance of each cell, while nobody adds to them.
    pub fn means(&self, quantum: &Quantum) -> Means {
        let of_table =
            |table: &Table<MeanCell>| (0..table.len()).map(|cell| table.sums(cell).mean(quantum).to_array()).collect();
        self.tables().par_iter().map(|table| of_table(table)).collect()
    }

    /// Adds sums to a cell.
    pub fn merge(&self, cell: LeafCell, sums: &WideSums) {
        let hash = cell.quick_hash();
        let mut table = self.table(shard_of(hash) as usize);
        let number = table.cell_of_hash(cell, hash as u32);
        table.merge(number, sums);
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

/// Tables within shards go by the lower bits.
fn shard_of(hash: u64) -> u32 {
    (hash >> (64 - SHARD_BITS)) as u32
}

impl ShardedIndex {
    /// The place of no cell.
    pub const NONE: Self = Self { shard: u32::MAX, number: u32::MAX };

    /// The mean of its cell among those of all.
    #[inline]
    pub fn of(self, means: &Means) -> [f32; 3] {
        means[self.shard as usize][self.number as usize]
    }
}
