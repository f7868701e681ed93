//! The errors of a film's pixels, from what its samples say.

use glam::DVec3;

use super::Estimate;
use super::filtered::{self, Earlier};
use super::unfiltered;
use crate::film::Film;
use crate::math::{Rgb, luminance, windows};

/// As in relMSE: the share of a channel's squared mean that keeps dark pixels finite.
const RELATIVE_FLOOR: f64 = 0.01;
/// As in relMSE: the share of the pixels that count, the best ones. The rest are so few that their samples say little of them.
const BEST: f64 = 0.999;
/// Half the side of the windows over which errors are pooled: 49 degrees of freedom know a standard error to 10 %.
const RADIUS: usize = 3;
/// Side of the blocks whose scatter gives the frame's interval: cells of the filter are smaller.
const BLOCK: usize = 16;
/// Half the width of a 95 % interval, in standard errors.
pub(super) const NORMAL_95: f64 = 1.959_964;

/// A pixel of a frame.
pub(super) struct Pixel {
    pub value: DVec3,
    /// Half the difference of even and odd samples.
    pub noise: DVec3,
}

/// What is known of a frame's error.
pub(super) struct Judgement {
    pub relmse: f64,
    pub interval: [f64; 2],
    /// Squared errors that tell pixels apart, each times its weight.
    pub local: Vec<DVec3>,
    pub weights: Vec<DVec3>,
    /// What they are to be multiplied by to be right in the mean.
    pub level: f64,
}

/// Standard error of each pixel, film RGB, and that of the frame.
pub(super) fn estimate(film: &Film, earlier: Option<&Earlier>) -> (Vec<Rgb>, Option<Estimate>) {
    let width = film.bounds().width() as usize;
    let pixel = |at| {
        let [even, odd] = film.pixel(at).halves()?;
        Some(Pixel { value: film.value(at), noise: 0.5 * (even - odd) })
    };
    let pixels: Option<Vec<Pixel>> = film.bounds().pixels().map(pixel).collect();
    let judgement = match (&pixels, film.filtered(), earlier) {
        (Some(pixels), false, _) => Some(unfiltered::judge(pixels, width)),
        (Some(pixels), true, Some(earlier)) => Some(filtered::judge(film, pixels, earlier, width)),
        _ => None,
    };
    let (Some(pixels), Some(Judgement { relmse, interval, local, weights, level })) = (pixels, judgement) else {
        return (vec![Rgb::ZERO; film.bounds().area() as usize], None);
    };
    let errors = pooled(local, &weights, level, width);
    let total: f64 = pixels.iter().map(|p| f64::from(luminance(p.value.as_vec3()))).sum();
    if !is_known(total, pixels.iter().map(|p| f64::from(luminance(p.noise.abs().as_vec3()))).collect()) {
        return (errors, None);
    }
    let noise = errors.iter().map(|error| f64::from(luminance(*error))).sum::<f64>() / total.max(f64::MIN_POSITIVE);
    (errors, Some(Estimate { relmse, interval, noise }))
}

/// Whether there is light, of this sum, of which the worst pixels' noise is less than half. If not, hardly a path has found any
/// yet, and that the best pixels agree on darkness says nothing of the error.
fn is_known(light: f64, mut noise: Vec<f64>) -> bool {
    noise.sort_unstable_by(|a, b| b.total_cmp(a));
    // Of frames so small that none is left out, the worst pixel's.
    let worst = noise.len().saturating_sub(kept(noise.len())).max(1);
    light > 0.0 && 2.0 * noise.iter().take(worst).sum::<f64>() < light
}

/// How many of so many pixels are the best.
fn kept(pixels: usize) -> usize {
    ((pixels as f64 * BEST).round() as usize).clamp(1, pixels.max(1))
}

/// Standard errors from squares that were multiplied by `weights`.
pub(super) fn pooled(squares: Vec<DVec3>, weights: &[DVec3], level: f64, width: usize) -> Vec<Rgb> {
    let root = |square: f64, weight: f64| if weight > 0.0 { (level * square / weight).sqrt() } else { 0.0 };
    let of_pixel = |(square, weight): (DVec3, &DVec3)| {
        DVec3::new(root(square.x, weight.x), root(square.y, weight.y), root(square.z, weight.z)).as_vec3()
    };
    windows(squares, width, RADIUS, |sum, count| sum / count as f64).into_iter().zip(weights).map(of_pixel).collect()
}

/// What keeps weights finite: a share of each channel's squared mean.
pub(super) fn floor(values: &[DVec3]) -> DVec3 {
    let mean = values.iter().sum::<DVec3>() / values.len().max(1) as f64;
    RELATIVE_FLOOR * mean * mean
}

/// What a squared error is multiplied by where the reference's square is `square`.
pub(super) fn weight(square: DVec3, floor: DVec3) -> DVec3 {
    (square + floor).to_array().map(|x| if x > 0.0 { x.recip() } else { 0.0 }).into()
}

/// Which pixels are among the best by these squares.
pub(super) fn best(squares: &[DVec3]) -> Vec<bool> {
    let sums: Vec<f64> = squares.iter().map(|square| square.element_sum()).collect();
    let kept = kept(sums.len());
    let mut sorted = sums.clone();
    if sorted.is_empty() {
        return Vec::new();
    }
    let most = *sorted.select_nth_unstable_by(kept - 1, f64::total_cmp).1;
    sums.into_iter().map(|sum| sum <= most).collect()
}

/// Mean over channels and the pixels that are kept, and its standard error: from neighbouring blocks, which differ little
/// but by noise.
pub(super) fn mean_and_error(squares: &[DVec3], kept: &[bool], width: usize) -> (f64, f64) {
    let height = squares.len() / width.max(1);
    let sum = |pixel: usize| if kept[pixel] { squares[pixel].element_sum() } else { 0.0 };
    let mut blocks = Vec::new();
    for y in (0..height).step_by(BLOCK) {
        for x in (0..width).step_by(BLOCK) {
            let row = |y| (y * width + x..y * width + width.min(x + BLOCK)).map(sum).sum::<f64>();
            blocks.push((y..height.min(y + BLOCK)).map(row).sum::<f64>());
        }
    }
    let count = 3.0 * kept.iter().filter(|kept| **kept).count().max(1) as f64;
    let pairs = blocks.windows(2).map(|pair| 0.5 * (pair[0] - pair[1]).powi(2)).sum::<f64>();
    let variance = pairs * blocks.len() as f64 / (blocks.len() as f64 - 1.0).max(1.0);
    (blocks.iter().sum::<f64>() / count, variance.sqrt() / count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_that_hardly_any_light_has_reached_is_not_judged() {
        // Found by one half of the samples, light is as large as its noise.
        let found = |lit: usize| (0..2000).map(|pixel| if pixel < lit { 1.0 } else { 0.0 }).collect::<Vec<_>>();
        for lit in [0, 1, 2, 4] {
            assert!(!is_known(lit as f64, found(lit)), "{lit}");
        }
        assert!(is_known(5.0, found(5)) && is_known(2000.0, found(2000)));
        // A lamp of two pixels that all samples see.
        assert!(is_known(1e4, vec![0.01; 2000]));
        assert!(!is_known(0.0, Vec::new()));
    }

    #[test]
    fn the_worst_thousandth_does_not_count() {
        let mut squares = vec![DVec3::ONE; 2000];
        squares[7] = DVec3::splat(1e9);
        squares[8] = DVec3::splat(2.0);
        let kept = best(&squares);
        assert_eq!(kept.iter().filter(|kept| !**kept).count(), 2);
        assert!(!kept[7] && !kept[8]);
        assert_eq!(mean_and_error(&squares, &kept, 50).0, 1.0);
        assert_eq!(best(&[DVec3::ONE]), [true]);
        assert!(best(&[]).is_empty());
    }
}
