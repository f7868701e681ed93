//! Gradient noise and its sums over octaves.

use glam::Vec3;

use super::mapping::Point3;

/// The permutation that \[Perlin02\] publishes; noise is a function of it.
#[rustfmt::skip]
const PERMUTATION: [u8; 256] = [
    151, 160, 137, 91, 90, 15, 131, 13, 201, 95, 96, 53, 194, 233, 7, 225, 140, 36, 103, 30, 69, 142, 8, 99, 37, 240,
    21, 10, 23, 190, 6, 148, 247, 120, 234, 75, 0, 26, 197, 62, 94, 252, 219, 203, 117, 35, 11, 32, 57, 177, 33, 88,
    237, 149, 56, 87, 174, 20, 125, 136, 171, 168, 68, 175, 74, 165, 71, 134, 139, 48, 27, 166, 77, 146, 158, 231, 83,
    111, 229, 122, 60, 211, 133, 230, 220, 105, 92, 41, 55, 46, 245, 40, 244, 102, 143, 54, 65, 25, 63, 161, 1, 216,
    80, 73, 209, 76, 132, 187, 208, 89, 18, 169, 200, 196, 135, 130, 116, 188, 159, 86, 164, 100, 109, 198, 173, 186,
    3, 64, 52, 217, 226, 250, 124, 123, 5, 202, 38, 147, 118, 126, 255, 82, 85, 212, 207, 206, 59, 227, 47, 16, 58, 17,
    182, 189, 28, 42, 223, 183, 170, 213, 119, 248, 152, 2, 44, 154, 163, 70, 221, 153, 101, 155, 167, 43, 172, 9, 129,
    22, 39, 253, 19, 98, 108, 110, 79, 113, 224, 232, 178, 185, 112, 104, 218, 246, 97, 228, 251, 34, 242, 193, 238,
    210, 144, 12, 191, 179, 162, 241, 81, 51, 145, 235, 249, 14, 239, 107, 49, 192, 214, 31, 181, 199, 106, 157, 184,
    84, 204, 176, 115, 121, 50, 45, 127, 4, 150, 254, 138, 236, 205, 93, 222, 114, 67, 29, 24, 72, 243, 141, 128, 195,
    78, 66, 215, 61, 156, 180,
];

/// Ratio of the frequencies of successive octaves: just off 2, so that the zeros of octaves do not coincide.
const LACUNARITY: f32 = 1.99;

/// Mean of |noise|, which stands for the octaves that a footprint is too wide to resolve.
const MEAN_ABSOLUTE: f32 = 0.2;

/// Gradient noise in about [-1, 1]: 0 at all points with integer coordinates, twice differentiable. Repeats after 256.
///
/// **Source**: \[Perlin02\], with the assignment of gradients to hashes of \[Pharr23\] section 10.6, so that scenes look as
/// in pbrt.
pub fn noise(p: Vec3) -> f32 {
    // Far away neither cells nor their fractions mean anything any more.
    const FAR: f32 = (1 << 30) as f32;
    let p = Vec3::select(p.abs().cmplt(Vec3::splat(FAR)), p, Vec3::ZERO);
    let floor = p.floor();
    let (cell, d) = (floor.as_ivec3(), p - floor);
    let corner = |x: i32, y: i32, z: i32| {
        gradient_dot(hash(cell.x + x, cell.y + y, cell.z + z), d - Vec3::new(x as f32, y as f32, z as f32))
    };
    let w = d * d * d * (d * (d * 6.0 - 15.0) + 10.0);
    let along_x = |y: i32, z: i32| lerp(w.x, corner(0, y, z), corner(1, y, z));
    let along_y = |z: i32| lerp(w.y, along_x(0, z), along_x(1, z));
    lerp(w.z, along_y(0), along_y(1))
}

fn lerp(t: f32, a: f32, b: f32) -> f32 {
    (1.0 - t) * a + t * b
}

fn hash(x: i32, y: i32, z: i32) -> u8 {
    let permute = |i: i32| i32::from(PERMUTATION[(i & 255) as usize]);
    permute(permute(permute(x & 255) + (y & 255)) + (z & 255)) as u8
}

/// Product of `d` with one of the 12 directions to the edges of a cube (four of them twice).
fn gradient_dot(hash: u8, d: Vec3) -> f32 {
    let h = hash & 15;
    let u = if h < 8 || h == 12 || h == 13 { d.x } else { d.y };
    let v = if h < 4 || h == 12 || h == 13 { d.y } else { d.z };
    (if h & 1 == 0 { u } else { -u }) + (if h & 2 == 0 { v } else { -v })
}

/// How many octaves the footprint resolves: the last one's wavelength is twice the pixel.
fn resolved(at: &Point3, octaves: u32) -> f32 {
    let width2 = at.dpdx.length_squared().max(at.dpdy.length_squared());
    (-1.0 - width2.log2() / 2.0).max(0.0).min(octaves as f32)
}

fn smoothstep(x: f32, low: f32, high: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Fractional Brownian motion: noise summed over octaves whose amplitudes fall by `omega`, without those that the
/// footprint cannot resolve.
///
/// **Source**: \[Pharr23\] section 10.6.
pub fn fbm(at: &Point3, omega: f32, octaves: u32) -> f32 {
    let count = resolved(at, octaves);
    let (mut sum, mut frequency, mut amplitude) = (0.0, 1.0, 1.0);
    for _ in 0..count as u32 {
        sum += amplitude * noise(frequency * at.p);
        frequency *= LACUNARITY;
        amplitude *= omega;
    }
    sum + amplitude * smoothstep(count.fract(), 0.3, 0.7) * noise(frequency * at.p)
}

/// As [`fbm`] of |noise|, with the mean in place of octaves that the footprint cannot resolve.
///
/// **Source**: \[Pharr23\] section 10.6.
pub fn turbulence(at: &Point3, omega: f32, octaves: u32) -> f32 {
    let count = resolved(at, octaves);
    let (mut sum, mut frequency, mut amplitude) = (0.0, 1.0, 1.0);
    for _ in 0..count as u32 {
        sum += amplitude * noise(frequency * at.p).abs();
        frequency *= LACUNARITY;
        amplitude *= omega;
    }
    sum += amplitude * lerp(smoothstep(count.fract(), 0.3, 0.7), MEAN_ABSOLUTE, noise(frequency * at.p).abs());
    for _ in count as u32..octaves {
        sum += amplitude * MEAN_ABSOLUTE;
        amplitude *= omega;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sharp(p: Vec3) -> Point3 {
        Point3 { p, dpdx: Vec3::ZERO, dpdy: Vec3::ZERO }
    }

    #[test]
    fn the_permutation_is_one() {
        let mut sorted = PERMUTATION;
        sorted.sort_unstable();
        assert!(sorted.iter().enumerate().all(|(i, &p)| usize::from(p) == i));
    }

    #[test]
    fn noise_is_zero_at_lattice_points_and_follows_their_gradients() {
        // Entry 0 of the table is 151, entry 151 is 17, entry 17 is 36, and 36 modulo 16 is 4: gradient (1, 0, 1).
        let h = 1e-3;
        for cell in [Vec3::ZERO, Vec3::new(3.0, -7.0, 250.0), Vec3::splat(1000.0)] {
            assert_eq!(noise(cell), 0.0);
        }
        let slope = Vec3::new(noise(Vec3::X * h), noise(Vec3::Y * h), noise(Vec3::Z * h)) / h;
        assert!((slope - Vec3::new(1.0, 0.0, 1.0)).length() < 1e-2, "{slope}");
        assert_eq!(noise(Vec3::new(0.25, 0.7, 0.1)), noise(Vec3::new(256.25, 0.7, 0.1)));
    }

    #[test]
    fn the_mean_of_its_absolute_value_is_what_turbulence_assumes() {
        let n = 40;
        let mut sum = 0.0;
        for i in 0..n * n * n {
            let (x, y, z) = (i % n, i / n % n, i / n / n);
            sum += noise(Vec3::new(x as f32, y as f32, z as f32) * 1.37 + 0.11).abs();
        }
        let mean = sum / (n * n * n) as f32;
        assert!((mean - MEAN_ABSOLUTE).abs() < 0.05, "{mean}");
    }

    #[test]
    fn octaves_add_up_and_fade_with_the_footprint() {
        let p = Vec3::new(0.3, 0.6, 0.9);
        let expected = noise(p) + 0.5 * noise(LACUNARITY * p);
        assert!((fbm(&sharp(p), 0.5, 2) - expected).abs() < 1e-6);
        let expected = noise(p).abs() + 0.5 * noise(LACUNARITY * p).abs() + 0.25 * 0.2;
        assert!((turbulence(&sharp(p), 0.5, 2) - expected).abs() < 1e-6);
        // A pixel as wide as the first octave resolves nothing.
        let blurred = Point3 { p, dpdx: Vec3::X, dpdy: Vec3::Y };
        assert_eq!(fbm(&blurred, 0.5, 8), 0.0);
        let all_means: f32 = (0..8).map(|i| 0.2 * 0.5_f32.powi(i)).sum::<f32>();
        let first_twice = 0.2;
        assert!((turbulence(&blurred, 0.5, 8) - all_means - first_twice).abs() < 1e-6);
    }

    proptest! {
        #[test]
        fn noise_is_bounded_and_finite(x: f32, y in -1e3f32..1e3, z in -1e3f32..1e3) {
            let value = noise(Vec3::new(x, y, z));
            prop_assert!(value.abs() <= 1.1, "{value}");
        }
    }
}
