//! Loop subdivision: a triangle mesh refined a number of times and moved to its limit surface.

use glam::{DVec3, Vec3};

use crate::scene::description::TriangleMesh;

/// Why a control mesh cannot be subdivided.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LoopError {
    /// An index names no vertex.
    #[error("triangle {triangle} of the control mesh names vertex {vertex}, but there are {vertices}")]
    Index {
        /// Which triangle.
        triangle: usize,
        /// What it names.
        vertex: u32,
        /// How many there are.
        vertices: usize,
    },
    /// A position is infinite or not a number.
    #[error("vertex {0} of the control mesh is not finite")]
    NotFinite(usize),
    /// The surface has no neighbourhood there.
    #[error(
        "the control mesh is not a manifold at vertex {0}: every edge must have one or two triangles, all wound the same way, and the triangles around a vertex must form one fan"
    )]
    NotManifold(u32),
    /// More vertices than 32 bits can name.
    #[error("{0} levels of subdivision make more triangles than can be indexed; use fewer")]
    TooMany(u32),
}

/// Refines `mesh` `levels` times and moves its vertices to the limit surface, with the limit surface's normals.
///
/// The normals are those of pbrt, which point to the side from which the triangles are wound clockwise.
///
/// # Errors
/// The control mesh is not an oriented manifold, with or without boundary, or grows too large.
///
/// **Source**: \[Loop87\] for the refinement, with the weights of \[Warren95\]; \[Hoppe94\] for limits and tangents.
pub fn subdivide(mesh: &TriangleMesh, levels: u32) -> Result<TriangleMesh, LoopError> {
    let vertices = mesh.positions.len();
    for (triangle, indices) in mesh.indices.iter().enumerate() {
        if let Some(&vertex) = indices.iter().find(|&&vertex| vertex as usize >= vertices) {
            return Err(LoopError::Index { triangle, vertex, vertices });
        }
    }
    if let Some(vertex) = mesh.positions.iter().position(|p| !p.is_finite()) {
        return Err(LoopError::NotFinite(vertex));
    }
    // Each level makes four of each triangle; corners are named by 32 bits.
    let corners = 4_u64.checked_pow(levels).and_then(|factor| factor.checked_mul(3 * mesh.indices.len() as u64));
    if corners.is_none_or(|corners| corners >= u64::from(NONE)) {
        return Err(LoopError::TooMany(levels));
    }
    let mut level = Level {
        points: mesh.positions.iter().map(|p| p.as_dvec3()).collect(),
        corners: mesh.indices.as_flattened().to_vec(),
    };
    for _ in 0..levels {
        level = level.refined(&Topology::new(&level)?);
    }
    let (positions, normals) = level.limit(&Topology::new(&level)?);
    let indices = level.corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
    Ok(TriangleMesh { indices, positions, normals, uvs: Vec::new(), tangents: Vec::new() })
}

/// No corner.
const NONE: u32 = u32::MAX;

/// A control mesh. Corner c belongs to triangle c / 3 and names a vertex; edge c leads from it to the next corner.
struct Level {
    points: Vec<DVec3>,
    corners: Vec<u32>,
}

/// How the triangles of a mesh hang together.
struct Topology {
    /// Of each edge, the same edge of the neighbour, or [`NONE`] at the boundary.
    opposite: Vec<u32>,
    /// Of each vertex, the corner from which a turn that follows [`Self::turned`] sees all its triangles, or [`NONE`].
    first: Vec<u32>,
}

fn next(corner: u32) -> u32 {
    if corner % 3 == 2 { corner - 2 } else { corner + 1 }
}

fn previous(corner: u32) -> u32 {
    if corner % 3 == 0 { corner + 2 } else { corner - 1 }
}

impl Topology {
    fn new(level: &Level) -> Result<Self, LoopError> {
        let corners = &level.corners;
        let opposite = opposite_edges(corners)?;
        let mut topology = Self { opposite, first: vec![NONE; level.points.len()] };
        let mut incident = vec![0_u32; level.points.len()];
        for (corner, &vertex) in (0..).zip(corners) {
            incident[vertex as usize] += 1;
            let first = &mut topology.first[vertex as usize];
            // A boundary vertex starts at its boundary edge; any corner will do for others.
            if *first == NONE || topology.opposite[corner as usize] == NONE {
                *first = corner;
            }
        }
        for (vertex, &count) in (0..).zip(&incident) {
            if count > 0 && topology.fan(vertex).count() != count as usize {
                return Err(LoopError::NotManifold(vertex));
            }
        }
        Ok(topology)
    }

    /// The next corner of the same vertex, counter-clockwise, or [`NONE`] beyond the boundary.
    fn turned(&self, corner: u32) -> u32 {
        self.opposite[previous(corner) as usize]
    }

    /// The corners of a vertex, counter-clockwise.
    fn fan(&self, vertex: u32) -> impl Iterator<Item = u32> + '_ {
        let first = self.first[vertex as usize];
        let start = (first != NONE).then_some(first);
        // Turning is a permutation of corners, so it comes back to the first or ends at a boundary.
        std::iter::successors(start, move |&corner| {
            Some(self.turned(corner)).filter(|&corner| corner != NONE && corner != first)
        })
    }

    fn on_boundary(&self, vertex: u32) -> bool {
        let first = self.first[vertex as usize];
        first != NONE && self.opposite[first as usize] == NONE
    }
}

/// Pairs the edges of a mesh.
fn opposite_edges(corners: &[u32]) -> Result<Vec<u32>, LoopError> {
    let mut edges: Vec<(u32, u32, u32)> = (0..corners.len() as u32)
        .map(|corner| {
            let (a, b) = (corners[corner as usize], corners[next(corner) as usize]);
            (a.min(b), a.max(b), corner)
        })
        .collect();
    edges.sort_unstable();
    let mut opposite = vec![NONE; corners.len()];
    for pair in edges.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        let vertex = pair[0].0;
        match *pair {
            _ if pair[0].0 == pair[0].1 => return Err(LoopError::NotManifold(vertex)),
            [_] => {}
            [(_, _, x), (_, _, y)] if corners[x as usize] != corners[y as usize] => {
                opposite[x as usize] = y;
                opposite[y as usize] = x;
            }
            _ => return Err(LoopError::NotManifold(vertex)),
        }
    }
    Ok(opposite)
}

impl Level {
    fn point(&self, corner: u32) -> DVec3 {
        self.points[self.corners[corner as usize] as usize]
    }

    /// The neighbours of a vertex, counter-clockwise, from boundary to boundary where there is one.
    fn ring(&self, topology: &Topology, vertex: u32, ring: &mut Vec<DVec3>) {
        ring.clear();
        let mut last = NONE;
        for corner in topology.fan(vertex) {
            ring.push(self.point(next(corner)));
            last = corner;
        }
        if topology.on_boundary(vertex) {
            ring.push(self.point(previous(last)));
        }
    }

    fn refined(&self, topology: &Topology) -> Level {
        let mut ring = Vec::new();
        let mut points: Vec<DVec3> = (0..self.points.len() as u32)
            .map(|vertex| {
                self.ring(topology, vertex, &mut ring);
                let weight = if topology.on_boundary(vertex) { 1.0 / 8.0 } else { beta(ring.len()) };
                weighted(self.points[vertex as usize], &ring, weight, topology.on_boundary(vertex))
            })
            .collect();
        // One new vertex per edge, made at the first of its two corners.
        let mut on_edge = vec![NONE; self.corners.len()];
        for corner in 0..self.corners.len() as u32 {
            let opposite = topology.opposite[corner as usize];
            if opposite != NONE && opposite < corner {
                on_edge[corner as usize] = on_edge[opposite as usize];
                continue;
            }
            on_edge[corner as usize] = points.len() as u32;
            let ends = self.point(corner) + self.point(next(corner));
            points.push(match opposite {
                NONE => ends / 2.0,
                _ => ends * 0.375 + (self.point(previous(corner)) + self.point(previous(opposite))) * 0.125,
            });
        }
        let corners = (0..self.corners.len() as u32)
            .step_by(3)
            .flat_map(|corner| {
                let c = |k: u32| self.corners[(corner + k) as usize];
                let e = |k: u32| on_edge[(corner + k) as usize];
                [c(0), e(0), e(2), e(0), c(1), e(1), e(2), e(1), c(2), e(0), e(1), e(2)]
            })
            .collect();
        Level { points, corners }
    }

    /// Positions and normals on the limit surface.
    fn limit(&self, topology: &Topology) -> (Vec<Vec3>, Vec<Vec3>) {
        let mut ring = Vec::new();
        (0..self.points.len() as u32)
            .map(|vertex| {
                self.ring(topology, vertex, &mut ring);
                let p = self.points[vertex as usize];
                let boundary = topology.on_boundary(vertex);
                let n = ring.len();
                let weight = if boundary { 1.0 / 5.0 } else { 1.0 / (n as f64 + 3.0 / (8.0 * beta(n))) };
                let normal = if boundary { boundary_normal(p, &ring) } else { interior_normal(&ring) };
                (weighted(p, &ring, weight, boundary).as_vec3(), normal.normalize_or_zero().as_vec3())
            })
            .unzip()
    }
}

/// Weight of each neighbour of an interior vertex.
fn beta(valence: usize) -> f64 {
    if valence == 3 { 3.0 / 16.0 } else { 3.0 / (8.0 * valence as f64) }
}

/// The vertex less the weights of its neighbours, plus those: all of them, or the two along the boundary.
fn weighted(p: DVec3, ring: &[DVec3], weight: f64, boundary: bool) -> DVec3 {
    let (count, sum) = match ring {
        [] => (0, DVec3::ZERO),
        [first, .., last] if boundary => (2, *first + *last),
        _ => (ring.len(), ring.iter().sum()),
    };
    p * (1.0 - count as f64 * weight) + sum * weight
}

/// The cross product of the tangents, pointing to the clockwise side.
fn interior_normal(ring: &[DVec3]) -> DVec3 {
    let (mut s, mut t) = (DVec3::ZERO, DVec3::ZERO);
    for (j, &p) in ring.iter().enumerate() {
        let (sin, cos) = (std::f64::consts::TAU * j as f64 / ring.len() as f64).sin_cos();
        s += p * cos;
        t += p * sin;
    }
    t.cross(s)
}

/// As [`interior_normal`], from the tangent along the boundary and the one across it.
fn boundary_normal(p: DVec3, ring: &[DVec3]) -> DVec3 {
    let along = ring[ring.len() - 1] - ring[0];
    let across = match *ring {
        [a, b] => a + b - 2.0 * p,
        [_, b, _] => b - p,
        [a, b, c, d] => 2.0 * b + 2.0 * c - a - d - 2.0 * p,
        _ => {
            let theta = std::f64::consts::PI / (ring.len() - 1) as f64;
            let weight = |k: usize| (2.0 - 2.0 * theta.cos()) * (k as f64 * theta).sin();
            let inner: DVec3 = (1..ring.len() - 1).map(|k| ring[k] * weight(k)).sum();
            inner - (ring[0] + ring[ring.len() - 1]) * theta.sin()
        }
    };
    along.cross(across)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(positions: Vec<Vec3>, indices: Vec<[u32; 3]>) -> TriangleMesh {
        TriangleMesh { positions, indices, ..Default::default() }
    }

    fn tetrahedron() -> TriangleMesh {
        let p = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]].map(Vec3::from_array);
        mesh(p.to_vec(), vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    }

    /// A square grid in the plane z = 0, wound counter-clockwise seen from +z.
    fn grid(n: u32) -> TriangleMesh {
        let positions = (0..=n).flat_map(|y| (0..=n).map(move |x| Vec3::new(x as f32, y as f32, 0.0))).collect();
        let at = |x: u32, y: u32| y * (n + 1) + x;
        let quads = (0..n).flat_map(|y| (0..n).map(move |x| (x, y)));
        let indices = quads.flat_map(|(x, y)| {
            [[at(x, y), at(x + 1, y), at(x + 1, y + 1)], [at(x, y), at(x + 1, y + 1), at(x, y + 1)]]
        });
        mesh(positions, indices.collect())
    }

    #[test]
    fn a_closed_mesh_stays_closed_and_converges_to_one_limit() {
        // The limit position of a vertex does not depend on how often the mesh was refined before.
        let limits: Vec<TriangleMesh> = (0..5).map(|levels| subdivide(&tetrahedron(), levels).unwrap()).collect();
        for (level, limit) in limits.iter().enumerate() {
            assert_eq!(limit.indices.len(), 4 << (2 * level));
            // Euler: V − E + F = 2.
            assert_eq!(limit.positions.len(), 2 + limit.indices.len() / 2);
            for vertex in 0..4 {
                let miss = (limit.positions[vertex] - limits[0].positions[vertex]).length();
                assert!(miss < 1e-6, "vertex {vertex} at level {level} is off by {miss}");
                // By symmetry, at the corners the normal is radial; clockwise side: inwards.
                let radial = limit.positions[vertex].normalize();
                assert!(limit.normals[vertex].dot(radial) < -0.999_99);
            }
        }
    }

    #[test]
    fn normals_are_those_of_the_refined_mesh() {
        let mesh = subdivide(&tetrahedron(), 5).unwrap();
        let mut sums = vec![Vec3::ZERO; mesh.positions.len()];
        for triangle in &mesh.indices {
            let [a, b, c] = triangle.map(|vertex| mesh.positions[vertex as usize]);
            for &vertex in triangle {
                sums[vertex as usize] -= (b - a).cross(c - a);
            }
        }
        for (sum, n) in sums.iter().zip(&mesh.normals) {
            assert!(sum.normalize().dot(*n) > 0.995, "{sum} {n}");
        }
    }

    #[test]
    fn a_flat_sheet_stays_flat_and_keeps_its_straight_boundary() {
        let sheet = subdivide(&grid(3), 2).unwrap();
        for (p, n) in sheet.positions.iter().zip(&sheet.normals) {
            assert!(p.z.abs() < 1e-6 && p.x >= -1e-6 && p.x <= 3.0 + 1e-6);
            assert!((*n - Vec3::NEG_Z).length() < 1e-5, "{n} at {p}");
        }
        // Every valence of boundary vertex: a fan of n triangles around vertex 0.
        for triangles in 1..7_u32 {
            let rim = (0..=triangles).map(|k| Vec3::from_array([(k as f32 * 0.5).cos(), (k as f32 * 0.5).sin(), 0.0]));
            let fan = mesh(
                std::iter::once(Vec3::ZERO).chain(rim).collect(),
                (0..triangles).map(|k| [0, k + 1, k + 2]).collect(),
            );
            for n in subdivide(&fan, 1).unwrap().normals {
                assert!((n - Vec3::NEG_Z).length() < 1e-5, "{n} in a fan of {triangles}");
            }
        }
    }

    #[test]
    fn broken_meshes_are_refused() {
        let with =
            |indices: Vec<[u32; 3]>| subdivide(&mesh(grid(2).positions, indices), 1).map(|mesh| mesh.indices.len());
        assert_eq!(with(vec![[0, 1, 9]]), Err(LoopError::Index { triangle: 0, vertex: 9, vertices: 9 }));
        assert_eq!(with(vec![[0, 1, 2], [0, 1, 3]]), Err(LoopError::NotManifold(0)));
        assert_eq!(with(vec![[0, 1, 2], [1, 0, 3], [0, 1, 4]]), Err(LoopError::NotManifold(0)));
        assert_eq!(with(vec![[0, 0, 1]]), Err(LoopError::NotManifold(0)));
        assert_eq!(with(vec![[4, 0, 1], [4, 7, 8]]), Err(LoopError::NotManifold(4)));
        assert_eq!(with(vec![]), Ok(0));
        assert_eq!(subdivide(&tetrahedron(), 40).unwrap_err(), LoopError::TooMany(40));
    }
}
