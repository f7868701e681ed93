//! What the noise of the images leaves certain about their difference.

use serde::Serialize;

use crate::metric::Pair;
use crate::ssim::luminance;

/// Side of the blocks whose mean differences are tested, in pixels: 64 pixels make a mean nearly normal.
const BLOCK: usize = 8;
/// Half the width of a 95 % interval, in standard errors.
const NORMAL_95: f64 = 1.959_964;
/// Variance that 16 bits add to a value of 1: uniform over an interval of 2^-11 at most.
const HALF_ROUNDING: f64 = 1.0 / 4_194_304.0 / 12.0;

/// Standard errors of an image's pixels.
pub type Errors<'a> = &'a [[f32; 3]];

/// How well an image's own `error` layer foretells its difference from the reference.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Prediction {
    /// The relMSE that the layer stands for: its squares in place of (I − R)².
    pub relmse: f64,
    /// Share of all values with |I − R| within 1.96 standard errors of the difference.
    pub coverage: f64,
    /// Where the measured relMSE would lie in 95 % of all images of this quality, pixels taken to be independent.
    pub interval: [f64; 2],
}

/// Whether the images' noise explains their difference: z is a mean difference of luminance in standard errors.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ZTest {
    /// Of the whole frame.
    pub frame: f64,
    /// The largest of all blocks.
    pub worst: f64,
    /// Number of blocks.
    pub blocks: usize,
    /// Probability that a block of images without a difference is as far off: below 0.001 they differ.
    pub p: f64,
}

/// The noise of image and reference, as far as it is known.
#[derive(Clone, Copy, Default)]
pub struct Noise<'a> {
    /// The image's `error` layer.
    pub image: Option<Errors<'a>>,
    /// The reference's.
    pub reference: Option<Errors<'a>>,
    /// Half the difference of two independent references, of which the reference is the mean.
    pub halves: Option<Errors<'a>>,
}

impl Noise<'_> {
    /// Squared standard error of the reference's value `c` of pixel `at`, without bias.
    fn reference(&self, at: usize, c: usize) -> f64 {
        let known = self.halves.or(self.reference);
        known.map_or(0.0, |errors| f64::from(errors[at][c]).powi(2))
    }

    /// The same of luminance. Errors of an `error` layer are taken to be the same ray's in all channels, which can only be
    /// too much; halves tell.
    fn luminance(&self, at: usize) -> f64 {
        let of =
            |errors: Option<Errors<'_>>| errors.map_or(0.0, |errors| luminance(&errors[at].map(f64::from)).powi(2));
        of(self.image) + of(self.halves.or(self.reference))
    }
}

/// Compares what `noise.image` says with what is measured; `scale` is what squares of each value are divided by. `None`
/// without an error layer.
pub fn predict(pairs: &[Pair], noise: Noise<'_>, scale: impl Fn(&[f64; 3], usize) -> f64) -> Option<Prediction> {
    let image = noise.image?;
    let (mut predicted, mut measured, mut variances) = (0.0, 0.0, [0.0; 3]);
    let (mut within, mut count) = (0u64, 0u64);
    for (at, (i, r)) in pairs.iter().enumerate().filter_map(|(at, pair)| Some((at, pair.as_ref()?))) {
        for c in 0..3 {
            let own = f64::from(image[at][c]).powi(2);
            let known = own + noise.reference(at, c) + HALF_ROUNDING * (i[c] * i[c] + r[c] * r[c]);
            let (square, scale) = ((i[c] - r[c]).powi(2), scale(r, c));
            within += u64::from(square <= NORMAL_95 * NORMAL_95 * known);
            count += 1;
            if scale > 0.0 {
                predicted += own / scale;
                measured += square / scale;
                // Of the square of a normal variable with mean b: 2σ⁴ + 4b²σ², and b² + σ² is measured.
                variances[c] += (4.0 * square * known - 2.0 * known * known) / (scale * scale);
            }
        }
    }
    let n = count.max(1) as f64;
    // Channels share their paths: their deviations add.
    let half = NORMAL_95 * variances.iter().map(|variance| variance.max(0.0).sqrt()).sum::<f64>() / n;
    let interval = [(measured / n - half).max(0.0), measured / n + half];
    Some(Prediction { relmse: predicted / n, coverage: within as f64 / n, interval })
}

/// Tests the frame and its blocks; `None` if the image's noise is not known. A reference whose noise is not known counts as
/// exact. Pixels must be independent, which those of filtered images are not.
///
/// **Source**: the test of blocks as a whole by \[Sidak67\].
pub fn z_test(pairs: &[Pair], width: usize, noise: Noise<'_>) -> Option<ZTest> {
    noise.image?;
    let across = width.div_ceil(BLOCK);
    let mut sums = vec![[0.0; 2]; across * (pairs.len() / width.max(1)).div_ceil(BLOCK)];
    for (at, (i, r)) in pairs.iter().enumerate().filter_map(|(at, pair)| Some((at, pair.as_ref()?))) {
        let (own, other) = (luminance(i), luminance(r));
        let block = &mut sums[at / width / BLOCK * across + at % width / BLOCK];
        block[0] += own - other;
        block[1] += noise.luminance(at) + HALF_ROUNDING * (own * own + other * other);
    }
    let z = |[difference, variance]: [f64; 2]| if difference == 0.0 { 0.0 } else { difference / variance.sqrt() };
    let worst = sums.iter().map(|block| z(*block)).fold(0.0, |a: f64, b: f64| if b.abs() > a.abs() { b } else { a });
    let frame = z(sums.iter().fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]));
    let one = libm::erfc(worst.abs() / std::f64::consts::SQRT_2);
    // 1 − (1 − one)^n without losing what is small.
    let p = -f64::exp_m1(sums.len() as f64 * f64::ln_1p(-one));
    Some(ZTest { frame, worst, blocks: sums.len(), p })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normal numbers of variance 1, by the sum of twelve uniform ones, which is normal enough up to 3 deviations.
    fn noise(count: usize, seed: u64) -> Vec<f64> {
        let mut state = seed;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / (1u64 << 24) as f64
        };
        (0..count).map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect()
    }

    const SIDE: usize = 64;

    fn noisy(deviation: f64, offset: f64) -> Vec<Pair> {
        let value = |noise: f64| Some(([1.0 + offset + deviation * noise; 3], [1.0; 3]));
        noise(SIDE * SIDE, 7).into_iter().map(value).collect()
    }

    fn known(error: f32) -> Vec<[f32; 3]> {
        vec![[error; 3]; SIDE * SIDE]
    }

    #[test]
    fn noise_that_is_known_is_predicted_and_no_difference() {
        let (pairs, errors) = (noisy(0.1, 0.0), known(0.1));
        let noise = Noise { image: Some(&errors), ..Noise::default() };
        let found = predict(&pairs, noise, |_, _| 1.0).unwrap();
        assert!((found.relmse - 0.01).abs() < 1e-8, "{found:?}");
        // Of 4096 pixels 95 % ± 3 √(0.95 0.05 / 4096).
        assert!((found.coverage - 0.95).abs() < 0.011, "{found:?}");
        // ± 1.96 √2 0.01 / √4096, to the accuracy with which 4096 numbers give their own fourth moment: 5 %.
        let half = 0.5 * (found.interval[1] - found.interval[0]);
        assert!((half / (NORMAL_95 * 2.0_f64.sqrt() * 0.01 / 64.0) - 1.0).abs() < 0.1, "{found:?}");
        let test = z_test(&pairs, SIDE, noise).unwrap();
        assert!(test.frame.abs() < 3.0 && test.p > 0.001 && test.blocks == 64, "{test:?}");
    }

    #[test]
    fn a_difference_beyond_the_noise_is_found() {
        // A thirtieth of a pixel's noise: a quarter of a block's error, but 64/30 of the frame's. Three times more in one.
        let (mut pairs, errors) = (noisy(0.1, 0.1 / 15.0), known(0.1));
        let noise = Noise { image: Some(&errors), ..Noise::default() };
        let test = z_test(&pairs, SIDE, noise).unwrap();
        assert!(test.frame > 3.0, "{test:?}");
        for at in (0..8).flat_map(|y| (0..8).map(move |x| y * SIDE + x)) {
            pairs[at].as_mut().unwrap().0 = [1.08; 3];
        }
        // 0.08 is 6.4 standard errors of a block: 2e-10 for one, 64 times that for any.
        let test = z_test(&pairs, SIDE, noise).unwrap();
        assert!((test.worst - 6.4).abs() < 0.01 && (5e-9..5e-8).contains(&test.p), "{test:?}");
    }

    #[test]
    fn halves_of_the_reference_tell_its_noise() {
        let (pairs, halves, own) = (noisy(0.1, 0.0), known(0.1), known(0.05));
        let alone = Noise { image: Some(&own), ..Noise::default() };
        let [test, test_alone] =
            [Noise { halves: Some(&halves), ..alone }, alone].map(|noise| z_test(&pairs, SIDE, noise).unwrap());
        // 0.05² + 0.1² is five times 0.05².
        assert!((test_alone.frame / test.frame - 5.0_f64.sqrt()).abs() < 1e-4, "{test:?} {test_alone:?}");
        assert!(z_test(&pairs, SIDE, Noise { halves: Some(&halves), ..Noise::default() }).is_none());
    }
}
