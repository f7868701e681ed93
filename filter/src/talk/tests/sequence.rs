//! Frames: moving averages, and who stays in the table.

use glam::{DVec3, Vec3};

use super::support::*;
use crate::record::PathRecord;
use crate::talk::{Eviction, Jitter, Params, Reading, Talk};

fn still() -> Params {
    Params { jitter: Jitter::None, normal_jitter: 0.0, ..Params::default() }
}

fn one(x: f32) -> [Vec<PathRecord>; 1] {
    [vec![diffuse(0, Vec3::ZERO, Vec3::Z, x)]]
}

fn value(talk: &Talk) -> f32 {
    talk.resolve()[0][0].1.diffuse.x
}

#[test]
fn a_moving_average_answers_a_step_as_powers_of_alpha() {
    for alpha in [0.0, 0.5, 0.8] {
        let mut talk = Talk::new(&Params { temporal: Some(alpha), ..still() }, &ANCHOR, 16).unwrap();
        // Lit from the first frame on: there is no past to be mixed with.
        talk.add(&one(1.0));
        assert_eq!(value(&talk), 1.0);
        let mut to_10_percent = None;
        for frame in 1..=20 {
            talk.next_frame(ANCHOR.origin, DVec3::ZERO);
            talk.add(&one(0.0));
            let expected = alpha.powi(frame);
            assert!((value(&talk) - expected).abs() < 1e-5, "{} in frame {frame}, not {expected}", value(&talk));
            if value(&talk) <= 0.1 {
                to_10_percent = to_10_percent.or(Some(frame));
            }
        }
        println!("alpha {alpha}: {to_10_percent:?} frames to 90 % of the answer");
        assert_eq!(to_10_percent, Some(if alpha == 0.0 { 1 } else { (0.1f32.ln() / alpha.ln()).ceil() as i32 }));
    }
}

#[test]
fn passes_of_one_frame_count_alike_in_a_moving_average() {
    let mut talk = Talk::new(&Params { temporal: Some(0.75), ..still() }, &ANCHOR, 16).unwrap();
    talk.add(&one(8.0));
    talk.next_frame(ANCHOR.origin, DVec3::ZERO);
    talk.add(&one(1.0));
    talk.add(&one(3.0));
    // Read after each pass: of 8 and 1, then of 8 and the mean of 1 and 3.
    assert_eq!(value(&talk), 0.75 * 8.0 + 0.25 * 1.0 + 0.75 * 8.0 + 0.25 * 2.0);
}

#[test]
fn reading_at_the_end_all_paths_of_a_frame_read_the_same_moving_average() {
    let params = Params { temporal: Some(0.75), reading: Reading::AtTheEnd, ..still() };
    let mut talk = Talk::new(&params, &ANCHOR, 16).unwrap();
    talk.add(&one(8.0));
    talk.next_frame(ANCHOR.origin, DVec3::ZERO);
    talk.add(&one(1.0));
    talk.add(&one(3.0));
    assert_eq!(value(&talk), 2.0 * (0.75 * 8.0 + 0.25 * 2.0));
    let report = talk.report();
    assert_eq!((report.passes, report.paths), (2, 2));
}

#[test]
fn places_that_are_measured_from_elsewhere_keep_their_cells() {
    let mut talk = Talk::new(&Params { temporal: Some(0.5), ..still() }, &ANCHOR, 16).unwrap();
    talk.add(&one(4.0));
    let moved = DVec3::new(-1024.0, 17.0, 3.5);
    talk.next_frame(ANCHOR.origin + moved, moved);
    talk.add(&[vec![diffuse(0, moved.as_vec3(), Vec3::Z, 2.0)]]);
    assert_eq!(value(&talk), 3.0);
    assert_eq!(talk.report().cells, 1);
}

#[test]
fn cells_that_no_path_meets_keep_their_average_and_a_moving_eye_keeps_its_cells() {
    let mut talk = Talk::new(&Params { temporal: Some(0.5), ..still() }, &ANCHOR, 16).unwrap();
    talk.add(&one(4.0));
    for step in 1..4 {
        talk.next_frame(ANCHOR.origin + DVec3::X * 0.25 * f64::from(step), DVec3::ZERO);
        talk.add(&[vec![diffuse(1, Vec3::X * 3.0, Vec3::Z, 1.0)]]);
    }
    talk.next_frame(ANCHOR.origin + DVec3::X, DVec3::ZERO);
    talk.add(&one(2.0));
    assert_eq!(value(&talk), 3.0);
    assert_eq!(talk.report().cells, 2);
}

/// `count` places of group `group`, far from each other and all others, `copies` paths at each.
fn places(group: u32, count: u32, copies: u32, x: f32) -> Vec<PathRecord> {
    (0..count * copies)
        .map(|i| {
            let place = i % count;
            diffuse(1000 * group + place, Vec3::new(place as f32, group as f32 * 2.0, 0.0), Vec3::Z, x)
        })
        .collect()
}

/// A filter of 64 slots after passes with two groups, four with the first alone, and one with the first and many new
/// keys; the second group had `copies` paths at each place.
fn contested(eviction: Eviction, copies: u32) -> Talk {
    let params = Params { eviction, probes: 64, ..still() };
    let mut talk = Talk::new(&params, &ANCHOR, 64).unwrap();
    talk.add(&[[places(1, 20, 1, 1.0), places(2, 20, copies, 1.0)].concat()]);
    for _ in 0..4 {
        talk.add(&[places(1, 20, 1, 2.0)]);
    }
    talk.add(&[[places(1, 20, 1, 3.0), places(3, 60, 1, 1.0)].concat()]);
    talk
}

/// How many places of a group still have the averages of their first pass, where radiance was 1, when 2 comes.
fn kept(mut talk: Talk, group: u32, count: u32) -> usize {
    talk.next_frame(ANCHOR.origin, DVec3::ZERO);
    talk.add(&[places(group, count, 1, 2.0)]);
    talk.resolve()[0].iter().filter(|(_, resolved)| resolved.diffuse.x < 2.0).count()
}

#[test]
fn what_was_used_lately_stays_and_what_was_not_gives_way() {
    let never = contested(Eviction::Never, 1);
    let least_recent = contested(Eviction::LeastRecent { patience: 1 }, 1);
    let patient = contested(Eviction::LeastRecent { patience: 9 }, 1);
    let [without, with, late] = [&never, &least_recent, &patient].map(Talk::report);
    println!(
        "evicted {} {} {}, unresolved {} {} {}",
        without.evicted, with.evicted, late.evicted, without.unresolved, with.unresolved, late.unresolved
    );
    // 60 new keys meet 20 that are in use, 20 that are not, and 24 free slots.
    assert_eq!((without.evicted, without.unresolved), (0, 36));
    assert_eq!((late.evicted, late.unresolved), (0, 36));
    assert_eq!((with.evicted, with.unresolved), (20, 16));
    assert_eq!(kept(never, 2, 20), 20);
    assert_eq!(kept(least_recent, 2, 20), 0);
    // Of what was in use all stayed: sums hold all passes.
    let mut in_use = contested(Eviction::LeastRecent { patience: 1 }, 1);
    in_use.next_frame(ANCHOR.origin, DVec3::ZERO);
    in_use.add(&[places(1, 20, 1, 9.0)]);
    let expected = (1.0 + 4.0 * 2.0 + 3.0 + 9.0) / 7.0;
    assert!(in_use.resolve()[0].iter().all(|(_, resolved)| resolved.diffuse.x == expected));
}

#[test]
fn health_keeps_what_many_paths_found() {
    let health = Eviction::Health { patience: 1 };
    // An age of 4 over ⌊log₂ 101⌋ is 0, over ⌊log₂ 2⌋ it is 4.
    assert_eq!(kept(contested(health, 100), 2, 20), 20);
    assert_eq!(kept(contested(health, 1), 2, 20), 0);
    assert_eq!(kept(contested(Eviction::LeastRecent { patience: 1 }, 100), 2, 20), 0);
}
