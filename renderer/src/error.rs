//! What the renderer knows of its own error.
//!
//! Even and odd samples make two independent images A and B of mean U, so ((A − B)/2)² estimates the variance of U without
//! bias, whatever the sampler's stratification. What is in a filtered image R cannot be weighed against its own samples: the
//! blend has weighed them already, and what they share with it is as large as its error. So the frame is kept as it was with
//! m of its n samples:
//! - of the samples since then the halves A′ and B′ are nearly independent of each other and of Rₘ (not quite: they are
//!   stratified against the samples before them), so (Rₘ − A′)(Rₘ − B′) is nearly Rₘ's squared error without bias, variance
//!   and bias both. It is as noisy as the unfiltered image, so it is used for the frame
//!   as a whole;
//! - (R − Rₘ)² is what the error has lost, with little noise, but blind to what R and Rₘ have in common. It tells pixels
//!   apart, and the frame's error as far as the first is uncertain.
//!
//! What relMSE divides by is not known either, and an image is a poor stand-in for its own reference: `unfiltered` and
//! `filtered` say what stands for it where.
//!
//! **Source**: the first is validation by samples held out \[Stone74\], here those that came later.

mod estimator;
mod filtered;
mod unfiltered;

use std::sync::{Mutex, MutexGuard, PoisonError};

use estimator::estimate;
use filtered::Earlier;

use crate::film::Film;
use crate::frame::Accumulation;

/// The error of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Expected relMSE: mean over channels and the best 99.9 % of the pixels of e² / (R² + 0.01 m²), m the channel's mean.
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

/// What the looks have left.
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
        let samples = frame.samples.count();
        if samples < self.next_look() || (samples == frame.description.spp && self.goal == Goal::default()) {
            return;
        }
        if frame.filter.is_some() {
            frame.develop();
        }
        self.look(&frame.film, samples);
    }

    /// Number of samples per pixel at which to look next.
    pub fn next_look(&self) -> u64 {
        self.state().next
    }

    /// Looks at a film of so many samples per pixel, filtered if it is to be; whether the goal is reached.
    pub fn look(&self, film: &Film, samples: u64) -> bool {
        let mut state = self.state();
        state.next = 2 * samples;
        if self.goal != Goal::default() {
            let (_, estimate) = estimate(film, state.best(samples));
            // Three samples are the least of which a filtered frame knows its error.
            if samples == 2 && estimate.is_none() {
                state.next = 3;
            }
            if let Some(estimate) = estimate {
                state.reached |= self.goal.reached(&estimate);
                // At least a tenth more, so that looking stays cheap.
                let factor = self.goal.distance(&estimate).clamp(1.1, 2.0);
                state.next = (samples as f64 * factor).ceil() as u64;
            }
        }
        let last = state.earlier[1].as_ref().map_or(0, |earlier| earlier.samples);
        if film.filtered() && samples >= 2 * last {
            state.earlier.swap(0, 1);
            state.earlier[1] = Some(Earlier::new(film, samples));
        }
        state.reached
    }

    /// Whether the goal is reached.
    pub fn reached(&self) -> bool {
        self.state().reached
    }

    /// Gives the finished film its errors; `None` with too few samples to tell: without even and odd ones, or filtered and
    /// not looked at when it had half of all at most.
    pub fn finish(&self, film: &mut Film) -> Option<Estimate> {
        let state = self.state();
        let samples = film.bounds().pixels().next().map_or(0, |at| film.pixel(at).count());
        let (errors, estimate) = estimate(film, state.best(samples));
        film.set_errors(&errors);
        estimate
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// The frame with the most samples of which as many have been taken since.
    fn best(&self, samples: u64) -> Option<&Earlier> {
        self.earlier.iter().flatten().rfind(|earlier| earlier.serves(samples))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{AovSet, Taken};
    use crate::integrator::FirstHit;
    use crate::math::Rgb;
    use crate::world::Bounds;

    /// A film of 64 x 64 pixels with `spp` samples of mean `level` and variance 1, uniform.
    fn film(spp: u64, level: f32) -> Film {
        of_side(64, spp, level)
    }

    fn of_side(side: u32, spp: u64, level: f32) -> Film {
        let mut film = Film::new([side; 2], Bounds::full([side; 2]), AovSet::default(), false);
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
        // ± 1.96 of those 2.2 %, and of the 10 % that weights may be off.
        let half = 0.5 * (found.interval[1] - found.interval[0]) / expected;
        assert!((0.18..0.22).contains(&half), "{found:?}");
        assert!((found.noise / 0.025 - 1.0).abs() < 0.05, "{found:?}");
        // Coverage of the truth: 95 % of normal values, of errors known to 10 % and with 49 degrees of freedom 94.4 %.
        let within = |at: &[u32; 2]| (film.value(*at).x - 10.0).abs() <= 1.96 * f64::from(film.error(*at).x);
        let share = film.bounds().pixels().filter(within).count() as f64 / 4096.0;
        assert!((0.92..0.97).contains(&share), "{share}");
    }

    /// What is known of a frame of 16 samples of mean 10 and variance 1 that was looked at with 2, 4 and 8 of them. Its filter
    /// takes the mean of 5 x 5 pixels and errs by `bias` in each, by more with fewer samples: as their fourth root, as where
    /// cells are as large as bias and noise let them.
    fn filtered(bias: f32) -> (Film, Estimate) {
        let watch = Watch::new(Goal::default());
        let filtered = |spp: u64| {
            let mut film = of_side(256, spp, 10.0);
            let values = film.bounds().pixels().map(|at| film.pixel(at).mean()).collect();
            let means = crate::math::windows(values, 256, 2, |sum: glam::DVec3, n| (sum / n as f64).as_vec3());
            let bias = bias * (16.0 / spp as f32).powf(0.25);
            film.set_filtered(&means.into_iter().map(|mean| mean + bias).collect::<Vec<_>>());
            film
        };
        for spp in [2, 4, 8] {
            assert!(!watch.look(&filtered(spp), spp));
        }
        let mut film = filtered(16);
        let found = watch.finish(&mut film).unwrap();
        (film, found)
    }

    /// 65536 pixels know the square of the earlier error to V/256, V = 2/8 being the variance of a half of the eight samples
    /// since: to 0.001, of errors from 0.0085 on.
    #[test]
    fn the_error_of_a_filtered_frame_is_noise_and_bias() {
        for bias in [0.05, 0.1, 0.3] {
            let (film, found) = filtered(bias);
            // By definition; what one film is off by chance is small, for it has 65536 / 25 independent means.
            let expected = (1.0 / 16.0 / 25.0 + f64::from(bias).powi(2)) / (100.0 * 1.01);
            assert!((0.7..1.4).contains(&(found.relmse / expected)), "{bias}: {found:?}, {expected}");
            assert!(found.interval[0] < expected && expected < found.interval[1], "{bias}: {found:?}, {expected}");
            let within = |at: &[u32; 2]| (film.value(*at).x - 10.0).abs() <= 1.96 * f64::from(film.error(*at).x);
            let share = film.bounds().pixels().filter(within).count() as f64 / 65536.0;
            assert!(share > 0.85, "{bias}: {share}");
        }
    }

    #[test]
    fn a_filtered_frame_that_was_not_looked_at_is_not_judged() {
        let watch = Watch::new(Goal::default());
        let mut film = film(16, 10.0);
        film.set_filtered(&vec![Rgb::ONE; 64 * 64]);
        assert_eq!(watch.finish(&mut film), None);
        // With more than half of the samples is too late.
        watch.look(&film, 9);
        assert_eq!(watch.finish(&mut film), None);
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
