//! The adaptive filter's exactness: sums, keys, order, places, and what must never get into a cell.
#![allow(clippy::print_stdout, reason = "tests print the figures that they judge")]

use std::collections::HashSet;

use filter::{Adaptive, Anchor, Branch, Lobe, PackedRgb, Params, PathRecord, Resolved, Shrinkage, Slots, Vertex};
use glam::{DVec3, Vec3};
use tests::synthetic::{ANCHOR, Random, Sheet, diffuse, resolve, thorough};

/// One tree whose cells are trusted as they are.
fn bare() -> Params {
    Params {
        trees: 1,
        second_trees: 1,
        leaf: 1.0,
        shrinkage: Shrinkage { certain: f64::NEG_INFINITY, levels: 0, ..Params::default().shrinkage },
        ..Params::default()
    }
}

/// A permutation of 51 bits, so that different numbers make different places.
fn scrambled(i: u64) -> [i32; 3] {
    const MASK: u64 = (1 << 51) - 1;
    let x = i.wrapping_mul(0x5851_f42d_4c95_7f2d) & MASK;
    let x = ((x ^ x >> 25).wrapping_mul(0x2545_f491_4f6c_dd1d)) & MASK;
    let x = x ^ x >> 26;
    let coordinate = |at: u32| (x >> at & 0x1_ffff) as i32 - (1 << 16);
    [coordinate(0), coordinate(17), coordinate(34)]
}

/// Cells are half a unit wide, and there are 2²⁰ of them to either side.
const WIDE: Anchor = Anchor { origin: DVec3::new(0.3, -0.7, 0.1), extent: 131_072.0 };

#[test]
fn random_keys_are_never_taken_for_each_other() {
    // Merged keys would make fewer cells than there are places.
    const ROUND: u64 = 1 << 20;
    let rounds = if thorough() { 96 } else { 10 };
    let (mut places, mut cells) = (0, 0);
    for round in 0..rounds {
        let mut filter = Adaptive::new(&bare(), &WIDE, 1);
        for block in 0..8 {
            let first = round * ROUND + block * ROUND / 8;
            let paths = (first..first + ROUND / 8).map(|i| {
                let p = Vec3::from_array(scrambled(i).map(|x| x as f32));
                diffuse((i % 64) as u32, 0, Vertex::new(p, Vec3::Z, 1.0, 7, 0), 1.0)
            });
            filter.add(&[paths.collect()]);
        }
        let report = filter.report();
        assert_eq!(report.unfiltered, 0);
        places += report.paths;
        cells += report.cells;
    }
    println!("{places} random keys in tables of {ROUND}: {} merged (bound 0)", places - cells);
    assert_eq!(cells, places);
}

/// Keys that differ in little: a sheet of neighbours across all signs, single bits of coordinates, surfaces, normals, and
/// sizes of cells.
fn adversarial() -> Vec<Vertex> {
    let mut seen = HashSet::new();
    let mut vertices = Vec::new();
    let mut add = |p: [i32; 3], n: usize, level: i32, surface: u32| {
        if seen.insert((p, n, level, surface)) {
            let normal = [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z][n];
            // One unit of `p` is the side of a cell.
            let side = 0.5 * (level as f32).exp2();
            let p = Vec3::from_array(p.map(|x| x as f32)) * side;
            vertices.push(Vertex::new(p, normal, (level as f32).exp2(), surface, 0));
        }
    };
    for x in -300..300 {
        for y in -300..300 {
            add([x, y, 0], 4, 0, 1);
            add([0, x, y], 0, 0, 1);
        }
    }
    for base in [[0; 3], [-1; 3], [1000, -2000, 3000]] {
        for axis in 0..3 {
            for bit in 0..17 {
                for surface in (0..24).map(|bit| 1 << bit) {
                    let mut p = base;
                    p[axis] ^= 1 << bit;
                    add(p, 2, 0, surface);
                }
                for level in 0..17 {
                    for n in 0..6 {
                        let mut p = base;
                        p[axis] ^= 1 << bit >> level;
                        add(p.map(|x| x >> level), n, level, 3);
                    }
                }
            }
        }
    }
    vertices
}

#[test]
fn similar_keys_are_never_taken_for_each_other() {
    let vertices = adversarial();
    // The number of a path in two channels, for a packed channel has 17 bits.
    let number = |i: u32| Vec3::new((i % 1024) as f32, (i / 1024) as f32, 1.0);
    let path = |(vertex, i): (&Vertex, u32)| {
        let mut path = diffuse(i, 0, *vertex, 0.0);
        path.diffuse.rest = PackedRgb::new(number(i));
        path
    };
    let paths: Vec<PathRecord> = vertices.iter().zip(0..).map(path).collect();
    let (values, report) = resolve(&bare(), &WIDE, &[&paths], paths.len() as u32);
    let wrong =
        values.iter().zip(0..).filter(|(value, i)| (value.diffuse - number(*i)).abs().max_element() > 1e-3).count();
    println!("{} adversarial keys: {wrong} wrong values, {} cells (bounds 0, all)", paths.len(), report.cells);
    assert_eq!(wrong, 0);
    assert_eq!(report.cells, paths.len() as u64);
    assert_eq!(report.unfiltered, 0);
}

#[test]
fn a_cell_takes_any_number_of_the_largest_deposits() {
    // 2²⁰ units are the most that a cell takes. 64-bit sums overflow at the 2¹⁴th, those of squares at the first.
    const LARGEST: f32 = (1 << 20) as f32;
    let vertex = Vertex::new(Vec3::splat(0.3), Vec3::Z, 1.0, 1, 0);
    let block: Vec<PathRecord> = (0..1 << 16).map(|i| diffuse(0, i, vertex, LARGEST)).collect();
    let (values, report) = resolve(&Params::default(), &ANCHOR, &[block.as_slice(); 16], 1);
    let mean = values[0].diffuse.y / (1 << 20) as f32;
    println!("2^20 deposits of 2^20: mean {mean} (exactly {LARGEST}), {} unfiltered", report.unfiltered);
    assert_eq!(mean, LARGEST);
    assert_eq!(report.unfiltered, 0);
}

#[test]
fn sums_do_not_stagnate() {
    // A sum in single precision stops growing at 2²⁴ equal deposits.
    let blocks = if thorough() { 1 << 10 } else { 1 << 5 };
    let vertex = Vertex::new(Vec3::splat(0.3), Vec3::Z, 1.0, 1, 0);
    let value = 0.1f32;
    let block: Vec<PathRecord> = (0..1 << 16).map(|i| diffuse(i % 1024, i / 1024, vertex, value)).collect();
    let mut filter = Adaptive::new(&Params::default(), &ANCHOR, 1);
    for _ in 0..blocks {
        filter.add(std::slice::from_ref(&block));
    }
    let per_slot = f64::from(blocks * 64);
    let value = f64::from(PackedRgb::new(Vec3::splat(value)).get().y);
    let worst = filter.resolve()[0]
        .iter()
        .map(|(_, resolved)| (f64::from(resolved.diffuse.y) / per_slot / value - 1.0).abs())
        .fold(0.0, f64::max);
    println!("{} equal deposits: worst relative error {worst:.2e} (bound 2^-23)", blocks << 16);
    // The cell's mean and the slot's sum are each rounded to 24 bits once, and the deposit to 2⁻³⁰.
    assert!(worst <= 2f64.powi(-23));
}

/// Many kinds of paths: two lobes, second vertices, either sign, a few surfaces, several sizes of cells.
fn motley(count: u32, slots: u32, throughput: f32, seed: u64) -> Vec<PathRecord> {
    let random = &mut Random::new(seed);
    (0..count)
        .map(|i| {
            let vertex = |random: &mut Random| {
                let p = 16.0 * Vec3::new(random.unit(), random.unit(), 0.0);
                let n = if random.below(4) == 0 { Vec3::X } else { Vec3::Z };
                let footprint = (random.unit() * 4.0 - 2.0).exp2();
                Vertex::new(p, n, footprint, random.below(3) as u32, random.below(16) as u8)
            };
            let rgb = |random: &mut Random, scale: f32| {
                PackedRgb::new(scale * Vec3::new(random.noise(), random.noise(), random.noise()))
            };
            let sign = if random.below(8) == 0 { -throughput } else { throughput };
            let lobe = |random: &mut Random| Lobe {
                throughput: rgb(random, sign),
                rest: rgb(random, 1.0),
                transfer: rgb(random, 0.5),
            };
            let mut record = PathRecord {
                slot: random.below(u64::from(slots)) as u32,
                first: vertex(random),
                diffuse: lobe(random),
                ..PathRecord::default()
            };
            if random.below(3) == 0 {
                record.glossy = lobe(random);
            }
            if random.below(3) > 0 {
                record.second = vertex(random);
                record.suffix = rgb(random, 2.0);
            }
            record.set_sample(i as u8);
            record
        })
        .collect()
}

/// All values by slot, with every bit.
fn all_bits(parts: Vec<Vec<(u32, Resolved)>>) -> Vec<(u32, [u32; 12])> {
    let mut values: Vec<(u32, [u32; 12])> = parts
        .into_iter()
        .flatten()
        .map(|(slot, Resolved { diffuse, glossy, glossy_own: [even, odd], .. })| {
            let numbers = [diffuse, glossy, even, odd];
            (slot, std::array::from_fn(|i| numbers[i / 3][i % 3].to_bits()))
        })
        .collect();
    values.sort_unstable();
    values
}

#[test]
fn neither_order_nor_partition_nor_threads_change_a_bit() {
    const SLOTS: u32 = 97;
    let runs = if thorough() { 200 } else { 24 };
    // Throughputs of 300 make sums of throughput overflow their 2¹¹ within a slot.
    for throughput in [1.0, 300.0] {
        let blocks: Vec<Vec<PathRecord>> = (0..3).map(|block| motley(4000, SLOTS, throughput, block)).collect();
        let mut expected = None;
        for run in 0..runs {
            let random = &mut Random::new(1000 + run);
            let parts = [1, 2, 3, 7, 16][run as usize % 5];
            let threads = [1, 2, 3, 5, 7, 16][run as usize % 6];
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let mut order: Vec<usize> = (0..blocks.len()).collect();
            random.shuffle(&mut order);
            let bits = pool.install(|| {
                let mut filter = Adaptive::new(&Params::default(), &ANCHOR, parts);
                for at in order {
                    let mut block = blocks[at].clone();
                    random.shuffle(&mut block);
                    let mut by_part = vec![Vec::new(); parts];
                    block.iter().for_each(|path| by_part[path.slot as usize % parts].push(*path));
                    filter.begin_epoch();
                    filter.add(&by_part);
                }
                let report = filter.report();
                (all_bits(filter.resolve()), report.cells, report.unfiltered)
            });
            let expected = expected.get_or_insert_with(|| bits.clone());
            let differ = expected.0.iter().zip(&bits.0).filter(|(a, b)| a != b).count();
            assert_eq!(differ, 0, "run {run} of throughput {throughput}: {differ} slots differ");
            assert!((expected.1, expected.2) == (bits.1, bits.2), "run {run}: other cells");
        }
        println!("throughput {throughput}: {runs} orders of blocks and paths, partitions and thread counts: same bits");
    }
}

#[test]
fn epochs_add_to_the_same_bits_in_any_order() {
    let blocks: Vec<Vec<PathRecord>> = (0..5).map(|block| motley(2000, 64, 1.0, 50 + block)).collect();
    let total = |order: &[usize]| {
        let mut filter = Adaptive::new(&Params::default(), &ANCHOR, 1);
        for &at in order {
            filter.begin_epoch();
            filter.add(std::slice::from_ref(&blocks[at]));
        }
        all_bits(filter.resolve())
    };
    let expected = total(&[0, 1, 2, 3, 4]);
    for order in [[4, 3, 2, 1, 0], [2, 0, 4, 1, 3], [1, 2, 3, 4, 0]] {
        assert!(total(&order) == expected, "order {order:?} differs");
    }
    // Looking in between changes nothing.
    let mut filter = Adaptive::new(&Params::default(), &ANCHOR, 1);
    for block in &blocks {
        filter.begin_epoch();
        filter.add(std::slice::from_ref(block));
        filter.resolve();
    }
    assert!(all_bits(filter.resolve()) == expected, "resolving in between changes the end");
    println!("5 epochs in 4 orders, and resolved in between: same bits");
}

#[test]
fn parts_of_a_frame_add_to_the_same_bits_in_any_order() {
    // As machines of a farm would: each filters some of the epochs, and their sums are stored, read and added.
    let blocks: Vec<Vec<PathRecord>> = (0..6).map(|block| motley(2000, 64, 1.0, 80 + block)).collect();
    let filter = |epochs: &[usize]| {
        let mut filter = Adaptive::new(&Params::default(), &ANCHOR, 1);
        for &at in epochs {
            filter.begin_epoch();
            filter.add(std::slice::from_ref(&blocks[at]));
        }
        filter
    };
    let (slots, params) = (0..u32::MAX, Params::default());
    let stored = |filter: &mut Adaptive| {
        filter.settle();
        let mut words = vec![Vec::new(); params.stored_trees() + 1];
        let (own, trees) = words.split_last_mut().expect("the slots' words");
        filter.store_trees(0, &slots, trees);
        filter.store_slots(0, &slots, own);
        words
    };
    let load = |filter: &mut Adaptive, words: &[Vec<u64>]| {
        let (own, trees) = words.split_last().expect("the slots' words");
        for (tree, words) in trees.iter().enumerate() {
            filter.add_tree(tree, 0, &Branch::read(&params, tree, &slots, words).expect("the same frame"));
        }
        filter.add_slots(0, &Slots::read(&slots, own).expect("the same frame"));
    };
    let mut whole = filter(&[0, 1, 2, 3, 4, 5]);
    let (expected, words) = (all_bits(whole.resolve()), stored(&mut whole));
    for shares in
        [vec![vec![0, 1, 2, 3, 4, 5]], vec![vec![3, 4, 5], vec![0, 1, 2]], vec![vec![5, 0], vec![2], vec![4, 1, 3]]]
    {
        let mut sum = Adaptive::new(&Params::default(), &ANCHOR, 1);
        for share in &shares {
            load(&mut sum, &stored(&mut filter(share)));
        }
        assert!(stored(&mut sum) == words, "{shares:?}: other sums are stored");
        assert!(all_bits(sum.resolve()) == expected, "{shares:?} differs");
    }
    println!("6 epochs over 1, 2 and 3 filters, stored ({} words), read and added: same bits", words.concat().len());
}

#[test]
fn bad_radiance_changes_no_cell_and_stays_with_its_path() {
    let good = Sheet::level([16, 16], 0.0, 1, 0).paths(4, 1, |_, random| random.noise());
    let vertex = good[500].first;
    let (clean, _) = resolve(&Params::default(), &ANCHOR, &[&good], 257);
    let place = |p: Vec3, footprint: f32| diffuse(256, 0, Vertex::new(p, Vec3::Z, footprint, 1, 0), 1.0);
    let mut cases: Vec<(String, PathRecord, f32)> =
        [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 1e30, 1e-40, f32::MAX]
            .into_iter()
            .map(|bad| (format!("radiance {bad:e}"), diffuse(256, 0, vertex, bad), bad))
            .collect();
    for (name, p, footprint) in [
        ("place NaN", Vec3::NAN, 1.0),
        ("place infinite", Vec3::INFINITY, 1.0),
        ("place far beyond the scene", Vec3::splat(1e20), 1.0),
        ("footprint 0", Vec3::ZERO, 0.0),
        ("footprint negative", Vec3::ZERO, -1.0),
        ("footprint NaN", Vec3::ZERO, f32::NAN),
        ("footprint infinite", Vec3::ZERO, f32::INFINITY),
    ] {
        cases.push((name.into(), place(p, footprint), 1.0));
    }
    for bad in [f32::NAN, 1e30, 1e6] {
        let mut record = diffuse(256, 0, vertex, 1.0);
        record.diffuse.throughput = PackedRgb::new(Vec3::splat(bad));
        cases.push((format!("throughput {bad:e}"), record, bad));
    }
    for (name, record, own) in cases {
        let paths: Vec<PathRecord> = good.iter().copied().chain([record]).collect();
        let (values, report) = resolve(&Params::default(), &ANCHOR, &[&paths], 257);
        let changed = values[..256].iter().zip(&clean).filter(|(a, b)| a != b).count();
        let kept = values[256].diffuse.y;
        println!("{name}: {changed} other slots changed, {} counted, its slot has {kept:e}", report.unfiltered);
        let cells_may_change = name.starts_with("throughput");
        assert!(changed == 0 || cells_may_change, "{name} got into a cell");
        assert_eq!(report.unfiltered, 1, "{name} is not counted");
        assert!(kept.is_finite(), "{name} made the slot {kept}");
        // A slot holds up to 2³⁹ units of what no cell took, in steps of 2⁻²⁴; what is no number is black.
        let limit = 2f32.powi(39);
        let own = if own.is_finite() { own.clamp(-limit, limit) } else { kept };
        assert!((kept - own).abs() <= 2f32.powi(-24) + 1e-5 * own.abs(), "{name}: {kept} instead of {own}");
    }
}

#[test]
fn bad_suffixes_change_no_cell() {
    let chained = |i: u32, suffix: f32, random: &mut Random| {
        let p = 8.0 * Vec3::new(random.unit(), random.unit(), 0.0);
        let mut record = diffuse(i % 64, i / 64, Vertex::new(p, Vec3::Z, 1.0, 1, 0), 0.5);
        record.diffuse.transfer = PackedRgb::new(Vec3::ONE);
        record.second = Vertex::new(p + 4.0 * Vec3::Z, -Vec3::Z, 2.0, 2, 0);
        record.suffix = PackedRgb::new(Vec3::splat(suffix));
        record.set_sample((i / 64) as u8);
        record
    };
    let random = &mut Random::new(3);
    let good: Vec<PathRecord> = (0..2048)
        .map(|i| {
            let suffix = random.noise();
            chained(i, suffix, random)
        })
        .collect();
    let (clean, _) = resolve(&Params::default(), &ANCHOR, &[&good], 65);
    for bad in [f32::NAN, f32::INFINITY, -1.0, 1e30, 1e-40] {
        let mut record = chained(0, bad, random);
        record.slot = 64;
        let paths: Vec<PathRecord> = good.iter().copied().chain([record]).collect();
        let (values, report) = resolve(&Params::default(), &ANCHOR, &[&paths], 65);
        // What is sound in the path may go on to the first vertex's cells: a little above or below the clean values.
        let worst =
            (values[..64].iter().zip(&clean)).map(|(a, b)| (a.diffuse.y / b.diffuse.y - 1.0).abs()).fold(0.0, f32::max);
        let count = report.unfiltered;
        println!(
            "suffix {bad:e}: others move by {worst:.1e}, {count} counted, its slot has {:e}",
            values[64].diffuse.y
        );
        assert!(values.iter().all(|value| value.diffuse.is_finite()));
        // 2048 paths share; the sound part of this one is 0.5 of their mean of 1.5.
        assert!(worst < 1e-3, "suffix {bad} spread");
        assert!(count == 1 || bad.is_subnormal(), "suffix {bad} is not counted");
    }
}

#[test]
fn a_scene_far_from_the_origin_has_the_same_cells() {
    // Places on a lattice of whole numbers: exact after translation by up to 10⁷ < 2²⁴, so nothing may change.
    let at = |offset: f32| {
        let random = &mut Random::new(11);
        let paths: Vec<PathRecord> = (0..20_000)
            .map(|i| {
                let p = Vec3::new(random.below(256) as f32, random.below(256) as f32, random.below(4) as f32);
                let vertex = Vertex::new(p + Vec3::splat(offset), Vec3::Z, 8.0, 1, 0);
                diffuse(i % 256, i / 256, vertex, (1.0 + p.x / 64.0) * random.noise())
            })
            .collect();
        let anchor = Anchor { origin: DVec3::splat(f64::from(offset)), extent: 1024.0 };
        let (values, report) = resolve(&Params::default(), &anchor, &[&paths], 256);
        (values, report.cells)
    };
    let (near, cells) = at(0.0);
    for k in 0..=7 {
        let (far, far_cells) = at(10f32.powi(k));
        let changed = near.iter().zip(&far).filter(|(a, b)| a != b).count();
        println!("translated by 10^{k}: {far_cells} cells of {cells}, {changed} of 256 slots differ (bound 0)");
        assert_eq!((far_cells, changed), (cells, 0));
    }
}

#[test]
fn degenerate_frames_are_finite() {
    // An extent of nothing or of everything, footprints from the smallest to the largest, a single path.
    for extent in [0.0, f64::MIN_POSITIVE, 1e-30, 1.0, 1e30, f64::INFINITY, f64::NAN] {
        let anchor = Anchor { origin: DVec3::ZERO, extent };
        for footprint in [f32::MIN_POSITIVE, 1e-45, 1e-20, 1.0, 1e20, f32::MAX] {
            let path = diffuse(0, 0, Vertex::new(Vec3::new(0.1, 0.2, 0.3), Vec3::Z, footprint, 1, 0), 0.75);
            let (values, _) = resolve(&Params::default(), &anchor, &[&[path]], 1);
            assert_eq!(values[0].diffuse.y, 0.75, "extent {extent}, footprint {footprint}");
        }
    }
    let (values, report) = resolve(&Params::default(), &ANCHOR, &[], 1);
    assert_eq!((values[0], report.paths, report.cells), (Resolved::default(), 0, 0));
    let (values, _) = resolve(&Params::default(), &ANCHOR, &[&[PathRecord::default()]], 1);
    assert_eq!(values[0], Resolved::default());
    // At the camera, where a footprint is nothing: no cell, and no loss.
    let path = diffuse(0, 0, Vertex::new(Vec3::ZERO, Vec3::Z, 0.0, 1, 0), 0.5);
    let (values, report) = resolve(&Params::default(), &ANCHOR, &[&[path]], 1);
    assert_eq!((values[0].diffuse.y, report.unfiltered), (0.5, 1));
    println!("extents 0 to infinity, footprints 1e-45 to 3e38, one path, none: all kept");
}
