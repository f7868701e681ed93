//! Sums of slots that need no cell.

use std::collections::BTreeMap;

/// Two sums of three channels for each of some slots, by slot.
#[derive(Debug, Default)]
pub(crate) struct SlotSums {
    /// What sums usually hold: a frame has millions of them.
    sums: Vec<(u32, [[i32; 3]; 2])>,
    /// What comes to it, of slots whose sums did not fit.
    wide: BTreeMap<u32, [[i64; 3]; 2]>,
    /// Where in the list the last path's slot is.
    last: usize,
}

impl SlotSums {
    /// Adds to one of the sums of a slot. A slot that was added to has sums, even of zeros.
    pub fn add(&mut self, slot: u32, which: usize, quanta: [i64; 3]) {
        let at = self.at(slot);
        for (c, x) in quanta.into_iter().enumerate() {
            let narrow = &mut self.sums[at].1[which][c];
            let sum = i64::from(*narrow).saturating_add(x);
            *narrow = i32::try_from(sum).unwrap_or_else(|_| {
                let wide = &mut self.wide.entry(slot).or_default()[which][c];
                *wide = wide.saturating_add(sum);
                0
            });
        }
    }

    /// Where the sums of a slot are.
    fn at(&mut self, slot: u32) -> usize {
        // Paths of a slot come one after the other.
        if self.sums.get(self.last).is_none_or(|(at, _)| *at != slot) {
            self.last = self.sums.binary_search_by_key(&slot, |(at, _)| *at).unwrap_or_else(|at| {
                if self.sums.len() == self.sums.capacity() {
                    self.sums.reserve_exact((self.sums.len() / 4).max(16));
                }
                self.sums.insert(at, (slot, Default::default()));
                at
            });
        }
        self.last
    }

    /// All of them, by slot.
    pub fn iter(&self) -> impl Iterator<Item = (u32, [[i64; 3]; 2])> + '_ {
        self.sums.iter().map(|(slot, narrow)| {
            let mut sums = self.wide.get(slot).copied().unwrap_or_default();
            for (sum, x) in sums.as_flattened_mut().iter_mut().zip(narrow.as_flattened()) {
                *sum = sum.saturating_add((*x).into());
            }
            (*slot, sums)
        })
    }

    /// Number of slots.
    pub fn len(&self) -> usize {
        self.sums.len()
    }

    /// Gives back room: from block to block hardly a slot comes to those that there are.
    pub fn shrink(&mut self) {
        self.sums.shrink_to_fit();
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.sums.capacity() * size_of::<(u32, [[i32; 3]; 2])>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_any_size_are_exact() {
        let mut sums = SlotSums::default();
        let mut expected: BTreeMap<u32, [[i64; 3]; 2]> = BTreeMap::new();
        let mut state = 1u64;
        for k in 0..10_000u32 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let (slot, which) = ((state >> 59) as u32, (state >> 58 & 1) as usize);
            let quanta = [state as i32 as i64 >> (k % 20), (state as i64) >> (k % 50 + 10), 0];
            sums.add(slot, which, quanta);
            let known = &mut expected.entry(slot).or_default()[which];
            (0..3).for_each(|c| known[c] += quanta[c]);
        }
        assert!(!sums.wide.is_empty());
        sums.shrink();
        assert_eq!(sums.len(), expected.len());
        assert_eq!(sums.iter().collect::<Vec<_>>(), expected.into_iter().collect::<Vec<_>>());
    }
}
