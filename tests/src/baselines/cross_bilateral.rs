//! Filtering in screen space, guided by what is seen there: a cross-bilateral filter.
//!
//! **Source**: \[Eisemann04\], with the guides that renderers have.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// What is seen first in each pixel, row by row as the image is.
#[derive(Clone, Copy, Debug)]
pub struct Guides<'a> {
    /// Normals; zero where nothing is seen.
    pub normal: &'a [[f32; 3]],
    /// Albedos.
    pub albedo: &'a [[f32; 3]],
    /// Distances; infinite where nothing is seen.
    pub depth: &'a [f32],
}

/// How far pixels reach. A pixel counts by the product of Gaussians of its differences.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrossBilateral {
    /// Standard deviation in pixels. Three of them are looked at.
    pub space: f32,
    /// Of the distance between normals.
    pub normal: f32,
    /// Of the distance between albedos.
    pub albedo: f32,
    /// Of the difference of depths over the pixel's own depth.
    pub depth: f32,
}

impl Default for CrossBilateral {
    /// In space the variance of the talk's kernel for cells of 8 pixels, h²/3; the others usual.
    fn default() -> Self {
        Self { space: 8.0 / 3f32.sqrt(), normal: 0.2, albedo: 0.05, depth: 0.05 }
    }
}

impl CrossBilateral {
    /// The image, filtered. Pixels that are not finite stay as they are and are not looked at.
    ///
    /// # Panics
    /// If image and guides differ in size.
    pub fn filter(&self, image: &[[f32; 3]], width: usize, guides: &Guides) -> Vec<[f32; 3]> {
        let sizes = [guides.normal.len(), guides.albedo.len(), guides.depth.len()];
        assert!(sizes.iter().all(|&size| size == image.len()), "image and guides differ in size");
        let rows = image.len() / width;
        let reach = (3.0 * self.space).ceil() as usize;
        (0..image.len())
            .into_par_iter()
            .map(|own| {
                let (x, y) = (own % width, own / width);
                let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
                for row in y.saturating_sub(reach)..(y + reach + 1).min(rows) {
                    for column in x.saturating_sub(reach)..(x + reach + 1).min(width) {
                        let other = row * width + column;
                        let radiance = Vec3::from_array(image[other]);
                        let squared = (column.abs_diff(x).pow(2) + row.abs_diff(y).pow(2)) as f32;
                        let weight = self.weight(own, other, squared, guides);
                        if weight > 0.0 && radiance.is_finite() {
                            sum += weight * radiance.as_dvec3();
                            weights += weight;
                        }
                    }
                }
                let finite = Vec3::from_array(image[own]).is_finite();
                if finite { (sum / weights).as_vec3().to_array() } else { image[own] }
            })
            .collect()
    }

    /// What pixel `other` counts for pixel `own`; 1 for itself.
    fn weight(&self, own: usize, other: usize, squared_distance: f32, guides: &Guides) -> f64 {
        let squared =
            |guide: &[[f32; 3]]| Vec3::from_array(guide[own]).distance_squared(Vec3::from_array(guide[other]));
        let (near, far) = (guides.depth[own], guides.depth[other]);
        // Equal depths differ by nothing, infinite ones too.
        let depth = if near == far { 0.0 } else { (far - near) / near };
        let exponent = squared_distance / self.space.powi(2)
            + squared(guides.normal) / self.normal.powi(2)
            + squared(guides.albedo) / self.albedo.powi(2)
            + (depth / self.depth).powi(2);
        // NaN guides make a weight of NaN, which counts as none, and as 1 for the pixel itself.
        if own == other { 1.0 } else { f64::from(-0.5 * exponent).exp() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 64;
    const FILTER: CrossBilateral = CrossBilateral { space: 3.0, normal: 0.2, albedo: 0.05, depth: 0.05 };

    struct Flat {
        normal: Vec<[f32; 3]>,
        albedo: Vec<[f32; 3]>,
        depth: Vec<f32>,
    }

    /// A wall.
    fn flat() -> Flat {
        let pixels = SIDE * SIDE;
        Flat { normal: vec![[0.0, 0.0, 1.0]; pixels], albedo: vec![[0.5; 3]; pixels], depth: vec![4.0; pixels] }
    }

    impl Flat {
        fn filter(&self, image: &[[f32; 3]]) -> Vec<[f32; 3]> {
            FILTER.filter(image, SIDE, &Guides { normal: &self.normal, albedo: &self.albedo, depth: &self.depth })
        }
    }

    #[test]
    fn on_a_wall_the_kernel_is_a_gaussian() {
        let mut image = vec![[0.0; 3]; SIDE * SIDE];
        let centre = SIDE * SIDE / 2 + SIDE / 2;
        image[centre] = [1000.0; 3];
        let filtered = flat().filter(&image);
        let at = |dx: usize, dy: usize| filtered[centre + dx + dy * SIDE][0];
        for (dx, dy) in [(1, 0), (0, 2), (3, 4), (6, 0)] {
            let expected = (-((dx * dx + dy * dy) as f32) / 18.0).exp();
            assert!((at(dx, dy) / at(0, 0) - expected).abs() < 1e-4);
        }
        let sum: f32 = filtered.iter().map(|pixel| pixel[0]).sum();
        assert!((sum / 1000.0 - 1.0).abs() < 1e-4, "{sum}");
    }

    #[test]
    fn an_edge_in_any_guide_is_kept() {
        let left = |i: usize| i % SIDE < SIDE / 2;
        let image: Vec<[f32; 3]> = (0..SIDE * SIDE).map(|i| if left(i) { [1.0; 3] } else { [9.0; 3] }).collect();
        let error = |flat: &Flat| {
            let filtered = flat.filter(&image);
            filtered.iter().zip(&image).map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, f32::max)
        };
        assert!(error(&flat()) > 1.0, "without an edge in the guides there is none in the image");
        let mut guides = [flat(), flat(), flat()];
        for i in (0..SIDE * SIDE).filter(|&i| left(i)) {
            guides[0].normal[i] = [1.0, 0.0, 0.0];
            guides[1].albedo[i] = [0.9; 3];
            guides[2].depth[i] = 8.0;
        }
        for guides in &guides {
            assert!(error(guides) < 1e-3);
        }
    }

    #[test]
    fn nothing_seen_and_nothing_finite_do_no_harm() {
        let mut flat = flat();
        flat.depth[..SIDE * SIDE / 2].fill(f32::INFINITY);
        let mut image = vec![[2.0; 3]; SIDE * SIDE];
        image[100] = [f32::NAN; 3];
        flat.normal[200] = [f32::NAN; 3];
        let filtered = flat.filter(&image);
        assert!(filtered[100][0].is_nan());
        assert!(filtered.iter().enumerate().all(|(i, pixel)| i == 100 || (pixel[0] - 2.0).abs() < 1e-5));
    }
}
