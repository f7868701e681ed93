use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3};

use super::testing::{Mean, Random};
use super::*;
use crate::math::{Frame, Transform, luminance, octahedral, warp};
use crate::sampling::stats::chi2_p_value;
use crate::scene::Span;
use crate::scene::description::{self, AreaLight, AreaLightId, LightKind};
use crate::shape::{Disk, Shape, Sphere, Triangle};
use crate::texture::RgbImage;
use crate::texture::image::Flaws;

const BOUNDS: (Vec3, Vec3) = (Vec3::splat(-5.0), Vec3::splat(5.0));

fn span(start: u32) -> Span {
    Span { file: 0, start, end: start + 1 }
}

/// Light of all groups.
fn all(found: impl Iterator<Item = (Rgb, Group)>) -> Rgb {
    found.map(|(radiance, _)| radiance).sum()
}

fn light(kind: LightKind) -> description::Light {
    description::Light { world_from_light: Transform::default(), kind, group: None, span: span(0) }
}

fn area_light(radiance: Rgb) -> AreaLight {
    AreaLight { radiance, image: None, two_sided: false, power: None, group: None, span: span(1) }
}

/// Images by name, as a file system would hold them.
fn load(path: &Path) -> compile::Loaded {
    let square = |size: usize, texel: &dyn Fn(usize, usize) -> Rgb| {
        let pixels = (0..size * size).map(|i| texel(i % size, i / size)).collect();
        Ok((RgbImage { width: size, height: size, pixels }, Flaws::default()))
    };
    match path.to_str().unwrap() {
        "sky" => square(16, &|x, y| match (x, y) {
            (6, 7) => Rgb::new(400.0, 300.0, 200.0),
            _ => Rgb::new(0.1 + x as f32 * 0.02, 0.3, y as f32 * 0.05),
        }),
        "black" => square(4, &|_, _| Rgb::ZERO),
        "bad" => square(2, &|x, y| [Rgb::ONE, Rgb::NAN, Rgb::NEG_X, Rgb::ONE][2 * y + x]),
        "poster" => square(2, &|x, y| Rgb::new(1.0 + x as f32, 1.0 + y as f32, 1.0)),
        "wide" => Ok((RgbImage { width: 2, height: 1, pixels: vec![Rgb::ONE; 2] }, Flaws::default())),
        _ => Err(format!("\"{}\": no such file", path.display())),
    }
}

fn build(lights: &[description::Light], area: &[AreaLight], emitters: Vec<Emitter>) -> Lights {
    Lights::build_with(lights, area, emitters, BOUNDS, load).unwrap().0
}

fn emitter(shape: Shape, light: u32) -> Emitter {
    Emitter { face_area: shape.area(), shape, alpha: None, light: AreaLightId(light) }
}

fn sphere(center: DVec3, radius: f32) -> Shape {
    let placed = Transform::new(DMat4::from_translation(center));
    Shape::Sphere(Box::new(Sphere::new(&placed, false, radius, [-radius, radius], 360.0).unwrap()))
}

fn triangle(p: [Vec3; 3]) -> Shape {
    Shape::Triangle(Triangle::new(p, None, None, false).unwrap())
}

/// Two triangles that face −z at the height `z`, within ±`half` in x and y.
fn panel(z: f32, half: f32) -> [Shape; 2] {
    let corner = |x: f32, y: f32| Vec3::new(x * half, y * half, z);
    let (a, b, c, d) = (corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0));
    [triangle([a, b, c]), triangle([a, c, d])]
}

fn uniform(radiance: Rgb) -> description::Light {
    light(LightKind::Infinite { radiance, image: None, illuminance: None, portal: vec![] })
}

fn environment(name: &str) -> description::Light {
    let image = Some(PathBuf::from(name));
    light(LightKind::Infinite { radiance: Rgb::ONE, image, illuminance: None, portal: vec![] })
}

fn point(from: Vec3, intensity: Rgb) -> description::Light {
    light(LightKind::Point { intensity, from, power: None })
}

/// Irradiance at the receiver by light samples, nothing in between.
fn sampled_irradiance(lights: &Lights, from: &Receiver, samples: u32) -> Mean {
    let mut random = Random::new(21);
    let mut mean = Mean::default();
    for _ in 0..samples {
        let sample = lights.sample(&Textures::default(), from, random.unit(), random.square());
        mean.add(
            sample.map_or(DVec3::ZERO, |s| {
                s.radiance.as_dvec3() * f64::from(s.wi.dot(from.n).max(0.0)) / f64::from(s.pdf)
            }),
        );
    }
    mean
}

/// Irradiance of a polygon of radiance 1: half the sum over edges of the angle each subtends times the cosine between the
/// normal and the plane through the edge and the receiver.
///
/// **Source**: \[Arvo95b\] equations 3.1 to 3.3 (Lambert's formula). The polygon is above the receiver's horizon, clockwise as the
/// receiver sees it.
fn lambert(corners: &[DVec3], p: DVec3, n: DVec3) -> f64 {
    let edge = |i: usize| {
        let (a, b) = ((corners[i] - p).normalize(), (corners[(i + 1) % corners.len()] - p).normalize());
        a.dot(b).acos() * a.cross(b).normalize().dot(n)
    };
    0.5 * (0..corners.len()).map(edge).sum::<f64>().abs()
}

#[test]
fn a_panel_gives_the_irradiance_of_lamberts_formula() {
    let emitters = panel(2.0, 1.5).map(|shape| emitter(shape, 0)).to_vec();
    let lights = build(&[], &[area_light(Rgb::new(1.0, 2.0, 3.0))], emitters);
    let corners = [(-1.5, -1.5), (-1.5, 1.5), (1.5, 1.5), (1.5, -1.5)].map(|(x, y)| DVec3::new(x, y, 2.0));
    for (p, n) in
        [(Vec3::ZERO, Vec3::Z), (Vec3::new(3.0, -2.0, 1.0), Vec3::new(-0.6, 0.0, 0.8)), (Vec3::Z * 1.9, Vec3::Z)]
    {
        let n = n.normalize();
        let expected = lambert(&corners, p.as_dvec3(), n.as_dvec3()) * DVec3::new(1.0, 2.0, 3.0);
        let mean = sampled_irradiance(&lights, &Receiver { p, n }, 50_000);
        mean.assert_is(expected, &format!("at {p}"));
    }
    // Behind it.
    let above = Receiver { p: Vec3::Z * 3.0, n: -Vec3::Z };
    assert!(lights.sample(&Textures::default(), &above, 0.3, Vec2::splat(0.4)).is_none());
    assert_eq!(lights.emitter_pdf(0, &above, Vec3::new(-0.5, 0.5, 2.0), -Vec3::Z), 0.0);
}

#[test]
fn a_disk_and_a_sphere_give_their_analytic_irradiance() {
    let flipped = Transform::new(DMat4::from_translation(DVec3::Z * 2.0));
    let disk = Shape::Disk(Box::new(Disk::new(&flipped, true, 0.0, 1.5, 0.0, 360.0).unwrap()));
    let up = Receiver { p: Vec3::ZERO, n: Vec3::Z };
    let disk = build(&[], &[area_light(Rgb::ONE)], vec![emitter(disk, 0)]);
    let expected = PI * 1.5 * 1.5 / (1.5 * 1.5 + 2.0 * 2.0);
    sampled_irradiance(&disk, &up, 50_000).assert_is(DVec3::splat(expected), "disk");

    let ball = build(&[], &[area_light(Rgb::ONE)], vec![emitter(sphere(DVec3::new(1.0, 0.0, 3.0), 0.8), 0)]);
    // A sphere above the horizon: π (r/d)² cosθ of its centre.
    let d2 = 10.0_f64;
    let expected = PI * 0.64 / d2 * 3.0 / d2.sqrt();
    sampled_irradiance(&ball, &up, 50_000).assert_is(DVec3::splat(expected), "sphere");
}

#[test]
fn all_kinds_together_add_up() {
    let lights = [
        uniform(Rgb::new(0.2, 0.0, 0.1)),
        point(Vec3::new(1.0, 1.0, 2.0), Rgb::new(3.0, 0.0, 1.0)),
        light(LightKind::Distant {
            radiance: Rgb::new(0.0, 0.5, 0.0),
            from: Vec3::Z,
            to: Vec3::ZERO,
            illuminance: None,
        }),
    ];
    let emitters = panel(2.0, 1.0).map(|shape| emitter(shape, 0)).to_vec();
    let lights = build(&lights, &[area_light(Rgb::ONE)], emitters);
    let (p, n) = (Vec3::new(0.5, -0.5, 0.0), Vec3::new(0.0, 0.6, 0.8));
    let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)].map(|(x, y)| DVec3::new(x, y, 2.0));
    let to_point = DVec3::new(0.5, 1.5, 2.0);
    let expected = PI * DVec3::new(0.2, 0.0, 0.1)
        + to_point.normalize().dot(n.as_dvec3()) / to_point.length_squared() * DVec3::new(3.0, 0.0, 1.0)
        + 0.8 * DVec3::new(0.0, 0.5, 0.0)
        + lambert(&corners, p.as_dvec3(), n.as_dvec3());
    sampled_irradiance(&lights, &Receiver { p, n }, 200_000).assert_is(expected, "all");
}

/// A scene with every kind of light that has a density: one-sided, two-sided and curved emitters, two environments.
fn mixture() -> Lights {
    let area = [area_light(Rgb::ONE), AreaLight { two_sided: true, ..area_light(Rgb::new(0.5, 2.0, 1.0)) }];
    let [a, b] = panel(2.0, 1.0);
    let slanted = triangle([Vec3::new(2.0, -1.0, -1.0), Vec3::new(2.5, 1.0, -0.5), Vec3::new(1.5, 0.5, 1.0)]);
    let emitters =
        vec![emitter(a, 0), emitter(b, 0), emitter(sphere(DVec3::new(-2.0, 0.5, 0.0), 0.7), 0), emitter(slanted, 1)];
    build(&[uniform(Rgb::ONE), environment("sky")], &area, emitters)
}

/// Density of light samples along `wi`: the sum over all surfaces that the ray meets, and over environments.
fn density(lights: &Lights, from: &Receiver, wi: Vec3) -> f64 {
    let mut sum = 0.0;
    for (number, emitter) in lights.emitters.iter().enumerate() {
        let mut near = 0.0;
        while let Some(hit) = emitter.shape.intersect(from.p, wi, (near, f32::INFINITY)) {
            near = hit.t * (1.0 + 1e-5);
            let p = from.p + wi * hit.t;
            let n = match &emitter.shape {
                Shape::Sphere(sphere) => sphere.surface_point(hit.local).n,
                shape => shape.normal_cone().0,
            };
            // A sample that emits nothing to here is not returned.
            if lights.emitted(number as u32, Vec2::splat(0.5), n, -wi) != Rgb::ZERO {
                sum += f64::from(lights.emitter_pdf(number as u32, from, p, n));
            }
        }
    }
    let infinite = lights.infinite.iter().map(|light| f64::from(light.light.radiance_and_pdf(wi, from.n).1));
    sum + infinite.sum::<f64>() * f64::from(lights.infinite_pmf)
}

#[test]
fn the_density_is_that_of_samples() {
    let lights = mixture();
    for from in [
        Receiver { p: Vec3::new(0.3, 0.2, -0.5), n: Vec3::new(0.0, 0.6, 0.8) },
        Receiver { p: Vec3::new(0.3, 0.2, 1.0), n: Vec3::ZERO },
    ] {
        const BINS: usize = 16;
        const STEPS: usize = 40;
        const SAMPLES: usize = 60_000;
        let side = BINS * STEPS;
        let mut random = Random::new(31);
        let mut expected = vec![0.0; BINS * BINS];
        for i in 0..side * side {
            let uv = (Vec2::new((i % side) as f32, (i / side) as f32) + random.square()) / side as f32;
            let d = density(&lights, &from, octahedral::direction_from_square(uv));
            expected[(i / side / STEPS) * BINS + i % side / STEPS] +=
                d * SAMPLES as f64 * 2.0 * TAU / (side * side) as f64;
        }
        let mut observed = vec![0.0; BINS * BINS];
        let mut none = 0;
        for _ in 0..SAMPLES {
            let Some(sample) = lights.sample(&Textures::default(), &from, random.unit(), random.square()) else {
                none += 1;
                continue;
            };
            let at = (octahedral::square_from_direction(sample.wi) * BINS as f32).as_usizevec2();
            observed[at.y.min(BINS - 1) * BINS + at.x.min(BINS - 1)] += 1.0;
        }
        // What the density leaves to 1 are samples without a value.
        let total: f64 = expected.iter().sum();
        observed.push(f64::from(none));
        expected.push((SAMPLES as f64 - total).max(0.0));
        let p = chi2_p_value(&observed, &expected);
        assert!(p > 1e-4, "{from:?}: p = {p}, {none} without value, {total} expected");
    }
}

#[test]
fn a_sample_has_the_density_that_a_hit_is_weighted_with() {
    let lights = mixture();
    let mut random = Random::new(32);
    let (mut surfaces, mut beyond, mut different) = (0, 0, 0);
    for i in 0..20_000 {
        let n = if i % 3 == 0 { Vec3::ZERO } else { random.direction() };
        let from = Receiver { p: random.cube() * 1.4, n };
        let Some(sample) = lights.sample(&Textures::default(), &from, random.unit(), random.square()) else { continue };
        match sample.target {
            Target::Surface { point, n } => {
                surfaces += 1;
                // Emitters do not overlap: one of them has the point.
                let found = (0..4).any(|e| (lights.emitter_pdf(e, &from, point.p, n) / sample.pdf - 1.0).abs() < 1e-4);
                different += u32::from(!found);
            }
            Target::Infinite => {
                beyond += 1;
                let found = lights.infinite.iter().any(|light| {
                    let (radiance, pdf) = light.light.radiance_and_pdf(sample.wi, from.n);
                    radiance == sample.radiance && (pdf * lights.infinite_pmf / sample.pdf - 1.0).abs() < 1e-4
                });
                different += u32::from(!found);
            }
            Target::Point(_) => unreachable!(),
        }
    }
    assert!(surfaces > 1000 && beyond > 1000);
    // Points round, and the density of grazing ones with them.
    assert!(different < 20, "{different}");
}

#[test]
fn light_and_bsdf_samples_weighted_together_are_complete() {
    let n = Vec3::new(0.0, 0.6, 0.8);
    let from = Receiver { p: Vec3::ZERO, n };
    let lights = build(&[uniform(Rgb::new(0.3, 0.2, 0.1)), environment("sky")], &[], vec![]);
    const SIDE: usize = 1024;
    let mut expected = DVec3::ZERO;
    for i in 0..SIDE * SIDE {
        let uv = (Vec2::new((i % SIDE) as f32, (i / SIDE) as f32) + 0.5) / SIDE as f32;
        let wi = octahedral::direction_from_square(uv);
        expected += all(lights.escaped(wi, None, 0.0)).as_dvec3() * f64::from(wi.dot(n).max(0.0));
    }
    expected *= 2.0 * TAU / (SIDE * SIDE) as f64;
    for (what, lights) in [("alone", lights.clone()), ("beside", lights.beside_bsdf_samples())] {
        let mut random = Random::new(41);
        let mut mean = Mean::default();
        for _ in 0..100_000 {
            let mut value = DVec3::ZERO;
            if let Some(s) = lights.sample(&Textures::default(), &from, random.unit(), random.square()) {
                let cos = s.wi.dot(n).max(0.0);
                let weight = power_heuristic(s.pdf, warp::cosine_hemisphere_pdf(cos));
                value += s.radiance.as_dvec3() * f64::from(cos * weight / s.pdf);
            }
            // Irradiance by the cosine: f cosθ / pdf is π.
            let wi = Frame::from_normal(n).to_world(warp::cosine_hemisphere(random.square()));
            let escaped = all(lights.escaped(wi, Some(&from), warp::cosine_hemisphere_pdf(wi.dot(n))));
            value += PI * escaped.as_dvec3();
            mean.add(value);
        }
        mean.assert_is(expected, what);
    }
}

#[test]
fn specular_paths_see_environments_unweighted() {
    let lights = build(&[uniform(Rgb::ONE), environment("sky")], &[], vec![]);
    let wi = Vec3::new(0.48, 0.6, 0.64);
    let sky = lights.infinite.iter().map(|light| light.light.radiance_and_pdf(wi, Vec3::ZERO).0).sum::<Rgb>();
    assert_eq!(all(lights.escaped(wi, None, 0.0)), sky);
    let from = Receiver { p: Vec3::ZERO, n: Vec3::Z };
    assert!(all(lights.escaped(wi, Some(&from), 0.3)).cmplt(sky).all());
    // Nearly a delta: the light sample has no part in it.
    assert!((all(lights.escaped(wi, Some(&from), 1e30)) - sky).length() < 1e-5);
}

/// Luminous power of a light at a point, by a random point in each of many equal areas.
fn power(lights: &Lights) -> f64 {
    const SIDE: usize = 512;
    let mut random = Random::new(45);
    let mut sum = 0.0;
    for i in 0..SIDE * SIDE {
        let uv = (Vec2::new((i % SIDE) as f32, (i / SIDE) as f32) + random.square()) / SIDE as f32;
        sum += f64::from(luminance(lights.points[0].light.intensity(octahedral::direction_from_square(uv))));
    }
    sum * 2.0 * TAU / (SIDE * SIDE) as f64
}

#[test]
fn lights_have_the_power_asked_for() {
    let (intensity, power_asked) = (Rgb::ONE, Some(50.0));
    let image = PathBuf::from("poster");
    let kinds = [
        LightKind::Point { intensity, from: Vec3::ONE, power: power_asked },
        LightKind::Spot {
            intensity,
            from: Vec3::ONE,
            to: Vec3::X,
            cone_angle: 40.0,
            cone_delta_angle: 15.0,
            power: power_asked,
        },
        LightKind::Projection { scale: intensity, image, fov: 70.0, power: power_asked },
    ];
    for kind in kinds {
        let lights = build(&[light(kind.clone())], &[], vec![]);
        assert!((power(&lights) / 50.0 - 1.0).abs() < 3e-3, "{kind:?}: {}", power(&lights));
    }
    // A goniometric image scales by the mean of its channels, whatever the luminance.
    let image = Some(PathBuf::from("poster"));
    let lights = build(&[light(LightKind::Goniometric { intensity, image, power: power_asked })], &[], vec![]);
    assert!((power(&lights) / 50.0 - 1.0).abs() < 3e-3, "{}", power(&lights));
}

#[test]
fn emitters_have_the_power_asked_for_each() {
    let image = PathBuf::from("poster");
    let plain = AreaLight { power: Some(10.0), ..area_light(Rgb::ONE) };
    let area =
        [plain.clone(), AreaLight { two_sided: true, ..plain.clone() }, AreaLight { image: Some(image), ..plain }];
    let shape = || triangle([Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 3.0]);
    let lights = build(&[], &area, (0..3).map(|i| emitter(shape(), i)).collect());
    for (number, sides) in [(0, 1.0), (1, 2.0)] {
        let radiance = f64::from(lights.emitted(number, Vec2::splat(0.5), Vec3::Z, Vec3::Z).x);
        assert!((radiance * 3.0 * PI * sides / 10.0 - 1.0).abs() < 1e-6, "{number}");
    }
    assert_eq!(lights.emitted(0, Vec2::ZERO, Vec3::Z, -Vec3::Z), Rgb::ZERO);
    assert_eq!(lights.emitted(1, Vec2::ZERO, Vec3::Z, -Vec3::Z), lights.emitted(1, Vec2::ZERO, Vec3::Z, Vec3::Z));
    // The image's four texels have the mean (1.5, 1.5, 1); its top left is at u = 0, v = 1.
    let mean = f64::from(luminance(Rgb::new(1.5, 1.5, 1.0)));
    let corner = lights.emitted(2, Vec2::new(1.0, 1.0), Vec3::Z, Vec3::Z).as_dvec3();
    let expected = DVec3::new(2.0, 1.0, 1.0) * 10.0 / (3.0 * PI * mean);
    assert!((corner - expected).length() < 1e-6, "{corner} {expected}");
}

#[test]
fn environments_have_the_illuminance_asked_for() {
    let kind = LightKind::Infinite { radiance: Rgb::ONE, image: None, illuminance: Some(5.0), portal: vec![] };
    let lights = build(&[light(kind)], &[], vec![]);
    let up = Receiver { p: Vec3::ZERO, n: Vec3::Z };
    sampled_irradiance(&lights, &up, 1000).assert_is(DVec3::splat(5.0), "uniform");
    let kind = LightKind::Distant { radiance: Rgb::ONE, from: Vec3::Z * 3.0, to: Vec3::ZERO, illuminance: Some(5.0) };
    let lights = build(&[light(kind)], &[], vec![]);
    let sample = lights.sample(&Textures::default(), &up, 0.7, Vec2::ZERO).unwrap();
    assert_eq!((sample.radiance, sample.wi, sample.pdf, sample.delta), (Rgb::splat(5.0), Vec3::Z, 1.0, true));
}

#[test]
fn lights_turn_with_their_transform() {
    let world_from_light = Transform::new(
        DMat4::from_translation(DVec3::new(1.0, 2.0, 3.0))
            * DMat4::from_rotation_y(FRAC_PI_2)
            * DMat4::from_scale(DVec3::splat(2.0)),
    );
    let kind = LightKind::Spot {
        intensity: Rgb::ONE,
        from: Vec3::ZERO,
        to: Vec3::Z,
        cone_angle: 20.0,
        cone_delta_angle: 5.0,
        power: None,
    };
    let spot = description::Light { world_from_light, ..light(kind) };
    // Several, so that the tree must find them by their cones.
    let lights = build(&vec![spot; 12], &[], vec![]);
    let lit = Receiver { p: Vec3::new(5.0, 2.5, 3.2), n: Vec3::ZERO };
    let sample = lights.sample(&Textures::default(), &lit, 0.4, Vec2::ZERO).unwrap();
    assert!((sample.radiance.x * 16.29 - 1.0).abs() < 1e-3 && sample.target == Target::Point(Vec3::new(1.0, 2.0, 3.0)));
    for p in [Vec3::new(-3.0, 2.0, 3.0), Vec3::new(1.0, 2.0, 7.0), Vec3::new(1.0, 2.0, 3.0)] {
        assert!(lights.sample(&Textures::default(), &Receiver { p, n: Vec3::ZERO }, 0.4, Vec2::ZERO).is_none(), "{p}");
    }
    let kind = LightKind::Distant { radiance: Rgb::ONE, from: Vec3::Z, to: Vec3::ZERO, illuminance: None };
    let sun = build(&[description::Light { world_from_light, ..light(kind) }], &[], vec![]);
    assert!((sun.sample(&Textures::default(), &lit, 0.4, Vec2::ZERO).unwrap().wi - Vec3::X).length() < 1e-6);
}

#[test]
fn narrow_spots_are_found_in_their_whole_cone() {
    let mut random = Random::new(51);
    let spot = |from: Vec3, to: Vec3, cone: f32| {
        light(LightKind::Spot {
            intensity: Rgb::ONE,
            from,
            to,
            cone_angle: cone,
            cone_delta_angle: 0.3 * cone,
            power: None,
        })
    };
    for cone in [1e-3, 0.05, 1.0, 30.0, 100.0] {
        let description: Vec<_> = (0..20).map(|_| spot(random.cube(), random.cube() * 4.0, cone)).collect();
        let lights = build(&description, &[], vec![]);
        for _ in 0..2000 {
            let light = (random.unit() * 20.0) as usize;
            let position = lights.points[light].light.position();
            let LightKind::Spot { from, to, .. } = &description[light].kind else { unreachable!() };
            let drop = 1.0 - cone.to_radians().cos();
            let around = Frame::from_normal((*to - *from).normalize());
            let w = around.s * warp::uniform_cone(random.square(), drop).x
                + around.t * warp::uniform_cone(random.square(), drop).y
                + around.n;
            let p = position + w.normalize() * (0.1 + 5.0 * random.unit());
            let from = Receiver { p, n: Vec3::ZERO };
            if lights.points[light].light.intensity((p - position).normalize()) != Rgb::ZERO {
                assert!(lights.tree.pmf(&from, light as u32) > 0.0, "{cone} {light}");
            }
        }
    }
}

#[test]
fn emitters_are_chosen_on_their_side_and_only_there() {
    let mut random = Random::new(52);
    for round in 0..50 {
        let corners: Vec<_> = (0..7).map(|_| [random.cube(), random.cube(), random.cube()]).collect();
        let emitters = corners.iter().map(|&p| emitter(triangle(p), 0)).collect();
        let lights = build(&[], &[area_light(Rgb::ONE)], emitters);
        for _ in 0..50 {
            let from = Receiver { p: random.cube() * 1.5, n: Vec3::ZERO };
            for (number, [a, b, c]) in corners.iter().enumerate() {
                let height = (from.p - *a).dot((*b - *a).cross(*c - *a).normalize());
                // Distances are of the order of 1 and known to some ulps.
                if height.abs() > 1e-5 {
                    let pmf = lights.tree.pmf(&from, number as u32);
                    assert_eq!(pmf > 0.0, height > 0.0, "{round} {number}: {pmf} at {height}");
                }
            }
        }
    }
}

#[test]
fn hopeless_input_is_safe() {
    let nowhere = Receiver { p: Vec3::ONE, n: Vec3::Z };
    let empty = build(&[], &[], vec![]);
    assert!(empty.is_empty() && empty.sample(&Textures::default(), &nowhere, 0.5, Vec2::ZERO).is_none());
    assert_eq!(all(empty.escaped(Vec3::X, Some(&nowhere), 1.0)), Rgb::ZERO);

    // Lights that emit nothing are no lights.
    let dark = build(&[environment("black"), uniform(Rgb::ZERO), point(Vec3::ONE, Rgb::ZERO)], &[], vec![]);
    assert!(dark.is_empty() && dark.sample(&Textures::default(), &nowhere, 0.5, Vec2::ZERO).is_none());
    let black = build(&[], &[area_light(Rgb::ZERO)], panel(2.0, 1.0).map(|s| emitter(s, 0)).to_vec());
    assert!(black.is_empty());
    assert_eq!(black.emitter_pdf(1, &nowhere, Vec3::Z * 2.0, -Vec3::Z), 0.0);

    // At the place of a light.
    let lights = build(&[point(Vec3::ONE, Rgb::ONE), point(Vec3::ONE, Rgb::ONE)], &[], vec![]);
    assert!(lights.sample(&Textures::default(), &nowhere, 0.5, Vec2::ZERO).is_none());
    // Radiance that f32 cannot hold.
    let bright = build(&[point(Vec3::ZERO, Rgb::splat(1e12))], &[], vec![]);
    assert!(
        bright
            .sample(&Textures::default(), &Receiver { p: Vec3::splat(1e-15), n: Vec3::ZERO }, 0.5, Vec2::ZERO)
            .is_none()
    );
}

#[test]
fn bright_and_dim_lights_share_a_frame() {
    let area = [area_light(Rgb::splat(1e-12)), area_light(Rgb::splat(1e12))];
    let shapes = panel(2.0, 1.0).into_iter().zip([0, 1]).map(|(shape, light)| emitter(shape, light)).collect();
    let lights = build(&[uniform(Rgb::splat(1e-12)), environment("sky")], &area, shapes);
    let mut random = Random::new(61);
    for _ in 0..10_000 {
        let from = Receiver { p: random.cube() * 2.0, n: random.direction() };
        if let Some(sample) = lights.sample(&Textures::default(), &from, random.unit(), random.square()) {
            assert!(sample.pdf > 0.0 && sample.pdf.is_finite() && sample.radiance.is_finite());
        }
        let escaped = all(lights.escaped(random.direction(), Some(&from), random.unit() * 1e12));
        assert!(escaped.is_finite() && escaped.min_element() >= 0.0);
    }
    // Seen from the side of the dim triangle alone, it is chosen.
    let below = Receiver { p: Vec3::new(-0.5, 0.5, 1.0), n: Vec3::Z };
    assert!(lights.emitter_pdf(0, &below, Vec3::new(-0.5, 0.5, 2.0), -Vec3::Z) > 0.0);
}

#[test]
fn all_errors_are_reported_with_their_places() {
    let at = |start: u32, light: description::Light| description::Light { span: span(start), ..light };
    let flat = Transform::new(DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0)));
    let same = LightKind::Distant { radiance: Rgb::ONE, from: Vec3::X, to: Vec3::X, illuminance: None };
    let lights = [
        at(10, environment("missing")),
        at(11, environment("wide")),
        at(12, description::Light { world_from_light: flat, ..point(Vec3::ZERO, Rgb::ONE) }),
        at(13, light(same)),
        at(14, environment("sky")),
    ];
    let area = [AreaLight { image: Some("missing too".into()), span: span(15), ..area_light(Rgb::ONE) }];
    let emitters = panel(2.0, 1.0).map(|shape| emitter(shape, 0)).to_vec();
    let errors = Lights::build_with(&lights, &area, emitters, BOUNDS, load).unwrap_err();
    let mut places: Vec<u32> = errors.iter().map(|(span, _)| span.start).collect();
    places.sort_unstable();
    assert_eq!(places, [10, 11, 12, 13, 15], "{errors:?}");
    assert!(errors.iter().any(|(_, message)| message.contains("2x1")));
}

#[test]
fn what_is_changed_is_warned_about() {
    let portal = vec![Vec3::ZERO, Vec3::X, Vec3::ONE, Vec3::Y];
    let lights = [
        environment("bad"),
        light(LightKind::Infinite { radiance: Rgb::ONE, image: None, illuminance: None, portal }),
        point(Vec3::ZERO, Rgb::new(1.0, -2.0, 3.0)),
        light(LightKind::Infinite {
            radiance: Rgb::ONE,
            image: Some("black".into()),
            illuminance: Some(3.0),
            portal: vec![],
        }),
    ];
    let (built, warnings) = Lights::build_with(&lights, &[], vec![], BOUNDS, load).unwrap();
    // Of the portal the reader has warned already.
    assert_eq!(warnings.len(), 3, "{warnings:?}");
    assert!(warnings[0].1.contains("4 values"), "{warnings:?}");
    assert_eq!(built.points[0].light.intensity(Vec3::X), Rgb::new(1.0, 0.0, 3.0));
    let seen = all(built.escaped(Vec3::X, None, 0.0));
    assert!(seen.is_finite());
}

#[test]
fn the_result_does_not_depend_on_how_often_it_is_built() {
    let (a, b) = (mixture(), mixture());
    let mut random = Random::new(71);
    for _ in 0..1000 {
        let from = Receiver { p: random.cube(), n: random.direction() };
        let (u, v) = (random.unit(), random.square());
        assert_eq!(a.sample(&Textures::default(), &from, u, v), b.sample(&Textures::default(), &from, u, v));
    }
}

#[test]
fn image_files_are_loaded_and_their_broken_values_counted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("env.exr");
    let texels = [1.0, f32::NAN, 3.0, 4.0, f32::INFINITY, 6.0, -7.0, 8.0, 9.0, 10.0, 11.0, 12.0];
    let window = oiio::Window::at_origin(2, 2);
    let channel = |name: &str| oiio::Channel { name: name.to_owned(), format: oiio::Format::Float };
    let output = oiio::Output {
        path: &path,
        file_format: oiio::FileFormat::Exr,
        data_window: window,
        display_window: window,
        channels: ["R", "G", "B"].map(channel).to_vec(),
        pixels: &texels,
        attributes: vec![],
        compression: oiio::Compression::default(),
    };
    oiio::write(&output).unwrap();
    let kind = LightKind::Infinite { radiance: Rgb::ONE, image: Some(path), illuminance: None, portal: vec![] };
    let (lights, warnings) = Lights::build(&[light(kind)], &[], vec![], BOUNDS).unwrap();
    assert!(warnings[0].1.contains("env.exr") && warnings[0].1.contains("3 values"), "{warnings:?}");
    for (u, v, texel) in [(0.2, 0.2, [1, 0, 3]), (0.7, 0.2, [4, 0, 6]), (0.2, 0.7, [0, 8, 9]), (0.7, 0.7, [10, 11, 12])]
    {
        let texel = Rgb::from_array(texel.map(|channel| channel as f32));
        let seen = all(lights.escaped(octahedral::direction_from_square(Vec2::new(u, v)), None, 0.0));
        // Texels are kept to 2⁻¹⁶ of their sum.
        assert!((seen - texel).abs().max_element() <= texel.element_sum() / 65_536.0, "{seen} {texel}");
    }
}
