//! Lights of any strength, size and number.

use std::fmt::Write;

use renderer::filtering::Filtering;
use tests::render::mean_and_error;
use tests::small::{PLAIN, adaptive, room, values};

use super::support::{
    ROUNDING, Z, both, check_all, check_mean, diffuse, frame, job, lamp, picture, pinhole, quad, refused, scene, sky,
    warned,
};

/// A picture at another strength of the light is the same picture: paths depend on the ratios of lights only.
fn strength(level: f32) {
    for (name, filtering) in both() {
        let one = picture(&room([32, 24], 1.0, 1.0, PLAIN), 8, filtering);
        let other = picture(&room([32, 24], 1.0, level, PLAIN), 8, filtering);
        let worst = one.pixels.iter().flatten().zip(other.pixels.iter().flatten()).map(|(a, b)| {
            let b = f64::from(*b) / f64::from(level);
            (f64::from(*a) - b).abs() / f64::from(a.max(1e-3))
        });
        let worst = worst.fold(0.0, f64::max);
        println!("{name}, radiance {level:e}: pixels as at 1 to {worst:.1e}");
        // Filtered: paths are stored to 2⁻¹⁵, rounded at another place.
        assert!(worst <= if name == "filtered" { 2e-3 } else { ROUNDING });
    }
}

#[test]
fn radiance_of_1e12() {
    strength(1e12);
}

#[test]
fn radiance_of_1e_minus_12() {
    strength(1e-12);
}

#[test]
fn lamps_of_1e12_and_1e_minus_12_side_by_side_are_both_seen() {
    let half = |x0: f64, x1: f64| quad([[x0, -1.0, 1.0], [x0, 1.0, 1.0], [x1, 1.0, 1.0], [x1, -1.0, 1.0]]);
    let world = lamp(1e12) + &half(-1.0, 0.0) + &lamp(1e-12) + &half(0.0, 1.0);
    for (name, filtering) in both() {
        let image = picture(&scene([8, 8], 4, &pinhole(80.0), &world), 4, filtering);
        for (i, pixel) in image.pixels.iter().enumerate() {
            // The camera's x points to the left of a picture whose up is y: one half or the other.
            let level = f64::from(pixel[1]);
            assert!(
                [1e12, 1e-12].iter().any(|&l: &f64| (level / l - 1.0).abs() < 1e-6),
                "{name}: pixel {i} is {level:e}"
            );
        }
        let bright = image.pixels.iter().filter(|pixel| pixel[1] > 1.0).count();
        println!("{name}: {bright} of {} pixels show 1e12, the others 1e-12", image.pixels.len());
        assert_eq!(2 * bright, image.pixels.len());
    }
}

/// Two rooms without a way from one to the other, lit by 10¹² and 10⁻¹²: each must look as it does alone.
#[test]
fn rooms_lit_by_1e12_and_1e_minus_12_in_one_frame() {
    let cell = |x: f64, level: f64| {
        let turned = "\"bool twosided\" true";
        let emission = lamp(level).replace('\n', &format!(" {turned}\n"));
        format!(
            "AttributeBegin\nTranslate {x} 0 0\n{}{emission}{}AttributeEnd\n",
            diffuse(0.5),
            super::support::closed_box(1.0)
        )
    };
    // The camera is within one and within the other.
    for (name, filtering) in both() {
        for (x, level) in [(-2.0, 1e12), (2.0, 1e-12)] {
            let camera = format!("LookAt {x} 0 0  {x} 0.1 1  0 1 0\n{}", pinhole(70.0));
            let world = cell(-2.0, 1e12) + &cell(2.0, 1e-12);
            let both = frame(&scene([12, 12], 1000, &camera, &world), job(64, filtering));
            let (_, error) = mean_and_error(&both.film);
            let mean = values(&both).mean()[1];
            println!("{name}: {:.5} ± {:.5} of a furnace of {level:e}", mean / level, error / level);
            assert!((mean - 2.0 * level).abs() <= Z * error + 1e-4 * level);
        }
    }
}

#[test]
fn bright_and_dark_halves_of_one_frame_keep_their_values() {
    // A diffuse wall lit by 10¹² on one side of a partition and by 10⁻¹² on the other: irradiances differ by 24 orders.
    let side = |x0: f64, x1: f64, level: f64| {
        let mut text = diffuse(0.5);
        // Wall, and a lamp of the same size facing it from behind the camera.
        text += &quad([[x0, -1.0, 1.0], [x0, 1.0, 1.0], [x1, 1.0, 1.0], [x1, -1.0, 1.0]]);
        text += &format!("AttributeBegin\n{}", lamp(level));
        text += &quad([[x0, -1.0, -1.0], [x1, -1.0, -1.0], [x1, 1.0, -1.0], [x0, 1.0, -1.0]]);
        text + "AttributeEnd\n"
    };
    let partition = diffuse(0.0) + &quad([[0.0, -9.0, -1.5], [0.0, 9.0, -1.5], [0.0, 9.0, 1.5], [0.0, -9.0, 1.5]]);
    let camera = "Camera \"orthographic\" \"float screenwindow\" [ -0.9 0.9 -0.9 0.9 ]";
    let text = |a: f64, b: f64| scene([16, 16], 1, camera, &(side(-1.0, -1e-3, a) + &side(1e-3, 1.0, b) + &partition));
    for (name, filtering) in both() {
        let mixed = picture(&text(1e12, 1e-12), 64, filtering);
        let (bright, dark) = (picture(&text(1e12, 0.0), 64, filtering), picture(&text(0.0, 1e-12), 64, filtering));
        let mean = |image: &tests::image::RgbImage, lit: bool| {
            let mut sum = 0.0;
            for (pixel, b) in image.pixels.iter().zip(&bright.pixels) {
                sum += if (b[1] > 1.0) == lit { f64::from(pixel[1]) } else { 0.0 };
            }
            sum / 128.0
        };
        let (b, d) = (mean(&mixed, true) / mean(&bright, true), mean(&mixed, false) / mean(&dark, false));
        println!("{name}: {b:.5} and {d:.5} of what each side shows alone");
        // 128 pixels × 64 samples whose light is chosen by other numbers: a relative deviation of 1, 4.4 times, twice.
        assert!((b - 1.0).abs() <= 0.1 && (d - 1.0).abs() <= 0.1, "{name}: {b}, {d}");
    }
}

/// The centre of a diffuse floor below a disk of radius `r` at height 1 with radiance L: its radiosity over π is
/// ρ L r² / (1 + r²), the disk's view factor.
fn disk_above(r: f64) {
    // A lamp of constant power: L r² = 1.
    let level = 1.0 / (r * r);
    let mut world =
        diffuse(0.5) + &quad([[-1e-4, -1e-4, 0.0], [1e-4, -1e-4, 0.0], [1e-4, 1e-4, 0.0], [-1e-4, 1e-4, 0.0]]);
    world += &format!(
        "AttributeBegin\nTranslate 0 0 1\nRotate 180 1 0 0\n{}Shape \"disk\" \"float radius\" {r:e}\nAttributeEnd\n",
        lamp(level)
    );
    let camera =
        "LookAt 0 -0.5 0.5  0 0 0  0 0 1\nCamera \"orthographic\" \"float screenwindow\" [ -1e-5 1e-5 -1e-5 1e-5 ]";
    let rendered = frame(&scene([8, 8], 2, camera, &world), job(16, Filtering::None));
    // The floor is seen within 10⁻⁵ of its centre: cosines differ by 10⁻⁵.
    check_mean(&format!("disk of radius {r:e}"), &rendered, 0.5 * level * r * r / (1.0 + r * r), 5e-5);
}

#[test]
fn a_light_of_1e_minus_9_of_the_scene() {
    disk_above(1e-9);
}

#[test]
fn a_light_of_1e_minus_4_of_the_scene() {
    disk_above(1e-4);
}

#[test]
fn a_light_of_1000_times_the_scene() {
    disk_above(1e3);
}

#[test]
fn a_sphere_light_of_1e_minus_9_of_the_scene_is_a_point() {
    // Seen from distance 1: E = L π r², so the floor shows ρ L r².
    let r = 1e-9;
    let level = 1.0 / (r * r);
    let mut world =
        diffuse(0.5) + &quad([[-1e-4, -1e-4, 0.0], [1e-4, -1e-4, 0.0], [1e-4, 1e-4, 0.0], [-1e-4, 1e-4, 0.0]]);
    world += &format!(
        "AttributeBegin\nTranslate 0 0 1\n{}Shape \"sphere\" \"float radius\" {r:e}\nAttributeEnd\n",
        lamp(level)
    );
    let camera =
        "LookAt 0 -0.5 0.5  0 0 0  0 0 1\nCamera \"orthographic\" \"float screenwindow\" [ -1e-5 1e-5 -1e-5 1e-5 ]";
    check_mean("sphere of 1e-9", &frame(&scene([8, 8], 2, camera, &world), job(16, Filtering::None)), 0.5, 5e-5);
}

#[test]
fn a_hundred_thousand_lights_are_one() {
    // A square lamp in one piece and in 2 · 224² = 100 352 pieces.
    let n = 224;
    let (mut p, mut indices) = (String::new(), String::new());
    for y in 0..=n {
        for x in 0..=n {
            write!(p, "{} {} 1 ", -1.0 + 2.0 * f64::from(x) / f64::from(n), -1.0 + 2.0 * f64::from(y) / f64::from(n))
                .unwrap();
        }
    }
    for y in 0..n {
        for x in 0..n {
            let i = y * (n + 1) + x;
            let (a, b, c, d) = (i, i + n + 1, i + n + 2, i + 1);
            write!(indices, "{a} {b} {c} {a} {c} {d} ").unwrap();
        }
    }
    let pieces = format!("Shape \"trianglemesh\" \"point3 P\" [ {p} ] \"integer indices\" [ {indices} ]\n");
    let whole = quad([[-1.0, -1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, -1.0, 1.0]]);
    let floor = diffuse(0.5) + &quad([[-1e-4, -1e-4, 0.0], [1e-4, -1e-4, 0.0], [1e-4, 1e-4, 0.0], [-1e-4, 1e-4, 0.0]]);
    let camera =
        "LookAt 0 -0.5 0.5  0 0 0  0 0 1\nCamera \"orthographic\" \"float screenwindow\" [ -1e-5 1e-5 -1e-5 1e-5 ]";
    // View factor of a square of side 2 at distance 1 from below its centre: 4/(π√2) · atan(1/√2).
    let expected = 0.5 * 4.0 / (std::f64::consts::PI * 2f64.sqrt()) * (0.5f64.sqrt()).atan();
    for (name, lights) in [("1 light of 2 triangles", whole), ("100 352 lights", pieces)] {
        let rendered =
            frame(&scene([8, 8], 1, camera, &(floor.clone() + &lamp(1.0) + &lights)), job(64, Filtering::None));
        check_mean(name, &rendered, expected, 5e-5);
    }
}

#[test]
fn a_light_without_area_is_left_out_with_a_warning() {
    let flat = quad([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 0.0, 1.0]]);
    let text = scene([8, 8], 4, &pinhole(60.0), &(sky(1.0) + &lamp(100.0) + &flat));
    let rendered = warned("two emitting triangles in a line", &text, "no area");
    check_all("the sky behind them", &values(&rendered), 1.0, 0.0);
}

#[test]
fn lights_with_areas_that_vanish_in_f32_are_left_out_or_right() {
    // An area of 10⁻⁴⁴ is next to nothing even as a denormal number.
    let s = 1e-22;
    let tiny = quad([[-s, -s, 1.0], [-s, s, 1.0], [s, s, 1.0], [s, -s, 1.0]]);
    let at_origin = quad([[-s, -s, 0.0], [-s, s, 0.0], [s, s, 0.0], [s, -s, 0.0]]);
    for (name, shape) in [("rounded to a point", tiny), ("sides of 1e-22", at_origin)] {
        let world = diffuse(0.5)
            + &quad([[-1.0, -1.0, 2.0], [-1.0, 1.0, 2.0], [1.0, 1.0, 2.0], [1.0, -1.0, 2.0]])
            + &lamp(1.0)
            + &shape;
        for (mode, filtering) in both() {
            let camera = format!("LookAt 0 0 -1  0 0 1  0 1 0\n{}", pinhole(40.0));
            let image = picture(&scene([8, 8], 4, &camera, &world), 8, filtering);
            println!("{name}, {mode}: mean {:e}", image.mean()[1]);
            assert!(image.mean()[1] <= 1e-30);
        }
    }
}

#[test]
fn a_point_light_on_the_surface_it_lights() {
    // At the very surface, and at distances whose squares underflow: finite, and nothing rejected.
    for z in [0.0, 1e-30, 1e-20, 1e-10] {
        let world = diffuse(0.5)
            + "Shape \"bilinearmesh\" \"point3 P\" [ -1 -1 0  1 -1 0  -1 1 0  1 1 0 ]\n"
            + &format!("LightSource \"point\" \"rgb I\" [ 1 1 1 ] \"point3 from\" [ 0 0 {z:e} ]\n");
        let camera = format!("LookAt 0 -1 1  0 0 0  0 0 1\n{}", pinhole(60.0));
        let image = picture(&scene([9, 9], 3, &camera, &world), 8, Filtering::None);
        println!("point light at {z:e}: mean {:e}", image.mean()[1]);
    }
}

#[test]
fn a_point_light_in_the_camera() {
    // A wall across the view at distance d: ρ I cos³θ·cosθ… per unit: on the axis ρ/π · I / d².
    let world = diffuse(1.0)
        + &quad([[-1.0, -1.0, 2.0], [-1.0, 1.0, 2.0], [1.0, 1.0, 2.0], [1.0, -1.0, 2.0]])
        + "LightSource \"point\" \"rgb I\" [ 1 1 1 ]\n";
    let image = picture(&scene([4, 4], 1, &pinhole(0.01), &world), 4, Filtering::None);
    check_all("wall lit from the camera", &image, 1.0 / std::f64::consts::PI / 4.0, 1e-5);
}

#[test]
fn strengths_that_are_no_numbers_are_refused() {
    for value in ["nan", "inf", "1e39"] {
        let text = scene([4, 4], 1, &pinhole(60.0), &format!("LightSource \"point\" \"rgb I\" [ 1 {value} 1 ]\n"));
        refused(&format!("intensity {value}"), &text, &["scene.pbrt:7:"]);
    }
}

#[test]
fn a_light_whose_power_overflows_is_still_finite() {
    // 10³⁶ times an area of 10⁶: the power is beyond f32, the picture is not.
    let world = diffuse(0.5)
        + &quad([[-1e3, -1e3, 1e3], [-1e3, 1e3, 1e3], [1e3, 1e3, 1e3], [1e3, -1e3, 1e3]])
        + &lamp(1e36)
        + &quad([[-1e3, -1e3, -1e3], [1e3, -1e3, -1e3], [1e3, 1e3, -1e3], [-1e3, 1e3, -1e3]]);
    let text = scene([8, 8], 2, &pinhole(40.0), &world);
    let weak = mean_and_error(&frame(&text.replace("1e36", "1e0"), job(32, Filtering::None)).film).0;
    for (name, filtering) in [("unfiltered", Filtering::None), ("filtered", adaptive())] {
        let mean = values(&frame(&text, job(32, filtering))).mean()[1];
        println!("{name}: {:.6} of the picture at radiance 1", mean / 1e36 / weak);
        assert!((mean / 1e36 / weak - 1.0).abs() <= 1e-3);
    }
}

#[test]
fn the_published_filter_keeps_the_light_at_any_strength() {
    let mean = |text: &str| values(&frame(text, job(8, super::support::talk()))).mean()[1];
    let one = mean(&room([32, 24], 1.0, 1.0, PLAIN));
    for level in [1e-12f32, 1e12, 1e30] {
        let ratio = mean(&room([32, 24], 1.0, level, PLAIN)) / f64::from(level) / one;
        println!("talk, radiance {level:e}: {ratio:.6} of the light at 1");
        // Shares of the light are rounded at other places.
        assert!((ratio - 1.0).abs() <= 1e-3);
    }
}

#[test]
fn within_a_sphere_of_light_all_is_bright() {
    // Radiance 1 from all sides: a convex body shows its albedo, at the middle and where it touches the light.
    for radius in [2.0, 1.000001, 1.0] {
        let light = lamp(1.0).replace('\n', " \"bool twosided\" true\n");
        let world =
            format!("AttributeBegin\n{}{light}Shape \"sphere\" \"float radius\" 9\nAttributeEnd\n", diffuse(0.0));
        let ball = format!("{}Translate 0 {} 0\nShape \"sphere\" \"float radius\" 1\n", diffuse(0.5), 9.0 - radius);
        let camera = format!("LookAt 0 {0} -3  0 {0} 0  0 1 0\n{1}", 9.0 - radius, pinhole(8.0));
        let rendered = frame(&scene([16, 16], 1, &camera, &(world + &ball)), job(64, Filtering::None));
        check_mean(&format!("ball {radius} from a sphere of light"), &rendered, 0.5, 1e-4);
    }
}

#[test]
fn a_lamp_in_the_plane_of_a_floor_does_not_light_it() {
    let square = |x: f64, y: f64| [[x, 0.0, y], [x, 0.0, y + 2.0], [x + 2.0, 0.0, y + 2.0], [x + 2.0, 0.0, y]];
    // Turned about an axis of no short form, so that points of one plane are in it to rounding only.
    let world = format!(
        "Rotate 33 1 2 3\n{}{}{}{}",
        diffuse(0.5),
        quad(square(-1.0, -1.0)),
        lamp(1e6),
        quad(square(1.0, -1.0))
    );
    let eye = glam::DQuat::from_axis_angle(glam::DVec3::new(1.0, 2.0, 3.0).normalize(), 33f64.to_radians())
        * glam::DVec3::new(0.0, 5.0, 0.0);
    let camera = format!("LookAt {} {} {}  0 0 0  0 0 1\n{}", eye.x, eye.y, eye.z, pinhole(15.0));
    for (name, filtering) in both() {
        let image = picture(&scene([12, 12], 2, &camera, &world), 64, filtering);
        // A cosine of 2⁻²⁴ of rounding at either end, of 10⁶, over a solid angle below π.
        let worst = image.pixels.iter().flatten().copied().fold(0.0, f32::max);
        println!("{name}: at most {worst:e} of 1e6");
        assert!(worst <= 1e6 * 1e-6);
    }
}

#[test]
fn a_distant_light_has_its_direction_at_any_length() {
    let lit = |end: &str| {
        let sun = format!(
            "LightSource \"distant\" \"rgb L\" [ 1 1 1 ] \"point3 from\" [ 0 0 -{end} ] \"point3 to\" [ 0 0 {end} ]\n"
        );
        picture(&scene([4, 4], 2, &pinhole(60.0), &(sun + &diffuse(0.5) + &wall())), 4, Filtering::None)
    };
    let expected = lit("1");
    assert!(expected.mean()[1] > 0.1);
    for end in ["1e-40", "1e-25", "1e19", "1e30", "1.5e38"] {
        assert_eq!(lit(end).pixels, expected.pixels, "{end}");
    }
}

/// Across the view, facing the camera.
fn wall() -> String {
    quad([[-9.0, -9.0, 3.0], [-9.0, 9.0, 3.0], [9.0, 9.0, 3.0], [9.0, -9.0, 3.0]])
}
