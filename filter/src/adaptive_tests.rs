use glam::{DVec3, Vec3};

use super::*;
use crate::{Lobe, PackedRgb, StoredError};

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

/// The words of every part.
fn stored(filter: &mut Adaptive) -> Vec<Vec<u64>> {
    let part = |at| {
        let mut words = Vec::new();
        filter.store_part(at, &mut words);
        words
    };
    (0..5).map(part).collect()
}

fn load(filter: &mut Adaptive, part: usize, words: &[u64]) -> Result<(), StoredError> {
    let first = 16 * part as u32;
    filter.load_part(part, first..first + 16, words)
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
fn an_epoch_can_be_gone_on_with() {
    let mut whole = Adaptive::new(&Params { epoch: 4, ..Params::default() }, &ANCHOR, 5);
    let mut first = Adaptive::new(&Params { epoch: 4, ..Params::default() }, &ANCHOR, 5);
    let mut second = Adaptive::new(&Params { epoch: 4, ..Params::default() }, &ANCHOR, 5);
    add(&mut whole, 0..8);
    add(&mut first, 0..3);
    for (part, words) in stored(&mut first).iter().enumerate() {
        load(&mut second, part, words).unwrap();
    }
    let mut words = Vec::new();
    first.store_epoch(&mut words);
    second.load_epoch(3, &words).unwrap();
    add(&mut second, 3..8);
    assert_eq!(second.resolve(), whole.resolve());
    assert_eq!(filter().load_epoch(3, &words[1..]), Err(StoredError));
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
fn words_that_are_no_sums_are_refused() {
    let mut whole = filter();
    add(&mut whole, 0..4);
    let words = &stored(&mut whole)[1];
    assert_eq!(load(&mut filter(), 1, words), Ok(()));
    assert_eq!(load(&mut filter(), 2, words), Err(StoredError), "slots of another part");
    for end in (0..words.len()).step_by(97) {
        assert_eq!(load(&mut filter(), 1, &words[..end]), Err(StoredError), "{end} words");
    }
    let other = Params { trees: 3, ..Params::default() };
    assert_eq!(load(&mut Adaptive::new(&other, &ANCHOR, 5), 1, words), Err(StoredError), "three trees");
    // Whatever the words are, nothing panics.
    for at in 0..words.len() {
        for value in [0, 1, u64::MAX, words[at] ^ 1 << 63] {
            let mut wrong = words.clone();
            wrong[at] = value;
            let mut filter = filter();
            if load(&mut filter, 1, &wrong).and_then(|()| load(&mut filter, 1, words)).is_ok() && at % 50 == 0 {
                filter.resolve();
            }
        }
    }
}
