//! Paths from the camera to the lights.

mod aside;
mod direct;
mod path;
mod queries;
mod record;
mod recorder;
mod roulette;

pub use aside::{Aside, Feature, Ids, Scattered};
pub use path::{Path, trace};
pub use queries::{AlphaTested, Opaque, Queries, Recorded, Recording};
pub use record::{FirstHit, Sample};
pub use recorder::{Cut, Recorder, Unrecorded};

/// How many rays of each kind were traced, and what became of samples. Sums over pixels: the same for any threads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Paths begun.
    pub camera_rays: u64,
    /// Queries for the closest hit, camera rays included.
    pub closest_hit_rays: u64,
    /// Queries for any hit.
    pub shadow_rays: u64,
    /// Scattering events.
    pub scatterings: u64,
    /// Samples that came out NaN, infinite or negative, and count as black.
    pub rejected_samples: u64,
}

impl std::ops::AddAssign for Counters {
    fn add_assign(&mut self, other: Self) {
        self.camera_rays += other.camera_rays;
        self.closest_hit_rays += other.closest_hit_rays;
        self.shadow_rays += other.shadow_rays;
        self.scatterings += other.scatterings;
        self.rejected_samples += other.rejected_samples;
    }
}
