//! How far an image is from a reference.

use serde::Serialize;

use crate::flip;
use crate::picture::Picture;
use crate::significance::{self, Errors, Noise, Prediction, ZTest};
use crate::ssim;

/// Side of the blocks whose means are compared, in pixels: large enough that the noise of a fair reference averages out,
/// small enough that a wrong material shows.
const BLOCK: usize = 32;
/// Keeps the relative error of dark pixels finite: this share of the squared mean of the reference.
const RELATIVE_FLOOR: f64 = 0.01;
/// The share of the pixels without those that a few bright samples decide.
const BEST: f64 = 0.999;

/// All figures. Pixels that are not finite in either image are counted and left out of the rest.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Width and height in pixels.
    pub resolution: [usize; 2],
    /// Mean over pixels and channels of (I − R)² / (R² + 0.01 mean(R)²). With a second reference S it is (I − R)(I − S) in
    /// place of the square, so that the references' noise cancels, and everywhere else their mean is the reference.
    pub relmse: f64,
    /// The same for each channel.
    pub relmse_channels: [f64; 3],
    /// The same over the best 99.9 % of the pixels: what renders estimate of themselves.
    pub relmse_best: f64,
    /// √ of the mean over pixels and channels of (I − R)².
    pub rmse: f64,
    /// Mean of I over mean of R for each channel; `None` where R is black and I is not.
    pub mean_ratio: [Option<f64>; 3],
    /// Median over blocks of Σ|mean(I) − mean(R)| / Σ mean(R), both sums over channels.
    pub block_difference: f64,
    /// Largest |I − R|.
    pub max_difference: f64,
    /// Structural similarity of tone-mapped luminance.
    pub ssim: f64,
    /// Peak signal over noise of tone-mapped values, dB.
    pub psnr: f64,
    /// HDR-FLIP: 0 where no difference is seen, at most 1.
    pub flip: f64,
    /// The exposures that it looked at, in stops.
    pub flip_exposures: [f64; 2],
    /// Whether the noise that is known explains the difference; `None` if none is known.
    pub z_test: Option<ZTest>,
    /// What the image's `error` layer says; `None` without one.
    pub predicted: Option<Prediction>,
    /// Pixels that are not finite, in the image and in the reference or the second one.
    pub non_finite: [u64; 2],
}

/// What images are measured against.
pub struct Reference<'a> {
    /// The reference.
    pub picture: &'a Picture,
    /// Another, independent one.
    pub second: Option<&'a Picture>,
    /// Standard errors of the reference's pixels, if they are known.
    pub errors: Option<Errors<'a>>,
}

/// Measures `image`, whose standard errors may be known, against a reference. All have the same size.
pub fn compare(image: &Picture, errors: Option<Errors<'_>>, reference: &Reference<'_>) -> Comparison {
    let finite = |pixel: &[f32; 3]| pixel.iter().all(|value| value.is_finite());
    let first = &reference.picture.pixels;
    let second = reference.second.map_or(first, |second| &second.pixels);
    // Half the difference between the references; the two are at R ± that.
    let halves: Vec<[f32; 3]> =
        first.iter().zip(second).map(|(a, b)| [0, 1, 2].map(|c| 0.5 * a[c] - 0.5 * b[c])).collect();
    let pairs: Vec<Pair> = (image.pixels.iter().zip(first).zip(second))
        .map(|((i, a), b)| {
            let mean = || [0, 1, 2].map(|c| 0.5 * (f64::from(a[c]) + f64::from(b[c])));
            (finite(i) && finite(a) && finite(b)).then(|| (i.map(f64::from), mean()))
        })
        .collect();
    let mean_r = channel_means(&pairs, |_, r, _| r);
    let mean_i = channel_means(&pairs, |i, _, _| i);
    let scale = |r: f64, c: usize| r * r + RELATIVE_FLOOR * mean_r[c] * mean_r[c];
    let relative = |(pair, half): (&Pair, &[f32; 3])| {
        let (i, r) = pair.as_ref()?;
        Some([0, 1, 2].map(|c| {
            let (difference, half) = (i[c] - r[c], f64::from(half[c]));
            let square = (difference - half) * (difference + half);
            // Only a channel that is black all over has no floor, and then either no error or an infinite one.
            if square == 0.0 { 0.0 } else { square / scale(r[c], c) }
        }))
    };
    let relative: Vec<[f64; 3]> = pairs.iter().zip(&halves).filter_map(relative).collect();
    let relmse_channels =
        [0, 1, 2].map(|c| relative.iter().map(|pixel| pixel[c]).sum::<f64>() / relative.len().max(1) as f64);
    let squares = channel_means(&pairs, |i, r, _| (i - r).powi(2));
    let differences = pairs.iter().flatten().flat_map(|(i, r)| (0..3).map(|c| (i[c] - r[c]).abs()));
    let flip = flip::hdr_flip(&pairs, image.width);
    let halves = reference.second.map(|_| halves.as_slice());
    let noise = Noise { image: errors, reference: reference.errors, halves };
    Comparison {
        resolution: [image.width, image.height],
        relmse: relmse_channels.iter().sum::<f64>() / 3.0,
        relmse_channels,
        relmse_best: best(&relative),
        rmse: (squares.iter().sum::<f64>() / 3.0).sqrt(),
        mean_ratio: [0, 1, 2].map(|c| ratio(mean_i[c], mean_r[c])),
        block_difference: median(block_differences(&pairs, image.width)),
        max_difference: differences.fold(0.0, f64::max),
        ssim: ssim::ssim(&pairs, image.width),
        psnr: ssim::psnr(&pairs),
        flip: flip.mean,
        flip_exposures: flip.exposures,
        z_test: significance::z_test(&pairs, image.width, noise),
        predicted: significance::predict(&pairs, noise, |r, c| scale(r[c], c)),
        non_finite: [
            image.pixels.iter().filter(|pixel| !finite(pixel)).count() as u64,
            first.iter().zip(second).filter(|(a, b)| !(finite(a) && finite(b))).count() as u64,
        ],
    }
}

/// Mean over channels and the best 99.9 % of the pixels.
fn best(relative: &[[f64; 3]]) -> f64 {
    let mut sorted: Vec<f64> = relative.iter().map(|pixel| pixel.iter().sum::<f64>() / 3.0).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let kept = (sorted.len() as f64 * BEST).round() as usize;
    sorted[..kept].iter().sum::<f64>() / kept.max(1) as f64
}

/// Mean over pixels of a function of I, R and the channel's index.
fn channel_means(pairs: &[Pair], value: impl Fn(f64, f64, usize) -> f64) -> [f64; 3] {
    let count = pairs.iter().flatten().count().max(1) as f64;
    [0, 1, 2].map(|c| pairs.iter().flatten().map(|(i, r)| value(i[c], r[c], c)).sum::<f64>() / count)
}

/// A pixel of the image and of the reference, unless one of them is not finite.
pub type Pair = Option<([f64; 3], [f64; 3])>;

fn ratio(a: f64, b: f64) -> Option<f64> {
    if b != 0.0 {
        Some(a / b)
    } else if a == 0.0 {
        Some(1.0)
    } else {
        None
    }
}

/// Blocks at the right and lower edges are smaller.
fn block_differences(pairs: &[Pair], width: usize) -> Vec<f64> {
    let across = width.div_ceil(BLOCK);
    let down = (pairs.len() / width).div_ceil(BLOCK);
    let mut sums = vec![([0.0; 3], [0.0; 3]); across * down];
    for (index, (i, r)) in pairs.iter().enumerate().filter_map(|(index, pair)| Some((index, pair.as_ref()?))) {
        let (sum_i, sum_r) = &mut sums[index / width / BLOCK * across + index % width / BLOCK];
        for c in 0..3 {
            sum_i[c] += i[c];
            sum_r[c] += r[c];
        }
    }
    let difference = |(i, r): &([f64; 3], [f64; 3])| {
        let off: f64 = (0..3).map(|c| (i[c] - r[c]).abs()).sum();
        if off == 0.0 { 0.0 } else { off / r.iter().sum::<f64>().abs() }
    };
    sums.iter().map(difference).collect()
}

/// The lower of the two middle values of an even number of them.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len().saturating_sub(1) / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: usize, height: usize, value: impl Fn(usize, usize) -> [f32; 3]) -> Picture {
        let pixels = (0..width * height).map(|at| value(at % width, at / width)).collect();
        let window = oiio::Window::at_origin(width, height);
        Picture { width, height, pixels, data_window: window, display_window: window, eight_bit: false, filter: None }
    }

    fn compare(image: &Picture, reference: &Picture) -> Comparison {
        super::compare(image, None, &Reference { picture: reference, second: None, errors: None })
    }

    #[test]
    fn an_image_equals_itself() {
        let image = picture(70, 40, |x, y| [x as f32, y as f32, 0.0]);
        let result = compare(&image, &image);
        assert_eq!((result.relmse, result.rmse, result.block_difference, result.max_difference), (0.0, 0.0, 0.0, 0.0));
        assert_eq!(result.mean_ratio, [Some(1.0); 3]);
        assert!((result.ssim - 1.0).abs() < 1e-12);
    }

    /// R = 1 and I = 1.5 everywhere: (0.5)² / (1 + 0.01) in each channel.
    #[test]
    fn constant_images_give_the_figures_of_the_formulas() {
        let (image, reference) = (picture(64, 64, |_, _| [1.5; 3]), picture(64, 64, |_, _| [1.0; 3]));
        let result = compare(&image, &reference);
        assert!((result.relmse - 0.25 / 1.01).abs() < 1e-12);
        assert!((result.rmse - 0.5).abs() < 1e-12 && (result.block_difference - 0.5).abs() < 1e-12);
        assert_eq!(result.mean_ratio, [Some(1.5); 3]);
    }

    /// Channel means 2, 4, 0: the floor is each channel's own.
    #[test]
    fn channels_are_judged_by_their_own_mean() {
        let reference = picture(2, 1, |x, _| [[1.0, 4.0, 0.0], [3.0, 4.0, 0.0]][x]);
        let image = picture(2, 1, |x, _| [[2.0, 4.0, 0.0], [3.0, 5.0, 0.0]][x]);
        let result = compare(&image, &reference);
        let expected = [0.5 / (1.0 + 0.04), 0.5 / (16.0 + 0.16), 0.0];
        for (found, expected) in result.relmse_channels.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{result:?}");
        }
        assert_eq!(result.mean_ratio, [Some(1.25), Some(1.125), Some(1.0)]);
    }

    #[test]
    fn one_wrong_block_of_five_leaves_the_median_alone() {
        let reference = picture(160, 20, |_, _| [1.0; 3]);
        let image = picture(160, 20, |x, _| if x < 32 { [9.0; 3] } else { [1.02; 3] });
        let result = compare(&image, &reference);
        assert!((result.block_difference - 0.02).abs() < 1e-6, "{}", result.block_difference);
    }

    #[test]
    fn pixels_that_are_not_finite_are_counted_and_left_out() {
        let reference = picture(8, 8, |_, _| [1.0; 3]);
        let image = picture(8, 8, |x, y| if (x, y) == (3, 3) { [f32::NAN, 1.0, 1.0] } else { [1.0; 3] });
        let result = compare(&image, &reference);
        assert_eq!((result.non_finite, result.relmse), ([1, 0], 0.0));
        assert!(result.ssim.is_finite());
    }

    #[test]
    fn a_second_reference_that_is_not_finite_is_counted() {
        let (a, b) = (picture(4, 4, |_, _| [1.0; 3]), picture(4, 4, |x, _| [[f32::NAN, 1.0][x.min(1)]; 3]));
        let reference = Reference { picture: &a, second: Some(&b), errors: None };
        assert_eq!(super::compare(&a, None, &reference).non_finite, [0, 4]);
    }

    #[test]
    fn light_where_the_reference_is_black_is_infinitely_wrong() {
        let (image, reference) = (picture(4, 4, |_, _| [1.0; 3]), picture(4, 4, |_, _| [0.0; 3]));
        let result = compare(&image, &reference);
        assert!(result.relmse.is_infinite() && result.block_difference.is_infinite());
        assert_eq!(result.mean_ratio, [None; 3]);
        assert!(result.ssim < 0.5, "{}", result.ssim);
    }

    /// References 1 ± 0.5 and an image between them: their noise cancels, and 0.3 from both sides adds.
    #[test]
    fn noise_of_two_references_cancels() {
        let (a, b) = (picture(16, 16, |_, _| [1.5; 3]), picture(16, 16, |_, _| [0.5; 3]));
        let reference = Reference { picture: &a, second: Some(&b), errors: None };
        let found = super::compare(&picture(16, 16, |_, _| [1.0; 3]), None, &reference);
        assert!((found.relmse + 0.25 / 1.01).abs() < 1e-12 && found.rmse == 0.0, "{found:?}");
        let chequers = |sign: f32| picture(16, 16, |x, y| [1.0 + sign * if (x + y) % 2 == 0 { 0.5 } else { -0.5 }; 3]);
        let (a, b) = (chequers(1.0), picture(16, 16, |_, _| [1.0; 3]));
        let reference = Reference { picture: &a, second: Some(&b), errors: None };
        // R is 1.25 or 0.75: Σ (0.3 ∓ 0.5) 0.3 / (R² + 0.01).
        let found = super::compare(&picture(16, 16, |_, _| [1.3; 3]), None, &reference);
        let expected = 0.5 * (-0.2 * 0.3 / (1.25 * 1.25 + 0.01) + 0.8 * 0.3 / (0.75 * 0.75 + 0.01));
        assert!((found.relmse - expected).abs() < 1e-6, "{found:?} {expected}");
    }
}
