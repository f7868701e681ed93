//! Writing image files.

use std::ffi::c_void;
use std::path::Path;
use std::ptr::NonNull;

use crate::ffi::{self, ShimAttribute, ShimInfo, ShimWriter};
use crate::{Attribute, Error, Format, Window};

/// Kind of file, chosen by name and not by the path: the file may have a temporary name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FileFormat {
    /// OpenEXR, scanlines.
    #[default]
    Exr,
    /// PNG. Values are display-encoded by the caller; an alpha channel is taken to be premultiplied.
    Png,
}

/// Compression of OpenEXR, lossless but for one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compression {
    /// None.
    None,
    /// Run lengths.
    Rle,
    /// Deflate of single rows.
    Zips,
    /// Deflate of 16 rows.
    #[default]
    Zip,
    /// Wavelets: small for noisy pictures.
    Piz,
    /// Lossy: cosine transforms of channels named R, G and B, in any layer. Numbers that are not light are damaged there.
    Dwaa,
}

/// One channel of an image to be written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Its name; OpenEXR takes the part before the last dot as the layer.
    pub name: String,
    /// How it is stored.
    pub format: Format,
}

/// An image to be written.
#[derive(Clone, Debug)]
pub struct Output<'a> {
    /// The file.
    pub path: &'a Path,
    /// Its kind.
    pub file_format: FileFormat,
    /// What `pixels` covers.
    pub data_window: Window,
    /// The frame. PNG writes only the data window.
    pub display_window: Window,
    /// The channels, in the order of `pixels`.
    pub channels: Vec<Channel>,
    /// Row from the top, column, channel. Integer formats map 0 to 1 to their range and clamp.
    pub pixels: &'a [f32],
    /// Metadata. Without `DateTime` a fixed one is written, so that the same picture is always the same file.
    pub attributes: Vec<(String, Attribute)>,
    /// For OpenEXR.
    pub compression: Compression,
}

/// What had to be changed in order to write an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Written {
    /// Values beyond the range of a half float, written as the largest one.
    pub clamped: u64,
}

/// The largest finite 16-bit float.
const HALF_MAX: f32 = 65504.0;

/// What OpenImageIO writes as the date when none is given is the present, which would differ from run to run.
const NO_DATE: &str = "1970:01:01 00:00:00";

/// Writes an image. The same input gives the same bytes.
///
/// # Errors
/// The numbers of channels, pixels and values disagree, or the file cannot be written.
pub fn write(output: &Output) -> Result<Written, Error> {
    let fail = |reason| Error::Write { path: output.path.to_owned(), reason };
    let _pool = crate::steady_pool();
    check_shape(output).map_err(fail)?;
    let path = ffi::c_path(output.path).map_err(fail)?;
    let (pixels, written) = within_half_range(output);
    let writer = Writer::create(output).map_err(fail)?;
    for channel in &output.channels {
        writer.add_channel(channel).map_err(fail)?;
    }
    for (name, value) in &output.attributes {
        writer.set(name, value).map_err(fail)?;
    }
    if output.file_format == FileFormat::Exr {
        writer.set("compression", &Attribute::Text(output.compression.name().to_owned())).map_err(fail)?;
        if !output.attributes.iter().any(|(name, _)| name == "DateTime") {
            writer.set("DateTime", &Attribute::Text(NO_DATE.to_owned())).map_err(fail)?;
        }
    }
    // SAFETY: the writer is alive, the path a C string, and `check_shape` made sure that the buffer holds
    // width · height · channels floats.
    ffi::check(|error| unsafe { ffi::shim_writer_write(writer.0.as_ptr(), path.as_ptr(), pixels.as_ptr(), error) })
        .map_err(fail)?;
    Ok(written)
}

impl Compression {
    fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Rle => "rle",
            Self::Zips => "zips",
            Self::Zip => "zip",
            Self::Piz => "piz",
            Self::Dwaa => "dwaa",
        }
    }
}

fn check_shape(output: &Output) -> Result<(), String> {
    let Window { width, height, .. } = output.data_window;
    let values = width.checked_mul(height).and_then(|n| n.checked_mul(output.channels.len()));
    let fits = |n: usize| i32::try_from(n).is_ok();
    if values != Some(output.pixels.len()) || output.pixels.is_empty() || !fits(width) || !fits(height) {
        let count = output.channels.len();
        return Err(format!("{width} x {height} pixels of {count} channels are not {} values", output.pixels.len()));
    }
    Ok(())
}

/// The pixels, copied only if a half channel has to be clamped.
fn within_half_range<'a>(output: &Output<'a>) -> (std::borrow::Cow<'a, [f32]>, Written) {
    let half: Vec<bool> = output.channels.iter().map(|channel| channel.format == Format::Half).collect();
    let beyond =
        |(index, value): (usize, &f32)| value.is_finite() && value.abs() > HALF_MAX && half[index % half.len()];
    let clamped = output.pixels.iter().enumerate().filter(|&item| beyond(item)).count() as u64;
    if clamped == 0 {
        return (output.pixels.into(), Written::default());
    }
    let limit = |item: (usize, &f32)| if beyond(item) { HALF_MAX.copysign(*item.1) } else { *item.1 };
    (output.pixels.iter().enumerate().map(limit).collect(), Written { clamped })
}

struct Writer(NonNull<ShimWriter>);

impl Writer {
    fn create(output: &Output) -> Result<Self, String> {
        let (data, full) = (output.data_window, output.display_window);
        let info = ShimInfo {
            x: data.x,
            y: data.y,
            width: data.width as i32,
            height: data.height as i32,
            full_x: full.x,
            full_y: full.y,
            full_width: i32::try_from(full.width).map_err(|e| e.to_string())?,
            full_height: i32::try_from(full.height).map_err(|e| e.to_string())?,
            ..ShimInfo::default()
        };
        let format = match output.file_format {
            FileFormat::Exr => c"exr",
            FileFormat::Png => c"png",
        };
        let mut raw = std::ptr::null_mut();
        // SAFETY: the format is a C string; `info` is valid for reads and the outputs for writes during the call.
        ffi::check(|error| unsafe { ffi::shim_writer_create(format.as_ptr(), &info, &mut raw, error) })?;
        NonNull::new(raw).map(Self).ok_or_else(|| "no writer".to_owned())
    }

    fn add_channel(&self, channel: &Channel) -> Result<(), String> {
        let name = ffi::c_text(&channel.name)?;
        // SAFETY: the writer is alive and used by this thread alone; the name is a C string.
        ffi::check(|error| unsafe {
            ffi::shim_writer_channel(self.0.as_ptr(), name.as_ptr(), channel.format as i32, error)
        })
    }

    fn set(&self, name: &str, value: &Attribute) -> Result<(), String> {
        let c_name = ffi::c_text(name)?;
        let rational;
        let (kind, data, count) = match value {
            Attribute::Text(text) => (ffi::kind::STRING, text.as_ptr().cast::<c_void>(), text.len()),
            Attribute::Int(int) => (ffi::kind::INT, std::ptr::from_ref(int).cast(), 1),
            Attribute::Float(float) => (ffi::kind::FLOATS, std::ptr::from_ref(float).cast(), 1),
            Attribute::Floats(floats) if floats.is_empty() => return Err(format!("the attribute {name} is empty")),
            Attribute::Floats(floats) => (ffi::kind::FLOATS, floats.as_ptr().cast(), floats.len()),
            Attribute::Matrix(matrix) => (ffi::kind::MATRIX, matrix.as_ptr().cast(), 16),
            Attribute::Rational(over, under) => {
                rational = [*over, *under];
                (ffi::kind::RATIONAL, rational.as_ptr().cast(), 2)
            }
        };
        let attribute = ShimAttribute { name: c_name.as_ptr(), data, count, kind };
        // SAFETY: `data` points to `count` items of the type of `kind`, which the shim copies before it returns.
        ffi::check(|error| unsafe { ffi::shim_writer_attribute(self.0.as_ptr(), &attribute, error) })
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        // SAFETY: made by `shim_writer_create` and given back only here.
        unsafe { ffi::shim_writer_destroy(self.0.as_ptr()) }
    }
}
