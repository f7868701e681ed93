//! A film as an EXR file.

use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use oiio::{Attribute, Channel, Compression, FileFormat, Format, Output, Window};

use super::{Film, Image};
use crate::draft::Draft;

/// What keeps an image from being written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// OpenImageIO says why.
    #[error("cannot write {}: {why}", path.display())]
    Image {
        /// The file asked for.
        path: PathBuf,
        /// The reason.
        why: oiio::Error,
    },
    /// The system says why.
    #[error("cannot write {}: {why}", path.display())]
    File {
        /// The file asked for.
        path: PathBuf,
        /// The reason.
        why: io::Error,
    },
}

/// How an image is stored.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Encoding {
    /// Of the whole file.
    pub compression: Compression,
    /// Layers in 16 bits rather than what is usual for them, by the names of outputs; [`RADIANCE`] for the root.
    pub half: Vec<String>,
    /// Layers in 32 bits.
    pub float: Vec<String>,
}

/// What [`Encoding`] calls the channels R, G, B and A.
pub const RADIANCE: &str = "rgba";

impl Encoding {
    fn format(&self, channel: &super::Channel) -> Format {
        let name = channel.name.as_str();
        let within = |layer: &String| match name.strip_prefix(layer.as_str()) {
            Some(rest) => rest.is_empty() || rest.starts_with('.'),
            None => layer == RADIANCE && ["R", "G", "B", "A"].contains(&name),
        };
        match (self.half.iter().any(within), self.float.iter().any(within)) {
            (true, _) => Format::Half,
            (false, true) => Format::Float,
            (false, false) if channel.float => Format::Float,
            (false, false) => Format::Half,
        }
    }

    /// Whether it would damage one of these outputs: ids must keep every bit.
    pub fn damages(&self, aovs: super::AovSet) -> bool {
        self.compression == Compression::Dwaa && aovs.iter().any(super::Aov::is_matte)
    }
}

/// What was lost on the way to the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// Pixels whose value the filter's negative lobes had made negative; written as 0.
    pub clamped_negative: u64,
    /// Values too large for 16 bits; written as the largest that fits.
    pub clamped_half: u64,
}

/// Writes the film's image to `path` as is usual.
///
/// # Errors
/// As [`write_as`].
pub fn write(film: &Film, attributes: Vec<(String, Attribute)>, path: &Path) -> Result<Losses, WriteError> {
    write_as(film, attributes, &Encoding::default(), path)
}

/// Writes the film's image to `path`, with `attributes` as its metadata.
///
/// The file appears under its name only when it is whole. The bytes depend on the film and the attributes alone.
///
/// # Errors
/// The folder is absent or not writable, or the disk is full; then there is no new file, and an old one is untouched.
pub fn write_as(
    film: &Film,
    attributes: Vec<(String, Attribute)>,
    encoding: &Encoding,
    path: &Path,
) -> Result<Losses, WriteError> {
    write_image(&film.image(), attributes, encoding, path)
}

/// Writes an image to `path`, as [`write_as`] does a film's.
///
/// # Errors
/// As [`write_as`].
pub fn write_image(
    image: &Image,
    attributes: Vec<(String, Attribute)>,
    encoding: &Encoding,
    path: &Path,
) -> Result<Losses, WriteError> {
    let (bounds, [width, height]) = (image.bounds, image.resolution);
    let file_error = |why| WriteError::File { path: path.to_owned(), why };
    let draft = Draft::create(path).map_err(file_error)?;
    let output = Output {
        path: draft.path(),
        file_format: FileFormat::Exr,
        data_window: Window {
            x: bounds.min[0] as i32 - image.overscan as i32,
            y: bounds.min[1] as i32 - image.overscan as i32,
            width: bounds.width() as usize,
            height: bounds.height() as usize,
        },
        display_window: Window::at_origin(width as usize, height as usize),
        channels: image
            .channels
            .iter()
            .map(|channel| Channel { name: channel.name.clone(), format: encoding.format(channel) })
            .collect(),
        pixels: &image.values,
        attributes,
        compression: encoding.compression,
    };
    let written = oiio::write(&output).map_err(|why| match refusal(&draft) {
        Some(why) => file_error(why),
        None => WriteError::Image { path: path.to_owned(), why },
    })?;
    draft.publish().map_err(file_error)?;
    Ok(Losses { clamped_negative: image.clamped_negative, clamped_half: written.clamped })
}

/// Why the system takes no more bytes of a file, if it does not. OpenEXR only says that it could not write.
fn refusal(draft: &Draft) -> Option<io::Error> {
    // More than a disk that has refused a block of pixels has left.
    const MORE: usize = 1 << 20;
    let mut file = OpenOptions::new().append(true).open(draft.path()).ok()?;
    file.write_all(&vec![0; MORE]).and_then(|()| file.sync_all()).err()
}

#[cfg(test)]
mod tests {
    use super::super::{Aov, AovSet, Taken};
    use super::*;
    use crate::integrator::FirstHit;
    use crate::math::Rgb;
    use crate::world::Bounds;

    #[test]
    fn a_written_film_reads_back_and_leaves_no_part() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let bounds = Bounds { min: [2, 1], max: [5, 3] };
        let mut film = Film::new([8, 4], bounds, AovSet::from_iter([Aov::SampleCount]), false);
        film.tiles()[0].for_each(|mut pixel| {
            let radiance = Rgb::new(pixel.at[0] as f32, pixel.at[1] as f32, 0.25);
            let first = &FirstHit::NOTHING;
            pixel.add(&Taken { index: 0, radiance, alpha: 1.0, weight: 1.0, prefix: Rgb::ZERO, first, seen: None });
        });
        let attributes = vec![("tessera/seed".to_owned(), Attribute::Text("7".into()))];
        write(&film, attributes.clone(), &path).unwrap();
        let image = oiio::read(&path).unwrap();
        assert_eq!((image.data_window.x, image.data_window.y, image.width, image.height), (2, 1, 3, 2));
        assert_eq!((image.display_window.width, image.display_window.height), (8, 4));
        let red = image.channel("R").unwrap();
        assert_eq!(image.pixels[image.channels.len() + red], 3.0);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        let first = std::fs::read(&path).unwrap();
        write(&film, attributes, &path).unwrap();
        assert!(first == std::fs::read(&path).unwrap(), "the bytes differ from run to run");
    }

    #[test]
    fn layers_are_stored_as_they_are_asked_for() {
        let layers = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        let encoding = Encoding { half: layers(&["N", "light"]), float: layers(&[RADIANCE]), ..Encoding::default() };
        let of = |name: &str, float| encoding.format(&super::super::Channel { name: name.into(), float });
        assert_eq!(["R", "A"].map(|name| of(name, false)), [Format::Float; 2]);
        assert_eq!(["N.X", "light.key.R"].map(|name| of(name, true)), [Format::Half; 2]);
        assert_eq!(["Ng.X", "albedo.R", "denoise.N.X"].map(|name| of(name, true)), [Format::Float; 3]);
    }

    #[test]
    fn an_absent_folder_is_an_error_that_names_the_file() {
        let film = Film::new([1, 1], Bounds::full([1, 1]), AovSet::default(), false);
        let error = write(&film, Vec::new(), Path::new("/nonexistent/folder/a.exr")).unwrap_err().to_string();
        assert!(error.contains("/nonexistent/folder/a.exr"), "{error}");
    }
}
