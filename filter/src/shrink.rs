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

use glam::DVec3;
use rayon::prelude::*;

use crate::grid::CellKey;
use crate::sums::{LUMINANCE, Quantum, WideSums};
use crate::table::{CellIndex, PerCell, ShardedTable};

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
            rgb: DVec3::from_array(sums.rgb.map(|x| x as f64)) * quantum.radiance(),
            square: sums.square as f64 * quantum.squared_radiance(),
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

/// A cell of a level, leaf or not.
#[derive(Clone, Copy, Debug)]
struct Node {
    key: CellKey,
    moments: Moments,
    estimate: DVec3,
    /// Where the estimate goes; [`Node::INNER`] for cells that are not leaves.
    leaf: CellIndex,
}

impl Node {
    const INNER: CellIndex = CellIndex::MAX;
}

/// Estimates for all cells of `table`: radiance.
pub fn estimate(table: &mut ShardedTable, quantum: &Quantum, shrinkage: &Shrinkage) -> PerCell<[f32; 3]> {
    let mut estimates = PerCell::new(table);
    let leaves = sorted_leaves(table, quantum);
    let (Some(first), Some(last)) = (leaves.first(), leaves.last()) else { return estimates };
    let coarsest = last.key.level() + shrinkage.levels as i32;

    // From fine to coarse: each level is the parents of the one before, and the leaves of its own.
    let mut levels: Vec<Vec<Node>> = Vec::new();
    let mut inner: Vec<Node> = Vec::new();
    let mut rest = leaves.as_slice();
    for level in first.key.level()..=coarsest {
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
        let parents = coarse[0].iter().filter(|node| node.leaf == Node::INNER);
        for (siblings, parent) in fine[level].chunk_by_mut(|a, b| a.key.parent() == b.key.parent()).zip(parents) {
            shrink(siblings, parent, shrinkage);
        }
    }
    for node in levels.iter().flatten().filter(|node| node.leaf != Node::INNER) {
        estimates.set(node.leaf, node.estimate.as_vec3().to_array());
    }
    estimates
}

/// The cells of a table in the order of their keys.
fn sorted_leaves(table: &mut ShardedTable, quantum: &Quantum) -> Vec<Node> {
    let unsorted: Vec<(CellKey, CellIndex, Moments)> =
        table.cells().map(|(leaf, key, sums)| (key, leaf, Moments::of(&sums, quantum))).collect();
    // Keys with their indices are a third as long as the cells.
    let mut order: Vec<(CellKey, u32)> = unsorted.iter().map(|(key, ..)| *key).zip(0..).collect();
    order.par_sort_unstable();
    let node = |&(key, at): &(CellKey, u32)| {
        let (_, leaf, moments) = unsorted[at as usize];
        Node { key, moments, estimate: moments.mean(), leaf }
    };
    order.iter().map(node).collect()
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
            _ => parents.push(Node { key, leaf: Node::INNER, ..*node }),
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
