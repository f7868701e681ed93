//! Environments given by an image.

use std::f64::consts::PI;

use glam::{DMat3, Mat3, Vec2, Vec3};

use super::choose::{Choice, choose};
use super::image::LightImage;
use super::infinite::DirectionSample;
use crate::math::{Rgb, luminance, octahedral};
use crate::sampling::PiecewiseConstant2D;

/// An equal-area octahedral image at infinite distance.
///
/// Texels are kept in tiles. A sample first chooses a tile, from tables small enough to stay in a cache, and then one of
/// the tile's texels by their values, which it needs anyway. Large images are in no cache: what a sample costs is the
/// lines of memory that it touches.
#[derive(Clone, Debug)]
pub struct Environment {
    /// Of determinant ±1, so that the factor between the solid angles of both spaces is |M d|⁻³.
    light_from_world: Mat3,
    world_from_light: Mat3,
    scale: Rgb,
    /// Texels along a side of the image.
    size: usize,
    /// Tiles along a side. Tiles that the image does not fill hold black texels beyond it.
    tiles: usize,
    /// Row by row.
    texels: Box<[Tile]>,
    /// Over tiles; `None`: light samples are not drawn.
    distribution: Option<PiecewiseConstant2D>,
    /// Sum of channels below which a texel is not sampled.
    threshold: f32,
    /// Density on the light's sphere (sr⁻¹) per unit of [`Self::importance`].
    pdf_scale: f32,
    /// No direction of a tile is farther than this from that of its centre.
    tile_radius: f32,
}

/// Texels along a side of a tile.
const TILE: usize = 4;

/// A square of texels, row by row: a cache line of what choosing one needs, and next to it a line of the rest.
#[derive(Clone, Debug, Default)]
#[repr(C, align(128))]
struct Tile {
    /// Of the three channels.
    sums: [[f32; TILE]; TILE],
    /// What of the sum is red, and what green, over [`WHOLE`]: no channel is off by more than 2⁻¹⁶ of the sum.
    shares: [[[u16; 2]; TILE]; TILE],
}

/// All of a sum. Thirds of it are exact, so what is grey stays grey.
const WHOLE: f32 = u16::MAX as f32;

impl Tile {
    fn set(&mut self, x: usize, y: usize, texel: Rgb) {
        let sum = texel.element_sum();
        self.sums[y][x] = sum;
        if sum > 0.0 {
            self.shares[y][x] = [texel.x, texel.y].map(|channel| (channel / sum * WHOLE).round() as u16);
        }
    }

    #[inline]
    fn texel(&self, x: usize, y: usize) -> Rgb {
        let (sum, shares) = (self.sums[y][x], self.shares[y][x].map(|share| f32::from(share) * (1.0 / WHOLE)));
        Rgb::new(shares[0], shares[1], (1.0 - shares[0] - shares[1]).max(0.0)) * sum
    }
}

impl Environment {
    /// The square `image` times `scale`, turned by an invertible `light_from_world`.
    pub fn new(image: &LightImage, scale: Rgb, light_from_world: DMat3) -> Self {
        debug_assert_eq!(image.width(), image.height());
        let size = image.width();
        let tiles = size.div_ceil(TILE);
        let mut texels = vec![Tile::default(); tiles * tiles];
        for (i, &texel) in image.texels().iter().enumerate() {
            let (x, y) = (i % size, i / size);
            texels[y / TILE * tiles + x / TILE].set(x % TILE, y % TILE, texel);
        }
        let normalized = light_from_world * (1.0 / light_from_world.determinant().abs().cbrt());
        let mut environment = Self {
            light_from_world: normalized.as_mat3(),
            world_from_light: normalized.inverse().as_mat3(),
            scale,
            size,
            tiles,
            texels: texels.into(),
            distribution: None,
            threshold: 0.0,
            pdf_scale: 0.0,
            tile_radius: octahedral::STRETCH * (0.5 * TILE as f32 / size as f32) * std::f32::consts::SQRT_2,
        };
        environment.distribute();
        environment
    }

    /// Whether every direction is black.
    pub fn is_black(&self) -> bool {
        self.scale == Rgb::ZERO || self.sums().all(|sum| sum == 0.0)
    }

    /// Whether [`Self::sample`] ever returns a sample.
    pub fn is_sampled(&self) -> bool {
        self.distribution.is_some()
    }

    /// Samples only what exceeds the mean, by how much it does. With BSDF samples beside, which find the rest, the
    /// weighted sum of both stays complete and has less variance.
    ///
    /// **Source**: \[Karlik19\].
    pub fn compensate(&mut self) {
        let sum: f64 = self.sums().map(f64::from).sum();
        self.threshold = (sum / (self.size * self.size) as f64) as f32;
        self.distribute();
    }

    fn distribute(&mut self) {
        let tile_sum =
            |tile: &Tile| -> f64 { tile.sums.as_flattened().iter().map(|&sum| f64::from(self.importance(sum))).sum() };
        let sums: Vec<f64> = self.texels.iter().map(tile_sum).collect();
        let total: f64 = sums.iter().sum();
        let pdf_scale = (self.size * self.size) as f64 / (total * 4.0 * PI);
        // A map so dark that the scale overflows (below 1e-38) is black for sampling.
        let lit = total > 0.0 && (pdf_scale as f32).is_finite();
        self.pdf_scale = if lit { pdf_scale as f32 } else { 0.0 };
        let relative: Vec<f32> = sums.iter().map(|sum| (sum / total) as f32).collect();
        self.distribution = if lit { PiecewiseConstant2D::new(&relative, self.tiles) } else { None };
    }

    /// Sums of channels of all texels, and of those that fill the tiles up.
    fn sums(&self) -> impl Iterator<Item = f32> + '_ {
        self.texels.iter().flat_map(|tile| tile.sums.as_flattened().iter().copied())
    }

    /// What the density of a texel is proportional to, by the sum of its channels.
    #[inline]
    fn importance(&self, sum: f32) -> f32 {
        (sum - self.threshold).max(0.0)
    }

    /// A direction towards the environment, with a density in proportion to the importance of texels. `None` also for
    /// some directions that are not in the hemisphere around `n`: one is often drawn in vain, and this is known before
    /// the texels, which are far away in memory, are looked at.
    #[inline]
    pub fn sample(&self, n: Vec3, u: Vec2) -> Option<DirectionSample> {
        let ([column, row], within) = self.distribution.as_ref()?.sample_cell(u);
        let center = (Vec2::new(column as f32, row as f32) + 0.5) * (TILE as f32 / self.size as f32);
        // n · world_from_light d has the sign of the cosine.
        let n = self.world_from_light.transpose_mul_vec3(n);
        if octahedral::direction_from_square(center.min(Vec2::ONE)).dot(n) < -self.tile_radius * n.length() {
            return None;
        }
        let tile = &self.texels[row * self.tiles + column];

        // The texel in the tile, and the place in the texel.
        let importances: [[f32; TILE]; TILE] =
            std::array::from_fn(|y| std::array::from_fn(|x| self.importance(tile.sums[y][x])));
        let rows: [f32; TILE] = std::array::from_fn(|y| importances[y].iter().sum());
        let Choice { index: y, rest: v, .. } = choose(&rows, within.y)?;
        let Choice { index: x, rest: u, .. } = choose(&importances[y], within.x)?;
        let corner = Vec2::new((column * TILE + x) as f32, (row * TILE + y) as f32);
        // Not so near the next texel that the sum rounds to it.
        let inside = Vec2::new(u, v).min(Vec2::splat(1.0 - self.size as f32 * f32::EPSILON));
        let uv = (corner + inside) / self.size as f32;

        let stretched = self.world_from_light * octahedral::direction_from_square(uv);
        let length = stretched.length();
        let pdf = importances[y][x] * self.pdf_scale * (length * length * length);
        let sample =
            DirectionSample { wi: stretched / length, radiance: self.scale * tile.texel(x, y), pdf, delta: false };
        (pdf > 0.0).then_some(sample)
    }

    /// Radiance from the unit direction `wi`, and the density (sr⁻¹) with which [`Self::sample`] draws it.
    #[inline]
    pub fn radiance_and_pdf(&self, wi: Vec3) -> (Rgb, f32) {
        let stretched = self.light_from_world * wi;
        let length = stretched.length();
        let place = octahedral::square_from_direction(stretched / length) * self.size as f32;
        let (x, y) = ((place.x as usize).min(self.size - 1), (place.y as usize).min(self.size - 1));
        let tile = &self.texels[y / TILE * self.tiles + x / TILE];
        let (x, y) = (x % TILE, y % TILE);
        let pdf = self.importance(tile.sums[y][x]) * self.pdf_scale / (length * length * length);
        (self.scale * tile.texel(x, y), pdf)
    }
}

/// Illuminance (luminance · sr) that `image` gives a surface facing +z of light space, as pbrt computes it.
///
/// pbrt takes the mean over the square times 2π, but only the upper half of the texels contributes, of which each stands
/// for 4π over the number of texels: half the true value. Kept, so that `illuminance` means what it does there.
pub fn pbrt_illuminance(image: &LightImage) -> f64 {
    let (width, height) = (image.width(), image.height());
    let mut sum = 0.0;
    for (i, texel) in image.texels().iter().enumerate() {
        let uv = (Vec2::new((i % width) as f32, (i / width) as f32) + 0.5) / Vec2::new(width as f32, height as f32);
        let cos_theta = octahedral::direction_from_square(uv).z;
        sum += f64::from(luminance(*texel)) * f64::from(cos_theta.max(0.0));
    }
    2.0 * PI * sum / (width * height) as f64
}

#[cfg(test)]
#[path = "environment_tests.rs"]
mod tests;
