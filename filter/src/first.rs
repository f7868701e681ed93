//! First vertices of the paths of a part of the slots: its cells, and which slots read them.

use glam::Vec3;

use crate::adaptive::{Params, place};
use crate::grid::{Grid, LeafCell, Place};
use crate::pairs::{Lobe as PairLobe, Pairs};
use crate::record::{Lobe, PathRecord};
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
    bin: u8,
    incident: Vec3,
    /// `None`: no cell takes it.
    deposit: Option<Deposit>,
    /// The cell that the path reads.
    read: u32,
}

/// Paths that are worked on together, one tree after the other, so that a tree's cells stay in the cache.
const BATCH: usize = 256;

/// Room for a batch, to be used again.
#[derive(Default)]
pub(crate) struct Batch {
    places: Vec<Place>,
    leaves: Vec<Option<LeafCell>>,
    shares: [Vec<Share>; 2],
    /// Whether all of a path's light went to cells.
    taken: Vec<bool>,
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

    /// Adds a block's paths, at whose second vertices `suffixes` arrive; how many stay unfiltered.
    pub fn add(&mut self, records: &[PathRecord], suffixes: &[Vec3], rules: &Rules<'_>, batch: &mut Batch) -> u64 {
        let mut unfiltered = 0;
        for (records, suffixes) in records.chunks(BATCH).zip(suffixes.chunks(BATCH)) {
            batch.gather(records, suffixes, rules, &mut self.pairs);
            for (tree, grid) in rules.grids.iter().enumerate() {
                batch.deposit(tree, grid, rules.grids.len(), records, &mut self.cells);
            }
            unfiltered += batch.read(records, rules, &mut self.pairs);
        }
        self.pairs.end_block();
        unfiltered
    }
}

impl Batch {
    /// Finds out what the paths bring, and where.
    fn gather(&mut self, records: &[PathRecord], suffixes: &[Vec3], rules: &Rules<'_>, pairs: &mut Pairs) {
        self.shares.iter_mut().for_each(Vec::clear);
        self.places.clear();
        self.places.extend(records.iter().map(|record| place(&record.first, rules.params.leaf, 0)));
        self.taken.clear();
        self.taken.resize(records.len(), true);
        for ((path, record), &suffix) in (0..).zip(records).zip(suffixes) {
            let exists = record.first.exists();
            let mut share = |lobe: &Lobe, kind: PairLobe, bin: u8| {
                let incident = lobe.incident(suffix);
                let deposit = if exists { rules.quantum.deposit(incident, 1.0) } else { None };
                self.shares[kind as usize].push(Share { path, bin, incident, deposit, read: NOWHERE });
                incident
            };
            if !record.diffuse.is_black() {
                share(&record.diffuse, PairLobe::Diffuse, 0);
            }
            if !record.glossy.is_black() {
                let incident = share(&record.glossy, PairLobe::Glossy, record.first.bin());
                pairs.add_own(record.slot, record.odd(), record.glossy.throughput.get() * incident, rules.quantum);
            }
        }
    }

    /// Adds all shares to their cells of one tree, of which there are `trees`. Both lobes have the same grid.
    fn deposit(
        &mut self,
        tree: usize,
        grid: &Grid,
        trees: usize,
        records: &[PathRecord],
        cells: &mut [Vec<Table<LeafCell>>; 2],
    ) {
        self.leaves.clear();
        self.leaves.extend(self.places.iter().map(|place| grid.leaf(place)));
        for (shares, cells) in self.shares.iter_mut().zip(cells) {
            let cells = &mut cells[tree];
            for share in shares {
                let Some(deposit) = &share.deposit else { continue };
                // A place at the very border of the extent may have cells in some trees only: it is deposited in the
                // first of those, and the path reads its own light.
                let Some(leaf) = self.leaves[share.path as usize] else {
                    (share.deposit, share.read) = (None, NOWHERE);
                    continue;
                };
                let cell = cells.cell(leaf.with_bin(share.bin));
                cells.add(cell, deposit);
                if usize::from(records[share.path as usize].sample()) % trees == tree {
                    share.read = cell;
                }
            }
        }
    }

    /// Says which slots read which cells; how many paths stay unfiltered.
    fn read(&mut self, records: &[PathRecord], rules: &Rules<'_>, pairs: &mut Pairs) -> u64 {
        for (shares, kind) in self.shares.iter().zip([PairLobe::Diffuse, PairLobe::Glossy]) {
            for share in shares {
                let record = &records[share.path as usize];
                let throughput = match kind {
                    PairLobe::Diffuse => record.diffuse.throughput,
                    PairLobe::Glossy => record.glossy.throughput,
                };
                let throughput = throughput.get();
                let tree = u32::from(record.sample()) % rules.grids.len() as u32;
                if share.read == NOWHERE || !pairs.add(record.slot, kind, tree, share.read, throughput) {
                    self.taken[share.path as usize] = false;
                    pairs.add_unfiltered(record.slot, kind, throughput * share.incident, rules.quantum);
                }
            }
        }
        self.taken.iter().map(|taken| u64::from(!taken)).sum()
    }
}

/// No cell's number.
const NOWHERE: u32 = u32::MAX;
