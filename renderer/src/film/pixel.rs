//! What one pixel adds up.

use glam::DVec3;

use crate::integrator::FirstHit;
use crate::math::Rgb;

/// Weighted sums of a pixel's samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Σ w L.
    pub sum: DVec3,
    /// Σ (w L)².
    pub sum_of_squares: DVec3,
    /// Σ w alpha.
    pub alpha: f64,
    /// Σ w. Nearly all weights are ± one constant.
    pub weight: f64,
    /// Number of samples, rejected ones included: a rejected sample counts as black.
    pub count: u64,
}

impl Pixel {
    /// Adds a sample of finite, non-negative radiance (film RGB) with a filter weight of either sign.
    pub fn add(&mut self, radiance: Rgb, alpha: f32, weight: f32) {
        let value = (radiance * weight).as_dvec3();
        self.sum += value;
        self.sum_of_squares += value * value;
        self.alpha += f64::from(alpha * weight);
        self.weight += f64::from(weight);
        self.count += 1;
    }

    /// The pixel's value, film RGB; negative only if the filter has negative lobes. Zero without samples.
    ///
    /// The sum of the weights normalises, not the number of samples: their ratio tends to one, and the ratio estimator
    /// leaves a constant image constant. Where few samples of a negative-lobed filter cancel, the number serves.
    pub fn mean(&self) -> DVec3 {
        self.sum / self.normalisation()
    }

    /// Mean coverage.
    pub fn mean_alpha(&self) -> f64 {
        self.alpha / self.normalisation()
    }

    /// Unbiased estimate of the variance of one weighted sample, film RGB squared. Zero below two samples.
    pub fn sample_variance(&self) -> DVec3 {
        if self.count < 2 {
            return DVec3::ZERO;
        }
        let n = self.count as f64;
        ((self.sum_of_squares - self.sum * self.sum / n) / (n - 1.0)).max(DVec3::ZERO)
    }

    /// What sums are divided by.
    pub fn normalisation(&self) -> f64 {
        let n = self.count.max(1) as f64;
        // Half the expected sum: a smaller one has lost most of its digits to cancellation.
        if self.weight > 0.5 * n { self.weight } else { n }
    }
}

/// Sums of a pixel's first hits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Auxiliary {
    /// Σ albedo.
    pub albedo: DVec3,
    /// Σ shading normal.
    pub ns: DVec3,
    /// Σ geometric normal.
    pub ng: DVec3,
    /// Σ position.
    pub p: DVec3,
    /// Σ distance.
    pub depth: f64,
    /// Number of samples that met a surface.
    pub hits: u64,
}

impl Auxiliary {
    /// Adds the first hit of a sample that met a surface.
    pub fn add(&mut self, first: &FirstHit) {
        self.albedo += first.albedo.as_dvec3();
        self.ns += first.ns.as_dvec3();
        self.ng += first.ng.as_dvec3();
        self.p += first.p;
        self.depth += f64::from(first.depth);
        self.hits += 1;
    }
}

/// What a filtered frame keeps of a pixel besides [`Pixel`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Split {
    /// Σ w L of the light that the filter does not touch, scene RGB.
    pub prefix: DVec3,
    /// Σ w L of odd samples, film RGB.
    pub odd: DVec3,
    /// Σ w of odd samples.
    pub odd_weight: f64,
}

impl Split {
    /// Adds a sample: its whole radiance (film RGB), and what of it the filter leaves alone (scene RGB).
    pub fn add(&mut self, index: u64, radiance: Rgb, prefix: Rgb, weight: f32) {
        self.prefix += (prefix * weight).as_dvec3();
        if index % 2 == 1 {
            self.odd += (radiance * weight).as_dvec3();
            self.odd_weight += f64::from(weight);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_variance_are_those_of_the_samples() {
        let mut pixel = Pixel::default();
        for value in [1.0, 2.0, 3.0, 6.0] {
            pixel.add(Rgb::new(value, 1.0e-6 * value, 5.0), 1.0, 1.0);
        }
        assert_eq!(pixel.mean().x, 3.0);
        assert!((pixel.sample_variance().x - 14.0 / 3.0).abs() < 1e-12);
        assert_eq!(pixel.sample_variance().z, 0.0);
        assert_eq!(pixel.mean_alpha(), 1.0);
    }

    #[test]
    fn a_constant_stays_constant_under_a_filter_with_negative_lobes() {
        let mut pixel = Pixel::default();
        for k in 0..16 {
            pixel.add(Rgb::ONE, 1.0, if k % 8 == 0 { -1.25 } else { 1.25 });
        }
        assert_eq!(pixel.mean(), DVec3::ONE);
    }
}
