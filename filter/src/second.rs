//! Second vertices of a block's paths: what arrives there is shared before it is passed on to first vertices.

use glam::Vec3;

use crate::adaptive::{Tree, place};
use crate::grid::{LeafCell, Places};
use crate::record::{Lobe, PathRecord};
use crate::shards::{Means, ShardedIndex};
use crate::sums::{Deposit, LUMINANCE, Quantum};

/// The second vertices of a part of a block, which have been deposited in their cells.
#[derive(Debug)]
pub(crate) struct SecondVertices {
    /// Places of their cells, path by path, and of a path tree by tree. [`ShardedIndex::NONE`] where no cell took one.
    places: Vec<ShardedIndex>,
}

/// Room for a batch, to be used again.
#[derive(Default)]
pub(crate) struct Batch {
    places: Places,
    paths: Vec<u32>,
    deposits: Vec<Deposit>,
    /// Tree by tree.
    leaves: Vec<Vec<LeafCell>>,
    /// Cells and deposits of the whole part, tree by tree.
    keyed: Vec<Vec<(LeafCell, Deposit)>>,
    /// The paths of those.
    keyed_paths: Vec<u32>,
}

impl SecondVertices {
    /// Deposits them.
    pub fn new(records: &[PathRecord], trees: &[Tree], side: f32, quantum: &Quantum, batch: &mut Batch) -> Self {
        batch.leaves.resize(trees.len(), Vec::new());
        batch.keyed.resize(trees.len(), Vec::new());
        batch.keyed.iter_mut().for_each(Vec::clear);
        batch.keyed_paths.clear();
        for (first, records) in (0..).step_by(Places::MOST).zip(records.chunks(Places::MOST)) {
            batch.gather(first, records, trees, side, quantum);
        }
        let mut places = vec![ShardedIndex::NONE; records.len() * trees.len()];
        for (tree, keyed) in trees.iter().zip(&batch.keyed).enumerate().map(|(at, (tree, keyed))| ((at, tree), keyed)) {
            let (at, tree) = tree;
            tree.cells.add(keyed, |item, place| {
                places[batch.keyed_paths[item] as usize * trees.len() + at] = place;
            });
        }
        Self { places }
    }
}

impl Batch {
    /// Finds the cells of some paths' second vertices, of which the first path is number `first`.
    fn gather(&mut self, first: u32, records: &[PathRecord], trees: &[Tree], side: f32, quantum: &Quantum) {
        self.places.clear();
        self.paths.clear();
        self.deposits.clear();
        let finest = trees[0].grid.finest();
        for (path, record) in (first..).zip(records) {
            if !record.second.exists() {
                continue;
            }
            if let Some(deposit) = quantum.deposit(record.suffix.get(), weight(record)) {
                place(&mut self.places, &record.second, side, finest);
                self.paths.push(path);
                self.deposits.push(deposit);
            }
        }
        for (tree, leaves) in trees.iter().zip(&mut self.leaves) {
            tree.grid.leaves(&self.places, leaves);
        }
        for (i, path) in self.paths.iter().enumerate() {
            // All trees take it or none.
            if self.leaves.iter().all(|leaves| leaves[i].exists()) {
                self.keyed_paths.push(*path);
                for (keyed, leaves) in self.keyed.iter_mut().zip(&self.leaves) {
                    keyed.push((leaves[i], self.deposits[i]));
                }
            }
        }
    }
}

/// What arrives at the second vertices of a part of a block: means over their cells.
///
/// Whether cells differ by more than noise is not asked here. What is noise is averaged once more at first vertices, and
/// what is bias is small there, for a first vertex looks at many cells: of four scenes at 1 to 64 samples none was better by
/// more than 5 % with cells of 1 to 16 footprints that were shrunk towards those around, of which there were up to twenty
/// times as many and which took most of the filter's time.
pub(crate) struct Suffixes<'a> {
    places: &'a SecondVertices,
    /// Of all cells, tree by tree.
    means: &'a [Means],
}

impl<'a> Suffixes<'a> {
    /// From the means of all cells, tree by tree.
    pub fn new(places: &'a SecondVertices, means: &'a [Means]) -> Self {
        Self { places, means }
    }

    /// What arrives at the second vertex of a path of the part.
    #[inline]
    pub fn get(&self, path: usize, record: &PathRecord) -> Vec3 {
        let trees = self.means.len();
        let places = &self.places.places[path * trees..(path + 1) * trees];
        if places[0] == ShardedIndex::NONE {
            // A vertex that no cell took keeps its own light.
            return record.suffix.get();
        }
        let found = places.iter().zip(self.means).map(|(place, tree)| Vec3::from_array(place.of(tree)));
        found.sum::<Vec3>() * (trees as f32).recip()
    }
}

/// What light at the second vertex counts for in the slot: as weights of the mean over a cell these keep its energy, for
/// the sum of weight × mean is that of weight × own.
fn weight(record: &PathRecord) -> f32 {
    let through = |lobe: &Lobe| lobe.throughput.get() * lobe.transfer.get();
    (through(&record.diffuse) + through(&record.glossy)).dot(LUMINANCE.as_vec3()).abs()
}
