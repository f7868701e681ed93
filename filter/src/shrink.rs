//! Noise told from signal: cell means shrunk towards those of the cells around them.
//!
//! Every cell is a leaf of a tree of cells, each of twice the side of those it holds. From the coarsest to the finest, the
//! estimate of a cell is its parent's estimate plus a share w of the difference between their means,
//!
//! estimate(child) = estimate(parent) + w (mean(child) − mean(parent)),
//!
//! with w = max(0, 1 − (τ (k−1) V / S)²) for k siblings whose means scatter by S = Σ n (mean − mean(parent))², of which noise
//! alone, of variance V a deposit, would explain (k−1) V. Where the means scatter no more than noise does, w is 0 and the
//! siblings are pooled; as deposits accumulate S grows with them and w goes to 1: the bias vanishes. The sum over
//! siblings is kept exactly, so energy is neither lost nor made.
//!
//! **Source**: shrinkage as by James and Stein \[James61\] on unbalanced Haar details; with the square it is nearer to
//! Breiman's garrote \[Breiman95\]. On three scenes at 16 samples per pixel the square gains 9 to 30 % over the plain ratio.

use std::ops::Deref;

use glam::DVec3;
use rayon::prelude::*;

use crate::buckets::Buckets;
use crate::grid::CellKey;
use crate::sums::{LUMINANCE, Quantum, WideSums};
use crate::table::{Key, Table};

/// How sure a difference between cells must be to be kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shrinkage {
    /// τ: how many times the scatter that noise explains is taken off. 1 is unbiased for V known; more guards against the
    /// chance that the largest of many differences is noise, and against V measured too small.
    pub tau: f64,
    /// Degrees of freedom from which siblings' own scatter of deposits measures V. With fewer the parent's total scatter
    /// does, which includes the differences in question and so votes for pooling.
    pub trusted: f64,
    /// Levels above the coarsest leaf.
    pub levels: u32,
}

/// Sums of a cell in floating point; order and grouping are fixed by the order of keys.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    /// Deposits.
    n: f64,
    /// Σ weight.
    weight: f64,
    /// Σ weight · radiance.
    rgb: DVec3,
    /// Σ weight · luminance².
    square: f64,
}

impl Moments {
    fn of(sums: &WideSums, quantum: &Quantum) -> Self {
        Self {
            n: sums.count as f64,
            weight: sums.weight as f64 * quantum.weight(),
            rgb: DVec3::from_array(sums.rgb.map(float)) * quantum.radiance(),
            square: float(sums.square) * quantum.squared_radiance(),
        }
    }

    fn add(&mut self, other: &Self) {
        self.n += other.n;
        self.weight += other.weight;
        self.rgb += other.rgb;
        self.square += other.square;
    }

    fn mean(&self) -> DVec3 {
        self.rgb / self.weight
    }

    /// Mean luminance.
    fn luminance(&self) -> f64 {
        self.rgb.dot(LUMINANCE) / self.weight
    }

    /// Σ weight (y − ȳ)².
    fn scatter(&self) -> f64 {
        let mean = self.luminance();
        (self.square - self.weight * mean * mean).max(0.0)
    }
}

/// Nearest number; nearly all are short, for which there are instructions.
fn float(x: u128) -> f64 {
    i64::try_from(x).map_or(x as f64, |x| x as f64)
}

/// A cell of a level, leaf or not.
#[derive(Clone, Copy, Debug)]
struct Node {
    key: CellKey,
    moments: Moments,
    estimate: DVec3,
    /// Whether deposits were made in it, and not in cells that it holds.
    leaf: bool,
}

/// Radiance of each cell of each table, and how many different cells they are.
///
/// The same key may be in several tables, which then share the cell: its sums are those of all.
pub fn estimate<K: Key, T: Deref<Target = Table<K>> + Sync>(
    tables: &[T],
    quantum: &Quantum,
    shrinkage: &Shrinkage,
) -> (Vec<Vec<[f32; 3]>>, u64) {
    let levels = tables.par_iter().filter_map(|table| table.keys().map(CellKey::level).max());
    let Some(coarsest) = levels.max().map(|level| level + shrinkage.levels as i32) else {
        return (vec![Vec::new(); tables.len()], 0);
    };
    // Cells of different ancestors at the coarsest level know nothing of each other, so they can be worked on in
    // buckets, which fit into caches and occupy all threads.
    let cells: usize = tables.iter().map(|table| table.len()).sum();
    let count = (cells / BUCKET).next_power_of_two();
    let bucket = |key: CellKey| key.ancestor(coarsest).hash() as u32 & (count as u32 - 1);
    let orders: Vec<Buckets> = tables.par_iter().map(|table| Buckets::new(count, table.keys().map(bucket))).collect();
    let bucket_estimates = |bucket: usize| {
        let places = tables
            .iter()
            .zip(&orders)
            .flat_map(|(table, order)| order.get(bucket).iter().map(|&cell| (&**table, cell)));
        estimate_bucket(&places.collect::<Vec<_>>(), coarsest, quantum, shrinkage)
    };
    let (estimates, different): (Vec<Vec<[f32; 3]>>, Vec<u64>) =
        (0..count).into_par_iter().map(bucket_estimates).unzip();
    // Where the cells of each table begin in each bucket.
    let mut begins = vec![vec![0; count]];
    for order in &orders {
        let last = &begins[begins.len() - 1];
        begins.push((0..count).map(|bucket| last[bucket] + order.get(bucket).len()).collect());
    }
    let by_table = |((table, order), begins): ((&T, &Buckets), &Vec<usize>)| {
        let mut of_table = vec![[0.0; 3]; table.len()];
        for (bucket, estimates) in estimates.iter().enumerate() {
            for (&cell, estimate) in order.get(bucket).iter().zip(&estimates[begins[bucket]..]) {
                of_table[cell as usize] = *estimate;
            }
        }
        of_table
    };
    (tables.par_iter().zip(&orders).zip(&begins).map(by_table).collect(), different.iter().sum())
}

/// Cells of a bucket: few enough that their nodes stay in a core's cache, enough that a bucket is worth a task.
const BUCKET: usize = 2048;

/// Estimates of the cells at the given places, and how many different cells they are.
fn estimate_bucket<K: Key>(
    places: &[(&Table<K>, u32)],
    coarsest: i32,
    quantum: &Quantum,
    shrinkage: &Shrinkage,
) -> (Vec<[f32; 3]>, u64) {
    let mut order: Vec<(CellKey, u32)> = places.iter().map(|(table, cell)| table.key(*cell)).zip(0..).collect();
    order.sort_unstable();
    let leaves: Vec<Node> = order
        .chunk_by(|a, b| a.0 == b.0)
        .map(|same| {
            let mut sums = WideSums::default();
            for (table, cell) in same.iter().map(|(_, at)| &places[*at as usize]) {
                sums.merge(&table.sums(*cell));
            }
            let moments = Moments::of(&sums, quantum);
            Node { key: same[0].0, moments, estimate: moments.mean(), leaf: true }
        })
        .collect();
    let mut estimates = vec![[0.0; 3]; places.len()];
    let levels = estimate_levels(&leaves, coarsest, shrinkage);
    // Both in the order of keys.
    let nodes = levels.iter().flatten().filter(|node| node.leaf);
    for (node, same) in nodes.zip(order.chunk_by(|a, b| a.0 == b.0)) {
        let estimate = node.estimate.as_vec3().to_array();
        same.iter().for_each(|(_, at)| estimates[*at as usize] = estimate);
    }
    (estimates, leaves.len() as u64)
}

/// The nodes of all levels of the trees above `leaves`, which are sorted, with their estimates.
fn estimate_levels(leaves: &[Node], coarsest: i32, shrinkage: &Shrinkage) -> Vec<Vec<Node>> {
    // From fine to coarse: each level is the parents of the one before, and the leaves of its own.
    let mut levels: Vec<Vec<Node>> = Vec::new();
    let mut inner: Vec<Node> = Vec::new();
    let mut rest = leaves;
    let finest = leaves.first().map_or(coarsest, |leaf| leaf.key.level());
    for level in finest..=coarsest {
        let (own, coarser) = rest.split_at(rest.partition_point(|leaf| leaf.key.level() == level));
        rest = coarser;
        let nodes = merged(&inner, own);
        inner = parents(&nodes);
        levels.push(nodes);
    }

    // From coarse to fine.
    for level in (0..levels.len() - 1).rev() {
        let (fine, coarse) = levels.split_at_mut(level + 1);
        // The groups of siblings are in the order of their parents, which are the inner cells of the next level.
        let parents = coarse[0].iter().filter(|node| !node.leaf);
        for (siblings, parent) in fine[level].chunk_by_mut(|a, b| a.key.parent() == b.key.parent()).zip(parents) {
            shrink(siblings, parent, shrinkage);
        }
    }
    levels
}

/// Two sorted lists as one. A cell may be in both: some of its deposits were finer than others, and the two are siblings.
fn merged(inner: &[Node], leaves: &[Node]) -> Vec<Node> {
    let mut nodes = Vec::with_capacity(inner.len() + leaves.len());
    let mut leaves = leaves.iter().peekable();
    for node in inner {
        while let Some(leaf) = leaves.next_if(|leaf| leaf.key < node.key) {
            nodes.push(*leaf);
        }
        nodes.push(*node);
    }
    nodes.extend(leaves);
    nodes
}

/// The parents of a level's cells, in order.
fn parents(nodes: &[Node]) -> Vec<Node> {
    let mut parents: Vec<Node> = Vec::with_capacity(nodes.len() / 2);
    for node in nodes {
        let key = node.key.parent();
        match parents.last_mut() {
            Some(parent) if parent.key == key => parent.moments.add(&node.moments),
            _ => parents.push(Node { key, leaf: false, ..*node }),
        }
    }
    for parent in &mut parents {
        parent.estimate = parent.moments.mean();
    }
    parents
}

/// Sets the estimates of all children of `parent`.
fn shrink(siblings: &mut [Node], parent: &Node, shrinkage: &Shrinkage) {
    let mean = parent.moments.mean();
    // No further than to where the first channel of a child would become negative, which its parent's own shrinkage can
    // bring about; the sum over siblings is still kept.
    let reach = |child: &Node| {
        let down = (mean - child.moments.mean()).max(DVec3::ZERO);
        // Where nothing goes down the quotient is infinite or, 0 / 0, not a number, which `min` passes over.
        (parent.estimate / down).to_array().into_iter().fold(f64::INFINITY, f64::min)
    };
    let weight = siblings.iter().map(reach).fold(kept(siblings, &parent.moments, shrinkage), f64::min).max(0.0);
    for child in siblings {
        child.estimate = (parent.estimate + weight * (child.moments.mean() - mean)).max(DVec3::ZERO);
    }
}

/// The share w of the siblings' differences that is kept.
fn kept(siblings: &[Node], parent: &Moments, shrinkage: &Shrinkage) -> f64 {
    if siblings.len() == 1 {
        return 0.0;
    }
    let mean = parent.luminance();
    let (mut within, mut between) = (0.0, 0.0);
    for Node { moments, .. } in siblings {
        let difference = moments.luminance() - mean;
        within += moments.scatter();
        between += moments.weight * difference * difference;
    }
    let freedom = parent.n - siblings.len() as f64;
    let variance = if freedom >= shrinkage.trusted { within / freedom } else { parent.scatter() / (parent.n - 1.0) };
    let noise = shrinkage.tau * (siblings.len() - 1) as f64 * variance;
    // The ratio is squared where James and Stein have it plain: a difference that stands out is kept nearly whole, and the
    // doubt that τ expresses falls on those that do not.
    if between > noise { 1.0 - (noise / between).powi(2) } else { 0.0 }
}
