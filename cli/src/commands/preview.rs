//! `tessera preview`: an image for looking at.

use oiio::{Channel, Format};

use crate::args::PreviewArguments;
use crate::exit::Failure;
use crate::job;
use crate::log::Log;
use crate::output::OutputFile;
use crate::picture::Picture;
use crate::tone;

/// Runs the command.
pub fn run(arguments: &PreviewArguments, log: &Log) -> Result<(), Failure> {
    job::require_extension(&arguments.output, "png", "previews are written as PNG")?;
    let output = OutputFile::prepare(&arguments.output)?;
    let picture = Picture::read(&arguments.image, arguments.layer.as_deref())?;
    let gain = arguments.exposure.exp2();
    let shown = |value: &f32| tone::display(arguments.tone, gain * value);
    let pixels: Vec<f32> = picture.pixels.iter().flatten().map(shown).collect();
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
