//! The error of an unfiltered frame: the variance of each pixel.

use glam::DVec3;

use super::estimator::{Judgement, NORMAL_95, Pixel, best, floor, mean_and_error, weight};
use crate::math::{wiener, windows};

/// Half the side of the neighbourhood that stands for a pixel's reference.
const AROUND: usize = 2;

/// How far weights are off, in parts of the error: in eleven scenes of 16 to 256 samples up to a fifth in four of five frames.
/// Fine detail beside something bright makes them too small, light that is seldom found too large.
const WEIGHTS: f64 = 0.1;

/// Judges a frame by the halves of its samples.
///
/// The reference of relMSE is not known. In the mean over the frame the pixels around stand for each: with its own value
/// weights would be small where its error is large. There are 24 of them: of 8 that by chance have found no light, which
/// happens where it is rare, weights would be many times too large. Where errors are pooled and given back to pixels, such
/// a weight would let a firefly among the neighbours swell a pixel's error, and the edge of something bright that of what is
/// dark beside it; there it is the pixel's value after a Wiener filter.
pub(super) fn judge(pixels: &[Pixel], width: usize) -> Judgement {
    let (values, noise): (Vec<DVec3>, Vec<DVec3>) = pixels.iter().map(|pixel| (pixel.value, pixel.noise)).unzip();
    let floor = floor(&values);
    let weighted = |weights: &[DVec3]| noise.iter().zip(weights).map(|(noise, w)| *noise * *noise * *w).collect();
    let weights: Vec<DVec3> = wiener(&values, &noise, width).into_iter().map(|x| weight(x * x, floor)).collect();
    let around: Vec<DVec3> = around(&values, width).into_iter().map(|x| weight(x * x, floor)).collect();
    let whole: Vec<DVec3> = weighted(&around);
    let (relmse, error) = mean_and_error(&whole, &best(&whole), width);
    let half = NORMAL_95 * error.hypot(WEIGHTS * relmse);
    Judgement {
        relmse,
        interval: [(relmse - half).max(0.0), relmse + half],
        local: weighted(&weights),
        weights,
        level: 1.0,
    }
}

/// The mean of the pixels around each, itself left out.
fn around(values: &[DVec3], width: usize) -> Vec<DVec3> {
    if values.len() < 2 {
        return values.to_vec();
    }
    let sums = windows(values.to_vec(), width, AROUND, |sum, count| (sum, count as f64 - 1.0));
    sums.into_iter().zip(values).map(|((sum, others), value)| (sum - *value) / others).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::estimator::pooled;

    /// Pixels of 1 with noise 0.1, and one of 1000 with this noise.
    fn frame(lamp: Option<f64>) -> Vec<Pixel> {
        let mut pixels: Vec<Pixel> =
            (0..32 * 32).map(|_| Pixel { value: DVec3::ONE, noise: DVec3::splat(0.1) }).collect();
        if let Some(noise) = lamp {
            pixels[16 * 32 + 16] = Pixel { value: DVec3::splat(1e3), noise: DVec3::splat(noise) };
        }
        pixels
    }

    #[test]
    fn a_pixel_beside_a_lamp_keeps_its_own_error() {
        let error = |pixels: &[Pixel], at: usize| {
            let Judgement { local, weights, level, .. } = judge(pixels, 32);
            pooled(local, &weights, level, 32)[at].x
        };
        // The lamp is known to 1 %, the pixel to 10 %: pooled, 48 of 49 such squares.
        let (beside, alone) = (error(&frame(Some(10.0)), 16 * 32 + 17), error(&frame(None), 16 * 32 + 17));
        assert!((beside / alone - 1.0).abs() < 0.02, "{beside} {alone}");
        assert!((alone - 0.1).abs() < 1e-6, "{alone}");
    }

    #[test]
    fn a_frame_of_one_pixel_is_its_own_reference() {
        let judged = judge(&[Pixel { value: DVec3::ONE, noise: DVec3::splat(0.1) }], 1);
        assert!((judged.relmse - 0.01 / 1.01).abs() < 1e-12, "{}", judged.relmse);
    }
}
