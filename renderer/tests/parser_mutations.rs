//! No input makes the readers panic: fixed files are mutated by a fixed sequence, and what once was trouble stays fixed.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use renderer::scene::{pbrt, ply};

/// SplitMix64 (Steele, Lea, Flood: Fast splittable pseudorandom number generators, 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }
}

/// Fragments that mean something somewhere.
const FRAGMENTS: [&[u8]; 24] = [
    b"\"",
    b"[",
    b"]",
    b"#",
    b"\\",
    b"\n",
    b" ",
    b"-1",
    b"4294967296",
    b"1e38",
    b"-1e-40",
    b"nan",
    b"0",
    b"\x00",
    b"\xff\xfe",
    b"Shape \"curve\" ",
    b"ObjectBegin \"a\" ",
    b"ObjectInstance \"a\" ",
    b"AttributeEnd ",
    b"\"float alpha\" ",
    b"\"spectrum L\" ",
    b"Attribute \"shape\" ",
    b"property list uchar int vertex_indices\n",
    b"element face 9999999999\n",
];

fn mutate(random: &mut Random, seed: &[u8], other: &[u8]) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..=random.below(6) {
        let at = random.below(bytes.len() + 1);
        let end = (at + random.below(20)).min(bytes.len());
        match random.below(7) {
            0 => bytes.truncate(at),
            1 => drop(bytes.drain(at..end)),
            2 => drop(bytes.splice(at..end, FRAGMENTS[random.below(FRAGMENTS.len())].iter().copied())),
            3 => bytes[at..end].iter_mut().for_each(|b| *b = b.wrapping_add(1)),
            4 => {
                let piece = bytes[at..end].to_vec();
                let to = random.below(bytes.len() + 1);
                bytes.splice(to..to, piece);
            }
            5 => {
                let from = random.below(other.len());
                let piece = &other[from..(from + random.below(200)).min(other.len())];
                bytes.splice(at..at, piece.iter().copied());
            }
            _ => {
                if let Some(b) = bytes.get_mut(at) {
                    *b = random.next() as u8;
                }
            }
        }
    }
    bytes
}

fn files(folder: &str, extension: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let mut paths: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.is_file() && (extension.is_empty() || path.extension().is_some_and(|e| e == extension)));
    paths.sort();
    paths.into_iter().map(|path| (path.clone(), fs::read(path).unwrap())).collect()
}

fn read_scene(bytes: &[u8]) {
    // Where there are no files to include: the text alone is tried.
    let read = pbrt::parse(bytes, Path::new("/nonexistent"), "scene.pbrt");
    let messages = match &read {
        Ok((_, warnings)) => warnings,
        Err(all) => {
            assert!(!all.is_empty(), "refused without a reason");
            all
        }
    };
    for message in messages {
        assert!(message.to_string().len() < 10_000, "an endless message");
    }
}

fn read_ply(bytes: &[u8]) {
    if let Ok(mesh) = ply::parse(bytes) {
        let count = mesh.triangles.positions.len() as u32;
        assert!(mesh.triangles.indices.iter().flatten().all(|&index| index < count));
        assert!(mesh.quads.iter().flatten().all(|&index| index < count));
    }
}

/// Binary meshes are too short to keep as files: made here.
fn binary_ply(format: &str) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {format} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         property list uchar ushort odd\nelement face 2\nproperty list uint8 int vertex_indices\nend_header\n"
    )
    .into_bytes();
    for vertex in 0..4_u8 {
        bytes.extend([vertex; 12]);
        bytes.extend([1, 0, vertex]);
    }
    let [a, b, c, d] = [0, 1, 2, 3_u32].map(if format.contains("big") { u32::to_be_bytes } else { u32::to_le_bytes });
    bytes.extend([&[3][..], &a, &b, &c, &[4], &a, &b, &c, &d].concat());
    bytes
}

/// Runs `rounds` mutations of each seed, or as many as fit in the time that slow machines may take.
fn run(seeds: &[Vec<u8>], rounds: usize, read: impl Fn(&[u8])) {
    // Another seed tries other mutations; without one, every run is the same.
    let seed = std::env::var("TESSERA_SEED").ok().and_then(|seed| seed.parse().ok());
    let mut random = Random(seed.unwrap_or(2018));
    let start = Instant::now();
    for _ in 0..rounds {
        for seed in seeds {
            let other = &seeds[random.below(seeds.len())];
            read(&mutate(&mut random, seed, other));
            if start.elapsed() > Duration::from_secs(20) {
                return;
            }
        }
    }
}

#[test]
fn mutated_scenes_do_not_panic() {
    let seeds: Vec<_> = files("tests/parser_corpus", "pbrt").into_iter().map(|(_, bytes)| bytes).collect();
    run(&seeds, 400, read_scene);
}

#[test]
fn mutated_meshes_do_not_panic() {
    let mut seeds: Vec<_> = files("tests/parser_corpus/parts", "ply").into_iter().map(|(_, bytes)| bytes).collect();
    seeds.extend(["binary_little_endian", "binary_big_endian"].map(binary_ply));
    for seed in &seeds {
        assert!(ply::parse(seed).is_ok());
    }
    run(&seeds, 20_000, read_ply);
}

#[test]
#[allow(clippy::print_stderr)]
fn what_once_was_trouble_stays_fixed() {
    for (path, bytes) in files("../tests/fuzz/regressions/scene", "") {
        eprintln!("{}", path.display());
        read_scene(&bytes);
    }
    for (path, bytes) in files("../tests/fuzz/regressions/ply", "") {
        eprintln!("{}", path.display());
        read_ply(&bytes);
    }
}
