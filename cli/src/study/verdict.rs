//! What a study's figures say.

use serde::Serialize;

use super::measure::Point;
use super::plan::Setting;

/// How far beyond the budgets a price is foretold, as a factor of samples.
const REACH: f64 = 4.0;

/// What an error costs with a setting.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Price {
    /// relMSE.
    pub target: f64,
    /// The setting's name.
    pub name: String,
    /// Index of the setting.
    #[serde(skip)]
    pub setting: usize,
    /// Samples per pixel.
    pub spp: u64,
    /// Seconds.
    pub seconds: f64,
    /// Outside of the budgets that were rendered.
    pub foretold: bool,
}

/// The prices of a target, one for each setting that reaches it, cheapest first. Between budgets, and up to four times
/// beyond the last, error and time go by powers of the samples.
pub fn prices(points: &[Point], settings: usize, target: f64) -> Vec<Price> {
    let mut prices: Vec<Price> = (0..settings)
        .filter_map(|setting| {
            let of: Vec<&Point> = points.iter().filter(|p| p.setting == setting && p.relmse > 0.0).collect();
            price(&of, target)
        })
        .collect();
    prices.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
    prices
}

fn price(points: &[&Point], target: f64) -> Option<Price> {
    let price = |spp: f64, seconds: f64, foretold: bool| {
        // Rounding must not add a sample to what is a whole number.
        let (name, setting) = (points[0].name.clone(), points[0].setting);
        Price { target, name, setting, spp: (spp * (1.0 - 1.0e-9)).ceil() as u64, seconds, foretold }
    };
    if points.first()?.relmse <= target {
        return Some(price(points[0].spp as f64, points[0].seconds, false));
    }
    let between = |a: &Point, b: &Point| {
        let share = (a.relmse / target).ln() / (a.relmse / b.relmse).ln();
        let at = |a: f64, b: f64| (a.ln() + share * (b.ln() - a.ln())).exp();
        (at(a.spp as f64, b.spp as f64), at(a.seconds, b.seconds))
    };
    if let Some(pair) = points.windows(2).find(|pair| pair[1].relmse <= target) {
        let (spp, seconds) = between(pair[0], pair[1]);
        return Some(price(spp, seconds, false));
    }
    let [.., a, b] = points else { return None };
    if b.relmse >= a.relmse {
        return None;
    }
    let (spp, seconds) = between(a, b);
    (spp <= REACH * b.spp as f64).then(|| price(spp, seconds, true))
}

/// Whether no other point has less error in no more time, or the same in less.
pub fn on_front(point: &Point, points: &[Point]) -> bool {
    let beaten = |other: &Point| {
        let (faster, better) = (other.seconds < point.seconds, other.relmse < point.relmse);
        other.seconds <= point.seconds && other.relmse <= point.relmse && (faster || better)
    };
    point.relmse > 0.0 && !points.iter().any(|other| other.relmse > 0.0 && beaten(other))
}

/// One sentence.
pub fn recommendation(prices: &[Price], settings: &[Setting], points: &[Point], target: f64) -> String {
    let shown = number(target);
    let [best, others @ ..] = prices else {
        let least = points.iter().filter(|p| p.relmse > 0.0).min_by(|a, b| a.relmse.total_cmp(&b.relmse));
        let reached = least.map_or(String::new(), |p| {
            format!("; {} at {} samples comes closest, with {}", p.name, p.spp, number(p.relmse))
        });
        return format!("No setting comes near a relMSE of {shown} with the budgets tried{reached}.");
    };
    let mut text = format!(
        "For a relMSE of {shown} use {} with {} samples per pixel: {}{}",
        settings[best.setting].options,
        best.spp,
        time(best.seconds),
        if best.foretold { ", as far as the trend holds" } else { "" },
    );
    let plain = others.iter().find(|price| settings[price.setting].options == "--filter none");
    if let Some(plain) = plain {
        text += &format!(" – without a filter it takes {}", time(plain.seconds));
        let gain = plain.seconds / best.seconds;
        text += &format!(", {} times as long", if gain < 9.95 { format!("{gain:.1}") } else { format!("{gain:.0}") });
    }
    text + "."
}

/// Two digits, without an exponent where it reads well.
pub fn number(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return x.to_string();
    }
    let digits = (1 - x.abs().log10().floor() as i32).max(0) as usize;
    if digits > 7 { format!("{x:.1e}") } else { trimmed(&format!("{x:.digits$}")) }
}

/// A time for people.
pub fn time(seconds: f64) -> String {
    match seconds {
        s if s < 0.0995 => format!("{:.0} ms", 1000.0 * s),
        s if s < 9.95 => format!("{s:.1} s"),
        s if s < 119.5 => format!("{s:.0} s"),
        s if s < 5970.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

fn trimmed(text: &str) -> String {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(setting: usize, spp: u64, seconds: f64, relmse: f64) -> Point {
        let name = ["none", "adaptive"][setting].to_owned();
        let (seeds, interval, errors) = (1, [relmse; 2], Vec::new());
        let (relmse_best, squared_bias, squared_bias_error, variance) = (relmse, 0.0, 0.0, relmse);
        Point {
            setting,
            name,
            spp,
            seeds,
            seconds,
            relmse,
            interval,
            relmse_best,
            squared_bias,
            squared_bias_error,
            variance,
            predicted: None,
            errors,
        }
    }

    /// Error 1 / spp and a second per sample; and a tenth of both the error and no more time.
    fn points() -> Vec<Point> {
        let of =
            |setting: usize, factor: f64| [1, 4, 16].map(|spp| point(setting, spp, spp as f64, factor / spp as f64));
        [of(0, 1.0), of(1, 0.1)].concat()
    }

    #[test]
    fn prices_follow_the_powers_between_and_a_little_beyond() {
        let found = prices(&points(), 2, 0.0125);
        assert_eq!((found[0].name.as_str(), found[0].spp, found[0].foretold), ("adaptive", 8, false));
        assert!((found[0].seconds - 8.0).abs() < 1e-9);
        // Without the filter it would be 80 samples, five times the last budget.
        assert_eq!(found.len(), 1);
        let found = prices(&points(), 2, 0.02);
        assert_eq!((found[1].spp, found[1].foretold), (50, true));
        assert_eq!(prices(&points(), 2, 0.5)[0].spp, 1);
    }

    #[test]
    fn the_front_is_what_nothing_beats() {
        let points = points();
        let front: Vec<_> = points.iter().map(|p| on_front(p, &points)).collect();
        assert_eq!(front, [false, false, false, true, true, true]);
    }

    #[test]
    fn numbers_and_times_are_short() {
        assert_eq!([0.01, 0.123, 1.0, 12.34, 250.0, 0.00125].map(number), ["0.01", "0.12", "1", "12", "250", "0.0013"]);
        assert_eq!([0.0123, 1.26, 38.2, 150.0, 7200.0].map(time), ["12 ms", "1.3 s", "38 s", "2 min", "2.0 h"]);
    }
}
