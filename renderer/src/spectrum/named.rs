//! Spectra by the names of pbrt-v4.

use super::Spectrum;
use super::glass::glass;
use super::illuminant::{self, D50, D60, D65};
use super::metal::{Part, metal};

/// Every name that [`named`] knows.
pub fn names() -> impl Iterator<Item = String> {
    let glasses = ["BAF10", "BK7", "F10", "F11", "F5", "FK51A", "LASF9"].map(|glass| format!("glass-{glass}"));
    let metals = ["Ag", "Al", "Au", "Cu", "CuZn", "MgO", "TiO2"];
    let metals = metals.into_iter().flat_map(|metal| ["eta", "k"].map(|part| format!("metal-{metal}-{part}")));
    let lamps = (1..=12).map(|number| format!("stdillum-F{number}"));
    let illuminants = ["illum-acesD60", "stdillum-A", "stdillum-D50", "stdillum-D65"].map(String::from);
    glasses.into_iter().chain(metals).chain(illuminants).chain(lamps)
}

/// The spectrum of this name: `metal-Cu-eta`, `metal-Cu-k`, `glass-BK7`, `stdillum-D65`, `stdillum-F11`, `illum-acesD60`...
///
/// `None`: no such name; [`names`] lists them. Illuminants are relative: 100 at 560 nm, lamps as tabulated. D50 is the
/// CIE's; pbrt-v4's table of that name lacks the negative components of daylight.
pub fn named(name: &str) -> Option<Spectrum> {
    let (kind, rest) = name.split_once('-')?;
    match (kind, rest) {
        ("glass", _) => glass(rest),
        ("metal", _) => match rest.split_once('-')? {
            (formula, "eta") => metal(formula, Part::Eta),
            (formula, "k") => metal(formula, Part::K),
            _ => None,
        },
        ("illum", "acesD60") => Some(illuminant::daylight_spectrum(D60)),
        ("stdillum", "A") => Some(illuminant::tungsten()),
        ("stdillum", "D50") => Some(illuminant::daylight_spectrum(D50)),
        ("stdillum", "D65") => Some(illuminant::daylight_spectrum(D65)),
        ("stdillum", _) => {
            let number = rest.strip_prefix('F').filter(|digits| !digits.starts_with(['0', '+']))?;
            illuminant::fluorescent(number.parse().ok()?)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_listed_name_is_a_proper_spectrum_and_no_other_is() {
        let names: Vec<String> = names().collect();
        assert_eq!(names.len(), 7 + 14 + 4 + 12);
        for name in &names {
            let Some(Spectrum::Sampled(samples)) = named(name) else { panic!("{name}") };
            assert!(Spectrum::sampled(&samples).is_ok(), "{name}");
            // They cover what an eye sees of them.
            assert!(samples[0].0 <= 390.0 && samples[samples.len() - 1].0 >= 760.0, "{name}");
        }
        for name in
            ["", "glass", "glass-", "metal-Cu", "metal-Cu-n", "stdillum-F0", "stdillum-F13", "stdillum-F01", "Cu"]
        {
            assert!(named(name).is_none(), "{name}");
        }
    }
}
