use super::*;

/// A smooth picture of high dynamic range, and the same with noise of a share of each value.
fn noisy(noise: f64) -> Vec<Pair> {
    let pair = |at: usize| {
        let (x, y) = ((at % 64) as f64, (at / 64) as f64);
        let reference = [
            0.02 + 0.5 * (1.0 + (0.3 * x).sin()) * (y / 12.0 - 2.0).exp(),
            0.1 + 0.3 * (1.0 + (0.2 * x + 0.25 * y).cos()),
            0.05 + 0.02 * (x * y).sqrt(),
        ];
        let random = |c: f64| ((12.9898 * x + 78.233 * y + 37.7 * c).sin() * 43758.5453).rem_euclid(1.0);
        let image = [0, 1, 2].map(|c| reference[c] * (1.0 + noise * (random(c as f64) - 0.5)));
        Some((image, reference))
    };
    (0..64 * 48).map(pair).collect()
}

/// Means of the authors' `flip-evaluator` 1.7 with `HDR` for the same pictures. It computes in 32 bits: a difference of two
/// values of up to 100, each to 6e-8, is known to 1e-5, and so is the mean of the results; 1e-4 leaves room for the
/// matrices, which are given to 7 digits, and the cuts of the kernels.
#[test]
fn figures_are_those_of_the_authors() {
    for (noise, mean) in [(0.1, 0.028_104_99), (0.5, 0.095_155_48), (1.0, 0.171_557_07)] {
        let found = hdr_flip(&noisy(noise), 64);
        assert!((found.mean - mean).abs() < 1e-4, "{noise}: {found:?}");
        // Their luminance has weights of 4 digits: 1e-4 of it is 2e-4 stops.
        assert!((found.exposures[0] - 0.104_713).abs() < 3e-4, "{found:?}");
        assert!((found.exposures[1] - 2.163_268).abs() < 3e-4, "{found:?}");
    }
}

#[test]
fn a_picture_equals_itself_and_brightness_alone_changes_nothing() {
    let pairs = noisy(0.5);
    let same: Vec<Pair> = pairs.iter().map(|pair| pair.map(|(_, r)| (r, r))).collect();
    assert_eq!(hdr_flip(&same, 64).mean, 0.0);
    // Exposures follow the reference. Powers of two are exact, so only the stops differ.
    let scale = |rgb: [f64; 3]| rgb.map(|value| 1024.0 * value);
    let bright: Vec<Pair> = pairs.iter().map(|pair| pair.map(|(i, r)| (scale(i), scale(r)))).collect();
    assert!((hdr_flip(&bright, 64).mean - hdr_flip(&pairs, 64).mean).abs() < 1e-6);
}

/// The distance of blue from green is the largest there is (Sec. 4.1.3), without edges between them.
#[test]
fn the_largest_difference_is_one() {
    let whole = |rgb: [f64; 3]| vec![rgb; 32 * 32];
    let map = flip(&whole([0.0, 1.0, 0.0]), &whole([0.0, 0.0, 1.0]), 32);
    assert!(map.iter().all(|value| (value - 1.0).abs() < 1e-4), "{}", map[0]);
}

/// A step from black to white is an edge of strength 1 where it lies.
#[test]
fn features_have_unit_strength() {
    let step: Vec<f64> = (0..64 * 64).map(|at| if at % 64 < 32 { 0.0 } else { 1.0 }).collect();
    let edges = features(&step, 64);
    let strongest = edges.iter().map(|[edge, _]| *edge).fold(0.0, f64::max);
    // The middle of the kernel has weight 0, so all of one side may lie beyond the step.
    assert!((strongest - 1.0).abs() < 1e-12, "{strongest}");
}

#[test]
fn pictures_without_light_or_pixels_have_figures() {
    assert_eq!(hdr_flip(&[], 1).mean, 0.0);
    assert_eq!(hdr_flip(&[Some(([0.0; 3], [0.0; 3])); 12], 4).mean, 0.0);
    assert_eq!(hdr_flip(&[None; 12], 4).mean, 0.0);
    let lit = hdr_flip(&[Some(([1.0; 3], [0.0; 3])); 12], 4).mean;
    assert!(lit > 0.3 && lit <= 1.0, "{lit}");
}

#[test]
fn the_matrices_are_inverse() {
    for axis in 0..3 {
        let unit = [0, 1, 2].map(|c| f64::from(u8::from(c == axis)));
        let back = rgb_from_xyz(xyz_from_rgb(unit));
        assert!((0..3).all(|c| (back[c] - unit[c]).abs() < 1e-7), "{back:?}");
    }
}
