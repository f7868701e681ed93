//! Scenes that are formulas.

use glam::{DVec3, Vec3};

use crate::grid::Anchor;
use crate::hash::mix64;
use crate::packed::PackedRgb;
use crate::record::{Lobe, PathRecord, Vertex};
use crate::talk::{Params, Report, Resolved, Talk};

pub const ANCHOR: Anchor = Anchor { origin: DVec3::new(0.3, -0.2, 5.0), extent: 10.0 };

/// A random number of [0, 1).
pub fn random(seed: u64) -> f64 {
    (mix64(seed) >> 11) as f64 / (1u64 << 53) as f64
}

/// A lobe of throughput 1 in which `radiance` arrives.
pub fn lobe(radiance: Vec3) -> Lobe {
    Lobe { throughput: PackedRgb::new(Vec3::ONE), rest: PackedRgb::new(radiance), transfer: PackedRgb::default() }
}

/// A path of `slot` that meets a diffuse surface.
pub fn diffuse(slot: u32, p: Vec3, n: Vec3, radiance: f32) -> PathRecord {
    let first = Vertex::new(p, n, 1.0 / 64.0, 0, 0);
    PathRecord { slot, first, diffuse: lobe(Vec3::splat(radiance)), ..PathRecord::default() }
}

/// The `number`th sample of its slot.
pub fn sample(record: PathRecord, number: u8) -> PathRecord {
    PathRecord { second: Vertex::none(number), ..record }
}

/// One pass of one part.
pub fn filtered(params: &Params, anchor: &Anchor, records: Vec<PathRecord>) -> (Vec<(u32, Resolved)>, Report) {
    let mut talk = Talk::new(params, anchor, records.len()).unwrap();
    talk.add(&[records]);
    (talk.resolve().remove(0), talk.report())
}

/// `count` paths with noise on a square of side 4 around the origin, with both lobes, four samples to a slot.
pub fn noisy_square(count: u32, seed: u64) -> Vec<PathRecord> {
    (0..count)
        .map(|i| {
            let random = |axis: u64| random(seed << 40 | u64::from(i) << 3 | axis) as f32;
            let p = Vec3::new(4.0 * random(0) - 2.0, 4.0 * random(1) - 2.0, 0.0);
            let first = Vertex::new(p, Vec3::Z, 1.0 / 64.0, 0, (8.0 * random(2)) as u8);
            let glossy = if i % 3 == 0 { lobe(Vec3::splat(random(3))) } else { Lobe::default() };
            let diffuse = lobe(Vec3::new(random(4), 3.0 * random(5), 0.1));
            sample(PathRecord { slot: i / 4, first, diffuse, glossy, ..PathRecord::default() }, i as u8 % 4)
        })
        .collect()
}
