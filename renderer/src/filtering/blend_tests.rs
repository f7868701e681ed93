use super::*;
use crate::sampling::mix64;

const SIDE: usize = 96;

/// Independent normal numbers of mean 0 and variance 1, by pixel and use.
fn noise(pixel: usize, of: u64) -> f32 {
    let uniform = |of: u64| (mix64((pixel as u64) << 8 | of) >> 11) as f64 / (1u64 << 53) as f64;
    // Box and Muller's.
    let (radius, angle) = ((-2.0 * (1.0 - uniform(2 * of)).ln()).sqrt(), std::f64::consts::TAU * uniform(2 * of + 1));
    (radius * angle.cos()) as f32
}

/// A white frame whose unfiltered halves have noise of standard deviation `sigma`, and whose filtered value is off by
/// `bias` of the pixel.
fn frame(sigma: f32, halves: bool, bias: impl Fn(usize, usize) -> f32) -> Frame {
    let pixel = |i: usize| {
        let [a, b] = [0, 1].map(|half| sigma * noise(i, half));
        Pixel {
            own: Vec3::splat(1.0 + 0.5 * (a + b)),
            own_noise: halves.then(|| Vec3::splat(0.5 * (a - b))),
            base: Vec3::splat(1.0 + bias(i % SIDE, i / SIDE)),
            ..Pixel::default()
        }
    };
    Frame { width: SIDE, rows: (0..SIDE).map(|y| (y * SIDE..(y + 1) * SIDE).map(pixel).collect()).collect() }
}

/// Mean squared error of the blend over all pixels.
fn error(frame: &Frame) -> f32 {
    let (values, _) = frame.blend(&Blend::default());
    values.iter().map(|value| (value.x - 1.0).powi(2)).sum::<f32>() / values.len() as f32
}

#[test]
fn a_good_filter_is_left_alone() {
    for sigma in [1e-3, 0.1, 1.0] {
        for halves in [true, false] {
            let gain = 0.5 * sigma * sigma / error(&frame(sigma, halves, |_, _| 0.0));
            // Of a filter without error: what chance speaks against it costs a ninetieth of the noise at most. Where noise
            // is not seen it counts for nine times as much.
            assert!(gain > 90.0, "{sigma} {halves}: {gain}");
        }
    }
}

#[test]
fn a_bad_filter_is_dropped() {
    for (sigma, bias) in [(1e-3, 0.1), (0.1, 1.0)] {
        let gain = 0.5 * sigma * sigma / error(&frame(sigma, true, |_, _| bias));
        assert!((0.98..1.02).contains(&gain), "{sigma}: {gain}");
    }
}

#[test]
fn an_error_of_one_pixel_is_found_once_the_noise_is_below_it() {
    // A window's mean of one error among many scatters as much as it is large: only the noise tells it is no chance.
    let lone = |x: usize, y: usize| if x % 32 == 16 && y % 32 == 16 { 0.5 } else { 0.0 };
    let at = 16 * SIDE + 16;
    let off = |sigma: f32| (frame(sigma, true, lone).blend(&Blend::default()).0[at].x - 1.0).abs();
    assert!(off(1e-3) < 0.01 && off(1e-4) < 1e-3, "{} {}", off(1e-3), off(1e-4));
}

/// The lowest gain over no filter, with biases of all sizes beside the noise in patches of all sizes.
fn lowest_gain(sigma: f32) -> f32 {
    let mut lowest = f32::INFINITY;
    for side in [1, 4, 16, 96] {
        for bias in [0.1, 0.3, 0.7, 1.0, 1.5, 2.0, 3.0, 10.0] {
            let patches = |x: usize, y: usize| if (x / side + y / side) % 2 == 0 { bias * sigma } else { 0.0 };
            lowest = lowest.min(0.5 * sigma * sigma / error(&frame(sigma, true, patches)));
        }
    }
    lowest
}

#[test]
fn no_bias_makes_it_worse_than_no_filter() {
    let lowest = lowest_gain(0.1);
    assert!(lowest >= 0.98, "{lowest}");
}

#[test]
fn patches_ten_times_too_bright_cost_little() {
    // They count as ten times as bright as they are beside pixels that do not, whose noise then seems to be theirs: that
    // such errors do no harm either is not reached, though they remain small.
    let lowest = lowest_gain(1.0);
    assert!(lowest >= 0.7, "{lowest}");
}

#[test]
fn a_firefly_is_not_taken_for_the_filters_error() {
    let mut frame = frame(0.1, true, |_, _| 0.0);
    let at = 40 * SIDE + 40;
    // In one half of the samples, as any single path is.
    let pixel = &mut frame.rows[at / SIDE][at % SIDE];
    pixel.own += 500.0;
    *pixel.own_noise.as_mut().unwrap() += 500.0;
    let value = frame.blend(&Blend::default()).0[at].x;
    assert!((value - 1.0).abs() < 0.05, "{value}");
}

/// A window in which no path has found light has no noise of its own, and must not be believed to be black.
#[test]
fn where_light_is_rare_hardly_any_hole_is_left() {
    for halves in [true, false] {
        // One half of a pixel in 50 finds it, 50 times as bright: 81 of 100 windows of nine pixels have seen none.
        let found = |pixel: usize, half: u64| if mix64((pixel as u64) << 8 | half) % 50 == 0 { 50.0 } else { 0.0 };
        let mut frame = frame(0.0, halves, |_, _| 0.0);
        for (i, pixel) in frame.rows.iter_mut().flatten().enumerate() {
            let [a, b] = [found(i, 0), found(i, u64::from(halves))];
            pixel.own = Vec3::splat(0.5 * (a + b));
            pixel.own_noise = halves.then(|| Vec3::splat(0.5 * (a - b)));
        }
        let (values, _) = frame.blend(&Blend::default());
        let dark = values.iter().filter(|value| value.x < 0.5).count();
        assert!(100 * dark < values.len(), "{halves}: {dark} of {}", values.len());
    }
}

/// As behind a pane: what is seen by all has little noise, and what only few find is missed by many windows without a sign.
#[test]
fn light_that_few_paths_find_leaves_no_cracks() {
    for halves in [true, false] {
        // Two fifths of the light, which one half of a pixel in 50 finds.
        let found = |pixel: usize, half: u64| if mix64((pixel as u64) << 8 | half) % 50 == 0 { 20.0 } else { 0.0 };
        let mut frame = frame(0.0, halves, |_, _| 0.0);
        for (i, pixel) in frame.rows.iter_mut().flatten().enumerate() {
            let [a, b] = [0, u64::from(halves)].map(|half| 0.6 + 0.05 * noise(i, half) + found(i, half));
            pixel.own = Vec3::splat(0.5 * (a + b));
            pixel.own_noise = halves.then(|| Vec3::splat(0.5 * (a - b)));
        }
        let (values, _) = frame.blend(&Blend::default());
        let dark = values.iter().filter(|value| value.x < 0.9).count();
        assert!(100 * dark < values.len(), "{halves}: {dark} of {}", values.len());
    }
}

#[test]
fn the_doubt_is_the_variance_of_the_error() {
    // Over many pixels of one bias and noise: a product of two normal-like numbers and its sample variance. Relative errors
    // of both are below 6/√n for numbers whose fourth power has a standard deviation below six times its mean.
    let n = 1 << 16;
    for bias in [0.0, 0.5, 2.0] {
        let evidence = |i: usize| {
            let [a, b] = [0, 1].map(|half| noise(i, half));
            let from_filtered = Vec3::splat(0.5 * (a + b) - bias);
            Difference { from_filtered, noise: Some(Vec3::splat(0.5 * (a - b))), scale: 1.0 }
        };
        let all: Vec<Evidence> = (0..n).map(|i| evidence(i).evidence(|| evidence(i))).collect();
        let mean = |of: &dyn Fn(&Evidence) -> f64| all.iter().map(of).sum::<f64>() / n as f64;
        let error = mean(&|e| e.error.into());
        let variance = mean(&|e| (f64::from(e.error) - error).powi(2));
        let doubt = mean(&|e| e.doubt.into());
        let tolerance = 6.0 / f64::from(n as u32).sqrt();
        assert!((doubt / variance - 1.0).abs() < tolerance, "{bias}: {doubt} {variance}");
        let expected = 3.0 * f64::from(bias).powi(2);
        assert!((error - expected).abs() < 3.0 * (variance / n as f64).sqrt(), "{bias}: {error} {expected}");
    }
}
