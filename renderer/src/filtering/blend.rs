//! Filtered or not: decided by what the samples say of the filter's error, against the noise of the unfiltered image.
//!
//! Even and odd samples make two independent unfiltered images A and B. With F the filtered one and U the mean of A and B,
//! (F − A)(F − B) estimates the squared error of F less 2 cov(F, U), for F has the samples of A and B in it too (the last
//! term of \[Stein81\]), and (A − B)²/4 that of U. With h the share that a pixel's own samples have in F, cov(F, U) is about
//! h times the variance of U, and the least squared error of the blend is exceeded by cov² over the mean of (F − U)²: second
//! order in h. The first has the variance ((A − F)² − (B − F)²)²/4 in the mean if noise is normal, and less if its tails are
//! heavier. This is sampling noise alone: where it vanishes so do doubts, however few pixels of a neighbourhood the filter
//! has wrong. But where light is rare a few pixels may all have missed it, and seem to be without noise: the variance counts
//! as a ninth of that in the window of nine times as many pixels at least, as if it had been one of the nine that saw it
//! all, spread over all nine; as [`MISSED`] of it where the pixels are darker than the filter says, for then what they miss
//! may be the very light that it has from those around them; where there is none at all, as a ninth of what it counts as
//! there, from window to window; and [`SCATTER`] of the scatter between pixels is added to it. (From window to window in all
//! cases it would be too much: in veach-mis, whose dark plates lie beside noisy ones, the gain at one sample fell by two
//! thirds.)
//!
//! Windows are nested, each thrice the side of the next. From the widest to the narrowest, a window's mean e and standard
//! error s are weighed by [`most_probable`] against what is believed of the window around it, or the lower confidence bound
//! e − c s is believed if that is more: at first nothing is believed, so only what is certain speaks against the filter.
//! With b what is believed of the narrowest window the result is F + w (U − F), w = κb / (κb + V). With κ = 1 and the true
//! b that minimises the squared error of the sum, but for that covariance; [`GRAVITY`] says why and where κ is
//! more. As samples grow V and s vanish, and w goes to 1 wherever F is wrong.
//!
//! With one sample a pixel there are no halves; then the neighbouring pixel stands for the other half.
//!
//! **Source**: the combiner of James and Stein \[James61\], \[Zheng22\] in its form for two halves, which is 1 − V/D with
//! D = b + V; the nested windows and their standard error are ours.

use std::collections::VecDeque;
use std::ops::Add;

use filter::{Resolved, most_probable};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::film::{Film, Layer};
use crate::math::{Rgb, Widening, luminance, widened};

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

/// All pixels.
pub struct Frame {
    /// Pixels of a row.
    pub width: usize,
    /// All rows.
    pub rows: Vec<Vec<Pixel>>,
}

/// When the unfiltered image is believed. The default is measured, not derived.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blend {
    /// c: how many standard errors an error must exceed to be certain, whatever its surroundings; half as much again in the
    /// narrowest windows, for nine pixels do not know their own standard error well.
    pub doubt: f32,
}

impl Default for Blend {
    fn default() -> Self {
        Self { doubt: 2.0 }
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

impl Pixel {
    /// Its unfiltered value, film RGB.
    pub fn own(&self) -> Rgb {
        self.own
    }
}

impl Frame {
    /// A pixel by its number, row by row.
    pub fn at(&self, i: usize) -> &Pixel {
        &self.rows[i / self.width][i % self.width]
    }

    /// All pixels, row by row.
    fn pixels(&self) -> impl IndexedParallelIterator<Item = &Pixel> {
        (0..self.width * self.rows.len()).into_par_iter().map(|i| self.at(i))
    }

    /// The blended image, and the share of the unfiltered one in each pixel.
    pub fn blend(&self, settings: &Blend) -> (Vec<Rgb>, Vec<f32>) {
        let sum: f64 = self.rows.iter().flatten().map(|pixel| f64::from(luminance(pixel.own))).sum();
        let mean = (sum / (self.width * self.rows.len()).max(1) as f64) as f32;
        // Errors count relative to brightness, as eyes see them, down to a tenth of the mean. The brightness is that of nine
        // pixels: by its own, an error that brightens would excuse itself.
        let bright = |pixel: &Pixel| Vec2::new(luminance(pixel.base + pixel.glossy), 1.0);
        let bright = widened(&self.pixels().map(bright).collect::<Vec<_>>(), self.width, 1);
        let scale = |bright: Vec2| (bright.x / bright.y).hypot(0.1 * mean).max(f32::MIN_POSITIVE).recip();
        let scales: Vec<f32> = bright.into_par_iter().map(scale).collect();
        let glossy = weights(self, settings.doubt, |i| {
            let pixel = self.at(i);
            let noise = pixel.own_noise.map(|_| pixel.glossy_noise);
            Difference { from_filtered: pixel.glossy_own - pixel.glossy, noise, scale: scales[i] }
        });
        let filtered: Vec<Vec3> = (self.pixels().zip(&glossy))
            .map(|(pixel, &w)| pixel.base + pixel.glossy + w * (pixel.glossy_own - pixel.glossy))
            .collect();
        let whole = weights(self, settings.doubt, |i| {
            let pixel = self.at(i);
            Difference { from_filtered: pixel.own - filtered[i], noise: pixel.own_noise, scale: scales[i] }
        });
        let blended = (self.pixels().zip(&filtered).zip(&whole))
            .map(|((pixel, filtered), w)| *filtered + *w * (pixel.own - *filtered));
        (blended.collect(), whole)
    }
}

/// How a pixel's unfiltered value differs from the filtered one.
#[derive(Clone, Copy)]
struct Difference {
    from_filtered: Vec3,
    /// Half the difference between the unfiltered values of even and odd samples; `None` without both.
    noise: Option<Vec3>,
    /// What differences are multiplied by before they are squared, so that bright pixels do not count for more than dark
    /// ones.
    scale: f32,
}

/// Sums over a window of what its pixels say. Differences are relative to brightness.
#[derive(Clone, Copy, Debug, Default)]
struct Evidence {
    /// Squared error of the filtered value: an unbiased estimate, which may be negative.
    error: f32,
    /// Its square.
    square: f32,
    /// Its variance by sampling noise.
    doubt: f32,
    /// Squared error of the unfiltered value.
    noise: f32,
    /// Luminance of the unfiltered value above that of the filtered one.
    excess: f32,
    /// Pixels.
    count: f32,
}

impl Add for Evidence {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            error: self.error + other.error,
            square: self.square + other.square,
            doubt: self.doubt + other.doubt,
            noise: self.noise + other.noise,
            excess: self.excess + other.excess,
            count: self.count + other.count,
        }
    }
}

/// Relative differences beyond this count as this much, so that fourth powers, summed over the widest window, fit an `f32`.
const LARGEST: f32 = 1e8;

impl Difference {
    /// What a pixel says, with the help of its neighbour if it has to.
    fn evidence(&self, neighbour: impl Fn() -> Self) -> Evidence {
        let relative =
            |difference: Vec3, scale: f32| (difference * scale).clamp(Vec3::splat(-LARGEST), Vec3::splat(LARGEST));
        let own = relative(self.from_filtered, self.scale);
        // Mean and half the difference of F − A and F − B.
        let (mean, half, pixels) = match self.noise {
            Some(noise) => (own, relative(noise, self.scale), 1.0),
            // With one sample the neighbour is the other half: its noise is independent, and the filter errs much as here.
            None => {
                let neighbour = neighbour();
                let beside = relative(neighbour.from_filtered, neighbour.scale);
                (0.5 * (own + beside), 0.5 * (own - beside), 2.0)
            }
        };
        let (variance, both) = (half.length_squared(), mean.dot(half));
        let error = mean.length_squared() - variance;
        Evidence {
            error,
            square: error * error,
            doubt: 4.0 * both * both,
            noise: pixels * variance,
            excess: luminance(mean),
            count: 1.0,
        }
    }
}

/// Means over a window, of which some may be what wider windows say.
#[derive(Clone, Copy, Default)]
struct Variance {
    /// Of the squared error of the filtered value.
    doubt: f64,
    /// Of the unfiltered value.
    noise: f64,
}

/// How much of the scatter between pixels counts as doubt. All of it would, were all errors of a window the same; but one
/// pixel of nine that is wrong, at three standard errors, is certain only with less than an eighth.
const SCATTER: f64 = 0.1;

/// How much of the noise of wider windows counts in those that are darker than the filter says. With a ninth, walls that are
/// lit through glass had dark cracks where no path of a window had found the lamp, with a third traces of them; with all of it
/// a filter that is ten times too bright would pass for that.
const MISSED: f64 = 0.5;

impl Evidence {
    /// Mean squared error of the filtered value, and the standard error of this mean where the pixels have these variances.
    fn error(&self, variance: &Variance) -> [f64; 2] {
        let mean = |sum: f32| f64::from(sum) / f64::from(self.count);
        let error = mean(self.error);
        let scatter = (mean(self.square) - error * error).max(0.0);
        [error, ((variance.doubt + SCATTER * scatter) / f64::from(self.count)).sqrt()]
    }

    /// What variances count as, in view of the wider window and of what they count as there.
    fn variance(&self, wider: Option<(&Self, Variance)>) -> Variance {
        let share = if self.excess < 0.0 { MISSED } else { 1.0 / 9.0 };
        let counts = |of: fn(&Self) -> f32, known: fn(&Variance) -> f64| {
            let seen = |window: &Self| f64::from(of(window) / window.count);
            match (seen(self), wider) {
                (0.0, Some((_, wider))) => known(&wider) / 9.0,
                (own, Some((wider, _))) => own.max(share * seen(wider)),
                (own, None) => own,
            }
        };
        Variance {
            doubt: counts(|window| window.doubt, |variance| variance.doubt),
            noise: counts(|window| window.noise, |variance| variance.noise),
        }
    }
}

/// κ − 1 where noise cannot be seen. A bias is what more samples around do not average out, so it counts more than noise;
/// this much buys a bias that falls to less than half of the error. Where noise can be seen κ is 1: there it would make dots
/// of it.
const GRAVITY: f64 = 8.0;

/// Squared noise that can be seen, relative to brightness, as the sum over channels: of a tenth in each.
const SEEN: f64 = 3.0 * 0.1 * 0.1;

/// Nested windows of 3, 9, 27 and 81 pixels a side.
const LEVELS: usize = 4;

/// Rows that are worked on at once: enough for many threads, and few next to those that the widest windows reach over.
const ROWS: usize = 32;

/// Windows of one size, of rows that are not done with.
struct Level {
    widening: Widening<Evidence>,
    rows: VecDeque<Vec<Evidence>>,
}

impl Level {
    /// Takes the next rows of the level below, and says how many of its own are known by that.
    fn push<'r>(&mut self, rows: impl IndexedParallelIterator<Item = &'r Vec<Evidence>>) -> usize {
        let fresh = self.widening.push(rows);
        let count = fresh.len();
        self.rows.extend(fresh);
        count
    }
}

/// The unfiltered value's share for each pixel.
fn weights(frame: &Frame, doubt: f32, measure: impl Fn(usize) -> Difference + Sync) -> Vec<f32> {
    let (width, height) = (frame.width, frame.rows.len());
    let evidence = |i: usize| {
        let neighbour = if i % width + 1 < width { i + 1 } else { i - i.min(1) };
        measure(i).evidence(|| measure(neighbour))
    };
    let mut levels: [Level; LEVELS] = std::array::from_fn(|level| Level {
        widening: Widening::new(3_usize.pow(level as u32), height),
        rows: VecDeque::new(),
    });
    let mut shares = Vec::with_capacity(width * height);
    for begin in (0..height).step_by(ROWS) {
        let rows = (begin..height.min(begin + ROWS)).into_par_iter();
        let pixels: Vec<Vec<_>> = rows.map(|y| (y * width..(y + 1) * width).map(evidence).collect()).collect();
        let mut fresh = levels[0].push(pixels.par_iter());
        for level in 1..LEVELS {
            let (narrower, wider) = levels.split_at_mut(level);
            let rows = &narrower[level - 1].rows;
            let rows: Vec<_> = rows.range(rows.len() - fresh..).collect();
            fresh = wider[0].push(rows.into_par_iter());
        }
        // The widest windows are known last, and of those that are only now.
        let share = |y: usize| -> Vec<f32> {
            let rows: [&[Evidence]; LEVELS] = std::array::from_fn(|level| levels[level].rows[y].as_slice());
            (0..width).map(|x| share(rows.map(|row| &row[x]), f64::from(doubt))).collect()
        };
        let of_rows: Vec<Vec<f32>> = (0..fresh).into_par_iter().map(share).collect();
        shares.extend(of_rows.into_iter().flatten());
        levels.iter_mut().for_each(|level| drop(level.rows.drain(..fresh)));
    }
    shares
}

/// The unfiltered value's share for a pixel from its windows, from narrow to wide.
fn share(windows: [&Evidence; LEVELS], doubt: f64) -> f32 {
    let (mut believed, mut wider, mut noise) = (0.0, None, 0.0);
    for (level, window) in windows.into_iter().enumerate().rev() {
        let variance = window.variance(wider);
        wider = Some((window, variance));
        let [error, standard_error] = window.error(&variance);
        let doubt = if level == 0 { 1.5 * doubt } else { doubt };
        believed = most_probable(error, standard_error, believed).max(error - doubt * standard_error);
        // The noise of nine pixels may miss all that is bright; that of 81 is less likely to.
        noise = if level == 1 { variance.noise } else { noise };
    }
    let bias = believed * (1.0 + GRAVITY * SEEN / (SEEN + noise));
    if bias > 0.0 { (bias / (bias + noise)) as f32 } else { 0.0 }
}

#[cfg(test)]
#[path = "blend_tests.rs"]
mod tests;
