//! The adaptive filter: cells as fine as the samples can tell apart.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use crate::cell::PlainCell;
use crate::first::{self, Part, Rules};
use crate::grid::{Anchor, Grid, Places};
use crate::pairs::Lobe as PairLobe;
use crate::record::{PathRecord, Vertex};
use crate::second::{self, SecondVertices, Suffixes};
use crate::shards::{Means, ShardedTable};
use crate::shrink::{Estimates, Shrinkage, estimate};
use crate::sides::Sides;
use crate::sums::Quantum;
use crate::table::Table;

/// Settings. The defaults are measured, not derived; they are those for 16 samples a slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    /// Shifted trees at the first vertex, at most 8: deposits go to all.
    pub trees: u32,
    /// How many of them each path reads, at least one and at most all. The mean over trees shows no cells' borders, but what is
    /// read must be remembered; a slot's samples take turns.
    pub reads: u32,
    /// Shifted trees at the second vertex: each path reads all.
    pub second_trees: u32,
    /// Finest cells at the first vertex are a quarter to one of this wide, in footprints.
    pub leaf: f32,
    /// The same of all cells at the second vertex.
    pub second_leaf: f32,
    /// When differences between cells are believed.
    pub shrinkage: Shrinkage,
    /// Samples of a slot over which second vertices share; 0: all. Sums of filters that saw different epochs add up to those
    /// of one that saw all; within an epoch each block profits from those before it.
    pub epoch: u64,
    /// How many samples there will be is not known: each epoch after the first ends with twice as many as the one before,
    /// and leaves, which are those of the first, shrink as [`Self::for_samples`] has them shrink.
    pub growing: bool,
    /// Radiance of the order of the frame's mean: see [`Quantum`].
    pub unit: f32,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            trees: 4,
            reads: 1,
            second_trees: 1,
            leaf: 4.0,
            second_leaf: 32.0,
            shrinkage: Shrinkage { certain: 2.5, inherited: 0.125, trusted: 24.0, levels: 8 },
            epoch: 0,
            growing: false,
            unit: 1.0,
        }
    }
}

impl Params {
    /// Settings for so many samples of each slot, with leaves as fine as they can tell apart and memory allows.
    ///
    /// Bias vanishes if cells shrink as samples grow, and noise if they shrink more slowly than samples grow in number. The
    /// side of first vertices' leaves shrinks with the cube root of the samples, from 16 samples on and down to one
    /// footprint: against the eighth root this takes 2 to 29 % off the squared error of four of five scenes at 256 samples,
    /// adds 3 % to that of one, and keeps the shade below a plate that is narrower than a wider leaf. Of second vertices there
    /// is one epoch at a time, which grows with the samples, and nothing tells noise from signal: up to 256 samples the area
    /// of their cells shrinks with the samples, so that a cell keeps its number of paths. From there on it shrinks by more,
    /// which costs squared error by at most a fifth at 1024 samples in three small scenes, and brings bias below half of the
    /// error in all of them.
    ///
    /// A slot of few samples makes eight reads of trees, or all: against one a sample this takes 15 to 23 % off the squared
    /// error of four scenes at one sample, 4 to 11 % at 4. At 16 samples two reads each would take 2 to 7 % off, and the time
    /// that took them would too.
    pub fn for_samples(samples: u64) -> Self {
        // In f64, so that other libraries' last bits are not seen.
        let fewer = |most: f64, power: f64| (most / samples as f64).min(1.0).powf(power) as f32;
        let leaf = (4.0 * fewer(16.0, 1.0 / 3.0)).max(1.0);
        let second_leaf = (32.0 * fewer(16.0, 0.5) * fewer(256.0, 0.75)).max(1.0);
        let reads = (8 / samples.max(1)).max(1) as u32;
        Self { reads, leaf, second_leaf, ..Self::default() }
    }

    /// The epoch of a sample, from its first to one past its last.
    pub fn epoch(&self, sample: u64) -> Range<u64> {
        match (self.epoch, self.growing) {
            (0, _) => 0..u64::MAX,
            (first, true) if sample < first => 0..first,
            (first, true) => {
                let begin = first << (sample / first).ilog2();
                begin..begin.saturating_mul(2)
            }
            (length, false) => {
                let begin = sample - sample % length;
                begin..begin.saturating_add(length)
            }
        }
    }

    /// Leaves at first and second vertices in the epoch of a sample.
    fn leaves(&self, sample: u64) -> [f32; 2] {
        if !self.growing {
            return [self.leaf, self.second_leaf];
        }
        let [first, now] = [0, sample].map(|sample| Self::for_samples(self.epoch(sample).end));
        [self.leaf * (now.leaf / first.leaf), self.second_leaf * (now.second_leaf / first.second_leaf)]
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

/// A tree of cells of second vertices.
#[derive(Debug)]
pub(crate) struct Tree {
    pub grid: Grid,
    pub cells: ShardedTable,
}

/// What the pairs of a part read from the estimates of all trees, diffuse and then glossy.
fn reader(estimates: &[Estimates], trees: usize, part: usize) -> impl Fn(PairLobe, usize, u32) -> [f32; 3] + '_ {
    move |lobe, tree, cell| estimates[lobe as usize * trees + tree][part][cell as usize]
}

/// The grids of several trees.
fn grids(anchor: &Anchor, count: u32) -> impl Iterator<Item = Grid> {
    (0..count).map(move |index| Grid::new(anchor, index, count))
}

/// Adds a vertex to places, with finest cells of `side` footprints and a bin of 0.
#[inline]
pub(crate) fn place(places: &mut Places, vertex: &Vertex, side: f32, finest: i32) {
    let attributes = u64::from(vertex.surface()) << 8;
    places.push(vertex.p, vertex.n.direction(), side * vertex.footprint.get(), finest, attributes);
}

/// Sums over all paths so far.
#[derive(Debug)]
pub struct Adaptive {
    pub(crate) params: Params,
    quantum: Quantum,
    /// Of first vertices, in both lobes.
    grids: Vec<Grid>,
    pub(crate) second: Vec<Tree>,
    pub(crate) parts: Vec<Part>,
    /// First sample of the current epoch, once there is one.
    epoch: Option<u64>,
    /// Leaves of the current epoch, see [`Params::leaf`] and [`Params::second_leaf`].
    leaves: [f32; 2],
    /// Different cells at the first vertex, once they were counted.
    cells: Option<u64>,
    pub(crate) report: Report,
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
            grids: grids(anchor, params.trees).collect(),
            second: grids(anchor, params.second_trees)
                .map(|grid| Tree { grid, cells: ShardedTable::default() })
                .collect(),
            parts: (0..parts).map(|_| Part::new(params.trees as usize)).collect(),
            epoch: None,
            leaves: params.leaves(0),
            cells: None,
            report: Report::default(),
        }
    }

    /// Says which samples of the slots the next block holds, by the first of them. Second vertices share within
    /// [`Params::epoch`].
    pub fn begin_block(&mut self, first_sample: u64) {
        let epoch = self.params.epoch(first_sample).start;
        self.leaves = self.params.leaves(first_sample);
        if self.epoch.replace(epoch).is_some_and(|last| last != epoch) {
            self.begin_epoch();
        }
    }

    /// Forgets what second vertices shared: those of the blocks to come share among themselves.
    pub fn begin_epoch(&mut self) {
        self.second.iter().for_each(|tree| tree.cells.clear());
    }

    /// Adds a block of paths, by part. A slot belongs to one part for good.
    ///
    /// Second vertices share with those of the block and of all blocks before it in the epoch.
    ///
    /// # Panics
    /// If there are not as many parts as were announced.
    pub fn add(&mut self, parts: &[Vec<PathRecord>]) {
        self.add_each(parts.iter().collect(), false);
    }

    /// The same of the last block: gives memory back as it goes, so that what grows has room. If its epoch `ends` with it, all
    /// that second vertices share goes too.
    ///
    /// # Panics
    /// As [`Self::add`].
    pub fn add_last(&mut self, parts: Vec<Vec<PathRecord>>, ends: bool) {
        self.add_each(parts, ends);
    }

    /// Adds records that are dropped part by part if they are owned.
    fn add_each<R: AsRef<[PathRecord]> + Send + Sync>(&mut self, parts: Vec<R>, ends: bool) {
        assert_eq!(parts.len(), self.parts.len(), "parts of a block");
        let (vertices, means) = self.share(&parts);
        if ends {
            self.report.bytes = self.bytes();
            self.second.iter_mut().for_each(|tree| tree.cells = ShardedTable::default());
        }
        self.report.paths += parts.iter().map(|records| records.as_ref().len() as u64).sum::<u64>();
        let rules = Rules { params: &self.params, leaf: self.leaves[0], quantum: &self.quantum, grids: &self.grids };
        let unfiltered = (&mut self.parts, parts, vertices).into_par_iter().map_init(
            first::Batch::default,
            |batch, (part, records, vertices)| {
                part.add(records.as_ref(), &Suffixes::new(&vertices, &means), &rules, batch)
            },
        );
        self.report.unfiltered += unfiltered.sum::<u64>();
        self.cells = None;
    }

    /// Deposits a block's second vertices; the means of all cells of the epoch so far, tree by tree.
    fn share<R: AsRef<[PathRecord]> + Sync>(&mut self, parts: &[R]) -> (Vec<SecondVertices>, Vec<Means>) {
        let (trees, quantum, side) = (&self.second, &self.quantum, self.leaves[1]);
        let vertices = parts.par_iter().map_init(second::Batch::default, |batch, records| {
            SecondVertices::new(records.as_ref(), trees, side, quantum, batch)
        });
        let vertices = vertices.collect();
        let means: Vec<Means> = trees.iter().map(|tree| tree.cells.means(quantum)).collect();
        self.report.second_cells = means.iter().flatten().map(|means| means.len() as u64).sum();
        (vertices, means)
    }

    /// The tables of the first vertices' tree, diffuse and then glossy, by part.
    fn tables(&self, tree: usize) -> Vec<&Table<PlainCell>> {
        let (lobe, tree) = (tree / self.grids.len(), tree % self.grids.len());
        self.parts.iter().map(|part| &part.cells[lobe][tree]).collect()
    }

    /// What each slot of each part gets from all paths so far; slots without a path are left out.
    pub fn resolve(&mut self) -> Vec<Vec<(u32, Resolved)>> {
        let estimates = self.estimates();
        self.read(&estimates)
    }

    /// The same at the end, and what was done: gives memory back as it goes.
    pub fn finish(mut self) -> (Vec<Vec<(u32, Resolved)>>, Report) {
        let bytes = self.bytes().max(self.report.bytes);
        self.second.clear();
        let (mut cells, mut estimates) = (0, Vec::new());
        for tree in 0..2 * self.grids.len() {
            let (estimate, count) = estimate(&self.tables(tree), &self.quantum, &self.params.shrinkage);
            estimates.push(estimate);
            cells += count;
            let (lobe, tree) = (tree / self.grids.len(), tree % self.grids.len());
            self.parts.iter_mut().for_each(|part| part.cells[lobe][tree] = Table::default());
        }
        self.cells = Some(cells);
        self.settle();
        let report = self.report();
        let (quantum, trees) = (&self.quantum, self.grids.len());
        // The pairs of a part are dropped when it has read.
        let resolved = self.parts.into_par_iter().enumerate().map(|(at, part)| {
            let mut pairs = part.pairs;
            pairs.resolve(quantum, reader(&estimates, trees, at))
        });
        (resolved.collect(), Report { bytes, ..report })
    }

    /// What each slot gets, given the estimates.
    fn read(&mut self, estimates: &[Estimates]) -> Vec<Vec<(u32, Resolved)>> {
        let (quantum, trees) = (&self.quantum, self.grids.len());
        let resolve = |(at, part): (usize, &mut Part)| part.pairs.resolve(quantum, reader(estimates, trees, at));
        self.parts.par_iter_mut().enumerate().map(resolve).collect()
    }

    /// The estimate of each cell of each part, tree by tree: one after the other, for each needs room to work.
    fn estimates(&mut self) -> Vec<Estimates> {
        let mut count = 0;
        let estimates = (0..2 * self.grids.len()).map(|tree| {
            let (estimates, cells) = estimate(&self.tables(tree), &self.quantum, &self.params.shrinkage);
            count += cells;
            estimates
        });
        let estimates = estimates.collect();
        self.cells = Some(count);
        estimates
    }

    /// The side of the finest cells that the paths of each slot were put into, by part: the geometric mean over throughput,
    /// in the units of the anchor. Estimates are means over these or, where differences are noise, over larger ones.
    pub fn cell_sides(&mut self) -> Vec<Vec<(u32, f32)>> {
        let trees = self.params.trees;
        let of_part = |part: &mut Part| {
            part.pairs.settle();
            let (cells, mut sides) = (&part.cells, Sides::default());
            sides.add(&part.pairs.settled(), trees, |pair| {
                let tree = pair.tree_of(2 * trees as usize);
                cells[tree / trees as usize][tree % trees as usize].key(pair.index() as u32).level()
            });
            sides.mean(trees)
        };
        self.parts.par_iter_mut().map(of_part).collect()
    }

    /// Says that cells have come.
    pub(crate) fn cells_changed(&mut self) {
        self.cells = None;
    }

    /// What was done so far.
    pub fn report(&mut self) -> Report {
        if self.cells.is_none() {
            self.estimates();
        }
        let pairs = self.parts.iter().map(|part| part.pairs.len() as u64).sum();
        Report {
            cells: self.cells.unwrap_or_default(),
            pairs,
            bytes: self.bytes().max(self.report.bytes),
            ..self.report
        }
    }

    fn bytes(&self) -> u64 {
        let bytes = self.parts.iter().map(Part::bytes).sum::<usize>()
            + self.second.iter().map(|tree| tree.cells.bytes()).sum::<usize>();
        bytes as u64
    }
}

#[cfg(test)]
#[path = "adaptive_tests.rs"]
mod tests;
