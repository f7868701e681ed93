//! Images as the tests see them: read back by a reader that is not ours, and compared.

use std::path::Path;

/// RGB pixels, row by row from the top.
#[derive(Clone, Debug)]
pub struct RgbImage {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Linear RGB.
    pub pixels: Vec<[f32; 3]>,
}

/// Reads the `R G B` channels of an EXR with the crate `exr`.
///
/// # Panics
/// If the file is not such an image: the test fails with the reader's message.
pub fn read_exr(path: &Path) -> RgbImage {
    let image = exr::prelude::read_first_rgba_layer_from_file(
        path,
        |size, _| RgbImage { width: size.x(), height: size.y(), pixels: vec![[0.0; 3]; size.area()] },
        |image, at, (r, g, b, _): (f32, f32, f32, f32)| image.pixels[at.y() * image.width + at.x()] = [r, g, b],
    );
    image.unwrap_or_else(|why| panic!("{}: {why}", path.display())).layer_data.channel_data.pixels
}

impl RgbImage {
    /// Mean of each channel.
    pub fn mean(&self) -> [f64; 3] {
        mean(self.pixels.iter())
    }

    /// The image at `width` columns, each pixel the mean of a square of pixels.
    ///
    /// # Panics
    /// If the size is not a whole multiple of the new one.
    pub fn reduced(&self, width: usize) -> Self {
        let factor = self.width / width;
        assert!(factor > 0 && factor * width == self.width && self.height % factor == 0, "no whole multiple");
        let pixels = self.block_means(factor).into_iter().map(|mean| mean.map(|channel| channel as f32)).collect();
        Self { width, height: self.height / factor, pixels }
    }

    /// Means of all whole and partial square blocks, row by row.
    pub fn block_means(&self, side: usize) -> Vec<[f64; 3]> {
        let mut means = Vec::new();
        for y in (0..self.height).step_by(side) {
            for x in (0..self.width).step_by(side) {
                let rows = y..(y + side).min(self.height);
                let columns = x..(x + side).min(self.width);
                means.push(mean(rows.flat_map(|row| &self.pixels[row * self.width..][columns.clone()])));
            }
        }
        means
    }
}

fn mean<'a>(pixels: impl Iterator<Item = &'a [f32; 3]>) -> [f64; 3] {
    let (mut sum, mut count) = ([0.0f64; 3], 0usize);
    for pixel in pixels {
        count += 1;
        for c in 0..3 {
            sum[c] += f64::from(pixel[c]);
        }
    }
    sum.map(|channel| channel / count.max(1) as f64)
}

/// Both images without the pixels that are among the brightest `share` of either: those become black in both.
///
/// # Panics
/// If the sizes differ.
pub fn without_brightest(a: &RgbImage, b: &RgbImage, share: f64) -> (RgbImage, RgbImage) {
    assert_eq!((a.width, a.height), (b.width, b.height), "the images differ in size");
    let brightness = |pixel: &[f32; 3]| pixel.iter().copied().fold(0.0, f32::max);
    let limit = |image: &RgbImage| {
        let mut sorted: Vec<f32> = image.pixels.iter().map(brightness).collect();
        sorted.sort_by(f32::total_cmp);
        sorted[((1.0 - share) * (sorted.len() - 1) as f64) as usize]
    };
    let (limit_a, limit_b) = (limit(a), limit(b));
    let (mut a, mut b) = (a.clone(), b.clone());
    for (a, b) in a.pixels.iter_mut().zip(&mut b.pixels) {
        if brightness(a) > limit_a || brightness(b) > limit_b {
            (*a, *b) = ([0.0; 3], [0.0; 3]);
        }
    }
    (a, b)
}

/// How an image agrees with a reference.
#[derive(Clone, Debug)]
pub struct Agreement {
    /// Ratio of the means, image over reference, per channel.
    pub mean_ratio: [f64; 3],
    /// Median over blocks of 32×32 pixels of the relative difference of their means, averaged over channels.
    pub median_block_difference: f64,
}

/// Compares two images of equal size.
///
/// # Panics
/// If the sizes differ.
pub fn agreement(image: &RgbImage, reference: &RgbImage) -> Agreement {
    assert_eq!((image.width, image.height), (reference.width, reference.height), "the images differ in size");
    let (a, b) = (image.mean(), reference.mean());
    let mut differences: Vec<f64> = image
        .block_means(32)
        .iter()
        .zip(reference.block_means(32))
        .map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).abs() / b[c].abs().max(1e-6)).sum::<f64>() / 3.0)
        .collect();
    differences.sort_by(f64::total_cmp);
    Agreement {
        mean_ratio: [0, 1, 2].map(|c| a[c] / b[c]),
        median_block_difference: differences[differences.len() / 2],
    }
}
