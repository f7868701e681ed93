//! Spectra of lights: Planck's radiator, daylight, and the CIE's standard illuminants.

use std::sync::Arc;

use super::Spectrum;
use super::illuminant_data::{DAYLIGHT, FLUORESCENT};

/// Planck's law: spectral radiance of a black body, W·sr⁻¹·m⁻² per metre of wavelength.
///
/// `lambda_nm` in nm, temperature in kelvin. 0 where either is not positive.
pub fn blackbody_radiance(lambda_nm: f64, kelvin: f64) -> f64 {
    if !(lambda_nm > 0.0 && kelvin > 0.0) {
        return 0.0;
    }
    // Exact by the definition of the SI (2019).
    const C: f64 = 299_792_458.0;
    const H: f64 = 6.626_070_15e-34;
    const K: f64 = 1.380_649e-23;
    let lambda = lambda_nm * 1e-9;
    2.0 * H * C * C / (lambda.powi(5) * (H * C / (lambda * K * kelvin)).exp_m1())
}

/// [`blackbody_radiance`] relative to its maximum over all wavelengths.
pub(super) fn blackbody_relative(lambda_nm: f64, kelvin: f64) -> f64 {
    /// Wien's displacement constant, nm·K.
    const WIEN: f64 = 2.897_771_955e6;
    let peak = blackbody_radiance(WIEN / kelvin, kelvin);
    if peak > 0.0 { blackbody_radiance(lambda_nm, kelvin) / peak } else { 0.0 }
}

/// Weights M₁, M₂ of the principal components of daylight.
pub(super) type Daylight = [f64; 2];

/// D65, D50 and ACES' D60 are defined with weights rounded to three figures (CIE 015:2018 section 4.1.2; ACES TB-2014-004).
pub(super) const D65: Daylight = [-0.295, -0.689];
pub(super) const D50: Daylight = [-1.039, 0.363];
pub(super) const D60: Daylight = [-0.536, -0.519];

/// Relative power of a phase of daylight, 100 at 560 nm, linear between steps of 10 nm; 0 outside 300 nm to 830 nm.
pub(super) fn daylight_value([m1, m2]: Daylight, lambda_nm: f64) -> f64 {
    let [mean, first, second] = &DAYLIGHT;
    let x = (lambda_nm - 300.0) / 10.0;
    if !(0.0..=(mean.len() - 1) as f64).contains(&x) {
        return 0.0;
    }
    let low = (x as usize).min(mean.len() - 2);
    let at = |i: usize| mean[i] + m1 * first[i] + m2 * second[i];
    at(low) + (x - low as f64) * (at(low + 1) - at(low))
}

/// Daylight of a nominal colour temperature, such as 6500 for D65.
///
/// The nominal temperature is in the scale in which c₂ was 14380 µm·K. Below 4000 K, where daylight is not defined, it is
/// the black body of that temperature, as in pbrt-v4.
///
/// **Source**: CIE 015:2018 equations 4.7 to 4.12.
pub fn daylight(nominal_kelvin: f32) -> Spectrum {
    let kelvin = f64::from(nominal_kelvin) * 1.4388 / 1.4380;
    if kelvin < 4000.0 {
        return Spectrum::Blackbody(kelvin as f32);
    }
    let t = 1000.0 / kelvin;
    let x = if kelvin <= 7000.0 {
        0.244_063 + t * (0.099_11 + t * (2.967_8 - t * 4.607_0))
    } else {
        0.237_040 + t * (0.247_48 + t * (1.901_8 - t * 2.006_4))
    };
    let y = -3.0 * x * x + 2.870 * x - 0.275;
    let m = 0.0241 + 0.2562 * x - 0.7341 * y;
    daylight_spectrum([(-1.3515 - 1.7703 * x + 5.9114 * y) / m, (0.0300 - 31.4424 * x + 30.0717 * y) / m])
}

pub(super) fn daylight_spectrum(weights: Daylight) -> Spectrum {
    tabulate(300, 830, 10, |lambda| daylight_value(weights, lambda))
}

/// Illuminant A, tungsten: 100 at 560 nm (CIE 015:2018 equation 4.1, whose constants predate today's kelvin).
pub(super) fn tungsten() -> Spectrum {
    let planck = |lambda: f64| (1.435e7 / (2848.0 * lambda)).exp_m1();
    tabulate(300, 830, 5, |lambda| 100.0 * (560.0 / lambda).powi(5) * planck(560.0) / planck(lambda))
}

/// Fluorescent illuminant F1 to F12, by its number.
pub(super) fn fluorescent(number: usize) -> Option<Spectrum> {
    let table = FLUORESCENT.get(number.checked_sub(1)?)?;
    Some(Spectrum::Sampled(table.iter().enumerate().map(|(i, &value)| (380.0 + 5.0 * i as f32, value)).collect()))
}

/// Samples a function of the wavelength from `first` to `last` nm.
fn tabulate(first: u32, last: u32, step: usize, value: impl Fn(f64) -> f64) -> Spectrum {
    let samples: Arc<[_]> = (first..=last).step_by(step).map(|nm| (nm as f32, value(f64::from(nm)) as f32)).collect();
    Spectrum::Sampled(samples)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::observer;
    use crate::spectrum::observer_data::CIE_1931;
    use glam::DVec3;

    fn chromaticity(spectrum: &Spectrum) -> [f64; 2] {
        let xyz = observer::xyz(|lambda| spectrum.value(lambda));
        [xyz.x / xyz.element_sum(), xyz.y / xyz.element_sum()]
    }

    #[test]
    fn planck_obeys_stefan_boltzmann_and_wien() {
        for kelvin in [1000.0, 2856.0, 6504.0] {
            // ∫ L dλ = σT⁴/π. Midpoint rule on a logarithmic scale, from where the exponent is 700 to where the tail
            // (∝ λ⁻³) holds a part in 10⁹.
            let (low, high, n): (f64, f64, u32) = (1.439e7 / kelvin / 700.0, 1.439e7 / kelvin * 400.0, 20_000);
            let step = (high / low).ln() / f64::from(n);
            let sum: f64 = (0..n)
                .map(|i| {
                    let lambda = low * ((f64::from(i) + 0.5) * step).exp();
                    blackbody_radiance(lambda, kelvin) * lambda * 1e-9 * step
                })
                .sum();
            let exact = 5.670_374_419e-8 * kelvin.powi(4) / std::f64::consts::PI;
            assert!((sum / exact - 1.0).abs() < 1e-7, "{kelvin} K: {}", sum / exact);
        }
        assert!((blackbody_relative(2.897_771_955e6 / 5000.0, 5000.0) - 1.0).abs() < 1e-15);
        assert!(blackbody_relative(579.0, 5000.0) < 1.0 && blackbody_relative(580.1, 5000.0) < 1.0);
        assert_eq!((blackbody_radiance(0.0, 5000.0), blackbody_relative(500.0, -1.0)), (0.0, 0.0));
    }

    #[test]
    fn standard_illuminants_have_their_published_chromaticities() {
        // CIE 015:2018 tables 10.2 and 10.3, to the five and four figures printed there.
        let published = [
            (tungsten(), [0.44758, 0.40745]),
            (daylight_spectrum(D50), [0.34567, 0.35851]),
            (daylight_spectrum(D65), [0.31272, 0.32903]),
            (daylight_spectrum(D60), [0.32168, 0.33767]),
        ];
        for (spectrum, expected) in published {
            let found = chromaticity(&spectrum);
            assert!((0..2).all(|i| (found[i] - expected[i]).abs() < 5e-5), "{found:?} {expected:?}");
        }
        let fluorescent_xy = [
            [0.3131, 0.3371],
            [0.3721, 0.3751],
            [0.4091, 0.3941],
            [0.4402, 0.4031],
            [0.3138, 0.3452],
            [0.3779, 0.3882],
            [0.3129, 0.3292],
            [0.3458, 0.3586],
            [0.3741, 0.3727],
            [0.3458, 0.3588],
            [0.3805, 0.3769],
            [0.4370, 0.4042],
        ];
        for (i, expected) in fluorescent_xy.into_iter().enumerate() {
            // As the CIE sums: over the tabulated wavelengths, whose matching functions start 20 nm earlier.
            let sum: DVec3 =
                FLUORESCENT[i].iter().zip(&CIE_1931[4..]).map(|(&f, &row)| f64::from(f) * DVec3::from(row)).sum();
            let found = sum / sum.element_sum();
            // F10's printed x is 3e-4 below that of its table.
            let tolerance = if i + 1 == 10 { 3.5e-4 } else { 6e-5 };
            assert!((0..2).all(|c| (found[c] - expected[c]).abs() < tolerance), "F{}: {found} {expected:?}", i + 1);
            // At 1 nm, the lines, which such tables hold as triangles, are a little wider.
            let spectrum = chromaticity(&fluorescent(i + 1).unwrap());
            assert!((0..2).all(|c| (spectrum[c] - expected[c]).abs() < 1e-3), "F{}: {spectrum:?}", i + 1);
        }
    }

    #[test]
    fn daylight_by_temperature_meets_the_standard_ones() {
        // Rounding of the weights of the standard ones moves their chromaticity by less than 1e-4.
        for (kelvin, expected) in
            [(6500.0, [0.31272, 0.32903]), (5000.0, [0.34567, 0.35851]), (7500.0, [0.29902, 0.31485])]
        {
            let found = chromaticity(&daylight(kelvin));
            assert!((0..2).all(|i| (found[i] - expected[i]).abs() < 1e-4), "{found:?} {expected:?}");
        }
        assert_eq!(daylight(3500.0), Spectrum::Blackbody((3500.0 * 1.4388 / 1.4380) as f32));
    }

    #[test]
    fn illuminant_a_matches_its_table() {
        // CIE 015:2018 table 5.
        for (lambda, expected) in
            [(300.0, 0.930_483), (400.0, 14.708), (560.0, 100.0), (700.0, 198.261), (830.0, 261.602)]
        {
            assert!((tungsten().at(lambda) - expected).abs() < 1e-5 * expected);
        }
    }
}
