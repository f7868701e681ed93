//! Textures that are computed from their coordinates alone.

use glam::{Vec2, Vec3};

use super::mapping::{Point2, Point3};
use super::noise::{fbm, noise};
use crate::math::Rgb;

/// Half the width of the tent that smooths checks, in pixels: pbrt's.
const TENT: f32 = 1.5;

/// How much of the second of two textures a 2D checkerboard shows, in [0, 1]. Checks are unit squares.
///
/// **Source**: \[Pharr23\] section 10.3 (the product of box- and tent-filtered square waves).
pub fn checks2(at: &Point2) -> f32 {
    let reach = TENT * at.footprint.dx.abs().max(at.footprint.dy.abs());
    (0.5 - 0.5 * square_wave(at.st.x, reach.x) * square_wave(at.st.y, reach.y)).clamp(0.0, 1.0)
}

/// As [`checks2`], with unit cubes.
pub fn checks3(at: &Point3) -> f32 {
    let reach = TENT * at.dpdx.abs().max(at.dpdy.abs());
    let wave = |axis: usize| square_wave(at.p[axis], reach[axis]);
    (0.5 - 0.5 * wave(0) * wave(1) * wave(2)).clamp(0.0, 1.0)
}

/// The square wave that is 1 in [0, 1) and −1 in [1, 2), convolved with a tent of half width `reach`.
fn square_wave(x: f32, reach: f32) -> f32 {
    // Beyond this a pixel covers so many checks that their mean is 0 to the last digit shown, or is no number.
    const UNIFORM: f32 = 1.0e4;
    if !x.is_finite() || reach >= UNIFORM || reach.is_nan() {
        return 0.0;
    }
    let (x, reach) = (f64::from(x).rem_euclid(2.0), f64::from(reach));
    if (x - reach).floor() == (x + reach).floor() {
        return if x < 1.0 { 1.0 } else { -1.0 };
    }
    // Twice integrated, the wave is this; its second difference is the convolution.
    let integral = |x: f64| {
        let y = x / 2.0 - (x / 2.0).floor() - 0.5;
        x / 2.0 + y * (1.0 - 2.0 * y.abs())
    };
    ((integral(x + reach) - 2.0 * integral(x) + integral(x - reach)) / (reach * reach)) as f32
}

/// Whether `st` lies in a polka dot. Two in five of the unit cells, chosen by noise, have one, of radius 0.35.
///
/// **Source**: pbrt-v4 `dots`.
pub fn inside_dot(st: Vec2) -> bool {
    const RADIUS: f32 = 0.35;
    let cell = (st + 0.5).floor();
    // pbrt's noise of two arguments takes 0.5 for the third.
    let random = |dx: f32, dy: f32| noise((cell + Vec2::new(dx, dy)).extend(0.5));
    if random(0.5, 0.5) <= 0.0 {
        return false;
    }
    let shift = (0.5 - RADIUS) * Vec2::new(random(1.5, 2.8), random(4.5, 9.8));
    st.distance_squared(cell + shift) < RADIUS * RADIUS
}

/// Height of waves on water: gusts of wind, of low frequency, scale the waves.
///
/// **Source**: pbrt-v4 `windy`.
pub fn windy(at: &Point3) -> f32 {
    const GUSTS: f32 = 0.1;
    let wind = fbm(&scaled(at, GUSTS), 0.5, 3);
    wind.abs() * fbm(at, 0.5, 6)
}

/// Albedo of marble: veins are layers along y, displaced by noise.
///
/// **Source**: pbrt-v4 `marble`.
pub fn marble(at: &Point3, octaves: u32, omega: f32, scale: f32, variation: f32) -> Rgb {
    let at = scaled(at, scale);
    let phase = at.p.y + variation * fbm(&at, omega, octaves);
    let t = (0.5 + 0.5 * phase.sin()) * (VEINS.len() - 3) as f32;
    let first = (t as usize).min(VEINS.len() - 4);
    1.5 * cubic_bezier(&VEINS[first..first + 4], t - first as f32)
}

/// Control points of the marble's spline: a dark vein in grey.
const VEINS: [Rgb; 9] = {
    const BASE: Rgb = Rgb::new(0.58, 0.58, 0.6);
    let grey = Rgb::new(0.5, 0.5, 0.5);
    let warm = Rgb::new(0.6, 0.59, 0.58);
    let vein = Rgb::new(0.2, 0.2, 0.33);
    [BASE, BASE, BASE, grey, warm, BASE, BASE, vein, BASE]
};

fn cubic_bezier(points: &[Rgb], t: f32) -> Rgb {
    let mix = |a: Rgb, b: Rgb| a + (b - a) * t;
    let [a, b, c] = [mix(points[0], points[1]), mix(points[1], points[2]), mix(points[2], points[3])];
    mix(mix(a, b), mix(b, c))
}

fn scaled(at: &Point3, by: f32) -> Point3 {
    let Point3 { p, dpdx, dpdy } = *at;
    let times = |v: Vec3| v * by;
    Point3 { p: times(p), dpdx: times(dpdx), dpdy: times(dpdy) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::pyramid::Footprint;

    fn wide(st: Vec2, width: f32) -> Point2 {
        Point2 { st, footprint: Footprint { dx: Vec2::new(width, 0.0), dy: Vec2::new(0.0, width) } }
    }

    #[test]
    fn sharp_checks_alternate() {
        for (x, y, second) in [(0.5, 0.5, 0.0), (1.5, 0.5, 1.0), (1.5, 1.5, 0.0), (-0.5, 0.5, 1.0), (-0.5, -1.5, 1.0)] {
            assert_eq!(checks2(&wide(Vec2::new(x, y), 0.0)), second, "{x} {y}");
        }
        let at = |p| checks3(&Point3 { p, dpdx: Vec3::ZERO, dpdy: Vec3::ZERO });
        assert_eq!((at(Vec3::splat(0.5)), at(Vec3::splat(1.5)), at(Vec3::new(0.5, 1.5, 1.5))), (0.0, 1.0, 0.0));
    }

    #[test]
    fn wide_checks_are_the_convolution_with_a_tent() {
        let n = 4000;
        for (x, reach) in [(0.9_f32, 0.3_f32), (0.25, 0.8), (1.0, 0.01), (3.3, 1.7), (1001.95, 0.2), (-0.1, 0.4)] {
            let mut numeric = 0.0;
            for i in 0..n {
                let u = (f64::from(i) + 0.5) / f64::from(n) * 2.0 - 1.0;
                let wave = if (f64::from(x) + u * f64::from(reach)).rem_euclid(2.0) < 1.0 { 1.0 } else { -1.0 };
                numeric += wave * (1.0 - u.abs()) * 2.0 / f64::from(n);
            }
            // The midpoint rule errs by about one cell at each jump of the wave.
            let error = f64::from(square_wave(x, reach)) - numeric;
            assert!(error.abs() < 4.0 / f64::from(n), "{x} {reach}: {error}");
        }
        // On the border between two checks both show equally.
        assert!((checks2(&wide(Vec2::new(1.0, 0.5), 0.01)) - 0.5).abs() < 1e-6);
        assert_eq!(checks2(&wide(Vec2::new(f32::NAN, 0.5), 0.1)), 0.5);
        assert_eq!(checks2(&wide(Vec2::new(0.3, 0.5), f32::INFINITY)), 0.5);
    }

    #[test]
    fn dots_are_disks_within_their_cells_and_two_in_five_cells_have_one() {
        let (mut dots, cells) = (0, 60);
        for y in 0..cells {
            for x in 0..cells {
                let cell = Vec2::new(x as f32, y as f32);
                // Whatever its shift of at most 0.15, a dot of radius 0.35 covers its cell's centre and not its corners.
                dots += u32::from(inside_dot(cell));
                assert!(!inside_dot(cell + Vec2::new(0.499, 0.499)));
            }
        }
        let share = dots as f32 / (cells * cells) as f32;
        // Noise is symmetric, but at the centres of its cells it is often exactly 0, which means no dot.
        assert!((0.35..0.45).contains(&share), "{share}");
    }

    #[test]
    fn marble_runs_along_its_spline() {
        let at = |y: f32| Point3 { p: Vec3::new(0.0, y, 0.0), dpdx: Vec3::ZERO, dpdy: Vec3::ZERO };
        let half_pi = std::f32::consts::FRAC_PI_2;
        // sin = −1 and 1 are the ends of the spline.
        assert!((marble(&at(-half_pi), 8, 0.5, 1.0, 0.0) - 1.5 * VEINS[0]).length() < 1e-5);
        assert!((marble(&at(half_pi / 2.0), 8, 0.5, 2.0, 0.0) - 1.5 * VEINS[8]).length() < 1e-5);
        // sin = 0 is the middle: t = 3, the start of the fourth piece.
        assert!((marble(&at(0.0), 8, 0.5, 1.0, 0.0) - 1.5 * VEINS[3]).length() < 1e-5);
    }

    #[test]
    fn wind_moves_nothing_where_there_is_none() {
        // At a lattice point of the gusts all octaves of 0.1 p with lacunarity 1.99 start from zero.
        assert_eq!(windy(&Point3 { p: Vec3::ZERO, dpdx: Vec3::ZERO, dpdy: Vec3::ZERO }), 0.0);
        let p = Vec3::new(1.3, 2.7, -0.4);
        let at = Point3 { p, dpdx: Vec3::ZERO, dpdy: Vec3::ZERO };
        let gust = Point3 { p: 0.1 * p, ..at };
        assert!((windy(&at) - fbm(&gust, 0.5, 3).abs() * fbm(&at, 0.5, 6)).abs() < 1e-6);
    }
}
