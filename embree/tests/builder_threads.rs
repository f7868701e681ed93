//! Alone in its process, because the number of builder threads belongs to the process.

mod support;

use embree::{BuildQuality, Device, DeviceOptions};
use support::coincident::{answers, rays, scene};

/// With the medium quality, whose builder sorts what lies in a leaf, more threads change nothing but the time.
#[test]
fn medium_builds_do_not_depend_on_the_number_of_threads() {
    let rays = rays(5000);
    let build = |threads| {
        let device = Device::new(&DeviceOptions { threads, ..DeviceOptions::default() }).unwrap();
        answers(&scene(&device, BuildQuality::Medium, 20_000, 3), &rays)
    };
    let first = build(1);
    for threads in [2, 2, 3, 4] {
        assert!(build(threads) == first, "{threads} threads");
    }
}
