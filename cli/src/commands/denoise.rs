//! `tessera denoise`: an image through Intel Open Image Denoise, into another file.

use std::path::{Path, PathBuf};

use oiio::{Attribute, Channel, Format, Image};

use crate::args::DenoiseArguments;
use crate::exit::Failure;
use crate::job;
use crate::log::Log;
use crate::oidn::{Oidn, Pictures};
use crate::output::OutputFile;

/// Layers that tell the denoiser of the surfaces, the best first: albedo and normals.
const GUIDES: [[[&str; 3]; 2]; 2] = [
    [["denoise.albedo.R", "denoise.albedo.G", "denoise.albedo.B"], ["denoise.N.X", "denoise.N.Y", "denoise.N.Z"]],
    [["albedo.R", "albedo.G", "albedo.B"], ["N.X", "N.Y", "N.Z"]],
];

/// Runs the command.
pub fn run(arguments: &DenoiseArguments, log: &Log) -> Result<(), Failure> {
    job::require_extension(&arguments.output, "exr", "denoised images are written as OpenEXR")?;
    if same_file(&arguments.image, &arguments.output) {
        let text =
            "the denoised image would take the place of the noisy one, which cannot be had back: name another output";
        return Err(Failure::Usage(text.into()));
    }
    let output = OutputFile::prepare(&arguments.output)?;
    let oidn = Oidn::find(arguments.oidn.as_deref())?;
    let image = oiio::read(&arguments.image).map_err(|error| Failure::Input(error.to_string()))?;
    let color = layer(&image, &["R", "G", "B"]).ok_or_else(|| {
        Failure::Input(format!("{} has no channels R, G and B to denoise", arguments.image.display()))
    })?;
    let guides =
        GUIDES.iter().find_map(|[albedo, normal]| Some((layer(&image, albedo)?, layer(&image, normal)?, albedo[0])));
    match &guides {
        Some((.., name)) => log.verbose(&format!("guided by {} and its normals", name.trim_end_matches(".R"))),
        None => log.warning(
            "the image has no albedo and normals, without which details are lost: render it with --aov \
             denoise.albedo,denoise.N",
        ),
    }
    let guides = guides.map(|(albedo, normal, _)| [albedo, normal]);
    let denoised = oidn.denoise(&Pictures { width: image.width, height: image.height, color, guides })?;
    let draft = output.draft()?;
    write(&image, &denoised, &oidn, draft.path())?;
    output.publish(draft)?;
    log.info(&format!("wrote {}", arguments.output.display()));
    Ok(())
}

/// Whether two paths lead to one file.
fn same_file(a: &Path, b: &Path) -> bool {
    let real = |path: &Path| std::fs::canonicalize(path).unwrap_or_else(|_| PathBuf::from(path));
    real(a) == real(b)
}

/// Three channels, pixel by pixel; `None` if the image lacks one.
fn layer(image: &Image, names: &[&str; 3]) -> Option<Vec<[f32; 3]>> {
    let [a, b, c] = names.map(|name| image.channels.iter().position(|channel| channel == name));
    let places = [a?, b?, c?];
    Some(image.pixels.chunks_exact(image.channels.len()).map(|pixel| places.map(|place| pixel[place])).collect())
}

/// Writes the denoised colour with the image's own coverage, windows and metadata. Other layers stay in the noisy file.
fn write(image: &Image, denoised: &[[f32; 3]], oidn: &Oidn, path: &Path) -> Result<(), Failure> {
    let alpha = image.channels.iter().position(|channel| channel == "A");
    let names: &[&str] = if alpha.is_some() { &["R", "G", "B", "A"] } else { &["R", "G", "B"] };
    let mut pixels = Vec::with_capacity(denoised.len() * names.len());
    for (rgb, pixel) in denoised.iter().zip(image.pixels.chunks_exact(image.channels.len())) {
        pixels.extend(rgb);
        pixels.extend(alpha.map(|place| pixel[place]));
    }
    let of_layers = |name: &str| name.starts_with("cryptomatte/") || name == "compression";
    let mut attributes: Vec<_> = image.attributes.iter().filter(|(name, _)| !of_layers(name)).cloned().collect();
    attributes.push(("tessera/denoiser".into(), Attribute::Text(oidn.name().into())));
    let written = oiio::write(&oiio::Output {
        path,
        file_format: oiio::FileFormat::Exr,
        data_window: image.data_window,
        display_window: image.display_window,
        channels: names.iter().map(|name| Channel { name: (*name).into(), format: Format::Half }).collect(),
        pixels: &pixels,
        attributes,
        compression: oiio::Compression::default(),
    });
    written.map(drop).map_err(|error| Failure::Output(error.to_string()))
}
