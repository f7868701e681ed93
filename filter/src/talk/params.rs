//! The knobs of the talk.

use std::fmt;

/// How wide cells are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LevelOfDetail {
    /// The same everywhere: `side` in world units.
    Fixed {
        /// Side of a cell, world units.
        side: f32,
    },
    /// By distance d to the eye: `side` · 2^⌊log₂ d⌋.
    Distance {
        /// Side of a cell at distance 1, world units.
        side: f32,
    },
    /// By the path's footprint f: `side` · 2^⌊log₂ f⌋. Behind mirrors and glass it is the length of the path that counts.
    Footprint {
        /// Side of a cell in footprints, rounded down to a power of two of them.
        side: f32,
    },
}

/// How positions are jittered in the tangent plane. Radii are in sides of the cell.
///
/// A path deposits and looks up under one jittered key, so what it sees is the mean of a kernel: on a plane along the grid
/// with squares of radius ½ a cubic B-spline, of variance h²/3 an axis; without jitter a tent of variance h²/6 locked to
/// the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Jitter {
    /// Not at all.
    None,
    /// Uniformly in a square of half side `radius`.
    Square {
        /// Half the side of the square.
        radius: f32,
    },
    /// Uniformly in a disk.
    Disk {
        /// Its radius.
        radius: f32,
    },
}

/// Which keys make room in a full run of slots.
///
/// Every resident has an age: the passes in a row before this one in which no path had its key. One that a path has in this
/// pass stays. Else a new key counts as `patience` old; the older goes, at equal age the one with the larger hash, which is
/// one at random.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Eviction {
    /// Residents stay for good; what finds no room is unfiltered.
    Never,
    /// The least recently used.
    LeastRecent {
        /// Passes that a resident may miss before a new key may take its slot, 1 to 126.
        patience: u32,
    },
    /// As by least recent use, but a resident ages the slower the more it was used: its age is divided by
    /// ⌊log₂(n + 1)⌋ with n its deposits so far. What many paths found over a long time survives a look aside.
    Health {
        /// As above.
        patience: u32,
    },
}

/// When a path reads its cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// After the pass that it is of: nothing is remembered of paths. With static accumulation the first passes then read
    /// fewer contributions than the last.
    EveryPass,
    /// After all passes. It takes 16 to 28 bytes for each lobe of each path, and cells that stay.
    AtTheEnd,
}

/// Settings of the talk. The defaults are what the talk says where it does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    /// Side of cells. Default: 8 footprints, with which a prototype erred least at 16 samples a pixel among 8, 16 and 32.
    pub level: LevelOfDetail,
    /// Jitter of positions. Default: squares of half a cell, the least that lets no border show: every place is as likely
    /// to fall on either side of a border near it.
    pub jitter: Jitter,
    /// Bins of the normal along each edge of a cube's six faces; 0: not in the key. Default 3: bins of 30°, and walls
    /// along the axes, the most frequent, fall on the middle of one.
    pub normal_bins: u32,
    /// Jitter of the normal, as half the side of a square in bins. Default 0.49: ½, for the reason that positions have
    /// it, less what the rounding of a record's normals could carry from the middle of a bin, where walls are, to the next.
    pub normal_jitter: f32,
    /// Whether vertices with different [`crate::Vertex::surface`]s are told apart. Default: yes, as the record promises.
    pub surface: bool,
    /// Whether glossy lobes are told apart by [`crate::Vertex::bin`], their direction. Default: yes.
    pub direction: bool,
    /// Whether diffuse and glossy lobes are told apart. Default: yes.
    pub layers: bool,
    /// Sides of diffuse cells over those of glossy ones, at least 1. Default 2.
    pub glossy_finer: f32,
    /// Levels to which each path deposits, from its own up, at most [`Params::MOST_LOOKUPS`]. It reads the finest in which
    /// `enough` contributions came together and whose mean has at most the variance `relative_variance`; if there is none,
    /// the coarsest. Default 1: no choice.
    pub lookups: u32,
    /// Contributions that make a level trusted: level of detail by the density of rays. Default 16, with which the error
    /// of the mean of contributions that vary by their own size is 25 %.
    pub enough: u32,
    /// Largest variance of a trusted mean over its square, by luminance. Default: infinite, not asked for.
    pub relative_variance: f32,
    /// Slots that a key may look at, at least 1 and at most 255. Default 8: at half load one key in 200 finds no slot.
    pub probes: u32,
    /// Slots over rays of a pass. Default 1.
    pub table_size: f32,
    /// Bits of the verification word that are hashed, 1 to 57. Default 57: the rest is the priority.
    pub verification_bits: u32,
    /// None: contributions of all frames count alike and averages converge as long as nothing moves. Some(α): an average
    /// is α × that of the frames before + (1 − α) × that of this frame. Default: none.
    /// Frames that count alike must be given to the same table; the renderer begins each with an empty one unless this is set.
    pub temporal: Option<f32>,
    /// Which keys make room. Default: never any, for averages that converge.
    pub eviction: Eviction,
    /// When paths read. Default: every pass.
    pub reading: Reading,
    /// Radiance of the order of the frame's mean: sums count in 2⁻³⁰ of its power of two. Default 1.
    pub unit: f32,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            level: LevelOfDetail::Footprint { side: 8.0 },
            jitter: Jitter::Square { radius: 0.5 },
            normal_bins: 3,
            normal_jitter: 0.49,
            surface: true,
            direction: true,
            layers: true,
            glossy_finer: 2.0,
            lookups: 1,
            enough: 16,
            relative_variance: f32::INFINITY,
            probes: 8,
            table_size: 1.0,
            verification_bits: Self::HASHED_BITS,
            temporal: None,
            eviction: Eviction::Never,
            reading: Reading::EveryPass,
            unit: 1.0,
        }
    }
}

/// A setting that makes no sense: what it is, and what it may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParamsError(&'static str);

impl fmt::Display for ParamsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
}

impl std::error::Error for ParamsError {}

impl Params {
    /// Most levels that a path may deposit to.
    pub const MOST_LOOKUPS: u32 = 4;

    /// Bits of a verification word below the priority.
    pub(crate) const HASHED_BITS: u32 = 57;

    /// Whether all is within bounds.
    ///
    /// # Errors
    /// The first setting that is not.
    pub fn validate(&self) -> Result<(), ParamsError> {
        let (LevelOfDetail::Fixed { side } | LevelOfDetail::Distance { side } | LevelOfDetail::Footprint { side }) =
            self.level;
        let radius = match self.jitter {
            Jitter::None => 0.0,
            Jitter::Square { radius } | Jitter::Disk { radius } => radius,
        };
        let patience = match self.eviction {
            Eviction::Never => 1,
            Eviction::LeastRecent { patience } | Eviction::Health { patience } => patience,
        };
        let rules = [
            (positive(side), "the side of cells must be positive"),
            ((0.0..=8.0).contains(&radius), "the radius of the jitter must be 0 to 8 cells"),
            (self.normal_bins <= 255, "there can be at most 255 bins of the normal"),
            ((0.0..=4.0).contains(&self.normal_jitter), "the jitter of the normal must be 0 to 4 bins"),
            (
                self.glossy_finer >= 1.0 && positive(self.glossy_finer),
                "glossy cells must not be wider than diffuse ones",
            ),
            (self.glossy_finer == 1.0 || self.layers, "glossy cells can be finer only if the layer is in the key"),
            ((1..=Self::MOST_LOOKUPS).contains(&self.lookups), "the number of lookups must be 1 to 4"),
            (self.relative_variance >= 0.0, "the relative variance must not be negative"),
            ((1..=255).contains(&self.probes), "the number of probes must be 1 to 255"),
            (positive(self.table_size), "the size of the table must be positive"),
            (
                (1..=Self::HASHED_BITS).contains(&self.verification_bits),
                "the verification word must have 1 to 57 hashed bits",
            ),
            (self.temporal.is_none_or(|alpha| (0.0..1.0).contains(&alpha)), "alpha must be at least 0 and less than 1"),
            ((1..=126).contains(&patience), "the patience must be 1 to 126 passes"),
            (
                self.reading == Reading::EveryPass || self.eviction == Eviction::Never,
                "reading at the end needs cells that stay: no eviction",
            ),
            (positive(self.unit) && self.unit.is_normal(), "the unit of radiance must be positive"),
        ];
        match rules.iter().find(|(kept, _)| !kept) {
            Some((_, message)) => Err(ParamsError(message)),
            None => Ok(()),
        }
    }

    /// Whether cells need the sum of squares.
    pub(crate) fn needs_squares(&self) -> bool {
        self.lookups > 1 && self.relative_variance < f32::INFINITY
    }
}

fn positive(x: f32) -> bool {
    x > 0.0 && x.is_finite()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_valid() {
        assert_eq!(Params::default().validate(), Ok(()));
    }

    #[test]
    fn every_bound_is_checked() {
        let ok = Params::default();
        let bad = [
            Params { level: LevelOfDetail::Distance { side: 0.0 }, ..ok },
            Params { level: LevelOfDetail::Footprint { side: f32::NAN }, ..ok },
            Params { jitter: Jitter::Disk { radius: -0.5 }, ..ok },
            Params { normal_bins: 256, ..ok },
            Params { normal_jitter: f32::NAN, ..ok },
            Params { glossy_finer: 0.5, ..ok },
            Params { layers: false, ..ok },
            Params { lookups: 0, ..ok },
            Params { lookups: 5, ..ok },
            Params { relative_variance: f32::NAN, ..ok },
            Params { probes: 0, ..ok },
            Params { table_size: f32::INFINITY, ..ok },
            Params { verification_bits: 58, ..ok },
            Params { temporal: Some(1.0), ..ok },
            Params { eviction: Eviction::LeastRecent { patience: 0 }, ..ok },
            Params { eviction: Eviction::Health { patience: 127 }, ..ok },
            Params { reading: Reading::AtTheEnd, eviction: Eviction::LeastRecent { patience: 1 }, ..ok },
            Params { unit: 0.0, ..ok },
        ];
        for params in bad {
            assert!(params.validate().is_err(), "{params:?}");
        }
        let message = Params { probes: 0, ..ok }.validate().unwrap_err().to_string();
        assert_eq!(message, "the number of probes must be 1 to 255");
    }
}
