//! Triangles and other shapes that are thin, flat, coincident, or seen at grazing angles.

use std::fmt::Write;

use renderer::filtering::Filtering;
use tests::small::{bits, values};
use tests::synthetic::thorough;

use super::support::{
    ROUNDING, both, check_all, check_mean, closed_box, diffuse, frame, job, lamp, picture, pinhole, quad, scene, sky,
    warned,
};

/// A floor of strips, each `length` long and `length / aspect` wide, seen so that each pixel has many.
fn strips(aspect: f64) -> String {
    let (n, length) = (512, 128.0);
    let width = length / aspect;
    let (mut p, mut indices) = (String::new(), String::new());
    for i in 0..=n {
        let x = width * (f64::from(i) - 0.5 * f64::from(n));
        write!(p, "{x:e} {} 1 {x:e} {} 1 ", -0.5 * length, 0.5 * length).unwrap();
    }
    for i in 0..n {
        let a = 2 * i;
        write!(indices, "{a} {} {} {} {} {} ", a + 1, a + 2, a + 1, a + 3, a + 2).unwrap();
    }
    let (x, y) = (0.49 * width * f64::from(n), 0.49 * length);
    let camera = format!("Camera \"orthographic\" \"float screenwindow\" [ {} {x:e} {} {y} ]", -x, -y);
    let world = sky(1.0)
        + &diffuse(0.5)
        + &format!("Shape \"trianglemesh\" \"point3 P\" [ {p} ] \"integer indices\" [ {indices} ]\n");
    scene([32, 32], 4, &camera, &world)
}

/// A plane in an environment of radiance 1 shows its albedo, whatever it is made of: no hole, no shadow of its own.
fn slivers(aspect: f64) {
    for (name, filtering) in both() {
        check_mean_of(&format!("{name}, slivers of 1:{aspect:e}"), &strips(aspect), filtering);
    }
}

fn check_mean_of(case: &str, text: &str, filtering: Filtering) {
    let image = picture(text, 16, filtering);
    check_all(case, &image, 0.5, 2f64.powi(-14));
}

#[test]
fn slivers_of_1_to_1e5_cover_a_plane() {
    slivers(1e5);
}

#[test]
fn slivers_of_1_to_1e7_cover_a_plane() {
    slivers(1e7);
}

#[test]
fn a_closed_box_of_slivers_keeps_its_light() {
    // Fans from one corner of each side, whose outermost triangles have an aspect of 10⁴ and points of 10⁻⁴ rad.
    let sides = [
        ([-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
        ([-1.0, -1.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
        ([-1.0, -1.0, -1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]),
        ([1.0, -1.0, -1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]),
        ([-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
        ([-1.0, 1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
    ];
    let mut world = diffuse(0.5) + "AreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ] \"bool twosided\" true\n";
    for (corner, u, v) in sides {
        // Along two sides from the corner opposite: n points each, closer and closer.
        let n = 40;
        let mut p = format!("{} {} {} ", corner[0], corner[1], corner[2]);
        let mut point = |a: f64, b: f64| {
            let at: Vec<String> = (0..3).map(|i| (corner[i] + 2.0 * (a * u[i] + b * v[i])).to_string()).collect();
            p += &(at.join(" ") + " ");
        };
        point(1.0, 0.0);
        (0..n).for_each(|i| point(1.0, 0.7f64.powi(n - i)));
        point(1.0, 1.0);
        (0..n).for_each(|i| point(0.7f64.powi(i + 1), 1.0));
        point(0.0, 1.0);
        let triangles: Vec<String> = (1..2 * n + 2).map(|i| format!("0 {} {}", i, i + 1)).collect();
        world +=
            &format!("Shape \"trianglemesh\" \"point3 P\" [ {p} ] \"integer indices\" [ {} ]\n", triangles.join(" "));
    }
    let camera = format!("LookAt 0.1 0.2 -0.3  0.4 0.1 1  0 1 0\n{}", pinhole(80.0));
    check_mean("box of fans", &frame(&scene([24, 24], 1000, &camera, &world), job(32, Filtering::None)), 2.0, ROUNDING);
}

#[test]
fn triangles_without_area_are_left_out_with_a_warning() {
    let mesh = "Shape \"trianglemesh\" \"point3 P\" [ 0 0 1  1 0 1  2 0 1  0 0 1 ] \"integer indices\" [ 0 1 2  0 0 1  0 3 1 ]\n";
    let rendered =
        warned("three of them", &scene([8, 8], 4, &pinhole(60.0), &(sky(1.0) + mesh)), "3 faces have no area");
    check_all("the sky behind them", &values(&rendered), 1.0, 0.0);
}

#[test]
fn coincident_surfaces_are_one() {
    // Ten squares in one place: none shadows another, the light is scattered once.
    let square = quad([[-9.0, -9.0, 1.0], [-9.0, 9.0, 1.0], [9.0, 9.0, 1.0], [9.0, -9.0, 1.0]]);
    let world = sky(1.0) + &diffuse(0.5) + &square.repeat(10);
    for (name, filtering) in both() {
        let image = picture(&scene([16, 16], 4, &pinhole(60.0), &world), 16, filtering);
        check_all(&format!("{name}, ten squares"), &image, 0.5, 2f64.powi(-14));
    }
}

#[test]
fn coincident_turned_surfaces_are_one() {
    // The same in a plane whose points are rounded, in two tessellations that cross.
    let corners = [[-9.0, -8.0, 1.5], [-8.0, 9.0, 2.5], [9.0, 8.0, 3.7], [8.0, -9.0, 2.7]];
    let turned = [corners[1], corners[2], corners[3], corners[0]];
    let world = sky(1.0) + &diffuse(0.5) + &quad(corners) + &quad(turned);
    let rendered = frame(&scene([16, 16], 4, &pinhole(40.0), &world), job(64, Filtering::None));
    check_mean("two squares", &rendered, 0.5, ROUNDING);
}

/// Five sides of a box from `x0` to `x1` that is open at its left or right.
fn open_box(x0: f64, x1: f64) -> String {
    let p = |i: usize| {
        [if i & 1 == 1 { x1 } else { x0 }, if i & 2 == 2 { 1.0 } else { -1.0 }, if i & 4 == 4 { 1.0 } else { -1.0 }]
    };
    [[1, 3, 7, 5], [0, 1, 5, 4], [2, 3, 7, 6], [0, 1, 3, 2], [4, 5, 7, 6]].map(|side| quad(side.map(p))).concat()
}

#[test]
fn open_boxes_that_touch_are_one_furnace() {
    // Rays that graze the seam must not slip through. The seam lies at a number that has no short form.
    let world = diffuse(0.5)
        + "AreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ] \"bool twosided\" true\n"
        + &open_box(0.1, 1.0)
        + &open_box(0.1, -1.0);
    let camera = format!("LookAt 0.12 0.2 -0.3  0.1 0.1 1  0 1 0\n{}", pinhole(80.0));
    check_mean(
        "two open boxes",
        &frame(&scene([24, 24], 1000, &camera, &world), job(64, Filtering::None)),
        2.0,
        ROUNDING,
    );
}

#[test]
fn no_ray_slips_through_the_edges_and_corners_of_a_cube() {
    // From within, towards a corner, an edge of the cube, and one between the two triangles of a face.
    let world =
        "AreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ] \"bool twosided\" true\n".to_owned() + &closed_box(1.0);
    for (name, [x, y, z]) in [("corner", [1.0, 1.0, 1.0]), ("edge", [1.0, 1.0, 0.3]), ("diagonal", [1.0, 0.25, 0.25])] {
        for fov in [1e-3, 1e-1, 10.0] {
            let camera = format!("LookAt 0.1 -0.2 0.3  {x} {y} {z}  0 1 0\n{}", pinhole(fov));
            // Emission alone: paths end where they meet it.
            let image = picture(&scene([64, 64], 0, &camera, &world), 16, Filtering::None);
            check_all(&format!("{name}, {fov} degrees"), &image, 1.0, 0.0);
        }
    }
}

/// Shadow rays of a plane that is lit at `elevation`: no point of it is in the shadow of another, so all pixels show
/// ρ/π · E sin(elevation).
fn grazing(elevation: f64, world: &str, spp: u64) -> (usize, usize) {
    let light = format!(
        "LightSource \"distant\" \"rgb L\" [ 1 1 1 ] \"point3 from\" [ {:e} 0 {:e} ] \"point3 to\" [ 0 0 0 ]\n",
        elevation.cos(),
        elevation.sin()
    );
    let camera = "LookAt 0.1 0.2 10  0.1 0.2 0  0 1 0\nCamera \"orthographic\" \"float screenwindow\" [ -1 1 -1 1 ]";
    let rendered = frame(&scene([64, 64], 1, camera, &(light + &diffuse(1.0) + world)), job(spp, Filtering::None));
    let bounds = rendered.film.bounds();
    let expected = elevation.sin() / std::f64::consts::PI;
    // A pixel in which one of its samples is dark is darker by 1/spp.
    let dark = bounds.pixels().map(|at| (1.0 - rendered.film.pixel(at).mean().y / expected) * spp as f64);
    let dark: f64 = dark.map(|samples| samples.round().max(0.0)).sum();
    (dark as usize, bounds.area() as usize * spp as usize)
}

#[test]
fn a_plane_lit_at_grazing_angles_has_no_shadow() {
    let plane = quad([[-99.0, -99.0, 0.0], [99.0, -99.0, 0.0], [99.0, 99.0, 0.0], [-99.0, 99.0, 0.0]]);
    let spp = if thorough() { 512 } else { 16 };
    let (mut dark, mut rays) = (0, 0);
    for elevation in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5] {
        let (d, n) = grazing(elevation, &plane, spp);
        (dark, rays) = (dark + d, rays + n);
    }
    println!("{dark} of {rays} shadow rays from a plane met it (bound 0)");
    assert_eq!(dark, 0);
}

#[test]
fn a_plane_off_the_origin_lit_at_grazing_angles_has_no_shadow() {
    let plane = quad([[-99.0, -99.0, 0.3], [99.0, -99.0, 0.3], [99.0, 99.0, 0.3], [-99.0, 99.0, 0.3]]);
    let spp = if thorough() { 512 } else { 16 };
    let (mut dark, mut rays) = (0, 0);
    for elevation in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5] {
        let (d, n) = grazing(elevation, &plane, spp);
        (dark, rays) = (dark + d, rays + n);
    }
    println!("{dark} of {rays} shadow rays from a plane met it (bound 0)");
    assert_eq!(dark, 0);
}

/// A convex body in an environment of radiance 1 whose every shadow and path ray leaves: it shows its albedo.
fn convex(name: &str, shape: &str) {
    let world = sky(1.0) + &diffuse(0.5) + shape;
    let camera = format!("LookAt 0 0 -5  0 0 0  0 1 0\n{}", pinhole(8.0));
    for (mode, filtering) in both() {
        let image = picture(&scene([24, 24], 5, &camera, &world), 64, filtering);
        check_all(&format!("{name}, {mode}"), &image, 0.5, 2f64.powi(-14));
    }
}

#[test]
fn a_sphere_does_not_meet_itself() {
    convex("sphere", "Shape \"sphere\" \"float radius\" 1\n");
}

#[test]
fn a_flat_ellipsoid_does_not_meet_itself() {
    convex("ellipsoid of 1:10^5", "Scale 1 1 1e-5\nShape \"sphere\" \"float radius\" 1\n");
}

#[test]
fn a_cylinder_of_1_to_1e6_does_not_meet_itself() {
    convex(
        "cylinder of 1:10^6",
        "Rotate 90 0 1 0\nShape \"cylinder\" \"float radius\" 1 \"float zmin\" -1e6 \"float zmax\" 1e6\n",
    );
}

#[test]
fn a_disk_seen_from_its_edge_is_nothing() {
    let world = sky(1.0) + &diffuse(0.5) + "Rotate 90 0 1 0\nShape \"disk\" \"float radius\" 1\n";
    let camera = format!("LookAt 0 0 -5  0 0 0  0 1 0\n{}", pinhole(30.0));
    let image = picture(&scene([15, 15], 4, &camera, &world), 16, Filtering::None);
    println!("disk edge on: mean {:.6}", image.mean()[1]);
    assert!(image.mean()[1] > 0.999);
}

#[test]
fn spheres_touching_a_floor_get_the_light_of_a_cusp() {
    // White surfaces in a white environment show 1 wherever the paths are not cut, in the cusp as well.
    let floor = quad([[-99.0, -99.0, 0.0], [99.0, -99.0, 0.0], [99.0, 99.0, 0.0], [-99.0, 99.0, 0.0]]);
    let world = sky(1.0) + &diffuse(1.0) + &floor + "Translate 0 0 1\nShape \"sphere\" \"float radius\" 1\n";
    let camera = format!("LookAt 0 -5 0.2  0 0 0.1  0 0 1\n{}", pinhole(12.0));
    check_mean("cusp", &frame(&scene([24, 24], 100_000, &camera, &world), job(64, Filtering::None)), 1.0, 1e-4);
}

#[test]
fn a_lamp_that_lies_on_a_wall_is_the_lamp() {
    // Coincident, with the lamp first or last in the file: the same bits, and no half of the pixels lost to chance.
    let square = quad([[-9.0, -9.0, 1.0], [9.0, -9.0, 1.0], [9.0, 9.0, 1.0], [-9.0, 9.0, 1.0]])
        .replace("0 1 2 0 2 3", "0 2 1 0 3 2");
    let glowing = format!("AttributeBegin\n{}{square}AttributeEnd\n", lamp(3.0));
    for world in [glowing.clone() + &square, square.clone() + &glowing] {
        let text = scene([16, 16], 1, &pinhole(60.0), &world);
        let (a, b) = (frame(&text, job(16, Filtering::None)), frame(&text, job(16, Filtering::None)));
        assert_eq!(bits(&a), bits(&b));
        let image = values(&a);
        let lit = image.pixels.iter().filter(|pixel| pixel[1] == 3.0).count();
        let dark = image.pixels.iter().filter(|pixel| pixel[1] == 0.0).count();
        println!("{lit} pixels lit, {dark} dark, of {}", image.pixels.len());
        assert!(lit == image.pixels.len() || dark == image.pixels.len());
    }
}
