//! What is kept of a tile's paths.

use filter::PathRecord;

use crate::film::Split;
use crate::integrator::{Cut, Recorder, Unrecorded};
use crate::math::Rgb;

/// Keeps what a path's recorder has seen.
pub trait Keeper: Default + Send {
    /// What looks at the paths.
    type Recorder: Recorder + Default;
    /// Takes the recorder of a finished path.
    fn keep(&mut self, recorder: &Self::Recorder, sample: Keep<'_>);
}

/// Where a path belongs.
pub struct Keep<'a> {
    /// The pixel's number.
    pub slot: u32,
    /// The path's number within the pixel.
    pub index: u64,
    /// Along the camera ray, scene RGB.
    pub radiance: Rgb,
    /// The same as the sensor takes it, film RGB.
    pub exposed: Rgb,
    /// Of the pixel filter.
    pub weight: f32,
    /// Share of the radiance that the sensor takes.
    pub exposure: f32,
    /// The pixel's sums for the filter.
    pub split: Option<&'a mut Split>,
}

/// Nothing is kept.
#[derive(Default)]
pub struct Nothing;

impl Keeper for Nothing {
    type Recorder = Unrecorded;
    #[inline]
    fn keep(&mut self, _: &Unrecorded, _: Keep<'_>) {}
}

/// Paths are kept for the filter.
#[derive(Default)]
pub struct Paths(pub Vec<PathRecord>);

impl Keeper for Paths {
    type Recorder = Cut;
    #[inline]
    fn keep(&mut self, cut: &Cut, sample: Keep<'_>) {
        self.0.extend(cut.record(sample.slot, sample.index, sample.weight * sample.exposure));
        if let Some(split) = sample.split {
            split.add(sample.index, sample.exposed, cut.prefix() * sample.exposure, sample.weight);
        }
    }
}
