//! The image that a film shows.

use super::aov::Shown;
use super::matte::RANKS;
use super::{Aov, Film, FilterMap, Layer, Outputs};
use crate::math::Rgb;
use crate::world::Bounds;

/// One channel of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// EXR name.
    pub name: String,
    /// Stored in 32 bits rather than 16.
    pub float: bool,
}

/// Pixels by channel, row by row from the top: `values[(y * width + x) * channels + c]` over the film's bounds.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Width and height of the whole frame.
    pub resolution: [u32; 2],
    /// Column and row that are the frame's first.
    pub overscan: u32,
    /// The pixels that there are.
    pub bounds: Bounds,
    /// Channels, in order.
    pub channels: Vec<Channel>,
    /// Values.
    pub values: Vec<f32>,
    /// Pixels that a filter's negative lobes or the sensor's response had made negative, and that are written as 0.
    pub clamped_negative: u64,
}

impl Film {
    /// The image of all sums so far: `R G B A` as halves, then the auxiliary channels as floats.
    pub fn image(&self) -> Image {
        let outputs = self.known_outputs();
        let (bounds, shown) = (self.bounds(), outputs.shown());
        let mut image = Image {
            resolution: self.resolution(),
            overscan: self.overscan(),
            bounds,
            channels: channels(&outputs),
            values: Vec::new(),
            clamped_negative: 0,
        };
        image.values.reserve_exact(bounds.area() as usize * image.channels.len());
        for at in bounds.pixels() {
            image.push_radiance(self.value(at), self.pixel(at).mean_alpha());
            self.push_auxiliary(at, &shown, &mut image.values);
        }
        image
    }

    /// The outputs that there are values for.
    fn known_outputs(&self) -> Outputs {
        let Outputs { aovs, groups } = self.outputs().clone();
        let known = |aov: &Aov| match aov {
            Aov::Error => !self.errors.is_empty(),
            Aov::FilterBlend => !self.maps[FilterMap::Blend as usize].is_empty(),
            Aov::FilterCell => !self.maps[FilterMap::Cell as usize].is_empty(),
            _ => true,
        };
        Outputs { aovs: aovs.iter().filter(known).collect(), groups }
    }

    fn push_auxiliary(&self, at: [u32; 2], shown: &[Shown], values: &mut Vec<f32>) {
        let pixel = self.pixel(at);
        // Albedo and normals fade to zero where nothing is seen, as denoisers expect. A position or a distance must not: it
        // is the mean over the samples that have one.
        let (all, hits) = (1.0 / pixel.count().max(1) as f64, 1.0 / pixel.hits().max(1) as f64);
        let light = 1.0 / pixel.normalisation();
        for shown in shown {
            let layer = match shown {
                Shown::Sum(layer) => layer,
                Shown::Count => {
                    values.push(pixel.count() as f32);
                    continue;
                }
                Shown::Error => {
                    values.extend(self.error(at).to_array());
                    continue;
                }
                Shown::Filter(map) => {
                    values.push(self.map(*map, at).unwrap_or_default());
                    continue;
                }
                Shown::Matte(named) => {
                    let coverage = (pixel.mean_alpha() as f32).clamp(0.0, 1.0);
                    let ranks = self.matte(*named, at).map_or([(0, 0.0); RANKS], |matte| matte.ranks(coverage));
                    values.extend(ranks.iter().flat_map(|(id, share)| [f32::from_bits(*id), *share]));
                    continue;
                }
            };
            let sum = self.layer(*layer, at).unwrap_or_default();
            match layer {
                Layer::Depth if pixel.hits() == 0 => values.push(f32::INFINITY),
                Layer::Depth => values.push((sum.x * hits) as f32),
                Layer::Position => values.extend((sum * hits).as_vec3().to_array()),
                Layer::Squares => {
                    // The square of a radiance that fits need not.
                    let variance = pixel.sample_variance(sum).min(glam::DVec3::splat(f64::from(f32::MAX)));
                    values.extend(variance.as_vec3().to_array());
                }
                Layer::Class(_) | Layer::Light(_) | Layer::Prefix => values.extend((sum * light).as_vec3().to_array()),
                Layer::Albedo
                | Layer::Normal
                | Layer::GeometricNormal
                | Layer::DenoiseAlbedo
                | Layer::DenoiseNormal => values.extend((sum * all).as_vec3().to_array()),
            }
        }
    }
}

fn channels(outputs: &Outputs) -> Vec<Channel> {
    let radiance = ["R", "G", "B", "A"].map(|name| Channel { name: name.into(), float: false });
    radiance.into_iter().chain(outputs.channels().map(|name| Channel { name, float: true })).collect()
}

impl Image {
    fn push_radiance(&mut self, radiance: glam::DVec3, alpha: f64) {
        let radiance = self.shown(radiance.as_vec3());
        self.values.extend(radiance);
        self.values.push((alpha as f32).clamp(0.0, 1.0));
    }

    /// What is written of a pixel's value.
    fn shown(&mut self, radiance: Rgb) -> [f32; 3] {
        self.clamped_negative += u64::from(radiance.min_element() < 0.0);
        radiance.max(Rgb::ZERO).to_array()
    }

    /// The same with room for all pixels in `bounds`.
    pub fn with_room_for(mut self, bounds: Bounds) -> Self {
        let all = bounds.area() as usize * self.channels.len();
        self.values.reserve_exact(all.saturating_sub(self.values.len()));
        self
    }

    /// Appends the rows of an image of the same frame, which follow.
    pub fn append(&mut self, band: Self) {
        assert_eq!((self.bounds.max[1], &self.channels), (band.bounds.min[1], &band.channels), "bands of one image");
        self.bounds.max = band.bounds.max;
        self.values.extend(band.values);
        self.clamped_negative += band.clamped_negative;
    }

    /// Sets what all pixels show, film RGB, row by row.
    pub fn set_radiance(&mut self, values: &[Rgb]) {
        self.clamped_negative = 0;
        let channels = self.channels.len();
        for (at, value) in values.iter().enumerate() {
            let shown = self.shown(*value);
            self.values[at * channels..][..3].copy_from_slice(&shown);
        }
    }

    /// Sets one channel of all pixels, row by row, if the image has it.
    pub fn set_channel(&mut self, name: &str, values: &[f32]) {
        let channels = self.channels.len();
        let Some(which) = self.channels.iter().position(|channel| channel.name == name) else { return };
        self.values.chunks_exact_mut(channels).zip(values).for_each(|(pixel, value)| pixel[which] = *value);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{AovSet, Taken};
    use super::*;
    use crate::integrator::FirstHit;

    #[test]
    fn channels_and_values_agree_in_number_and_negative_lobes_are_clamped() {
        let mut film = Film::new([3, 2], Bounds::full([3, 2]), AovSet::all(), false);
        film.tiles()[0].for_each(|mut pixel| {
            let (alpha, prefix, first) = (1.0, Rgb::ZERO, &FirstHit::NOTHING);
            let sample = |index, radiance, weight| Taken { index, radiance, alpha, weight, prefix, first, seen: None };
            pixel.add(&sample(0, Rgb::new(2.0, 1.0e9, 0.0), 1.0));
            pixel.add(&sample(1, Rgb::new(6.0, 0.0, 0.0), -0.5));
        });
        let image = film.image();
        assert_eq!(image.values.len(), 6 * image.channels.len());
        assert_eq!(image.clamped_negative, 6);
        assert_eq!(image.values[..3], [0.0, 5.0e8, 0.0]);
    }
}
