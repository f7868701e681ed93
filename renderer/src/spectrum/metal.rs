//! Optical constants as spectra.

use super::Spectrum;
use super::metal_data::{ALUMINIUM, BRASS, ByEnergy, COPPER, GOLD, MAGNESIA, SILVER, TITANIA};

/// Part of the complex refractive index η + ik.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Eta,
    K,
}

/// The metal or oxide of this chemical formula.
pub(super) fn metal(formula: &str, part: Part) -> Option<Spectrum> {
    let row = part as usize;
    let samples = match formula {
        "Ag" => by_energy(&SILVER, part),
        "Al" => by_energy(&ALUMINIUM, part),
        "Au" => by_energy(&GOLD, part),
        "Cu" => by_energy(&COPPER, part),
        "CuZn" => BRASS[row].iter().enumerate().map(|(i, &value)| (290.0 + 10.0 * i as f32, value)).collect(),
        "MgO" => MAGNESIA.iter().map(|&(nm, eta)| (nm, if part == Part::Eta { eta } else { 0.0 })).collect(),
        "TiO2" => TITANIA.iter().map(|&(nm, eta, k)| (nm, if part == Part::Eta { eta } else { k })).collect(),
        _ => return None,
    };
    Some(Spectrum::Sampled(samples))
}

fn by_energy(table: &ByEnergy, part: Part) -> std::sync::Arc<[(f32, f32)]> {
    /// Wavelength (nm) of a photon of 1 eV, hc/e, as in the tables.
    const NM_EV: f64 = 1_239.841_76;
    let wavelength = |i: usize| (NM_EV / (4.15 - 0.05 * i as f64)) as f32;
    table[part as usize].iter().enumerate().map(|(i, &value)| (wavelength(i), value)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_lie_on_their_wavelengths() {
        let at = |formula, part, lambda| metal(formula, part).unwrap().at(lambda);
        // Sodium's yellow, against the tables' values at 2.10 eV.
        for (formula, eta, k) in [
            ("Ag", 0.121, 3.66),
            ("Al", 1.15, 7.15),
            ("Au", 0.236, 2.97),
            ("Cu", 0.468, 2.809),
            ("CuZn", 0.4596, 3.1628),
        ] {
            assert!((at(formula, Part::Eta, 590.4) - eta).abs() < 1e-3, "{formula}");
            assert!((at(formula, Part::K, 590.4) - k).abs() < 1e-3, "{formula}");
        }
        assert_eq!(at("MgO", Part::K, 550.0), 0.0);
        assert!((at("TiO2", Part::Eta, 589.3) - 2.91).abs() < 0.01);
        assert!(metal("Unobtainium", Part::Eta).is_none());
    }
}
