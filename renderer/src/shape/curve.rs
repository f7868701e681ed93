//! Curves, as segments of cubic Bézier curves with a radius at each control point.

use glam::{Vec3, Vec4};

use crate::math::Transform;
use crate::scene::description::{Curve, CurveKind};

/// The segments of one or more curves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Segments {
    /// Four control points per segment, radius in w.
    pub control: Vec<Vec4>,
    /// Ribbons: the Bézier control points of the normals, as many as `control`. Others: empty.
    pub normals: Vec<Vec3>,
    /// What part of its curve each segment is: u at its start and at its end.
    pub u: Vec<[f32; 2]>,
}

/// Why a curve cannot be rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CurveError {
    /// A number is infinite or not a number.
    #[error("a control point, a normal or a width of the curve is not finite")]
    NotFinite,
    /// A ribbon without the normals that orient it.
    #[error("the ribbon has {segments} segments and needs {} normals, but has {normals}", .segments + 1)]
    Normals {
        /// Segments of the curve.
        segments: usize,
        /// Normals given.
        normals: usize,
    },
}

impl Segments {
    /// Appends a curve, transformed to world space. Widths scale by the cube root of the volume's ratio, which is the
    /// length's ratio for a similarity; curves have no other notion of width across the ray.
    ///
    /// # Errors
    /// The curve is not finite or lacks normals; nothing is appended then.
    pub fn push(&mut self, curve: &Curve, world_from_shape: &Transform) -> Result<(), CurveError> {
        let count = curve.control.len();
        let ribbon = curve.kind == CurveKind::Ribbon;
        if ribbon && curve.normals.len() != count + 1 {
            return Err(CurveError::Normals { segments: count, normals: curve.normals.len() });
        }
        let scale = glam::DMat3::from_mat4(world_from_shape.matrix()).determinant().abs().cbrt() as f32;
        let [start, end] = curve.width.map(|width| 0.5 * scale * width);
        // At control point k of 3 of segment i, a linear function of u has the value of u there.
        let u = |segment: usize, k: usize| (segment as f32 + k as f32 / 3.0) / count as f32;
        let point = |(index, &p): (usize, &Vec3)| {
            let u = u(index / 4, index % 4);
            world_from_shape.point(p).extend((start + (end - start) * u).max(0.0))
        };
        let control: Vec<Vec4> = curve.control.iter().flatten().enumerate().map(point).collect();
        let normals: Vec<Vec3> = if ribbon {
            let unit: Vec<Vec3> =
                curve.normals.iter().map(|&n| world_from_shape.normal(n).normalize_or_zero()).collect();
            unit.windows(2).flat_map(|ends| normal_control(ends[0], ends[1])).collect()
        } else {
            Vec::new()
        };
        if !(control.iter().all(|p| p.is_finite()) && normals.iter().all(|n| n.is_finite())) {
            return Err(CurveError::NotFinite);
        }
        self.control.extend(control);
        self.normals.extend(normals);
        self.u.extend((0..count).map(|segment| [u(segment, 0), u(segment, 3)]));
        Ok(())
    }

    /// Moves the segments of `other` behind these.
    pub fn append(&mut self, other: &mut Segments) {
        self.control.append(&mut other.control);
        self.normals.append(&mut other.normals);
        self.u.append(&mut other.u);
    }

    /// How many segments.
    pub fn len(&self) -> usize {
        self.u.len()
    }

    /// None.
    pub fn is_empty(&self) -> bool {
        self.u.is_empty()
    }

    /// The derivative by the segment's own parameter at `t` in [0, 1].
    pub fn tangent(&self, segment: usize, t: f32) -> Vec3 {
        let [p0, p1, p2, p3] = self.segment(segment).map(Vec4::truncate);
        let (a, b, c) = (p1 - p0, p2 - p1, p3 - p2);
        3.0 * a.lerp(b, t).lerp(b.lerp(c, t), t)
    }

    /// The centre line at `t` and the radius in w.
    pub fn at(&self, segment: usize, t: f32) -> Vec4 {
        let [p0, p1, p2, p3] = self.segment(segment);
        let (a, b, c) = (p0.lerp(p1, t), p1.lerp(p2, t), p2.lerp(p3, t));
        a.lerp(b, t).lerp(b.lerp(c, t), t)
    }

    fn segment(&self, segment: usize) -> [Vec4; 4] {
        std::array::from_fn(|k| self.control[4 * segment + k])
    }
}

/// Bézier control points of the cubic through the spherical interpolation of two unit normals at 0, 1/3, 2/3 and 1.
fn normal_control(start: Vec3, end: Vec3) -> [Vec3; 4] {
    let angle = start.dot(end).clamp(-1.0, 1.0).acos();
    let slerp = |t: f32| {
        // Parallel or opposite ends have no one great circle between them: interpolate linearly.
        let sin = angle.sin();
        if sin < 1e-3 {
            start.lerp(end, t)
        } else {
            (start * ((1.0 - t) * angle).sin() + end * (t * angle).sin()) / sin
        }
    };
    let (p1, p2) = (slerp(1.0 / 3.0), slerp(2.0 / 3.0));
    // The inverse of the Bernstein matrix at 1/3 and 2/3.
    let b1 = (-5.0 * start + 18.0 * p1 - 9.0 * p2 + 2.0 * end) / 6.0;
    let b2 = (2.0 * start - 9.0 * p1 + 18.0 * p2 - 5.0 * end) / 6.0;
    [start, b1, b2, end]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(kind: CurveKind, normals: Vec<Vec3>) -> Curve {
        let control = vec![
            [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y],
            [Vec3::Y, Vec3::Y - Vec3::X, Vec3::Y * 2.0 - Vec3::X, Vec3::Y * 3.0],
        ];
        Curve { kind, control, normals, width: [0.4, 0.2] }
    }

    #[test]
    fn widths_and_parameters_run_over_all_segments() {
        let mut segments = Segments::default();
        segments.push(&curve(CurveKind::Flat, vec![]), &Transform::default()).unwrap();
        assert_eq!(segments.len(), 2);
        assert_eq!(segments.u, [[0.0, 0.5], [0.5, 1.0]]);
        assert!((segments.at(0, 1.0).w - 0.15).abs() < 1e-6 && (segments.at(1, 0.0).w - 0.15).abs() < 1e-6);
        assert!((segments.at(1, 1.0) - Vec4::new(0.0, 3.0, 0.0, 0.1)).length() < 1e-6);
        assert_eq!(segments.tangent(0, 0.0), Vec3::X * 3.0);
    }

    #[test]
    fn a_ribbons_normals_turn_along_the_great_circle() {
        let mut segments = Segments::default();
        assert!(segments.push(&curve(CurveKind::Ribbon, vec![Vec3::X]), &Transform::default()).is_err());
        assert!(segments.is_empty());
        segments.push(&curve(CurveKind::Ribbon, vec![Vec3::X, Vec3::Y, Vec3::Z]), &Transform::default()).unwrap();
        let n = &segments.normals[0..4];
        let (a, b, c) = (n[0].lerp(n[1], 0.5), n[1].lerp(n[2], 0.5), n[2].lerp(n[3], 0.5));
        let middle = a.lerp(b, 0.5).lerp(b.lerp(c, 0.5), 0.5);
        assert!((middle - Vec3::new(1.0, 1.0, 0.0).normalize()).length() < 2e-3, "{middle}");
    }

    #[test]
    fn what_is_not_finite_is_refused() {
        let mut bad = curve(CurveKind::Flat, vec![]);
        bad.width[1] = f32::NAN;
        bad.control[1][2].y = f32::INFINITY;
        assert_eq!(Segments::default().push(&bad, &Transform::default()), Err(CurveError::NotFinite));
    }
}
