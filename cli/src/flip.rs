//! What an eye sees that flips between two images: FLIP, over the exposures that a picture of high dynamic range needs.
//!
//! **Source**: \[Andersson20\] for one exposure, \[Andersson21\] for many; equations are theirs. Images are seen at
//! [`PIXELS_PER_DEGREE`]; at their edges the last pixel goes on.

use rayon::prelude::*;

use crate::metric::Pair;
use crate::tone;

/// The authors' viewer: 0.7 m from a screen of 0.7 m with 3840 pixels. (Degrees are small here: π/180 is their tangent.)
const PIXELS_PER_DEGREE: f64 = 3840.0 * std::f64::consts::PI / 180.0;
/// Display values of the brightest and of the median pixel at the two ends of the exposures. \[Andersson21, Sec. 4\]
const SHOWN: f64 = 0.85;
/// A median this far below the brightest pixel, in stops, stands for darker ones: 32-bit floats end here.
const STOPS: f64 = 23.0;

/// What is seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Flip {
    /// From 0, no difference is seen, to 1: mean over the pixels.
    pub mean: f64,
    /// The first and the last exposure that were looked at, in stops.
    pub exposures: [f64; 2],
}

/// HDR-FLIP of an image against a reference: at each pixel the largest difference over all exposures. Pixels without a
/// value are black in both.
pub fn hdr_flip(pairs: &[Pair], width: usize) -> Flip {
    if pairs.is_empty() {
        return Flip { mean: 0.0, exposures: [0.0; 2] };
    }
    let [start, stop] = exposures(pairs);
    let count = (stop - start).ceil().max(2.0);
    let difference = |step: usize| {
        let scale = (start + step as f64 * (stop - start) / (count - 1.0)).exp2();
        let shown = |rgb: [f64; 3]| rgb.map(|value| f64::from(tone::filmic((value * scale).max(0.0) as f32)).min(1.0));
        let (image, reference) = pairs
            .iter()
            .map(|pair| pair.map_or(([0.0; 3], [0.0; 3]), |(i, r)| (shown(i), shown(r))))
            .unzip::<_, _, Vec<_>, Vec<_>>();
        flip(&image, &reference, width)
    };
    let largest = |a: Vec<f64>, b: Vec<f64>| a.iter().zip(&b).map(|(a, b)| a.max(*b)).collect::<Vec<_>>();
    let map = (0..count as usize).into_par_iter().map(difference).reduce(|| vec![0.0; pairs.len()], largest);
    Flip { mean: map.iter().sum::<f64>() / map.len() as f64, exposures: [start, stop] }
}

/// Exposures, in stops, that show the reference's brightest pixel and its median one. \[Andersson21, Eq. 5\]
fn exposures(pairs: &[Pair]) -> [f64; 2] {
    let mut bright: Vec<f64> = pairs.iter().map(|pair| pair.map_or(0.0, |(_, r)| luminance(r))).collect();
    bright.sort_unstable_by(f64::total_cmp);
    let (low, high) = (bright[(bright.len() - 1) / 2], bright[bright.len() / 2]);
    let max = bright[bright.len() - 1];
    if max <= 0.0 {
        return [0.0; 2];
    }
    let median = (0.5 * (low + high)).max(max * (-STOPS).exp2());
    let shown = tone::filmic_inverse(SHOWN);
    [(shown / max).log2(), (shown / median).log2()]
}

/// The difference at each pixel, of linear display values in [0, 1]. \[Andersson20, Eq. 11\]
fn flip(image: &[[f64; 3]], reference: &[[f64; 3]], width: usize) -> Vec<f64> {
    let (seen, seen_reference) = (Seen::new(image, width), Seen::new(reference, width));
    let farthest = hyab(hunt_lab([0.0, 1.0, 0.0]), hunt_lab([0.0, 0.0, 1.0])).powf(COLOUR_POWER);
    (0..image.len())
        .map(|at| {
            let distance = hyab(seen.colours[at], seen_reference.colours[at]).powf(COLOUR_POWER);
            let colour = compress(distance / farthest);
            let [edge, point] = [0, 1].map(|k| (seen.features[at][k] - seen_reference.features[at][k]).abs());
            // Eq. 10; a step from black to white has features of 1, and both directions together √2.
            let feature = (edge.max(point) / std::f64::consts::SQRT_2).sqrt();
            colour.powf(1.0 - feature)
        })
        .collect()
}

/// q of Sec. 4.1.3.
const COLOUR_POWER: f64 = 0.7;

/// Gives small differences most of the range. \[Andersson20, Sec. 4.1.3\]
fn compress(share: f64) -> f64 {
    let (knee, value) = (0.4, 0.95);
    if share < knee { value / knee * share } else { value + (share - knee) / (1.0 - knee) * (1.0 - value) }
}

/// An image as it is compared.
struct Seen {
    /// Lab with Hunt's effect, of the image without what is too fine to see.
    colours: Vec<[f64; 3]>,
    /// Strengths of edges and of points.
    features: Vec<[f64; 2]>,
}

impl Seen {
    fn new(image: &[[f64; 3]], width: usize) -> Self {
        let opponent: Vec<[f64; 3]> = image.iter().map(|rgb| opponent_from_xyz(xyz_from_rgb(*rgb))).collect();
        let channel = |c: usize| opponent.iter().map(|pixel| pixel[c]).collect::<Vec<_>>();
        let [y, cx, cz] = [0, 1, 2].map(|c| SENSITIVITY[c].blur(&channel(c), width));
        let colour = |at: usize| {
            let rgb = rgb_from_xyz(xyz_from_opponent([y[at], cx[at], cz[at]]));
            hunt_lab(rgb.map(|value| value.clamp(0.0, 1.0)))
        };
        let achromatic: Vec<f64> = channel(0).iter().map(|y| (y + 16.0) / 116.0).collect();
        Self { colours: (0..image.len()).map(colour).collect(), features: features(&achromatic, width) }
    }
}

/// The eye's response to a channel as a sum of two Gaussians, in degrees: amplitudes a and widths b of Eq. 2 and Table 1.
struct Sensitivity {
    a: [f64; 2],
    b: [f64; 2],
}

/// Of Y, Cx and Cz.
const SENSITIVITY: [Sensitivity; 3] = [
    Sensitivity { a: [1.0, 0.0], b: [0.0047, 1.0e-5] },
    Sensitivity { a: [1.0, 0.0], b: [0.0053, 1.0e-5] },
    Sensitivity { a: [34.1, 13.5], b: [0.04, 0.025] },
];

impl Sensitivity {
    fn blur(&self, map: &[f64], width: usize) -> Vec<f64> {
        // Three standard deviations of the widest of all.
        let pi = std::f64::consts::PI;
        let radius = (3.0 * (0.04 / (2.0 * pi * pi)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
        let mut sum = vec![0.0; map.len()];
        let mut total = 0.0;
        for (a, b) in self.a.into_iter().zip(self.b).filter(|(a, _)| *a > 0.0) {
            let kernel: Vec<f64> =
                (-radius..=radius).map(|x| (-(pi * f64::from(x) / PIXELS_PER_DEGREE).powi(2) / b).exp()).collect();
            let amplitude = a * (pi / b).sqrt();
            total += amplitude * kernel.iter().sum::<f64>().powi(2);
            let blurred = convolve(map, width, &kernel, &kernel);
            sum.iter_mut().zip(blurred).for_each(|(sum, value)| *sum += amplitude * value);
        }
        sum.iter().map(|value| value / total).collect()
    }
}

/// Strengths of edges and of points: first and second derivatives of a Gaussian. \[Andersson20, Sec. 4.2\]
fn features(achromatic: &[f64], width: usize) -> Vec<[f64; 2]> {
    let deviation = 0.5 * 0.082 * PIXELS_PER_DEGREE;
    let radius = (3.0 * deviation).ceil() as i32;
    let kernel = |weight: &dyn Fn(f64) -> f64| -> Vec<f64> {
        let value = |x: f64| weight(x / deviation) * (-0.5 * (x / deviation).powi(2)).exp();
        let values: Vec<f64> = (-radius..=radius).map(|x| value(f64::from(x))).collect();
        // Positive weights sum to 1, negative ones to -1.
        let positive: f64 = values.iter().filter(|value| **value > 0.0).sum();
        let negative: f64 = -values.iter().filter(|value| **value < 0.0).sum::<f64>();
        values
            .iter()
            .map(|value| value / if *value > 0.0 { positive } else { negative.max(f64::MIN_POSITIVE) })
            .collect()
    };
    let (smooth, edge, point) = (kernel(&|_| 1.0), kernel(&|x| -x), kernel(&|x| x * x - 1.0));
    let strength = |across: &[f64]| -> Vec<f64> {
        let (x, y) = (convolve(achromatic, width, across, &smooth), convolve(achromatic, width, &smooth, across));
        x.iter().zip(y).map(|(x, y)| x.hypot(y)).collect()
    };
    strength(&edge).into_iter().zip(strength(&point)).map(|(edge, point)| [edge, point]).collect()
}

/// Convolves rows and then columns, with kernels of odd length about their middle.
fn convolve(map: &[f64], width: usize, rows: &[f64], columns: &[f64]) -> Vec<f64> {
    let height = map.len() / width;
    let near = |at: usize, step: usize, radius: usize, size: usize| (at + step).saturating_sub(radius).min(size - 1);
    let mut across = vec![0.0; map.len()];
    for (line, out) in map.chunks_exact(width).zip(across.chunks_exact_mut(width)) {
        for (x, out) in out.iter_mut().enumerate() {
            *out = rows.iter().enumerate().map(|(k, weight)| weight * line[near(x, k, rows.len() / 2, width)]).sum();
        }
    }
    let mut down = vec![0.0; map.len()];
    for (y, out) in down.chunks_exact_mut(width).enumerate() {
        for (k, weight) in columns.iter().enumerate() {
            let line = &across[near(y, k, columns.len() / 2, height) * width..][..width];
            out.iter_mut().zip(line).for_each(|(out, value)| *out += weight * value);
        }
    }
    down
}

/// Linear Rec.709 to XYZ, each relative to that of white.
const XYZ_FROM_RGB: [[f64; 3]; 3] = [
    [0.433_895_388_8, 0.376_242_372_6, 0.189_862_238_6],
    [0.212_636_821_7, 0.715_182_981_8, 0.072_180_196_5],
    [0.017_752_423_2, 0.109_465_628_6, 0.872_781_948_2],
];
/// Its inverse.
const RGB_FROM_XYZ: [[f64; 3]; 3] = [
    [3.080_341_99, -1.537_398_97, -0.542_943_02],
    [-0.921_178_40, 1.875_929_98, 0.045_248_41],
    [0.052_881_29, -0.204_011_21, 1.151_129_91],
];

fn luminance(rgb: [f64; 3]) -> f64 {
    xyz_from_rgb(rgb)[1]
}

fn xyz_from_rgb(rgb: [f64; 3]) -> [f64; 3] {
    product(&XYZ_FROM_RGB, rgb)
}

fn rgb_from_xyz(xyz: [f64; 3]) -> [f64; 3] {
    product(&RGB_FROM_XYZ, xyz)
}

fn product(matrix: &[[f64; 3]; 3], vector: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|row| (0..3).map(|c| matrix[row][c] * vector[c]).sum())
}

/// YCxCz: linear in light, so that light may be averaged in it. \[Andersson20, Sec. 4.1.1\]
fn opponent_from_xyz([x, y, z]: [f64; 3]) -> [f64; 3] {
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn xyz_from_opponent([y, cx, cz]: [f64; 3]) -> [f64; 3] {
    let y = (y + 16.0) / 116.0;
    [y + cx / 500.0, y, y - cz / 200.0]
}

/// CIE L*a*b* with a* and b* less where it is dark, after Hunt. \[Andersson20, Eq. 5\]
fn hunt_lab(rgb: [f64; 3]) -> [f64; 3] {
    let delta: f64 = 6.0 / 29.0;
    let root = |t: f64| if t > delta.powi(3) { t.cbrt() } else { t / (3.0 * delta * delta) + 4.0 / 29.0 };
    let [x, y, z] = xyz_from_rgb(rgb).map(root);
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}

/// A distance that holds for large differences of colour. \[Andersson20, Eq. 6\]
fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

#[cfg(test)]
#[path = "flip_tests.rs"]
mod tests;
