//! Path space filtering before hashing: every path looks for its neighbours.
//!
//! **Source**: \[Keller14\].

use std::cmp::Ordering;

use filter::{Lobe, PathRecord};
use glam::{DVec3, Vec3};
use kd_tree::KdTree3;
use rayon::prelude::*;

/// What counts as near.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeSearch {
    /// Radius of the ball around a vertex, in its own footprints.
    pub radius: f32,
    /// Cosine c of the largest angle between normals. A neighbour counts by (n·n′ − c) / (1 − c).
    pub normal_cosine: f32,
}

impl Default for RangeSearch {
    /// Balls with the variance of the talk's kernel of 8 footprints: r²/4 = h²/3 on a plane. Normals within 30°.
    fn default() -> Self {
        Self { radius: 8.0 * (4f32 / 3.0).sqrt(), normal_cosine: 0.866 }
    }
}

/// A vertex as its neighbours see it.
#[derive(Clone, Copy, Debug)]
struct Neighbour {
    p: [f32; 3],
    n: Vec3,
    radiance: Vec3,
    /// Surface, and for glossy lobes the bin of directions.
    kind: (u32, u8),
}

#[derive(Clone, Copy, Debug)]
enum Layer {
    Diffuse,
    Glossy,
}

impl Layer {
    fn lobe(self, record: &PathRecord) -> &Lobe {
        match self {
            Self::Diffuse => &record.diffuse,
            Self::Glossy => &record.glossy,
        }
    }

    /// `None` where there is nothing to share.
    fn neighbour(self, record: &PathRecord) -> Option<Neighbour> {
        let (lobe, first) = (self.lobe(record), &record.first);
        let radiance = lobe.incident(record.suffix.get());
        let bin = match self {
            Self::Diffuse => 0,
            Self::Glossy => first.bin(),
        };
        let usable = !lobe.is_black() && first.exists() && radiance.is_finite();
        usable.then(|| Neighbour { p: first.p, n: first.n.get(), radiance, kind: (first.surface(), bin) })
    }
}

impl RangeSearch {
    /// What each path brings to its slot: through each lobe throughput × weighted mean of the radiance that arrives in the
    /// same lobe of neighbours, the path among them. Paths without a vertex, or with radiance that is not finite, keep
    /// their own.
    ///
    /// The work is proportional to records × neighbours of each.
    pub fn filter(&self, records: &[PathRecord]) -> Vec<Vec3> {
        let mut brought = vec![Vec3::ZERO; records.len()];
        for layer in [Layer::Diffuse, Layer::Glossy] {
            let neighbours: Vec<Neighbour> = records.iter().filter_map(|record| layer.neighbour(record)).collect();
            let tree = KdTree3::par_build_by(neighbours, |a, b, axis| a.p[axis].total_cmp(&b.p[axis]));
            brought.par_iter_mut().zip(records).for_each(|(brought, record)| {
                let lobe = layer.lobe(record);
                if !lobe.is_black() {
                    let average = match layer.neighbour(record) {
                        Some(own) => self.average(&tree, &own, self.radius * record.first.footprint.get()),
                        None => lobe.incident(record.suffix.get()),
                    };
                    *brought += lobe.throughput.get() * average;
                }
            });
        }
        brought
    }

    fn average(&self, tree: &KdTree3<Neighbour>, own: &Neighbour, radius: f32) -> Vec3 {
        let compare = |other: &Neighbour, axis: usize| {
            let difference = other.p[axis] - own.p[axis];
            if difference < -radius {
                Ordering::Less
            } else if difference > radius {
                Ordering::Greater
            } else {
                Ordering::Equal
            }
        };
        let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
        // The path itself is in the tree and counts by 1. The tree's order is that of the records, whoever searches.
        for other in tree.within_by_cmp(compare) {
            let near = Vec3::from_array(other.p).distance_squared(Vec3::from_array(own.p)) <= radius * radius;
            let alike = (other.n.dot(own.n) - self.normal_cosine) / (1.0 - self.normal_cosine);
            if near && alike > 0.0 && other.kind == own.kind {
                sum += f64::from(alike) * other.radiance.as_dvec3();
                weights += f64::from(alike);
            }
        }
        (sum / weights).as_vec3()
    }
}

#[cfg(test)]
mod tests {
    use filter::{PackedRgb, Vertex};

    use super::*;

    fn lobe(radiance: f32) -> Lobe {
        let [throughput, rest] = [0.5, radiance].map(|x| PackedRgb::new(Vec3::splat(x)));
        Lobe { throughput, rest, ..Lobe::default() }
    }

    fn record(p: Vec3, n: Vec3, surface: u32, radiance: f32) -> PathRecord {
        PathRecord { first: Vertex::new(p, n, 1.0, surface, 0), diffuse: lobe(radiance), ..PathRecord::default() }
    }

    const NEAR: RangeSearch = RangeSearch { radius: 1.5, normal_cosine: 0.5 };

    #[test]
    fn only_near_and_similar_vertices_are_averaged() {
        let tilted = Vec3::new(0.0, 0.6, 0.8);
        let records = [
            record(Vec3::ZERO, Vec3::Z, 0, 1.0),
            record(Vec3::X, Vec3::Z, 0, 4.0),
            record(Vec3::X * 2.0, Vec3::Z, 0, 100.0),
            record(Vec3::Y * 0.1, Vec3::Z, 1, 1000.0),
            record(Vec3::Y * 0.1, Vec3::X, 0, 10_000.0),
            record(Vec3::Y, tilted, 0, 10.0),
        ];
        let brought = NEAR.filter(&records);
        // The tilted neighbour counts by (0.8 − 0.5) / (1 − 0.5); normals are stored to a degree.
        let expected = 0.5 * (1.0 + 4.0 + 0.6 * 10.0) / 2.6;
        assert!((brought[0].x - expected).abs() < 0.05, "{} not {expected}", brought[0].x);
        assert!((brought[3].x - 500.0).abs() < 0.01 && (brought[4].x - 5000.0).abs() < 0.1);
    }

    #[test]
    fn the_tree_finds_what_looking_at_all_finds() {
        let random = |i: u32| f32::from((i.wrapping_mul(2_654_435_761) >> 16) as u16) / 65536.0;
        let at = |i: u32| Vec3::new(random(3 * i), random(3 * i + 1), 0.1 * random(3 * i + 2)) * 20.0;
        let records: Vec<PathRecord> = (0..2000).map(|i| record(at(i), Vec3::Z, 0, random(7 * i + 5))).collect();
        for (own, brought) in records.iter().zip(NEAR.filter(&records)) {
            let p = Vec3::from_array(own.first.p);
            let near = records.iter().filter(|r| Vec3::from_array(r.first.p).distance(p) <= NEAR.radius);
            let values: Vec<f32> = near.map(|record| record.diffuse.rest.get().x).collect();
            let expected = 0.5 * values.iter().sum::<f32>() / values.len() as f32;
            assert!((brought.x - expected).abs() < 1e-5, "{} not {expected}", brought.x);
        }
    }

    #[test]
    fn layers_and_directions_do_not_mix_and_bad_radiance_stays_alone() {
        let with = |bin: u8, diffuse: f32, glossy: f32| {
            let first = Vertex::new(Vec3::ZERO, Vec3::Z, 1.0, 0, bin);
            PathRecord { first, diffuse: lobe(diffuse), glossy: lobe(glossy), ..PathRecord::default() }
        };
        let records = [with(0, 1.0, 10.0), with(0, 3.0, 30.0), with(1, 5.0, 500.0), with(0, f32::NAN, 20.0)];
        let brought = NEAR.filter(&records);
        let expected = [0.5 * (3.0 + 20.0), 0.5 * (3.0 + 20.0), 0.5 * (3.0 + 500.0)];
        assert!(brought.iter().zip(expected).all(|(b, expected)| (b.x - expected).abs() < 0.01), "{brought:?}");
        assert!(brought[3].is_nan());
    }
}
