use glam::{DVec3, Vec3};

use super::*;
use crate::PackedRgb;

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

#[test]
fn sums_of_epochs_add_up_in_any_order_to_the_bits_of_the_whole() {
    let mut whole = filter();
    add(&mut whole, 0..8);
    let expected = whole.resolve();
    assert!(expected.iter().flatten().any(|(_, resolved)| resolved.diffuse.x > 0.0 && resolved.glossy.x < 0.0));
    for order in [[0, 2, 4, 6], [6, 2, 0, 4], [4, 6, 2, 0]] {
        let mut sum = filter();
        for epoch in order {
            let mut part = filter();
            add(&mut part, epoch..epoch + 2);
            sum.absorb(&part.snapshot()).unwrap();
        }
        assert_eq!(sum.resolve(), expected, "{order:?}");
        assert_eq!(sum.snapshot(), whole.snapshot(), "{order:?}");
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
fn epochs_matter() {
    let mut cut = filter();
    add(&mut cut, 0..8);
    let mut long = Adaptive::new(&Params::default(), &ANCHOR, 5);
    add(&mut long, 0..8);
    assert_ne!(cut.resolve(), long.resolve());
}

#[test]
fn stored_sums_read_back() {
    let mut filter = filter();
    add(&mut filter, 0..4);
    let snapshot = filter.snapshot();
    let bytes = snapshot.to_bytes();
    assert_eq!(Snapshot::from_bytes(&bytes), Ok(snapshot));
    assert_eq!(Snapshot::from_bytes(&bytes[..bytes.len() / 2]), Err(SnapshotError::Truncated));
    assert_eq!(Snapshot::from_bytes(b"PNG"), Err(SnapshotError::Truncated));
    assert_eq!(Snapshot::from_bytes(&[b'x'; 64]), Err(SnapshotError::Foreign));
    for at in (12..bytes.len()).step_by(211) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 16;
        assert!(Snapshot::from_bytes(&damaged).is_err(), "bit flipped in byte {at}");
    }
}

#[test]
fn sums_of_other_filters_are_refused() {
    let other = Adaptive::new(&Params { trees: 3, ..Params::default() }, &ANCHOR, 5).snapshot();
    assert_eq!(filter().absorb(&other), Err(SnapshotError::Mismatch));
    let other = Adaptive::new(&Params::default(), &ANCHOR, 4).snapshot();
    assert_eq!(filter().absorb(&other), Err(SnapshotError::Mismatch));
}
