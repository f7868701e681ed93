//! Sums of many filters, resolved tree by tree.

use rayon::prelude::*;

use super::{Branch, Slots};
use crate::adaptive::{Params, Report, Resolved};
use crate::pairs::{Gathered, Pair};
use crate::shrink::estimate;
use crate::sides::Sides;
use crate::sums::Quantum;
use crate::table::Table;

/// A frame that is resolved from stored sums: the same bits as [`crate::Adaptive::resolve`] of a filter that holds all of
/// them. It holds the cells of one tree at a time.
pub struct Merging {
    params: Params,
    quantum: Quantum,
    /// What slots have read so far, by part.
    gathered: Vec<Gathered>,
    /// How large their cells were, if anybody wants to know.
    sides: Option<Vec<Sides>>,
    report: Report,
}

impl Merging {
    /// No tree yet, over `parts` disjoint sets of slots. If it is `measured`, [`Self::cell_sides`] will be known.
    pub fn new(params: &Params, parts: usize, measured: bool) -> Self {
        let gathered = (0..parts).map(|_| Gathered::default()).collect();
        let sides = measured.then(|| (0..parts).map(|_| Sides::default()).collect());
        Self { params: *params, quantum: Quantum::new(params.unit), gathered, sides, report: Report::default() }
    }

    /// Adds one of [`Params::stored_trees`] trees, by part: every one once, in any order.
    ///
    /// # Panics
    /// If there are not as many parts as were announced.
    pub fn add_tree(&mut self, branches: Vec<Branch>) {
        assert_eq!(branches.len(), self.gathered.len(), "parts of a tree");
        let (tables, pairs): (Vec<Table<_>>, Vec<Vec<Pair>>) =
            branches.into_par_iter().map(|branch| (Table::from_cells(branch.cells), branch.pairs)).unzip();
        let held = tables.iter().map(Table::bytes).sum::<usize>()
            + pairs.iter().map(|pairs| pairs.capacity() * size_of::<Pair>()).sum::<usize>();
        let (estimates, cells) = estimate(&tables.iter().collect::<Vec<_>>(), &self.quantum, &self.params.shrinkage);
        if let Some(sides) = &mut self.sides {
            let trees = self.params.trees;
            (sides, &pairs, &tables).into_par_iter().for_each(|(sides, pairs, table)| {
                sides.add(pairs, trees, |pair| table.key(pair.index() as u32).level());
            });
        }
        drop(tables);
        self.report.cells += cells;
        self.report.pairs += pairs.iter().map(|pairs| pairs.len() as u64).sum::<u64>();
        self.report.bytes = self.report.bytes.max(held as u64);
        (&mut self.gathered, &pairs, &estimates).into_par_iter().for_each(|(gathered, pairs, estimates)| {
            gathered.add(pairs, &self.quantum, |pair| estimates[pair.index()]);
        });
    }

    /// What each slot of a part gets, once all trees were added; slots without a path are left out.
    pub fn resolve(&self, part: usize, slots: &Slots) -> Vec<(u32, Resolved)> {
        self.gathered[part].resolve(&slots.0, &self.quantum)
    }

    /// As [`crate::Adaptive::cell_sides`], once all trees were added.
    pub fn cell_sides(&self) -> Option<Vec<Vec<(u32, f32)>>> {
        let sides = self.sides.as_ref()?;
        Some(sides.iter().map(|sides| sides.mean(self.params.trees)).collect())
    }

    /// What was done, by filters with `paths` paths of which `unfiltered` found no cell. Its bytes are those of one tree.
    pub fn report(&self, [paths, unfiltered]: [u64; 2]) -> Report {
        Report { paths, unfiltered, ..self.report }
    }
}
