//! The errors of a film's pixels, from what its samples say.

use std::ops::Add;

use glam::DVec3;

use super::Estimate;
use crate::film::Film;
use crate::math::{Rgb, luminance, windows};

/// As in relMSE: the share of a channel's squared mean that keeps dark pixels finite.
const RELATIVE_FLOOR: f64 = 0.01;
/// Half the side of the windows over which errors are pooled: 49 degrees of freedom know a standard error to 10 %.
const RADIUS: usize = 3;
/// Side of the blocks whose scatter gives the frame's interval: cells of the filter are smaller.
const BLOCK: usize = 16;
/// Half the width of a 95 % interval, in standard errors.
const NORMAL_95: f64 = 1.959_964;

/// A frame as it was.
#[derive(Clone)]
pub(super) struct Earlier {
    pub samples: f64,
    values: Vec<DVec3>,
    own: Vec<DVec3>,
}

impl Earlier {
    pub fn new(film: &Film, samples: u64) -> Self {
        let at = || film.bounds().pixels();
        let values = at().map(|at| film.value(at)).collect();
        Self { samples: samples as f64, values, own: at().map(|at| film.pixel(at).mean()).collect() }
    }
}

/// A pixel of a frame.
struct Pixel {
    value: DVec3,
    own: DVec3,
    /// Half the difference of even and odd samples.
    noise: DVec3,
}

impl Pixel {
    fn new(film: &Film, at: [u32; 2]) -> Option<Self> {
        let [even, odd] = film.pixel(at).halves()?;
        Some(Self { value: film.value(at), own: 0.5 * (even + odd), noise: 0.5 * (even - odd) })
    }
}

/// Squared errors, each times its pixel's weight.
struct Squares {
    weights: Vec<DVec3>,
    /// What tells pixels apart.
    local: Vec<DVec3>,
    /// What is right in the mean; for an unfiltered frame of other weights.
    whole: Vec<DVec3>,
}

/// Standard error of each pixel, film RGB, and that of the frame.
pub(super) fn estimate(film: &Film, earlier: Option<&Earlier>) -> (Vec<Rgb>, Option<Estimate>) {
    let (width, filtered) = (film.bounds().width() as usize, film.filtered());
    let pixels: Option<Vec<Pixel>> = film.bounds().pixels().map(|at| Pixel::new(film, at)).collect();
    let squares = match (&pixels, filtered, earlier) {
        (Some(pixels), false, _) => Some(of_unfiltered(pixels, width)),
        (Some(pixels), true, Some(earlier)) => Some(of_filtered(pixels, earlier)),
        _ => None,
    };
    let (Some(pixels), Some(Squares { weights, local, whole })) = (pixels, squares) else {
        return (vec![Rgb::ZERO; film.bounds().area() as usize], None);
    };
    let (mean, error) = mean_and_error(&whole, width);
    let (relmse, level) = if filtered { level(mean, error, mean_and_error(&local, width).0) } else { (mean, 1.0) };
    let pooled = windows(local, width, RADIUS, |sum, count| sum / count as f64);
    let root = |square: f64, weight: f64| if weight > 0.0 { (level * square / weight).sqrt() } else { 0.0 };
    let errors = pooled.iter().zip(&weights).map(|(square, weight)| {
        DVec3::new(root(square.x, weight.x), root(square.y, weight.y), root(square.z, weight.z)).as_vec3()
    });
    let errors: Vec<Rgb> = errors.collect();
    let total: f64 = pixels.iter().map(|p| f64::from(luminance(p.value.as_vec3()))).sum();
    let noise = errors.iter().map(|error| f64::from(luminance(*error))).sum::<f64>() / total.max(f64::MIN_POSITIVE);
    let half = NORMAL_95 * if filtered { error.max(0.1 * relmse) } else { error };
    (errors, Some(Estimate { relmse, interval: [(relmse - half).max(0.0), relmse + half], noise }))
}

/// relMSE of a filtered frame from the unbiased `mean`, of standard error `error`, as far as that is certain, else from the
/// `model` that tells pixels apart; and what the latter is to be multiplied by.
fn level(mean: f64, error: f64, model: f64) -> (f64, f64) {
    let certain = (mean - model).powi(2) / ((mean - model).powi(2) + error * error).max(f64::MIN_POSITIVE);
    let relmse = (model + certain * (mean - model)).max(0.25 * model);
    (relmse, if model > 0.0 { relmse / model } else { 1.0 })
}

/// Squared errors of an unfiltered frame: the variance of each pixel.
///
/// The reference of relMSE is not known. In the mean over the frame each pixel's neighbours stand for it: with its own value
/// weights would be small where its error is large. Where errors are pooled and given back to pixels, such a weight would
/// let a firefly among the neighbours swell a pixel's error, and the edge of something bright that of what is dark beside
/// it; there it is the pixel's value after a Wiener filter, [`smoothed`].
fn of_unfiltered(pixels: &[Pixel], width: usize) -> Squares {
    let values: Vec<DVec3> = pixels.iter().map(|pixel| pixel.value).collect();
    let floor = floor(&values);
    let weighted = |weights: &[DVec3]| pixels.iter().zip(weights).map(|(p, w)| p.noise * p.noise * *w).collect();
    let weights: Vec<DVec3> = smoothed(pixels, width).into_iter().map(|x| weight(x * x, floor)).collect();
    let around = if values.len() > 1 {
        let sums = windows(values.clone(), width, 1, |sum, count| (sum, count as f64 - 1.0));
        sums.into_iter().zip(&values).map(|((sum, others), value)| (sum - *value) / others).collect()
    } else {
        values
    };
    let around: Vec<DVec3> = around.into_iter().map(|x| weight(x * x, floor)).collect();
    Squares { local: weighted(&weights), whole: weighted(&around), weights }
}

/// Squared errors of a filtered frame.
///
/// Of a squared value R², which stands for the reference's, a share R² / (R² + Δ²) counts, Δ being the change since the
/// frame was as it was: a value that is all noise, as at the edge of a lamp that one sample has hit, is no reference.
fn of_filtered(pixels: &[Pixel], earlier: &Earlier) -> Squares {
    let changes = |at: usize| (pixels[at].value - earlier.values[at], pixels[at].own - earlier.own[at]);
    let values: Vec<DVec3> = pixels.iter().map(|pixel| pixel.value).collect();
    let floor = floor(&values);
    let weights = values.iter().enumerate().map(|(at, value)| {
        let (square, change) = (value * value, changes(at).0);
        weight(square * square / (square + change * change).max(DVec3::splat(f64::MIN_POSITIVE)), floor)
    });
    let weights: Vec<DVec3> = weights.collect();
    // How much more the unfiltered image has changed than its error is.
    let (mut noise, mut change) = (DVec3::ZERO, DVec3::ZERO);
    for (at, weight) in weights.iter().enumerate() {
        noise += pixels[at].noise * pixels[at].noise * *weight;
        change += changes(at).1 * changes(at).1 * *weight;
    }
    let ratio = noise / change.max(DVec3::splat(f64::MIN_POSITIVE));
    // Of m samples and of n: the change has variance σ²(1/m − 1/n), the frame σ²/n.
    let share = noise.element_sum() / change.element_sum().max(f64::MIN_POSITIVE);
    let local = (0..pixels.len()).map(|at| share * changes(at).0 * changes(at).0 * weights[at]).collect();
    let whole = |at: usize| {
        let (Pixel { value, own, noise }, (filtered, plain)) = (&pixels[at], changes(at));
        let product = (value - own - noise) * (value - own + noise);
        (product + 2.0 * ratio * filtered * plain) * weights[at]
    };
    Squares { local, whole: (0..pixels.len()).map(whole).collect(), weights }
}

/// What relMSE adds to squares.
fn floor(values: &[DVec3]) -> DVec3 {
    let mean = values.iter().sum::<DVec3>() / values.len().max(1) as f64;
    RELATIVE_FLOOR * mean * mean
}

/// What a squared error is multiplied by where the reference's square is `square`.
fn weight(square: DVec3, floor: DVec3) -> DVec3 {
    (square + floor).to_array().map(|x| if x > 0.0 { x.recip() } else { 0.0 }).into()
}

/// Sums over a window.
#[derive(Clone, Copy, Default)]
struct Moments {
    value: DVec3,
    square: f64,
    noise: f64,
}

impl Add for Moments {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, square: self.square + other.square, noise: self.noise + other.noise }
    }
}

/// The frame as far as it is more than noise: the mean over a window, and of what a pixel differs from that the share that
/// noise does not explain.
///
/// **Source**: the filter of \[Lee80\] for additive noise.
fn smoothed(pixels: &[Pixel], width: usize) -> Vec<DVec3> {
    let moments =
        |p: &Pixel| Moments { value: p.value, square: p.value.length_squared(), noise: p.noise.length_squared() };
    let around = windows(pixels.iter().map(moments).collect(), width, RADIUS, |sum, count| {
        let n = count as f64;
        let mean = sum.value / n;
        let scatter = sum.square / n - mean.length_squared();
        (mean, if scatter > 0.0 { (1.0 - sum.noise / n / scatter).max(0.0) } else { 0.0 })
    });
    pixels.iter().zip(around).map(|(pixel, (mean, signal))| mean + signal * (pixel.value - mean)).collect()
}

/// Mean over pixels and channels, and its standard error: from neighbouring blocks, which differ little but by noise.
fn mean_and_error(squares: &[DVec3], width: usize) -> (f64, f64) {
    let height = squares.len() / width.max(1);
    let mut blocks = Vec::new();
    for y in (0..height).step_by(BLOCK) {
        for x in (0..width).step_by(BLOCK) {
            let rows = y..height.min(y + BLOCK);
            let sum: f64 = rows
                .flat_map(|y| &squares[y * width + x..y * width + width.min(x + BLOCK)])
                .map(|square| square.element_sum())
                .sum();
            blocks.push(sum);
        }
    }
    let count = 3.0 * squares.len().max(1) as f64;
    let pairs = blocks.windows(2).map(|pair| 0.5 * (pair[0] - pair[1]).powi(2)).sum::<f64>();
    let variance = pairs * blocks.len() as f64 / (blocks.len() as f64 - 1.0).max(1.0);
    (blocks.iter().sum::<f64>() / count, variance.sqrt() / count)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One pixel of 1000 and of noise as large among pixels of 1 with noise 0.1.
    fn frame(lamp: Option<DVec3>) -> Vec<Pixel> {
        let mut pixels: Vec<Pixel> =
            (0..32 * 32).map(|_| Pixel { value: DVec3::ONE, own: DVec3::ONE, noise: DVec3::splat(0.1) }).collect();
        if let Some(noise) = lamp {
            pixels[16 * 32 + 16] = Pixel { value: DVec3::splat(1e3), own: DVec3::splat(1e3), noise };
        }
        pixels
    }

    #[test]
    fn a_lamp_stays_and_a_firefly_goes() {
        let lamp = smoothed(&frame(Some(DVec3::ONE)), 32)[16 * 32 + 16].x;
        assert!(lamp > 990.0, "{lamp}");
        let firefly = smoothed(&frame(Some(DVec3::splat(1e3))), 32)[16 * 32 + 16].x;
        // The window's mean.
        assert!((firefly - (1e3 + 48.0) / 49.0).abs() < 1.0, "{firefly}");
    }

    #[test]
    fn a_pixel_beside_a_lamp_keeps_its_own_error() {
        let error = |pixels: &[Pixel], at: usize| {
            let Squares { weights, local, .. } = of_unfiltered(pixels, 32);
            let pooled = windows(local, 32, RADIUS, |sum, count| sum / count as f64);
            (pooled[at].x / weights[at].x).sqrt()
        };
        // The lamp is known to 1 %, the pixel to 10 %: pooled, 48 of 49 such squares.
        let (beside, alone) =
            (error(&frame(Some(DVec3::splat(10.0))), 16 * 32 + 17), error(&frame(None), 16 * 32 + 17));
        assert!((beside / alone - 1.0).abs() < 0.02, "{beside} {alone}");
        assert!((alone - 0.1).abs() < 1e-6, "{alone}");
    }

    #[test]
    fn the_unbiased_estimate_counts_as_far_as_it_is_certain() {
        assert_eq!(level(2.0, 0.0, 1.0), (2.0, 2.0));
        assert_eq!(level(2.0, 1.0, 1.0), (1.5, 1.5));
        // Never less than a quarter of what the frame has changed.
        assert_eq!(level(-5.0, 0.0, 1.0), (0.25, 0.25));
        assert_eq!(level(0.0, 0.0, 0.0), (0.0, 1.0));
    }
}
