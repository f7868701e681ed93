//! Filtered or not: decided by what the samples say of the filter's error, against the noise of the unfiltered image.
//!
//! Even and odd samples make two independent unfiltered images A and B. With F the filtered one, (F − A)(F − B) estimates
//! the squared error of F without bias, whatever the sampler's stratification, and (A − B)²/4 that of their mean, the
//! unfiltered image U. Over a window the first has a mean b and a standard error s. Only what is certain speaks against
//! the filter: with b' = max(0, b − c s), the result is F + w (U − F), w = b' / (b' + V), which minimises the error of the sum
//! of independent estimates. As samples grow V vanishes, and w goes to 1 wherever F is wrong.
//!
//! With one sample a pixel there are no halves; then the neighbouring pixel stands for the other half.
//!
//! **Source**: the combiner of James and Stein \[James61\], \[Zheng22\] in its form for two halves, which is 1 − V/D with
//! D = b + V; the standard error is ours, against the heavy tails of path tracing.

use filter::Resolved;
use glam::Vec3;
use rayon::prelude::*;

use crate::film::{Film, Layer};
use crate::math::{Rgb, luminance, windows};

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

/// When the unfiltered image is believed. The defaults are measured, not derived.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blend {
    /// Half the side of the windows over which noise and difference are measured: of a window's pixels each gives one
    /// degree of freedom to the variance.
    pub radius: usize,
    /// c for the glossy part.
    pub glossy_doubt: f32,
    /// c for the whole.
    pub doubt: f32,
}

impl Default for Blend {
    fn default() -> Self {
        Self { radius: 3, glossy_doubt: 1.0, doubt: 2.0 }
    }
}

impl Pixel {
    /// Gathers a pixel from its film and its filter.
    pub fn new(film: &Film, at: [u32; 2], resolved: &Resolved, expose: impl Fn(Vec3) -> Vec3) -> Self {
        let pixel = film.pixel(at);
        let prefix = film.layer(Layer::Prefix, at).unwrap_or_default().as_vec3();
        let scale = 1.0 / pixel.normalisation();
        let sums = |sum: Vec3| expose(sum) * scale as f32;
        let [even, odd] = resolved.glossy_own.map(&expose);
        let [even_weight, odd_weight] = pixel.half_normalisations().map(|weight| weight as f32);
        let halves = pixel.halves();
        Self {
            own: pixel.mean().as_vec3(),
            own_noise: halves.map(|[even, odd]| (0.5 * (even - odd)).as_vec3()),
            base: sums(prefix + resolved.diffuse),
            glossy: sums(resolved.glossy),
            glossy_own: sums(resolved.glossy_own[0] + resolved.glossy_own[1]),
            glossy_noise: halves.map_or(Vec3::ZERO, |_| 0.5 * (even / even_weight - odd / odd_weight)),
        }
    }
}

impl Frame {
    /// The blended image.
    pub fn blend(&self, settings: &Blend) -> Vec<Rgb> {
        let sum: f64 = self.pixels.iter().map(|pixel| f64::from(luminance(pixel.own))).sum();
        let mean = (sum / self.pixels.len().max(1) as f64) as f32;
        // Errors count relative to brightness, as eyes see them, down to a tenth of the mean.
        let scale =
            |pixel: &Pixel| luminance(pixel.base + pixel.glossy).hypot(0.1 * mean).max(f32::MIN_POSITIVE).recip();
        let glossy = weights(self, settings.glossy_doubt, settings.radius, |i| {
            let pixel = &self.pixels[i];
            let noise = pixel.own_noise.map(|_| pixel.glossy_noise);
            Difference { from_filtered: pixel.glossy_own - pixel.glossy, noise, scale: scale(pixel) }
        });
        let filtered: Vec<Vec3> = (self.pixels.par_iter().zip(&glossy))
            .map(|(pixel, &w)| pixel.base + pixel.glossy + w * (pixel.glossy_own - pixel.glossy))
            .collect();
        let whole = weights(self, settings.doubt, settings.radius, |i| {
            let pixel = &self.pixels[i];
            Difference { from_filtered: pixel.own - filtered[i], noise: pixel.own_noise, scale: scale(pixel) }
        });
        let blended = (&self.pixels, &filtered, &whole)
            .into_par_iter()
            .map(|(pixel, filtered, w)| *filtered + *w * (pixel.own - *filtered));
        blended.collect()
    }
}

/// How a pixel's unfiltered value differs from the filtered one.
#[derive(Clone, Copy)]
struct Difference {
    from_filtered: Vec3,
    /// Half the difference between the unfiltered values of even and odd samples; `None` without both.
    noise: Option<Vec3>,
    /// What differences are multiplied by before they are squared, so that bright pixels do not count for more than dark
    /// ones, and so that squares fit: those of radiance itself need not.
    scale: f32,
}

impl Difference {
    /// Unbiased estimates of the squared error of the filtered value and of that of the unfiltered one.
    fn errors(&self, neighbour: &Self) -> [f32; 2] {
        let difference = self.from_filtered * self.scale;
        let square = difference.length_squared();
        let beside = difference.dot(neighbour.from_filtered * neighbour.scale);
        match self.noise {
            // (F − A)(F − B) with A and B at U ± noise.
            Some(noise) => {
                let variance = (noise * self.scale).length_squared();
                [0.5 * (square - variance + beside), variance]
            }
            // With one sample the neighbour is the other half: its noise is independent, and the filter errs much as here.
            None => [beside, (square - beside).max(0.0)],
        }
    }
}

/// The unfiltered value's share for each pixel.
fn weights(frame: &Frame, doubt: f32, radius: usize, measure: impl Fn(usize) -> Difference + Sync) -> Vec<f32> {
    let width = frame.width;
    let differences: Vec<Difference> = (0..frame.pixels.len()).into_par_iter().map(&measure).collect();
    let measured: Vec<Vec3> = (0..differences.len())
        .into_par_iter()
        .map(|i| {
            let neighbour = if i % width + 1 < width { i + 1 } else { i - i.min(1) };
            let [error, variance] = differences[i].errors(&differences[neighbour]);
            Vec3::new(error, error * error, variance)
        })
        .collect();
    drop(differences);
    windows(measured, width, radius, |sums, count| {
        let n = count as f32;
        let [error, square, variance] = (sums / n).to_array();
        let standard_error = ((square - error * error) / n).max(0.0).sqrt();
        let certain = error - doubt * standard_error;
        if certain > 0.0 { certain / (certain + variance) } else { 0.0 }
    })
}
