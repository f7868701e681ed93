//! Coverage of pixels by what has a name.

/// What is named.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Named {
    /// Objects.
    Object,
    /// Materials.
    Material,
}

/// Share of a pixel that each name has, by the names' ids. Sums are of integers, and no name is ever dropped, so no bit
/// depends on the order of samples and slices.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Matte {
    /// Id and Σ w in quanta, by rising id.
    entries: Vec<(u32, i64)>,
}

/// Names of a pixel that a file has room for, largest first.
pub const RANKS: usize = 6;

impl Matte {
    /// Adds a sample's weight.
    #[inline]
    pub fn add(&mut self, id: u32, quanta: i64) {
        match self.entries.binary_search_by_key(&id, |entry| entry.0) {
            Ok(at) => self.entries[at].1 = self.entries[at].1.saturating_add(quanta),
            // Most pixels see one thing.
            Err(at) => {
                self.entries.reserve_exact(1);
                self.entries.insert(at, (id, quanta));
            }
        }
    }

    /// Adds the samples of another film's pixel.
    pub fn merge(&mut self, other: &Self) {
        other.entries.iter().for_each(|&(id, quanta)| self.add(id, quanta));
    }

    /// Ids with the largest shares of `coverage`, which is that of all of them, as a file has them: largest first, then by id;
    /// empty ranks are 0.
    ///
    /// A name that a filter's negative lobes leave with less than nothing has none, and the others share the coverage.
    pub fn ranks(&self, coverage: f32) -> [(u32, f32); RANKS] {
        let mut seen: Vec<(u32, i64)> = self.entries.iter().copied().filter(|(_, quanta)| *quanta > 0).collect();
        seen.sort_by_key(|&(id, quanta)| (std::cmp::Reverse(quanta), id));
        let total: f64 = seen.iter().map(|(_, quanta)| *quanta as f64).sum();
        let mut ranks = [(0, 0.0); RANKS];
        for (rank, (id, quanta)) in ranks.iter_mut().zip(seen) {
            *rank = (id, (quanta as f64 / total * f64::from(coverage)) as f32);
        }
        ranks
    }

    /// Appends the number of names, and each with its sum, to be stored.
    pub fn store(&self, words: &mut Vec<u64>) {
        words.push(self.entries.len() as u64);
        words.extend(self.entries.iter().flat_map(|&(id, quanta)| [u64::from(id), quanta as u64]));
    }

    /// Takes what [`Self::store`] appended off the front; `None` where there is no such thing.
    pub fn load(words: &mut &[u64]) -> Option<Self> {
        let (&count, rest) = words.split_first()?;
        let (own, rest) = rest.split_at_checked(usize::try_from(count).ok()?.checked_mul(2)?)?;
        *words = rest;
        let mut matte = Self::default();
        for entry in own.chunks_exact(2) {
            matte.add(u32::try_from(entry[0]).ok()?, entry[1] as i64);
        }
        Some(matte)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_merge_to_the_whole_in_any_order_and_survive_storing() {
        let samples: Vec<(u32, i64)> = (0..300u64).map(|k| ((k * k % 17) as u32 * 99, (k as i64 % 11) - 2)).collect();
        let matte = |range: std::ops::Range<usize>| {
            let mut matte = Matte::default();
            samples[range].iter().for_each(|&(id, quanta)| matte.add(id, quanta));
            let mut words = Vec::new();
            matte.store(&mut words);
            let mut rest = words.as_slice();
            let loaded = Matte::load(&mut rest).unwrap();
            assert!(rest.is_empty() && Matte::load(&mut &words[1..]).is_none_or(|other| other != matte));
            loaded
        };
        let whole = matte(0..300);
        for parts in [[0..7, 7..150, 150..300], [150..300, 0..7, 7..150]] {
            let mut merged = Matte::default();
            parts.into_iter().for_each(|part| merged.merge(&matte(part)));
            assert_eq!(merged, whole);
        }
    }

    #[test]
    fn the_largest_come_first_and_share_the_coverage() {
        let mut matte = Matte::default();
        [(7, 10), (3, 30), (5, 10), (9, -5)].into_iter().for_each(|(id, quanta)| matte.add(id, quanta));
        assert_eq!(matte.ranks(0.5)[..4], [(3, 0.3), (5, 0.1), (7, 0.1), (0, 0.0)]);
        assert_eq!(Matte::default().ranks(0.0), [(0, 0.0); RANKS]);
    }
}
