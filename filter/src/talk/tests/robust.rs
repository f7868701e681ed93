//! Exactness, order, bad input, scale.

use glam::{DVec3, Vec3};

use super::support::*;
use crate::grid::Anchor;
use crate::hash::mix64;
use crate::packed::PackedRgb;
use crate::record::{Lobe, PathRecord, Vertex};
use crate::talk::{Eviction, Jitter, LevelOfDetail, Params, Reading, Resolved, Talk};

fn all_knobs() -> Vec<Params> {
    let ok = Params::default();
    vec![
        ok,
        Params { level: LevelOfDetail::Distance { side: 0.03 }, jitter: Jitter::Disk { radius: 1.0 }, ..ok },
        Params { lookups: 3, enough: 8, relative_variance: 0.01, ..ok },
        Params { table_size: 0.05, probes: 3, eviction: Eviction::LeastRecent { patience: 1 }, ..ok },
        Params { table_size: 0.02, probes: 2, eviction: Eviction::Health { patience: 2 }, temporal: Some(0.7), ..ok },
        Params { reading: Reading::AtTheEnd, lookups: 2, ..ok },
    ]
}

/// Three passes and two frames, each slot's result as bits, and the report.
fn run(params: &Params, anchor: &Anchor, passes: &[Vec<Vec<PathRecord>>]) -> (Vec<(u32, [u32; 6])>, String) {
    let mut talk = Talk::new(params, anchor, passes[0].iter().map(Vec::len).sum()).unwrap();
    talk.add(&passes[0]);
    talk.next_frame(anchor.origin, DVec3::ZERO);
    talk.add(&passes[1]);
    talk.add(&passes[2]);
    let bits =
        |r: Resolved| [r.diffuse.x, r.diffuse.y, r.diffuse.z, r.glossy.x, r.glossy.y, r.glossy.z].map(f32::to_bits);
    let mut slots: Vec<_> = talk.resolve().concat().into_iter().map(|(slot, r)| (slot, bits(r))).collect();
    slots.sort_unstable();
    let report = talk.report();
    (slots, format!("{} {:?} {} {}", report.cells, report.probes, report.unresolved, report.evicted))
}

/// Three passes, in parts by slot.
fn passes(parts: u32) -> Vec<Vec<Vec<PathRecord>>> {
    (0..3)
        .map(|pass| {
            let mut split = vec![Vec::new(); parts as usize];
            for record in noisy_square(4000, pass) {
                split[(record.slot % parts) as usize].push(record);
            }
            split
        })
        .collect()
}

#[test]
fn no_order_partition_or_number_of_threads_changes_a_bit() {
    for (at, params) in all_knobs().iter().enumerate() {
        let expected = run(params, &ANCHOR, &passes(1));
        for threads in [1, 2, 3, 7] {
            let mut passes = passes(3 * threads + 1);
            passes.iter_mut().flatten().for_each(|part| {
                part.sort_by_key(|record| mix64(u64::from(record.first.p[0].to_bits()) ^ threads as u64));
            });
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads as usize).build().unwrap();
            let got = pool.install(|| run(params, &ANCHOR, &passes));
            assert!(got == expected, "knobs {at}, {threads} threads");
        }
    }
}

#[test]
fn scaling_by_a_power_of_two_changes_no_bit() {
    for params in all_knobs() {
        let expected = run(&params, &ANCHOR, &passes(2));
        for scale in [2f32.powi(-20), 0.5, 2f32.powi(20)] {
            let mut scaled = passes(2);
            for record in scaled.iter_mut().flatten().flatten() {
                let first = &record.first;
                let p = Vec3::from_array(first.p) * scale;
                let footprint = first.footprint.get() * scale;
                record.first = Vertex::new(p, Vec3::Z, footprint, first.surface(), first.bin());
            }
            let by = f64::from(scale);
            let anchor = Anchor { origin: ANCHOR.origin * by, extent: ANCHOR.extent * by };
            assert!(run(&params, &anchor, &scaled) == expected, "{params:?} at {scale}");
        }
    }
}

#[test]
fn far_from_the_origin_the_same_paths_meet() {
    // What f32 keeps of positions at 2¹⁸ is 1/32; cells are 1/4 wide and positions here whole numbers of 1/16.
    let params = Params { level: LevelOfDetail::Fixed { side: 0.25 }, ..Params::default() };
    let at = |offset: Vec3| {
        let records = noisy_square(4000, 0)
            .into_iter()
            .map(|record| {
                let p = (Vec3::from_array(record.first.p) * 16.0).round() / 16.0 + offset;
                PathRecord { first: Vertex::new(p, Vec3::Z, 1.0 / 64.0, 0, 0), ..record }
            })
            .collect();
        let anchor = Anchor { origin: ANCHOR.origin + offset.as_dvec3(), ..ANCHOR };
        filtered(&params, &anchor, records)
    };
    assert_eq!(at(Vec3::new(131_072.0, -65_536.0, 131_072.0)), at(Vec3::ZERO));
}

#[test]
fn bad_radiance_leaves_cells_alone_and_stays_the_paths_own() {
    let params = Params { jitter: Jitter::None, ..Params::default() };
    let good = |slot| diffuse(slot, Vec3::ZERO, Vec3::Z, 2.0);
    let mut records: Vec<PathRecord> = (0..10).map(good).collect();
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 1e20, 1e30, 1e-40];
    records.extend(bad.iter().zip(10..).map(|(&x, slot)| diffuse(slot, Vec3::ZERO, Vec3::Z, x)));
    let (slots, report) = filtered(&params, &ANCHOR, records);
    assert_eq!((report.rejected, report.lost, report.cells), (bad.len() as u64, 3, 1));
    let got: Vec<f32> = slots.iter().map(|(_, resolved)| resolved.diffuse.x).collect();
    assert!(got[..10].iter().all(|&x| x == 2.0), "{got:?}");
    let near = |x: f32, expected: f32| (x / expected - 1.0).abs() < 1e-5;
    // What is packed as not a number is lost, 1e30 is limited, the rest is as it was.
    assert!(got[10..13].iter().all(|&x| x == 0.0), "{got:?}");
    assert!(near(got[13], -1.0) && near(got[14], 1e20) && near(got[15], 2f32.powi(80)) && got[16] == 0.0, "{got:?}");
}

#[test]
fn bad_throughput_is_counted_and_spoils_only_its_path() {
    let mut records: Vec<PathRecord> = (0..4).map(|slot| diffuse(slot, Vec3::ZERO, Vec3::Z, 2.0)).collect();
    records[1].diffuse.throughput = PackedRgb::INVALID;
    let (slots, report) = filtered(&Params { jitter: Jitter::None, ..Params::default() }, &ANCHOR, records);
    assert_eq!(report.lost, 1);
    assert_eq!(slots.iter().map(|(_, r)| r.diffuse.x).collect::<Vec<_>>(), [2.0, 0.0, 2.0, 2.0]);
}

#[test]
fn vertices_without_a_place_and_paths_without_a_vertex_are_unfiltered() {
    let mut nowhere = diffuse(0, Vec3::NAN, Vec3::Z, 3.0);
    nowhere.glossy = lobe(Vec3::ONE);
    let (slots, report) = filtered(&Params::default(), &ANCHOR, vec![nowhere, PathRecord::default()]);
    assert_eq!(slots, [(0, Resolved { diffuse: Vec3::splat(3.0), glossy: Vec3::ONE })]);
    assert_eq!((report.paths, report.lobes, report.placeless, report.cells), (2, 2, 2, 0));
}

#[test]
fn a_path_brings_throughput_times_the_average_of_its_cell() {
    let mut records: Vec<PathRecord> =
        [1.0, 2.0, 6.0].iter().zip(0..).map(|(&x, slot)| diffuse(slot, Vec3::ZERO, Vec3::Z, x)).collect();
    // The suffix counts by way of the transfer; throughputs may be negative, as pixel filters' weights are.
    records[2].suffix = PackedRgb::new(Vec3::splat(4.0));
    records[2].diffuse = Lobe {
        throughput: PackedRgb::new(Vec3::new(0.5, 0.0, -1.0)),
        rest: PackedRgb::new(Vec3::splat(4.0)),
        transfer: PackedRgb::new(Vec3::splat(0.5)),
    };
    let (slots, _) = filtered(&Params { jitter: Jitter::None, ..Params::default() }, &ANCHOR, records);
    let got: Vec<Vec3> = slots.iter().map(|(_, resolved)| resolved.diffuse).collect();
    assert_eq!(got, [Vec3::splat(3.0), Vec3::splat(3.0), Vec3::new(1.5, 0.0, -3.0)]);
}

#[test]
fn collisions_that_stay_unresolved_leave_paths_unfiltered() {
    // Sixteen places far apart, two paths at each, a table of a few slots.
    let records: Vec<PathRecord> =
        (0..32u32).map(|i| diffuse(i, Vec3::X * (i / 2) as f32, Vec3::Z, if i % 2 == 0 { 1.0 } else { 3.0 })).collect();
    let params = Params { jitter: Jitter::None, table_size: 0.125, probes: 4, ..Params::default() };
    let (slots, report) = filtered(&params, &ANCHOR, records);
    assert_eq!((report.slots, report.cells), (4, 4));
    assert_eq!(report.unresolved, 24);
    assert_eq!(report.unresolved_share(), 0.75);
    assert_eq!(report.occupancy(), 1.0);
    let with = |x: f32| slots.iter().filter(|(_, resolved)| resolved.diffuse.x == x).count();
    assert_eq!((with(2.0), with(1.0), with(3.0)), (8, 12, 12));
}

#[test]
fn passes_accumulate_and_slots_sum() {
    let params = Params { jitter: Jitter::None, ..Params::default() };
    let pass = |x: f32| [vec![diffuse(7, Vec3::ZERO, Vec3::Z, x)]];
    for (reading, expected) in [(Reading::EveryPass, 1.0 + 2.0 + 3.0), (Reading::AtTheEnd, 3.0 * 3.0)] {
        let mut talk = Talk::new(&Params { reading, ..params }, &ANCHOR, 1).unwrap();
        for x in [1.0, 3.0, 5.0] {
            talk.add(&pass(x));
        }
        assert_eq!(talk.resolve(), [[(7, Resolved { diffuse: Vec3::splat(expected), glossy: Vec3::ZERO })]]);
        // Another frame of the same: slots begin again, cells do not.
        talk.next_frame(DVec3::ZERO, DVec3::ZERO);
        assert!(talk.resolve().concat().is_empty());
        talk.add(&pass(7.0));
        assert_eq!(talk.resolve()[0][0].1.diffuse.x, 4.0);
    }
}

#[test]
fn settings_out_of_bounds_are_refused() {
    assert!(Talk::new(&Params { probes: 0, ..Params::default() }, &ANCHOR, 10).is_err());
}
