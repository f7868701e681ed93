//! Images that lights show.

use glam::{DVec3, Vec2};

use crate::math::Rgb;
use crate::texture::RgbImage;

/// An image of non-negative, finite linear RGB: row 0 is the top, texel centres are at half integers.
#[derive(Clone, Debug, PartialEq)]
pub struct LightImage {
    width: usize,
    height: usize,
    texels: Box<[Rgb]>,
}

/// A texel above this counts as infinite: sums of its channels must stay finite.
const LARGEST: f32 = f32::MAX / 8.0;

impl LightImage {
    /// Takes over `image` and returns also how many of its values are negative, infinite or not a number. Those count as
    /// 0. `None`: there is no texel.
    pub fn new(image: RgbImage) -> Option<(Self, usize)> {
        let RgbImage { width, height, mut pixels } = image;
        if width == 0 || height == 0 || pixels.len() != width * height {
            return None;
        }
        let mut unusable = 0;
        for texel in &mut pixels {
            let clean = Rgb::from_array(texel.to_array().map(|v| if (0.0..=LARGEST).contains(&v) { v } else { 0.0 }));
            unusable += clean.cmpne(*texel).bitmask().count_ones() as usize;
            *texel = clean;
        }
        Some((Self { width, height, texels: pixels.into() }, unusable))
    }

    /// One texel of 1.
    pub fn white() -> Self {
        Self { width: 1, height: 1, texels: Box::new([Rgb::ONE]) }
    }

    /// Width.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All texels, row by row.
    pub fn texels(&self) -> &[Rgb] {
        &self.texels
    }

    /// The texel that contains `uv`; the nearest one outside [0, 1]².
    #[inline]
    pub fn nearest(&self, uv: Vec2) -> Rgb {
        // Conversion saturates: what is below 0 or not a number is texel 0.
        let x = ((uv.x * self.width as f32) as usize).min(self.width - 1);
        let y = ((uv.y * self.height as f32) as usize).min(self.height - 1);
        self.texels[y * self.width + x]
    }

    /// Bilinear interpolation at `uv`; edge texels go on outside [0, 1]².
    #[inline]
    pub fn bilinear(&self, uv: Vec2) -> Rgb {
        let inside = |v: f32, size: usize| if v > 0.0 { v.min(1.0) * size as f32 - 0.5 } else { -0.5 };
        let (x, y) = (inside(uv.x, self.width), inside(uv.y, self.height));
        let (x0, y0) = (x.floor(), y.floor());
        let texel = |dx: f32, dy: f32| {
            let column = ((x0 + dx) as usize).min(self.width - 1);
            let row = ((y0 + dy) as usize).min(self.height - 1);
            self.texels[row * self.width + column]
        };
        let top = texel(0.0, 0.0).lerp(texel(1.0, 0.0), x - x0);
        let bottom = texel(0.0, 1.0).lerp(texel(1.0, 1.0), x - x0);
        top.lerp(bottom, y - y0)
    }

    /// Mean of all texels.
    pub fn mean(&self) -> DVec3 {
        self.texels.iter().map(|t| t.as_dvec3()).sum::<DVec3>() / self.texels.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: usize, pixels: &[f32]) -> LightImage {
        let pixels: Vec<Rgb> = pixels.iter().map(|&v| Rgb::splat(v)).collect();
        LightImage::new(RgbImage { width, height: pixels.len() / width, pixels }).unwrap().0
    }

    #[test]
    fn unusable_texels_are_zeroed_and_counted() {
        let pixels = vec![Rgb::new(1.0, f32::NAN, 2.0), Rgb::splat(-1.0), Rgb::splat(f32::INFINITY), Rgb::ONE];
        let (image, unusable) = LightImage::new(RgbImage { width: 2, height: 2, pixels }).unwrap();
        assert_eq!(unusable, 7);
        assert_eq!(image.texels(), [Rgb::new(1.0, 0.0, 2.0), Rgb::ZERO, Rgb::ZERO, Rgb::ONE]);
        assert_eq!(image.mean(), DVec3::new(0.5, 0.25, 0.75));
        assert!(LightImage::new(RgbImage { width: 0, height: 3, pixels: vec![] }).is_none());
    }

    #[test]
    fn lookups_hit_texel_centres_and_clamp_at_the_edges() {
        let image = image(2, &[1.0, 2.0, 3.0, 4.0]);
        for (u, v, nearest, bilinear) in [
            (0.25, 0.25, 1.0, 1.0),
            (0.75, 0.25, 2.0, 2.0),
            (0.5, 0.5, 4.0, 2.5),
            (0.5, 0.25, 2.0, 1.5),
            (0.0, 1.0, 3.0, 3.0),
            (7.0, -7.0, 2.0, 2.0),
            (f32::NAN, f32::INFINITY, 3.0, 3.0),
        ] {
            let uv = Vec2::new(u, v);
            assert_eq!((image.nearest(uv).x, image.bilinear(uv).x), (nearest, bilinear), "{uv}");
        }
    }
}
