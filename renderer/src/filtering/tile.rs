//! What is kept of a tile's paths.

use filter::PathRecord;

use crate::integrator::{Aside, Cut, Ids, Recorder, Unrecorded};
use crate::math::Rgb;

/// Keeps what a path's recorder has seen.
pub trait Keeper: Send {
    /// What looks at the paths.
    type Recorder: Recorder;
    /// What looks at one path.
    fn recorder(&self) -> Self::Recorder;
    /// Takes the recorder of a finished path; the light in it that the filter does not touch, scene RGB.
    fn keep(&mut self, recorder: &Self::Recorder, sample: Keep) -> Rgb;
    /// What a recorder has seen besides, if anybody wants to know.
    #[inline]
    fn aside<'r>(&self, _recorder: &'r Self::Recorder) -> Option<&'r Aside<'r>> {
        None
    }
}

/// Keeps what another keeper does, and looks aside.
pub struct Watching<'w, K> {
    /// The other one.
    pub keeper: K,
    /// How many groups of lights are told apart.
    pub groups: usize,
    /// Ids of names, if they are wanted.
    pub ids: Option<&'w Ids>,
}

impl<'w, K: Keeper> Keeper for Watching<'w, K> {
    type Recorder = (K::Recorder, Aside<'w>);
    #[inline]
    fn recorder(&self) -> Self::Recorder {
        (self.keeper.recorder(), Aside::new(self.groups, self.ids))
    }
    #[inline]
    fn keep(&mut self, recorder: &Self::Recorder, sample: Keep) -> Rgb {
        self.keeper.keep(&recorder.0, sample)
    }
    #[inline]
    fn aside<'r>(&self, recorder: &'r Self::Recorder) -> Option<&'r Aside<'r>> {
        Some(&recorder.1)
    }
}

/// Where a path belongs.
#[derive(Clone, Copy, Debug)]
pub struct Keep {
    /// The pixel's number.
    pub slot: u32,
    /// The path's number within the pixel.
    pub index: u64,
    /// Along the camera ray, scene RGB; black if it was rejected.
    pub radiance: Rgb,
    /// Of the pixel filter.
    pub weight: f32,
    /// Of its radiance, what the sensor takes: less than 1 only if it clamps.
    pub share: f32,
}

/// Nothing is kept.
#[derive(Default)]
pub struct Nothing;

impl Keeper for Nothing {
    type Recorder = Unrecorded;
    #[inline]
    fn recorder(&self) -> Unrecorded {
        Unrecorded
    }
    #[inline]
    fn keep(&mut self, _: &Unrecorded, _: Keep) -> Rgb {
        Rgb::ZERO
    }
}

/// Which vertex of a path others share: the first of those that are no mirror and no smooth glass, or a later one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Selection {
    /// The first, the primary one: what is seen, straight on or in mirrors.
    #[default]
    Primary,
    /// The first that is not primary.
    Secondary,
    /// The second that is not primary.
    Tertiary,
}

/// Paths are kept for the filter.
#[derive(Debug, Default)]
pub struct Paths {
    /// Those with a selected vertex.
    pub records: Vec<PathRecord>,
    pub(super) selection: Selection,
    /// How many there will be at most.
    pub(super) most: usize,
}

impl Paths {
    /// No path yet.
    pub fn new(selection: Selection) -> Self {
        Self { records: Vec::new(), selection, most: 0 }
    }
}

impl Keeper for Paths {
    type Recorder = Cut;
    #[inline]
    fn recorder(&self) -> Cut {
        Cut::after(self.selection as u8)
    }
    #[inline]
    fn keep(&mut self, cut: &Cut, sample: Keep) -> Rgb {
        // By the thread that has paths to keep: what it frees it can use again.
        if self.records.capacity() == self.records.len() {
            self.records.reserve_exact(self.most);
        }
        self.records.extend(cut.record(sample.slot, sample.index, sample.weight, sample.share));
        cut.prefix()
    }
}
