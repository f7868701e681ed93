//! What features of scenes cost, as measured by `ci/bench-features`, whose output is in `prices.jsonl`.

use serde::{Deserialize, Serialize};

/// What a feature costs the tracing of a small room.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct Price {
    /// The feature, as `info` calls it.
    pub feature: String,
    /// Percent of the room's own time, where the feature is defined but not used.
    pub unused_percent: f64,
    /// The same where it is used.
    pub used_percent: f64,
}

const MEASURED: &str = include_str!("prices.jsonl");

/// Below this prices are noise, percent: `unused_percent`, of what is not there, comes to that.
const NOISE: f64 = 1.0;

/// All prices.
///
/// # Panics
/// If they are not what `ci/bench-features` prints, which a test would have found.
pub fn all() -> Vec<Price> {
    MEASURED.lines().map(|line| serde_json::from_str(line).expect("a line of ci/bench-features")).collect()
}

/// The prices of some features, those that have one.
pub fn of(features: &[&str]) -> Vec<Price> {
    all().into_iter().filter(|price| features.contains(&price.feature.as_str())).collect()
}

/// `curves +12 %, quadrics nothing`.
pub fn in_words(prices: &[Price]) -> String {
    let words = |price: &Price| match price.used_percent {
        percent if percent.abs() < NOISE => format!("{} nothing", price.feature),
        percent => format!("{} {percent:+.0} %", price.feature),
    };
    prices.iter().map(words).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_price_is_measured_and_what_is_not_used_costs_nothing() {
        let all = all();
        assert!(all.len() >= 15, "{}", all.len());
        for price in &all {
            // Medians of rounds on a machine with other work scatter by a percent.
            assert!(price.unused_percent <= 2.0 * NOISE, "{price:?}");
        }
        assert_eq!(of(&["curves", "no such feature"]).len(), 1);
    }

    #[test]
    fn prices_are_for_people() {
        let price = |feature: &str, used_percent| Price { feature: feature.into(), unused_percent: 0.0, used_percent };
        let words = in_words(&[price("curves", 12.4), price("crop", 0.3), price("clamping", -1.6)]);
        assert_eq!(words, "curves +12 %, crop nothing, clamping -2 %");
    }
}
