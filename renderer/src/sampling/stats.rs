//! Hypothesis tests shared by the statistical tests of all modules.

/// Probability that Pearson's χ² of a correct sampler exceeds that of `observed` counts against `expected` ones.
///
/// Cells expected to hold fewer than 5 samples are pooled, in order, until they hold that many (Cochran's rule), so
/// that the χ² distribution applies. A sample in cells of total expectation 0 gives p = 0.
pub(crate) fn chi2_p_value(observed: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(observed.len(), expected.len());
    let mut cells: Vec<(f64, f64)> = Vec::new();
    let (mut pooled_observed, mut pooled_expected) = (0.0, 0.0);
    for (&o, &e) in observed.iter().zip(expected) {
        if e == 0.0 && o > 0.0 {
            return 0.0;
        }
        if e >= 5.0 {
            cells.push((o, e));
            continue;
        }
        pooled_observed += o;
        pooled_expected += e;
        if pooled_expected >= 5.0 {
            cells.push((pooled_observed, pooled_expected));
            (pooled_observed, pooled_expected) = (0.0, 0.0);
        }
    }
    if let Some(last) = cells.last_mut() {
        last.0 += pooled_observed;
        last.1 += pooled_expected;
    }
    let chi2: f64 = cells.iter().map(|(o, e)| (o - e) * (o - e) / e).sum();
    let degrees = cells.len().saturating_sub(1);
    if degrees == 0 { 1.0 } else { upper_gamma(degrees as f64 / 2.0, chi2 / 2.0) }
}

/// Probability that |z| of a standard normal variable exceeds |`z`|.
pub(crate) fn normal_p_value(z: f64) -> f64 {
    upper_gamma(0.5, z * z / 2.0)
}

/// The regularised upper incomplete gamma function Q(a, x).
///
/// **Source**: \[Abramowitz64\] 6.5.29 (series) and 6.5.31 (continued fraction, by Lentz's method).
fn upper_gamma(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > sum * f64::EPSILON {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return 1.0 - front * sum;
    }
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (f64::MAX, 1.0 / b);
    let mut h = d;
    for i in 1..10_000 {
        let i = f64::from(i);
        let an = -i * (i - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        h *= d * c;
        if (d * c - 1.0).abs() < 4.0 * f64::EPSILON {
            break;
        }
    }
    front * h
}

/// ln Γ(x) for x > 0, by Stirling's series after the argument was raised to at least 12, where three terms leave less
/// than 1e-11.
fn ln_gamma(mut x: f64) -> f64 {
    let mut shift = 0.0;
    while x < 12.0 {
        shift += x.ln();
        x += 1.0;
    }
    let series = 1.0 / (12.0 * x) - 1.0 / (360.0 * x.powi(3)) + 1.0 / (1260.0 * x.powi(5));
    (x - 0.5) * x.ln() - x + 0.5 * std::f64::consts::TAU.ln() + series - shift
}

#[test]
fn p_values_match_tables() {
    // Upper 5 % and 1 % points of χ² with 1, 10 and 100 degrees of freedom, and of the normal distribution.
    for (degrees, chi2, p) in [(1.0, 3.841_459, 0.05), (10.0, 23.209_251, 0.01), (100.0, 124.342_113, 0.05)] {
        assert!((upper_gamma(degrees / 2.0, chi2 / 2.0) - p).abs() < 1e-7);
    }
    assert!((normal_p_value(1.959_964) - 0.05).abs() < 1e-6);
    assert!((ln_gamma(0.5) - std::f64::consts::PI.sqrt().ln()).abs() < 1e-10);
}
