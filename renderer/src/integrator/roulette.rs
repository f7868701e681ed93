//! When a path is ended, and what those that go on are worth.

/// The factor by which a surviving path's throughput grows, or `None` if the path ends.
///
/// A path survives with probability `min(1, throughput)`, where `throughput` is its largest component without the η²
/// scaling of radiance inside a denser medium: that factor is taken back where the path leaves the medium, so a path
/// is not worth less for being inside glass. The first two vertices always survive. The estimate is unbiased: what a
/// path is worth grows by what its survival was unlikely. `u` is asked for only where chance decides.
pub fn survive(throughput: f32, scatterings: u32, u: impl FnOnce() -> f32) -> Option<f32> {
    if scatterings < 2 || throughput >= 1.0 {
        return Some(1.0);
    }
    (u() < throughput).then(|| 1.0 / throughput)
}

#[cfg(test)]
mod tests {
    use super::survive;

    #[test]
    fn what_survives_is_worth_one_on_average() {
        for throughput in [0.01f32, 0.3, 0.999, 1.0, 7.0] {
            let n = 10_000u32;
            let sum: f64 =
                (0..n).filter_map(|k| survive(throughput, 5, || (k as f32 + 0.5) / n as f32)).map(f64::from).sum();
            // The u are stratified: the count of survivors is off by at most one.
            assert!((sum / f64::from(n) - 1.0).abs() <= 1.0 / (f64::from(n) * f64::from(throughput.min(1.0))) + 1e-6);
        }
        assert_eq!(survive(0.0, 5, || 0.0), None);
        assert_eq!(survive(0.0, 1, || 0.999), Some(1.0));
    }
}
