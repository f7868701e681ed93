use super::header::{Property, Scalar};
use super::*;

/// A pyramid: a quad and two triangles, with normals, uv and a property nobody knows, as ascii.
const ASCII: &str = "ply\r\nformat ascii 1.0\ncomment by hand \nelement vertex 5\nproperty float x\nproperty double y\n\
    property float z\nproperty uchar red\nproperty float nx\nproperty float ny\nproperty float nz\n\
    property float s\nproperty float t\nelement edge 1\nproperty int a\nproperty list uchar short b\n\
    element face 3\nproperty list uchar int vertex_indices\nproperty int face_indices\nend_header\n\
    0 0 0 255 0 0 1 0 0\n1 0 0 255 0 0 1 1 0\n1 1 0 255 0 0 1 1 1\n0 1 0 255 0 0 1 0 1\n.5 .5 1 0 0 0 1 .5 .5\n\
    7 2 1 2\n4 0 1 2 3 10\n3 0 1 4 11\n3 1 2 4 12\n";

fn pyramid_is(mesh: &PlyMesh) {
    assert_eq!(mesh.triangles.indices, [[0, 1, 4], [1, 2, 4]]);
    assert_eq!(mesh.quads, [[0, 1, 3, 2]]);
    assert_eq!(mesh.triangles.positions[4], Vec3::new(0.5, 0.5, 1.0));
    assert_eq!(mesh.triangles.normals, [Vec3::Z; 5]);
    assert_eq!(mesh.triangles.uvs[2], Vec2::ONE);
    assert_eq!((mesh.polygons, mesh.degenerate), (0, 0));
}

/// The pyramid as bytes of the given order.
fn binary(big_endian: bool) -> Vec<u8> {
    let header_end = ASCII.find("end_header\n").unwrap() + "end_header\n".len();
    let name = if big_endian { "binary_big_endian" } else { "binary_little_endian" };
    let mut out = ASCII[..header_end].replace("ascii", name).into_bytes();
    let mut words = ASCII[header_end..].split_ascii_whitespace().map(|word| word.parse::<f64>().unwrap());
    let mut put = |kind: Scalar, value: f64| {
        let mut bytes = match kind {
            Scalar::U8 => vec![value as u8],
            Scalar::I16 => (value as i16).to_le_bytes().to_vec(),
            Scalar::I32 => (value as i32).to_le_bytes().to_vec(),
            Scalar::F32 => (value as f32).to_le_bytes().to_vec(),
            Scalar::F64 => value.to_le_bytes().to_vec(),
            _ => unreachable!("not in this file"),
        };
        if big_endian {
            bytes.reverse();
        }
        out.extend(bytes);
    };
    for element in Header::parse(ASCII.as_bytes()).unwrap().elements {
        for _ in 0..element.count {
            for property in &element.properties {
                match *property {
                    Property::Scalar { kind, .. } => put(kind, words.next().unwrap()),
                    Property::List { length, kind, .. } => {
                        let count = words.next().unwrap();
                        put(length, count);
                        (0..count as usize).for_each(|_| put(kind, words.next().unwrap()));
                    }
                }
            }
        }
    }
    out
}

#[test]
fn all_encodings_give_the_same_mesh() {
    pyramid_is(&parse(ASCII.as_bytes()).unwrap());
    pyramid_is(&parse(&binary(false)).unwrap());
    pyramid_is(&parse(&binary(true)).unwrap());
}

#[test]
fn a_gzipped_file_is_unpacked_whatever_its_name() {
    use std::io::Write;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.ply");
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    packer.write_all(&binary(false)).unwrap();
    let packed = packer.finish().unwrap();
    std::fs::write(&path, &packed).unwrap();
    pyramid_is(&read(&path).unwrap());

    std::fs::write(&path, &packed[..packed.len() / 2]).unwrap();
    assert!(matches!(read(&path), Err(PlyError::Io(_))));
    assert!(matches!(read(&folder.path().join("absent.ply")), Err(PlyError::Io(_))));
    assert!(matches!(read(folder.path()), Err(PlyError::Io(_))));
}

#[test]
fn every_truncation_is_an_error_with_its_place() {
    for whole in [ASCII.as_bytes().to_vec(), binary(false), binary(true)] {
        // Without its line end the last number of an ascii file is still whole, with one digit less it is another.
        for length in 0..whole.len() - 4 {
            assert!(parse(&whole[..length]).is_err(), "{length} bytes");
        }
    }
    let short = binary(false);
    let message = parse(&short[..short.len() - 20]).unwrap_err().to_string();
    assert!(message.contains("face 1 of 3"), "{message}");
}

#[test]
fn bad_words_and_indices_are_told_with_their_place() {
    let message = |text: &str| parse(text.as_bytes()).unwrap_err().to_string();
    assert_eq!(message(&ASCII.replace("1 1 0 255", "1 x 0 255")), "line 23: expected a number, found x");
    assert_eq!(message(&ASCII.replace("3 1 2 4", "3 1 2 5")), "triangle 1 names vertex 5, but there are 5, from 0");
    assert_eq!(message(&ASCII.replace("4 0 1 2 3", "4 0 -1 2 3")), "quad 0 names vertex -1, but there are 5, from 0");
    assert_eq!(message(&ASCII.replace("3 1 2 4", "3 1 2 1e30")), "triangle 1 names vertex -1, but there are 5, from 0");
    assert!(message(&ASCII.replace("4 0 1 2 3", "-4 0 1 2 3")).contains("a list of -4 values in face 0"));
    assert_eq!(message("ply\nformat ascii 2.0\n"), "line 2 of the header: expected \"format ENCODING 1.0\"");
    assert_eq!(message("PLY\n"), "line 1 of the header: a PLY file starts with the line \"ply\"");
    assert_eq!(message(&ASCII.replace("float z", "float w")), "the vertices have no x, y and z");
    assert_eq!(message(&ASCII.replace("face 3", "face 0")), "the file has no faces: points alone cannot be drawn");
    assert!(message(&ASCII.replace("double y", "complex y")).contains("line 6"));
}

#[test]
fn polygons_are_cut_and_lines_left_out() {
    let text = "ply\nformat ascii 1.0\nelement face 3\nproperty list int uint vertex_index\nelement vertex 5\n\
        property int x\nproperty int y\nproperty int z\nend_header\n5 0 1 2 3 4\n2 0 1\n0\n\
        0 0 0 1 0 0 2 1 0 1 2 0 0 1 0";
    let mesh = parse(text.as_bytes()).unwrap();
    assert_eq!(mesh.triangles.indices, [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
    assert_eq!((mesh.polygons, mesh.degenerate), (1, 2));
}

#[test]
fn counts_that_no_file_can_hold_do_not_allocate() {
    for format in ["ascii", "binary_little_endian"] {
        let text = format!(
            "ply\nformat {format} 1.0\nelement nothing 18446744073709551615\nelement vertex 4294967295\n\
             property float x\nproperty float y\nproperty float z\nelement face 18446744073709551615\n\
             property list int int vertex_indices\nend_header\n0 0 0 1 0 0"
        );
        assert!(matches!(parse(text.as_bytes()), Err(PlyError::Truncated { .. })));
    }
}
