//! How alike images look on a display: structural similarity, and signal over noise.

use crate::metric::Pair;
use crate::tone;

/// Luminance weights of Rec.709.
const LUMINANCE: [f64; 3] = [0.212_639, 0.715_169, 0.072_192];
/// Half width and standard deviation of the Gaussian window, pixels.
const RADIUS: usize = 5;
const SIGMA: f64 = 1.5;
/// What the mean luminance of the reference is exposed to.
const KEY: f64 = 0.18;

/// Luminance of linear Rec.709.
pub fn luminance(rgb: &[f64; 3]) -> f64 {
    (0..3).map(|c| LUMINANCE[c] * rgb[c]).sum()
}

/// What makes the reference's mean luminance 0.18.
fn exposure(pairs: &[Pair]) -> f64 {
    let mean = pairs.iter().flatten().map(|(_, r)| luminance(r)).sum::<f64>() / pairs.len().max(1) as f64;
    if mean > 0.0 { KEY / mean } else { 1.0 }
}

/// The display value, in [0, 1], of an exposed one.
fn shown(exposed: f64) -> f64 {
    let y = exposed.max(0.0);
    f64::from(tone::srgb_from_linear((y / (1.0 + y)) as f32))
}

/// Peak signal over noise, in dB, of display values: tone-mapped as for [`ssim`], but each channel by itself. Infinite
/// where they are the same.
pub fn psnr(pairs: &[Pair]) -> f64 {
    let exposure = exposure(pairs);
    let square = |(i, r): &([f64; 3], [f64; 3])| -> f64 {
        (0..3).map(|c| (shown(exposure * i[c]) - shown(exposure * r[c])).powi(2)).sum()
    };
    let count = 3 * pairs.iter().flatten().count().max(1);
    -10.0 * (pairs.iter().flatten().map(square).sum::<f64>() / count as f64).log10()
}

/// The mean structural similarity of the luminances, tone-mapped alike: exposed so that the reference's mean becomes
/// 0.18, compressed by y / (1 + y) and sRGB-encoded. 1 where they are the same. Pixels without a value are black in both.
///
/// **Source**: \[Wang04\], with its window and constants; the window is cut off and renormalised at the image's edges.
pub fn ssim(pairs: &[Pair], width: usize) -> f64 {
    let exposure = exposure(pairs);
    let seen = |rgb: &[f64; 3]| shown(exposure * luminance(rgb));
    let (a, b): (Vec<f64>, Vec<f64>) =
        pairs.iter().map(|pair| pair.as_ref().map_or((0.0, 0.0), |(i, r)| (seen(i), seen(r)))).unzip();
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).collect::<Vec<_>>();
    let blurred =
        [a.clone(), b.clone(), product(&a, &a), product(&b, &b), product(&a, &b)].map(|map| blur(&map, width));
    let [mean_a, mean_b, square_a, square_b, cross] = &blurred;
    let (c1, c2) = (0.01_f64.powi(2), 0.03_f64.powi(2));
    let similarity = |at: usize| {
        let (ma, mb) = (mean_a[at], mean_b[at]);
        let (va, vb, covariance) = (square_a[at] - ma * ma, square_b[at] - mb * mb, cross[at] - ma * mb);
        (2.0 * ma * mb + c1) * (2.0 * covariance + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2))
    };
    (0..pairs.len()).map(similarity).sum::<f64>() / pairs.len().max(1) as f64
}

/// A Gaussian blur, along rows and then along columns.
fn blur(map: &[f64], width: usize) -> Vec<f64> {
    let height = map.len() / width.max(1);
    let rows = blur_lines(map, width, height, 1, width);
    blur_lines(&rows, height, width, width, 1)
}

/// Blurs `lines` lines of `length` values each: `step` apart along a line, `pitch` from line to line.
fn blur_lines(map: &[f64], length: usize, lines: usize, step: usize, pitch: usize) -> Vec<f64> {
    let weights: Vec<f64> =
        (0..=2 * RADIUS).map(|k| (-0.5 * ((k as f64 - RADIUS as f64) / SIGMA).powi(2)).exp()).collect();
    let mut blurred = vec![0.0; map.len()];
    for line in 0..lines {
        for at in 0..length {
            let (mut sum, mut total) = (0.0, 0.0);
            for near in at.saturating_sub(RADIUS)..(at + RADIUS + 1).min(length) {
                let weight = weights[near + RADIUS - at];
                sum += weight * map[line * pitch + near * step];
                total += weight;
            }
            blurred[line * pitch + at * step] = sum / total;
        }
    }
    blurred
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(width: usize, height: usize, value: impl Fn(f64, f64) -> (f64, f64)) -> Vec<Pair> {
        (0..width * height)
            .map(|at| {
                let (i, r) = value((at % width) as f64, (at / width) as f64);
                Some(([i; 3], [r; 3]))
            })
            .collect()
    }

    #[test]
    fn blurring_keeps_constants_and_the_sum_of_an_inner_point() {
        assert!(blur(&[0.7; 12 * 9], 12).iter().all(|value| (value - 0.7).abs() < 1e-12));
        let mut point = vec![0.0; 31 * 25];
        point[12 * 31 + 15] = 1.0;
        let spread = blur(&point, 31);
        assert!((spread.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert!((spread[12 * 31 + 16] - spread[13 * 31 + 15]).abs() < 1e-15);
    }

    /// Mean 1 is exposed to 0.18 and shown as srgb(0.18 / 1.18); twice that as srgb(0.36 / 1.36).
    #[test]
    fn signal_over_noise_is_of_display_values() {
        let found = psnr(&pairs(8, 8, |_, _| (2.0, 1.0)));
        let shown = |y: f64| f64::from(tone::srgb_from_linear((y / (1.0 + y)) as f32));
        assert!((found + 20.0 * (shown(0.36) - shown(0.18)).log10()).abs() < 1e-9, "{found}");
        assert_eq!(psnr(&pairs(8, 8, |_, _| (2.0, 2.0))), f64::INFINITY);
    }

    #[test]
    fn similarity_falls_with_noise_blur_and_inversion() {
        let wave = |x: f64, y: f64| 1.0 + 0.8 * (0.7 * x).sin() * (0.5 * y).cos();
        let same = ssim(&pairs(40, 30, |x, y| (wave(x, y), wave(x, y))), 40);
        let near = ssim(&pairs(40, 30, |x, y| (wave(x, y) + 0.05 * (91.7 * x * y).sin(), wave(x, y))), 40);
        let flat = ssim(&pairs(40, 30, |x, y| (1.0, wave(x, y))), 40);
        let inverse = ssim(&pairs(40, 30, |x, y| (2.0 - wave(x, y), wave(x, y))), 40);
        assert!((same - 1.0).abs() < 1e-9, "{same}");
        assert!(same > near && near > 0.9 && near > flat && flat > inverse, "{near} {flat} {inverse}");
    }

    /// Two constants: what is left is (2ab + c1) / (a² + b² + c1).
    #[test]
    fn constants_differ_by_their_luminance_term() {
        let shown = |y: f64| f64::from(tone::srgb_from_linear((y / (1.0 + y)) as f32));
        let (a, b) = (shown(0.36), shown(0.18));
        let expected = (2.0 * a * b + 1e-4) / (a * a + b * b + 1e-4);
        let found = ssim(&pairs(20, 20, |_, _| (2.0, 1.0)), 20);
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
    }
}
