//! OpenImageIO's texture system: cached, mip-mapped, filtered look-ups, of what the file stores, not linearised.
//!
//! Fastest settings that are still right, by `cargo run --release -p oiio --example lookups` (2048 × 2048 bytes, one EPYC
//! core): [`Filter::Bilinear`] with [`MipMode::Trilinear`] costs no more than one level, 111 ns for neighbouring texels
//! and 280 ns for texels anywhere, with `tile: 0`; tiles of 64 cost 130 and 410 ns, but let an image that does not fit
//! the cache be read in parts. What remains is the search for the tile, once per level, whatever the options.

use std::ffi::c_void;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::ptr::NonNull;
use std::sync::Arc;

use crate::ffi::{self, ShimError, ShimInfo, ShimLookup, ShimTextures};
use crate::{Error, Format};

/// Settings of a [`TextureSystem`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureOptions {
    /// Memory that the tiles in the cache may take, in MB. OpenImageIO may exceed it a little.
    pub megabytes: f32,
    /// Files kept open at a time.
    pub max_open_files: i32,
    /// Edge of the tiles into which an untiled file is cut; 0 keeps the whole image as one tile.
    pub tile: i32,
}

impl Default for TextureOptions {
    fn default() -> Self {
        Self { megabytes: 1024.0, max_open_files: 100, tile: 64 }
    }
}

/// What a texture shows beyond [0, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// Black.
    Black = 1,
    /// The texel at the edge.
    Clamp = 2,
    /// Repeats.
    #[default]
    Periodic = 3,
    /// Repeats, every other time mirrored.
    Mirror = 4,
}

/// Interpolation within a level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// The nearest texel.
    Closest = 0,
    /// Bilinear.
    #[default]
    Bilinear = 1,
    /// Bicubic.
    Bicubic = 2,
    /// Bicubic where texels are magnified, else bilinear.
    SmartBicubic = 3,
}

/// Which levels of the pyramid a look-up uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MipMode {
    /// The finest.
    NoMip = 1,
    /// The one that fits the footprint.
    OneLevel = 2,
    /// Two, interpolated.
    #[default]
    Trilinear = 3,
    /// Two, along the longer axis of the footprint.
    Anisotropic = 4,
}

/// How to look up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lookup {
    /// Beyond the edges, in s and t.
    pub wrap: Wrap,
    /// Within a level.
    pub filter: Filter,
    /// Across levels.
    pub mip: MipMode,
    /// Largest ratio of the footprint's axes.
    pub anisotropy: i32,
}

impl Default for Lookup {
    fn default() -> Self {
        Self { wrap: Wrap::default(), filter: Filter::default(), mip: MipMode::default(), anisotropy: 8 }
    }
}

/// Figures of a cache.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stats {
    /// Bytes that the tiles take.
    pub memory_used: i64,
    /// Tiles that were read so far.
    pub tiles_read: i64,
}

/// A private texture cache. Files must not change while it lives.
#[derive(Debug)]
pub struct TextureSystem {
    system: Arc<System>,
}

/// Owner of OpenImageIO's object.
#[derive(Debug)]
struct System(NonNull<ShimTextures>);

// SAFETY: OpenImageIO's TextureSystem may be called from any thread, several at a time, provided that each has its own
// per-thread information: `Sampler` is that, and cannot leave its thread.
unsafe impl Send for System {}
// SAFETY: as above.
unsafe impl Sync for System {}

/// A file that a [`TextureSystem`] has resolved and found readable.
#[derive(Clone, Debug)]
pub struct Texture {
    handle: NonNull<c_void>,
    /// The system that owns what the handle points to.
    system: Arc<System>,
    /// Columns of the finest level.
    pub width: usize,
    /// Rows of the finest level.
    pub height: usize,
    /// Channels in the file; 1 is shown as grey.
    pub channels: usize,
    /// Format in the file.
    pub format: Format,
    /// The file.
    pub path: PathBuf,
}

// SAFETY: the handle is an opaque pointer that OpenImageIO lets any thread pass to the system it came from.
unsafe impl Send for Texture {}
// SAFETY: as above; it is never written through.
unsafe impl Sync for Texture {}

impl TextureSystem {
    /// An empty cache of its own.
    ///
    /// # Errors
    /// OpenImageIO refuses.
    pub fn new(options: &TextureOptions) -> Result<Self, Error> {
        let mut raw = std::ptr::null_mut();
        // SAFETY: the outputs are valid for writes during the call.
        ffi::check(|error| unsafe {
            ffi::shim_textures_create(options.megabytes, options.max_open_files, options.tile, &mut raw, error)
        })
        .map_err(Error::Library)?;
        let raw = NonNull::new(raw).ok_or_else(|| Error::Library("no texture system".to_owned()))?;
        Ok(Self { system: Arc::new(System(raw)) })
    }

    /// Resolves a file and reads its header. Unlike OpenImageIO's own handles, the result is known to exist.
    ///
    /// # Errors
    /// The file is missing or no image.
    pub fn open(&self, path: impl AsRef<Path>) -> Result<Texture, Error> {
        let path = path.as_ref();
        let fail = |reason| Error::Open { path: path.to_owned(), reason };
        let c_path = ffi::c_path(path).map_err(fail)?;
        let mut handle = std::ptr::null_mut();
        let mut info = ShimInfo::default();
        // SAFETY: the system is alive, the path a C string, the outputs valid for writes during the call.
        ffi::check(|error| unsafe {
            ffi::shim_textures_open(self.system.as_ptr(), c_path.as_ptr(), &mut handle, &mut info, error)
        })
        .map_err(fail)?;
        let handle = NonNull::new(handle).ok_or_else(|| fail("no handle".to_owned()))?;
        Ok(Texture {
            handle,
            system: Arc::clone(&self.system),
            width: info.width.max(0) as usize,
            height: info.height.max(0) as usize,
            channels: info.channels.max(0) as usize,
            format: Format::from_code(info.format),
            path: path.to_owned(),
        })
    }

    /// The look-ups of the calling thread. Make it once per thread, not once per look-up.
    ///
    /// # Errors
    /// Memory is short.
    pub fn sampler(&self) -> Result<Sampler<'_>, Error> {
        // SAFETY: the system is alive.
        let thread = unsafe { ffi::shim_textures_thread(self.system.as_ptr()) };
        let thread = NonNull::new(thread).ok_or_else(|| Error::Library("no per-thread information".to_owned()))?;
        Ok(Sampler { system: &self.system, thread, _not_send: PhantomData })
    }

    /// Figures of the cache.
    pub fn stats(&self) -> Stats {
        let mut stats = Stats::default();
        // SAFETY: the system is alive and the outputs valid for writes. Where it fails, the zeros stay.
        unsafe { ffi::shim_textures_stats(self.system.as_ptr(), &mut stats.memory_used, &mut stats.tiles_read) };
        stats
    }
}

impl System {
    fn as_ptr(&self) -> *mut ShimTextures {
        self.0.as_ptr()
    }
}

impl Drop for System {
    fn drop(&mut self) {
        // SAFETY: made by `shim_textures_create` and given back only here, when no texture or sampler is left: textures
        // own a share of `self`, samplers borrow it.
        unsafe { ffi::shim_textures_destroy(self.as_ptr()) }
    }
}

/// One thread's access to a [`TextureSystem`], with its own small cache of tiles.
#[derive(Debug)]
pub struct Sampler<'a> {
    system: &'a Arc<System>,
    thread: NonNull<c_void>,
    _not_send: PhantomData<*mut ()>,
}

impl Sampler<'_> {
    /// The filtered value around (s, t), where (0, 0) is the upper left corner and (1, 1) the lower right one, and the
    /// derivatives by x and y span the footprint. Channels that the file does not have are 0.
    ///
    /// # Errors
    /// A tile cannot be read.
    ///
    /// # Panics
    /// The texture is another system's.
    #[inline]
    pub fn sample(
        &mut self,
        texture: &Texture,
        [s, t]: [f32; 2],
        [dsdx, dtdx]: [f32; 2],
        [dsdy, dtdy]: [f32; 2],
        lookup: &Lookup,
    ) -> Result<[f32; 4], Error> {
        assert!(Arc::ptr_eq(&texture.system, self.system), "a texture of another TextureSystem");
        let raw = ShimLookup {
            s,
            t,
            dsdx,
            dtdx,
            dsdy,
            dtdy,
            channels: texture.channels.clamp(3, 4) as i32,
            wrap: lookup.wrap as i32,
            interpolation: lookup.filter as i32,
            mip: lookup.mip as i32,
            anisotropy: lookup.anisotropy,
        };
        let mut result = [0.0; 4];
        // SAFETY: the handle belongs to this system (asserted), which is alive; the per-thread information is this
        // thread's, because `Sampler` is not Send; `result` has room for the 3 or 4 channels asked for.
        let failed = unsafe {
            ffi::shim_textures_sample(
                self.system.as_ptr(),
                self.thread.as_ptr(),
                texture.handle.as_ptr(),
                &raw,
                result.as_mut_ptr(),
            )
        };
        if failed == 0 { Ok(result) } else { Err(self.failure(texture)) }
    }

    #[cold]
    fn failure(&self, texture: &Texture) -> Error {
        let mut error = ShimError::new();
        // SAFETY: the system is alive and `error` valid for the write. The message is this thread's own.
        unsafe { ffi::shim_textures_last_error(self.system.as_ptr(), &mut error) };
        Error::Read { path: texture.path.clone(), reason: error.message() }
    }
}

impl Drop for Sampler<'_> {
    fn drop(&mut self) {
        // SAFETY: made by `shim_textures_thread` of this system, which is alive, and given back only here.
        unsafe { ffi::shim_textures_thread_end(self.system.as_ptr(), self.thread.as_ptr()) }
    }
}
