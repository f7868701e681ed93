use proptest::prelude::*;

use super::*;
use crate::packed::PackedNormal;

const ANCHOR: Anchor = Anchor { origin: DVec3::new(3.0, -2.0, 7.0), extent: 20.0 };

fn plain() -> Params {
    Params { jitter: Jitter::None, normal_jitter: 0.0, glossy_finer: 1.0, ..Params::default() }
}

fn locator(params: Params) -> Locator {
    params.validate().unwrap();
    Locator::new(&params, &ANCHOR, ANCHOR.origin)
}

/// Keys of one path; the path's number only moves the jitter.
fn keys_of(params: Params, vertex: &Vertex, layer: Layer, path: u32) -> Vec<Key> {
    let mut keys = Vec::new();
    locator(params).keys(vertex, layer, Random::new(path, 0, 0, 1), &mut keys);
    keys
}

fn key(params: Params, vertex: &Vertex, layer: Layer) -> Key {
    keys_of(params, vertex, layer, 0)[0]
}

fn vertex(p: Vec3, n: Vec3, surface: u32, bin: u8) -> Vertex {
    Vertex::new(p, n, 0.01, surface, bin)
}

/// How often two hundred jittered paths leave the cell that they have without jitter.
fn share_elsewhere(params: Params, vertex: &Vertex) -> f64 {
    let home = key(Params { jitter: Jitter::None, normal_jitter: 0.0, ..params }, vertex, Layer::Diffuse);
    let elsewhere = (0..200).filter(|&path| keys_of(params, vertex, Layer::Diffuse, path)[0] != home).count();
    elsewhere as f64 / 200.0
}

#[test]
fn each_attribute_is_in_the_key_if_its_knob_says_so() {
    let p = Vec3::new(1.0, 2.0, 3.0);
    let base = vertex(p, Vec3::Z, 1, 1);
    let same = |params: Params, other: &Vertex, layers: [Layer; 2]| {
        key(params, &base, layers[0]) == key(params, other, layers[1])
    };
    use Layer::{Diffuse, Glossy};
    let ok = plain();
    let turned = vertex(p, Vec3::X, 1, 1);
    assert!(!same(ok, &turned, [Diffuse; 2]));
    assert!(same(Params { normal_bins: 0, ..ok }, &turned, [Diffuse; 2]));
    let elsewhere = vertex(p, Vec3::Z, 2, 1);
    assert!(!same(ok, &elsewhere, [Diffuse; 2]));
    assert!(same(Params { surface: false, ..ok }, &elsewhere, [Diffuse; 2]));
    let reflecting = vertex(p, Vec3::Z, 1, 2);
    assert!(!same(ok, &reflecting, [Glossy; 2]));
    assert!(same(Params { direction: false, ..ok }, &reflecting, [Glossy; 2]));
    assert!(same(ok, &reflecting, [Diffuse; 2]), "diffuse cells do not know directions");
    let no_direction = Params { direction: false, ..ok };
    assert!(!same(no_direction, &base, [Diffuse, Glossy]));
    assert!(same(Params { layers: false, ..no_direction }, &base, [Diffuse, Glossy]));
}

#[test]
fn opposite_and_perpendicular_walls_never_meet() {
    let walls = [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z];
    for bins in [1, 3, 5] {
        let params = Params { normal_bins: bins, normal_jitter: Params::default().normal_jitter, ..plain() };
        let all: Vec<Vec<Key>> = walls
            .iter()
            .map(|&n| {
                let vertex = vertex(Vec3::ONE, n, 0, 0);
                (0..200).map(|path| keys_of(params, &vertex, Layer::Diffuse, path)[0]).collect()
            })
            .collect();
        for (i, a) in all.iter().enumerate() {
            assert!(bins == 1 || a.iter().all(|key| *key == a[0]), "jitter moves a wall out of its bin");
            assert!(all[..i].iter().flatten().all(|key| !a.contains(key)), "{bins} bins");
        }
    }
}

#[test]
fn all_normal_bins_are_reached_and_told_apart() {
    let bins = 4;
    let mut seen = [false; 6 * 16];
    for i in 0..20_000 {
        let u = Random::new(i, 0, 0, 0).point(0) * 2.0 - 1.0;
        let n = Vec3::new(u.x, u.y, Random::new(i, 0, 0, 0).point(1).x * 2.0 - 1.0);
        seen[normal_bin(n.normalize(), bins) as usize] = true;
    }
    assert!(seen.iter().all(|&seen| seen));
}

#[test]
fn normals_are_jittered_by_the_bin() {
    // A normal in the middle between two bins of 1/4 of a face: half of the paths change bins.
    let bin = 2.0 / 4.0;
    let on_border = vertex(Vec3::ONE, Vec3::new(bin, 0.3 * bin, 1.0).normalize(), 0, 0);
    let params = Params { normal_bins: 4, ..plain() };
    let share = share_elsewhere(Params { normal_jitter: 0.5, ..params }, &on_border);
    assert!((0.3..0.7).contains(&share), "{share} of the paths left their bin");
    assert_eq!(share_elsewhere(params, &on_border), 0.0);
    let inside = vertex(Vec3::ONE, Vec3::new(0.5 * bin, 0.5 * bin, 1.0).normalize(), 0, 0);
    assert!(share_elsewhere(Params { normal_jitter: 0.4, ..params }, &inside) < 0.05);
}

#[test]
fn jitter_stays_in_the_tangent_plane_and_within_its_radius() {
    let n = Vec3::new(0.3, -0.5, 0.8).normalize();
    let (t, b) = PackedNormal::new(n).get().any_orthonormal_pair();
    assert!(t.cross(b).dot(n) > 0.999);
    let points = |jitter: Jitter| -> Vec<Vec2> {
        let locator = locator(Params { jitter, ..plain() });
        (0..20_000).map(|path| locator.offset(Random::new(path, 0, 0, 1))).collect()
    };
    let variance = |points: &[Vec2]| points.iter().map(|p| p.x * p.x).sum::<f32>() / points.len() as f32;
    let square = points(Jitter::Square { radius: 0.5 });
    assert!(square.iter().all(|p| p.abs().max_element() <= 0.5) && square.iter().any(|p| p.length() > 0.65));
    assert!((variance(&square) * 12.0 - 1.0).abs() < 0.05);
    let disk = points(Jitter::Disk { radius: 2.0 });
    assert!(disk.iter().all(|p| p.length() <= 2.0) && disk.iter().any(|p| p.length() > 1.95));
    // r²/4 along each axis: uniform in area, not in radius, which would give r²/6.
    assert!((variance(&disk) - 1.0).abs() < 0.05);
    assert!(points(Jitter::None).iter().all(|&p| p == Vec2::ZERO));
}

#[test]
fn levels_of_detail_double_the_side_where_they_should() {
    // How far two vertices along an axis may be apart in one cell: the side.
    let side = |level: LevelOfDetail, at: Vec3, footprint: f32, layer: Layer, finer: f32| {
        let params = Params { level, glossy_finer: finer, ..plain() };
        let key = |x: f32| key(params, &Vertex::new(at + Vec3::X * x, Vec3::Z, footprint, 0, 0), layer);
        let step = 1.0 / 4096.0;
        let borders: Vec<i32> = (1..8192).filter(|&i| key(i as f32 * step) != key((i - 1) as f32 * step)).collect();
        (borders[1] - borders[0]) as f32 * step
    };
    let eye = ANCHOR.origin.as_vec3();
    let by_distance = LevelOfDetail::Distance { side: 0.125 };
    let at = |z: f32| eye + Vec3::Z * z;
    for (distance, expected) in [(1.3, 0.125), (1.8, 0.125), (2.1, 0.25), (3.0, 0.25), (4.5, 0.5), (0.7, 0.0625)] {
        // Far enough to the side that no level's border is crossed on the way.
        let got = side(by_distance, at(distance), 1e-3, Layer::Diffuse, 1.0);
        assert!((got - expected).abs() < 1e-3, "{got} at {distance}");
    }
    let by_footprint = LevelOfDetail::Footprint { side: 8.0 };
    for (footprint, expected) in [(0.0175, 0.125), (0.031, 0.125), (0.0325, 0.25), (0.05, 0.25)] {
        let got = side(by_footprint, at(5.0), footprint, Layer::Diffuse, 1.0);
        assert!((got - expected).abs() < 1e-3, "{got} with {footprint}");
    }
    let fixed = LevelOfDetail::Fixed { side: 0.25 };
    for distance in [0.1, 1.0, 100.0] {
        assert!((side(fixed, at(distance), 0.03, Layer::Diffuse, 1.0) - 0.25).abs() < 1e-3);
    }
    assert!((side(fixed, at(1.0), 0.03, Layer::Glossy, 2.0) - 0.125).abs() < 1e-3);
    assert!((side(fixed, at(1.0), 0.03, Layer::Diffuse, 2.0) - 0.25).abs() < 1e-3);
}

#[test]
fn a_level_above_is_that_of_another_path_twice_as_far() {
    let params = Params { lookups: 3, ..plain() };
    let near = keys_of(params, &Vertex::new(Vec3::ONE, Vec3::Z, 0.01, 0, 0), Layer::Diffuse, 0);
    let far = keys_of(params, &Vertex::new(Vec3::ONE, Vec3::Z, 0.02, 0, 0), Layer::Diffuse, 0);
    assert_eq!(near.len(), 3);
    assert_eq!(near[1..], far[..2]);
    assert_ne!(near[0], near[1]);
}

#[test]
fn the_level_is_that_of_the_jittered_place() {
    // At the border between two levels, half of the paths are on either side of it, if the cells are large enough for the
    // jitter to reach across: on a plane seen from above at a slant.
    let eye = ANCHOR.origin.as_vec3();
    let params =
        Params { level: LevelOfDetail::Distance { side: 0.25 }, jitter: Jitter::Square { radius: 0.5 }, ..plain() };
    let locator = locator(params);
    for (distance, expected) in [(2.0, 0.5), (1.7, 0.0), (2.5, 1.0)] {
        let at = vertex(eye + Vec3::X * distance, Vec3::Z, 0, 0);
        let p = Vec3::from_array(at.p).as_dvec3();
        let coarse = (0..2000).filter(|&path| {
            let offset = locator.offset(Random::new(path, 0, 0, 1)) * 0.25;
            locator.level(&at, p, p + Vec3::new(offset.x, offset.y, 0.0).as_dvec3()) == 1
        });
        let share = coarse.count() as f64 / 2000.0;
        assert!((share - expected).abs() < 0.05, "{share} at {distance}");
    }
    // And so are footprints.
    let params = Params { level: LevelOfDetail::Footprint { side: 16.0 }, ..params };
    let at = Vertex::new(eye + Vec3::X * 2.0, Vec3::Z, 1.0 / 64.0, 0, 0);
    let p = Vec3::from_array(at.p).as_dvec3();
    let locator = self::locator(params);
    assert_eq!(locator.level(&at, p, p + DVec3::X * 0.1), -6);
    assert_eq!(locator.level(&at, p, p - DVec3::X * 0.1), -7);
}

#[test]
fn places_without_a_cell_have_no_key() {
    let params = plain();
    let tiny = LevelOfDetail::Fixed { side: 1e-30 };
    assert!(keys_of(Params { level: tiny, ..params }, &vertex(Vec3::ONE, Vec3::Z, 0, 0), Layer::Diffuse, 0).is_empty());
    assert!(keys_of(params, &vertex(Vec3::NAN, Vec3::Z, 0, 0), Layer::Diffuse, 0).is_empty());
    assert!(keys_of(params, &Vertex::none(0), Layer::Diffuse, 0).is_empty());
}

#[test]
fn at_the_eye_itself_there_is_a_cell() {
    let eye = ANCHOR.origin.as_vec3();
    for level in [LevelOfDetail::Distance { side: 0.1 }, LevelOfDetail::Footprint { side: 8.0 }] {
        let params = Params { level, jitter: Jitter::Square { radius: 0.5 }, ..plain() };
        for offset in [0.0, 1e-20, 1e-6] {
            assert_eq!(keys_of(params, &vertex(eye + Vec3::X * offset, Vec3::Z, 0, 0), Layer::Diffuse, 0).len(), 1);
        }
    }
}

#[test]
fn adversarial_neighbours_have_different_words_and_their_homes_are_uniform() {
    // A sheet of cells along the axes, at several levels, with negative coordinates, and attributes that differ by a bit.
    let mut keys = Vec::new();
    for x in -64..64 {
        for y in -64..64 {
            for (level, attributes) in [(0, 0), (1, 0), (-1, 0), (0, 1), (0, 1 << 20), (0, 1 << 44), (0, 1 << 52)] {
                keys.push(Cell { position: [x, y, 0], level, attributes }.key(57));
            }
        }
    }
    let mut homes = [0u32; 256];
    keys.iter().for_each(|key| homes[(key.home >> 56) as usize] += 1);
    let mean = keys.len() as f64 / 256.0;
    let chi2: f64 = homes.iter().map(|&count| (f64::from(count) - mean).powi(2) / mean).sum();
    assert!((chi2 - 255.0).abs() < 6.0 * 510f64.sqrt(), "chi² {chi2}");
    let count = keys.len();
    keys.sort_by_key(|key| key.verification);
    keys.dedup_by_key(|key| key.verification);
    assert_eq!(keys.len(), count);
}

proptest! {
    #[test]
    fn scaling_by_a_power_of_two_changes_no_key(
        x in -20.0f32..20.0, y in -20.0f32..20.0, footprint in 0.001f32..0.1, e in -20i32..=20, path in 0u32..1000,
        by_distance in any::<bool>(), lookups in 1u32..=4,
    ) {
        let level =
            if by_distance { LevelOfDetail::Distance { side: 0.01 } } else { LevelOfDetail::Footprint { side: 8.0 } };
        let params = Params { level, lookups, ..Params::default() };
        let keys = |scale: f64| {
            let anchor = Anchor { origin: ANCHOR.origin * scale, extent: ANCHOR.extent * scale };
            let at = Vertex::new(Vec3::new(x, y, 1.0) * scale as f32, Vec3::new(0.6, 0.0, 0.8), footprint * scale as f32, 3, 4);
            let mut keys = Vec::new();
            Locator::new(&params, &anchor, anchor.origin).keys(&at, Layer::Glossy, Random::new(path, 0, 1, 1), &mut keys);
            keys
        };
        prop_assert_eq!(keys(1.0), keys(power_of_two(e)));
    }
}
