//! What came together in each slot of the table.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::params::{Eviction, Params};
use super::sums::{Cell, Quantum};
use super::table::{Place, Table};

/// Sums and averages by slot of the table.
#[derive(Debug)]
pub struct Cells {
    quantum: Quantum,
    cells: Vec<Cell>,
    /// By slot, with a moving average; else empty.
    past: Vec<Past>,
    alpha: f32,
    squares: bool,
    enough: u64,
    relative_variance: f64,
}

/// What a cell was in the frames before this one.
#[derive(Clone, Copy, Debug, Default)]
struct Past {
    mean: [f32; 3],
    /// Deposits of all frames; 0: there were none, and no mean.
    count: u32,
}

impl Cells {
    /// Empty cells.
    pub fn new(params: &Params, slots: usize) -> Self {
        Self {
            quantum: Quantum::new(params.unit),
            cells: (0..slots).map(|_| Cell::default()).collect(),
            past: if params.temporal.is_some() { vec![Past::default(); slots] } else { Vec::new() },
            alpha: params.temporal.unwrap_or(0.0),
            squares: params.needs_squares(),
            enough: u64::from(params.enough),
            relative_variance: params.relative_variance.into(),
        }
    }

    /// The unit of sums.
    pub fn quantum(&self) -> &Quantum {
        &self.quantum
    }

    /// Whether radiance is such as may be deposited.
    #[inline]
    pub fn may_take(&self, radiance: Vec3) -> bool {
        self.quantum.deposit(radiance).is_some()
    }

    /// Deposits radiance in the cells of all levels that have a slot.
    #[inline]
    pub fn add(&self, radiance: Vec3, places: &[Place], pass: u32) {
        let Some(deposit) = self.quantum.deposit(radiance) else { return };
        for &place in places.iter().filter(|&&place| place != Table::NOWHERE) {
            self.cells[place as usize].add(&deposit, pass, self.squares);
        }
    }

    /// The average of the finest level that can be trusted, else of the coarsest that has a slot.
    ///
    /// # Panics
    /// If no level has a slot.
    #[inline]
    pub fn average(&self, places: &[Place]) -> DVec3 {
        let mut with_slot = places.iter().filter(|&&place| place != Table::NOWHERE).map(|&place| place as usize);
        let coarsest = with_slot.clone().next_back().expect("a level with a slot");
        let finest =
            if places.len() == 1 { coarsest } else { with_slot.find(|&at| self.trusted(at)).unwrap_or(coarsest) };
        self.average_of(finest)
    }

    #[inline]
    fn average_of(&self, slot: usize) -> DVec3 {
        let now = self.cells[slot].mean(&self.quantum);
        match self.past.get(slot) {
            Some(past) if past.count > 0 => {
                let alpha = f64::from(self.alpha);
                alpha * Vec3::from_array(past.mean).as_dvec3() + (1.0 - alpha) * now
            }
            _ => now,
        }
    }

    /// Whether a cell's own average is good enough, by the density of rays and by variance.
    fn trusted(&self, slot: usize) -> bool {
        let cell = &self.cells[slot];
        cell.count() >= self.enough
            && (!self.squares || cell.relative_variance(&self.quantum) <= self.relative_variance)
    }

    /// Priority of a resident in the coming pass, 0 the strongest.
    pub fn priority(&self, slot: usize, pass: u32, eviction: Eviction) -> u32 {
        let cell = &self.cells[slot];
        // A resident of the pass before this one has missed nothing yet.
        let age = (pass - 1).saturating_sub(cell.used());
        match eviction {
            Eviction::Never => 0,
            Eviction::LeastRecent { .. } => age,
            Eviction::Health { .. } => {
                let past = self.past.get(slot).map_or(0, |past| u64::from(past.count));
                age / (cell.count() + past + 1).ilog2().max(1)
            }
        }
    }

    /// Forgets cells.
    pub fn reset(&mut self, places: &[Place]) {
        for &place in places {
            self.cells[place as usize].reset();
            if let Some(past) = self.past.get_mut(place as usize) {
                *past = Past::default();
            }
        }
    }

    /// With a moving average: what came together joins it, and is forgotten. Cells without a deposit keep theirs.
    pub fn end_frame(&mut self) {
        if self.past.is_empty() {
            return;
        }
        let joined: Vec<Option<[f32; 3]>> = (0..self.cells.len())
            .into_par_iter()
            .map(|slot| (self.cells[slot].count() > 0).then(|| self.average_of(slot).as_vec3().to_array()))
            .collect();
        self.cells.par_iter_mut().zip(&mut self.past).zip(joined).for_each(|((cell, past), joined)| {
            if let Some(mean) = joined {
                let count = past.count.saturating_add(u32::try_from(cell.count()).unwrap_or(u32::MAX));
                *past = Past { mean, count };
                cell.clear();
            }
        });
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.cells.capacity() * size_of::<Cell>() + self.past.capacity() * size_of::<Past>()
    }
}
