//! Path space filtering as the talk of 2018 has it \[Binder18\].
//!
//! One vertex of each path is quantised after a jitter in its tangent plane; what arrives there is added to the cell of a
//! hash table that its key leads to, and the path brings its throughput times the cell's average to its slot. Two hashes:
//! one for the place in the table, one to verify that a slot holds the key's own cell. Few steps of linear probing; a path
//! that finds no slot brings what it brought unfiltered.
//!
//! What the talk leaves to timing is settled here in an order that cannot change, see `table.rs`: results do not depend on
//! threads or on the order of paths. Contributions are summed as integers.
//!
//! This is the published filter, with its faults: it does not know noise from signal, so its bias stays however many
//! samples there are. [`crate::Adaptive`] is the one to use.

mod cells;
mod key;
mod params;
mod random;
mod reads;
mod sums;
mod table;

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

pub use params::{Eviction, Jitter, LevelOfDetail, Params, ParamsError, Reading};

use crate::grid::Anchor;
use crate::record::{Lobe, PathRecord};
use cells::Cells;
use key::{Key, Layer, Locator};
use random::Random;
use reads::Reads;
use sums::SlotSum;
use table::{Place, Table};

/// What a slot gets: sums over its paths of what they bring, weighted as their throughputs are.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Resolved {
    /// Through diffuse lobes.
    pub diffuse: Vec3,
    /// Through glossy lobes.
    pub glossy: Vec3,
}

/// Counts of what the filter did in a frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Passes so far.
    pub passes: u32,
    /// Paths so far.
    pub paths: u64,
    /// Lobes of paths, each of which asks for a cell.
    pub lobes: u64,
    /// Lobes whose key found no slot. They stay unfiltered, like the next two.
    pub unresolved: u64,
    /// Lobes with radiance that no cell may take: not finite, negative, subnormal, or too large.
    pub rejected: u64,
    /// Lobes of vertices without a place in the grid.
    pub placeless: u64,
    /// Lobes that were left out of their slot too, since even throughput times radiance is not a number.
    pub lost: u64,
    /// Slots of the table.
    pub slots: u64,
    /// Cells: slots with a key.
    pub cells: u64,
    /// Cells by slots looked at to find them: entry i for i + 1.
    pub probes: Vec<u64>,
    /// Cells that gave way to others.
    pub evicted: u64,
    /// Times that keys of the last pass went through the table until no slot changed hands.
    pub rounds: u32,
    /// Bytes held between passes.
    pub bytes: u64,
}

impl Report {
    /// Share of the table's slots that hold a cell.
    pub fn occupancy(&self) -> f64 {
        self.cells as f64 / self.slots as f64
    }

    /// Share of lobes whose key found no slot.
    pub fn unresolved_share(&self) -> f64 {
        self.unresolved as f64 / self.lobes.max(1) as f64
    }

    /// Mean number of slots looked at to find a cell.
    pub fn mean_probes(&self) -> f64 {
        let looks: u64 = self.probes.iter().zip(1..).map(|(cells, probes)| cells * probes).sum();
        looks as f64 / self.cells.max(1) as f64
    }
}

/// The filter: a table of cells, and what slots got.
#[derive(Debug)]
pub struct Talk {
    params: Params,
    anchor: Anchor,
    eye: DVec3,
    table: Table,
    cells: Cells,
    /// By part.
    slots: Vec<Slots>,
    /// Of all frames: what the ages of cells are counted in.
    passes: u32,
    /// Of this frame.
    report: Report,
}

/// What the slots of one part got.
#[derive(Debug, Default)]
struct Slots {
    sums: BTreeMap<u32, [SlotSum; 2]>,
    reads: Reads,
}

/// The lobes of one part's paths that ask for cells.
#[derive(Debug, Default)]
struct Queries {
    /// Record and layer, in order.
    lobes: Vec<(u32, Layer)>,
    /// As many for each lobe as there are lookups.
    keys: Vec<Key>,
    all: u64,
    rejected: u64,
    placeless: u64,
}

impl Talk {
    /// An empty filter for passes of about `rays_per_pass` paths.
    ///
    /// # Errors
    /// If a setting is out of its bounds.
    pub fn new(params: &Params, anchor: &Anchor, rays_per_pass: usize) -> Result<Self, ParamsError> {
        params.validate()?;
        let slots = (rays_per_pass as f64 * f64::from(params.table_size)).ceil().max(1.0) as usize;
        let new = match params.eviction {
            Eviction::Never => 1,
            Eviction::LeastRecent { patience } | Eviction::Health { patience } => patience,
        };
        let table = Table::new(slots, params.probes as u8, new);
        let cells = Cells::new(params, table.len());
        let (params, anchor) = (*params, *anchor);
        let (eye, report) = (anchor.origin, Report::default());
        Ok(Self { params, anchor, eye, table, cells, slots: Vec::new(), passes: 0, report })
    }

    /// Adds a pass: paths of the whole frame, by part. A slot belongs to one part for good.
    ///
    /// All paths deposit before any reads. What a pass is decides the result; the order of paths within a part does not.
    pub fn add(&mut self, parts: &[Vec<PathRecord>]) {
        self.report.passes += 1;
        self.passes += 1;
        let pass = self.passes;
        if self.slots.len() < parts.len() {
            self.slots.resize_with(parts.len(), Slots::default);
        }
        let (cells, eviction) = (&self.cells, self.params.eviction);
        self.table.prioritise(|slot| cells.priority(slot, pass, eviction));

        let locator = Locator::new(&self.params, &self.anchor, self.eye);
        let (queries, keys): (Vec<Queries>, Vec<Vec<Key>>) = parts
            .par_iter()
            .map(|records| {
                let mut queries = self.queries(records, &locator, pass);
                let keys = std::mem::take(&mut queries.keys);
                (queries, keys)
            })
            .unzip();
        let settled = self.table.settle(&keys);
        drop(keys);
        self.cells.reset(&settled.evicted);

        let lookups = self.params.lookups as usize;
        let asked = || parts.par_iter().zip(&queries).zip(&settled.places);
        asked().for_each(|((records, queries), places)| {
            for (&(record, layer), places) in queries.lobes.iter().zip(places.chunks_exact(lookups)) {
                self.cells.add(incident(&records[record as usize], layer), places, pass);
            }
        });
        let mut slots = std::mem::take(&mut self.slots);
        let counts: Vec<(u64, u64)> = asked()
            .zip(&mut slots)
            .map(|(((records, queries), places), slots)| self.read(records, queries, places, slots))
            .collect();
        self.slots = slots;
        self.count(parts, &queries, &counts);
        self.report.evicted += settled.evicted.len() as u64;
        self.report.rounds = settled.rounds;
    }

    fn queries(&self, records: &[PathRecord], locator: &Locator, pass: u32) -> Queries {
        let mut queries = Queries::default();
        for (record, at) in records.iter().zip(0..) {
            for (layer, _) in lobes(record) {
                queries.all += 1;
                if !self.cells.may_take(incident(record, layer)) {
                    queries.rejected += 1;
                    continue;
                }
                let random = Random::new(record.slot, record.sample(), layer as u8, pass);
                if locator.keys(&record.first, layer, random, &mut queries.keys) {
                    queries.lobes.push((at, layer));
                } else {
                    queries.placeless += 1;
                }
            }
        }
        queries
    }

    /// Brings to each slot what its paths do: averages, or their own. Lobes without a slot in the table, and lobes lost.
    fn read(&self, records: &[PathRecord], queries: &Queries, places: &[Place], slots: &mut Slots) -> (u64, u64) {
        let later = self.params.reading == Reading::AtTheEnd;
        let mut asked = queries.lobes.iter().zip(places.chunks_exact(self.params.lookups as usize)).peekable();
        let (mut unresolved, mut lost, mut at) = (0, 0, 0);
        for run in records.chunk_by(|a, b| a.slot == b.slot) {
            let mut sums = [SlotSum::default(); 2];
            for record in run {
                for (layer, lobe) in lobes(record) {
                    let places = asked.next_if(|(query, _)| **query == (at, layer)).map(|(_, places)| places);
                    let found = places.filter(|places| places.iter().any(|&place| place != Table::NOWHERE));
                    unresolved += u64::from(places.is_some() && found.is_none());
                    if let (true, Some(places)) = (later, found) {
                        slots.reads.push(record.slot, layer, lobe.throughput, places);
                        continue;
                    }
                    let average = match found {
                        Some(places) => self.cells.average(places),
                        None => incident(record, layer).as_dvec3(),
                    };
                    let radiance = lobe.throughput.get().as_dvec3() * average;
                    lost += u64::from(!sums[layer as usize].add(radiance, self.cells.quantum()));
                }
                at += 1;
            }
            let all = slots.sums.entry(run[0].slot).or_default();
            all.iter_mut().zip(&sums).for_each(|(all, sum)| all.merge(sum));
        }
        (unresolved, lost)
    }

    fn count(&mut self, parts: &[Vec<PathRecord>], queries: &[Queries], counts: &[(u64, u64)]) {
        let report = &mut self.report;
        report.paths += parts.iter().map(|records| records.len() as u64).sum::<u64>();
        for queries in queries {
            report.lobes += queries.all;
            report.rejected += queries.rejected;
            report.placeless += queries.placeless;
        }
        for (unresolved, lost) in counts {
            report.unresolved += unresolved;
            report.lost += lost;
        }
    }

    /// What each slot of each part got in this frame so far; slots without a path are left out.
    pub fn resolve(&self) -> Vec<Vec<(u32, Resolved)>> {
        let quantum = self.cells.quantum();
        self.slots
            .par_iter()
            .map(|slots| {
                let mut sums = slots.sums.clone();
                for (slot, layer, throughput, places) in slots.reads.iter() {
                    let sum = &mut sums.entry(slot).or_default()[layer as usize];
                    // A throughput that is not a number brings nothing.
                    let _ = sum.add(throughput.as_dvec3() * self.cells.average(places), quantum);
                }
                let resolved = |[diffuse, glossy]: [SlotSum; 2]| Resolved {
                    diffuse: diffuse.get(quantum),
                    glossy: glossy.get(quantum),
                };
                sums.into_iter().map(|(slot, sums)| (slot, resolved(sums))).collect()
            })
            .collect()
    }

    /// Begins another frame of a sequence, seen from `eye`: slots and counts begin at nothing, cells stay, and with
    /// [`Params::temporal`] what came together in this frame joins the moving averages. `moved` is what has come to the
    /// coordinates of all places, the eye's among them, since the frame before.
    pub fn next_frame(&mut self, eye: DVec3, moved: DVec3) {
        self.eye = eye;
        self.anchor.origin += moved;
        self.cells.end_frame();
        self.slots.clear();
        self.report = Report::default();
    }

    /// What was done so far.
    pub fn report(&self) -> Report {
        let probes = self.table.histogram();
        let slots =
            self.slots.iter().map(|slots| slots.sums.len() * size_of::<(u32, [SlotSum; 2])>() + slots.reads.bytes());
        Report {
            slots: self.table.len() as u64,
            cells: probes.iter().sum(),
            probes,
            bytes: (self.table.bytes() + self.cells.bytes() + slots.sum::<usize>()) as u64,
            ..self.report.clone()
        }
    }
}

/// The lobes that bring anything.
#[inline]
fn lobes(record: &PathRecord) -> impl Iterator<Item = (Layer, &Lobe)> {
    [(Layer::Diffuse, &record.diffuse), (Layer::Glossy, &record.glossy)]
        .into_iter()
        .filter(|(_, lobe)| !lobe.is_black())
}

/// What arrives in a lobe of the first vertex.
#[inline]
fn incident(record: &PathRecord, layer: Layer) -> Vec3 {
    let lobe = match layer {
        Layer::Diffuse => &record.diffuse,
        Layer::Glossy => &record.glossy,
    };
    lobe.incident(record.suffix.get())
}

#[cfg(test)]
mod tests;
