//! `tessera preview`: an image for looking at.

use oiio::{Channel, Format};

use crate::args::PreviewArguments;
use crate::exit::Failure;
use crate::job;
use crate::log::Log;
use crate::output::OutputFile;
use crate::picture::Picture;
use crate::tone;

/// What a layer has that is not light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Data {
    /// Components of unit vectors.
    Directions,
    /// Numbers of any size.
    Numbers,
}

impl Data {
    /// Of a layer; `None`: it is light, or not known.
    fn of(layer: &str) -> Option<Self> {
        match layer {
            "N" | "Ng" | "denoise.N" => Some(Self::Directions),
            "depth" | "P" | "sampleCount" | "variance" | "error" | "filter.blend" | "filter.cell" => {
                Some(Self::Numbers)
            }
            _ => None,
        }
    }

    /// What is shown black, and what white: of numbers all that are finite but the thousandths at both ends, which fireflies
    /// may have.
    fn range(self, picture: &Picture) -> [f32; 2] {
        let mut values: Vec<f32> = picture.pixels.iter().flatten().copied().filter(|value| value.is_finite()).collect();
        if self == Self::Directions || values.is_empty() {
            return [-1.0, 1.0];
        }
        values.sort_unstable_by(f32::total_cmp);
        let beyond = values.len() / 1000;
        [values[beyond], values[values.len() - 1 - beyond]]
    }
}

/// Runs the command.
pub fn run(arguments: &PreviewArguments, log: &Log) -> Result<(), Failure> {
    job::require_extension(&arguments.output, "png", "previews are written as PNG")?;
    let output = OutputFile::prepare(&arguments.output)?;
    output.spare([&*arguments.image])?;
    let picture = Picture::read(&arguments.image, arguments.layer.as_deref())?;
    let layer = arguments.layer.as_deref().unwrap_or_default();
    let pixels: Vec<f32> = match Data::of(layer) {
        None => {
            let gain = arguments.exposure.exp2();
            picture.pixels.iter().flatten().map(|value| tone::display(arguments.tone, gain * value)).collect()
        }
        Some(data) => {
            let [low, high] = data.range(&picture);
            log.info(&format!(
                "{layer} is data, no light: shown without exposure and tone from {low} (black) to {high} (white)"
            ));
            // What is beyond all hits is as far as can be; the scale of a single value is of no width.
            let scaled = |value: f32| {
                if value == f32::INFINITY { 1.0 } else { (value - low) / (high - low).max(f32::MIN_POSITIVE) }
            };
            let shown = |value: &f32| if value.is_nan() { 0.0 } else { scaled(*value).clamp(0.0, 1.0) };
            picture.pixels.iter().flatten().map(shown).collect()
        }
    };
    let window = oiio::Window::at_origin(picture.width, picture.height);
    let draft = output.draft()?;
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
    output.publish(draft)?;
    log.info(&format!("wrote {}", arguments.output.display()));
    Ok(())
}
