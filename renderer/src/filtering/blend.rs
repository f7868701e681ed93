//! Filtered or not: decided by how far the two are apart, against what noise explains.
//!
//! Wherever the filtered image differs from the unfiltered one by more than the latter's noise, the difference is bias,
//! and the unfiltered value takes its share: with the difference D² and the noise's variance V, both over a window,
//! w = max(0, 1 − κ V / D²) of it. As samples grow V vanishes and w goes to 1 unless D² vanishes too.
//!
//! V is measured between even and odd samples, which are two independent halves: their squared difference over 4
//! estimates the variance of their mean without bias, whatever the sampler's stratification.
//!
//! **Source**: the positive-part estimator of James and Stein \[James61\]; as an image-space combiner \[Zheng22\].

use filter::Resolved;
use glam::Vec3;

use crate::film::Film;
use crate::math::Rgb;

/// A pixel with all that speaks for and against its filtered value, film RGB.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pixel {
    /// Unfiltered value.
    own: Vec3,
    /// Half the difference between the unfiltered values of even and odd samples; `None` without both.
    own_noise: Option<Vec3>,
    /// Filtered value without the glossy part.
    base: Vec3,
    /// Filtered glossy part.
    glossy: Vec3,
    /// Unfiltered glossy part, though with filtered second vertices.
    glossy_own: Vec3,
    /// Half the difference of that between even and odd samples.
    glossy_noise: Vec3,
}

/// All pixels, row by row.
pub struct Frame {
    /// Pixels of a row.
    pub width: usize,
    /// All pixels.
    pub pixels: Vec<Pixel>,
}

/// Half the side of the windows over which noise and difference are measured: of the 25 pixels each gives one degree of
/// freedom to the variance.
const RADIUS: usize = 2;

/// κ for the glossy part.
const GLOSSY_DOUBT: f32 = 1.0;
/// κ for the whole.
const DOUBT: f32 = 1.5;

impl Pixel {
    /// Gathers a pixel from its film and its filter.
    pub fn new(film: &Film, at: [u32; 2], resolved: &Resolved, expose: impl Fn(Vec3) -> Vec3) -> Self {
        let pixel = film.pixel(at);
        let split = film.split(at).copied().unwrap_or_default();
        let scale = 1.0 / pixel.normalisation();
        let even_weight = pixel.weight - split.odd_weight;
        let both = split.odd_weight > 0.0 && even_weight > 0.0;
        let noise = |even: Vec3, odd: Vec3| 0.5 * (even / even_weight as f32 - odd / split.odd_weight as f32);
        let sums = |sum: Vec3| expose(sum) * scale as f32;
        let [even, odd] = resolved.glossy_own.map(&expose);
        Self {
            own: (pixel.sum * scale).as_vec3(),
            own_noise: both.then(|| noise((pixel.sum - split.odd).as_vec3(), split.odd.as_vec3())),
            base: sums(split.prefix.as_vec3() + resolved.diffuse),
            glossy: sums(resolved.glossy),
            glossy_own: (even + odd) * scale as f32,
            glossy_noise: if both { noise(even, odd) } else { Vec3::ZERO },
        }
    }
}

impl Frame {
    /// The blended image.
    pub fn blend(&self) -> Vec<Rgb> {
        let mean = self.pixels.iter().map(|pixel| luminance(pixel.own)).sum::<f32>() / self.pixels.len().max(1) as f32;
        // Errors count relative to brightness, as eyes see them, down to a tenth of the mean.
        let scale = |pixel: &Pixel| {
            (luminance(pixel.base + pixel.glossy).powi(2) + 0.01 * mean * mean).max(f32::MIN_POSITIVE).recip()
        };
        let glossy = self.weights(GLOSSY_DOUBT, |pixel| {
            pixel.own_noise.map(|_| (pixel.glossy_noise, pixel.glossy_own - pixel.glossy, scale(pixel)))
        });
        let filtered: Vec<Vec3> = (self.pixels.iter().zip(&glossy))
            .map(|(pixel, &w)| pixel.base + pixel.glossy + w * (pixel.glossy_own - pixel.glossy))
            .collect();
        let indexed: Vec<(Pixel, Vec3)> = self.pixels.iter().copied().zip(filtered.iter().copied()).collect();
        let whole = weights(&indexed, self.width, DOUBT, |(pixel, filtered)| {
            pixel.own_noise.map(|noise| (noise, pixel.own - *filtered, scale(pixel)))
        });
        indexed.iter().zip(whole).map(|((pixel, filtered), w)| *filtered + w * (pixel.own - *filtered)).collect()
    }

    fn weights(&self, doubt: f32, measure: impl Fn(&Pixel) -> Option<(Vec3, Vec3, f32)>) -> Vec<f32> {
        weights(&self.pixels, self.width, doubt, measure)
    }
}

/// The unfiltered value's share for each pixel. `measure` tells a pixel's noise, its difference and their scale; `None`
/// where noise is not known, which leaves the filter alone.
fn weights<T>(pixels: &[T], width: usize, doubt: f32, measure: impl Fn(&T) -> Option<(Vec3, Vec3, f32)>) -> Vec<f32> {
    let measured: Vec<[f32; 2]> = pixels
        .iter()
        .map(|pixel| match measure(pixel) {
            Some((noise, difference, scale)) => [noise.length_squared() * scale, difference.length_squared() * scale],
            None => [f32::INFINITY, 0.0],
        })
        .collect();
    let sums = windows(&measured, width);
    let share = |&[noise, difference]: &[f32; 2]| {
        if difference > doubt * noise { 1.0 - doubt * noise / difference } else { 0.0 }
    };
    sums.iter().map(share).collect()
}

/// Sums over windows, smaller at the borders.
fn windows(values: &[[f32; 2]], width: usize) -> Vec<[f32; 2]> {
    let height = values.len() / width.max(1);
    let near = |at: usize, size: usize| at.saturating_sub(RADIUS)..(at + RADIUS + 1).min(size);
    let sum = |a: [f32; 2], b: &[f32; 2]| [a[0] + b[0], a[1] + b[1]];
    let rows: Vec<[f32; 2]> = (0..values.len())
        .map(|i| near(i % width, width).map(|x| &values[i / width * width + x]).fold([0.0; 2], sum))
        .collect();
    (0..values.len())
        .map(|i| near(i / width, height).map(|y| &rows[y * width + i % width]).fold([0.0; 2], sum))
        .collect()
}

fn luminance(rgb: Vec3) -> f32 {
    rgb.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}
