//! What a part says of itself.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DMat4, DVec3, Mat3};
use serde::{Deserialize, Serialize};

use super::storable;
use crate::film::AovSet;
use crate::filtering::{Filtering, Surroundings};
use crate::frame::{FrameDescription, Samples};
use crate::integrator::Counters;
use crate::world::Bounds;

/// The first section.
#[derive(Serialize, Deserialize)]
pub(super) struct Header {
    pub version: String,
    number: i32,
    seed: u64,
    spp: u64,
    asked: [u64; 2],
    samples: Vec<[u64; 2]>,
    scene_hash: u64,
    resolution: [u32; 2],
    overscan: u32,
    pixels: [[u32; 2]; 2],
    aovs: Vec<String>,
    light_groups: Vec<String>,
    names: [Vec<String>; 2],
    filter: String,
    settings: Vec<(String, String)>,
    origin: [f64; 3],
    extent: f64,
    unit: f32,
    response: [f32; 9],
    camera_from_world: [f64; 16],
    ndc_from_world: Option<[f64; 16]>,
    filename: Option<PathBuf>,
    counters: [u64; 5],
    pub filter_paths: [u64; 2],
}

impl Header {
    /// Of a frame with these samples, that took so many rays and paths.
    pub fn new(description: &FrameDescription, samples: &Samples, counters: &Counters, filter_paths: [u64; 2]) -> Self {
        let FrameDescription { surroundings, bounds, .. } = description;
        Self {
            version: env!("CARGO_PKG_VERSION").into(),
            number: description.number,
            seed: description.seed,
            spp: description.spp,
            asked: [description.asked.start, description.asked.end],
            samples: samples.ranges().iter().map(|range| [range.start, range.end]).collect(),
            scene_hash: description.scene_hash,
            resolution: description.resolution,
            overscan: description.overscan,
            pixels: [bounds.min, bounds.max],
            aovs: description.aovs.iter().map(|aov| aov.name().into()).collect(),
            light_groups: texts(&description.light_groups),
            names: [0, 1].map(|named| texts(&description.names[named])),
            filter: description.filtering.name().into(),
            settings: description.filtering.settings().into_iter().map(|(key, value)| (key.into(), value)).collect(),
            origin: surroundings.anchor.origin.to_array(),
            extent: surroundings.anchor.extent,
            unit: surroundings.unit,
            response: surroundings.response.to_cols_array(),
            camera_from_world: description.camera_from_world.to_cols_array(),
            ndc_from_world: description.ndc_from_world.map(|matrix| matrix.to_cols_array()),
            filename: description.filename.clone(),
            counters: [
                counters.camera_rays,
                counters.closest_hit_rays,
                counters.shadow_rays,
                counters.scatterings,
                counters.rejected_samples,
            ],
            filter_paths,
        }
    }

    /// The frame of the part; `None` if there is none like this.
    pub fn description(&self) -> Option<FrameDescription> {
        let [min, max] = self.pixels;
        let size = [0, 1].map(|axis| u64::from(self.resolution[axis]) + 2 * u64::from(self.overscan));
        let within = |axis: usize| min[axis] < max[axis] && u64::from(max[axis]) <= size[axis];
        let small = size[0].checked_mul(size[1])? <= i32::MAX as u64;
        let mut aovs = AovSet::default();
        let known = self.aovs.iter().all(|name| aovs.insert(name));
        let mut filtering = Filtering::named(&self.filter)?;
        for (key, value) in &self.settings {
            // What has no meaning with the other settings is refused, and is not needed.
            let _ = filtering.set(key, value);
        }
        let filtering = filtering.settled(self.spp);
        let valid =
            filtering.validate().is_ok() && storable(&filtering).is_ok() && self.unit > 0.0 && self.unit.is_finite();
        (within(0) && within(1) && small && known && valid).then(|| FrameDescription {
            number: self.number,
            seed: self.seed,
            spp: self.spp,
            asked: self.asked[0]..self.asked[1],
            scene_hash: self.scene_hash,
            resolution: self.resolution,
            overscan: self.overscan,
            bounds: Bounds { min, max },
            aovs,
            light_groups: shared(&self.light_groups),
            names: [0, 1].map(|named| shared(&self.names[named])),
            filtering,
            surroundings: Surroundings {
                anchor: filter::Anchor { origin: DVec3::from_array(self.origin), extent: self.extent },
                unit: self.unit,
                response: Mat3::from_cols_array(&self.response),
            },
            origin: DVec3::ZERO,
            camera_from_world: DMat4::from_cols_array(&self.camera_from_world),
            ndc_from_world: self.ndc_from_world.map(|matrix| DMat4::from_cols_array(&matrix)),
            filename: self.filename.clone(),
        })
    }

    pub fn samples(&self) -> Option<Samples> {
        let mut samples = Samples::default();
        let mut valid = true;
        for &[start, end] in &self.samples {
            valid &= start < end && samples.insert(start..end).is_ok();
        }
        valid.then_some(samples)
    }

    pub fn counters(&self) -> Counters {
        let [camera_rays, closest_hit_rays, shadow_rays, scatterings, rejected_samples] = self.counters;
        Counters { camera_rays, closest_hit_rays, shadow_rays, scatterings, rejected_samples }
    }
}

fn texts(names: &[Arc<str>]) -> Vec<String> {
    names.iter().map(|name| name.to_string()).collect()
}

fn shared(names: &[String]) -> Vec<Arc<str>> {
    names.iter().map(|name| name.as_str().into()).collect()
}
