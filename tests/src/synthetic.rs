//! Paths made up by formulas, for what of the filter needs no renderer.

use filter::{Adaptive, Anchor, Lobe, PackedRgb, Params, PathRecord, Report, Resolved, Vertex};
use glam::{DVec3, Vec2, Vec3};

/// Random numbers: the sequence of \[Steele14\].
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// A sequence for each seed.
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15))
    }

    /// 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ x >> 31
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1 << 24) as f32
    }

    /// Below `n`.
    pub fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }

    /// Noise of mean 1 and variance 1, skewed as path tracing's is: exponentially distributed.
    pub fn noise(&mut self) -> f32 {
        -(1.0 - self.unit()).ln()
    }

    /// Puts items in a random order.
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, self.below(i as u64 + 1) as usize);
        }
    }
}

/// Where cells are measured from unless a test says otherwise.
pub const ANCHOR: Anchor = Anchor { origin: DVec3::ZERO, extent: 1024.0 };

/// A path that ends at its first vertex, which is diffuse and white.
pub fn diffuse(slot: u32, sample: u32, vertex: Vertex, radiance: f32) -> PathRecord {
    let one = PackedRgb::new(Vec3::ONE);
    let lobe = Lobe { throughput: one, rest: PackedRgb::new(Vec3::splat(radiance)), ..Lobe::default() };
    let mut record = PathRecord { slot, first: vertex, diffuse: lobe, ..PathRecord::default() };
    record.set_sample(sample as u8);
    record
}

/// A flat part of a surface, of `width` × `height` slots.
#[derive(Clone, Copy, Debug)]
pub struct Sheet {
    /// Slots.
    pub size: [u32; 2],
    /// A corner.
    pub corner: Vec3,
    /// Along the sides of a slot.
    pub sides: [Vec3; 2],
    /// What may share cells.
    pub surface: u32,
    /// Number of the first slot, row by row.
    pub first_slot: u32,
}

impl Sheet {
    /// In the plane z = `z`, of slots of side 1, centred.
    pub fn level(size: [u32; 2], z: f32, surface: u32, first_slot: u32) -> Self {
        let corner = Vec3::new(-0.5 * size[0] as f32, -0.5 * size[1] as f32, z);
        Self { size, corner, sides: [Vec3::X, Vec3::Y], surface, first_slot }
    }

    /// The sheet turned and moved.
    pub fn moved(self, by: glam::Affine3A) -> Self {
        let [u, v] = self.sides;
        let sides = [by.transform_vector3(u), by.transform_vector3(v)];
        Self { corner: by.transform_point3(self.corner), sides, ..self }
    }

    /// The side that paths arrive on.
    pub fn n(&self) -> Vec3 {
        self.sides[0].cross(self.sides[1]).normalize()
    }

    /// Number of slots.
    pub fn slots(&self) -> u32 {
        self.size[0] * self.size[1]
    }

    /// Samples of all slots, one after the other. `radiance` of a place, in slots from the corner, and random numbers.
    pub fn paths(&self, spp: u32, seed: u64, radiance: impl Fn(Vec2, &mut Random) -> f32) -> Vec<PathRecord> {
        let mut random = Random::new(seed);
        let footprint = self.sides[0].length();
        let mut paths = Vec::with_capacity((self.slots() * spp) as usize);
        for slot in 0..self.slots() {
            for sample in 0..spp {
                let jitter = Vec2::new(random.unit(), random.unit());
                let at = Vec2::new((slot % self.size[0]) as f32, (slot / self.size[0]) as f32) + jitter;
                let p = self.corner + at.x * self.sides[0] + at.y * self.sides[1];
                let vertex = Vertex::new(p, self.n(), footprint, self.surface, 0);
                paths.push(diffuse(self.first_slot + slot, sample, vertex, radiance(at, &mut random)));
            }
        }
        paths
    }
}

/// What each of `slots` slots gets; each block is an epoch.
pub fn resolve(params: &Params, anchor: &Anchor, blocks: &[&[PathRecord]], slots: u32) -> (Vec<Resolved>, Report) {
    let mut filter = Adaptive::new(params, anchor, 1);
    for block in blocks {
        filter.begin_epoch();
        filter.add(&[block.to_vec()]);
    }
    let mut values = vec![Resolved::default(); slots as usize];
    for (slot, value) in filter.resolve().into_iter().flatten() {
        values[slot as usize] = value;
    }
    (values, filter.report())
}

/// Mean over the paths of each slot: of what the filter makes of white diffuse `paths`.
pub fn means(params: &Params, anchor: &Anchor, paths: &[PathRecord], slots: u32) -> Vec<f64> {
    let mut counts = vec![0u32; slots as usize];
    paths.iter().for_each(|path| counts[path.slot as usize] += 1);
    let (values, _) = resolve(params, anchor, &[paths], slots);
    values.iter().zip(counts).map(|(value, n)| f64::from(value.diffuse.y) / f64::from(n.max(1))).collect()
}

/// The same without a filter.
pub fn unfiltered(paths: &[PathRecord], slots: u32) -> Vec<f64> {
    let mut sums = vec![(0.0, 0u32); slots as usize];
    for path in paths {
        let sum = &mut sums[path.slot as usize];
        *sum = (sum.0 + f64::from(path.unfiltered().y), sum.1 + 1);
    }
    sums.iter().map(|(sum, n)| sum / f64::from((*n).max(1))).collect()
}

/// Mean of numbers.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Root of the mean square.
pub fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, n) = values.into_iter().fold((0.0, 0.0), |(sum, n), x| (sum + x * x, n + 1.0));
    f64::sqrt(sum / f64::max(n, 1.0))
}

/// Whether to take the time for the thorough variants: `ci/test-filter` asks for them.
pub fn thorough() -> bool {
    std::env::var_os("TESSERA_THOROUGH").is_some()
}
