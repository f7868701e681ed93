//! Auxiliary outputs, and what the film sums up for them.

use super::pixel::Taken;

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
    /// `depth.Z`: distance of the first hit from the camera ray's origin.
    Depth,
    /// `variance.{R,G,B}`: variance of one sample.
    Variance,
    /// `sampleCount`.
    SampleCount,
}

impl Aov {
    /// All of them, in the order of their channels.
    pub const ALL: [Self; 7] = [
        Self::Albedo,
        Self::Normal,
        Self::GeometricNormal,
        Self::Position,
        Self::Depth,
        Self::Variance,
        Self::SampleCount,
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
        }
    }

    /// Names of its channels in a file.
    pub fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Albedo => &["albedo.R", "albedo.G", "albedo.B"],
            Self::Normal => &["N.X", "N.Y", "N.Z"],
            Self::GeometricNormal => &["Ng.X", "Ng.Y", "Ng.Z"],
            Self::Position => &["P.X", "P.Y", "P.Z"],
            Self::Depth => &["depth.Z"],
            Self::Variance => &["variance.R", "variance.G", "variance.B"],
            Self::SampleCount => &["sampleCount"],
        }
    }

    /// What is summed up for it, besides what every film sums.
    pub fn layer(self) -> Option<Layer> {
        match self {
            Self::Albedo => Some(Layer::Albedo),
            Self::Normal => Some(Layer::Normal),
            Self::GeometricNormal => Some(Layer::GeometricNormal),
            Self::Position => Some(Layer::Position),
            Self::Depth => Some(Layer::Depth),
            Self::Variance => Some(Layer::Squares),
            Self::SampleCount => None,
        }
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

    /// All of them.
    pub fn all() -> Self {
        Aov::ALL.into_iter().collect()
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
}

impl Layer {
    /// Whether it is of the first hit.
    pub fn first_hit(self) -> bool {
        match self {
            Self::Albedo | Self::Normal | Self::GeometricNormal | Self::Position | Self::Depth => true,
            Self::Squares | Self::Prefix => false,
        }
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
            assert!(aov.channels().iter().all(|channel| channel.split('.').next() == Some(aov.name())));
        }
        assert!(!AovSet::default().insert("Depth"));
        assert_eq!(AovSet::all().iter().count(), Aov::ALL.len());
    }
}
