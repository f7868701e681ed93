//! When a quad is as good as two triangles, which Embree intersects itself and ten times as fast as a patch.

use glam::{DVec3, Vec2, Vec3};

/// The triangles p00 p10 p11 and p00 p11 p01 of a patch with the corners p00 p10 p01 p11.
pub(super) const HALVES: [[usize; 3]; 2] = [[0, 1, 3], [0, 3, 2]];

/// Flatter than this, relative to its size, a quad is flat. Files state coordinates with five or six decimals, so flat
/// quads come no flatter; the patch differs from the triangles by at most a fourth of it, and in its normal by as much in
/// radians: 1/4000.
const FLATNESS: f64 = 1.0 / 4096.0;

/// The halves of a flat quad, if its first diagonal leaves both with area and wound alike.
pub(super) fn flat_halves(corners: [Vec3; 4]) -> Option<[[usize; 3]; 2]> {
    let [p00, p10, p01, p11] = corners.map(Vec3::as_dvec3);
    let (diagonal, other) = (p11 - p00, p01 - p10);
    let size = diagonal.length().min(other.length());
    let normal = diagonal.cross(other).normalize_or_zero();
    // The distance of the two diagonals from each other.
    let flat = (p10 - p00).dot(normal).abs() <= FLATNESS * size;
    let area = |a: DVec3, b: DVec3, c: DVec3| (b - a).cross(c - a).dot(normal);
    // The halves' areas along the normal, which the quad's own area bounds from above.
    let least = FLATNESS * diagonal.cross(other).length();
    let convex = area(p00, p10, p11) > least && area(p00, p11, p01) > least;
    (flat && convex).then_some(HALVES)
}

/// Whether positions, normals and texture coordinates are all affine over the patch, so that its halves interpolate as it
/// does.
pub(super) fn is_affine(quad: [u32; 4], positions: &[Vec3], normals: &[Vec3], uvs: &[Vec2]) -> bool {
    let affine = |values: [Vec3; 4]| {
        let [v00, v10, v01, v11] = values.map(Vec3::as_dvec3);
        (v00 + v11 - v10 - v01).length() <= FLATNESS * (v11 - v00).length().min((v01 - v10).length())
    };
    let at = |values: &[Vec3]| quad.map(|index| values[index as usize]);
    flat_halves(at(positions)).is_some()
        && affine(at(positions))
        && (uvs.is_empty() || affine(quad.map(|index| uvs[index as usize].extend(0.0))))
        && (normals.is_empty() || at(normals).iter().all(|n| *n == normals[quad[0] as usize]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flat_convex_quads_are_cut_and_others_are_not() {
        let quad = |p11: Vec3| [Vec3::ZERO, Vec3::X, Vec3::Y, p11];
        assert_eq!(flat_halves(quad(Vec3::new(1.0, 1.0, 0.0))), Some(HALVES));
        assert_eq!(flat_halves(quad(Vec3::new(2.0, 1.5, 1e-5))), Some(HALVES));
        assert_eq!(flat_halves(quad(Vec3::new(1.0, 1.0, 0.1))), None);
        // Not convex at p10, so that the diagonal lies outside; crossed; and a triangle.
        assert_eq!(flat_halves([Vec3::ZERO, Vec3::new(0.7, 0.2, 0.0), Vec3::X, Vec3::new(1.0, 1.0, 0.0)]), None);
        assert_eq!(flat_halves([Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y]), None);
        assert_eq!(flat_halves([Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::X]), None);
        assert_eq!(flat_halves([Vec3::ZERO; 4]), None);
    }

    #[test]
    fn only_parallelograms_with_affine_uvs_interpolate_like_their_halves() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0), Vec3::new(2.0, 1.0, 0.0)];
        let affine = [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE, Vec2::ONE];
        let bent = [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::new(0.5, 0.5), Vec2::ONE];
        assert!(is_affine([0, 1, 2, 3], &positions, &[], &[]));
        assert!(is_affine([0, 1, 2, 3], &positions, &[], &affine));
        assert!(!is_affine([0, 1, 2, 3], &positions, &[], &bent));
        assert!(!is_affine([0, 1, 2, 4], &positions, &[], &[]));
    }
}
