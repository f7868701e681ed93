//! What features of scenes cost, as measured by `ci/bench-features`, whose output is in `prices.jsonl`.

use serde::{Deserialize, Serialize};

/// What a feature costs the tracing of a small room.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct Price {
    /// The feature, as `info` calls it.
    pub feature: String,
    /// Percent of the room's own instructions, where the feature is defined but not used.
    pub unused_percent: f64,
    /// The same where it is used.
    pub used_percent: f64,
}

const MEASURED: &str = include_str!("prices.jsonl");

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

/// The most that any feature costs where it is not used, percent.
pub fn unused() -> f64 {
    all().iter().map(|price| price.unused_percent).fold(0.0, f64::max)
}

/// `curves +12 %, quadrics less than 1 %`.
pub fn in_words(prices: &[Price]) -> String {
    let words = |price: &Price| match price.used_percent {
        // Below what the measurement resolves.
        percent if percent <= 0.0 => format!("{} 0 %", price.feature),
        percent if percent < 0.5 => format!("{} less than 1 %", price.feature),
        percent => format!("{} {percent:+.0} %", price.feature),
    };
    prices.iter().map(words).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_have_prices_and_cost_nothing_unused() {
        assert!(all().len() >= 15, "{}", all().len());
        assert!(unused() <= 1.0, "{}", unused());
        assert_eq!(of(&["curves", "no such feature"]).len(), 1);
    }

    #[test]
    fn prices_are_for_people() {
        let price = |feature: &str, used_percent| Price { feature: feature.into(), unused_percent: 0.0, used_percent };
        let words = in_words(&[price("curves", 12.4), price("crop", 0.3), price("clamping", -1.6)]);
        assert_eq!(words, "curves +12 %, crop less than 1 %, clamping 0 %");
    }
}
