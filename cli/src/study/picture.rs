//! Pictures for the page.

use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use oiio::{Channel, Format};

use crate::args::Tone;
use crate::exit::Failure;
use crate::output::OutputFile;
use crate::picture::Picture;
use crate::tone;

/// What the typical luminance is shown as, before the tone curve.
const KEY: f64 = 0.18;
/// Darker pixels count as this share of the mean.
const DARK: f64 = 1.0e-3;

/// The gain that shows `reference` well: a few bright pixels must not leave the rest in the dark, so it is by the geometric
/// mean of luminance.
///
/// **Source**: \[Reinhard02\], its key value.
pub fn gain(reference: &Picture) -> f32 {
    let luminance = |[r, g, b]: &[f32; 3]| f64::from(0.2126 * r + 0.7152 * g + 0.0722 * b).max(0.0);
    let count = reference.pixels.len().max(1) as f64;
    let mean = reference.pixels.iter().map(luminance).sum::<f64>() / count;
    if mean <= 0.0 || !mean.is_finite() {
        return 1.0;
    }
    let logs = reference.pixels.iter().map(|pixel| (luminance(pixel) / mean).max(DARK).ln()).sum::<f64>();
    (KEY / (mean * (logs / count).exp())) as f32
}

/// Writes `picture` as a PNG to `path`, and gives it as text for a page.
///
/// # Errors
/// The file cannot be written.
pub fn data_url(picture: &Picture, gain: f32, path: &Path) -> Result<String, Failure> {
    let pixels: Vec<f32> = picture.pixels.iter().flatten().map(|x| tone::display(Tone::Filmic, gain * x)).collect();
    let window = oiio::Window::at_origin(picture.width, picture.height);
    let file = OutputFile::prepare(path)?;
    let draft = file.draft()?;
    let written = oiio::write(&oiio::Output {
        path: draft.path(),
        file_format: oiio::FileFormat::Png,
        data_window: window,
        display_window: window,
        channels: ["R", "G", "B"].map(|name| Channel { name: name.to_owned(), format: Format::U8 }).into(),
        pixels: &pixels,
        attributes: Vec::new(),
        compression: oiio::Compression::default(),
    });
    written.map_err(|error| Failure::Output(error.to_string()))?;
    let bytes = std::fs::read(draft.path());
    file.publish(draft)?;
    let bytes = bytes.map_err(|why| Failure::Output(format!("cannot read \"{}\" again: {why}", path.display())))?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(bytes)))
}

/// Where pictures differ most: corners of `count` crops of `size`, apart from each other, the largest difference first.
/// `difference` is that of a pixel by its column and row.
pub fn crops(
    resolution: [usize; 2],
    size: [usize; 2],
    count: usize,
    difference: impl Fn(usize, usize) -> f64,
) -> Vec<[usize; 2]> {
    let [width, height] = resolution;
    let step = [size[0] / 2, size[1] / 2].map(|step| step.max(1));
    let mut found: Vec<([usize; 2], f64)> = Vec::new();
    for y in (0..=height.saturating_sub(size[1])).step_by(step[1]) {
        for x in (0..=width.saturating_sub(size[0])).step_by(step[0]) {
            let rows = y..height.min(y + size[1]);
            let pixels = rows.flat_map(|y| (x..width.min(x + size[0])).map(move |x| (x, y)));
            found.push(([x, y], pixels.map(|(x, y)| difference(x, y)).sum()));
        }
    }
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut chosen: Vec<[usize; 2]> = Vec::new();
    for (at, _) in found {
        let apart = |other: &[usize; 2]| (0..2).any(|k| at[k].abs_diff(other[k]) >= size[k]);
        if chosen.len() < count && chosen.iter().all(apart) {
            chosen.push(at);
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crops_are_where_the_difference_is_and_apart() {
        let found = crops([64, 48], [16, 16], 2, |x, y| if x >= 48 && y < 16 { 1.0 } else { 0.0 });
        assert_eq!(found[0], [48, 0]);
        assert!(found[1][0].abs_diff(48) >= 16 || found[1][1] >= 16, "{found:?}");
        assert_eq!(crops([8, 8], [16, 16], 3, |_, _| 0.0), [[0, 0]]);
    }
}
