//! When a path is ended, and what those that go on are worth.

/// The factor by which a surviving path's throughput grows, or `None` if the path ends.
///
/// A path survives with probability `min(1, throughput)`, where `throughput` is its largest component without the η²
/// scaling of radiance inside a denser medium: that factor is taken back where the path leaves the medium, so a path
/// is not worth less for being inside glass. The first two vertices always survive. The estimate is unbiased: what a
/// path is worth grows by what its survival was unlikely. `u` is asked for only where chance decides.
///
/// Where nothing absorbs and nothing leads out, a path would go on as long as the scene allows, which may be for ever: one
/// that is [`ENDLESS`] ends with some probability at every vertex.
pub fn survive(throughput: f32, scatterings: u32, u: impl FnOnce() -> f32) -> Option<f32> {
    let most = if scatterings < ENDLESS { 1.0 } else { ENDLESS_SURVIVAL };
    if scatterings < 2 || throughput >= most && most == 1.0 {
        return Some(1.0);
    }
    let survival = throughput.min(most);
    (u() < survival).then(|| 1.0 / survival)
}

/// Scatterings beyond which a path is taken to be caught. Enough that no depth that someone asks for is touched.
const ENDLESS: u32 = 1 << 14;

/// Probability to go on from each vertex of a path that is caught: after as many again as a quarter of [`ENDLESS`] it is 1/e.
const ENDLESS_SURVIVAL: f32 = 1.0 - 4.0 / ENDLESS as f32;

#[cfg(test)]
mod tests {
    use super::{ENDLESS, ENDLESS_SURVIVAL, survive};

    #[test]
    fn what_survives_is_worth_one_on_average() {
        for throughput in [0.01f32, 0.3, 0.999, 1.0, 7.0] {
            let n = 10_000u32;
            let sum: f64 =
                (0..n).filter_map(|k| survive(throughput, 5, || (k as f32 + 0.5) / n as f32)).map(f64::from).sum();
            // The u are stratified: the count of survivors is off by at most one.
            assert!((sum / f64::from(n) - 1.0).abs() <= 1.0 / (f64::from(n) * f64::from(throughput.min(1.0))) + 1e-6);
        }
        // What is caught ends, at a vertex or the next.
        assert_eq!(survive(1.0, 10_000, || 0.999_999), Some(1.0));
        assert_eq!(survive(1.0, ENDLESS, || 0.999_999), None);
        assert_eq!(survive(1.0, ENDLESS, || 0.5), Some(1.0 / ENDLESS_SURVIVAL));
        assert_eq!(survive(0.0, 5, || 0.0), None);
        assert_eq!(survive(0.0, 1, || 0.999), Some(1.0));
    }
}
