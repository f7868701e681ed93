//! Auxiliary outputs, and what the film sums up for them.

use std::sync::Arc;

use super::matte::{Named, RANKS};
use super::pixel::Taken;
use crate::integrator::Scattered;
use crate::light::Group;

/// An auxiliary output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aov {
    /// `albedo.{R,G,B}`: hemispherical reflectance at the first hit.
    Albedo,
    /// `N.{X,Y,Z}`: shading normal at the first hit, world space.
    Normal,
    /// `Ng.{X,Y,Z}`: geometric normal at the first hit, world space.
    GeometricNormal,
    /// `P.{X,Y,Z}`: position of the first hit, world space.
    Position,
    /// `depth.Z`: distance of the first hit from the camera ray's origin, through interfaces.
    Depth,
    /// `variance.{R,G,B}`: variance of one sample.
    Variance,
    /// `sampleCount`.
    SampleCount,
    /// `direct.{R,G,B}`: radiance that was scattered once; not filtered.
    Direct,
    /// `indirect.{R,G,B}`: radiance that was scattered more often.
    Indirect,
    /// `emission.{R,G,B}`: radiance that was not scattered: lights and the background.
    Emission,
    /// `light.GROUP.{R,G,B}`: radiance by group of lights; not filtered.
    Light,
    /// `denoise.albedo.{R,G,B}`: reflectance of the first surface that is no mirror and no smooth glass.
    DenoiseAlbedo,
    /// `denoise.N.{X,Y,Z}`: its shading normal, on the side that is seen, world space.
    DenoiseNormal,
    /// `error.{R,G,B}`: standard error of the pixel, film RGB.
    Error,
    /// `filter.blend`: the share of the pixel's own, unfiltered value in it: 0 where the filter was believed.
    FilterBlend,
    /// `filter.cell`: side of the finest cells that the filter put the pixel's paths into, world units; 0 for none.
    FilterCell,
    /// `CryptoObject00.{R,G,B,A}` and so on: coverage by objects' names.
    CryptoObject,
    /// `CryptoMaterial00.{R,G,B,A}` and so on: coverage by materials' names.
    CryptoMaterial,
}

impl Aov {
    /// All of them, in the order of their channels.
    pub const ALL: [Self; 18] = [
        Self::Albedo,
        Self::Normal,
        Self::GeometricNormal,
        Self::Position,
        Self::Depth,
        Self::Variance,
        Self::SampleCount,
        Self::Direct,
        Self::Indirect,
        Self::Emission,
        Self::Light,
        Self::DenoiseAlbedo,
        Self::DenoiseNormal,
        Self::Error,
        Self::FilterBlend,
        Self::FilterCell,
        Self::CryptoObject,
        Self::CryptoMaterial,
    ];

    /// The name that users give, which is that of its layer in a file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Albedo => "albedo",
            Self::Normal => "N",
            Self::GeometricNormal => "Ng",
            Self::Position => "P",
            Self::Depth => "depth",
            Self::Variance => "variance",
            Self::SampleCount => "sampleCount",
            Self::Direct => "direct",
            Self::Indirect => "indirect",
            Self::Emission => "emission",
            Self::Light => "light",
            Self::DenoiseAlbedo => "denoise.albedo",
            Self::DenoiseNormal => "denoise.N",
            Self::Error => "error",
            Self::FilterBlend => "filter.blend",
            Self::FilterCell => "filter.cell",
            Self::CryptoObject => "CryptoObject",
            Self::CryptoMaterial => "CryptoMaterial",
        }
    }

    /// Whether its channels hold ids, of which every bit counts.
    pub fn is_matte(self) -> bool {
        matches!(self, Self::CryptoObject | Self::CryptoMaterial)
    }

    /// Names of its channels in a file.
    pub fn channels(self, groups: &[Arc<str>]) -> Vec<String> {
        let name = self.name();
        let of = |layer: &str, components: &str| components.chars().map(|c| format!("{layer}.{c}")).collect::<Vec<_>>();
        match self {
            Self::Normal | Self::GeometricNormal | Self::Position | Self::DenoiseNormal => of(name, "XYZ"),
            Self::Depth => of(name, "Z"),
            Self::SampleCount | Self::FilterBlend | Self::FilterCell => vec![name.into()],
            // Two ranks a layer: id and coverage, id and coverage.
            Self::CryptoObject | Self::CryptoMaterial => {
                (0..RANKS / 2).flat_map(|layer| of(&format!("{name}{layer:02}"), "RGBA")).collect()
            }
            Self::Light => groups.iter().flat_map(|group| of(&format!("{name}.{group}"), "RGB")).collect(),
            Self::Albedo
            | Self::Variance
            | Self::Direct
            | Self::Indirect
            | Self::Emission
            | Self::DenoiseAlbedo
            | Self::Error => of(name, "RGB"),
        }
    }

    /// What its channels show.
    fn shown(self, groups: &[Arc<str>]) -> Vec<Shown> {
        let sum = |layer| vec![Shown::Sum(layer)];
        match self {
            Self::Albedo => sum(Layer::Albedo),
            Self::Normal => sum(Layer::Normal),
            Self::GeometricNormal => sum(Layer::GeometricNormal),
            Self::Position => sum(Layer::Position),
            Self::Depth => sum(Layer::Depth),
            Self::Variance => sum(Layer::Squares),
            Self::SampleCount => vec![Shown::Count],
            Self::Direct => sum(Layer::Class(Scattered::Once)),
            Self::Indirect => sum(Layer::Class(Scattered::Often)),
            Self::Emission => sum(Layer::Class(Scattered::Never)),
            Self::Light => (0..groups.len()).map(|group| Shown::Sum(Layer::Light(Group(group as u16)))).collect(),
            Self::DenoiseAlbedo => sum(Layer::DenoiseAlbedo),
            Self::DenoiseNormal => sum(Layer::DenoiseNormal),
            Self::Error => vec![Shown::Error],
            Self::FilterBlend => vec![Shown::Filter(FilterMap::Blend)],
            Self::FilterCell => vec![Shown::Filter(FilterMap::Cell)],
            Self::CryptoObject => vec![Shown::Matte(Named::Object)],
            Self::CryptoMaterial => vec![Shown::Matte(Named::Material)],
        }
    }
}

/// What some channels show of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shown {
    /// A sum, in one or three channels.
    Sum(Layer),
    /// The number of samples.
    Count,
    /// The standard error.
    Error,
    /// What the filter did.
    Filter(FilterMap),
    /// Ids and coverages, in two channels a rank.
    Matte(Named),
}

/// What a filter tells of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilterMap {
    /// See [`Aov::FilterBlend`].
    Blend,
    /// See [`Aov::FilterCell`].
    Cell,
}

/// What a film shows besides radiance and coverage.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outputs {
    /// Auxiliary outputs.
    pub aovs: AovSet,
    /// Names of the groups of lights, by their numbers.
    pub groups: Vec<Arc<str>>,
}

impl From<AovSet> for Outputs {
    fn from(aovs: AovSet) -> Self {
        Self { aovs, groups: Vec::new() }
    }
}

impl Outputs {
    /// Names of the auxiliary channels, in their order.
    pub fn channels(&self) -> impl Iterator<Item = String> {
        self.aovs.iter().flat_map(|aov| aov.channels(&self.groups))
    }

    /// What these channels show, in their order.
    pub(super) fn shown(&self) -> Vec<Shown> {
        self.aovs.iter().flat_map(|aov| aov.shown(&self.groups)).collect()
    }

    /// What names are kept of.
    pub(super) fn mattes(&self) -> Vec<Named> {
        let shown = self.shown().into_iter();
        let mattes = shown.filter_map(|shown| match shown {
            Shown::Matte(named) => Some(named),
            Shown::Sum(_) | Shown::Count | Shown::Error | Shown::Filter(_) => None,
        });
        mattes.collect()
    }

    /// What is summed up for them. A `filtered` film keeps what its filter needs.
    pub(super) fn layers(&self, filtered: bool) -> Vec<Layer> {
        let shown = self.shown().into_iter();
        let layers = shown.filter_map(|shown| match shown {
            Shown::Sum(layer) => Some(layer),
            Shown::Count | Shown::Error | Shown::Filter(_) | Shown::Matte(_) => None,
        });
        layers.chain(filtered.then_some(Layer::Prefix)).collect()
    }
}

/// A set of auxiliary outputs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AovSet(u32);

impl AovSet {
    /// Every name that [`Self::insert`] knows.
    pub fn names() -> impl Iterator<Item = &'static str> {
        Aov::ALL.into_iter().map(Aov::name)
    }

    /// All that a frame's sums give: not [`Aov::Error`], for which a filtered frame must be watched while it is rendered.
    pub fn all() -> Self {
        Aov::ALL.into_iter().filter(|aov| *aov != Aov::Error).collect()
    }

    /// What pbrt's `gbuffer` asks for.
    pub fn gbuffer() -> Self {
        Aov::ALL.into_iter().take(7).collect()
    }

    /// Those of both sets.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Adds the output `name`; false if there is none of that name.
    pub fn insert(&mut self, name: &str) -> bool {
        let known = Aov::ALL.into_iter().find(|aov| aov.name() == name);
        known.map(|aov| self.0 |= 1 << aov as u32).is_some()
    }

    /// Whether an output is among them.
    pub fn contains(self, aov: Aov) -> bool {
        self.0 >> aov as u32 & 1 == 1
    }

    /// Those of the set, in the order of their channels.
    pub fn iter(self) -> impl Iterator<Item = Aov> {
        Aov::ALL.into_iter().filter(move |aov| self.contains(*aov))
    }
}

impl FromIterator<Aov> for AovSet {
    fn from_iter<I: IntoIterator<Item = Aov>>(aovs: I) -> Self {
        Self(aovs.into_iter().fold(0, |set, aov| set | 1 << aov as u32))
    }
}

/// What a film sums up per pixel besides radiance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// Σ albedo of first hits.
    Albedo,
    /// Σ shading normal.
    Normal,
    /// Σ geometric normal.
    GeometricNormal,
    /// Σ position.
    Position,
    /// Σ distance, in the first component.
    Depth,
    /// Σ (w L)², film RGB.
    Squares,
    /// Σ w L of the light that the frame's filter does not touch, scene RGB.
    Prefix,
    /// Σ w L of a class of light, film RGB.
    Class(Scattered),
    /// Σ w L of a group of lights, film RGB.
    Light(Group),
    /// Σ albedo of first rough surfaces.
    DenoiseAlbedo,
    /// Σ their shading normals.
    DenoiseNormal,
}

impl Layer {
    /// Whether it is of the first hit.
    pub fn first_hit(self) -> bool {
        match self {
            Self::Albedo | Self::Normal | Self::GeometricNormal | Self::Position | Self::Depth => true,
            Self::Squares
            | Self::Prefix
            | Self::Class(_)
            | Self::Light(_)
            | Self::DenoiseAlbedo
            | Self::DenoiseNormal => false,
        }
    }

    /// Whether paths must be watched for it.
    pub fn aside(self) -> bool {
        matches!(self, Self::Class(_) | Self::Light(_) | Self::DenoiseAlbedo | Self::DenoiseNormal)
    }

    /// What a sample adds.
    #[inline]
    pub(super) fn term(self, taken: &Taken<'_>) -> [f64; 3] {
        let vector = match self {
            Self::Position => return taken.first.p.to_array(),
            Self::Albedo => taken.first.albedo,
            Self::Normal => taken.first.ns,
            Self::GeometricNormal => taken.first.ng,
            Self::Depth => glam::Vec3::new(taken.first.depth, 0.0, 0.0),
            Self::Squares => {
                let value = taken.value();
                return (value * value).to_array();
            }
            Self::Prefix => taken.prefix * taken.weight,
            Self::Class(class) => taken.seen(|seen| seen.exposed(seen.aside.class(class)) * taken.weight),
            Self::Light(group) => taken.seen(|seen| seen.exposed(seen.aside.group(group)) * taken.weight),
            Self::DenoiseAlbedo => taken.seen(|seen| seen.aside.feature().albedo),
            Self::DenoiseNormal => taken.seen(|seen| seen.aside.feature().ns),
        };
        vector.as_dvec3().to_array()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_known_and_no_other() {
        for aov in Aov::ALL {
            let mut set = AovSet::default();
            assert!(set.insert(aov.name()) && set.contains(aov));
            assert_eq!(set.iter().collect::<Vec<_>>(), [aov]);
            let channels = aov.channels(&["key".into()]);
            assert!(!channels.is_empty() && channels.iter().all(|channel| channel.starts_with(aov.name())));
            assert!(aov as usize >= 7 || AovSet::gbuffer().contains(aov));
        }
        assert!(!AovSet::default().insert("Depth"));
        assert_eq!((AovSet::all().iter().count(), AovSet::gbuffer().iter().count()), (Aov::ALL.len() - 1, 7));
    }
}
