use super::*;

const GAUSSIAN: PixelFilterKind = PixelFilterKind::Gaussian { sigma: 0.5 };
const MITCHELL: PixelFilterKind = PixelFilterKind::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 };
const LANCZOS: PixelFilterKind = PixelFilterKind::LanczosSinc { tau: 3.0 };

/// Every kind, with unequal radii so that mixed-up axes show.
fn kinds() -> [PixelFilter; 6] {
    [
        (PixelFilterKind::Box, Vec2::new(0.5, 0.75)),
        (PixelFilterKind::Triangle, Vec2::new(2.0, 1.25)),
        (GAUSSIAN, Vec2::new(1.5, 2.0)),
        (PixelFilterKind::Gaussian { sigma: 3.0 }, Vec2::new(1.5, 1.0)),
        (MITCHELL, Vec2::new(2.0, 2.5)),
        (LANCZOS, Vec2::new(4.0, 3.0)),
    ]
    .map(|(kind, radius)| PixelFilter { radius, kind })
}

/// An equidistributed sequence of `n` points (the R2 sequence: fractional parts of multiples of 1/ρ, 1/ρ², with ρ the
/// plastic number).
fn points(n: u32) -> impl Iterator<Item = Vec2> {
    (1..=n).map(|k| {
        let fraction = |alpha: f64| ((f64::from(k) * alpha).fract() as f32).min(1.0 - 0.5 * f32::EPSILON);
        Vec2::new(fraction(0.754_877_666_246_692_8), fraction(0.569_840_290_998_053_3))
    })
}

/// An independent uniform sequence (SplitMix64), for tests whose null distribution assumes independence.
fn random_points(n: u32, mut state: u64) -> impl Iterator<Item = Vec2> {
    let mut next = move || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = (state ^ (state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    };
    (0..n).map(move |_| Vec2::new(next(), next()))
}

/// ∫f or ∫|f| over [a, b] along one axis, by the midpoint rule.
fn integral(filter: &PixelFilter, axis: usize, a: f64, b: f64, magnitude: bool) -> f64 {
    const STEPS: u32 = 2000;
    let step = (b - a) / f64::from(STEPS);
    (0..STEPS)
        .map(|k| {
            let f = profile(filter.kind, f64::from(filter.radius[axis]), a + (f64::from(k) + 0.5) * step);
            step * if magnitude { f.abs() } else { f }
        })
        .sum()
}

/// χ² of the offsets against |f| on a 21 × 21 grid. Under the null hypothesis the statistic has mean k and variance 2k
/// for k degrees of freedom; six standard deviations are never met by chance, while mistaking σ = 0.5 for 0.52 costs
/// hundreds.
#[test]
fn offsets_are_distributed_as_the_magnitude_of_the_filter() {
    const BINS: usize = 21;
    const SAMPLES: u32 = 400_000;
    for filter in kinds() {
        let sampler = Filter::build(&filter).unwrap();
        let shares: [Vec<f64>; 2] = [0, 1].map(|axis| {
            let radius = f64::from(filter.radius[axis]);
            let edge = |k: usize| radius * (2.0 * k as f64 / BINS as f64 - 1.0);
            let bins: Vec<f64> = (0..BINS).map(|k| integral(&filter, axis, edge(k), edge(k + 1), true)).collect();
            let total: f64 = bins.iter().sum();
            bins.iter().map(|bin| bin / total).collect()
        });
        let mut counts = vec![0_u32; BINS * BINS];
        for u in random_points(SAMPLES, 7) {
            let cell = (sampler.sample(u).offset / filter.radius + Vec2::ONE) * 0.5 * BINS as f32;
            counts[(cell.y as usize).min(BINS - 1) * BINS + (cell.x as usize).min(BINS - 1)] += 1;
        }
        // Bins that expect fewer than 5 are pooled, as the χ² approximation demands.
        let (mut chi2, mut cells, mut pooled) = (0.0, 0, (0.0, 0.0));
        for (k, &count) in counts.iter().enumerate() {
            let expected = f64::from(SAMPLES) * shares[0][k % BINS] * shares[1][k / BINS];
            if expected < 5.0 {
                pooled = (pooled.0 + expected, pooled.1 + f64::from(count));
            } else {
                chi2 += (f64::from(count) - expected).powi(2) / expected;
                cells += 1;
            }
        }
        if pooled.0 > 5.0 {
            chi2 += (pooled.1 - pooled.0).powi(2) / pooled.0;
            cells += 1;
        }
        let freedom = f64::from(cells - 1);
        assert!((chi2 - freedom).abs() < 6.0 * (2.0 * freedom).sqrt(), "{filter:?}: χ² {chi2} for {freedom}");
    }
}

/// The weights make a constant image constant, and reproduce the filter's second moment. The sequence's discrepancy is
/// O(log²n / n), far below the tolerance; the tables' own error is the square of a bin's width.
#[test]
fn weights_have_a_mean_of_one_and_keep_the_moments_of_the_filter() {
    const SAMPLES: u32 = 200_000;
    for filter in kinds() {
        let sampler = Filter::build(&filter).unwrap();
        let (mut weights, mut first, mut second) = (0.0, glam::DVec2::ZERO, glam::DVec2::ZERO);
        for sample in points(SAMPLES).map(|u| sampler.sample(u)) {
            assert!(sample.offset.abs().cmple(filter.radius).all() && sample.weight.is_finite());
            let (offset, weight) = (sample.offset.as_dvec2(), f64::from(sample.weight));
            (weights, first, second) = (weights + weight, first + offset * weight, second + offset * offset * weight);
        }
        let n = f64::from(SAMPLES);
        assert!((weights / n - 1.0).abs() < 1e-3, "{filter:?}: mean weight {}", weights / n);
        for axis in 0..2 {
            let radius = f64::from(filter.radius[axis]);
            let moment = |power: i32| {
                let steps = 20_000;
                let at = |k: i32| (f64::from(k) + 0.5) / f64::from(steps) * 2.0 * radius - radius;
                let f = |k: i32| profile(filter.kind, radius, at(k));
                (0..steps).map(|k| at(k).powi(power) * f(k)).sum::<f64>() / (0..steps).map(f).sum::<f64>()
            };
            assert!((first[axis] / n - moment(1)).abs() < 2e-3 * radius, "{filter:?}: first moment {first}");
            assert!((second[axis] / n - moment(2)).abs() < 2e-3 * radius * radius, "{filter:?}: {second}");
        }
    }
}

/// The mean of the weights is 1 by construction; what is left is the rounding of the cumulative shares to 24 bits.
#[test]
fn the_weights_of_a_table_average_to_one() {
    for filter in kinds() {
        if let Sampler::Tables(tables) = Filter::build(&filter).unwrap().sampler {
            for table in tables.iter() {
                let share = |bin: usize| f64::from(table.cumulative[bin + 1]) - f64::from(table.cumulative[bin]);
                let mean: f64 = (0..Table::BINS).map(|bin| share(bin) * f64::from(table.weights[bin])).sum();
                assert!((mean - 1.0).abs() < 4.0 * f64::from(f32::EPSILON), "{filter:?} {mean}");
            }
        }
    }
}

#[test]
fn offsets_increase_with_u_and_end_at_the_radius() {
    for filter in kinds() {
        let sampler = Filter::build(&filter).unwrap();
        // u has 24 bits: where the density falls linearly to zero its rounding is worth √ε of the radius. The Gaussian
        // of four standard deviations keeps less than that beyond 98 % of them.
        let near = |a: Vec2, b: Vec2| (a - b).abs().cmple(filter.radius * 2.0e-2).all();
        assert!(near(sampler.sample(Vec2::ZERO).offset, -filter.radius), "{filter:?}");
        assert!(near(sampler.sample(Vec2::splat(1.0 - 0.5 * f32::EPSILON)).offset, filter.radius), "{filter:?}");
        assert!(near(sampler.sample(Vec2::splat(0.5)).offset, Vec2::ZERO), "{filter:?}");
        let mut last = -filter.radius.x;
        for k in 0..10_000 {
            let x = sampler.sample(Vec2::new(k as f32 / 10_000.0, 0.3)).offset.x;
            assert!(x >= last, "{filter:?}: not monotone at {k}");
            last = x;
        }
    }
}

#[test]
fn the_filter_is_symmetric() {
    for filter in kinds() {
        let sampler = Filter::build(&filter).unwrap();
        for u in points(1000) {
            // A grid of 2⁻²³ on which 1 − u is exact.
            let u = (u * (1 << 23) as f32).floor() / (1 << 23) as f32;
            let (a, b) = (sampler.sample(u), sampler.sample(Vec2::ONE - u));
            assert_eq!(a.weight, b.weight, "{filter:?}");
            // The tent's root amplifies half an ulp of u near its ends.
            assert!((a.offset + b.offset).abs().cmple(filter.radius * 1.0e-3).all(), "{filter:?} {a:?} {b:?}");
        }
    }
}

/// Mitchell's negative lobe lies beyond half the radius, the Lanczos sinc's signs change at the integers.
#[test]
fn weights_are_negative_in_negative_lobes_only() {
    let radius = Vec2::splat(2.0);
    let mitchell = Filter::build(&PixelFilter { radius, kind: MITCHELL }).unwrap();
    let lanczos = Filter::build(&PixelFilter { radius: Vec2::splat(4.0), kind: LANCZOS }).unwrap();
    let mut negative = 0;
    for u in points(20_000) {
        let sample = mitchell.sample(Vec2::new(u.x, 0.5));
        let value = profile(MITCHELL, 2.0, f64::from(sample.offset.x));
        // Within a bin around the change of sign the weight is between the two.
        assert!(value.abs() < 2e-3 || (f64::from(sample.weight) * value > 0.0), "{sample:?}");
        negative += u32::from(sample.weight < 0.0);
        let sample = lanczos.sample(Vec2::new(u.x, 0.5));
        let value = profile(LANCZOS, 4.0, f64::from(sample.offset.x));
        assert!(value.abs() < 2e-3 || (f64::from(sample.weight) * value > 0.0), "{sample:?} {value}");
    }
    assert!(negative > 500, "{negative}");
}

#[test]
fn a_filter_without_weights_is_an_error() {
    let unit = Vec2::ONE;
    for (kind, radius) in [
        (PixelFilterKind::Box, Vec2::new(0.5, 0.0)),
        (PixelFilterKind::Triangle, Vec2::new(f32::NAN, 1.0)),
        (PixelFilterKind::Gaussian { sigma: 0.0 }, unit),
        (PixelFilterKind::Mitchell { b: f32::INFINITY, c: 0.0 }, unit),
        (PixelFilterKind::Mitchell { b: 5.0e4, c: 0.0 }, unit),
        (PixelFilterKind::LanczosSinc { tau: f32::NAN }, unit),
    ] {
        let built = Filter::build(&PixelFilter { kind, radius });
        if let Ok(filter) = built {
            let mean = points(50_000).map(|u| f64::from(filter.sample(u).weight)).sum::<f64>() / 50_000.0;
            panic!("{kind:?} {radius} was accepted, mean weight {mean}");
        }
    }
}
