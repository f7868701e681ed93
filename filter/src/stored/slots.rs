//! What slots sum up without a cell.

use std::ops::Range;

use super::{StoredError, Words};
use crate::pairs::Own;

/// What the slots of a part sum up without a cell.
///
/// | words | what |
/// |---|---|
/// | 1 | number of slots with such sums |
/// | 13 | of each, by slot: step from the last slot, or at first from that of the part; four sums of radiance |
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Slots(pub(super) Vec<(u32, Own)>);

impl Slots {
    /// Reads what [`crate::Adaptive::store_slots`] or [`Self::store`] appended for a part with these slots.
    ///
    /// # Errors
    /// There are no such sums.
    pub fn read(slots: &Range<u32>, words: &[u64]) -> Result<Self, StoredError> {
        let mut words = Words(words);
        let count = words.count(13)?;
        let mut own = Vec::with_capacity(count);
        let mut next = u64::from(slots.start);
        for _ in 0..count {
            let [step] = words.take()?;
            let slot = next.checked_add(step).filter(|slot| *slot < slots.end.into()).ok_or(StoredError)?;
            own.push((slot as u32, Own::from_words(words.take::<12>()?.map(|x| x as i64))));
            next = slot + 1;
        }
        words.end()?;
        Ok(Self(own))
    }

    /// Adds another filter's sums of the same part.
    pub fn add(&mut self, other: Self) {
        if self.0.is_empty() {
            *self = other;
            return;
        }
        self.0.extend(other.0);
        self.0.sort_by_key(|(slot, _)| *slot);
        self.0.dedup_by(|(slot, next), (kept, own)| {
            let same = slot == kept;
            if same {
                own.absorb(next);
            }
            same
        });
    }

    /// Appends the sums, of a part with these slots, as [`crate::Adaptive::store_slots`] does.
    pub fn store(&self, slots: &Range<u32>, words: &mut Vec<u64>) {
        store(&self.0, slots, words);
    }
}

/// Appends sums, which come by slot.
pub(super) fn store(own: &[(u32, Own)], slots: &Range<u32>, words: &mut Vec<u64>) {
    words.push(own.len() as u64);
    let mut next = slots.start;
    for (slot, own) in own {
        words.push((slot - next).into());
        words.extend(own.to_words().map(|x| x as u64));
        next = slot + 1;
    }
}
