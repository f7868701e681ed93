//! The same scene gives the same bits, however often it is built and whoever asks, coincident surfaces included.

mod support;

use embree::BuildQuality;
use std::thread;
use support::coincident::{answer, answers, rays, scene};
use support::device;

const TRIANGLES: u32 = 4000;
const QUALITIES: [BuildQuality; 2] = [BuildQuality::Medium, BuildQuality::High];

/// The test's own premise: what is there several times is hit at the very same `t`, `u` and `v`, so that which of the
/// copies is reported is up to the acceleration structure.
#[test]
fn coincident_surfaces_tie_exactly() {
    let (device, rays) = (device(), rays(5000));
    let single = answers(&scene(&device, BuildQuality::Medium, TRIANGLES, 1), &rays);
    let tripled = answers(&scene(&device, BuildQuality::Medium, TRIANGLES, 3), &rays);
    let place = |(hit, occluded): &support::coincident::Answer| (hit.map(|bits| bits[0]), *occluded);
    assert_eq!(single.iter().map(place).collect::<Vec<_>>(), tripled.iter().map(place).collect::<Vec<_>>());
    let hits = single.iter().filter(|(hit, _)| hit.is_some()).count();
    assert!(hits > rays.len() / 2, "only {hits} rays hit anything");
}

#[test]
fn repeated_builds_agree() {
    let rays = rays(5000);
    for quality in QUALITIES {
        let build = || answers(&scene(&device(), quality, TRIANGLES, 3), &rays);
        let first = build();
        (0..3).for_each(|_| assert!(build() == first, "{quality:?}: a second build answers otherwise"));
    }
}

/// Several scenes built at the same time on one device, then each asked by several threads at the same time.
#[test]
fn concurrent_builds_and_queries_agree() {
    let (device, rays) = (device(), rays(5000));
    for quality in QUALITIES {
        let first = answers(&scene(&device, quality, TRIANGLES, 3), &rays);
        let work = || {
            let scene = scene(&device, quality, TRIANGLES, 3);
            let ask = |worker: usize| {
                // Each worker begins elsewhere, so that they are never in step.
                let order = (0..rays.len()).map(|i| (i + worker * 1237) % rays.len());
                order.for_each(|i| assert!(answer(&scene, &rays[i]) == first[i], "{quality:?}, ray {i}"));
            };
            let ask = &ask;
            thread::scope(|scope| (0..2).for_each(|worker| _ = scope.spawn(move || ask(worker))));
        };
        thread::scope(|scope| (0..3).for_each(|_| _ = scope.spawn(work)));
    }
}
