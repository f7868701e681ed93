//! Scenes: built by one owner, then committed and shared.

use crate::device::{Device, Handle};
use crate::{Error, Features, Geometry};
use embree_sys as sys;
use glam::Vec3;
use std::fmt;
use std::ptr::NonNull;
use std::sync::Arc;

/// How a scene's acceleration structure is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneOptions {
    /// Watertight traversal: no ray slips between two triangles that share an edge.
    pub robust: bool,
    /// Time spent on the build.
    pub quality: BuildQuality,
    /// Less memory for slower queries: the structure refers to the vertices instead of copying them.
    pub compact: bool,
}

impl Default for SceneOptions {
    fn default() -> Self {
        Self { robust: true, quality: BuildQuality::Medium, compact: false }
    }
}

/// Quality of an acceleration structure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BuildQuality {
    /// Binned surface area heuristic.
    #[default]
    Medium,
    /// With spatial splits: a slower build and more memory for faster queries where triangles are long.
    High,
}

/// A scene that is being put together.
///
/// It has one owner, cannot be shared between threads, and is consumed by [`commit`](Self::commit):
///
/// ```compile_fail,E0382
/// # use embree::*;
/// # fn late(device: &Device, geometry: Geometry) -> Result<(), Error> {
/// let mut builder = SceneBuilder::new(device, SceneOptions::default());
/// let scene = builder.commit()?;
/// builder.attach(geometry); // the builder is gone
/// # Ok(())
/// # }
/// ```
///
/// ```compile_fail,E0277
/// # use embree::*;
/// fn shared_between_threads<T: Sync>(_: &T) {}
/// # fn share(device: &Device) {
/// shared_between_threads(&SceneBuilder::new(device, SceneOptions::default()));
/// # }
/// ```
pub struct SceneBuilder {
    options: SceneOptions,
    geometries: Vec<Geometry>,
    device: Arc<Handle>,
}

impl SceneBuilder {
    /// An empty scene.
    pub fn new(device: &Device, options: SceneOptions) -> Self {
        Self { options, geometries: Vec::new(), device: Arc::clone(&device.0) }
    }

    /// Adds a geometry and returns its number: 0, 1, 2, … in the order of the calls.
    ///
    /// # Panics
    /// With 2^32 geometries.
    pub fn attach(&mut self, geometry: Geometry) -> u32 {
        let number = u32::try_from(self.geometries.len()).expect("fewer than 2^32 geometries");
        self.geometries.push(geometry);
        number
    }

    /// Builds the acceleration structure and closes the scene for good.
    ///
    /// # Errors
    /// A geometry of another device; Embree out of memory.
    pub fn commit(mut self) -> Result<CommittedScene, Error> {
        // The scene keeps the geometries; spare capacity would be kept with them.
        self.geometries.shrink_to_fit();
        if let Some(geometry) = self.geometries.iter().position(|geometry| !geometry.is_of(&self.device)) {
            return Err(Error::ForeignGeometry { geometry: geometry as u32 }); // `attach` has checked the number
        }
        let features = self.geometries.iter().fold(Features::NONE, |all, one| all | one.features());
        // SAFETY: rtcNewScene(3): the device is alive.
        let raw = unsafe { sys::rtcNewScene(self.device.raw()) };
        let Some(raw) = NonNull::new(raw) else { return Err(self.device.refused("rtcNewScene")) };
        let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let scene = CommittedScene { raw, features, bounds: empty, geometries: self.geometries, device: self.device };
        scene.fill(self.options)
    }
}

/// A scene that only answers queries, from any number of threads at once.
///
/// Nothing of it can be changed any more:
///
/// ```compile_fail,E0599
/// # use embree::*;
/// # fn change(scene: CommittedScene, geometry: Geometry) {
/// scene.attach(geometry); // there is no such method
/// # }
/// ```
pub struct CommittedScene {
    raw: NonNull<sys::RTCSceneTy>,
    features: Features,
    bounds: (Vec3, Vec3),
    // Released after the scene: Embree reads their buffers and calls their callbacks as long as it exists.
    geometries: Vec<Geometry>,
    device: Arc<Handle>,
}

// SAFETY: rtcCommitScene(3) asks that modification, commit and tracing never overlap. A value of this type exists for
// others only after `SceneBuilder::commit` is through; its methods only trace, and it owns the geometries, through
// which nothing can be called any more. User geometry is `Send + Sync`, shared buffers are immutable.
unsafe impl Send for CommittedScene {}
// SAFETY: as above.
unsafe impl Sync for CommittedScene {}

impl CommittedScene {
    /// Lower and upper corner of a box around all that the scene holds; for an empty scene, +∞ and −∞.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.bounds
    }

    /// What the scene and its instanced scenes hold, which is what every query is told.
    #[inline]
    pub fn features(&self) -> Features {
        self.features
    }

    /// Whether any geometry, instanced or not, takes part in the filters of queries.
    #[inline]
    pub fn has_filtered_geometry(&self) -> bool {
        self.features.contains(Features::HIT_FILTER)
    }

    #[inline]
    pub(crate) fn raw(&self) -> sys::RTCScene {
        self.raw.as_ptr()
    }

    pub(crate) fn is_of(&self, device: &Arc<Handle>) -> bool {
        Arc::ptr_eq(&self.device, device)
    }

    /// The only modification in a scene's life: attaches the geometries, sets the options and commits.
    fn fill(mut self, options: SceneOptions) -> Result<Self, Error> {
        let (raw, flags) = (self.raw(), self.flags(options));
        for (number, geometry) in self.geometries.iter().enumerate() {
            // SAFETY: rtcCommitGeometry(3), rtcAttachGeometryByID(3): geometry and scene are of the same device and in
            // this thread's hands alone; the numbers are unused and dense.
            unsafe {
                sys::rtcCommitGeometry(geometry.raw());
                sys::rtcAttachGeometryByID(raw, geometry.raw(), number as u32);
            }
        }
        self.device.check("rtcAttachGeometryByID")?;
        let mut bounds = sys::RTCBounds {
            lower_x: 0.0,
            lower_y: 0.0,
            lower_z: 0.0,
            align0: 0.0,
            upper_x: 0.0,
            upper_y: 0.0,
            upper_z: 0.0,
            align1: 0.0,
        };
        // SAFETY: rtcSetSceneFlags(3), rtcSetSceneBuildQuality(3), rtcCommitScene(3): nobody else has the scene yet.
        // All buffers are bound and instanced scenes committed. rtcGetSceneBounds(3): called after the commit, into an
        // aligned place.
        unsafe {
            sys::rtcSetSceneFlags(raw, flags);
            sys::rtcSetSceneBuildQuality(raw, options.quality.raw());
            sys::rtcCommitScene(raw);
            sys::rtcGetSceneBounds(raw, &mut bounds);
        }
        self.device.check("rtcCommitScene")?;
        self.bounds = (
            Vec3::new(bounds.lower_x, bounds.lower_y, bounds.lower_z),
            Vec3::new(bounds.upper_x, bounds.upper_y, bounds.upper_z),
        );
        Ok(self)
    }

    fn flags(&self, options: SceneOptions) -> sys::RTCSceneFlags {
        let flag = |wanted, flag| if wanted { flag } else { sys::RTC_SCENE_FLAG_NONE };
        flag(options.robust, sys::RTC_SCENE_FLAG_ROBUST)
            | flag(options.compact, sys::RTC_SCENE_FLAG_COMPACT)
            | flag(self.has_filtered_geometry(), sys::RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS)
    }
}

impl Drop for CommittedScene {
    fn drop(&mut self) {
        // SAFETY: rtcReleaseScene(3): one reference is owned and given back once; instances that refer to the scene
        // hold an `Arc` of this value. The geometries go after it.
        unsafe { sys::rtcReleaseScene(self.raw()) };
    }
}

impl fmt::Debug for CommittedScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut debug = f.debug_struct("CommittedScene");
        debug.field("features", &self.features).field("bounds", &self.bounds);
        debug.field("geometries", &self.geometries.len()).finish()
    }
}

impl BuildQuality {
    fn raw(self) -> sys::RTCBuildQuality {
        match self {
            Self::Medium => sys::RTC_BUILD_QUALITY_MEDIUM,
            Self::High => sys::RTC_BUILD_QUALITY_HIGH,
        }
    }
}
