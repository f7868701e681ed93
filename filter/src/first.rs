//! First vertices of the paths of a part of the slots: its cells, and which slots read them.

use glam::Vec3;

use crate::adaptive::{Params, place};
use crate::cell::PlainCell;
use crate::grid::{Grid, LeafCell, Places};
use crate::hash::mix64;
use crate::pairs::{Lobe as PairLobe, Pair, Pairs};
use crate::record::{Lobe, PathRecord};
use crate::second::Suffixes;
use crate::sums::{Deposit, Quantum};
use crate::table::Table;

/// What the paths of a part left. A cell at a border is in several parts, each with its own share of the sums.
#[derive(Debug)]
pub(crate) struct Part {
    /// By lobe and tree.
    pub cells: [Vec<Table<PlainCell>>; 2],
    pub pairs: Pairs,
}

/// What all parts deposit by.
pub(crate) struct Rules<'a> {
    pub params: &'a Params,
    /// Width of leaves, in footprints.
    pub leaf: f32,
    pub quantum: &'a Quantum,
    pub grids: &'a [Grid],
}

/// A path's light in one lobe, on its way to the cells.
struct Share {
    /// Number of the path in its batch.
    path: u32,
    bin: u8,
    /// A tree without a cell was met: the others after it get nothing, and the path reads its own light.
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
    /// The cells that those were put into, by lobe and tree.
    cells: [Vec<Vec<u32>>; 2],
    /// Paths of which some light went to no cell.
    unfiltered: Vec<u32>,
    /// For the pairs of a block, and of all blocks.
    pairs: [Vec<Pair>; 2],
}

impl Rules<'_> {
    /// How many trees a path reads.
    fn reads(&self) -> usize {
        (self.params.reads as usize).clamp(1, self.grids.len())
    }
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
        self.pairs.begin_block(std::mem::take(&mut batch.pairs[0]));
        for (first, records) in (0..).step_by(Places::MOST).zip(records.chunks(Places::MOST)) {
            batch.gather(records, |path| suffixes.get(first + path, &records[path]), rules, &mut self.pairs);
            for (tree, grid) in rules.grids.iter().enumerate() {
                grid.leaves(&batch.places, &mut batch.leaves);
                for ((shares, cells), table) in batch.shares.iter_mut().zip(&mut batch.cells).zip(&mut self.cells) {
                    deposit(shares, &batch.leaves, &mut table[tree], &mut cells[tree]);
                }
            }
            unfiltered += batch.read(records, rules, &mut self.pairs);
        }
        batch.pairs[0] = self.pairs.end_block(&mut batch.pairs[1]);
        unfiltered
    }
}

impl Batch {
    /// Finds out what the paths bring, and where.
    fn gather(&mut self, records: &[PathRecord], suffix: impl Fn(usize) -> Vec3, rules: &Rules<'_>, pairs: &mut Pairs) {
        self.shares.iter_mut().for_each(Vec::clear);
        self.unfiltered.clear();
        self.places.clear();
        self.cells.iter_mut().for_each(|cells| cells.resize(rules.grids.len(), Vec::new()));
        let finest = rules.grids[0].finest();
        for (path, record) in records.iter().enumerate() {
            place(&mut self.places, &record.first, rules.leaf, finest);
            let (exists, suffix) = (record.first.exists(), suffix(path));
            let path = path as u32;
            let mut share = |lobe: &Lobe, kind: PairLobe, bin: u8| {
                let (incident, throughput) = (lobe.incident(suffix), lobe.throughput.get());
                match rules.quantum.deposit(incident, 1.0).filter(|_| exists) {
                    Some(deposit) => {
                        let share = Share { path, bin, lost: false, deposit, throughput, incident };
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
        let (trees, reads) = (rules.grids.len(), rules.reads());
        let part = (reads as f32).recip();
        for ((shares, cells), kind) in self.shares.iter().zip(&self.cells).zip([PairLobe::Diffuse, PairLobe::Glossy]) {
            for (at, share) in shares.iter().enumerate() {
                let record = &records[share.path as usize];
                let (slot, throughput) = (record.slot, share.throughput);
                let first = first_tree(slot, record.sample(), trees, reads);
                let read = !share.lost
                    && (first..first + reads).map(|tree| tree % trees).all(|tree| {
                        // Whether it can be held depends on the throughput alone: it is held of all trees or of none.
                        pairs.add(slot, kind, tree as u32, cells[tree][at], throughput * part)
                    });
                if !read {
                    self.unfiltered.push(share.path);
                    pairs.add_unfiltered(slot, kind, throughput * share.incident, rules.quantum);
                }
            }
        }
        self.unfiltered.sort_unstable();
        self.unfiltered.dedup();
        self.unfiltered.len() as u64
    }
}

/// The first of the trees that a path reads. The samples of a slot take turns, and slots begin anywhere, so that what cells
/// are wrong by does not show as their shape.
pub(crate) fn first_tree(slot: u32, sample: u8, trees: usize, reads: usize) -> usize {
    let turn = mix64(slot.into()) % trees as u64;
    (turn as usize + reads * usize::from(sample)) % trees
}

/// Adds shares to their cells of one tree, and says which those are.
fn deposit(shares: &mut [Share], leaves: &[LeafCell], table: &mut Table<PlainCell>, cells: &mut Vec<u32>) {
    cells.clear();
    cells.extend(shares.iter_mut().map(|share| {
        let leaf = leaves[share.path as usize];
        // A place at the very border of the extent may have cells in some trees only: it is deposited in the first of those.
        share.lost |= !leaf.exists();
        if share.lost {
            return NOWHERE;
        }
        let cell = table.cell(leaf.with_bin(share.bin));
        table.add(cell, &share.deposit);
        cell
    }));
}

/// No cell's number.
const NOWHERE: u32 = u32::MAX;
