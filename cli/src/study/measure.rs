//! What the renders of a study come to.

use serde::Serialize;

use super::plan::Plan;
use super::renders::Renders;
use crate::exit::Failure;
use crate::picture::Picture;

/// As in `compare`: the share of the reference's squared mean that keeps dark pixels finite.
const RELATIVE_FLOOR: f64 = 0.01;
/// The share of the pixels of the second figure: without those that a few bright samples decide.
const BEST: f64 = 0.999;
/// The 97.5 % quantile of the normal distribution.
const NORMAL_975: f64 = 1.959_964;

/// A setting at a budget.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Point {
    /// Index of the setting.
    #[serde(skip)]
    pub setting: usize,
    /// The setting's name.
    pub name: String,
    /// Samples per pixel.
    pub spp: u64,
    /// Renders.
    pub seeds: usize,
    /// Mean seconds of a render.
    pub seconds: f64,
    /// Mean relMSE of a render: of products of the differences from both halves of the reference.
    pub relmse: f64,
    /// 95 % interval of that mean, from the spread of the renders of this setting.
    pub interval: [f64; 2],
    /// The same over the best 99.9 % of the pixels.
    pub relmse_best: f64,
    /// The part of the relMSE that is the same in all renders; without bias itself, so it may come out below 0.
    pub squared_bias: f64,
    /// Standard error of that, pixels taken to be independent.
    pub squared_bias_error: f64,
    /// The part that differs from render to render.
    pub variance: f64,
    /// Mean relMSE as the renders themselves estimate it, if all could tell.
    pub predicted: Option<f64>,
    /// Of each render.
    #[serde(skip)]
    pub errors: Vec<f64>,
}

/// All figures.
pub struct Measured {
    /// Setting by setting, budgets rising.
    pub points: Vec<Point>,
    /// relMSE of the mean of both halves of the reference, from their difference.
    pub reference_noise: f64,
}

/// Compares renders with their reference.
///
/// # Errors
/// A picture cannot be read or has another size.
pub fn measure(plan: &Plan, renders: &Renders, cpu_time: bool) -> Result<Measured, Failure> {
    let scale = Scale::new(&renders.reference)?;
    let mut points = Vec::new();
    for (setting, name) in plan.settings.iter().map(|setting| &setting.name).enumerate() {
        let first = points.len();
        for &spp in &plan.budgets {
            let of = renders.done.iter().filter(|done| (done.render.setting, done.render.spp) == (setting, spp));
            let mut group = Group::new(&scale);
            let (mut seconds, mut predicted) = (0.0, Some(0.0));
            for done in of {
                group.add(&Picture::read(&done.path, None)?)?;
                let record = &done.record;
                seconds += if cpu_time { record.cpu_seconds / record.threads as f64 } else { record.seconds };
                predicted = predicted.zip(record.estimate).map(|(sum, estimate)| sum + estimate);
            }
            let mut point = group.point(setting, name, spp, seconds);
            point.predicted = predicted.map(|sum| sum / point.seeds as f64);
            points.push(point);
        }
        intervals(&mut points[first..]);
    }
    Ok(Measured { points, reference_noise: scale.noise })
}

/// What errors are relative to.
struct Scale<'a> {
    halves: &'a [Picture; 2],
    /// For each pixel and channel, the reciprocal of the reference's square, floored.
    weights: Vec<[f64; 3]>,
    noise: f64,
}

impl<'a> Scale<'a> {
    fn new(halves: &'a [Picture; 2]) -> Result<Self, Failure> {
        let [a, b] = halves;
        same_size(a, b)?;
        let mean = |a: &[f32; 3], b: &[f32; 3]| [0, 1, 2].map(|c| 0.5 * (f64::from(a[c]) + f64::from(b[c])));
        let reference: Vec<[f64; 3]> = a.pixels.iter().zip(&b.pixels).map(|(a, b)| mean(a, b)).collect();
        let n = reference.len() as f64;
        let means = [0, 1, 2].map(|c| reference.iter().map(|pixel| pixel[c]).sum::<f64>() / n);
        let weight = |value: f64, c: usize| {
            let square = value * value + RELATIVE_FLOOR * means[c] * means[c];
            if square > 0.0 { square.recip() } else { 0.0 }
        };
        let weights: Vec<_> = reference.iter().map(|pixel| [0, 1, 2].map(|c| weight(pixel[c], c))).collect();
        let half = |at: usize, c: usize| 0.5 * (f64::from(a.pixels[at][c]) - f64::from(b.pixels[at][c]));
        let noise = (0..weights.len()).map(|at| (0..3).map(|c| half(at, c).powi(2) * weights[at][c]).sum::<f64>());
        Ok(Self { halves, noise: noise.sum::<f64>() / (3.0 * n), weights })
    }

    /// Squared error of each pixel of an image, relative, mean over channels; the halves' noise cancels in the mean.
    fn errors<'b>(&'b self, image: impl Fn(usize, usize) -> f64 + 'b) -> impl Iterator<Item = f64> + 'b {
        let [a, b] = self.halves;
        (0..self.weights.len()).map(move |at| {
            let product = |c: usize| {
                let value = image(at, c);
                (value - f64::from(a.pixels[at][c])) * (value - f64::from(b.pixels[at][c])) * self.weights[at][c]
            };
            (product(0) + product(1) + product(2)) / 3.0
        })
    }
}

fn same_size(a: &Picture, b: &Picture) -> Result<(), Failure> {
    if (a.width, a.height) == (b.width, b.height) {
        return Ok(());
    }
    Err(Failure::Input(format!(
        "the references and the renders differ in size: {} x {} and {} x {}; give the references' size with --resolution",
        a.width, a.height, b.width, b.height
    )))
}

/// Renders of one setting at one budget.
struct Group<'a> {
    scale: &'a Scale<'a>,
    /// Sums and sums of squares over the renders.
    sums: Vec<[f64; 3]>,
    squares: Vec<[f64; 3]>,
    errors: Vec<f64>,
    best: f64,
}

impl<'a> Group<'a> {
    fn new(scale: &'a Scale<'a>) -> Self {
        let zeros = vec![[0.0; 3]; scale.weights.len()];
        Self { scale, sums: zeros.clone(), squares: zeros, errors: Vec::new(), best: 0.0 }
    }

    fn add(&mut self, picture: &Picture) -> Result<(), Failure> {
        same_size(&self.scale.halves[0], picture)?;
        let mut errors: Vec<f64> = self.scale.errors(|at, c| f64::from(picture.pixels[at][c])).collect();
        self.errors.push(errors.iter().sum::<f64>() / errors.len() as f64);
        errors.sort_unstable_by(f64::total_cmp);
        let kept = ((errors.len() as f64 * BEST).round() as usize).clamp(1, errors.len());
        self.best += errors[..kept].iter().sum::<f64>() / kept as f64;
        for (at, pixel) in picture.pixels.iter().enumerate() {
            for (c, value) in pixel.map(f64::from).into_iter().enumerate() {
                self.sums[at][c] += value;
                self.squares[at][c] += value * value;
            }
        }
        Ok(())
    }

    fn point(&self, setting: usize, name: &str, spp: u64, seconds: f64) -> Point {
        let n = self.errors.len() as f64;
        let pixels = self.scale.weights.len() as f64;
        let spread = |at: usize, c: usize| {
            let variance = (self.squares[at][c] - self.sums[at][c].powi(2) / n) / (n - 1.0);
            variance.max(0.0) * self.scale.weights[at][c]
        };
        let variances: Vec<f64> =
            (0..self.sums.len()).map(|at| (0..3).map(|c| spread(at, c)).sum::<f64>() / 3.0).collect();
        // The mean of the renders has the bias of each, and an n-th of the variance.
        let of_mean = self.scale.errors(|at, c| self.sums[at][c] / n);
        let biases: Vec<f64> = of_mean.zip(&variances).map(|(error, variance)| error - variance / n).collect();
        let mean = |values: &[f64]| values.iter().sum::<f64>() / pixels;
        let squared_bias = mean(&biases);
        let squares = biases.iter().map(|bias| (bias - squared_bias).powi(2)).sum::<f64>();
        Point {
            setting,
            name: name.to_owned(),
            spp,
            seeds: self.errors.len(),
            seconds: seconds / n,
            relmse: self.errors.iter().sum::<f64>() / n,
            interval: [0.0; 2],
            relmse_best: self.best / n,
            squared_bias,
            squared_bias_error: squares.sqrt() / pixels,
            variance: mean(&variances),
            predicted: None,
            errors: self.errors.clone(),
        }
    }
}

/// Sets the intervals of a setting's points. Errors spread by factors, alike at all budgets: so the spread of their
/// logarithms is taken from all of them.
fn intervals(points: &mut [Point]) {
    let (mut squares, mut degrees) = (0.0, 0.0);
    for point in points.iter().filter(|point| point.errors.len() > 1 && point.errors.iter().all(|e| *e > 0.0)) {
        let logs: Vec<f64> = point.errors.iter().map(|error| error.ln()).collect();
        let mean = logs.iter().sum::<f64>() / logs.len() as f64;
        squares += logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>();
        degrees += logs.len() as f64 - 1.0;
    }
    let deviation = if degrees > 0.0 { (squares / degrees).sqrt() } else { 0.0 };
    for point in points {
        let factor = (student_975(degrees) * deviation / (point.errors.len() as f64).sqrt()).exp();
        point.interval = [point.relmse / factor, point.relmse * factor];
    }
}

/// The 97.5 % quantile of Student's distribution, to 1 % from 4 degrees of freedom on.
///
/// **Source**: \[Abramowitz64\] 26.7.5.
fn student_975(degrees: f64) -> f64 {
    let (z, n) = (NORMAL_975, degrees.max(1.0));
    let (z3, z5, z7) = (z.powi(3), z.powi(5), z.powi(7));
    z + (z3 + z) / (4.0 * n)
        + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * n * n)
        + (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / (384.0 * n * n * n)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(value: impl Fn(usize) -> f32) -> Picture {
        let window = oiio::Window::at_origin(64, 64);
        let pixels = (0..64 * 64).map(|at| [value(at); 3]).collect();
        Picture {
            width: 64,
            height: 64,
            pixels,
            data_window: window,
            display_window: window,
            eight_bit: false,
            filter: None,
        }
    }

    fn noise(at: usize, seed: u64) -> f32 {
        let mut x = (at as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ seed.wrapping_mul(0xd1b5_4a32_d192_ed03);
        x = (x ^ (x >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 32)).wrapping_mul(0x94d0_49bb_1331_11eb);
        // Uniform of variance 1.
        (((x >> 40) as f32 / (1u64 << 24) as f32) - 0.5) * 12.0_f32.sqrt()
    }

    /// Renders 1.1 ± 0.2 of halves 1 ± 0.05: bias² 0.01 and variance 0.04, over 1.01.
    #[test]
    fn bias_and_variance_come_apart() {
        let halves = [1, 2].map(|seed| picture(|at| 1.0 + 0.05 * noise(at, seed)));
        let scale = Scale::new(&halves).unwrap();
        let mut group = Group::new(&scale);
        for seed in 3..7 {
            group.add(&picture(|at| 1.1 + 0.2 * noise(at, seed))).unwrap();
        }
        let point = group.point(0, "none", 1, 4.0);
        // 4 × 4096 numbers know their variance to 1 % and their mean to 0.2 / 128, which moves a bias of 0.1 by 3 %; the
        // weights are those of noisy references, 1 ± 0.07: their mean is 1 % off.
        assert!((point.variance * 1.01 / 0.04 - 1.0).abs() < 0.04, "{point:?}");
        assert!((point.squared_bias * 1.01 / 0.01 - 1.0).abs() < 0.12, "{point:?}");
        assert!((point.relmse * 1.01 / 0.05 - 1.0).abs() < 0.04, "{point:?}");
        assert!(point.squared_bias_error > 0.0 && point.squared_bias_error < 0.1 * point.squared_bias, "{point:?}");
        assert_eq!(point.seconds, 1.0);
        assert!((scale.noise * 1.01 / (0.05 * 0.05 / 2.0) - 1.0).abs() < 0.1, "{}", scale.noise);
    }

    #[test]
    fn intervals_are_of_the_pooled_spread() {
        let halves = [1, 2].map(|_| picture(|_| 1.0));
        let scale = Scale::new(&halves).unwrap();
        let mut points = [1, 2].map(|spp| Group::new(&scale).point(0, "none", spp, 0.0));
        for point in &mut points {
            point.errors = vec![1.0_f64.exp(), (-1.0_f64).exp(), 1.0_f64.exp(), (-1.0_f64).exp()];
            point.relmse = 1.0;
        }
        intervals(&mut points);
        // Deviation √(8/6), 6 degrees of freedom: t = 2.447.
        let factor = (2.447 * (8.0_f64 / 6.0).sqrt() / 2.0).exp();
        assert!((points[0].interval[1] / factor - 1.0).abs() < 0.02, "{:?}", points[0].interval);
        assert!((student_975(4.0) / 2.776 - 1.0).abs() < 0.01 && (student_975(1e9) - NORMAL_975).abs() < 1e-6);
    }
}
