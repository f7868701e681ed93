//! Images through OpenImageIO, behind an own C++ shim of some twenty functions: no published binding builds against
//! the 2.5 of Debian 13.
//!
//! [`read`] and [`Reader`] take any format; [`write`] makes OpenEXR with metadata, and PNG; [`TextureSystem`] is
//! OpenImageIO's cached, filtered look-up.
//!
//! # Invariants
//! No C++ exception and no Rust panic crosses the border; only plain data does. Nothing is linearised: values are those
//! of the file. The same picture gives the same file, byte for byte, whatever the time and the threads.

use std::sync::{PoisonError, RwLock, RwLockReadGuard};

mod error;
mod ffi;
mod image;
mod read;
mod texture;
mod write;

pub use error::Error;
pub use image::{Attribute, Format, Image, Window};
pub use read::{Reader, read};
pub use texture::{Filter, Lookup, MipMode, Sampler, Stats, Texture, TextureOptions, TextureSystem, Wrap};
pub use write::{Channel, Compression, FileFormat, Output, Written, write};

/// Threads that OpenImageIO and OpenEXR use inside one call, from now on and in the whole process.
///
/// 1 means the calling thread alone: right while a renderer's own threads are at work. Setting what is set already does
/// nothing, so that callers need not agree on who is the first. Waits for reads and writes of files that are under way.
///
/// # Errors
/// OpenImageIO refuses the number.
pub fn set_threads(threads: usize) -> Result<(), Error> {
    let threads = i32::try_from(threads.max(1)).map_err(|_| Error::Library(format!("{threads} threads")))?;
    let mut current = POOL.write().unwrap_or_else(PoisonError::into_inner);
    if *current != Some(threads) {
        // SAFETY: `error` is valid for the write.
        ffi::check(|error| unsafe { ffi::shim_set_threads(threads, error) }).map_err(Error::Library)?;
        *current = Some(threads);
    }
    Ok(())
}

/// The size that the pool was given. OpenImageIO aborts the process when a thread resizes its pool while another resizes or
/// uses it, so whoever does what may use it holds this.
static POOL: RwLock<Option<i32>> = RwLock::new(None);

/// Keeps the pool as it is.
fn steady_pool() -> RwLockReadGuard<'static, Option<i32>> {
    POOL.read().unwrap_or_else(PoisonError::into_inner)
}

/// Version of the OpenImageIO that the shim was compiled against.
pub fn version() -> String {
    // SAFETY: a string constant of the shim.
    unsafe { ffi::copy_text(ffi::shim_version()) }
}
