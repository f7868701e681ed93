use super::*;
use crate::hash::mix64;

/// `count` distinct keys, well mixed, with all hashed bits.
fn keys(count: u64, seed: u64) -> Vec<Key> {
    (0..count)
        .map(|i| {
            let home = mix64(seed << 40 | i);
            Key { home, verification: mix64(home ^ 0x5851_f42d_4c95_7f2d) & HASHED }
        })
        .collect()
}

fn parts(keys: &[Key], count: usize) -> Vec<Vec<Key>> {
    keys.chunks(keys.len().div_ceil(count)).map(<[Key]>::to_vec).collect()
}

/// Filling the table in ascending order of words, one key at a time: what a settlement should come to.
fn serially(slots: usize, probes: u8, keys: &[Key]) -> Vec<Option<u64>> {
    let table = Table::new(slots, probes, 1);
    let mut filled = vec![None; slots];
    let mut sorted = keys.to_vec();
    sorted.sort_by_key(|key| key.verification);
    sorted.dedup();
    for key in sorted {
        let free = (0..probes).map(|step| table.slot(key, step)).find(|&slot| filled[slot].is_none());
        if let Some(slot) = free {
            filled[slot] = Some(key.verification);
        }
    }
    filled
}

fn content(table: &Table) -> Vec<Option<u64>> {
    table.owners.iter().map(|&owner| (owner != EMPTY).then_some(owner)).collect()
}

fn with_threads<T: Send>(threads: usize, f: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(f)
}

#[test]
fn a_settlement_is_the_same_in_any_order_by_any_number_of_threads() {
    let mut keys = keys(3000, 1);
    for (slots, probes) in [(1000, 4), (2500, 3), (6000, 8)] {
        let expected = serially(slots, probes, &keys);
        for threads in [1, 2, 3, 7] {
            // Another order, and paths with the same key.
            keys.sort_by_key(|key| mix64(key.home ^ threads as u64));
            let mut with_copies = keys.clone();
            with_copies.extend_from_slice(&keys[..1000]);
            let mut table = Table::new(slots, probes, 1);
            let parts = parts(&with_copies, 4 * threads + 1);
            let settled = with_threads(threads, || table.settle(&parts));
            assert!(content(&table) == expected, "{slots} slots, {threads} threads");
            for (key, &place) in parts.iter().flatten().zip(settled.places.iter().flatten()) {
                let at = expected.iter().position(|&word| word == Some(key.verification));
                assert_eq!(at, (place != Table::NOWHERE).then_some(place as usize));
            }
        }
    }
}

#[test]
fn keys_with_equal_words_settle_the_same_in_any_order() {
    // Three bits of verification: most words are shared by keys of different homes.
    let mut keys = keys(200, 2);
    keys.iter_mut().for_each(|key| key.verification &= 7);
    let mut contents = Vec::new();
    for order in 0..20 {
        keys.sort_by_key(|key| mix64(key.home ^ order));
        let mut table = Table::new(300, 5, 1);
        table.settle(&parts(&keys, 3));
        contents.push((content(&table), table.histogram()));
    }
    assert!(contents.windows(2).all(|pair| pair[0] == pair[1]));
}

/// Knuth's mean of a successful search, and the shares of keys that need more than 4 and more than 8 slots as measured
/// with 2²⁰ slots. Which key gives way does not change the mean; that it is decided by hashes makes the shares those of
/// filling in random order.
#[test]
fn probes_are_as_many_as_linear_probing_takes() {
    const SLOTS: usize = 1 << 17;
    println!("load  probes (Knuth)   >4        >8        rounds");
    for (load, more_than_4, more_than_8) in
        [(0.1, 8e-5, 0.0), (0.25, 0.0030, 1e-4), (0.5, 0.032, 0.0053), (0.7, 0.093, 0.034), (0.8, 0.139, 0.067)]
    {
        let count = (SLOTS as f64 * load) as u64;
        let mut table = Table::new(SLOTS, 255, 1);
        let settled = table.settle(&parts(&keys(count, 3), 8));
        let histogram = table.histogram();
        assert!(histogram.iter().sum::<u64>() >= count - 10, "keys are missing at load {load}");
        let n = count as f64;
        let mean = histogram.iter().zip(1..).map(|(&cells, probes)| (cells * probes) as f64).sum::<f64>() / n;
        let knuth = 0.5 * (1.0 + 1.0 / (1.0 - load));
        let share = |above: usize| histogram[above..].iter().sum::<u64>() as f64 / n;
        let shares = [share(4), share(8)];
        println!("{load:<5} {mean:.3} ({knuth:.3})    {:.5}   {:.5}   {}", shares[0], shares[1], settled.rounds);
        assert!((mean / knuth - 1.0).abs() < 0.04, "{mean} probes at load {load}, not {knuth}");
        // Six standard deviations of a binomial, twice as wide for clustering, and the digits that the table has.
        for (got, expected) in shares.into_iter().zip([more_than_4, more_than_8]) {
            let bound = 12.0 * (expected / n).sqrt() + 0.06 * expected + 3e-4;
            assert!((got - expected).abs() < bound, "{got} of keys, not {expected}, at load {load}");
        }
    }
}

#[test]
fn what_finds_no_slot_is_nowhere_and_spread_uniformly() {
    // As many keys as slots, four probes each.
    let keys = keys(1 << 16, 4);
    let mut table = Table::new(1 << 16, 4, 1);
    let settled = table.settle(&parts(&keys, 8));
    let mut lost = [0u32; 16];
    for (key, &place) in keys.iter().zip(settled.places.iter().flatten()) {
        lost[(key.home >> 60) as usize] += u32::from(place == Table::NOWHERE);
    }
    let all: u32 = lost.iter().sum();
    println!("{all} of {} keys without a slot", keys.len());
    assert_eq!(all as usize + table.histogram().iter().sum::<u64>() as usize, keys.len());
    let mean = f64::from(all) / 16.0;
    assert!(lost.iter().all(|&lost| (f64::from(lost) - mean).abs() < 6.0 * mean.sqrt()), "{lost:?}");
}

#[test]
fn short_verification_merges_no_more_keys_than_the_bound() {
    // One key of each word is right to be where it is; another with the same word is taken for it if their runs meet.
    const BITS: u32 = 12;
    let mut keys = keys(40_000, 5);
    keys.iter_mut().for_each(|key| key.verification &= (1 << BITS) - 1);
    let mut table = Table::new(80_000, 8, 1);
    let settled = table.settle(&parts(&keys, 8));
    let mut residents = std::collections::BTreeMap::new();
    for &place in settled.places.iter().flatten().filter(|&&place| place != Table::NOWHERE) {
        *residents.entry(place).or_insert(0u64) += 1;
    }
    let merged: u64 = residents.values().map(|count| count - 1).sum();
    let histogram = table.histogram();
    let probes: u64 = histogram.iter().zip(1..).map(|(cells, probes)| cells * probes).sum();
    let bound = 2.0 * probes as f64 / f64::from(1 << BITS);
    println!("{merged} false merges of {} keys, bound {bound:.1}", keys.len());
    assert!(merged > 0 && (merged as f64) < bound, "{merged} false merges, bound {bound}");
}

#[test]
fn residents_stay_where_they_are_found() {
    let old = keys(500, 6);
    let mut table = Table::new(1000, 8, 1);
    let first = table.settle(&parts(&old, 3));
    table.prioritise(|_| 0);
    let both = [old.clone(), keys(500, 7)].concat();
    let second = table.settle(&parts(&both, 1));
    assert!(second.evicted.is_empty());
    let places: Vec<Place> = first.places.concat();
    assert_eq!(places, second.places[0][..500]);
    assert!(places.iter().filter(|&&place| place == Table::NOWHERE).count() < 25);
}

#[test]
fn the_weakest_residents_give_way_and_those_in_use_do_not() {
    const SLOTS: usize = 1000;
    let old = keys(SLOTS as u64, 8);
    let mut table = Table::new(SLOTS, 8, 50);
    let places = table.settle(&parts(&old, 1)).places.concat();
    // Half of the residents are as weak as can be; of these every other is in use again in this pass.
    let weak = |slot: usize| slot % 2 == 0;
    table.prioritise(|slot| if weak(slot) { 100 } else { 0 });
    let again: Vec<Key> = old
        .iter()
        .zip(&places)
        .filter(|&(_, &place)| place != Table::NOWHERE && place % 4 == 0)
        .map(|(&key, _)| key)
        .collect();
    let settled = table.settle(&[again, keys(2 * SLOTS as u64, 9)]);
    assert!(settled.evicted.iter().all(|&slot| slot % 4 == 2), "a strong resident gave way");
    // There are many new keys, and each looks at 8 slots: all that may give way do, but for chance.
    let may = places.iter().filter(|&&place| place != Table::NOWHERE && place % 4 == 2).count();
    assert!(settled.evicted.len() + 10 > may, "{} of {may} gave way", settled.evicted.len());
}

#[test]
fn a_table_of_one_slot_works() {
    let mut table = Table::new(0, 8, 1);
    let settled = table.settle(&[keys(3, 10)]);
    assert_eq!(table.len(), 1);
    assert_eq!(settled.places[0].iter().filter(|&&place| place == 0).count(), 1);
}
