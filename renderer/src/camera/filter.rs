//! Filter importance sampling: where in a pixel's filter a sample falls, so that each sample belongs to one pixel.

use std::f64::consts::PI;

use glam::Vec2;

use super::CameraError;
use crate::scene::description::{PixelFilter, PixelFilterKind};

/// A pixel filter that can be sampled. All kinds are separable: f(x, y) = fx(x) fy(y).
#[derive(Clone, Debug)]
pub struct Filter {
    sampler: Sampler,
    radius: Vec2,
}

#[derive(Clone, Debug)]
enum Sampler {
    Box,
    Triangle,
    Tables(Box<[Table; 2]>),
}

/// Where a sample falls and how much it counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterSample {
    /// From the pixel's centre, pixels.
    pub offset: Vec2,
    /// f / pdf, scaled to a mean of 1; negative in a negative lobe.
    pub weight: f32,
}

impl Filter {
    /// The filter that a description means.
    ///
    /// **Errors**: a radius that is not positive, parameters that make the filter non-finite, or one whose integral is
    /// not clearly positive, so that no weights with a mean of 1 exist.
    pub fn build(filter: &PixelFilter) -> Result<Self, CameraError> {
        let error = |message: String| CameraError { span: None, message };
        let radius = filter.radius;
        if !(radius.min_element() > 0.0 && radius.is_finite()) {
            return Err(error(format!("the pixel filter's radius is {radius}, but must be above 0")));
        }
        let sampler = match filter.kind {
            PixelFilterKind::Box => Sampler::Box,
            PixelFilterKind::Triangle => Sampler::Triangle,
            kind => {
                let table = |radius: f32| Table::build(f64::from(radius), |x| profile(kind, f64::from(radius), x));
                match (table(radius.x), table(radius.y)) {
                    (Some(x), Some(y)) => Sampler::Tables(Box::new([x, y])),
                    _ => return Err(error(format!("the pixel filter {kind:?} has no positive integral"))),
                }
            }
        };
        Ok(Self { sampler, radius })
    }

    /// The sample that `u` in [0, 1)² chooses, with a density proportional to |f|; offsets increase with `u`.
    #[inline]
    pub fn sample(&self, u: Vec2) -> FilterSample {
        match &self.sampler {
            Sampler::Box => FilterSample { offset: (2.0 * u - Vec2::ONE) * self.radius, weight: 1.0 },
            Sampler::Triangle => FilterSample { offset: Vec2::new(tent(u.x), tent(u.y)) * self.radius, weight: 1.0 },
            Sampler::Tables(tables) => {
                let ((x, weight_x), (y, weight_y)) = (tables[0].sample(u.x), tables[1].sample(u.y));
                FilterSample { offset: Vec2::new(x, y), weight: weight_x * weight_y }
            }
        }
    }

    /// Half width and half height of the support, pixels.
    pub fn radius(&self) -> Vec2 {
        self.radius
    }
}

/// The filter along one axis. **Source**: pbrt-v4's filters; \[Mitchell88\], \[Duchon79\].
fn profile(kind: PixelFilterKind, radius: f64, x: f64) -> f64 {
    let x = x.abs();
    if x > radius {
        return 0.0;
    }
    match kind {
        PixelFilterKind::Box => 1.0,
        PixelFilterKind::Triangle => radius - x,
        PixelFilterKind::Gaussian { sigma } => {
            let normal = |x: f64| (-0.5 * (x / f64::from(sigma)).powi(2)).exp();
            normal(x) - normal(radius)
        }
        PixelFilterKind::Mitchell { b, c } => mitchell(f64::from(b), f64::from(c), 2.0 * x / radius),
        PixelFilterKind::LanczosSinc { tau } => sinc(x) * sinc(x / f64::from(tau)),
    }
}

fn mitchell(b: f64, c: f64, x: f64) -> f64 {
    let cubic = |c3: f64, c2: f64, c1: f64, c0: f64| (((c3 * x + c2) * x + c1) * x + c0) / 6.0;
    if x <= 1.0 {
        cubic(12.0 - 9.0 * b - 6.0 * c, -18.0 + 12.0 * b + 6.0 * c, 0.0, 6.0 - 2.0 * b)
    } else {
        cubic(-b - 6.0 * c, 6.0 * b + 30.0 * c, -12.0 * b - 48.0 * c, 8.0 * b + 24.0 * c)
    }
}

fn sinc(x: f64) -> f64 {
    // Below this, 1 − (πx)²/6 rounds to 1.
    if x.abs() < 1.0e-8 { 1.0 } else { (PI * x).sin() / (PI * x) }
}

/// Inverse of the tent's cumulative distribution on [-1, 1].
#[inline]
fn tent(u: f32) -> f32 {
    if u < 0.5 { (2.0 * u).sqrt() - 1.0 } else { 1.0 - (2.0 * (1.0 - u)).sqrt() }
}

/// Half of an even function on [0, radius] as a histogram of |f|, with a guide that finds the bin of a given
/// cumulative share in one step on average.
///
/// **Source**: \[Chen74\] for the guide.
#[derive(Clone, Debug)]
struct Table {
    /// ∫|f| up to the start of each bin over the whole; one entry more than there are bins.
    cumulative: Vec<f32>,
    /// The bin to start looking from, for each of [`Table::BINS`] equal shares.
    guide: Vec<u16>,
    /// ∫f / ∫|f| of a bin, which is less than ±1 only where f changes sign within it, over the same of the whole.
    weights: Vec<f32>,
    bin_width: f32,
}

impl Table {
    /// A bin is a few thousandths of a pixel wide, so the density is off by as little; a table is 5 KB, so both axes'
    /// stay in the first-level cache.
    const BINS: usize = 512;
    /// Midpoints of the quadrature in each bin: relative error (width/16)² f''/f, below f32's rounding.
    const STEPS: usize = 16;

    /// Tabulates `f` on [0, `radius`]; `None` if that yields no finite weights.
    fn build(radius: f64, f: impl Fn(f64) -> f64) -> Option<Self> {
        let step = radius / (Self::BINS * Self::STEPS) as f64;
        let bin = |bin: usize| {
            let values = (0..Self::STEPS).map(|k| f(((bin * Self::STEPS + k) as f64 + 0.5) * step));
            values.fold((0.0, 0.0), |(absolute, signed), value| (absolute + value.abs(), signed + value))
        };
        let bins: Vec<(f64, f64)> = (0..Self::BINS).map(bin).collect();
        let (absolute, signed) = bins.iter().fold((0.0, 0.0), |sum, bin| (sum.0 + bin.0, sum.1 + bin.1));
        // Weights of a thousand and more would be noise alone.
        if !(f64::is_finite(absolute) && signed > 1.0e-3 * absolute) {
            return None;
        }
        let mut sum = 0.0;
        let mut cumulative = vec![0.0];
        cumulative.extend(bins.iter().map(|bin| {
            sum += bin.0 / absolute;
            sum as f32
        }));
        cumulative[Self::BINS] = 1.0;
        let first_above = |share: f32| cumulative.partition_point(|&c| c <= share) - 1;
        let guide = (0..Self::BINS).map(|k| first_above(k as f32 / Self::BINS as f32) as u16).collect();
        let weight = |bin: &(f64, f64)| (bin.1 / bin.0.max(f64::MIN_POSITIVE) * (absolute / signed)) as f32;
        let weights = bins.iter().map(weight).collect();
        Some(Self { cumulative, guide, weights, bin_width: (radius / Self::BINS as f64) as f32 })
    }

    /// Offset and weight. `u` below ½ falls left of the centre.
    #[inline]
    fn sample(&self, u: f32) -> (f32, f32) {
        let side = 2.0 * u - 1.0;
        // Below 1, so that it lies within a bin that is not empty.
        let share = side.abs().min(1.0 - 0.5 * f32::EPSILON);
        let mut bin = usize::from(self.guide[(share * Self::BINS as f32) as usize]);
        while self.cumulative[bin + 1] <= share {
            bin += 1;
        }
        let (start, end) = (self.cumulative[bin], self.cumulative[bin + 1]);
        let x = (bin as f32 + (share - start) / (end - start)) * self.bin_width;
        (x.copysign(side), self.weights[bin])
    }
}

#[cfg(test)]
mod tests;
