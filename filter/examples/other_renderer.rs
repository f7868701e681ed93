//! The filter without our renderer: a chequered floor under a rectangular light, traced in a hundred lines.
//!
//! What the renderer has to know of the filter is how to fill a [`PathRecord`], and what to do with what comes back. Here
//! paths end at the floor: they have a first vertex with a diffuse lobe and no second. The exact image is known, so the
//! error is printed without a filter, with that of the talk, and with the adaptive one.
#![allow(clippy::print_stdout, reason = "an example prints what it shows")]

use filter::talk::{self, Talk};
use filter::{Adaptive, Anchor, Lobe, PackedRgb, PathRecord, Vertex};
use glam::{DVec3, Vec3};

const WIDTH: u32 = 160;
const HEIGHT: u32 = 90;

/// Corners of the light, which faces down.
const LIGHT: [Vec3; 4] =
    [Vec3::new(-1.5, -0.5, 1.0), Vec3::new(-1.5, 0.5, 1.0), Vec3::new(1.5, 0.5, 1.0), Vec3::new(1.5, -0.5, 1.0)];
const RADIANCE: f32 = 5.0;
const EYE: Vec3 = Vec3::new(0.0, -5.0, 3.0);
/// Width of the image at distance 1.
const FIELD: f32 = 1.2;

/// Where the floor is seen through a place of the image, in pixels; the distance from the eye.
fn floor(x: f32, y: f32) -> (Vec3, f32) {
    let forward = -EYE.normalize();
    let right = Vec3::X;
    let up = right.cross(forward);
    let pixel = FIELD / WIDTH as f32;
    let direction = forward + (x - 0.5 * WIDTH as f32) * pixel * right + (0.5 * HEIGHT as f32 - y) * pixel * up;
    let t = -EYE.z / direction.z;
    (EYE + t * direction, t * direction.length())
}

/// Albedo of the floor, in squares.
fn albedo(p: Vec3) -> Vec3 {
    let odd = (p.x.floor() + p.y.floor()).rem_euclid(2.0) == 1.0;
    if odd { Vec3::new(0.8, 0.7, 0.5) } else { Vec3::new(0.1, 0.15, 0.3) }
}

/// Radiance that the light sends to a point of the floor, from the point `u` on it: the estimate of irradiance over π, which
/// is what a surface of albedo 1 reflects.
fn arriving(p: Vec3, u: [f32; 2]) -> f32 {
    let (edge_x, edge_y) = (LIGHT[3] - LIGHT[0], LIGHT[1] - LIGHT[0]);
    let to_light = LIGHT[0] + u[0] * edge_x + u[1] * edge_y - p;
    let area = edge_x.length() * edge_y.length();
    // The cosines at floor and light are the same.
    RADIANCE * area * to_light.z * to_light.z / to_light.length_squared().powi(2) / std::f32::consts::PI
}

/// The expectation of [`arriving`], by Lambert's formula: half the sum of the angles that the light's edges subtend, each
/// times the cosine between the floor's normal and the edge's own plane.
fn arriving_exactly(p: Vec3) -> f32 {
    let corners = LIGHT.map(|corner| (corner - p).normalize());
    let edges = (0..4).map(|i| {
        let (a, b) = (corners[i], corners[(i + 1) % 4]);
        a.dot(b).acos() * b.cross(a).normalize().z
    });
    RADIANCE * 0.5 * edges.sum::<f32>().abs() / std::f32::consts::PI
}

/// The paths of one row of pixels, and what their pixels are without a filter.
fn trace(row: u32, samples: u32, random: &mut impl FnMut() -> f32) -> (Vec<PathRecord>, Vec<Vec3>) {
    let mut records = Vec::new();
    let mut pixels = vec![Vec3::ZERO; WIDTH as usize];
    for (column, pixel) in (0..WIDTH).zip(&mut pixels) {
        for sample in 0..samples {
            let (p, distance) = floor(column as f32 + random(), row as f32 + random());
            let incident = Vec3::splat(arriving(p, [random(), random()]));
            let footprint = distance * FIELD / WIDTH as f32;
            // The filter sees radiance over albedo, so it does not blur the squares.
            let throughput = albedo(p) / samples as f32;
            records.push(PathRecord {
                slot: row * WIDTH + column,
                first: Vertex::new(p, Vec3::Z, footprint, 0, 0),
                second: Vertex::none(sample as u8),
                diffuse: Lobe {
                    throughput: PackedRgb::new(throughput),
                    rest: PackedRgb::new(incident),
                    ..Lobe::default()
                },
                ..PathRecord::default()
            });
            *pixel += throughput * incident;
        }
    }
    (records, pixels)
}

/// The exact image, but for 8 × 8 points a pixel where squares meet.
fn reference() -> Vec<Vec3> {
    let at = |i: u32| (i as f32 + 0.5) / 8.0;
    let pixel = |slot: u32| {
        let points = (0..64).map(|i| floor((slot % WIDTH) as f32 + at(i % 8), (slot / WIDTH) as f32 + at(i / 8)).0);
        points.map(|p| albedo(p) * arriving_exactly(p)).sum::<Vec3>() / 64.0
    };
    (0..WIDTH * HEIGHT).map(pixel).collect()
}

/// Mean over pixels and channels of the squared error over the squared reference, whose dark places count a hundredth of
/// the mean.
fn relative_error(image: &[Vec3], reference: &[Vec3]) -> f64 {
    let mean = reference.iter().map(|pixel| pixel.element_sum()).sum::<f32>() / (3 * reference.len()) as f32;
    let error = |(image, exact): (&Vec3, &Vec3)| {
        let squared = (*image - *exact) * (*image - *exact);
        f64::from((squared / (*exact * *exact + 0.01 * mean * mean)).element_sum() / 3.0)
    };
    image.iter().zip(reference).map(error).sum::<f64>() / image.len() as f64
}

/// An image from what slots got.
fn image(slots: impl Iterator<Item = (u32, Vec3)>) -> Vec<Vec3> {
    let mut image = vec![Vec3::ZERO; (WIDTH * HEIGHT) as usize];
    for (slot, radiance) in slots {
        image[slot as usize] = radiance;
    }
    image
}

fn main() -> Result<(), talk::ParamsError> {
    // SplitMix64 is random enough for an example.
    let mut state = 1u64;
    let mut random = move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (state ^ state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        (x >> 40) as f32 / (1u64 << 24) as f32
    };
    let anchor = Anchor { origin: EYE.as_dvec3(), extent: DVec3::splat(10.0).length() };
    let reference = reference();
    println!("relMSE of a floor under a light   unfiltered    the talk    adaptive");
    for samples in [1, 4, 16, 64, 256] {
        // Rows are the parts: each slot belongs to one.
        let (records, rows): (Vec<_>, Vec<_>) = (0..HEIGHT).map(|row| trace(row, samples, &mut random)).unzip();
        let unfiltered = rows.concat();

        let mut talk = Talk::new(&talk::Params::default(), &anchor, (WIDTH * HEIGHT * samples) as usize)?;
        talk.add(&records);
        let by_talk = image(talk.resolve().into_iter().flatten().map(|(slot, value)| (slot, value.diffuse)));

        let mut adaptive = Adaptive::new(&filter::Params::default(), &anchor, records.len());
        adaptive.add(&records);
        let by_adaptive = image(adaptive.resolve().into_iter().flatten().map(|(slot, value)| (slot, value.diffuse)));

        let error = |image: &[Vec3]| relative_error(image, &reference);
        println!(
            "{samples:>8} samples a pixel         {:>9.6}   {:>9.6}   {:>9.6}",
            error(&unfiltered),
            error(&by_talk),
            error(&by_adaptive)
        );
    }
    Ok(())
}
