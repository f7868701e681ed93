//! Sums of many filters, resolved tree by tree.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::{Branch, Slots};
use crate::adaptive::{Params, Report, Resolved};
use crate::grid::CellKey;
use crate::pairs::{Own, Pair, gather, radiance, resolved};
use crate::shrink::{Cells, estimate};
use crate::sides::Sides;
use crate::sums::{CellSums, Quantum, Sums, WideSums};

/// A frame that is resolved from stored sums: the same bits as [`crate::Adaptive::resolve`] of a filter that holds all of
/// them. It holds the cells of one tree at a time, and all of a kind in one piece of memory, which the system gets back at
/// once.
pub struct Merging {
    params: Params,
    quantum: Quantum,
    parts: usize,
    /// Of each part.
    slots: u32,
    /// Trees that are done.
    trees: usize,
    /// The next one.
    tree: Tree,
    /// What slots have read in the trees of a lobe that are done.
    gathered: Vec<[i128; 3]>,
    /// The same as radiance of lobes of which all trees are done.
    lobes: [Vec<Vec3>; 2],
    /// How large their cells were by part, if anybody wants to know.
    sides: Option<Vec<Sides>>,
    report: Report,
}

impl Merging {
    /// No tree yet, over `parts` sets of as many slots each, which are numbered one set after the other. If it is `measured`,
    /// [`Self::cell_sides`] will be known.
    pub fn new(params: &Params, parts: usize, slots: u32, measured: bool) -> Self {
        Self {
            params: *params,
            quantum: Quantum::new(params.unit),
            parts,
            slots,
            trees: 0,
            tree: Tree::default(),
            gathered: Vec::new(),
            lobes: [Vec::new(), Vec::new()],
            sides: measured.then(|| (0..parts).map(|_| Sides::default()).collect()),
            report: Report::default(),
        }
    }

    /// Adds the next parts of a tree, of which there are [`Params::stored_trees`]: in their order, all parts of each.
    pub fn add(&mut self, branches: Vec<Branch>) {
        branches.into_iter().for_each(|branch| self.tree.push(branch));
    }

    /// Resolves a tree of which all parts were added.
    ///
    /// # Panics
    /// If there are not as many parts as were announced.
    pub fn end_tree(&mut self) {
        assert_eq!(self.tree.ends.len(), self.parts, "parts of a tree");
        let Tree { cells, pairs, ends } = std::mem::take(&mut self.tree);
        self.report.bytes = self.report.bytes.max((cells.bytes() + pairs.capacity() * size_of::<Pair>()) as u64);
        let begins: Vec<[usize; 2]> = std::iter::once([0; 2]).chain(ends.iter().copied()).take(self.parts).collect();
        let shares = begins.iter().zip(&ends).map(|(begin, end)| Share { cells: &cells, range: begin[0]..end[0] });
        let shares: Vec<Share<'_>> = shares.collect();
        let (estimates, different) = estimate(&shares, &self.quantum, &self.params.shrinkage);
        let pairs_of = |part: usize| &pairs[begins[part][1]..ends[part][1]];
        if let Some(sides) = &mut self.sides {
            let trees = self.params.trees;
            (sides, &shares).into_par_iter().enumerate().for_each(|(part, (sides, share))| {
                sides.add(pairs_of(part), trees, |pair| share.keys()[pair.index()].level());
            });
        }
        drop(shares);
        drop(cells);
        self.report.cells += different;
        self.report.pairs += pairs.len() as u64;
        let (slots, quantum) = (self.slots, &self.quantum);
        self.gathered.resize(self.parts * slots as usize, [0; 3]);
        let sums = self.gathered.par_chunks_mut(slots.max(1) as usize).zip(&estimates).enumerate();
        sums.for_each(|(part, (sums, estimates))| {
            gather(pairs_of(part), quantum, |pair| estimates[pair.index()], part as u32 * slots, sums);
        });
        self.trees += 1;
        let trees = self.params.trees as usize;
        if self.trees % trees == 0 {
            let sums = std::mem::take(&mut self.gathered);
            self.lobes[(self.trees / trees - 1) % 2] = sums.into_par_iter().map(|sum| radiance(sum, quantum)).collect();
        }
    }

    /// What the slots of a part get, given what each of them keeps besides, once all trees were added.
    pub fn resolve(&self, part: usize, slots: &Slots) -> Vec<Resolved> {
        let first = part as u32 * self.slots;
        let mut own = slots.0.iter().peekable();
        let of_slot = |slot: u32| {
            let own = own.next_if(|(at, _)| *at == slot).map_or(Own::default(), |(_, own)| *own);
            resolved(self.lobes.each_ref().map(|lobe| lobe[slot as usize]), &own, &self.quantum)
        };
        (first..first + self.slots).map(of_slot).collect()
    }

    /// As [`crate::Adaptive::cell_sides`] of one part, once all trees were added; `None` unless it is measured.
    pub fn cell_sides(&self, part: usize) -> Option<Vec<(u32, f32)>> {
        Some(self.sides.as_ref()?[part].mean(self.params.trees))
    }

    /// What was done, by filters with `paths` paths of which `unfiltered` found no cell. Its bytes are those of one tree.
    pub fn report(&self, [paths, unfiltered]: [u64; 2]) -> Report {
        Report { paths, unfiltered, ..self.report }
    }
}

/// The parts of a tree, one after the other.
#[derive(Default)]
struct Tree {
    cells: Flat,
    /// With numbers of cells that count from the first of their part.
    pairs: Vec<Pair>,
    /// Where cells and pairs of each part end.
    ends: Vec<[usize; 2]>,
}

impl Tree {
    fn push(&mut self, branch: Branch) {
        for (key, sums) in &branch.cells {
            self.cells.push(*key, sums);
        }
        self.pairs.extend(branch.pairs);
        self.ends.push([self.cells.keys.len(), self.pairs.len()]);
    }
}

/// Cells.
#[derive(Default)]
struct Flat {
    keys: Vec<CellKey>,
    sums: Vec<Sums>,
    /// Those that do not fit, by the cell's place.
    wide: BTreeMap<usize, WideSums>,
}

impl Flat {
    fn push(&mut self, key: CellKey, wide: &WideSums) {
        let mut sums = Sums::default();
        if !sums.merge(wide) {
            self.wide.insert(self.keys.len(), *wide);
        }
        self.keys.push(key);
        self.sums.push(sums);
    }

    fn bytes(&self) -> usize {
        self.keys.capacity() * size_of::<CellKey>() + self.sums.capacity() * size_of::<Sums>()
    }
}

/// The cells of a part.
struct Share<'a> {
    cells: &'a Flat,
    range: Range<usize>,
}

impl Cells for Share<'_> {
    fn keys(&self) -> Cow<'_, [CellKey]> {
        self.cells.keys[self.range.clone()].into()
    }

    fn sums(&self, cell: u32) -> WideSums {
        let at = self.range.start + cell as usize;
        self.cells.wide.get(&at).copied().unwrap_or_else(|| self.cells.sums[at].wide())
    }
}
