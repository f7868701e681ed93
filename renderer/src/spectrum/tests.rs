use super::*;
use crate::math::luminance;

#[test]
fn greys_are_grey_and_d65_is_white() {
    let grey = Spectrum::sampled(&[(300.0, 0.5), (900.0, 0.5)]).unwrap();
    assert!((grey.reflectance_rgb() - 0.5).abs().max_element() < 1e-6);
    assert!((grey.unbounded_rgb() - 0.5).abs().max_element() < 1e-6);
    let d65 = named("stdillum-D65").unwrap().illuminant_rgb();
    assert!((d65 - 1.0).abs().max_element() < 1e-5, "{d65}");
    assert_eq!(Spectrum::constant(3.0).unbounded_rgb(), Rgb::splat(3.0));
}

#[test]
fn lights_have_luminance_one_whatever_their_level() {
    for name in names().filter(|name| name.contains("illum")) {
        let rgb = named(&name).unwrap().illuminant_rgb();
        // The two sets of luminance weights differ by 2e-4: they round the white of D65 differently.
        assert!((luminance(rgb) - 1.0).abs() < 3e-4, "{name}: {rgb}");
        let Some(Spectrum::Sampled(samples)) = named(&name) else { panic!("{name}") };
        let brighter = Spectrum::Sampled(samples.iter().map(|&(lambda, value)| (lambda, value * 7.0)).collect());
        assert!((brighter.illuminant_rgb() - rgb).abs().max_element() < 1e-5);
    }
    let rgb = Rgb::new(3.0, 0.5, -0.0);
    assert_eq!(Spectrum::Rgb(rgb).illuminant_rgb(), rgb);
    // Out of gamut on one side and dark on the other.
    let red = Spectrum::sampled(&[(690.0, 1.0), (700.0, 1.0)]).unwrap().illuminant_rgb();
    assert!(red.y == 0.0 && (luminance(red) - 1.0).abs() < 1e-3, "{red}");
    assert_eq!(Spectrum::sampled(&[(1000.0, 1.0), (1100.0, 1.0)]).unwrap().illuminant_rgb(), Rgb::ZERO);
    assert_eq!(Spectrum::Blackbody(0.0).illuminant_rgb(), Rgb::ZERO);
}

#[test]
fn black_bodies_have_their_published_hues() {
    // Chromaticity of Planck's locus (CIE 1931), from tables at 6504 K and 3000 K, as linear Rec.709 at luminance 1.
    let from_xy = |x: f64, y: f64| (observer::rec709_from_xyz() * DVec3::new(x / y, 1.0, (1.0 - x - y) / y)).as_vec3();
    for (kelvin, x, y) in [(2000.0, 0.52669, 0.41331), (3000.0, 0.43695, 0.40407), (6504.0, 0.31346, 0.32364)] {
        let rgb = Spectrum::Blackbody(kelvin).illuminant_rgb();
        assert!((rgb - from_xy(x, y)).abs().max_element() < 2e-3, "{kelvin} K: {rgb} {}", from_xy(x, y));
    }
    // D65 is greener than the locus but near it.
    let rgb = Spectrum::Blackbody(6504.0).illuminant_rgb();
    assert!((rgb - 1.0).abs().max_element() < 0.06, "{rgb}");
}

#[test]
fn values_are_interpolated_and_end_at_the_range() {
    let spectrum = Spectrum::sampled(&[(400.0, 1.0), (500.0, 3.0), (510.0, 0.0)]).unwrap();
    let expected = [(399.9, 0.0), (400.0, 1.0), (450.0, 2.0), (500.0, 3.0), (505.0, 1.5), (510.0, 0.0), (511.0, 0.0)];
    for (lambda, value) in expected {
        assert_eq!(spectrum.at(lambda), value, "{lambda}");
    }
    let single = Spectrum::sampled(&[(500.0, 2.0)]).unwrap();
    assert_eq!((single.at(500.0), single.at(500.1)), (2.0, 0.0));
    assert_eq!(Spectrum::constant(0.25).at(555.0), 0.25);
}

#[test]
fn reflectances_stay_in_the_unit_cube() {
    for (low, high) in [(400.0, 480.0), (490.0, 540.0), (600.0, 700.0)] {
        let band = Spectrum::sampled(&[(low, 1.0), (high, 1.0)]).unwrap();
        let rgb = band.reflectance_rgb();
        assert!(rgb.min_element() >= 0.0 && rgb.max_element() <= 1.0, "{rgb}");
    }
    assert_eq!(Spectrum::Rgb(Rgb::new(-0.5, 0.5, 2.0)).reflectance_rgb(), Rgb::new(0.0, 0.5, 1.0));
}

#[test]
fn a_dielectric_has_its_index_at_the_yellow_line() {
    assert_eq!(Spectrum::constant(1.5).refractive_index(), 1.5);
    // Spectra that end before the line.
    assert_eq!(Spectrum::sampled(&[(400.0, 1.6), (500.0, 1.5)]).unwrap().refractive_index(), 1.5);
    assert_eq!(Spectrum::sampled(&[(600.0, 1.4), (700.0, 1.3)]).unwrap().refractive_index(), 1.4);
}
