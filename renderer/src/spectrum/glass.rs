//! Refractive indices of optical glasses.

use super::Spectrum;

/// Coefficients B and C (µm²) of the dispersion formula n² = 1 + Σ Bᵢλ²/(λ² − Cᵢ).
type Sellmeier = [[f64; 3]; 2];

/// The glass of this name of Schott's catalogue, from 290 nm to 920 nm.
///
/// The names F5, F10 and F11 stand for SF5, SF10 and SF11, as in pbrt-v4.
pub(super) fn glass(name: &str) -> Option<Spectrum> {
    let coefficients: Sellmeier = match name {
        "BK7" => [[1.039_612_12, 0.231_792_344, 1.010_469_45], [0.006_000_698_67, 0.020_017_914_4, 103.560_653]],
        "BAF10" => [[1.585_149_5, 0.143_559_385, 1.085_212_69], [0.009_266_812_82, 0.042_448_980_5, 105.613_573]],
        "FK51A" => [[0.971_247_817, 0.216_901_417, 0.904_651_666], [0.004_723_019_95, 0.015_357_561_2, 168.681_33]],
        "LASF9" => [[2.000_295_47, 0.298_926_886, 1.806_918_43], [0.012_142_601_7, 0.053_873_623_6, 156.530_829]],
        "F5" => [[1.524_818_89, 0.187_085_527, 1.427_290_15], [0.011_254_756, 0.058_899_539_2, 129.141_675]],
        "F10" => [[1.621_539_02, 0.256_287_842, 1.644_475_52], [0.012_224_145_7, 0.059_573_677_5, 147.468_793]],
        "F11" => [[1.737_596_95, 0.313_747_346, 1.898_781_01], [0.013_188_707, 0.062_306_814_2, 155.236_29]],
        _ => return None,
    };
    // In steps of 10 nm a linear interpolation is off by less than 2e-4, near the ultraviolet end, and 2e-5 at 500 nm.
    let samples = (290..=920).step_by(10).map(|nm| (nm as f32, index(&coefficients, f64::from(nm)) as f32));
    Some(Spectrum::Sampled(samples.collect()))
}

fn index([b, c]: &Sellmeier, lambda_nm: f64) -> f64 {
    let squared = (lambda_nm * 1e-3).powi(2);
    (1.0 + (0..3).map(|i| b[i] * squared / (squared - c[i])).sum::<f64>()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glasses_have_their_catalogued_indices() {
        // n_d of Schott's data sheets.
        for (name, n_d) in [
            ("BK7", 1.51680),
            ("BAF10", 1.67003),
            ("FK51A", 1.48656),
            ("LASF9", 1.85025),
            ("F5", 1.67270),
            ("F10", 1.72825),
            ("F11", 1.78472),
        ] {
            let index = glass(name).unwrap().refractive_index();
            assert!((index - n_d).abs() < 3e-5, "{name}: {index}");
        }
        assert!(glass("BK8").is_none());
        // BK7 at the mercury e line and the hydrogen F line.
        let bk7 = glass("BK7").unwrap();
        assert!((bk7.at(546.1) - 1.51872).abs() < 3e-5 && (bk7.at(486.1) - 1.52238).abs() < 3e-5);
    }
}
