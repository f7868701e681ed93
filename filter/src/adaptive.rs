//! The adaptive filter: cells as fine as the samples can tell apart.

use glam::Vec3;
use rayon::prelude::*;

use crate::grid::{Anchor, Grid, LeafCell, Place};
use crate::pairs::{Lobe as PairLobe, Pair, Pairs};
use crate::record::{Lobe, PathRecord, Vertex};
use crate::shrink::{Shrinkage, estimate};
use crate::snapshot::{Snapshot, SnapshotError};
use crate::sums::{Deposit, LUMINANCE, Quantum};
use crate::table::{CellIndex, PerCell, ShardedTable, Table};

/// Settings. The defaults are measured, not derived.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    /// Shifted trees at the first vertex, at most 8: deposits go to all, each path reads one.
    pub trees: u32,
    /// Shifted trees at the second vertex: each path reads all.
    pub second_trees: u32,
    /// Finest cells at the first vertex are a quarter to one of this wide, in footprints.
    pub leaf: f32,
    /// The same at the second vertex.
    pub second_leaf: f32,
    /// When differences between cells are believed.
    pub shrinkage: Shrinkage,
    /// Samples of a slot over which second vertices share; 0: all. Sums of filters that saw different epochs add up to those
    /// of one that saw all; within an epoch each block profits from those before it.
    pub epoch: u64,
    /// Radiance of the order of the frame's mean: see [`Quantum`].
    pub unit: f32,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            trees: 4,
            second_trees: 1,
            leaf: 4.0,
            second_leaf: 16.0,
            shrinkage: Shrinkage { tau: 2.5, trusted: 24.0, levels: 4 },
            epoch: 0,
            unit: 1.0,
        }
    }
}

/// What a slot gets. All are sums over its paths of what they bring, weighted as their throughputs are.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Resolved {
    /// Through diffuse lobes, filtered, and all of paths that no cell could take.
    pub diffuse: Vec3,
    /// Through glossy lobes, filtered.
    pub glossy: Vec3,
    /// Through glossy lobes with only the second vertices filtered: of even samples and of odd ones.
    pub glossy_own: [Vec3; 2],
}

/// Counts of what the filter did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Paths with a selected vertex.
    pub paths: u64,
    /// Paths that no cell could take: radiance out of range or a place without a cell. They stay unfiltered.
    pub unfiltered: u64,
    /// Cells of all trees at the first vertex.
    pub cells: u64,
    /// Cells of all trees at the second vertex, in the last epoch.
    pub second_cells: u64,
    /// Pairs of slot and cell.
    pub pairs: u64,
    /// Bytes held between blocks.
    pub bytes: u64,
}

/// A tree of cells with a place for each vertex.
#[derive(Debug)]
struct Tree {
    grid: Grid,
    cells: ShardedTable,
}

impl Tree {
    fn several(anchor: &Anchor, count: u32) -> Vec<Self> {
        (0..count).map(|index| Self { grid: Grid::new(anchor, index, count), cells: ShardedTable::default() }).collect()
    }
}

/// A vertex as grids see it, with finest cells of `side` footprints.
#[inline]
fn place(vertex: &Vertex, side: f32, bin: u8) -> Place {
    let attributes = u64::from(vertex.surface()) << 8 | u64::from(bin);
    Place::new(vertex.p, vertex.n.direction(), side * vertex.footprint.get(), attributes)
}

/// Sums over all paths so far.
#[derive(Debug)]
pub struct Adaptive {
    params: Params,
    quantum: Quantum,
    diffuse: Vec<Tree>,
    glossy: Vec<Tree>,
    second: Vec<Tree>,
    /// By part.
    pairs: Vec<Pairs>,
    /// Number of the current epoch, once there is one.
    epoch: Option<u64>,
    report: Report,
}

impl Adaptive {
    /// An empty filter over `parts` disjoint sets of slots.
    ///
    /// # Panics
    /// If a number of trees is not from 1 to 8.
    pub fn new(params: &Params, anchor: &Anchor, parts: usize) -> Self {
        let counts = [params.trees, params.second_trees];
        assert!(counts.iter().all(|count| (1..=8).contains(count)), "trees: {counts:?}");
        Self {
            params: *params,
            quantum: Quantum::new(params.unit),
            diffuse: Tree::several(anchor, params.trees),
            glossy: Tree::several(anchor, params.trees),
            second: Tree::several(anchor, params.second_trees),
            pairs: (0..parts).map(|_| Pairs::default()).collect(),
            epoch: None,
            report: Report::default(),
        }
    }

    /// Says which samples of the slots the next block holds, by the first of them. Second vertices share within epochs of
    /// [`Params::epoch`] samples.
    pub fn begin_block(&mut self, first_sample: u64) {
        let epoch = first_sample.checked_div(self.params.epoch).unwrap_or(0);
        if self.epoch.replace(epoch).is_some_and(|last| last != epoch) {
            self.begin_epoch();
        }
    }

    /// Forgets what second vertices shared: those of the blocks to come share among themselves.
    pub fn begin_epoch(&mut self) {
        self.second.iter_mut().for_each(|tree| tree.cells.clear());
    }

    /// Adds a block of paths, by part. A slot belongs to one part for good.
    ///
    /// Second vertices share with those of the block and of all blocks before it in the epoch.
    ///
    /// # Panics
    /// If there are not as many parts as were announced.
    pub fn add(&mut self, parts: &[Vec<PathRecord>]) {
        assert_eq!(parts.len(), self.pairs.len(), "parts of a block");
        let suffixes = self.suffixes(parts);
        let unfiltered: Vec<u64> = (&mut self.pairs, parts, &suffixes)
            .into_par_iter()
            .map_init(
                || FirstVertices::new(&self.params, &self.quantum, &self.diffuse, &self.glossy),
                |block, (pairs, records, suffixes)| {
                    for (record, &suffix) in records.iter().zip(suffixes) {
                        block.add(record, suffix, pairs);
                    }
                    block.finish(pairs)
                },
            )
            .collect();
        self.report.paths += parts.iter().map(|records| records.len() as u64).sum::<u64>();
        self.report.unfiltered += unfiltered.iter().sum::<u64>();
    }

    /// What arrives at the second vertex of each path, filtered over the block.
    fn suffixes(&mut self, parts: &[Vec<PathRecord>]) -> Vec<Vec<Vec3>> {
        let trees = &self.second;
        let places: Vec<Vec<Option<CellIndex>>> = parts
            .par_iter()
            .map(|records| second_vertices(records, trees, self.params.second_leaf, &self.quantum))
            .collect();
        let estimates: Vec<PerCell<[f32; 3]>> = self
            .second
            .par_iter_mut()
            .map(|tree| estimate(&mut tree.cells, &self.quantum, &self.params.shrinkage))
            .collect();
        let share = (estimates.len() as f32).recip();
        let suffixes = parts
            .par_iter()
            .zip(&places)
            .map(|(records, places)| {
                let read = |(i, record): (usize, &PathRecord)| {
                    let mut mean = Vec3::ZERO;
                    for (tree, places) in estimates.iter().zip(places.chunks_exact(records.len())) {
                        // A vertex that no cell took keeps its own light.
                        let Some(place) = places[i] else { return record.suffix.get() };
                        mean += Vec3::from_array(tree.get(place));
                    }
                    mean * share
                };
                records.iter().enumerate().map(read).collect()
            })
            .collect();
        self.report.second_cells = self.second.iter_mut().map(|tree| tree.cells.len() as u64).sum();
        suffixes
    }

    /// All sums so far, the same whoever met which cell first.
    pub fn snapshot(&mut self) -> Snapshot {
        let mut snapshot = Snapshot { paths: [self.report.paths, self.report.unfiltered], ..Snapshot::default() };
        let mut numbers = Vec::new();
        for tree in self.diffuse.iter_mut().chain(&mut self.glossy) {
            let mut cells: Vec<_> = tree.cells.cells().collect();
            cells.sort_unstable_by_key(|(_, key, _)| *key);
            let mut number = PerCell::new(&mut tree.cells);
            cells.iter().zip(0u32..).for_each(|((place, ..), at)| number.set(*place, at));
            snapshot.trees.push(cells.into_iter().map(|(_, key, sums)| (key, sums)).collect());
            numbers.push(number);
        }
        for pairs in &mut self.pairs {
            let (pairs, own) = pairs.parts();
            let mut pairs: Vec<Pair> = pairs
                .iter()
                .map(|pair| pair.with_cell(numbers[pair.tree_of(numbers.len())].get(pair.index() as u32)))
                .collect();
            pairs.sort_unstable_by_key(Pair::order);
            snapshot.pairs.push(pairs);
            snapshot.own.push(own.to_vec());
        }
        snapshot
    }

    /// Adds the sums of another filter over the same frame. Exact: the order of additions does not count.
    ///
    /// # Errors
    /// The other has other trees or parts; then nothing was added.
    pub fn absorb(&mut self, other: &Snapshot) -> Result<(), SnapshotError> {
        let trees = self.diffuse.len() + self.glossy.len();
        if other.trees.len() != trees || other.pairs.len() != self.pairs.len() || other.own.len() != self.pairs.len() {
            return Err(SnapshotError::Mismatch);
        }
        let mut places: Vec<Vec<CellIndex>> = Vec::with_capacity(trees);
        for (tree, cells) in self.diffuse.iter_mut().chain(&mut self.glossy).zip(&other.trees) {
            places.push(cells.iter().map(|(key, sums)| tree.cells.add_sums(*key, sums)).collect());
        }
        for ((mine, pairs), own) in self.pairs.iter_mut().zip(&other.pairs).zip(&other.own) {
            mine.absorb(pairs.iter().map(|pair| pair.with_cell(places[pair.tree_of(trees)][pair.index()])), own);
        }
        self.report.paths += other.paths[0];
        self.report.unfiltered += other.paths[1];
        Ok(())
    }

    /// What each slot of each part gets from all paths so far; slots without a path are left out.
    pub fn resolve(&mut self) -> Vec<Vec<(u32, Resolved)>> {
        let (quantum, shrinkage) = (&self.quantum, &self.params.shrinkage);
        let estimates = |trees: &mut Vec<Tree>| -> Vec<PerCell<[f32; 3]>> {
            trees.par_iter_mut().map(|tree| estimate(&mut tree.cells, quantum, shrinkage)).collect()
        };
        let (diffuse, glossy) = (estimates(&mut self.diffuse), estimates(&mut self.glossy));
        let read = |lobe: PairLobe, tree: usize, cell: CellIndex| match lobe {
            PairLobe::Diffuse => diffuse[tree].get(cell),
            PairLobe::Glossy => glossy[tree].get(cell),
        };
        self.pairs.par_iter_mut().map(|pairs| pairs.resolve(quantum, read)).collect()
    }

    /// What was done so far.
    pub fn report(&mut self) -> Report {
        let trees = self.diffuse.iter_mut().chain(&mut self.glossy);
        let (mut cells, mut bytes) = (0, 0);
        for tree in trees {
            cells += tree.cells.len() as u64;
            bytes += tree.cells.bytes() as u64;
        }
        let pairs = self.pairs.iter().map(|pairs| pairs.len() as u64).sum();
        bytes += self.pairs.iter().map(|pairs| pairs.bytes() as u64).sum::<u64>();
        Report { cells, pairs, bytes, ..self.report }
    }
}

/// Deposits the second vertices of a part; places of the cells, tree by tree.
fn second_vertices(records: &[PathRecord], trees: &[Tree], side: f32, quantum: &Quantum) -> Vec<Option<CellIndex>> {
    let mut places = vec![None; records.len() * trees.len()];
    let deposits: Vec<Option<(Place, Deposit)>> = records
        .iter()
        .map(|record| {
            let deposit = quantum.deposit(record.suffix.get(), weight(record))?;
            record.second.exists().then(|| (place(&record.second, side, 0), deposit))
        })
        .collect();
    let mut keyed = Vec::with_capacity(records.len());
    for (tree, places) in trees.iter().zip(places.chunks_exact_mut(records.len().max(1))) {
        keyed.clear();
        keyed.extend(deposits.iter().map(|deposit| {
            let (place, deposit) = deposit.as_ref()?;
            Some((tree.grid.leaf(place)?, *deposit))
        }));
        tree.cells.add(&keyed, places);
    }
    places
}

/// What light at the second vertex counts for in the slot: as weights of the mean over a cell these keep its energy, for
/// the sum of weight × mean is that of weight × own.
fn weight(record: &PathRecord) -> f32 {
    let through = |lobe: &Lobe| lobe.throughput.get() * lobe.transfer.get();
    (through(&record.diffuse) + through(&record.glossy)).dot(LUMINANCE.as_vec3()).abs()
}

/// The first vertices of a part of a block, gathered in small tables before they go to the large ones: neighbouring
/// pixels share cells, so this saves most of the way to memory.
struct FirstVertices<'a> {
    params: &'a Params,
    quantum: &'a Quantum,
    diffuse: Vec<(&'a Tree, Table<LeafCell>)>,
    glossy: Vec<(&'a Tree, Table<LeafCell>)>,
    /// Places of a small table's cells in the large one.
    indices: Vec<CellIndex>,
    unfiltered: u64,
}

impl<'a> FirstVertices<'a> {
    fn new(params: &'a Params, quantum: &'a Quantum, diffuse: &'a [Tree], glossy: &'a [Tree]) -> Self {
        let local = |trees: &'a [Tree]| trees.iter().map(|tree| (tree, Table::default())).collect();
        Self { params, quantum, diffuse: local(diffuse), glossy: local(glossy), indices: Vec::new(), unfiltered: 0 }
    }

    fn add(&mut self, record: &PathRecord, suffix: Vec3, pairs: &mut Pairs) {
        let glossy = record.glossy.incident(suffix);
        if !record.glossy.is_black() {
            pairs.add_own(record.slot, record.odd(), record.glossy.throughput.get() * glossy, self.quantum);
        }
        let mut kept = true;
        for (lobe, incident, trees, kind) in [
            (&record.diffuse, record.diffuse.incident(suffix), &mut self.diffuse, PairLobe::Diffuse),
            (&record.glossy, glossy, &mut self.glossy, PairLobe::Glossy),
        ] {
            if lobe.is_black() {
                continue;
            }
            let bin = if kind == PairLobe::Glossy { record.first.bin() } else { 0 };
            let cell = self.quantum.deposit(incident, 1.0).filter(|_| record.first.exists()).and_then(|deposit| {
                deposit_in_all(trees, &place(&record.first, self.params.leaf, bin), record.sample(), &deposit)
            });
            let throughput = lobe.throughput.get();
            match cell {
                Some((tree, cell)) if pairs.add(record.slot, kind, tree, cell, throughput) => {}
                _ => {
                    kept = false;
                    pairs.add_unfiltered(record.slot, kind, throughput * incident, self.quantum);
                }
            }
        }
        self.unfiltered += u64::from(!kept);
    }

    /// Moves everything to the large tables; how many paths stay unfiltered.
    fn finish(&mut self, pairs: &mut Pairs) -> u64 {
        for (kind, trees) in [(PairLobe::Diffuse, &mut self.diffuse), (PairLobe::Glossy, &mut self.glossy)] {
            for (at, (tree, local)) in (0..).zip(trees) {
                tree.cells.merge(local, &mut self.indices);
                pairs.renumber(kind, at, &self.indices);
                local.clear();
            }
        }
        pairs.end_block();
        std::mem::take(&mut self.unfiltered)
    }
}

/// Adds to a cell of every tree; the tree that the path reads, and the number of its cell there.
#[inline]
fn deposit_in_all(
    trees: &mut [(&Tree, Table<LeafCell>)],
    place: &Place,
    sample: u8,
    deposit: &Deposit,
) -> Option<(u32, u32)> {
    let read = u32::from(sample) % trees.len() as u32;
    let mut found = None;
    // A place at the very border of the extent may have cells in some trees only: it is deposited in the first of
    // those, and the path reads its own light.
    for (at, (tree, local)) in (0..).zip(trees.iter_mut()) {
        let cell = local.cell(tree.grid.leaf(place)?);
        local.add(cell, deposit);
        if at == read {
            found = Some((read, cell));
        }
    }
    found
}

#[cfg(test)]
#[path = "adaptive_tests.rs"]
mod tests;
