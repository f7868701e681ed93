//! First vertices of the paths of a part of the slots: its cells, and which slots read them.

use glam::Vec3;

use crate::adaptive::{Params, place};
use crate::grid::{Grid, LeafCell, Places};
use crate::pairs::{Lobe as PairLobe, Pair, Pairs};
use crate::record::{Lobe, PathRecord};
use crate::second::Suffixes;
use crate::sums::{Deposit, Quantum};
use crate::table::Table;

/// What the paths of a part left. A cell at a border is in several parts, each with its own share of the sums.
#[derive(Debug)]
pub(crate) struct Part {
    /// By lobe and tree.
    pub cells: [Vec<Table<LeafCell>>; 2],
    pub pairs: Pairs,
}

/// What all parts deposit by.
pub(crate) struct Rules<'a> {
    pub params: &'a Params,
    pub quantum: &'a Quantum,
    pub grids: &'a [Grid],
}

/// A path's light in one lobe, on its way to the cells.
struct Share {
    /// Number of the path in its batch.
    path: u32,
    /// The tree that the path reads.
    tree: u32,
    /// The cell that it reads, and [`NOWHERE`] if there is none.
    read: u32,
    bin: u8,
    /// A tree without a cell was met: the others after it get nothing.
    lost: bool,
    deposit: Deposit,
    throughput: Vec3,
    incident: Vec3,
}

/// Room for a batch, to be used again. The paths of a batch are worked on together, one tree after the other, so that a
/// tree's cells stay in the cache.
#[derive(Default)]
pub(crate) struct Batch {
    places: Places,
    leaves: Vec<LeafCell>,
    shares: [Vec<Share>; 2],
    /// Paths of which some light went to no cell.
    unfiltered: Vec<u32>,
    /// For the pairs of a block.
    pairs: Vec<Pair>,
}

impl Part {
    /// An empty part.
    pub fn new(trees: usize) -> Self {
        let tables = || (0..trees).map(|_| Table::default()).collect();
        Self { cells: [tables(), tables()], pairs: Pairs::default() }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.pairs.bytes() + self.cells.iter().flatten().map(Table::bytes).sum::<usize>()
    }

    /// Adds a block's paths, with what arrives at their second vertices; how many stay unfiltered.
    pub fn add(
        &mut self,
        records: &[PathRecord],
        suffixes: &Suffixes<'_>,
        rules: &Rules<'_>,
        batch: &mut Batch,
    ) -> u64 {
        if records.is_empty() {
            return 0;
        }
        let mut unfiltered = 0;
        self.cells.iter().flatten().for_each(Table::warm);
        self.pairs.begin_block(std::mem::take(&mut batch.pairs));
        for (first, records) in (0..).step_by(Places::MOST).zip(records.chunks(Places::MOST)) {
            batch.gather(records, |path| suffixes.get(first + path, &records[path]), rules, &mut self.pairs);
            for (tree, grid) in rules.grids.iter().enumerate() {
                grid.leaves(&batch.places, &mut batch.leaves);
                for (shares, cells) in batch.shares.iter_mut().zip(&mut self.cells) {
                    deposit(shares, &batch.leaves, tree as u32, &mut cells[tree]);
                }
            }
            unfiltered += batch.read(records, rules, &mut self.pairs);
        }
        batch.pairs = self.pairs.end_block();
        unfiltered
    }
}

impl Batch {
    /// Finds out what the paths bring, and where.
    fn gather(&mut self, records: &[PathRecord], suffix: impl Fn(usize) -> Vec3, rules: &Rules<'_>, pairs: &mut Pairs) {
        self.shares.iter_mut().for_each(Vec::clear);
        self.unfiltered.clear();
        self.places.clear();
        let finest = rules.grids[0].finest();
        for (path, record) in records.iter().enumerate() {
            place(&mut self.places, &record.first, rules.params.leaf, finest);
            let (exists, suffix) = (record.first.exists(), suffix(path));
            let tree = u32::from(record.sample()) % rules.grids.len() as u32;
            let path = path as u32;
            let mut share = |lobe: &Lobe, kind: PairLobe, bin: u8| {
                let (incident, throughput) = (lobe.incident(suffix), lobe.throughput.get());
                match rules.quantum.deposit(incident, 1.0).filter(|_| exists) {
                    Some(deposit) => {
                        let share =
                            Share { path, tree, read: NOWHERE, bin, lost: false, deposit, throughput, incident };
                        self.shares[kind as usize].push(share);
                    }
                    None => {
                        self.unfiltered.push(path);
                        pairs.add_unfiltered(record.slot, kind, throughput * incident, rules.quantum);
                    }
                }
                throughput * incident
            };
            if !record.diffuse.is_black() {
                share(&record.diffuse, PairLobe::Diffuse, 0);
            }
            if !record.glossy.is_black() {
                let radiance = share(&record.glossy, PairLobe::Glossy, record.first.bin());
                pairs.add_own(record.slot, record.odd(), radiance, rules.quantum);
            }
        }
    }

    /// Says which slots read which cells; how many paths stay unfiltered.
    fn read(&mut self, records: &[PathRecord], rules: &Rules<'_>, pairs: &mut Pairs) -> u64 {
        for (shares, kind) in self.shares.iter().zip([PairLobe::Diffuse, PairLobe::Glossy]) {
            for share in shares {
                let slot = records[share.path as usize].slot;
                let (throughput, incident) = (share.throughput, share.incident);
                if share.read == NOWHERE || !pairs.add(slot, kind, share.tree, share.read, throughput) {
                    self.unfiltered.push(share.path);
                    pairs.add_unfiltered(slot, kind, throughput * incident, rules.quantum);
                }
            }
        }
        self.unfiltered.sort_unstable();
        self.unfiltered.dedup();
        self.unfiltered.len() as u64
    }
}

/// Adds shares to their cells of one tree.
fn deposit(shares: &mut [Share], leaves: &[LeafCell], tree: u32, cells: &mut Table<LeafCell>) {
    for share in shares {
        let leaf = leaves[share.path as usize];
        // A place at the very border of the extent may have cells in some trees only: it is deposited in the first of
        // those, and the path reads its own light.
        if !leaf.exists() || share.lost {
            (share.lost, share.read) = (true, NOWHERE);
            continue;
        }
        let cell = cells.cell(leaf.with_bin(share.bin));
        cells.add(cell, &share.deposit);
        share.read = if share.tree == tree { cell } else { share.read };
    }
}

/// No cell's number.
const NOWHERE: u32 = u32::MAX;
