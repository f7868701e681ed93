//! Which slots read which cells, and by how much: what a frame needs to remember of its paths.

use glam::{DVec3, Vec3};

use crate::adaptive::Resolved;
use crate::packed_pairs::PackedPairs;
use crate::slot_sums::SlotSums;
use crate::sums::Quantum;

/// Which estimate a pair reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Lobe {
    /// That of diffuse lobes.
    Diffuse,
    /// That of all others.
    Glossy,
}

/// A slot, a cell of its part, and the throughput of all paths between them. 20 bytes.
///
/// Throughputs are whole multiples of 2⁻²⁰, so sums are exact in any order; a sum that would overflow begins another pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Pair {
    /// See [`Pair::label_of`].
    slot_lobe_tree: u32,
    cell: u32,
    throughput: [i32; 3],
}

const TREE_BITS: u32 = 3;
const THROUGHPUT_BITS: i32 = 20;

impl Pair {
    fn label_of(slot: u32, lobe: Lobe, tree: u32) -> u32 {
        slot << (TREE_BITS + 1) | (lobe as u32) << TREE_BITS | tree
    }

    /// From [`Self::label`], cell and throughput.
    #[inline]
    pub fn of_label(label: u32, cell: u32, throughput: [i32; 3]) -> Self {
        Self { slot_lobe_tree: label, cell, throughput }
    }

    /// Slot, and below it the lobe and the tree.
    #[inline]
    pub fn label(&self) -> u32 {
        self.slot_lobe_tree
    }

    /// Its cell.
    #[inline]
    pub fn cell(&self) -> u32 {
        self.cell
    }

    pub fn slot(&self) -> u32 {
        self.slot_lobe_tree >> (TREE_BITS + 1)
    }

    fn lobe(&self) -> Lobe {
        if self.slot_lobe_tree >> TREE_BITS & 1 == 0 { Lobe::Diffuse } else { Lobe::Glossy }
    }

    /// Which tree of its lobe it reads.
    pub fn tree(&self) -> u32 {
        self.slot_lobe_tree & ((1 << TREE_BITS) - 1)
    }

    pub fn order(&self) -> u64 {
        u64::from(self.slot_lobe_tree) << 32 | u64::from(self.cell)
    }

    /// Which of `trees` trees it reads, diffuse and then glossy.
    pub fn tree_of(&self, trees: usize) -> usize {
        self.tree() as usize + if self.lobe() == Lobe::Glossy { trees / 2 } else { 0 }
    }

    /// Its cell, where that is an index.
    pub fn index(&self) -> usize {
        self.cell as usize
    }

    /// The same pair with another number for its cell.
    pub fn with_cell(self, cell: u32) -> Self {
        Self { cell, ..self }
    }

    /// A pair of `slot` and a cell of one of `trees` trees, diffuse and then glossy; `None` for a slot that no pair can have.
    pub fn of_tree(slot: u32, tree: usize, trees: usize, cell: u32, throughput: [i32; 3]) -> Option<Self> {
        let (lobe, tree) = if tree < trees / 2 { (Lobe::Diffuse, tree) } else { (Lobe::Glossy, tree - trees / 2) };
        let slot_lobe_tree = Self::label_of(slot, lobe, tree as u32);
        let pair = Self { slot_lobe_tree, cell, throughput };
        (pair.slot() == slot).then_some(pair)
    }

    /// Throughput in quanta.
    pub fn throughput(&self) -> [i32; 3] {
        self.throughput
    }

    /// Adds up those of the same slot and cell, which come one after the other, as far as sums fit.
    pub fn unite(pairs: &mut Vec<Self>) {
        pairs.dedup_by(|next, kept| next.order() == kept.order() && kept.absorb(next));
    }

    /// Adds another pair's throughput, if it fits.
    fn absorb(&mut self, other: &Self) -> bool {
        let sum = |i: usize| self.throughput[i].checked_add(other.throughput[i]);
        let (Some(r), Some(g), Some(b)) = (sum(0), sum(1), sum(2)) else { return false };
        self.throughput = [r, g, b];
        true
    }
}

/// Sums of one slot that need no cell, in quanta: of 2⁻²⁴ units, up to 2³⁹ of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Own {
    /// What paths bring through glossy lobes: of even samples and of odd ones.
    glossy: [[i64; 3]; 2],
    /// What they bring that no cell could take: through diffuse lobes and through glossy ones.
    unfiltered: [[i64; 3]; 2],
}

impl Own {
    /// As words, to be stored.
    pub fn to_words(self) -> [i64; 12] {
        let lists = [self.glossy[0], self.glossy[1], self.unfiltered[0], self.unfiltered[1]];
        std::array::from_fn(|i| lists[i / 3][i % 3])
    }

    /// From [`Self::to_words`].
    pub fn from_words(words: [i64; 12]) -> Self {
        let list = |at: usize| [words[at], words[at + 1], words[at + 2]];
        Self { glossy: [list(0), list(3)], unfiltered: [list(6), list(9)] }
    }
}

impl Own {
    /// Adds other sums.
    pub fn absorb(&mut self, other: &Self) {
        let (mine, others) = (self.to_words(), other.to_words());
        *self = Self::from_words(std::array::from_fn(|i| mine[i].saturating_add(others[i])));
    }
}

/// All pairs of one part.
#[derive(Debug, Default)]
pub(crate) struct Pairs {
    /// Sorted and without repetition.
    united: PackedPairs,
    /// Of blocks that have ended since, sorted block by block.
    recent: PackedPairs,
    /// Of the current block, as they come.
    block: Vec<Pair>,
    /// See [`Own::glossy`], of slots that have some.
    glossy: SlotSums,
    /// See [`Own::unfiltered`], likewise: there are hardly any.
    unfiltered: SlotSums,
}

impl Pairs {
    /// A path of `slot` reads `cell` of a tree; false if its throughput does not fit, 2¹¹ or not a number.
    #[inline]
    #[must_use]
    pub fn add(&mut self, slot: u32, lobe: Lobe, tree: u32, cell: u32, throughput: Vec3) -> bool {
        const SCALE: f32 = (1 << THROUGHPUT_BITS) as f32;
        if !throughput.is_finite() || throughput.abs().max_element() >= (i32::MAX as f32) / SCALE {
            return false;
        }
        let throughput = (throughput * SCALE).to_array().map(|x| (x + 0.5f32.copysign(x)) as i32);
        let pair = Pair { slot_lobe_tree: Pair::label_of(slot, lobe, tree), cell, throughput };
        // A pixel's samples come one after the other and mostly read one of a few cells.
        let recent = self.block.len().saturating_sub(8);
        let mut of_slot = self.block[recent..].iter_mut().rev().take_while(|known| known.slot() == slot);
        let known = of_slot.find(|known| known.order() == pair.order());
        if !known.is_some_and(|known| known.absorb(&pair)) {
            self.block.push(pair);
        }
        true
    }

    /// Adds what a path brings through glossy lobes.
    pub fn add_own(&mut self, slot: u32, odd: bool, radiance: Vec3, quantum: &Quantum) {
        self.glossy.add(slot, odd.into(), quanta(radiance, quantum));
    }

    /// Adds what a path brings that no cell could take.
    pub fn add_unfiltered(&mut self, slot: u32, lobe: Lobe, radiance: Vec3, quantum: &Quantum) {
        self.unfiltered.add(slot, lobe as usize, quanta(radiance, quantum));
    }

    /// Sums of slots, by slot.
    fn own(&self) -> Vec<(u32, Own)> {
        let mut own = Vec::with_capacity(self.glossy.len().max(self.unfiltered.len()));
        let mut unfiltered = self.unfiltered.iter().peekable();
        for (slot, glossy) in self.glossy.iter() {
            while let Some((slot, unfiltered)) = unfiltered.next_if(|(at, _)| *at < slot) {
                own.push((slot, Own { unfiltered, ..Own::default() }));
            }
            let same = unfiltered.next_if(|(at, _)| *at == slot).map(|(_, sums)| sums);
            own.push((slot, Own { glossy, unfiltered: same.unwrap_or_default() }));
        }
        own.extend(unfiltered.map(|(slot, unfiltered)| (slot, Own { unfiltered, ..Own::default() })));
        own
    }

    /// Begins a block, with memory of the last one's.
    pub fn begin_block(&mut self, room: Vec<Pair>) {
        self.block = room;
    }

    /// Ends a block; its memory, and that of `room`, are for the next one, whosever it is.
    pub fn end_block(&mut self, room: &mut Vec<Pair>) -> Vec<Pair> {
        let mut block = std::mem::take(&mut self.block);
        block.sort_unstable_by_key(Pair::order);
        Pair::unite(&mut block);
        // Only when there is as much again: that keeps the work per path constant.
        if self.recent.len() + block.len() >= self.united.len() {
            self.unite(&block, room);
        } else {
            self.recent.extend(&block);
        }
        self.glossy.shrink();
        self.unfiltered.shrink();
        block.clear();
        block
    }

    /// Orders the pairs of blocks that have ended.
    pub fn settle(&mut self) {
        if self.recent.len() > 0 {
            self.unite(&[], &mut Vec::new());
        }
    }

    /// All pairs by slot and cell, after [`Self::settle`].
    pub fn settled(&self) -> Vec<Pair> {
        assert_eq!(self.recent.len() + self.block.len(), 0, "pairs are read before they were settled");
        self.united.iter().collect()
    }

    /// Sums of slots that need no cell.
    pub fn own_sums(&self) -> Vec<(u32, Own)> {
        self.own()
    }

    /// Adds others', whose cells have the numbers of the large tables.
    pub fn absorb(&mut self, pairs: impl Iterator<Item = Pair>) {
        self.block.extend(pairs);
        self.end_block(&mut Vec::new());
    }

    /// Adds others' own sums.
    pub fn absorb_own(&mut self, own: &[(u32, Own)]) {
        for (slot, sums) in own {
            // A slot that has sums keeps them, even of zeros: what is stored again is what was stored.
            sums.glossy.into_iter().enumerate().for_each(|(which, sum)| self.glossy.add(*slot, which, sum));
            if sums.unfiltered != [[0; 3]; 2] {
                sums.unfiltered.into_iter().enumerate().for_each(|(which, sum)| self.unfiltered.add(*slot, which, sum));
            }
        }
    }

    /// Adds a sorted block, and all blocks before it, to those that are united.
    fn unite(&mut self, block: &[Pair], pairs: &mut Vec<Pair>) {
        let (united, recent) = (std::mem::take(&mut self.united), std::mem::take(&mut self.recent));
        pairs.clear();
        pairs.reserve(united.len() + recent.len() + block.len());
        pairs.extend(united.iter().chain(recent.iter()));
        pairs.extend_from_slice(block);
        // The stable sort finds the sorted runs and merges them.
        pairs.sort_by_key(Pair::order);
        Pair::unite(pairs);
        drop((united, recent));
        self.united.extend(pairs);
    }

    /// Number of pairs.
    pub fn len(&self) -> usize {
        self.united.len() + self.recent.len() + self.block.len()
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.united.bytes() + self.recent.bytes() + self.glossy.bytes() + self.unfiltered.bytes()
    }

    /// What every slot gets when `read` tells the estimate of a cell. By slot.
    pub fn resolve(&mut self, quantum: &Quantum, read: impl Fn(Lobe, usize, u32) -> [f32; 3]) -> Vec<(u32, Resolved)> {
        self.settle();
        let mut lobes: Vec<(u32, [[i128; 3]; 2])> = Vec::new();
        let estimate = |pair: &Pair| read(pair.lobe(), pair.tree() as usize, pair.cell);
        products(&self.settled(), quantum, estimate, |pair, product| {
            match lobes.last_mut() {
                Some((slot, sums)) if *slot == pair.slot() => add(&mut sums[pair.lobe() as usize], &product),
                _ => {
                    let mut sums = [[0; 3]; 2];
                    sums[pair.lobe() as usize] = product;
                    lobes.push((pair.slot(), sums));
                }
            };
        });
        let lobes = lobes.into_iter().map(|(slot, sums)| (slot, sums.map(|sum| radiance(sum, quantum))));
        resolve(lobes, &self.own(), quantum)
    }
}

/// Calls `take` with what sorted pairs read when `read` tells the estimate of a pair's cell: a pair of each slot and cell,
/// and throughput times estimate. All pairs of a tree come at once.
///
/// Products are rounded one by one, to be summed as integers: the order of cells within a slot, which depends on who met
/// them first, does not count, nor that of trees.
fn products(
    pairs: &[Pair],
    quantum: &Quantum,
    read: impl Fn(&Pair) -> [f32; 3],
    mut take: impl FnMut(&Pair, [i128; 3]),
) {
    let scale = 2f64.powi(RESOLVED_BITS) / quantum.radiance();
    // What overflowed one pair is in others beside it: all of a cell's throughput is summed before it is used, so that
    // where the overflow came does not count either.
    for same in pairs.chunk_by(|a, b| a.order() == b.order()) {
        let throughput: [i64; 3] = std::array::from_fn(|c| same.iter().map(|p| i64::from(p.throughput[c])).sum());
        let estimate = read(&same[0]);
        take(&same[0], std::array::from_fn(|c| whole(throughput[c] as f64 * f64::from(estimate[c]) * scale)));
    }
}

fn add(sum: &mut [i128; 3], other: &[i128; 3]) {
    sum.iter_mut().zip(other).for_each(|(sum, x)| *sum += x);
}

/// Adds what sorted pairs of a tree read, when `read` tells the estimate of a pair's cell, to the sums of slots from `first`
/// on.
pub(crate) fn gather(
    pairs: &[Pair],
    quantum: &Quantum,
    read: impl Fn(&Pair) -> [f32; 3],
    first: u32,
    sums: &mut [[i128; 3]],
) {
    products(pairs, quantum, read, |pair, product| add(&mut sums[(pair.slot() - first) as usize], &product));
}

/// What a slot gets: what it has read through diffuse lobes and through glossy ones, and its own sums.
pub(crate) fn resolved([diffuse, glossy]: [Vec3; 2], own: &Own, quantum: &Quantum) -> Resolved {
    let own_radiance = |sum: [i64; 3]| {
        (DVec3::from_array(sum.map(|x| x as f64)) * quantum.radiance() * 2f64.powi(OWN_SHIFT)).as_vec3()
    };
    Resolved {
        diffuse: diffuse + own_radiance(own.unfiltered[0]),
        glossy: glossy + own_radiance(own.unfiltered[1]),
        glossy_own: own.glossy.map(own_radiance),
    }
}

/// The same of all slots, from two lists by slot of which either may lack slots of the other.
fn resolve(
    lobes: impl Iterator<Item = (u32, [Vec3; 2])>,
    own: &[(u32, Own)],
    quantum: &Quantum,
) -> Vec<(u32, Resolved)> {
    let mut own = own.iter().peekable();
    let mut slots = Vec::with_capacity(lobes.size_hint().0);
    for (slot, lobes) in lobes {
        while let Some((slot, own)) = own.next_if(|(at, _)| *at < slot) {
            slots.push((*slot, resolved(Default::default(), own, quantum)));
        }
        let own = own.next_if(|(at, _)| *at == slot).map_or(Own::default(), |(_, own)| *own);
        slots.push((slot, resolved(lobes, &own, quantum)));
    }
    slots.extend(own.map(|(slot, own)| (*slot, resolved(Default::default(), own, quantum))));
    slots
}

/// Radiance of a sum of products.
pub(crate) fn radiance(sum: [i128; 3], quantum: &Quantum) -> Vec3 {
    let unit = quantum.radiance() * 2f64.powi(-RESOLVED_BITS - THROUGHPUT_BITS);
    (DVec3::from_array(sum.map(float)) * unit).as_vec3()
}

/// A number of either sign, cut towards zero; nearly all are short, for which there are instructions.
#[inline]
fn whole(x: f64) -> i128 {
    if x.abs() < 2f64.powi(63) { i128::from(x as i64) } else { x as i128 }
}

/// Nearest number, likewise.
#[inline]
fn float(x: i128) -> f64 {
    i64::try_from(x).map_or_else(|_| x as f64, |x| x as f64)
}

/// Quanta of the resolved sums per quantum of radiance times throughput, log₂: 2⁻¹⁰ of a rounding that f32 makes anyway.
const RESOLVED_BITS: i32 = 10;

/// Quanta of a slot's own sums are coarser than those of cells by this power of two.
const OWN_SHIFT: i32 = 6;

/// Radiance in quanta of a slot's own sums.
fn quanta(radiance: Vec3, quantum: &Quantum) -> [i64; 3] {
    let scale = 2f64.powi(-OWN_SHIFT) / quantum.radiance();
    // A cast saturates and turns NaN into 0; the renderer rejects such samples before they come here.
    radiance.as_dvec3().to_array().map(|x| (x * scale).round() as i64)
}
