//! Declarations of `shim.h`, item by item.

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::path::Path;

#[repr(C)]
pub struct ShimError {
    pub text: [c_char; 1024],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct ShimInfo {
    pub x: i32,
    pub y: i32,
    pub width: i32,
    pub height: i32,
    pub full_x: i32,
    pub full_y: i32,
    pub full_width: i32,
    pub full_height: i32,
    pub channels: i32,
    pub format: i32,
    pub attributes: i32,
}

#[repr(C)]
pub struct ShimAttribute {
    pub name: *const c_char,
    pub data: *const c_void,
    pub count: usize,
    pub kind: i32,
}

#[repr(C)]
pub struct ShimLookup {
    pub s: f32,
    pub t: f32,
    pub dsdx: f32,
    pub dtdx: f32,
    pub dsdy: f32,
    pub dtdy: f32,
    pub channels: i32,
    pub wrap: i32,
    pub interpolation: i32,
    pub mip: i32,
    pub anisotropy: i32,
}

// The same sizes are asserted in shim.cc.
const _: () = assert!(size_of::<ShimInfo>() == 44 && size_of::<ShimLookup>() == 44);
const _: () = assert!(size_of::<ShimAttribute>() == 3 * size_of::<usize>() + 8 && size_of::<ShimError>() == 1024);

/// `enum shim_kind`.
pub mod kind {
    pub const STRING: i32 = 0;
    pub const INT: i32 = 1;
    pub const FLOATS: i32 = 2;
    pub const MATRIX: i32 = 3;
    pub const RATIONAL: i32 = 4;
}

macro_rules! opaque {
    ($($name:ident),*) => {$(
        #[repr(C)]
        pub struct $name {
            _private: [u8; 0],
        }
    )*};
}
opaque!(ShimReader, ShimWriter, ShimTextures);

unsafe extern "C" {
    pub fn shim_version() -> *const c_char;
    pub fn shim_set_threads(threads: c_int, error: *mut ShimError) -> c_int;

    pub fn shim_reader_open(
        path: *const c_char,
        reader: *mut *mut ShimReader,
        info: *mut ShimInfo,
        error: *mut ShimError,
    ) -> c_int;
    pub fn shim_reader_channel(reader: *const ShimReader, index: c_int) -> *const c_char;
    pub fn shim_reader_attribute(reader: *const ShimReader, index: c_int, attribute: *mut ShimAttribute);
    pub fn shim_reader_read(
        reader: *mut ShimReader,
        format: c_int,
        pixels: *mut c_void,
        error: *mut ShimError,
    ) -> c_int;
    pub fn shim_reader_close(reader: *mut ShimReader);

    pub fn shim_writer_create(
        format: *const c_char,
        windows: *const ShimInfo,
        writer: *mut *mut ShimWriter,
        error: *mut ShimError,
    ) -> c_int;
    pub fn shim_writer_channel(
        writer: *mut ShimWriter,
        name: *const c_char,
        format: c_int,
        error: *mut ShimError,
    ) -> c_int;
    pub fn shim_writer_attribute(
        writer: *mut ShimWriter,
        attribute: *const ShimAttribute,
        error: *mut ShimError,
    ) -> c_int;
    pub fn shim_writer_write(
        writer: *mut ShimWriter,
        path: *const c_char,
        pixels: *const f32,
        error: *mut ShimError,
    ) -> c_int;
    pub fn shim_writer_destroy(writer: *mut ShimWriter);

    pub fn shim_textures_create(
        megabytes: f32,
        max_open_files: c_int,
        tile: c_int,
        textures: *mut *mut ShimTextures,
        error: *mut ShimError,
    ) -> c_int;
    pub fn shim_textures_open(
        textures: *mut ShimTextures,
        path: *const c_char,
        texture: *mut *mut c_void,
        info: *mut ShimInfo,
        error: *mut ShimError,
    ) -> c_int;
    pub fn shim_textures_thread(textures: *mut ShimTextures) -> *mut c_void;
    pub fn shim_textures_thread_end(textures: *mut ShimTextures, thread: *mut c_void);
    pub fn shim_textures_sample(
        textures: *mut ShimTextures,
        thread: *mut c_void,
        texture: *mut c_void,
        lookup: *const ShimLookup,
        result: *mut f32,
    ) -> c_int;
    pub fn shim_textures_last_error(textures: *mut ShimTextures, error: *mut ShimError);
    pub fn shim_textures_stats(textures: *mut ShimTextures, memory_used: *mut i64, tiles_read: *mut i64) -> c_int;
    pub fn shim_textures_destroy(textures: *mut ShimTextures);
}

impl ShimError {
    pub fn new() -> Self {
        Self { text: [0; 1024] }
    }

    /// The text up to its NUL; all of it should there be none.
    pub fn message(&self) -> String {
        let bytes: Vec<u8> = self.text.iter().take_while(|&&c| c != 0).map(|&c| c as u8).collect();
        String::from_utf8_lossy(&bytes).trim().to_owned()
    }
}

/// Runs one call of the shim that reports by code and message.
pub fn check(call: impl FnOnce(*mut ShimError) -> c_int) -> Result<(), String> {
    let mut error = ShimError::new();
    if call(&mut error) == 0 { Ok(()) } else { Err(error.message()) }
}

/// The path as OpenImageIO takes it: UTF-8 with a NUL at its end.
pub fn c_path(path: &Path) -> Result<CString, String> {
    let text = path.to_str().ok_or("the path is not UTF-8, which OpenImageIO requires")?;
    c_text(text)
}

pub fn c_text(text: &str) -> Result<CString, String> {
    CString::new(text).map_err(|_| format!("{text:?} contains a NUL character"))
}

/// Copies a C string.
///
/// # Safety
/// `text` points to a string that ends with a NUL and is not changed meanwhile.
pub unsafe fn copy_text(text: *const c_char) -> String {
    // SAFETY: the caller's promise.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}
