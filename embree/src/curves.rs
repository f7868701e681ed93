//! Curves: cubic Bézier ribbons.

use crate::buffer::{VertexBuffer, check_positions};
use crate::{Features, MeshError};
use embree_sys as sys;

/// How a curve is given its width.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveKind {
    /// A ribbon that turns its flat side to every ray; intersected as a few quads, meant to be thin on the screen.
    FlatBezier,
    /// A ribbon perpendicular to given normals.
    NormalOrientedBezier,
}

/// Control points of cubic Bézier curves, checked.
pub(crate) struct Curves {
    pub(crate) control: Vec<[f32; 4]>,
    pub(crate) first: Vec<u32>,
    pub(crate) normals: Option<VertexBuffer>,
}

impl Curves {
    pub(crate) fn new(
        kind: CurveKind,
        control: Vec<[f32; 4]>,
        first: Vec<u32>,
        normals: Option<Vec<[f32; 3]>>,
    ) -> Result<Self, MeshError> {
        check_positions(control.iter().map(|&[x, y, z, _]| [x, y, z]))?;
        if let Some((point, &[_, _, _, radius])) = control.iter().enumerate().find(|(_, c)| !c[3].is_finite()) {
            return Err(MeshError::NonFiniteRadius { point, radius });
        }
        if let Some((curve, &first)) = first.iter().enumerate().find(|(_, f)| **f as usize + 4 > control.len()) {
            return Err(MeshError::CurveOutOfRange { curve, first, count: control.len() });
        }
        let needed = if kind == CurveKind::NormalOrientedBezier { control.len() } else { 0 };
        let count = normals.as_ref().map_or(0, Vec::len);
        if count != needed {
            return Err(MeshError::CurveNormals { needed, count });
        }
        let normals = normals.filter(|normals| !normals.is_empty()).map(VertexBuffer::new).transpose()?;
        Ok(Self { control, first, normals })
    }
}

impl CurveKind {
    pub(crate) fn raw(self) -> sys::RTCGeometryType {
        match self {
            Self::FlatBezier => sys::RTC_GEOMETRY_TYPE_FLAT_BEZIER_CURVE,
            Self::NormalOrientedBezier => sys::RTC_GEOMETRY_TYPE_NORMAL_ORIENTED_BEZIER_CURVE,
        }
    }

    pub(crate) fn feature(self) -> Features {
        match self {
            Self::FlatBezier => Features::FLAT_BEZIER_CURVES,
            Self::NormalOrientedBezier => Features::NORMAL_ORIENTED_BEZIER_CURVES,
        }
    }
}
