//! What the renderer knows of its own error.
//!
//! Even and odd samples make two independent images A and B of mean U, so ((A − B)/2)² estimates the variance of U without
//! bias, whatever the sampler's stratification. A filtered image R is judged by two such estimates, for which the frame as
//! it was with m of its n samples is kept:
//! - (R − A)(R − B) + 2 Cov(R, U) is its squared error without bias, variance and bias both, as A and B are independent of
//!   each other but not of R. The covariance is the response of R to U times the variance of U, and the response the slope of
//!   R − Rₘ over U − Uₘ. It is as noisy as the unfiltered image, so it is used for the frame as a whole;
//! - (R − Rₘ)² m / (n − m) is R's variance and the change of its bias, with little noise: it tells pixels apart.
//!
//! **Source**: the first is Stein's unbiased estimate \[Stein81\] with a measured divergence.

use std::sync::{Mutex, PoisonError};

use glam::DVec3;

use crate::film::Film;
use crate::frame::Accumulation;
use crate::math::{Rgb, luminance, windows};

/// As in relMSE: the share of a channel's squared mean that keeps dark pixels finite.
const RELATIVE_FLOOR: f64 = 0.01;
/// Half the side of the windows over which errors are pooled: 49 degrees of freedom know a standard error to 10 %.
const RADIUS: usize = 3;
/// Side of the blocks whose scatter gives the frame's interval: cells of the filter are smaller.
const BLOCK: usize = 16;
/// Half the width of a 95 % interval, in standard errors.
const NORMAL_95: f64 = 1.959_964;

/// The error of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Expected relMSE: mean over pixels and channels of e² / (R² + 0.01 m²), m the channel's mean.
    pub relmse: f64,
    /// Its 95 % interval.
    pub interval: [f64; 2],
    /// Mean standard error over the mean, of luminance.
    pub noise: f64,
}

/// When a frame is good enough.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Goal {
    /// This relMSE.
    pub relmse: Option<f64>,
    /// This mean standard error, relative to the mean.
    pub noise: Option<f64>,
}

impl Goal {
    fn reached(&self, estimate: &Estimate) -> bool {
        self.relmse.is_some_and(|limit| estimate.relmse <= limit)
            || self.noise.is_some_and(|limit| estimate.noise <= limit)
    }

    /// How many times the samples an unfiltered frame would need.
    fn distance(&self, estimate: &Estimate) -> f64 {
        let relmse = self.relmse.map(|limit| estimate.relmse / limit);
        let noise = self.noise.map(|limit| (estimate.noise / limit).powi(2));
        relmse.unwrap_or(f64::INFINITY).min(noise.unwrap_or(f64::INFINITY))
    }
}

/// A frame as it was.
#[derive(Clone)]
struct Earlier {
    samples: f64,
    values: Vec<DVec3>,
    own: Vec<DVec3>,
}

#[derive(Default)]
struct State {
    /// The last two looks, the later one last.
    earlier: [Option<Earlier>; 2],
    next: u64,
    reached: bool,
}

/// Watches a frame's error while it is rendered: looks when the number of samples has doubled, and when the goal should be
/// near.
pub struct Watch {
    goal: Goal,
    state: Mutex<State>,
}

impl Watch {
    /// Looks for a goal.
    pub fn new(goal: Goal) -> Self {
        Self { goal, state: Mutex::new(State { next: 1, ..State::default() }) }
    }

    /// To be told of each pass.
    pub fn pass_done(&self, frame: &mut Accumulation) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let samples = frame.samples.count();
        if samples < state.next || (samples == frame.description.spp && self.goal == Goal::default()) {
            return;
        }
        state.next = 2 * samples;
        if frame.filter.is_some() {
            frame.develop();
        }
        if self.goal != Goal::default() {
            let (_, estimate) = estimate(&frame.film, state.best(samples));
            if let Some(estimate) = estimate {
                state.reached |= self.goal.reached(&estimate);
                // At least a tenth more, so that looking stays cheap.
                let factor = self.goal.distance(&estimate).clamp(1.1, 2.0);
                state.next = (samples as f64 * factor).ceil() as u64;
            }
        }
        let last = state.earlier[1].as_ref().map_or(0.0, |earlier| earlier.samples);
        if frame.filter.is_some() && samples as f64 >= 2.0 * last {
            let (film, at) = (&frame.film, || frame.film.bounds().pixels());
            let values = at().map(|at| film.value(at)).collect();
            let own = at().map(|at| film.pixel(at).mean()).collect();
            state.earlier.swap(0, 1);
            state.earlier[1] = Some(Earlier { samples: samples as f64, values, own });
        }
    }

    /// Whether the goal is reached.
    pub fn reached(&self) -> bool {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).reached
    }

    /// Gives the finished film its errors; `None` with too few samples to tell: without even and odd ones, or filtered in
    /// fewer than two blocks.
    pub fn finish(&self, film: &mut Film) -> Option<Estimate> {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let samples = film.bounds().pixels().next().map_or(0, |at| film.pixel(at).count());
        let (errors, estimate) = estimate(film, state.best(samples));
        film.set_errors(&errors);
        estimate
    }
}

impl State {
    /// The frame with the most samples that has not nearly all of them.
    fn best(&self, samples: u64) -> Option<&Earlier> {
        self.earlier.iter().flatten().rfind(|earlier| earlier.samples <= 0.75 * samples as f64)
    }
}

/// Standard error of each pixel, film RGB, and that of the frame.
fn estimate(film: &Film, earlier: Option<&Earlier>) -> (Vec<Rgb>, Option<Estimate>) {
    let (width, filtered) = (film.bounds().width() as usize, film.filtered());
    let unknown = || (vec![Rgb::ZERO; film.bounds().area() as usize], None);
    let Some(pixels) = film.bounds().pixels().map(|at| Pixel::new(film, at)).collect::<Option<Vec<_>>>() else {
        return unknown();
    };
    let weights = weights(&pixels, width, filtered);
    let (local, whole) = match (filtered, earlier) {
        (false, _) => {
            let squares: Vec<DVec3> = pixels.iter().zip(&weights).map(|(p, w)| p.noise * p.noise * *w).collect();
            (squares.clone(), squares)
        }
        (true, None) => return unknown(),
        (true, Some(earlier)) => of_filtered(&pixels, &weights, earlier),
    };
    let (mean, error) = mean_and_error(&whole, width);
    // The level is that of the unbiased estimate as far as that is certain, else that of the other.
    let model = mean_and_error(&local, width).0;
    let certain = (mean - model).powi(2) / ((mean - model).powi(2) + error * error).max(f64::MIN_POSITIVE);
    let relmse = (model + certain * (mean - model)).max(0.25 * model);
    let level = if model > 0.0 { relmse / model } else { 1.0 };
    let errors: Vec<Rgb> = means(&local, width, RADIUS)
        .iter()
        .zip(&weights)
        .map(|(square, weight)| {
            let root = |c: usize| if weight[c] > 0.0 { (level * square[c] / weight[c]).sqrt() } else { 0.0 };
            DVec3::new(root(0), root(1), root(2)).as_vec3()
        })
        .collect();
    let total: f64 = pixels.iter().map(|p| f64::from(luminance(p.value.as_vec3()))).sum();
    let noise = errors.iter().map(|error| f64::from(luminance(*error))).sum::<f64>() / total.max(f64::MIN_POSITIVE);
    let half = NORMAL_95 * if filtered { error.max(0.1 * relmse) } else { error };
    (errors, Some(Estimate { relmse, interval: [(relmse - half).max(0.0), relmse + half], noise }))
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

/// What squares are multiplied by. The reference of relMSE is not known: a filtered pixel stands for it, and for an unfiltered
/// one the mean of those around it. Its own value must not: weights would be small where its error is large.
fn weights(pixels: &[Pixel], width: usize, filtered: bool) -> Vec<DVec3> {
    let values: Vec<DVec3> = pixels.iter().map(|pixel| pixel.value).collect();
    let mean = values.iter().sum::<DVec3>() / values.len().max(1) as f64;
    let floor = RELATIVE_FLOOR * mean * mean;
    let reciprocal = |x: f64| if x > 0.0 { x.recip() } else { 0.0 };
    let weight = |value: &DVec3| (value * value + floor).to_array().map(reciprocal).into();
    if filtered || values.len() < 2 {
        return values.iter().map(weight).collect();
    }
    let around = windows(values.clone(), width, 1, |sum, count| (sum, count as f64 - 1.0));
    around.iter().zip(&values).map(|((sum, others), value)| weight(&((*sum - *value) / *others))).collect()
}

/// Relative squared errors of a filtered frame: what tells pixels apart, and what is right in the mean.
fn of_filtered(pixels: &[Pixel], weights: &[DVec3], earlier: &Earlier) -> (Vec<DVec3>, Vec<DVec3>) {
    let changes = |at: usize| (pixels[at].value - earlier.values[at], pixels[at].own - earlier.own[at]);
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
    (local, (0..pixels.len()).map(whole).collect())
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

/// Means over windows, smaller at the borders.
fn means(values: &[DVec3], width: usize, radius: usize) -> Vec<DVec3> {
    windows(values.to_vec(), width, radius, |sum, count| sum / count as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{AovSet, Taken};
    use crate::integrator::FirstHit;
    use crate::world::Bounds;

    /// A film of 64 x 64 pixels with `spp` samples of mean `level` and variance 1, uniform.
    fn film(spp: u64, level: f32) -> Film {
        let mut film = Film::new([64, 64], Bounds::full([64, 64]), AovSet::default(), false);
        for mut tile in film.tiles() {
            tile.for_each(|mut pixel| {
                for index in 0..spp {
                    let mut x = (u64::from(pixel.index) << 20 | index).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
                    let noise = ((x >> 40) as f32 / (1u64 << 24) as f32 - 0.5) * 12.0_f32.sqrt();
                    let radiance = Rgb::splat(level + noise);
                    let (alpha, weight, prefix, first) = (1.0, 1.0, Rgb::ZERO, &FirstHit::NOTHING);
                    pixel.add(&Taken { index, radiance, alpha, weight, prefix, first, seen: None });
                }
            });
        }
        film
    }

    /// 4096 pixels know a variance of one degree of freedom each to √(2/4096) = 2.2 %.
    #[test]
    fn the_error_of_independent_samples_is_theirs() {
        let mut film = film(16, 10.0);
        let found = Watch::new(Goal::default()).finish(&mut film).unwrap();
        let expected = 1.0 / 16.0 / (100.0 * 1.01);
        assert!((found.relmse / expected - 1.0).abs() < 0.07, "{found:?}");
        assert!(found.interval[0] < expected && expected < found.interval[1], "{found:?}");
        // ± 1.96 of those 2.2 %.
        let half = 0.5 * (found.interval[1] - found.interval[0]) / expected;
        assert!((0.03..0.06).contains(&half), "{found:?}");
        assert!((found.noise / 0.025 - 1.0).abs() < 0.05, "{found:?}");
        // Coverage of the truth: 95 % of normal values, of errors known to 10 % and with 49 degrees of freedom 94.4 %.
        let within = |at: &[u32; 2]| (film.value(*at).x - 10.0).abs() <= 1.96 * f64::from(film.error(*at).x);
        let share = film.bounds().pixels().filter(within).count() as f64 / 4096.0;
        assert!((0.92..0.97).contains(&share), "{share}");
    }

    #[test]
    fn one_sample_says_nothing_of_its_error() {
        assert_eq!(Watch::new(Goal::default()).finish(&mut film(1, 10.0)), None);
    }

    #[test]
    fn a_goal_is_reached_by_either_figure() {
        let estimate = Estimate { relmse: 0.01, interval: [0.0; 2], noise: 0.1 };
        let goal = |relmse, noise| Goal { relmse, noise }.reached(&estimate);
        assert!(goal(Some(0.01), None) && goal(None, Some(0.1)) && goal(Some(0.001), Some(0.2)));
        assert!(!goal(None, None) && !goal(Some(0.009), Some(0.09)));
    }
}
