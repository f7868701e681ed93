//! Reads meshes from PLY files: ascii, binary of both byte orders, and gzip'd.
//!
//! Elements and properties may come in any order and of any type; those that are no part of a mesh are stepped over.

mod body;
mod header;

use std::path::Path;

use glam::{Vec2, Vec3};

use self::body::{Ascii, Binary, Rows};
use self::header::{Element, Encoding, Header};
use super::description::TriangleMesh;
use super::pbrt::source::read_file;

/// Why a PLY file cannot be read. The messages do not name the file.
#[derive(Debug, thiserror::Error)]
pub enum PlyError {
    /// The file cannot be opened or unpacked.
    #[error("cannot read it: {0}")]
    Io(String),
    /// The header does not follow the format.
    #[error("line {line} of the header: {message}")]
    Header {
        /// Line, from 1.
        line: usize,
        /// What is wrong.
        message: String,
    },
    /// The header is fine but describes no mesh.
    #[error("{0}")]
    NoMesh(&'static str),
    /// The data ends before what the header promises.
    #[error("the data ends at byte {offset}, within {element} {row} of {count}: is the file truncated?")]
    Truncated {
        /// Where the data ends.
        offset: usize,
        /// Name of the element.
        element: String,
        /// Row that is incomplete, from 0.
        row: usize,
        /// Rows that the header promises.
        count: usize,
    },
    /// A word of an ascii file is not a number.
    #[error("line {line}: expected a number, found {word}")]
    NotANumber {
        /// Line, from 1.
        line: usize,
        /// What stands there.
        word: String,
    },
    /// A list has a length that is no number of vertices.
    #[error("byte {offset}: a list of {length} values in {element} {row}")]
    ListLength {
        /// Where the list starts.
        offset: usize,
        /// Its length.
        length: f64,
        /// Name of the element.
        element: String,
        /// Row, from 0.
        row: usize,
    },
    /// A face names a vertex that is not there.
    #[error("{face} {number} names vertex {index}, but there are {count}, from 0")]
    Index {
        /// `triangle` or `quad`.
        face: &'static str,
        /// Which, from 0, of its kind.
        number: usize,
        /// The index.
        index: i64,
        /// How many vertices there are.
        count: usize,
    },
}

/// A mesh of triangles and quads over the same vertices. All indices are valid.
#[derive(Clone, Debug, Default)]
pub struct PlyMesh {
    /// The vertices, and those faces that are triangles. Faces of more than four corners are here too, cut into fans.
    pub triangles: TriangleMesh,
    /// The faces of four corners as bilinear patches: p00 p10 p01 p11.
    pub quads: Vec<[u32; 4]>,
    /// How many faces of more than four corners were cut, which is right for convex ones only.
    pub polygons: usize,
    /// How many faces of fewer than three corners were left out.
    pub degenerate: usize,
}

/// Reads the mesh of a PLY file, gzip'd or not.
///
/// # Errors
/// See [`PlyError`].
pub fn read(path: &Path) -> Result<PlyMesh, PlyError> {
    parse(&read_file(path).map_err(PlyError::Io)?)
}

/// Reads the mesh of a PLY file from memory, unpacked.
///
/// # Errors
/// See [`PlyError`].
pub fn parse(bytes: &[u8]) -> Result<PlyMesh, PlyError> {
    let header = Header::parse(bytes)?;
    check(&header)?;
    let mut mesh = PlyMesh::default();
    match header.encoding {
        Encoding::Ascii => read_elements(&header, &mut Ascii::new(bytes, header.end), &mut mesh)?,
        Encoding::LittleEndian => read_elements(&header, &mut Binary::new(bytes, header.end, false), &mut mesh)?,
        Encoding::BigEndian => read_elements(&header, &mut Binary::new(bytes, header.end, true), &mut mesh)?,
    }
    check_indices(&mesh)?;
    Ok(mesh)
}

/// Names under which writers store the vertices of a face.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

/// Names under which writers store texture coordinates.
const UVS: [[&str; 2]; 4] = [["u", "v"], ["s", "t"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]];

fn check(header: &Header) -> Result<(), PlyError> {
    let element = |name: &str| header.elements.iter().find(|e| e.name == name && e.count > 0);
    let vertex = element("vertex").ok_or(PlyError::NoMesh("the file has no vertices"))?;
    let face = element("face").ok_or(PlyError::NoMesh("the file has no faces: points alone cannot be drawn"))?;
    if ["x", "y", "z"].iter().any(|name| vertex.scalar(name).is_none()) {
        return Err(PlyError::NoMesh("the vertices have no x, y and z"));
    }
    if face.list(&CORNERS).is_none() {
        return Err(PlyError::NoMesh("the faces have no list vertex_indices"));
    }
    if u32::try_from(vertex.count).is_err() {
        return Err(PlyError::NoMesh("more than 2^32 vertices cannot be indexed"));
    }
    Ok(())
}

fn read_elements(header: &Header, rows: &mut impl Rows, mesh: &mut PlyMesh) -> Result<(), PlyError> {
    let (mut vertices, mut faces) = (false, false);
    // As `check` chose them: an element without rows is no mesh, whatever its name.
    for element in header.elements.iter().filter(|element| element.count > 0 && !element.properties.is_empty()) {
        match element.name.as_str() {
            "vertex" if !vertices => {
                read_vertices(element, rows, &mut mesh.triangles)?;
                vertices = true;
            }
            "face" if !faces => {
                read_faces(element, rows, mesh)?;
                faces = true;
            }
            _ => rows.skip(element)?,
        }
        // What follows the mesh may be truncated or not: nobody needs it.
        if vertices && faces {
            break;
        }
    }
    Ok(())
}

fn read_vertices(element: &Element, rows: &mut impl Rows, mesh: &mut TriangleMesh) -> Result<(), PlyError> {
    let columns = |names: &[&str]| -> Option<Vec<usize>> { names.iter().map(|name| element.scalar(name)).collect() };
    let position = columns(&["x", "y", "z"]).unwrap_or_default();
    let normal = columns(&["nx", "ny", "nz"]);
    let uv = UVS.iter().find_map(|names| columns(names));

    let table = rows.table(element)?;
    mesh.positions = table.vec3s(&position);
    mesh.normals = normal.map_or_else(Vec::new, |columns| table.vec3s(&columns));
    mesh.uvs = uv.map_or_else(Vec::new, |columns| table.vec2s(&columns));
    Ok(())
}

fn read_faces(element: &Element, rows: &mut impl Rows, mesh: &mut PlyMesh) -> Result<(), PlyError> {
    let corners = element.list(&CORNERS).unwrap_or_default();
    let sink = &mut Faces { mesh };
    rows.lists(element, corners, |corners| sink.push(corners))
}

/// Faces on their way into a mesh.
struct Faces<'m> {
    mesh: &'m mut PlyMesh,
}

impl Faces<'_> {
    #[inline]
    fn push(&mut self, corners: &[u32]) {
        match *corners {
            [a, b, c] => self.mesh.triangles.indices.push([a, b, c]),
            // Around the face in the file, but row by row in a patch.
            [a, b, c, d] => self.mesh.quads.push([a, b, d, c]),
            [first, ref rest @ ..] if rest.len() > 3 => {
                self.mesh.polygons += 1;
                self.mesh.triangles.indices.extend(rest.windows(2).map(|edge| [first, edge[0], edge[1]]));
            }
            _ => self.mesh.degenerate += 1,
        }
    }
}

fn check_indices(mesh: &PlyMesh) -> Result<(), PlyError> {
    let count = mesh.triangles.positions.len();
    check_kind("triangle", &mesh.triangles.indices, count)?;
    check_kind("quad", &mesh.quads, count)
}

fn check_kind<const N: usize>(face: &'static str, faces: &[[u32; N]], count: usize) -> Result<(), PlyError> {
    let outside = |index: u32| index as usize >= count;
    match faces.iter().position(|face| face.iter().any(|&index| outside(index))) {
        None => Ok(()),
        Some(number) => {
            let index = faces[number].iter().copied().find(|&index| outside(index)).unwrap_or_default();
            // Files store signed indices, so what is beyond 2^31 was negative.
            let index = i64::from(index as i32);
            Err(PlyError::Index { face, number, index, count })
        }
    }
}

/// The scalar values of an element, whichever way they are stored.
trait Table {
    fn vec3s(&self, columns: &[usize]) -> Vec<Vec3>;
    fn vec2s(&self, columns: &[usize]) -> Vec<Vec2>;
}

#[cfg(test)]
mod tests;
