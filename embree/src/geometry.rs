//! Geometry: what is attached to a scene, and what it must keep alive.

use crate::curves::Curves;
use crate::device::{Device, Handle};
use crate::user::{self, Binding};
use crate::{CommittedScene, CurveKind, Error, Features, MeshError, TriangleIndices, UserGeometry, VertexBuffer};
use embree_sys as sys;
use glam::Affine3A;
use std::ffi::c_void;
use std::fmt;
use std::ptr::{self, NonNull};
use std::sync::Arc;

/// A mesh, a bundle of curves, a set of user primitives or an instance, ready to be attached to a scene.
pub struct Geometry {
    raw: NonNull<sys::RTCGeometryTy>,
    features: Features,
    content: Content,
    // Declared last: the device outlives what it made.
    device: Arc<Handle>,
}

/// What Embree reads while the geometry exists; it is dropped after the geometry's reference has been given back.
enum Content {
    Triangles { _vertices: VertexBuffer, _triangles: TriangleIndices },
    Curves { _curves: Curves },
    User(Arc<Binding>),
    Instance { _scene: Arc<CommittedScene> },
}

// SAFETY: Embree's objects are not bound to the thread that made them; calls for one object must not overlap
// (rtcCommitScene(3)), which `&mut` and ownership see to, as there are no methods that call Embree through `&self`.
unsafe impl Send for Geometry {}

impl Geometry {
    /// A triangle mesh. Embree reads vertices and indices where they are; nothing is copied.
    ///
    /// # Errors
    /// Indices that were checked against more vertices than there are; Embree out of memory.
    pub fn triangles(device: &Device, vertices: VertexBuffer, triangles: TriangleIndices) -> Result<Self, Error> {
        if triangles.vertex_count() > vertices.len() {
            let (checked, vertex_count) = (triangles.vertex_count(), vertices.len());
            return Err(MeshError::FewerVertices { checked, vertex_count }.into());
        }
        let (positions, indices) = (vertices.as_ptr().cast(), triangles.as_ptr().cast());
        let (vertex_count, triangle_count) = (vertices.len(), triangles.len());
        let content = Content::Triangles { _vertices: vertices, _triangles: triangles };
        let geometry = Self::new(device, sys::RTC_GEOMETRY_TYPE_TRIANGLE, Features::TRIANGLES, content)?;
        // SAFETY: `share`'s contract: `VertexBuffer` is padded for 16-byte loads and `TriangleIndices` holds whole
        // triples below the number of vertices; both are kept by `content` and never change.
        unsafe {
            geometry.share(sys::RTC_BUFFER_TYPE_VERTEX, sys::RTC_FORMAT_FLOAT3, positions, 12, vertex_count);
            geometry.share(sys::RTC_BUFFER_TYPE_INDEX, sys::RTC_FORMAT_UINT3, indices, 12, triangle_count);
        }
        geometry.checked("rtcSetSharedGeometryBuffer")
    }

    /// Cubic Bézier curves: `control` holds positions and radii, `first` the number of each curve's first of four
    /// control points, `normals` one normal per control point for the kind that needs them.
    ///
    /// # Errors
    /// Control points, radii or normals that are not finite; curves that reach beyond the control points; normals that
    /// are missing or superfluous; Embree out of memory.
    pub fn curves(
        device: &Device,
        kind: CurveKind,
        control: Vec<[f32; 4]>,
        first: Vec<u32>,
        normals: Option<Vec<[f32; 3]>>,
    ) -> Result<Self, Error> {
        let curves = Curves::new(kind, control, first, normals)?;
        let (control, control_count) = (curves.control.as_ptr().cast(), curves.control.len());
        let (first, curve_count) = (curves.first.as_ptr().cast(), curves.first.len());
        let normals = curves.normals.as_ref().map(|normals| normals.as_ptr().cast());
        let content = Content::Curves { _curves: curves };
        let geometry = Self::new(device, kind.raw(), kind.feature(), content)?;
        // SAFETY: `share`'s contract: control points are 16 bytes each, normals padded like vertices, and every curve
        // has four control points; all are kept by `content` and never change.
        unsafe {
            geometry.share(sys::RTC_BUFFER_TYPE_VERTEX, sys::RTC_FORMAT_FLOAT4, control, 16, control_count);
            geometry.share(sys::RTC_BUFFER_TYPE_INDEX, sys::RTC_FORMAT_UINT, first, 4, curve_count);
            if let Some(normals) = normals {
                geometry.share(sys::RTC_BUFFER_TYPE_NORMAL, sys::RTC_FORMAT_FLOAT3, normals, 12, control_count);
            }
        }
        geometry.checked("rtcSetSharedGeometryBuffer")
    }

    /// Primitives that Rust intersects.
    ///
    /// # Errors
    /// Bounds that are not finite or not ordered; Embree out of memory.
    pub fn user(device: &Device, object: Arc<dyn UserGeometry>) -> Result<Self, Error> {
        let binding = Arc::new(Binding::new(object)?);
        let count = binding.len();
        let user = Arc::as_ptr(&binding).cast_mut().cast::<c_void>();
        let content = Content::User(binding);
        let geometry = Self::new(device, sys::RTC_GEOMETRY_TYPE_USER, Features::USER_GEOMETRY, content)?;
        let raw = geometry.raw();
        // SAFETY: RTC_GEOMETRY_TYPE_USER(3): all five properties are set before the geometry is committed. The user
        // data is the shared `Binding`, which stays where it is until the geometry has been released; the callbacks
        // read it through shared references only, and it is `Sync`.
        unsafe {
            sys::rtcSetGeometryUserPrimitiveCount(raw, count);
            sys::rtcSetGeometryUserData(raw, user);
            sys::rtcSetGeometryBoundsFunction(raw, Some(user::on_bounds), ptr::null_mut());
            sys::rtcSetGeometryIntersectFunction(raw, Some(user::on_intersect));
            sys::rtcSetGeometryOccludedFunction(raw, Some(user::on_occluded));
        }
        geometry.checked("rtcSetGeometryUserData")
    }

    /// A committed scene, placed by a transform that may mirror and scale. Any number of instances may share it.
    ///
    /// # Errors
    /// A scene that holds instances itself; a transform without a finite inverse; a scene of another device.
    pub fn instance(device: &Device, scene: Arc<CommittedScene>, world_from_object: Affine3A) -> Result<Self, Error> {
        if scene.features().contains(Features::INSTANCES) {
            return Err(Error::NestedInstance);
        }
        if !scene.is_of(&device.0) {
            return Err(Error::ForeignScene);
        }
        if !world_from_object.is_finite() || !world_from_object.inverse().is_finite() {
            return Err(Error::SingularTransform { transform: world_from_object });
        }
        let (raw_scene, features) = (scene.raw(), scene.features() | Features::INSTANCES);
        let geometry =
            Self::new(device, sys::RTC_GEOMETRY_TYPE_INSTANCE, features, Content::Instance { _scene: scene })?;
        let columns = world_from_object.to_cols_array();
        // SAFETY: RTC_GEOMETRY_TYPE_INSTANCE(3): the scene is committed and of the same device; rtcSetGeometryTransform
        // (3) copies the twelve numbers, columns first. `content` keeps the scene.
        unsafe {
            sys::rtcSetGeometryInstancedScene(geometry.raw(), raw_scene);
            let format = sys::RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR;
            sys::rtcSetGeometryTransform(geometry.raw(), 0, format, columns.as_ptr().cast());
        }
        geometry.checked("rtcSetGeometryTransform")
    }

    /// Makes the geometry take part in the filters of queries; for an instance, its scene's geometry has to.
    pub fn with_hit_filter(mut self) -> Self {
        match &self.content {
            Content::Instance { .. } => return self,
            Content::User(binding) => binding.filter(),
            Content::Triangles { .. } | Content::Curves { .. } => {}
        }
        self.features = self.features | Features::HIT_FILTER;
        // SAFETY: rtcSetGeometryEnableFilterFunctionFromArguments(3): the geometry is alive, owned and not committed.
        unsafe { sys::rtcSetGeometryEnableFilterFunctionFromArguments(self.raw(), true) };
        self
    }

    /// What this geometry adds to its scene.
    pub fn features(&self) -> Features {
        self.features
    }

    pub(crate) fn raw(&self) -> sys::RTCGeometry {
        self.raw.as_ptr()
    }

    pub(crate) fn is_of(&self, device: &Arc<Handle>) -> bool {
        Arc::ptr_eq(&self.device, device)
    }

    fn new(device: &Device, kind: sys::RTCGeometryType, features: Features, content: Content) -> Result<Self, Error> {
        let device = Arc::clone(&device.0);
        // SAFETY: rtcNewGeometry(3): the device is alive; the type is one of the header's.
        let raw = unsafe { sys::rtcNewGeometry(device.raw(), kind) };
        match NonNull::new(raw) {
            Some(raw) => Ok(Self { raw, features, content, device }),
            None => Err(device.refused("rtcNewGeometry")),
        }
    }

    /// Binds a buffer without copying it.
    ///
    /// # Safety
    /// rtcSetSharedGeometryBuffer(3): `count` items of `stride` bytes in the format begin at `data`, aligned to 4
    /// bytes, readable by 16-byte loads if they are vertices, unchanged and alive until the geometry is released.
    unsafe fn share(
        &self,
        kind: sys::RTCBufferType,
        format: sys::RTCFormat,
        data: *const c_void,
        stride: usize,
        count: usize,
    ) {
        // SAFETY: by this function's own contract.
        unsafe { sys::rtcSetSharedGeometryBuffer(self.raw(), kind, 0, format, data, 0, stride, count) };
    }

    fn checked(self, call: &'static str) -> Result<Self, Error> {
        self.device.check(call)?;
        Ok(self)
    }
}

impl fmt::Debug for Geometry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Geometry").field("features", &self.features).finish_non_exhaustive()
    }
}

impl Drop for Geometry {
    fn drop(&mut self) {
        // SAFETY: rtcReleaseGeometry(3): one reference is owned and given back once; `content` goes after it. Scenes
        // that hold the geometry keep this value and are released before it.
        unsafe { sys::rtcReleaseGeometry(self.raw()) };
    }
}
