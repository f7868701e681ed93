use super::super::testing::Random;
use super::*;
use crate::texture::RgbImage;

fn image(width: usize, height: usize, texel: impl Fn(usize, usize) -> Rgb) -> LightImage {
    let pixels = (0..width * height).map(|i| texel(i % width, i / width)).collect();
    LightImage::new(RgbImage { width, height, pixels }).unwrap().0
}

/// ∫ intensity over the sphere, by one random point in each of n × n equal areas.
fn total(light: &PointLight, n: usize) -> DVec3 {
    let mut random = Random::new(3);
    let mut sum = DVec3::ZERO;
    for i in 0..n * n {
        let uv = (Vec2::new((i % n) as f32, (i / n) as f32) + random.square()) / n as f32;
        sum += light.intensity(octahedral::direction_from_square(uv)).as_dvec3();
    }
    sum * (2.0 * TAU / (n * n) as f64)
}

fn in_own_space(emission: Emission) -> PointLight {
    PointLight::new(Vec3::ZERO, Mat3::IDENTITY, emission)
}

#[test]
fn a_spot_has_the_solid_angle_that_normalises_it() {
    for (cone, delta) in [(30.0, 5.0), (90.0, 90.0), (175.0, 20.0), (60.0, 0.0), (20.0, 90.0)] {
        let spot = in_own_space(Emission::Spot(Spot::new(Rgb::new(1.0, 2.0, 0.5), cone, delta)));
        let exact = Spot::solid_angle(cone, delta);
        // A hard edge crosses about 4n of the n² cells, each of which errs by half its area at random: 2√n/n² of the
        // sphere, times 5 deviations and the lit share of the sphere.
        let error = (total(&spot, 512) - exact * DVec3::new(1.0, 2.0, 0.5)).abs().max_element() / exact;
        assert!(error < 2e-3, "{cone} {delta}: {error}");
    }
}

#[test]
fn a_spot_falls_off_smoothly_between_its_angles() {
    let spot = Spot::new(Rgb::ONE, 0.02, 0.01);
    let at = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        spot.intensity(Vec3::new(sin as f32, 0.0, cos as f32)).x
    };
    assert_eq!((at(0.0), at(0.0099), at(0.0201), at(90.0), at(180.0)), (1.0, 1.0, 0.0, 0.0, 0.0));
    // 1 − cosθ is θ²/2 here: half way down at θ² = (0.01² + 0.02²)/2.
    assert!((at(0.025_f64.sqrt() / 10.0) - 0.5).abs() < 1e-3, "{}", at(0.025_f64.sqrt() / 10.0));
    let hard = Spot::new(Rgb::ONE, 60.0, 0.0);
    assert_eq!(
        (hard.intensity(Vec3::new(0.86, 0.0, 0.51)), hard.intensity(Vec3::new(0.87, 0.0, 0.49))),
        (Rgb::ONE, Rgb::ZERO)
    );
}

#[test]
fn a_goniometric_image_integrates_to_its_solid_angle() {
    let image = image(8, 8, |x, y| Rgb::new(x as f32, y as f32, 1.0));
    let light = in_own_space(Emission::Goniometric(Goniometric::new(Rgb::new(1.0, 3.0, 0.0), &image)));
    let exact = Goniometric::solid_angle(&image) * DVec3::new(1.0, 3.0, 0.0);
    // As above, with some 30 borders of texels.
    assert!((total(&light, 512) - exact).abs().max_element() < 2e-3 * exact.max_element());
}

#[test]
fn a_goniometric_image_has_its_pole_on_the_lights_y_axis() {
    // The centre of the image, at texels 4 and 5 of 8, is the octahedral +z and so the light's +y.
    let image = image(8, 8, |x, y| Rgb::splat(f32::from((3..5).contains(&x) && (3..5).contains(&y))));
    let light = in_own_space(Emission::Goniometric(Goniometric::new(Rgb::ONE, &image)));
    assert_eq!(light.intensity(Vec3::Y), Rgb::ONE);
    for w in [Vec3::X, Vec3::Z, -Vec3::Y, -Vec3::Z] {
        assert_eq!(light.intensity(w), Rgb::ZERO, "{w}");
    }
}

#[test]
fn a_projection_integrates_to_its_solid_angle() {
    for (width, height, fov) in [(4, 4, 90.0), (6, 3, 60.0), (3, 6, 30.0)] {
        let image = image(width, height, |x, y| Rgb::new(1.0 + x as f32, y as f32, 1.0));
        let exact = Projection::solid_angle(&image, fov);
        let light = in_own_space(Emission::Projection(Projection::new(Rgb::ONE, image, fov)));
        let error = (total(&light, 1024) - exact).abs().max_element() / exact.max_element();
        // Texel borders cross about 6·n of the n² cells, and a cell errs by half its value at random.
        assert!(error < 2e-3, "{width} {height}: {error}");
    }
    // A square of 90° is one face of a cube.
    let face = Projection::solid_angle(&image(1, 1, |_, _| Rgb::ONE), 90.0);
    assert!((face.x - 2.0 * TAU / 6.0).abs() < 1e-6);
}

#[test]
fn a_projection_shows_its_image_upright() {
    let image = image(2, 2, |x, y| Rgb::new(x as f32, y as f32, 1.0));
    let slide = Projection::new(Rgb::ONE, image, 90.0);
    let at = |x: f32, y: f32, z: f32| slide.intensity(Vec3::new(x, y, z).normalize());
    assert_eq!(at(-0.5, 0.5, 1.0), Rgb::new(0.0, 0.0, 1.0), "top left");
    assert_eq!(at(0.5, -0.5, 1.0), Rgb::new(1.0, 1.0, 1.0), "bottom right");
    assert_eq!((at(1.1, 0.0, 1.0), at(0.0, 0.0, -1.0), at(0.5, 0.5, 0.0)), (Rgb::ZERO, Rgb::ZERO, Rgb::ZERO));
}

#[test]
fn directions_are_those_of_light_space() {
    let turned = PointLight::new(
        Vec3::ONE,
        Mat3::from_rotation_y(std::f32::consts::FRAC_PI_2) * 3.0,
        Emission::Spot(Spot::new(Rgb::ONE, 10.0, 1.0)),
    );
    assert_eq!((turned.intensity(-Vec3::X), turned.intensity(Vec3::Z)), (Rgb::ONE, Rgb::ZERO));
}
