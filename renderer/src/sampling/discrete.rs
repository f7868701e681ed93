//! Discrete distributions.

/// Draws an index with probability proportional to its weight, in constant time.
///
/// **Source**: \[Walker77\], built by \[Vose91\].
#[derive(Clone, Debug, PartialEq)]
pub struct AliasTable {
    bins: Box<[Bin]>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Bin {
    /// The bin stands for its own index below this fraction of 2³², for `alias` above.
    threshold: u32,
    alias: u32,
    pmf: f32,
}

impl AliasTable {
    /// The table of `weights`; `None` if there are none.
    ///
    /// A weight that is not positive and finite counts as 0; if all do, every index is equally probable.
    ///
    /// **Panics**: on more than 2³² weights.
    pub fn new(weights: &[f32]) -> Option<Self> {
        let count = u32::try_from(weights.len()).expect("an alias table indexes by u32");
        if count == 0 {
            return None;
        }
        let weight = |w: f32| if w > 0.0 && w.is_finite() { f64::from(w) } else { 0.0 };
        let sum: f64 = weights.iter().map(|&w| weight(w)).sum();
        let pmf: Vec<f64> = if sum > 0.0 {
            weights.iter().map(|&w| weight(w) / sum).collect()
        } else {
            vec![1.0 / f64::from(count); weights.len()]
        };
        Some(Self { bins: fill(&pmf) })
    }

    /// The number of indices: at least 1.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.bins.len()
    }

    /// The index that `u` in [0, 1) selects, and its probability.
    #[inline]
    pub fn sample(&self, u: f32) -> (usize, f32) {
        // Exact: a power of two; the cast drops digits below 2⁻³², and saturates if `u` were out of range.
        self.sample_bits((u * 4_294_967_296.0) as u32)
    }

    /// As [`Self::sample`], for a uniform 32-bit integer: use it where there are more than thousands of indices.
    #[inline]
    pub fn sample_bits(&self, u: u32) -> (usize, f32) {
        let scaled = u64::from(u) * self.bins.len() as u64;
        let (index, fraction) = ((scaled >> 32) as usize, scaled as u32);
        let bin = &self.bins[index];
        if fraction < bin.threshold {
            (index, bin.pmf)
        } else {
            let alias = bin.alias as usize;
            (alias, self.bins[alias].pmf)
        }
    }

    /// The probability of `index`.
    #[inline]
    pub fn pmf(&self, index: usize) -> f32 {
        self.bins[index].pmf
    }
}

/// Pairs each bin that is less than full with one that is more, until all are level.
fn fill(pmf: &[f64]) -> Box<[Bin]> {
    let count = pmf.len() as f64;
    let mut level: Vec<f64> = pmf.iter().map(|p| p * count).collect();
    // A bin that is its own alias needs no threshold: rounding leaves a few such bins, full but for an ulp.
    let mut bins: Box<[Bin]> =
        pmf.iter().enumerate().map(|(i, &p)| Bin { threshold: u32::MAX, alias: i as u32, pmf: p as f32 }).collect();
    let (mut under, mut over): (Vec<usize>, Vec<usize>) = (0..pmf.len()).partition(|&i| level[i] < 1.0);
    // Rounding can run out of over-full bins while bins of probability 0 are left. They must still never be drawn.
    let most_probable = (0..pmf.len()).max_by(|&a, &b| pmf[a].total_cmp(&pmf[b])).unwrap_or(0);
    while let Some(low) = under.pop() {
        let Some(&high) = over.last() else {
            if pmf[low] == 0.0 {
                (bins[low].threshold, bins[low].alias) = (0, most_probable as u32);
            }
            continue;
        };
        bins[low].threshold = (level[low] * 4_294_967_296.0).round() as u32;
        bins[low].alias = high as u32;
        level[high] -= 1.0 - level[low];
        if level[high] < 1.0 {
            over.pop();
            under.push(high);
        }
    }
    bins
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::mix64;
    use crate::sampling::stats::chi2_p_value;
    use proptest::prelude::*;

    /// The probabilities that the bins really realise, in units of 2⁻³² / n.
    fn realised(table: &AliasTable) -> Vec<f64> {
        let mut mass = vec![0.0; table.len()];
        for (i, bin) in table.bins.iter().enumerate() {
            let threshold = if bin.alias as usize == i { 1.0 } else { f64::from(bin.threshold) / 4_294_967_296.0 };
            mass[i] += threshold / table.len() as f64;
            mass[bin.alias as usize] += (1.0 - threshold) / table.len() as f64;
        }
        mass
    }

    proptest! {
        #[test]
        fn bins_realise_the_probabilities(weights in prop::collection::vec(0.0f32..100.0, 1..200)) {
            let table = AliasTable::new(&weights).unwrap();
            // Each index gains or loses half a unit of 2⁻³²/n per bin that it is the alias of, plus its f32 rounding.
            let bound = |pmf: f64| 0.5 / 4_294_967_296.0 + pmf * f64::from(f32::EPSILON) + 1e-12;
            for (i, mass) in realised(&table).into_iter().enumerate() {
                let pmf = f64::from(table.pmf(i));
                prop_assert!((mass - pmf).abs() <= bound(pmf), "{mass} {pmf}");
            }
        }
    }

    #[test]
    fn impossible_indices_are_never_drawn() {
        let table = AliasTable::new(&[0.0, 3.0, f32::NAN, -1.0, 1.0, f32::INFINITY, 0.0]).unwrap();
        assert_eq!((table.pmf(1), table.pmf(4)), (0.75, 0.25));
        for i in 0..100_000_u64 {
            let (index, pmf) = table.sample_bits(mix64(i) as u32);
            assert!(index == 1 || index == 4);
            assert_eq!(pmf, table.pmf(index));
        }
        for u in [0, u32::MAX] {
            assert!(table.sample_bits(u).1 > 0.0);
        }
    }

    #[test]
    fn draws_follow_the_weights() {
        let weights: Vec<f32> = (0..500).map(|i| (i % 17) as f32 * if i % 5 == 0 { 20.0 } else { 1.0 }).collect();
        let table = AliasTable::new(&weights).unwrap();
        let n = 1 << 20;
        let mut counts = vec![0.0; weights.len()];
        for i in 0..n {
            counts[table.sample((mix64(i) >> 40) as f32 / (1 << 24) as f32).0] += 1.0;
        }
        let expected: Vec<f64> = (0..weights.len()).map(|i| n as f64 * f64::from(table.pmf(i))).collect();
        let p = chi2_p_value(&counts, &expected);
        assert!(p > 1e-4, "p = {p}");
    }

    #[test]
    fn no_weight_at_all_means_uniform() {
        assert!(AliasTable::new(&[]).is_none());
        let table = AliasTable::new(&[0.0; 4]).unwrap();
        assert_eq!([0.0, 0.3, 0.6, 0.9].map(|u| table.sample(u)), [(0, 0.25), (1, 0.25), (2, 0.25), (3, 0.25)]);
    }
}
