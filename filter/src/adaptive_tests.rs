use glam::{DVec3, Vec3};

use super::*;
use crate::first::first_tree;
use crate::{Branch, Lobe, Merging, PackedRgb, Slots, StoredError};

const ANCHOR: Anchor = Anchor { origin: DVec3::ZERO, extent: 8.0 };

/// Paths over a wall: `parts` × 16 slots, all with both lobes and both vertices, of sample `sample`.
fn block(parts: usize, sample: u64) -> Vec<Vec<PathRecord>> {
    let random = |slot: u64, k: u64| (crate::hash::mix64(slot << 32 | sample << 8 | k) >> 40) as f32 / (1 << 24) as f32;
    let record = |slot: u64| {
        let at = |k: u64| Vec3::new(slot as f32 * 0.05 + 0.05 * random(slot, k), random(slot, k + 1), 0.0);
        let rgb = |k: u64, scale: f32| {
            PackedRgb::new(scale * Vec3::new(random(slot, k), random(slot, k + 1), random(slot, k + 2)))
        };
        let mut record = PathRecord {
            slot: slot as u32,
            first: Vertex::new(at(0), Vec3::Z, 0.03, 7, (slot % 3) as u8),
            second: Vertex::new(at(2), Vec3::X, 0.05, 3, 0),
            diffuse: Lobe { throughput: rgb(4, 0.9), rest: rgb(7, 2.0), transfer: rgb(10, 1.0) },
            glossy: Lobe { throughput: rgb(13, -0.3), rest: rgb(16, 9.0), transfer: rgb(19, 0.5) },
            suffix: rgb(22, 4.0),
        };
        record.set_sample(sample as u8);
        record
    };
    (0..parts as u64).map(|part| (16 * part..16 * part + 16).map(record).collect()).collect()
}

fn filter() -> Adaptive {
    Adaptive::new(&Params { epoch: 2, ..Params::default() }, &ANCHOR, 5)
}

fn add(filter: &mut Adaptive, samples: std::ops::Range<u64>) {
    for sample in samples {
        filter.begin_block(sample);
        filter.add(&block(5, sample));
    }
}

const TREES: usize = 8;

fn slots(part: usize) -> std::ops::Range<u32> {
    16 * part as u32..16 * (part as u32 + 1)
}

/// The words of every tree of every part, and of every part's slots.
fn stored(filter: &mut Adaptive) -> Vec<Vec<Vec<u64>>> {
    filter.settle();
    let part = |part| {
        let mut words = vec![Vec::new(); TREES + 1];
        filter.store_trees(part, &slots(part), &mut words[..TREES]);
        filter.store_slots(part, &slots(part), &mut words[TREES]);
        words
    };
    (0..5).map(part).collect()
}

fn read(part: usize, tree: usize, words: &[u64]) -> Result<Branch, StoredError> {
    Branch::read(&filter().params, tree, &slots(part), words)
}

fn load(filter: &mut Adaptive, part: usize, words: &[Vec<u64>]) -> Result<(), StoredError> {
    for (tree, words) in words[..TREES].iter().enumerate() {
        filter.add_tree(tree, part, &read(part, tree, words)?);
    }
    filter.add_slots(part, &Slots::read(&slots(part), &words[TREES])?);
    Ok(())
}

#[test]
fn sums_of_epochs_add_up_in_any_order_to_the_bits_of_the_whole() {
    let mut whole = filter();
    add(&mut whole, 0..8);
    let expected = whole.resolve();
    assert!(expected.iter().flatten().any(|(_, resolved)| resolved.diffuse.x > 0.0 && resolved.glossy.x < 0.0));
    for order in [[0, 2, 4, 6], [6, 2, 0, 4], [4, 6, 2, 0]] {
        let mut sum = filter();
        for epoch in order {
            let mut slice = filter();
            add(&mut slice, epoch..epoch + 2);
            for (part, words) in stored(&mut slice).iter().enumerate() {
                load(&mut sum, part, words).unwrap();
            }
            sum.add_paths(slice.paths());
        }
        assert_eq!(sum.resolve(), expected, "{order:?}");
        assert!(stored(&mut sum) == stored(&mut whole), "{order:?}");
        assert_eq!(sum.report().paths, whole.report().paths);
    }
}

#[test]
fn what_is_left_at_the_end_is_what_was_there_before() {
    let mut filter = filter();
    add(&mut filter, 0..8);
    let (resolved, report) = (filter.resolve(), filter.report());
    assert!(report.cells > 0 && report.pairs > 0);
    assert_eq!(filter.finish(), (resolved, report));
}

#[test]
fn sums_too_large_for_cells_go_from_epoch_to_epoch() {
    let of = |samples: std::ops::Range<u64>, filter: &mut Adaptive| {
        for sample in samples {
            let mut records = block(5, sample);
            for record in records.iter_mut().flatten() {
                // Up to 2²⁰ units each, of weights above 1, and cells hold 2²².
                record.suffix = PackedRgb::new(record.suffix.get() * 2f32.powi(18));
                record.diffuse.throughput = PackedRgb::new(record.diffuse.throughput.get() * 64.0);
            }
            filter.begin_block(sample);
            filter.add(&records);
        }
    };
    let params = Params { epoch: 4, ..Params::default() };
    let [mut whole, mut first, mut second] = [(); 3].map(|()| Adaptive::new(&params, &ANCHOR, 5));
    of(0..4, &mut whole);
    of(0..3, &mut first);
    for (part, words) in stored(&mut first).iter().enumerate() {
        load(&mut second, part, words).unwrap();
    }
    second.begin_stored_epoch(3);
    let mut wide = 0;
    for piece in first.epoch() {
        let mut words = Vec::new();
        first.store_epoch(&piece, &mut words);
        wide += words[4] & 1;
        second.add_epoch(&words).unwrap();
    }
    of(3..4, &mut second);
    assert!(wide > 0);
    assert_eq!(second.resolve(), whole.resolve());
}

#[test]
fn an_epoch_can_be_gone_on_with() {
    let mut whole = Adaptive::new(&Params { epoch: 4, ..Params::default() }, &ANCHOR, 5);
    let mut first = Adaptive::new(&Params { epoch: 4, ..Params::default() }, &ANCHOR, 5);
    let mut second = Adaptive::new(&Params { epoch: 4, ..Params::default() }, &ANCHOR, 5);
    add(&mut whole, 0..8);
    add(&mut first, 0..3);
    for (part, words) in stored(&mut first).iter().enumerate() {
        load(&mut second, part, words).unwrap();
    }
    second.begin_stored_epoch(3);
    let mut words = Vec::new();
    for piece in first.epoch() {
        words.clear();
        first.store_epoch(&piece, &mut words);
        second.add_epoch(&words).unwrap();
    }
    add(&mut second, 3..8);
    assert_eq!(second.resolve(), whole.resolve());
    // Not a tree; not so many cells; not a key, twice; without weight; more than the cells.
    for (at, value) in
        [(0, 1), (1, words[1] + 1), (1, words[1] - 1), (2, u64::MAX), (3, u64::MAX), (4, 0), (4, words[4] | 1)]
    {
        let mut wrong = words.clone();
        wrong[at] = value;
        assert_eq!(filter().add_epoch(&wrong), Err(StoredError), "word {at} is {value}");
    }
    assert_eq!(filter().add_epoch(&words[..words.len() - 1]), Err(StoredError));
    assert_eq!(filter().add_epoch(&[]), Err(StoredError));
}

#[test]
fn epochs_matter() {
    let mut cut = filter();
    add(&mut cut, 0..8);
    let mut long = Adaptive::new(&Params::default(), &ANCHOR, 5);
    add(&mut long, 0..8);
    assert_ne!(cut.resolve(), long.resolve());
}

#[test]
fn stored_sums_of_several_filters_resolve_tree_by_tree_to_the_bits_of_the_whole() {
    let mut whole = filter();
    add(&mut whole, 0..8);
    let (expected, expected_words) = (whole.resolve(), stored(&mut whole));
    let parts = [6, 0, 4, 2].map(|epoch| {
        let mut slice = filter();
        add(&mut slice, epoch..epoch + 2);
        stored(&mut slice)
    });
    for count in [4, 1] {
        let parts = if count == 1 { std::slice::from_ref(&expected_words) } else { &parts[..] };
        let mut merging = Merging::new(&filter().params, 5, 16, true);
        let mut words = vec![vec![Vec::new(); TREES + 1]; 5];
        (0..TREES).for_each(|tree| {
            let branches = (0..5).map(|part| {
                let shares = parts.iter().map(|words| read(part, tree, &words[part][tree]).unwrap());
                let sum = Branch::sum(shares.collect());
                sum.store(&slots(part), &mut words[part][tree]);
                sum
            });
            let mut branches: Vec<Branch> = branches.collect();
            let rest = branches.split_off(3);
            merging.add(branches);
            merging.add(rest);
            merging.end_tree();
        });
        for part in 0..5 {
            let mut sum = Slots::default();
            parts.iter().for_each(|words| sum.add(Slots::read(&slots(part), &words[part][TREES]).unwrap()));
            sum.store(&slots(part), &mut words[part][TREES]);
            let resolved = slots(part).zip(merging.resolve(part, &sum));
            let met: Vec<_> = resolved.filter(|(_, resolved)| *resolved != Resolved::default()).collect();
            assert_eq!(met, expected[part]);
            assert_eq!(merging.cell_sides(part).as_ref(), Some(&whole.cell_sides()[part]));
        }
        assert!(words == expected_words);
        let report = Report { bytes: 0, second_cells: 0, ..whole.report() };
        assert_eq!(Report { bytes: 0, ..merging.report(whole.paths()) }, report);
    }
}

#[test]
fn words_that_are_no_sums_are_refused() {
    let mut whole = filter();
    add(&mut whole, 0..4);
    let words = &stored(&mut whole)[1];
    assert_eq!(load(&mut filter(), 1, words), Ok(()));
    assert_eq!(Branch::read(&whole.params, 0, &(16..18), &words[0]), Err(StoredError), "more slots than the part has");
    assert_eq!(Slots::read(&(16..18), &words[TREES]), Err(StoredError), "more slots than the part has");
    for words in [&words[0], &words[TREES - 1], &words[TREES]] {
        let refused = |words: &[u64]| read(1, 0, words).is_err() && Slots::read(&slots(1), words).is_err();
        for end in (0..words.len()).step_by(17) {
            assert!(refused(&words[..end]), "{end} words");
        }
    }
    // Whatever the words are, nothing panics.
    for stored in 0..=TREES {
        for at in 0..words[stored].len() {
            for value in [0, 1, u64::MAX, words[stored][at] ^ 1 << 63] {
                let mut wrong = words.clone();
                wrong[stored][at] = value;
                let mut filter = filter();
                if load(&mut filter, 1, &wrong).and_then(|()| load(&mut filter, 1, words)).is_ok() && at % 50 == 0 {
                    filter.resolve();
                }
            }
        }
    }
}

#[test]
fn sides_are_those_of_the_finest_cells() {
    let mut filter = filter();
    add(&mut filter, 0..8);
    let sides = filter.cell_sides();
    assert!(sides.iter().all(|part| part.len() == 16));
    // Footprints of 0.03 and leaves of a quarter to one of `leaf` of them, in four trees.
    let largest = 0.03 * filter.params.leaf;
    assert!(sides.iter().flatten().all(|(_, side)| (0.25 * largest..=largest).contains(side)), "{sides:?}");
}

#[test]
fn a_slot_of_one_sample_reads_the_mean_over_trees() {
    let resolve = |reads: u32, sample: u8| {
        let mut filter = Adaptive::new(&Params { reads, ..Params::default() }, &ANCHOR, 5);
        let mut records = block(5, 0);
        records.iter_mut().flatten().for_each(|record| record.set_sample(sample));
        filter.add(&records);
        filter.resolve().concat()
    };
    let (one_by_one, all) = ([0, 1, 2, 3].map(|sample| resolve(1, sample)), resolve(4, 0));
    for (at, (slot, resolved)) in all.iter().enumerate() {
        let of_trees = one_by_one.each_ref().map(|tree| tree[at].1);
        for of in [|resolved: &Resolved| resolved.diffuse, |resolved: &Resolved| resolved.glossy] {
            let mean = of_trees.iter().map(of).sum::<Vec3>() / 4.0;
            // Throughput is rounded to 2⁻²⁰ in each tree, and radiance is below 16.
            assert!((of(resolved) - mean).abs().max_element() < 16.0 * 2f32.powi(-20), "{slot}: {of_trees:?}");
        }
    }
    // Slots begin with different trees, each of which is read by some at any sample.
    let begins_like_the_first = (0..80).filter(|slot| first_tree(*slot, 0, 4, 1) == first_tree(0, 0, 4, 1)).count();
    assert!((5..40).contains(&begins_like_the_first), "{begins_like_the_first}");
}

#[test]
fn leaves_shrink_as_samples_grow() {
    let leaves = |samples| {
        let params = Params::for_samples(samples);
        [params.leaf, params.second_leaf]
    };
    assert_eq!([0, 1, 2, 3, 4, 8, 9, u64::MAX].map(|n| Params::for_samples(n).reads), [8, 8, 4, 2, 2, 1, 1, 1]);
    assert_eq!(Params::for_samples(16), Params::default());
    let cases = [
        (0, [4.0, 32.0]),
        (1, [4.0, 32.0]),
        (128, [2.0, 128f32.sqrt()]),
        (1024, [1.0, 2f32.sqrt()]),
        (4096, [1.0; 2]),
        (1 << 20, [1.0; 2]),
        (u64::MAX, [1.0; 2]),
    ];
    for (samples, expected) in cases {
        assert_eq!(leaves(samples), expected, "{samples}");
    }
}

#[test]
fn growing_epochs_end_with_twice_the_samples_and_leaves_shrink_with_them() {
    let params = Params { epoch: 16, growing: true, ..Params::default() };
    for (epoch, samples) in [(0..16, [0, 7, 15]), (16..32, [16, 20, 31]), (512..1024, [512, 700, 1023])] {
        for sample in samples {
            assert_eq!(params.epoch(sample), epoch, "{sample}");
            let measured = Params::for_samples(epoch.end);
            assert_eq!(params.leaves(sample), [measured.leaf, measured.second_leaf], "{sample}");
        }
    }
    assert_eq!(params.epoch(u64::MAX), 1 << 63..u64::MAX);
    assert_eq!(params.leaves(u64::MAX), [1.0; 2]);
    let even = Params { growing: false, ..params };
    assert_eq!([even.epoch(15), even.epoch(700), even.epoch(u64::MAX)], [0..16, 688..704, u64::MAX - 15..u64::MAX]);
    assert_eq!(even.leaves(700), [params.leaf, params.second_leaf]);
    assert_eq!(Params::default().epoch(u64::MAX), 0..u64::MAX);
}

#[test]
fn cells_of_growing_epochs_hold_their_energy() {
    let growing = Params { epoch: 1, growing: true, leaf: 32.0, ..Params::default() };
    let mut filter = Adaptive::new(&growing, &ANCHOR, 5);
    add(&mut filter, 0..16);
    let (found, mut brought) = (filter.resolve().concat(), [Vec3::ZERO; 2]);
    for record in (0..16).flat_map(|sample| block(5, sample).concat()) {
        let suffix = record.suffix.get();
        brought[0] += record.diffuse.throughput.get() * record.diffuse.incident(suffix);
        brought[1] += record.glossy.throughput.get() * record.glossy.incident(suffix);
    }
    let sum = |of: fn(&Resolved) -> Vec3| found.iter().map(|(_, resolved)| of(resolved)).sum::<Vec3>();
    // Throughput and light are independent here, and neither deviates by more than 1/√3 of its mean: means over cells change
    // the sum of 1280 paths by noise of 1/3 / √1280, of which this is five times as much.
    for (found, brought) in [sum(|resolved| resolved.diffuse), sum(|resolved| resolved.glossy)].into_iter().zip(brought)
    {
        assert!(((found - brought) / brought).abs().max_element() < 0.047, "{found} for {brought}");
    }
}

#[test]
fn one_wide_footprint_pools_no_cells_but_its_own() {
    let resolve = |footprint: f32| {
        let mut filter = filter();
        for sample in 0..4 {
            let mut records = block(5, sample);
            let far = &mut records[4][15];
            far.first = Vertex::new(Vec3::splat(5.0), Vec3::Y, footprint, 99, 0);
            far.second = Vertex::new(Vec3::splat(-5.0), Vec3::Y, footprint, 99, 0);
            filter.begin_block(sample);
            filter.add(&records);
        }
        filter.resolve()
    };
    let (narrow, wide) = (resolve(0.03), resolve(30.0));
    assert_eq!(narrow[..4], wide[..4]);
    assert_eq!(narrow[4][..15], wide[4][..15]);
}
