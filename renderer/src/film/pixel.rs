//! What one pixel adds up.

use glam::{DVec3, Mat3, Vec3};

use super::sum::Sum;
use crate::integrator::{Aside, FirstHit};
use crate::math::Rgb;

/// A sample as the film takes it.
#[derive(Clone, Copy, Debug)]
pub struct Taken<'a> {
    /// Its number within the pixel.
    pub index: u64,
    /// Finite, film RGB.
    pub radiance: Rgb,
    /// Coverage.
    pub alpha: f32,
    /// Of the pixel filter, of either sign.
    pub weight: f32,
    /// The light in it that the frame's filter does not touch, scene RGB as the sensor takes it.
    pub prefix: Rgb,
    /// What auxiliary outputs see; not looked at unless `alpha` is above 0.
    pub first: &'a FirstHit,
    /// What else was seen, if a film wants it.
    pub seen: Option<Seen<'a>>,
}

/// What was seen along a path.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// In scene RGB.
    pub aside: &'a Aside<'a>,
    /// Film RGB from scene RGB, as the sensor takes this sample.
    pub film_from_scene: Mat3,
}

impl Seen<'_> {
    /// Film RGB of a part of the sample's radiance.
    pub(super) fn exposed(&self, part: Rgb) -> Rgb {
        self.film_from_scene * part
    }
}

impl Taken<'_> {
    /// w L, rounded as the sums take it.
    #[inline]
    pub(super) fn value(&self) -> DVec3 {
        (self.radiance * self.weight).as_dvec3()
    }

    /// A value of what was seen; zero where nothing was looked for, or where it is not finite.
    #[inline]
    pub(super) fn seen(&self, value: impl Fn(&Seen<'_>) -> Vec3) -> Vec3 {
        self.seen.as_ref().map(value).filter(|value| value.is_finite()).unwrap_or_default()
    }
}

/// Weighted sums of a pixel's samples, those of even numbers and those of odd ones apart: the sampler makes two independent
/// images of them. No bit depends on the order in which samples come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pixel {
    /// Σ w L of even and of odd samples.
    halves: [Sum<3>; 2],
    /// Σ w of even and of odd samples, in quanta. Nearly all weights are ± one constant.
    weights: [i64; 2],
    /// Σ w alpha, in quanta.
    alpha: i64,
    /// Number of samples, rejected ones included: a rejected sample counts as black.
    count: u32,
    /// Number of samples that met a surface.
    hits: u32,
}

/// Quanta of weights: 2⁻³⁶, so that 2²³ weights below 16 fit.
const WEIGHT_BITS: i32 = 36;

/// The largest weight: the number below 16, as 2²³ times 16 would be 2⁶³ quanta, one more than there are.
const LARGEST_WEIGHT: f32 = 16.0 - 8.0 * f32::EPSILON;

/// A weight in quanta.
pub(super) fn quanta(weight: f32) -> i64 {
    (f64::from(weight.clamp(-LARGEST_WEIGHT, LARGEST_WEIGHT)) * 2f64.powi(WEIGHT_BITS)).round() as i64
}

/// A number of quanta as a weight.
fn weight(quanta: i64) -> f64 {
    quanta as f64 * 2f64.powi(-WEIGHT_BITS)
}

/// What a sum of `n` samples is divided by: their weights, unless those cancel, as they may under a filter with negative
/// lobes.
pub fn normalisation(weight: f64, n: f64) -> f64 {
    // Half the expected sum: a smaller one has lost most of its digits to cancellation.
    if weight > 0.5 * n { weight } else { n }
}

impl Pixel {
    /// Words that a pixel is stored as.
    pub const WORDS: usize = 2 * Sum::<3>::WORDS + 4;

    /// Adds a sample.
    #[inline]
    pub fn add(&mut self, taken: &Taken<'_>) {
        let half = (taken.index % 2) as usize;
        self.halves[half].add(taken.value().to_array());
        self.weights[half] += quanta(taken.weight);
        self.alpha += quanta(taken.alpha * taken.weight);
        self.count += 1;
        self.hits += u32::from(taken.alpha > 0.0);
    }

    /// Adds the samples of another film's pixel.
    pub fn merge(&mut self, other: &Self) {
        for half in 0..2 {
            self.halves[half].merge(&other.halves[half]);
            self.weights[half] = self.weights[half].saturating_add(other.weights[half]);
        }
        self.alpha = self.alpha.saturating_add(other.alpha);
        self.count = self.count.saturating_add(other.count);
        self.hits = self.hits.saturating_add(other.hits);
    }

    /// Σ w L, film RGB.
    pub fn sum(&self) -> DVec3 {
        let [even, odd] = self.halves.map(|half| DVec3::from_array(half.value()));
        even + odd
    }

    /// Means of even and of odd samples, film RGB: independent of each other. `None` for a single sample: consecutive ones
    /// are of both.
    pub fn halves(&self) -> Option<[DVec3; 2]> {
        let normalisations = self.half_normalisations();
        let mean = |half: usize| DVec3::from_array(self.halves[half].value()) / normalisations[half];
        (self.count > 1).then(|| [mean(0), mean(1)])
    }

    /// Σ w L, film RGB, and Σ w of even and of odd samples.
    pub fn half_sums(&self) -> [(DVec3, f64); 2] {
        [0, 1].map(|half| (DVec3::from_array(self.halves[half].value()), weight(self.weights[half])))
    }

    /// What sums of even and of odd samples are divided by.
    pub fn half_normalisations(&self) -> [f64; 2] {
        self.weights.map(|quanta| normalisation(weight(quanta), 0.5 * f64::from(self.count.max(1))))
    }

    /// Number of samples.
    pub fn count(&self) -> u64 {
        self.count.into()
    }

    /// Number of samples that met a surface.
    pub fn hits(&self) -> u64 {
        self.hits.into()
    }

    /// The pixel's value, film RGB; negative only if the filter has negative lobes or the sensor's response does, as that of a
    /// white balance may. Zero without samples.
    ///
    /// The sum of the weights normalises, not the number of samples: their ratio tends to one, and the ratio estimator
    /// leaves a constant image constant. Where few samples of a negative-lobed filter cancel, the number serves.
    pub fn mean(&self) -> DVec3 {
        self.sum() / self.normalisation()
    }

    /// Mean coverage.
    pub fn mean_alpha(&self) -> f64 {
        weight(self.alpha) / self.normalisation()
    }

    /// Unbiased estimate of the variance of one weighted sample from the sum of their squares, film RGB squared. Zero
    /// below two samples.
    pub fn sample_variance(&self, squares: DVec3) -> DVec3 {
        if self.count < 2 {
            return DVec3::ZERO;
        }
        let (n, sum) = (f64::from(self.count), self.sum());
        ((squares - sum * sum / n) / (n - 1.0)).max(DVec3::ZERO)
    }

    /// What sums are divided by.
    pub fn normalisation(&self) -> f64 {
        normalisation(weight(self.weights[0].saturating_add(self.weights[1])), f64::from(self.count.max(1)))
    }

    /// Appends the pixel's [`Self::WORDS`], to be stored.
    pub fn store(&self, words: &mut Vec<u64>) {
        self.halves.iter().for_each(|half| half.store(words));
        words.extend(self.weights.map(|x| x as u64));
        words.extend([self.alpha as u64, u64::from(self.count) | u64::from(self.hits) << 32]);
    }

    /// Takes what [`Self::store`] appended off the front; `None` where no pixel has such words.
    pub fn load(words: &mut &[u64]) -> Option<Self> {
        let halves = [Sum::load(words)?, Sum::load(words)?];
        let (&[even, odd, alpha, counts], rest) = words.split_first_chunk::<4>()?;
        *words = rest;
        let weights = [even as i64, odd as i64];
        Some(Self { halves, weights, alpha: alpha as i64, count: counts as u32, hits: (counts >> 32) as u32 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taken(index: u64, radiance: Rgb, weight: f32) -> Taken<'static> {
        const NOTHING: FirstHit = FirstHit::NOTHING;
        Taken { index, radiance, alpha: 1.0, weight, prefix: Rgb::ZERO, first: &NOTHING, seen: None }
    }

    #[test]
    fn mean_and_variance_are_those_of_the_samples() {
        let (mut pixel, mut squares) = (Pixel::default(), DVec3::ZERO);
        for (index, value) in (0..).zip([1.0, 2.0, 3.0, 6.0]) {
            let sample = taken(index, Rgb::new(value, 1.0e-6 * value, 5.0), 1.0);
            pixel.add(&sample);
            squares += sample.value() * sample.value();
        }
        assert_eq!(pixel.mean().x, 3.0);
        assert_eq!(pixel.halves().unwrap().map(|half| half.x), [2.0, 4.0]);
        assert!((pixel.sample_variance(squares).x - 14.0 / 3.0).abs() < 1e-12);
        assert_eq!(pixel.sample_variance(squares).z, 0.0);
        assert_eq!(pixel.mean_alpha(), 1.0);
    }

    #[test]
    fn a_constant_stays_constant_under_a_filter_with_negative_lobes() {
        let mut pixel = Pixel::default();
        (0..16).for_each(|k| pixel.add(&taken(k, Rgb::ONE, if k % 8 == 0 { -1.25 } else { 1.25 })));
        assert_eq!(pixel.mean(), DVec3::ONE);
    }

    #[test]
    fn as_many_of_the_largest_weights_fit_as_there_may_be_samples() {
        for weight in [16.0, f32::INFINITY, -16.0, f32::NEG_INFINITY] {
            assert!(quanta(weight).checked_mul(crate::film::MOST_TERMS as i64).is_some(), "{weight}");
        }
    }

    #[test]
    fn halves_whose_weights_cancel_are_there_and_finite() {
        let mut pixel = Pixel::default();
        [1.0, -1.25, 1.0, 1.25].into_iter().zip(0..).for_each(|(w, k)| pixel.add(&taken(k, Rgb::ONE, w)));
        assert!(pixel.halves().unwrap().iter().all(|half| half.is_finite() && half.abs().max_element() <= 1.0));
    }

    #[test]
    fn slices_merge_to_the_whole_in_any_order_and_survive_storing() {
        let samples: Vec<_> = (0..100)
            .map(|k| taken(k, Rgb::new(0.1, 1.0 / (k + 1) as f32, 1e9 * (k % 7) as f32), 1.0 - 0.01 * k as f32))
            .collect();
        let pixel = |range: std::ops::Range<usize>| {
            let mut pixel = Pixel::default();
            samples[range].iter().for_each(|sample| pixel.add(sample));
            let mut words = Vec::new();
            pixel.store(&mut words);
            assert_eq!(words.len(), Pixel::WORDS);
            Pixel::load(&mut words.as_slice()).unwrap()
        };
        let whole = pixel(0..100);
        for parts in [[0..33, 33..34, 34..100], [34..100, 0..33, 33..34]] {
            let mut merged = Pixel::default();
            parts.into_iter().for_each(|range| merged.merge(&pixel(range)));
            assert_eq!(merged, whole);
        }
    }
}
