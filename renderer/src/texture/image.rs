//! Image files as linear values.

use std::path::Path;

use glam::{DVec3, Mat3, Vec3};

use super::encoding::{f32_to_half, half_to_f32};
use crate::math::Rgb;
use crate::scene::description::Encoding;
use crate::spectrum::RgbSpace;

/// An image in linear RGB.
#[derive(Clone, Debug, PartialEq)]
pub struct RgbImage {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// By rows from the top. Finite.
    pub pixels: Vec<Rgb>,
}

/// What of a file was not as it should be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flaws {
    /// How many values were not finite and became 0.
    pub replaced: usize,
    /// It names an RGB space that is not known, and was read as if it named none.
    pub unknown_space: bool,
}

/// What to say of a file whose RGB space is not known.
pub const UNKNOWN_SPACE: &str = "has chromaticities of no RGB space that is known, and is read as Rec.709";

/// Loads an image for a light: integers are sRGB, floats linear RGB of the space that the file names, Rec.709 if none; grey
/// images have equal channels.
///
/// # Errors
/// The file cannot be read, or has no R, G and B among several channels; the message names the file.
pub fn load_rgb(path: &Path) -> Result<(RgbImage, Flaws), String> {
    let texels = load_texels(path, Channels::Rgb, None)?;
    let rec709 = texels.space.rec709_from_light();
    let rgb = |i: usize| match texels.channels {
        1 => Rgb::splat(texels.value(i)),
        _ => Rgb::from_array(std::array::from_fn(|c| texels.value(3 * i + c))),
    };
    let pixels = (0..texels.width * texels.height).map(|i| rec709 * rgb(i)).collect();
    Ok((RgbImage { width: texels.width, height: texels.height, pixels }, texels.flaws))
}

/// Which channels of a file are meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Channels {
    /// R, G and B, or the only one, as they are.
    Rgb,
    /// The same as reflectances in Rec.709.
    Reflectance,
    /// For a number: the alpha channel if it says anything, else as `Rgb`, whose mean is taken.
    Number,
}

/// Texels in the format of their file.
#[derive(Clone, Debug)]
pub enum TexelData {
    /// Encoded bytes.
    U8(Vec<u8>),
    /// Linear 16-bit floats, by their bits. Finite.
    Half(Vec<u16>),
    /// Linear floats. Finite.
    Float(Vec<f32>),
}

/// A loaded image with one channel or three.
#[derive(Clone, Debug)]
pub struct Texels {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// 1 or 3.
    pub channels: usize,
    /// Row from the top, column, channel.
    pub data: TexelData,
    /// Of the bytes.
    pub encoding: Encoding,
    /// It is the file's alpha channel.
    pub alpha: bool,
    /// That of the values.
    pub space: RgbSpace,
    /// What was mended.
    pub flaws: Flaws,
}

impl TexelData {
    /// Multiplies texels of three channels by a matrix. Bytes stay as they are.
    fn multiply(&mut self, matrix: Mat3) {
        fn each<T: Copy>(items: &mut [T], change: impl Fn([T; 3]) -> [T; 3]) {
            items.chunks_exact_mut(3).for_each(|rgb| rgb.copy_from_slice(&change([rgb[0], rgb[1], rgb[2]])));
        }
        // Terms may overflow, and their sum must not be NaN.
        let matrix = matrix.as_dmat3();
        let product = |rgb: [f32; 3]| {
            let exact = matrix * Vec3::from_array(rgb).as_dvec3();
            exact.clamp(DVec3::splat(f32::MIN.into()), DVec3::splat(f32::MAX.into())).as_vec3().to_array()
        };
        match self {
            Self::U8(_) => {}
            Self::Half(halves) => each(halves, |rgb| product(rgb.map(half_to_f32)).map(f32_to_half)),
            Self::Float(floats) => each(floats, product),
        }
    }
}

impl Texels {
    /// Linear value of item `index` of the data.
    pub fn value(&self, index: usize) -> f32 {
        match &self.data {
            TexelData::U8(bytes) => self.encoding.decode(f32::from(bytes[index]) / 255.0),
            TexelData::Half(halves) => half_to_f32(halves[index]),
            TexelData::Float(floats) => floats[index],
        }
    }
}

/// Loads an image in the format of its file.
///
/// `encoding` is that of integers; without it they are sRGB, an alpha channel linear. Floats are always linear, in the space
/// whose `chromaticities` their file has.
///
/// # Errors
/// As [`load_rgb`].
pub fn load_texels(path: &Path, channels: Channels, encoding: Option<Encoding>) -> Result<Texels, String> {
    let mut reader = oiio::Reader::open(path).map_err(|e| e.to_string())?;
    let names = reader.channels();
    let Selection { rgb, alpha } = select(&names)
        .ok_or_else(|| format!("\"{}\" has no R, G and B channels, but {}", path.display(), names.join(", ")))?;
    let stored = Stored::read(&mut reader).map_err(|e| e.to_string())?;
    let masked = alpha.filter(|&a| channels == Channels::Number && !stored.is_opaque(names.len(), a));
    let chosen = masked.map_or(rgb, |a| vec![a]);
    let integers_are = encoding.unwrap_or(if masked.is_some() { Encoding::Linear } else { Encoding::Srgb });
    let window = reader.data_window();
    let pick = Pick { stride: names.len(), chosen };
    let (width, height) = (window.width, window.height);
    let space = if stored.is_linear() { space_of(&reader) } else { Some(RgbSpace::Srgb) };
    let mut flaws = Flaws { replaced: 0, unknown_space: space.is_none() };
    let mut space = space.unwrap_or_default();
    let (mut data, kept) = match stored {
        Stored::U8(bytes) => {
            let (bytes, channels) = pick.collapse(bytes);
            (TexelData::U8(bytes), channels)
        }
        Stored::Half(halves) => {
            let (mut halves, channels) = pick.collapse(halves);
            let broken = halves.iter_mut().filter(|bits| **bits & 0x7c00 == 0x7c00);
            flaws.replaced = broken.map(|bits| *bits = 0).count();
            (TexelData::Half(halves), channels)
        }
        Stored::Float(floats, integers) => {
            let (mut floats, channels) = pick.collapse(floats);
            if integers {
                floats.iter_mut().for_each(|value| *value = integers_are.decode(*value));
            }
            let broken = floats.iter_mut().filter(|value| !value.is_finite());
            flaws.replaced = broken.map(|value| *value = 0.0).count();
            (TexelData::Float(floats), channels)
        }
    };
    if channels == Channels::Reflectance {
        // Grey stays grey.
        if kept == 3 && space != RgbSpace::Srgb {
            data.multiply(space.rec709_from_reflectance());
        }
        space = RgbSpace::Srgb;
    }
    Ok(Texels { width, height, channels: kept, data, encoding: integers_are, alpha: masked.is_some(), space, flaws })
}

/// The space of the file's `chromaticities`: Rec.709 if it has none, `None` if they are of no space that is known.
fn space_of(reader: &oiio::Reader) -> Option<RgbSpace> {
    let attributes = reader.attributes();
    let named = attributes.iter().find(|(name, _)| name.eq_ignore_ascii_case("chromaticities"));
    match named {
        Some((_, oiio::Attribute::Floats(xy))) => RgbSpace::with_chromaticities(xy),
        _ => Some(RgbSpace::default()),
    }
}

/// Where the wanted channels are among those of the file.
struct Selection {
    rgb: Vec<usize>,
    alpha: Option<usize>,
}

fn select(names: &[String]) -> Option<Selection> {
    let find = |name: &str| names.iter().position(|n| n.eq_ignore_ascii_case(name));
    let alpha = find("A");
    let rgb = match (find("R"), find("G"), find("B")) {
        (Some(r), Some(g), Some(b)) => vec![r, g, b],
        _ => vec![find("Y").or((names.len() <= 2).then_some(0))?],
    };
    Some(Selection { rgb, alpha })
}

/// All channels of a file. The flag of floats says that they were integers of 16 bits.
enum Stored {
    U8(Vec<u8>),
    Half(Vec<u16>),
    Float(Vec<f32>, bool),
}

impl Stored {
    fn read(reader: &mut oiio::Reader) -> Result<Self, oiio::Error> {
        Ok(match reader.format() {
            oiio::Format::U8 => Self::U8(reader.read_u8()?),
            oiio::Format::Half => Self::Half(reader.read_half_bits()?),
            oiio::Format::U16 => Self::Float(reader.read_f32()?, true),
            oiio::Format::Float => Self::Float(reader.read_f32()?, false),
        })
    }

    /// Whether these are no integers.
    fn is_linear(&self) -> bool {
        matches!(self, Self::Half(_) | Self::Float(_, false))
    }

    /// Whether the channel is 1 everywhere.
    fn is_opaque(&self, stride: usize, channel: usize) -> bool {
        fn all<T: Copy + PartialEq>(items: &[T], stride: usize, channel: usize, one: T) -> bool {
            items.iter().skip(channel).step_by(stride).all(|&item| item == one)
        }
        match self {
            Self::U8(bytes) => all(bytes, stride, channel, 255),
            Self::Half(halves) => all(halves, stride, channel, f32_to_half(1.0)),
            Self::Float(floats, _) => all(floats, stride, channel, 1.0),
        }
    }
}

/// Which of `stride` interleaved channels to keep.
struct Pick {
    stride: usize,
    chosen: Vec<usize>,
}

impl Pick {
    /// The chosen channels and their number: 1 also for an image whose three channels are equal everywhere.
    fn collapse<T: Copy + PartialEq>(&self, items: Vec<T>) -> (Vec<T>, usize) {
        let grey = |pixel: &[T]| self.chosen.iter().all(|&c| pixel[c] == pixel[self.chosen[0]]);
        let kept = if items.chunks_exact(self.stride).all(grey) { &self.chosen[..1] } else { &self.chosen[..] };
        if kept.len() == self.stride && kept.is_sorted() {
            return (items, kept.len());
        }
        let mut out = Vec::with_capacity(items.len() / self.stride * kept.len());
        for pixel in items.chunks_exact(self.stride) {
            out.extend(kept.iter().map(|&c| pixel[c]));
        }
        (out, kept.len())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use oiio::{Attribute, Channel, FileFormat, Format, Output, Window};

    /// Writes an image with the given channels; `.png` by name, else EXR.
    pub fn write(path: &Path, size: [usize; 2], channels: &[(&str, Format)], pixels: &[f32]) {
        write_with(path, size, channels, pixels, vec![]);
    }

    fn write_with(
        path: &Path,
        size: [usize; 2],
        channels: &[(&str, Format)],
        pixels: &[f32],
        attributes: Vec<(String, Attribute)>,
    ) {
        let window = Window::at_origin(size[0], size[1]);
        let png = path.extension().is_some_and(|e| e == "png");
        oiio::write(&Output {
            path,
            file_format: if png { FileFormat::Png } else { FileFormat::Exr },
            data_window: window,
            display_window: window,
            channels: channels.iter().map(|&(name, format)| Channel { name: name.to_owned(), format }).collect(),
            pixels,
            attributes,
            compression: oiio::Compression::default(),
        })
        .unwrap();
    }

    pub const RGB8: [(&str, Format); 3] = [("R", Format::U8), ("G", Format::U8), ("B", Format::U8)];
    pub const RGB16: [(&str, Format); 3] = [("R", Format::U16), ("G", Format::U16), ("B", Format::U16)];

    #[test]
    fn bytes_are_srgb_unless_said_otherwise_and_floats_linear() {
        let folder = tempfile::tempdir().unwrap();
        let half = 128.0 / 255.0;
        let pixels = [half, 0.0, 1.0];
        let linear = Rgb::new(0.215_860_5, 0.0, 1.0);
        let png = folder.path().join("a.png");
        write(&png, [1, 1], &RGB8, &pixels);
        assert!((load_rgb(&png).unwrap().0.pixels[0] - linear).length() < 1e-6);
        let rgb = |path: &Path, encoding| {
            let texels = load_texels(path, Channels::Rgb, Some(encoding)).unwrap();
            Rgb::from_array([0, 1, 2].map(|c| texels.value(c)))
        };
        let stored = rgb(&png, Encoding::Linear);
        assert!((stored - Rgb::from_array(pixels)).length() < 1e-6);

        write(&png, [1, 1], &RGB16, &pixels);
        // 16 bits place the value to 1/65535.
        assert!((load_rgb(&png).unwrap().0.pixels[0] - linear).length() < 1e-4);

        let exr = folder.path().join("a.exr");
        write(&exr, [1, 1], &[("B", Format::Float), ("G", Format::Float), ("R", Format::Float)], &[3.0, 2.0, 1.0]);
        assert_eq!(rgb(&exr, Encoding::Srgb), Rgb::new(1.0, 2.0, 3.0));
    }

    #[test]
    fn floats_are_of_the_space_that_their_file_names() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let stored = Rgb::new(0.25, 0.75, 0.5);
        let of = |format: Format, rgb: Rgb, xy: &[f32]| {
            let attributes = vec![("chromaticities".to_owned(), Attribute::Floats(xy.to_vec()))];
            write_with(&path, [1, 1], &["R", "G", "B"].map(|name| (name, format)), &rgb.to_array(), attributes);
            let texels = |channels| load_texels(&path, channels, None).unwrap();
            let value = |t: &Texels| Rgb::from_array([0, 1, 2].map(|c| t.value(if t.channels == 3 { c } else { 0 })));
            let (light, flaws) = load_rgb(&path).unwrap();
            let data =
                [Channels::Rgb, Channels::Reflectance, Channels::Number].map(|channels| value(&texels(channels)));
            (light.pixels[0], data, flaws.unknown_space)
        };
        for space in [RgbSpace::Srgb, RgbSpace::DciP3, RgbSpace::Rec2020, RgbSpace::Aces2065] {
            let xy = space.chromaticities();
            // A half has eleven digits; sums of three terms of up to 2 err by half an ulp of each in f32.
            for (format, error) in [(Format::Float, 0.0), (Format::Half, 2.0_f32.powi(-11))] {
                let (light, [data, reflectance, number], unknown) = of(format, stored, xy.as_flattened());
                assert_eq!((light, data, number, unknown), (space.rec709_from_light() * stored, stored, stored, false));
                let expected = space.rec709_from_reflectance() * stored;
                assert!(
                    (reflectance - expected).abs().cmple(expected.abs() * error + 4.0 * f32::EPSILON).all(),
                    "{space:?}"
                );
            }
            // What is grey is white light of the space, and reflects all light alike.
            let (light, [_, reflectance, _], _) = of(Format::Float, Rgb::splat(0.5), xy.as_flattened());
            assert_eq!((light, reflectance), (space.rec709_from_light() * Rgb::splat(0.5), Rgb::splat(0.5)));
        }
        let strange = [0.7, 0.3, 0.2, 0.7, 0.15, 0.05, 0.314, 0.351];
        assert_eq!(of(Format::Float, stored, &strange), (stored, [stored; 3], true));
    }

    #[test]
    fn grey_collapses_alpha_is_a_number_and_broken_values_are_counted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grey.png");
        write(&path, [2, 1], &RGB8, &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
        let grey = load_texels(&path, Channels::Rgb, None).unwrap();
        assert_eq!((grey.channels, grey.value(1)), (1, 1.0));

        let path = folder.path().join("leaf.exr");
        let rgba = [("R", Format::Half), ("G", Format::Half), ("B", Format::Half), ("A", Format::Half)];
        write(&path, [2, 1], &rgba, &[1.0, 2.0, 3.0, 1.0, 4.0, f32::NAN, f32::INFINITY, 0.25]);
        let mask = load_texels(&path, Channels::Number, None).unwrap();
        assert_eq!((mask.channels, mask.value(0), mask.value(1)), (1, 1.0, 0.25));
        let rgb = load_texels(&path, Channels::Rgb, None).unwrap();
        assert_eq!((rgb.channels, rgb.value(2), rgb.value(3), rgb.value(4), rgb.flaws.replaced), (3, 3.0, 4.0, 0.0, 2));

        let path = folder.path().join("opaque.png");
        let rgba = [RGB8[0], RGB8[1], RGB8[2], ("A", Format::U8)];
        write(&path, [1, 1], &rgba, &[0.0, 0.2, 0.4, 1.0]);
        assert_eq!(load_texels(&path, Channels::Number, None).unwrap().channels, 3);
    }

    #[test]
    fn errors_name_the_file_and_what_it_lacks() {
        let error = load_rgb(Path::new("no-such.png")).unwrap_err();
        assert!(error.contains("no-such.png"), "{error}");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("xyz.exr");
        write(&path, [1, 1], &[("U", Format::Half), ("V", Format::Half), ("W", Format::Half)], &[0.0; 3]);
        let error = load_rgb(&path).unwrap_err();
        assert!(error.contains("xyz.exr") && error.contains("U, V, W"), "{error}");
    }
}
