//! The choice between levels, by density and by variance.

use glam::Vec3;

use super::support::*;
use crate::record::PathRecord;
use crate::talk::key::{Layer, Locator};
use crate::talk::random::Random;
use crate::talk::{Jitter, LevelOfDetail, Params};

const FIXED: LevelOfDetail = LevelOfDetail::Fixed { side: 0.25 };

fn params() -> Params {
    Params { level: FIXED, jitter: Jitter::None, normal_jitter: 0.0, lookups: 3, table_size: 8.0, ..Params::default() }
}

/// Two places in different cells of the same cell of the next level.
fn siblings() -> [Vec3; 2] {
    let locator = Locator::new(&params(), &ANCHOR, ANCHOR.origin);
    let keys = |p: Vec3| {
        let mut keys = Vec::new();
        let vertex = diffuse(0, p, Vec3::Z, 0.0).first;
        assert!(locator.keys(&vertex, Layer::Diffuse, Random::new(0, 0, 0, 1), &mut keys));
        keys
    };
    let places = |i: i32| Vec3::X * (i as f32 / 64.0);
    let at = (0..64).map(|i| [places(i), places(i + 1)]);
    at.into_iter()
        .find(|&[a, b]| {
            let (a, b) = (keys(a), keys(b));
            a[0] != b[0] && a[1] == b[1] && a[2] == b[2]
        })
        .unwrap()
}

/// What the first and the last path get.
fn ends(params: &Params, at: &[(Vec3, &[f32])]) -> [f32; 2] {
    let values = at.iter().flat_map(|&(p, values)| values.iter().map(move |&x| (p, x)));
    let records: Vec<PathRecord> = values.zip(0..).map(|((p, x), slot)| diffuse(slot, p, Vec3::Z, x)).collect();
    let (slots, report) = filtered(params, &ANCHOR, records);
    assert_eq!(report.unresolved, 0);
    [slots[0].1.diffuse.x, slots[slots.len() - 1].1.diffuse.x]
}

#[test]
fn where_paths_are_few_a_coarser_level_is_read() {
    let [a, b] = siblings();
    let at: [(Vec3, &[f32]); 2] = [(a, &[1.0, 3.0]), (b, &[10.0; 30])];
    assert_eq!(ends(&Params { enough: 16, ..params() }, &at), [304.0 / 32.0, 10.0]);
    assert_eq!(ends(&Params { enough: 2, ..params() }, &at), [2.0, 10.0]);
    assert_eq!(ends(&Params { lookups: 1, enough: 16, ..params() }, &at), [2.0, 10.0]);
    // Nowhere enough: the coarsest.
    assert_eq!(ends(&Params { enough: 1000, ..params() }, &at), [304.0 / 32.0; 2]);
}

#[test]
fn where_paths_are_noisy_a_coarser_level_is_read() {
    let [a, b] = siblings();
    let noisy: Vec<f32> = (0..20).map(|i| 2.0 * (i % 2) as f32).collect();
    let at: [(Vec3, &[f32]); 2] = [(a, &noisy), (b, &[1.5; 60])];
    // Of the noisy twenty the relative variance of the mean is 1/19; of all eighty 0.297/79/1.375².
    let with = |relative_variance: f32| ends(&Params { enough: 1, relative_variance, ..params() }, &at);
    assert_eq!(with(0.06), [1.0, 1.5]);
    assert_eq!(with(0.05), [1.375, 1.5]);
    assert_eq!(with(f32::INFINITY), [1.0, 1.5]);
}

#[test]
fn glossy_cells_are_finer_and_their_own() {
    let [a, b] = siblings();
    let record =
        |slot, p: Vec3, x: f32| PathRecord { glossy: lobe(Vec3::splat(x)), ..diffuse(slot, p, Vec3::Z, 1.0 + x) };
    let records = vec![record(0, a, 1.0), record(1, b, 3.0)];
    let coarse = Params { level: LevelOfDetail::Fixed { side: 0.5 }, lookups: 1, ..params() };
    // Twice as fine, the glossy lobes part where the diffuse ones still meet.
    let (slots, _) = filtered(&coarse, &ANCHOR, records.clone());
    assert_eq!(slots.iter().map(|(_, r)| (r.diffuse.x, r.glossy.x)).collect::<Vec<_>>(), [(3.0, 1.0), (3.0, 3.0)]);
    let (slots, _) = filtered(&Params { glossy_finer: 1.0, ..coarse }, &ANCHOR, records.clone());
    assert_eq!(slots.iter().map(|(_, r)| (r.diffuse.x, r.glossy.x)).collect::<Vec<_>>(), [(3.0, 2.0); 2]);
    let one_layer = Params { glossy_finer: 1.0, layers: false, ..coarse };
    let (slots, _) = filtered(&one_layer, &ANCHOR, records);
    assert_eq!(slots.iter().map(|(_, r)| (r.diffuse.x, r.glossy.x)).collect::<Vec<_>>(), [(2.5, 2.5); 2]);
}
