//! Vertices and indices that Embree reads where they lie: checked once, then shared and never changed.

use crate::MeshError;
use std::ops::Deref;
use std::sync::Arc;

/// Embree drops primitives beyond this without a word (rtcCommitScene(3)): its square is just below `f32::MAX`.
pub(crate) const FARTHEST: f32 = 1.844e18;

/// A vertex buffer is limited to 16 GiB (RTC_GEOMETRY_TYPE_TRIANGLE(3)); one vertex of it is padding.
const MOST_VERTICES: usize = (16 << 30) / size_of::<[f32; 3]>() - 1;

/// Primitives are numbered by `u32`, whose largest value means "none".
const MOST_PRIMITIVES: usize = u32::MAX as usize;

/// Positions of a mesh, shared between Embree and whoever else reads them.
///
/// **Space** of the object. Cloning shares; the data is freed when the last geometry and the last clone are gone.
#[derive(Clone, Debug)]
pub struct VertexBuffer(Arc<Padded>);

/// Three-word elements with one more behind the last: Embree loads 16 bytes from each element's start
/// (rtcSetNewGeometryBuffer(3)), so 4 bytes past the end must be readable; one more element makes it 12.
#[derive(Debug)]
struct Padded(Vec<[f32; 3]>);

impl VertexBuffer {
    /// Takes the positions without a copy if the vector has room for one more.
    ///
    /// # Errors
    /// The first vertex that is not finite or farther than 1.844e18 from the origin along an axis; more than 16 GiB.
    pub fn new(positions: Vec<[f32; 3]>) -> Result<Self, MeshError> {
        check_positions(positions.iter().copied())?;
        Ok(Self(Arc::new(Padded::new(positions))))
    }

    /// Bytes of memory held, the padding and unused capacity included.
    pub fn memory(&self) -> usize {
        self.0.0.capacity() * size_of::<[f32; 3]>()
    }
}

impl Padded {
    fn new(mut elements: Vec<[f32; 3]>) -> Self {
        elements.reserve_exact(1);
        elements.push([0.0; 3]);
        Self(elements)
    }
}

impl Deref for VertexBuffer {
    type Target = [[f32; 3]];

    /// The vertices, without the padding.
    #[inline]
    fn deref(&self) -> &[[f32; 3]] {
        let padded = &self.0.0;
        &padded[..padded.len() - 1]
    }
}

/// Reports the first position that Embree would drop.
pub(crate) fn check_positions(positions: impl ExactSizeIterator<Item = [f32; 3]>) -> Result<(), MeshError> {
    if positions.len() > MOST_VERTICES {
        return Err(MeshError::TooMany { what: "vertices", count: positions.len(), limit: MOST_VERTICES });
    }
    for (vertex, position) in positions.enumerate() {
        // One comparison for the good case: NaN fails it too.
        if position.iter().all(|x| x.abs() <= FARTHEST) {
            continue;
        }
        return Err(match position.iter().all(|x| x.is_finite()) {
            true => MeshError::FarVertex { vertex, position },
            false => MeshError::NonFiniteVertex { vertex, position },
        });
    }
    Ok(())
}

/// Triangles of a mesh as triples of vertex numbers, counter-clockwise from outside, shared like [`VertexBuffer`].
#[derive(Clone, Debug)]
pub struct TriangleIndices {
    triangles: Arc<Vec<[u32; 3]>>,
    vertex_count: usize,
}

impl TriangleIndices {
    /// Takes the triangles, without a copy, for a mesh of `vertex_count` vertices.
    ///
    /// # Errors
    /// The first index that names no vertex; 2^32 triangles or more.
    pub fn new(triangles: Vec<[u32; 3]>, vertex_count: usize) -> Result<Self, MeshError> {
        if triangles.len() > MOST_PRIMITIVES {
            return Err(MeshError::TooMany { what: "triangles", count: triangles.len(), limit: MOST_PRIMITIVES });
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&index) = corners.iter().find(|&&index| index as usize >= vertex_count) {
                return Err(MeshError::IndexOutOfRange { triangle, index, vertex_count });
            }
        }
        Ok(Self { triangles: Arc::new(triangles), vertex_count })
    }

    /// The number of vertices against which the indices were checked.
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
    }

    /// Bytes of memory held, unused capacity included.
    pub fn memory(&self) -> usize {
        self.triangles.capacity() * size_of::<[u32; 3]>()
    }
}

impl Deref for TriangleIndices {
    type Target = [[u32; 3]];

    #[inline]
    fn deref(&self) -> &[[u32; 3]] {
        &self.triangles
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_padding_is_there_and_is_not_seen() {
        let buffer = VertexBuffer::new(vec![[1.0; 3]; 5]).unwrap();
        assert_eq!(buffer.len(), 5);
        assert!(buffer.memory() >= 5 * 12 + 4);
        assert!(VertexBuffer::new(Vec::new()).unwrap().is_empty());
    }

    #[test]
    fn a_vector_with_room_is_not_copied() {
        let mut positions = Vec::with_capacity(4);
        positions.extend([[0.0_f32; 3]; 3]);
        let address = positions.as_ptr();
        assert_eq!(VertexBuffer::new(positions).unwrap().as_ptr(), address);
    }

    #[test]
    fn clones_share_the_memory() {
        let buffer = VertexBuffer::new(vec![[1.0; 3]; 5]).unwrap();
        assert_eq!(buffer.as_ptr(), buffer.clone().as_ptr());
    }

    #[test]
    fn bad_vertices_are_named() {
        let nan = VertexBuffer::new(vec![[0.0; 3], [0.0, f32::NAN, 0.0]]).unwrap_err();
        assert!(matches!(nan, MeshError::NonFiniteVertex { vertex: 1, .. }), "{nan}");
        let infinite = VertexBuffer::new(vec![[f32::NEG_INFINITY, 0.0, 0.0]]).unwrap_err();
        assert!(matches!(infinite, MeshError::NonFiniteVertex { vertex: 0, .. }), "{infinite}");
        let far = VertexBuffer::new(vec![[0.0; 3], [0.0; 3], [0.0, 0.0, -1.9e18]]).unwrap_err();
        assert_eq!(far, MeshError::FarVertex { vertex: 2, position: [0.0, 0.0, -1.9e18] });
        assert!(VertexBuffer::new(vec![[FARTHEST, -FARTHEST, 0.0]]).is_ok());
    }

    #[test]
    fn bad_indices_are_named() {
        let error = TriangleIndices::new(vec![[0, 1, 2], [2, 3, 0]], 3).unwrap_err();
        assert_eq!(error, MeshError::IndexOutOfRange { triangle: 1, index: 3, vertex_count: 3 });
        assert_eq!(error.to_string(), "triangle 1 names vertex 3, but there are 3");
        assert!(TriangleIndices::new(vec![[0, 0, 0]], 0).is_err());
        assert!(TriangleIndices::new(Vec::new(), 0).is_ok());
    }
}
