use proptest::prelude::*;

use super::*;

const ANCHOR: Anchor = Anchor { origin: DVec3::new(3.0, -2.0, 7.0), extent: 20.0 };

/// The finest cell of a place.
fn key(grid: &Grid, p: [f32; 3], n: Vec3, side: f32, attributes: u64) -> Option<CellKey> {
    let (mut places, mut leaves) = (Places::default(), Vec::new());
    places.push(p, n, side, grid.finest(), attributes);
    grid.leaves(&places, &mut leaves);
    leaves[0].exists().then(|| leaves[0].key())
}

proptest! {
    #[test]
    fn cells_nest(x in -20.0f32..20.0, y in -20.0f32..20.0, z in -20.0f32..20.0, tree in 0u32..4, up in 1i32..8) {
        let grid = Grid::new(&ANCHOR, tree, 4);
        let fine = key(&grid, [x, y, z], Vec3::Z, 0.01, 5).unwrap();
        let coarse = key(&grid, [x, y, z], Vec3::Z, 0.01 * power_of_two(up) as f32, 5).unwrap();
        let ancestor = (0..up).fold(fine, |key, _| key.parent());
        prop_assert_eq!(ancestor, coarse);
        prop_assert_eq!(ancestor.level(), fine.level() + up);
    }

    #[test]
    fn scaling_by_a_power_of_two_changes_the_level_alone(
        x in -20.0f32..20.0, y in -20.0f32..20.0, side in 0.001f32..1.0, e in -20i32..=20, tree in 0u32..4,
    ) {
        let scale = power_of_two(e);
        let scaled = Anchor { origin: ANCHOR.origin * scale, extent: ANCHOR.extent * scale };
        let (a, b) = (Grid::new(&ANCHOR, tree, 4), Grid::new(&scaled, tree, 4));
        let s = scale as f32;
        let at = key(&a, [x, y, 1.0], Vec3::X, side, 1).unwrap();
        let there = key(&b, [x * s, y * s, s], Vec3::X, side * s, 1).unwrap();
        prop_assert_eq!(there.level(), at.level() + e);
        prop_assert_eq!(there.bits() << 16, at.bits() << 16);
    }

    #[test]
    fn ancestors_are_parents_of_parents(c in any::<[i32; 3]>(), up in 0i32..30) {
        let key = CellKey::new(-7, 9, c.map(|x| x >> 11));
        prop_assert_eq!(key.ancestor(key.level() + up), (0..up).fold(key, |key, _| key.parent()));
        prop_assert_eq!(LeafCell::from(key).key(), key);
    }

    #[test]
    fn parents_keep_the_order(a in any::<[i32; 3]>(), b in any::<[i32; 3]>()) {
        let key = |c: [i32; 3]| CellKey::new(0, 9, c.map(|x| x >> 11));
        let (a, b) = (key(a), key(b));
        prop_assert_eq!(a.cmp(&b).then(a.parent().cmp(&b.parent())), a.cmp(&b));
    }
}

#[test]
fn normals_and_attributes_separate() {
    let grid = Grid::new(&ANCHOR, 0, 4);
    let keys = [
        key(&grid, [1.0; 3], Vec3::Z, 0.1, 1),
        key(&grid, [1.0; 3], -Vec3::Z, 0.1, 1),
        key(&grid, [1.0; 3], Vec3::X, 0.1, 1),
        key(&grid, [1.0; 3], Vec3::Z, 0.1, 2),
    ];
    for (i, a) in keys.iter().enumerate() {
        assert!(a.is_some());
        assert!(keys[..i].iter().all(|b| a != b));
    }
}

#[test]
fn walls_along_the_axes_are_separate_in_every_tree() {
    let normals = [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z];
    for count in 1..=8 {
        for grid in (0..count).map(|index| Grid::new(&ANCHOR, index, count)) {
            let key = |n: Vec3| key(&grid, [1.0; 3], n, 0.1, 1).unwrap();
            let mut keys: Vec<CellKey> = normals.iter().map(|n| key(*n)).collect();
            keys.sort_unstable();
            keys.dedup();
            assert_eq!(keys.len(), 6);
            // With room to spare: a bumpy wall is still one wall.
            assert!(normals.iter().all(|n| key(*n) == key((*n + 0.2 * n.any_orthonormal_vector()).normalize())));
        }
    }
}

#[test]
fn no_border_passes_through_the_camera_or_at_a_round_distance_from_it() {
    for grid in (0..8).map(|index| Grid::new(&ANCHOR, index, 8)) {
        let shift = (ANCHOR.origin - grid.corner).to_array();
        // No multiple of a 64th, which a border of cells of that side would be.
        assert!(shift.iter().all(|x| (x * 64.0).fract() > 1e-3 && (x * 64.0).fract() < 1.0 - 1e-3), "{shift:?}");
    }
}

#[test]
fn far_places_have_no_cell_and_all_of_the_scene_has_one() {
    let grid = Grid::new(&ANCHOR, 0, 4);
    assert_eq!(key(&grid, [1e9, 0.0, 0.0], Vec3::Z, 1e-6, 0), None);
    for side in [1e-30, 1e-6, 1.0] {
        assert!(key(&grid, [23.0, -22.0, 27.0], Vec3::Z, side, 0).is_some());
    }
}
