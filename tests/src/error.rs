//! How far an image is from two independent references.

use crate::image::RgbImage;

/// Errors against the product of the differences from two references, so that their noise cancels in the mean.
#[derive(Clone, Debug)]
pub struct Errors {
    /// Per pixel, mean over channels of (I − A)(I − B) / (R² + 0.01 m²), R the references' mean and m its mean over the
    /// image.
    pub pixels: Vec<f64>,
    width: usize,
}

impl Errors {
    /// Of `image` against references `a` and `b`, all of one size.
    pub fn new(image: &[[f32; 3]], a: &RgbImage, b: &RgbImage) -> Self {
        let mean: [f64; 3] = std::array::from_fn(|c| 0.5 * (a.mean()[c] + b.mean()[c]));
        Self::weighted(image, a, b, |i, c| {
            let r = 0.5 * (f64::from(a.pixels[i][c]) + f64::from(b.pixels[i][c]));
            (r * r + 0.01 * mean[c] * mean[c]).recip()
        })
    }

    /// The same with what multiplies the product of the differences in channel `c` of pixel `i` given.
    pub fn weighted(image: &[[f32; 3]], a: &RgbImage, b: &RgbImage, weight: impl Fn(usize, usize) -> f64) -> Self {
        let channel = |i: usize, c: usize| {
            let [value, a, b] = [image[i][c], a.pixels[i][c], b.pixels[i][c]].map(f64::from);
            (value - a) * (value - b) * weight(i, c)
        };
        let pixels = (0..image.len()).map(|i| (channel(i, 0) + channel(i, 1) + channel(i, 2)) / 3.0);
        Self { pixels: pixels.collect(), width: a.width }
    }

    /// relMSE over the best `share` of the pixels.
    pub fn relmse(&self, share: f64) -> f64 {
        let mut sorted = self.pixels.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        let kept = ((sorted.len() as f64 * share).round() as usize).clamp(1, sorted.len());
        sorted[..kept].iter().sum::<f64>() / kept as f64
    }

    /// relMSE of square blocks, row by row.
    pub fn blocks(&self, side: usize) -> Vec<f64> {
        let height = self.pixels.len() / self.width;
        let mut blocks = Vec::new();
        for y in (0..height).step_by(side) {
            for x in (0..self.width).step_by(side) {
                let rows = y..(y + side).min(height);
                let columns = x..(x + side).min(self.width);
                let area = (rows.len() * columns.len()) as f64;
                let sum: f64 =
                    rows.map(|y| columns.clone().map(|x| self.pixels[y * self.width + x]).sum::<f64>()).sum();
                blocks.push(sum / area);
            }
        }
        blocks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(value: f32) -> RgbImage {
        RgbImage { width: 4, height: 2, pixels: vec![[value; 3]; 8] }
    }

    #[test]
    fn noise_of_the_references_cancels() {
        // References one above and one below: the image between them is right.
        let errors = Errors::new(&image(1.0).pixels, &image(1.0), &image(1.0));
        assert_eq!(errors.relmse(1.0), 0.0);
        let errors = Errors::new(&image(1.5).pixels, &image(1.0), &image(1.0));
        assert!((errors.relmse(1.0) - 0.25 / 1.01).abs() < 1e-9);
        assert_eq!(errors.blocks(2).len(), 2);
    }

    #[test]
    fn the_worst_pixels_can_be_left_out() {
        let mut pixels = image(1.0).pixels;
        pixels[3] = [100.0; 3];
        let errors = Errors::new(&pixels, &image(1.0), &image(1.0));
        assert!(errors.relmse(1.0) > 100.0);
        assert_eq!(errors.relmse(0.875), 0.0);
    }
}
