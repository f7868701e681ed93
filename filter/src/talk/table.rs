//! Slots that keys compete for, and a settlement that does not depend on who comes first.

use std::sync::atomic::{AtomicU8, AtomicU64, Ordering::Relaxed};

use rayon::prelude::*;

use super::key::Key;
use super::params::Params;

/// A table of verification words with linear probing over a few slots.
///
/// A word is a priority (upper 7 bits, 0 the strongest) above hashed bits, and the smaller word takes the slot: one atomic
/// minimum decides collision and eviction, as in the talk. What loses goes on to its next slot.
///
/// In the talk a key that lost a slot after it had been granted is lost for the frame, and which it is depends on timing.
/// Here keys are settled before anything is added. They propose to their slots one by one, and a slot keeps the smallest
/// word that ever proposed. That is deferred acceptance: slots only ever improve, so no key is turned away from a slot
/// that it would have in the end, and the end is the same in any order, the stable matching of keys and slots \[Gale62\].
/// It is what filling the table in ascending order of words would give.
#[derive(Debug)]
pub struct Table {
    words: Vec<AtomicU64>,
    /// Hashed bits of the keys that had the slots after the last settlement, or [`EMPTY`].
    owners: Vec<u64>,
    /// Slots from the home of the key to where it is.
    distances: Vec<AtomicU8>,
    probes: u8,
    new: u64,
}

/// Number of a slot.
pub type Place = u32;

/// Where keys came to be.
#[derive(Debug)]
pub struct Settled {
    /// By part and key; [`Table::NOWHERE`] for keys that no slot was left for.
    pub places: Vec<Vec<Place>>,
    /// Slots whose residents gave way to new keys, ascending.
    pub evicted: Vec<Place>,
    /// How often keys went through the table.
    pub rounds: u32,
}

/// A key that is not in the table yet.
#[derive(Clone, Copy, Debug)]
struct Search {
    /// Of its part.
    key: u32,
    /// Slots that it was turned away from.
    step: u8,
}

const EMPTY: u64 = u64::MAX;
const HASHED: u64 = (1 << Params::HASHED_BITS) - 1;

impl Table {
    /// No slot.
    pub const NOWHERE: Place = Place::MAX;

    /// An empty table of `slots` slots, of which a key may look at `probes`. New keys compete as if they had priority
    /// `new`, 1 to 126.
    pub fn new(slots: usize, probes: u8, new: u32) -> Self {
        let slots = slots.clamp(1, Self::NOWHERE as usize);
        Self {
            words: (0..slots).map(|_| AtomicU64::new(EMPTY)).collect(),
            owners: vec![EMPTY; slots],
            distances: (0..slots).map(|_| AtomicU8::new(u8::MAX)).collect(),
            probes,
            new: u64::from(new) << Params::HASHED_BITS,
        }
    }

    /// Number of slots.
    pub fn len(&self) -> usize {
        self.words.len()
    }

    #[inline]
    fn slot(&self, key: Key, step: u8) -> usize {
        let slots = self.words.len();
        let home = ((u128::from(key.home) * slots as u128) >> 64) as usize;
        (home + usize::from(step)) % slots
    }

    /// Gives slots to keys. Residents that are among them get priority 0, others keep theirs and may lose their slot to a
    /// new key.
    pub fn settle(&mut self, parts: &[Vec<Key>]) -> Settled {
        let (mut places, mut searches): (Vec<_>, Vec<_>) = parts.par_iter().map(|keys| self.residents(keys)).unzip();
        let rounds = self.compete(parts, &mut searches);
        let evicted = self.change_owners();
        parts.par_iter().zip(&mut places).zip(&searches).for_each(|((keys, places), searches)| {
            for &Search { key, step } in searches {
                let slot = self.slot(keys[key as usize], step);
                // Two keys with one word, of different homes, count as the nearer.
                self.distances[slot].fetch_min(step, Relaxed);
                places[key as usize] = slot as Place;
            }
        });
        Settled { places, evicted, rounds }
    }

    /// Lets new keys propose until nothing changes; how often.
    fn compete(&self, parts: &[Vec<Key>], searches: &mut [Vec<Search>]) -> u32 {
        let mut rounds = 0;
        // Keys are turned away only by keys that take their place, so a round without such is the last.
        let mut displaced = true;
        while displaced {
            rounds += 1;
            displaced = parts
                .par_iter()
                .zip(&mut *searches)
                .map(|(keys, searches)| self.propose(keys, searches))
                .reduce(|| false, |a, b| a | b);
        }
        rounds
    }

    /// Notes who has each slot now; slots that had another resident before.
    fn change_owners(&mut self) -> Vec<Place> {
        self.words
            .par_iter_mut()
            .zip(&mut self.owners)
            .zip(&mut self.distances)
            .enumerate()
            .filter_map(|(slot, ((word, owner), distance))| {
                let word = *word.get_mut();
                let now = if word == EMPTY { EMPTY } else { word & HASHED };
                if now == *owner {
                    return None;
                }
                *distance.get_mut() = u8::MAX;
                let before = std::mem::replace(owner, now);
                (before != EMPTY).then_some(slot as Place)
            })
            .collect()
    }

    /// Places of residents; searches for all other keys. Hashed bits do not change meanwhile, so threads do not either.
    fn residents(&self, keys: &[Key]) -> (Vec<Place>, Vec<Search>) {
        let mut searches = Vec::new();
        let places = keys
            .iter()
            .zip(0..)
            .map(|(&key, at)| {
                let resident = (0..self.probes).map(|step| self.slot(key, step)).find(|&slot| {
                    let word = self.words[slot].load(Relaxed);
                    word != EMPTY && word & HASHED == key.verification
                });
                let Some(slot) = resident else {
                    searches.push(Search { key: at, step: 0 });
                    return Self::NOWHERE;
                };
                if self.words[slot].load(Relaxed) != key.verification {
                    self.words[slot].fetch_min(key.verification, Relaxed);
                }
                slot as Place
            })
            .collect();
        (places, searches)
    }

    /// Lets keys propose to further slots until one keeps them; forgets keys that ran out of slots. Whether any key or
    /// resident lost its slot.
    fn propose(&self, keys: &[Key], searches: &mut Vec<Search>) -> bool {
        let mut displaced = false;
        searches.retain_mut(|search| {
            let key = keys[search.key as usize];
            let word = self.new | key.verification;
            while search.step < self.probes {
                let slot = &self.words[self.slot(key, search.step)];
                // Mostly the word is there already: by an earlier round, or another path with the same key.
                if slot.load(Relaxed) == word {
                    return true;
                }
                let old = slot.fetch_min(word, Relaxed);
                if old >= word {
                    displaced |= old != EMPTY && old != word;
                    return true;
                }
                search.step += 1;
            }
            false
        });
        displaced
    }

    /// Gives residents new priorities, at most 126.
    pub fn prioritise(&mut self, priority: impl Fn(usize) -> u32 + Sync) {
        self.words.par_iter_mut().enumerate().for_each(|(slot, word)| {
            let word = word.get_mut();
            if *word != EMPTY {
                *word = u64::from(priority(slot).min(126)) << Params::HASHED_BITS | *word & HASHED;
            }
        });
    }

    /// Number of residents by slots looked at to find them: entry i for i + 1.
    pub fn histogram(&self) -> Vec<u64> {
        let mut histogram = vec![0; usize::from(self.probes)];
        for (word, distance) in self.words.iter().zip(&self.distances) {
            if word.load(Relaxed) != EMPTY {
                histogram[usize::from(distance.load(Relaxed))] += 1;
            }
        }
        histogram
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.words.len() * (2 * size_of::<u64>() + size_of::<u8>())
    }
}

#[cfg(test)]
#[path = "table_tests.rs"]
mod tests;
