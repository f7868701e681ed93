//! Building the light tree: a binary tree by the surface area orientation heuristic, then eight branches to a node.

use glam::DVec3;

use super::super::bounds::LightBounds;
use super::{LEAF, LightTree, NONE, Node, WIDTH};

/// A light to be chosen from.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// Its number, below 2³¹.
    pub light: u32,
    /// Where and whither it shines. Its intensity is positive.
    pub bounds: LightBounds,
    /// How far it reaches below the centre of its box along its axis.
    pub depth: f64,
}

/// A node of the binary tree.
struct Binary {
    bounds: LightBounds,
    kind: Kind,
}

enum Kind {
    /// Index into the candidates.
    Leaf(usize),
    /// Two nodes of the arena.
    Inner([u32; 2]),
}

/// Bins of candidate splits along an axis, as in \[Pharr23\] section 12.6.
const BINS: usize = 12;
/// Below this level nodes are halved, whatever the cost: clusters within clusters cannot make the recursion deep.
const LEVELS_BY_COST: u32 = 64;

impl LightTree {
    /// The tree over `candidates`, of `lights` lights in all, in a scene of the given size (a length, world).
    ///
    /// The result depends only on the candidates and their order.
    pub fn build(candidates: &[Candidate], lights: usize, scene_size: f64) -> Self {
        let size = if scene_size.is_finite() && scene_size > 0.0 { scene_size } else { 1.0 };
        let mut tree = Self { per_scene: (1.0 / size) as f32, ..Self::default() };
        match candidates {
            [] => {}
            [only] => tree.single = Some(only.light),
            _ => {
                let mut arena = Vec::with_capacity(2 * candidates.len());
                let mut order: Vec<usize> = (0..candidates.len()).collect();
                let root = split(candidates, &mut order, 0, &mut arena);
                tree.slots = vec![NONE; lights];
                let brightness = 1.0 / arena[root as usize].bounds.intensity;
                tree.widen(candidates, &arena, root, NONE, 1.0 / size, brightness);
            }
        }
        tree
    }

    /// Appends the wide node that stands for the inner node `root` of the arena, and all below it; returns its index.
    fn widen(
        &mut self,
        candidates: &[Candidate],
        arena: &[Binary],
        root: u32,
        parent: u32,
        scale: f64,
        brightness: f64,
    ) -> u32 {
        let index = self.nodes.len() as u32;
        self.nodes.push(Node::empty(parent));
        for (lane, branch) in branches(arena, root).into_iter().enumerate() {
            let slot = index * WIDTH as u32 + lane as u32;
            let Binary { bounds, kind } = &arena[branch as usize];
            let (link, depth) = match kind {
                Kind::Leaf(candidate) => {
                    let Candidate { light, depth, .. } = candidates[*candidate];
                    self.slots[light as usize] = slot;
                    (light | LEAF, depth)
                }
                Kind::Inner(_) => (self.widen(candidates, arena, branch, slot, scale, brightness), bounds.depth()),
            };
            self.nodes[index as usize].set(lane, bounds, depth, link, scale, brightness);
        }
        index
    }
}

/// Up to eight nodes that together are the inner node `root`: the dearest one is opened until there are eight.
///
/// **Source**: \[Wald08\].
fn branches(arena: &[Binary], root: u32) -> Vec<u32> {
    let mut open = vec![root];
    while open.len() < WIDTH {
        let mut dearest: Option<(usize, f64, [u32; 2])> = None;
        for (i, &node) in open.iter().enumerate() {
            let Binary { bounds, kind: Kind::Inner(children) } = &arena[node as usize] else { continue };
            let cost = bounds.cost();
            if dearest.is_none_or(|(_, most, _)| cost > most) {
                dearest = Some((i, cost, *children));
            }
        }
        let Some((i, _, [left, right])) = dearest else { break };
        open[i] = left;
        open.insert(i + 1, right);
    }
    open
}

/// Appends the binary tree over the candidates that `order` lists and returns its root.
fn split(candidates: &[Candidate], order: &mut [usize], level: u32, arena: &mut Vec<Binary>) -> u32 {
    if let [only] = *order {
        arena.push(Binary { bounds: candidates[only].bounds, kind: Kind::Leaf(only) });
        return arena.len() as u32 - 1;
    }
    let middle = partition(candidates, order, level);
    let (low, high) = order.split_at_mut(middle);
    let children = [split(candidates, low, level + 1, arena), split(candidates, high, level + 1, arena)];
    let bounds = arena[children[0] as usize].bounds.union(&arena[children[1] as usize].bounds);
    arena.push(Binary { bounds, kind: Kind::Inner(children) });
    arena.len() as u32 - 1
}

/// Reorders the two or more candidates so that a cut after the returned number of them, neither 0 nor all, is good.
fn partition(candidates: &[Candidate], order: &mut [usize], level: u32) -> usize {
    if order.len() == 2 {
        return 1;
    }
    let centers = order.iter().map(|&i| candidates[i].bounds.center());
    let low = centers.clone().fold(DVec3::INFINITY, DVec3::min);
    let high = centers.fold(DVec3::NEG_INFINITY, DVec3::max);
    let extent = high - low;
    if level < LEVELS_BY_COST {
        if let Some(cut) = cheapest_cut(candidates, order, low, extent) {
            let is_low = |i: usize| cut.is_low(&candidates[i].bounds, low, extent);
            let count = order.iter().filter(|&&i| is_low(i)).count();
            // Stable, so that the order of equals stays that of the file.
            order.sort_by_key(|&i| !is_low(i));
            return count;
        }
    }
    let axis = extent.max_position();
    order.sort_by(|&a, &b| {
        let at = |i: usize| candidates[i].bounds.center()[axis];
        at(a).total_cmp(&at(b)).then(a.cmp(&b))
    });
    order.len() / 2
}

/// A plane between two bins.
struct Cut {
    axis: usize,
    /// The last bin on the lower side.
    bin: usize,
}

impl Cut {
    fn is_low(&self, bounds: &LightBounds, low: DVec3, extent: DVec3) -> bool {
        bin(bounds, self.axis, low, extent) <= self.bin
    }
}

fn bin(bounds: &LightBounds, axis: usize, low: DVec3, extent: DVec3) -> usize {
    let place = (bounds.center()[axis] - low[axis]) / extent[axis];
    ((place * BINS as f64) as usize).min(BINS - 1)
}

/// The cut with the least sum of costs on both sides; `None` if all centres coincide.
fn cheapest_cut(candidates: &[Candidate], order: &[usize], low: DVec3, extent: DVec3) -> Option<Cut> {
    let mut cheapest: Option<(f64, Cut)> = None;
    for axis in 0..3 {
        if extent[axis] <= 0.0 {
            continue;
        }
        let mut bins: [Option<LightBounds>; BINS] = [None; BINS];
        for &i in order {
            let bounds = &candidates[i].bounds;
            let bin = &mut bins[bin(bounds, axis, low, extent)];
            *bin = join(bin.as_ref(), Some(bounds));
        }
        // Slabs across a long axis are thin and wide: they cost more than their area says.
        let slimness = extent.max_element() / extent[axis];
        // What lies above each bin.
        let mut above: [Option<LightBounds>; BINS] = [None; BINS];
        for i in (1..BINS).rev() {
            above[i - 1] = join(above[i].as_ref(), bins[i].as_ref());
        }
        let mut below = None;
        for i in 0..BINS - 1 {
            // Past an empty bin the groups are the same.
            let (Some(_), Some(above)) = (bins[i], above[i]) else { continue };
            below = join(below.as_ref(), bins[i].as_ref());
            let cost = slimness * (below.map_or(0.0, |b| b.cost()) + above.cost());
            if cost.is_finite() && cheapest.as_ref().is_none_or(|(least, _)| cost < *least) {
                cheapest = Some((cost, Cut { axis, bin: i }));
            }
        }
    }
    cheapest.map(|(_, cut)| cut)
}

fn join(a: Option<&LightBounds>, b: Option<&LightBounds>) -> Option<LightBounds> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.union(b)),
        (a, b) => a.or(b).copied(),
    }
}
