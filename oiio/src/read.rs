//! Reading image files.

use std::ffi::c_void;
use std::path::{Path, PathBuf};
use std::ptr::NonNull;

use crate::ffi::{self, ShimAttribute, ShimInfo, ShimReader};
use crate::{Attribute, Error, Format, Image, Window};

/// Reads the first image of a file as floats.
///
/// # Errors
/// The file cannot be opened, or its pixels cannot be read.
pub fn read(path: impl AsRef<Path>) -> Result<Image, Error> {
    let mut reader = Reader::open(path)?;
    Ok(Image {
        pixels: reader.read_f32()?,
        width: reader.data_window().width,
        height: reader.data_window().height,
        channels: reader.channels(),
        data_window: reader.data_window(),
        display_window: reader.display_window(),
        format: reader.format(),
        attributes: reader.attributes(),
    })
}

/// An open image file, for callers that want the pixels in the format in which they are stored.
#[derive(Debug)]
pub struct Reader {
    raw: NonNull<ShimReader>,
    info: ShimInfo,
    path: PathBuf,
}

// SAFETY: the shim's reader owns all it points to, has no thread affinity, and is used through `&mut self` where it
// changes.
unsafe impl Send for Reader {}

impl Reader {
    /// Opens a file and reads its header.
    ///
    /// # Errors
    /// The file is missing or no image, or its size is absurd.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let fail = |reason| Error::Open { path: path.to_owned(), reason };
        let _pool = crate::steady_pool();
        let c_path = ffi::c_path(path).map_err(fail)?;
        let mut raw = std::ptr::null_mut();
        let mut info = ShimInfo::default();
        // SAFETY: the path is a C string; the three outputs are valid for writes during the call.
        ffi::check(|error| unsafe { ffi::shim_reader_open(c_path.as_ptr(), &mut raw, &mut info, error) })
            .map_err(fail)?;
        let raw = NonNull::new(raw).ok_or_else(|| fail("no reader".to_owned()))?;
        let reader = Self { raw, info, path: path.to_owned() };
        if info.width <= 0 || info.height <= 0 || info.channels <= 0 {
            let reason = format!("it has {} x {} pixels of {} channels", info.width, info.height, info.channels);
            return Err(fail(reason));
        }
        Ok(reader)
    }

    /// What the file holds.
    pub fn data_window(&self) -> Window {
        window(self.info.x, self.info.y, self.info.width, self.info.height)
    }

    /// The frame.
    pub fn display_window(&self) -> Window {
        window(self.info.full_x, self.info.full_y, self.info.full_width, self.info.full_height)
    }

    /// The widest format of a channel.
    pub fn format(&self) -> Format {
        Format::from_code(self.info.format)
    }

    /// Names of the channels, in the order of the pixels' values.
    pub fn channels(&self) -> Vec<String> {
        (0..self.info.channels)
            .map(|index| {
                // SAFETY: the reader is alive, the index below its channel count; the name is a C string it owns.
                unsafe { ffi::copy_text(ffi::shim_reader_channel(self.raw.as_ptr(), index)) }
            })
            .collect()
    }

    /// Metadata. Values of types that [`Attribute`] does not have are left out.
    pub fn attributes(&self) -> Vec<(String, Attribute)> {
        (0..self.info.attributes).map(|index| self.attribute(index)).collect()
    }

    fn attribute(&self, index: i32) -> (String, Attribute) {
        let mut raw = ShimAttribute { name: std::ptr::null(), data: std::ptr::null(), count: 0, kind: 0 };
        // SAFETY: the reader is alive and the index is below its attribute count; `raw` is valid for the write.
        unsafe { ffi::shim_reader_attribute(self.raw.as_ptr(), index, &mut raw) };
        // SAFETY: `name` is a C string that lives as long as the reader.
        let name = unsafe { ffi::copy_text(raw.name) };
        // SAFETY: `data` points to `count` items of the type that goes with `kind`, suitably aligned (OpenImageIO
        // stores them in aligned memory), alive as long as the reader.
        let value = unsafe { attribute_value(&raw) };
        (name, value)
    }

    /// All values as floats: row from the top, column, channel. Integers become 0 to 1.
    ///
    /// # Errors
    /// The file is truncated or damaged, or memory is short.
    pub fn read_f32(&mut self) -> Result<Vec<f32>, Error> {
        self.read(Format::Float)
    }

    /// All values as 8-bit integers; wider ones are rounded.
    ///
    /// # Errors
    /// As [`Self::read_f32`].
    pub fn read_u8(&mut self) -> Result<Vec<u8>, Error> {
        self.read(Format::U8)
    }

    /// All values as 16-bit floats, by their bits.
    ///
    /// # Errors
    /// As [`Self::read_f32`].
    pub fn read_half_bits(&mut self) -> Result<Vec<u16>, Error> {
        self.read(Format::Half)
    }

    /// `T` has the size of `format`, and every bit pattern is a value of it.
    fn read<T: Copy + Default>(&mut self, format: Format) -> Result<Vec<T>, Error> {
        let fail = |reason| Error::Read { path: self.path.clone(), reason };
        let window = self.data_window();
        let count = window.width.checked_mul(window.height).and_then(|n| n.checked_mul(self.info.channels as usize));
        let mut pixels = Vec::<T>::new();
        let reserved = count.filter(|&n| pixels.try_reserve_exact(n).is_ok());
        let Some(count) = reserved else {
            let reason = format!("{} x {} pixels do not fit into memory", window.width, window.height);
            return Err(fail(reason));
        };
        pixels.resize(count, T::default());
        let _pool = crate::steady_pool();
        // SAFETY: the buffer holds width · height · channels items of the format asked for, which is what
        // `read_image` writes with its default strides.
        ffi::check(|error| unsafe {
            ffi::shim_reader_read(self.raw.as_ptr(), format as i32, pixels.as_mut_ptr().cast::<c_void>(), error)
        })
        .map_err(fail)?;
        Ok(pixels)
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        // SAFETY: made by `shim_reader_open` and given back only here.
        unsafe { ffi::shim_reader_close(self.raw.as_ptr()) }
    }
}

fn window(x: i32, y: i32, width: i32, height: i32) -> Window {
    Window { x, y, width: width.max(0) as usize, height: height.max(0) as usize }
}

/// # Safety
/// `raw.data` points to `raw.count` initialised items of the type of `raw.kind`.
unsafe fn attribute_value(raw: &ShimAttribute) -> Attribute {
    // SAFETY: the caller's promise, once for each type.
    let bytes = || unsafe { std::slice::from_raw_parts(raw.data.cast::<u8>(), raw.count) };
    // SAFETY: as above.
    let ints = || unsafe { std::slice::from_raw_parts(raw.data.cast::<i32>(), raw.count) };
    // SAFETY: as above.
    let floats = || unsafe { std::slice::from_raw_parts(raw.data.cast::<f32>(), raw.count) };
    match raw.kind {
        ffi::kind::STRING => Attribute::Text(String::from_utf8_lossy(bytes()).into_owned()),
        ffi::kind::INT => Attribute::Int(ints()[0]),
        ffi::kind::RATIONAL => Attribute::Rational(ints()[0], ints()[1]),
        ffi::kind::MATRIX => Attribute::Matrix(std::array::from_fn(|i| floats()[i])),
        _ if raw.count == 1 => Attribute::Float(floats()[0]),
        _ => Attribute::Floats(floats().to_vec()),
    }
}
