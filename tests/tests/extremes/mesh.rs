//! Meshes with numbers that are none, with indices beyond their vertices, with nothing, and with very much.

use std::fmt::Write;

use renderer::filtering::Filtering;
use tests::small::{SceneFile, values};

use super::support::{attempt, check_all, diffuse, job, picture, pinhole, refused, refused_file, scene, sky, sound};

fn mesh(p: &str, indices: &str) -> String {
    let world = sky(1.0)
        + &diffuse(0.5)
        + &format!("Shape \"trianglemesh\" \"point3 P\" [ {p} ] \"integer indices\" [ {indices} ]\n");
    scene([8, 8], 4, &pinhole(60.0), &world)
}

#[test]
fn vertices_that_are_no_numbers_are_refused() {
    for bad in ["nan", "inf", "-inf", "1e39"] {
        refused(&format!("vertex {bad}"), &mesh(&format!("0 0 1  1 {bad} 1  0 1 1"), "0 1 2"), &["scene.pbrt:9:"]);
    }
}

#[test]
fn indices_beyond_the_vertices_are_refused() {
    for bad in ["3", "-1", "2147483647"] {
        refused(
            &format!("index {bad}"),
            &mesh("0 0 1  1 0 1  0 1 1", &format!("0 1 {bad}")),
            &["scene.pbrt:9:", "there are 3"],
        );
    }
    refused("two indices", &mesh("0 0 1  1 0 1  0 1 1", "0 1"), &["scene.pbrt:9:", "multiple of 3"]);
}

#[test]
fn meshes_of_nothing_are_refused_or_nothing() {
    refused("no vertex", &mesh("", ""), &["scene.pbrt:9:"]);
    refused("vertices without faces", &mesh("0 0 1  1 0 1  0 1 1  1 1 1", ""), &["scene.pbrt:9:"]);
}

#[test]
fn the_largest_coordinates_are_refused_or_finite() {
    // Half of the largest f32: edges overflow.
    for far in ["1e15", "1e18", "1e19", "1e30", "1.7e38", "3.4e38"] {
        let file = SceneFile::new(&mesh(&format!("-{far} -{far} {far}  {far} -{far} {far}  0 {far} {far}"), "0 1 2"));
        match attempt(&file.path(), job(4, Filtering::None)) {
            Ok((frame, warnings)) => {
                sound(&frame);
                let mean = values(&frame).mean()[1];
                println!("coordinates of {far}: mean {mean:.5}, {warnings:?}");
                // The triangle is there, or its absence is said.
                assert!(mean < 0.9 || !warnings.is_empty(), "the triangle is gone in silence");
            }
            Err(messages) => {
                println!("coordinates of {far}: {}", messages.lines().nth(1).unwrap_or(""));
                assert!(messages.contains("scene.pbrt:9:"));
            }
        }
    }
}

#[test]
fn the_smallest_coordinates_are_refused_or_finite() {
    for near in ["1e-10", "1e-15", "1e-19", "1e-22", "1e-30", "1e-38", "1e-44"] {
        let file =
            SceneFile::new(&mesh(&format!("-{near} -{near} {near}  {near} -{near} {near}  0 {near} {near}"), "0 1 2"));
        match attempt(&file.path(), job(4, Filtering::None)) {
            Ok((frame, warnings)) => {
                sound(&frame);
                let mean = values(&frame).mean()[1];
                println!("coordinates of {near}: mean {mean:.5}, {} warnings", warnings.len());
                assert!(mean < 0.9 || !warnings.is_empty(), "the triangle is gone in silence");
            }
            Err(messages) => {
                println!("coordinates of {near}: {}", messages.lines().nth(1).unwrap_or(""));
                assert!(messages.contains("scene.pbrt:9:"));
            }
        }
    }
}

/// A scene with a PLY file beside it.
fn with_ply(bytes: &[u8]) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("mesh.ply"), bytes).unwrap();
    let world = sky(1.0) + &diffuse(0.5) + "Shape \"plymesh\" \"string filename\" \"mesh.ply\"\n";
    let path = folder.path().join("scene.pbrt");
    std::fs::write(&path, scene([8, 8], 4, &pinhole(60.0), &world)).unwrap();
    (folder, path)
}

fn header(vertices: usize, faces: usize) -> String {
    format!(
        "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
    )
}

#[test]
fn ply_faces_of_any_number_of_corners() {
    // 2 corners, 1 and 0 make no face; 5 are a fan. The square around it fills the view.
    let text = header(6, 4) + "-9 -9 1\n9 -9 1\n9 9 1\n0 9.5 1\n-9 9 1\n0 0 1\n2 0 1\n1 0\n0\n5 0 1 2 3 4\n";
    let (_folder, path) = with_ply(text.as_bytes());
    let (frame, warnings) = attempt(&path, job(4, Filtering::None)).unwrap();
    sound(&frame);
    println!("{warnings:?}");
    assert!(!warnings.is_empty());
    check_all("faces of 2, 1, 0 and 5 corners", &values(&frame), 0.5, 1e-6);
}

#[test]
fn ply_files_that_are_cut_or_wrong_are_refused() {
    let sound = header(3, 1) + "0 0 1\n1 0 1\n0 1 1\n3 0 1 2\n";
    for (case, text) in [
        ("empty", String::new()),
        ("header only", header(3, 1)),
        ("cut in a vertex", sound[..sound.len() - 20].to_owned()),
        ("NaN", sound.replace("1 0 1", "1 nan 1")),
        ("index beyond", sound.replace("3 0 1 2", "3 0 1 7")),
        ("negative index", sound.replace("3 0 1 2", "3 0 1 -2")),
        ("not PLY", "solid cube\n".to_owned()),
        ("more vertices than memory", header(1 << 60, 1)),
        ("more faces than the file", header(3, 1 << 60) + "0 0 1\n1 0 1\n0 1 1\n3 0 1 2\n"),
    ] {
        let (_folder, path) = with_ply(text.as_bytes());
        refused_file(case, &path, job(1, Filtering::None), &["mesh.ply", "scene.pbrt:9:"]);
    }
}

#[test]
fn a_ply_of_nothing_is_nothing() {
    let (_folder, path) = with_ply(header(0, 0).as_bytes());
    match attempt(&path, job(4, Filtering::None)) {
        Ok((frame, _)) => check_all("no vertex, no face", &values(&frame), 1.0, 0.0),
        Err(messages) => {
            println!("no vertex, no face: {messages}");
            assert!(messages.contains("mesh.ply") && messages.contains("scene.pbrt:9:"));
        }
    }
}

#[test]
fn a_binary_mesh_of_many_triangles() {
    // A plane of n² quads, with as much as the test's time allows; `ci/test-extremes` asks for more.
    let n = super::support::size("TESSERA_MESH_SIDE", 300);
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        (n + 1) * (n + 1),
        2 * n * n
    )
    .into_bytes();
    let at = |i: u32| -1.0 + 2.0 * i as f32 / n as f32;
    for y in 0..=n {
        for x in 0..=n {
            [at(x), at(y), 1.0].iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        }
    }
    for y in 0..n {
        for x in 0..n {
            let i = y * (n + 1) + x;
            for corners in [[i, i + 1, i + n + 2], [i, i + n + 2, i + n + 1]] {
                bytes.push(3);
                corners.iter().for_each(|corner| bytes.extend(corner.to_le_bytes()));
            }
        }
    }
    let (_folder, path) = with_ply(&bytes);
    drop(bytes);
    let (frame, _) = attempt(&path, job(4, Filtering::None)).unwrap();
    sound(&frame);
    let statistics = &frame.statistics;
    println!(
        "{} triangles: read in {:.1} s, built in {:.1} s, {} MB in Embree",
        statistics.unique_primitives,
        statistics.parse_seconds,
        statistics.compile_seconds,
        statistics.embree_bytes >> 20
    );
    assert_eq!(statistics.unique_primitives, u64::from(2 * n * n));
    check_all("plane of many triangles", &values(&frame), 0.5, 1e-6);
}

#[test]
fn normals_and_texture_coordinates_that_are_no_use() {
    let mut extra = String::new();
    for (name, values) in [
        ("zero normals", "0 0 0  0 0 0  0 0 0"),
        ("huge normals", "0 0 -1e38  0 0 -1e38  0 0 -1e38"),
        ("tiny normals", "0 0 -1e-40  0 0 -1e-40  0 0 -1e-40"),
    ] {
        extra.clear();
        write!(extra, "\"normal N\" [ {values} ]").unwrap();
        let text = mesh("-90 -90 1  0 90 1  90 -90 1", "0 1 2").replace("\"integer", &format!("{extra} \"integer"));
        check_all(name, &picture(&text, 4, Filtering::None), 0.5, 1e-5);
    }
}
