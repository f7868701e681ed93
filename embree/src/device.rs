//! The device: Embree's configuration, its errors turned into values, and its use of memory.

use crate::Error;
use embree_sys as sys;
use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr::{self, NonNull};
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, ThreadId};

/// How a device builds and traces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeviceOptions {
    /// Threads that build acceleration structures; 0 takes all of the machine.
    ///
    /// With 1, the default, a scene is built the same way every time, and with it every hit is the same bit for bit:
    /// which of several coincident surfaces is hit depends on the order that the builder leaves them in. More threads
    /// are meant to leave the same order with [`BuildQuality::Medium`](crate::BuildQuality::Medium) (Embree's issue
    /// 20; `tests/builder_threads.rs` holds it to that), but nobody promises it for
    /// [`BuildQuality::High`](crate::BuildQuality::High), although `examples/determinism.rs` has found no difference.
    ///
    /// Embree keeps one number for the whole process, the largest of its devices', so all devices that are alive at a
    /// time must name the same. Several scenes may be committed at once, each built by the thread that asks for it.
    pub threads: usize,
    /// Instruction set of the traversal.
    pub isa: Isa,
}

impl Default for DeviceOptions {
    fn default() -> Self {
        Self { threads: 1, isa: Isa::default() }
    }
}

/// Instruction set with which Embree builds and traces; hits may differ in the last bit between two of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Isa {
    /// SSE 4.2: every x86-64 machine since 2008.
    Sse42,
    /// AVX2 with fused multiply-add, whatever else the machine has: the same arithmetic on every machine since 2013.
    #[default]
    Avx2,
    /// AVX-512, on machines that have it.
    Avx512,
    /// The best that the machine has; images may then differ from machine to machine.
    Native,
}

impl Isa {
    /// Its part of the configuration. A misspelt name is not an error to Embree: it silently falls back to SSE2.
    fn config(self) -> &'static str {
        match self {
            Self::Sse42 => ",isa=sse4.2",
            Self::Avx2 => ",isa=avx2",
            Self::Avx512 => ",isa=avx512",
            Self::Native => "",
        }
    }
}

/// Bytes that Embree itself holds; shared vertex and index buffers are not among them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MemoryUse {
    /// Now.
    pub current: u64,
    /// The most so far.
    pub peak: u64,
}

/// An Embree device; cloning shares it, and it lives as long as anything that was made with it.
#[derive(Clone, Debug)]
pub struct Device(pub(crate) Arc<Handle>);

/// Owner of the raw device. Everything that was made by the device holds it, so that it is released last.
#[derive(Debug)]
pub(crate) struct Handle {
    raw: NonNull<sys::RTCDeviceTy>,
    // Shared with Embree, which holds its address until the device is released; `drop` does that before the fields go.
    monitor: Arc<Monitor>,
    // Declared last: the place in the process is given back once the device is gone.
    _place: Place,
}

// SAFETY: devices are used from many threads by design: rtcSetGeometryIntersectFunction(3) allows scenes and geometry
// to be created inside callbacks, which run concurrently; references are counted atomically; `monitor` is `Sync`.
unsafe impl Send for Handle {}
// SAFETY: as above.
unsafe impl Sync for Handle {}

/// What the callbacks of the device write to.
#[derive(Debug, Default)]
struct Monitor {
    current: AtomicI64,
    peak: AtomicI64,
    /// Errors that nobody has asked for yet, each with the thread whose call failed.
    errors: Mutex<Vec<(ThreadId, sys::RTCError, String)>>,
}

impl Device {
    /// Opens a device.
    ///
    /// # Errors
    /// An instruction set that the processor lacks; a number of builder threads other than that of a living device.
    pub fn new(options: &DeviceOptions) -> Result<Self, Error> {
        let place = Place::take(options.threads)?;
        let config = CString::new(format!("threads={},set_affinity=0{}", options.threads, options.isa.config()))
            .expect("numbers and names hold no NUL");
        // SAFETY: rtcNewDevice(3) takes a NUL-terminated configuration, which outlives the call.
        let raw = unsafe { sys::rtcNewDevice(config.as_ptr()) };
        let Some(raw) = NonNull::new(raw) else {
            return Err(Error::Device { isa: options.isa, message: failed_start() });
        };
        let monitor = Arc::<Monitor>::default();
        let user = Arc::as_ptr(&monitor).cast_mut().cast::<c_void>();
        // SAFETY: rtcSetDeviceErrorFunction(3), rtcSetDeviceMemoryMonitorFunction(3): both callbacks take `user` for a
        // `Monitor` and read it only through shared references; it lives until after the device is released.
        unsafe {
            sys::rtcSetDeviceErrorFunction(raw.as_ptr(), Some(on_error), user);
            sys::rtcSetDeviceMemoryMonitorFunction(raw.as_ptr(), Some(on_memory), user);
        }
        Ok(Self(Arc::new(Handle { raw, monitor, _place: place })))
    }

    /// What Embree holds now and has held at most.
    pub fn memory(&self) -> MemoryUse {
        let bytes = |counter: &AtomicI64| u64::try_from(counter.load(Ordering::Relaxed)).unwrap_or(0);
        let monitor = &self.0.monitor;
        MemoryUse { current: bytes(&monitor.current), peak: bytes(&monitor.peak) }
    }

    /// Version of the library that is linked: major, minor, patch.
    pub fn version(&self) -> (u32, u32, u32) {
        // SAFETY: rtcGetDeviceProperty(3) reads constants of a living device.
        let property = |which| unsafe { sys::rtcGetDeviceProperty(self.0.raw.as_ptr(), which) } as u32;
        (
            property(sys::RTC_DEVICE_PROPERTY_VERSION_MAJOR),
            property(sys::RTC_DEVICE_PROPERTY_VERSION_MINOR),
            property(sys::RTC_DEVICE_PROPERTY_VERSION_PATCH),
        )
    }
}

impl Handle {
    pub(crate) fn raw(&self) -> sys::RTCDevice {
        self.raw.as_ptr()
    }

    /// Turns the first error that this thread's calls have raised since the last check into a value.
    pub(crate) fn check(&self, call: &'static str) -> Result<(), Error> {
        let mut errors = self.monitor.errors();
        let mine = thread::current().id();
        let first = errors.iter().find(|(thread, ..)| *thread == mine).cloned();
        errors.retain(|(thread, ..)| *thread != mine);
        first.map_or(Ok(()), |(_, code, message)| Err(Error::Embree { call, code: name_of(code), message }))
    }

    /// The error of a call that returned null.
    pub(crate) fn refused(&self, call: &'static str) -> Error {
        let silent = || Error::Embree { call, code: "no error".into(), message: "it returned null".into() };
        self.check(call).err().unwrap_or_else(silent)
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        // SAFETY: rtcReleaseDevice(3): the handle owns one reference, given back once. All geometry and scenes made by
        // the device held this handle, so they are gone and Embree destroys the device here, while `monitor` lives.
        unsafe { sys::rtcReleaseDevice(self.raw.as_ptr()) };
    }
}

impl Monitor {
    /// The errors; a panic elsewhere cannot have left them half-written, so a poisoned lock is as good.
    fn errors(&self) -> MutexGuard<'_, Vec<(ThreadId, sys::RTCError, String)>> {
        self.errors.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Embree's error callback: it runs on the thread whose call failed.
unsafe extern "C" fn on_error(user: *mut c_void, code: sys::RTCError, message: *const c_char) {
    // SAFETY: `user` is the device's `Monitor`, alive while the device is; see `Device::new`.
    let monitor = unsafe { &*user.cast::<Monitor>() };
    // SAFETY: rtcSetDeviceErrorFunction(3): a string that describes the error.
    let message = unsafe { text(message) };
    monitor.errors().push((thread::current().id(), code, message));
}

/// Embree's memory callback: positive for allocations; returning `true` lets them happen.
unsafe extern "C" fn on_memory(user: *mut c_void, bytes: isize, _post: bool) -> bool {
    // SAFETY: `user` is the device's `Monitor`, alive while the device is; see `Device::new`.
    let monitor = unsafe { &*user.cast::<Monitor>() };
    let bytes = bytes as i64;
    let now = monitor.current.fetch_add(bytes, Ordering::Relaxed) + bytes;
    monitor.peak.fetch_max(now, Ordering::Relaxed);
    true
}

/// Embree's words on why `rtcNewDevice` has just returned null on this thread.
fn failed_start() -> String {
    // SAFETY: rtcGetDeviceError(3): a null device asks for the error of a failed construction on this thread; the
    // message stays valid until the next failure on this thread, and is copied here.
    unsafe {
        let code = sys::rtcGetDeviceError(ptr::null_mut());
        let message = text(sys::rtcGetDeviceLastErrorMessage(ptr::null_mut()));
        if message.is_empty() { name_of(code) } else { message }
    }
}

fn name_of(code: sys::RTCError) -> String {
    // SAFETY: rtcGetErrorString(3) returns a static string for every code.
    unsafe { text(sys::rtcGetErrorString(code)) }
}

/// Copies a C string; null counts as empty.
///
/// # Safety
/// `string` is null or a NUL-terminated string that lives throughout the call.
unsafe fn text(string: *const c_char) -> String {
    if string.is_null() {
        return String::new();
    }
    // SAFETY: by this function's own contract.
    unsafe { CStr::from_ptr(string) }.to_string_lossy().into_owned()
}

/// One device's share of Embree's process-wide number of builder threads, which is the largest of all living devices.
#[derive(Debug)]
struct Place;

/// The number of living devices, and their builder threads.
static LIVING: Mutex<(usize, usize)> = Mutex::new((0, 0));

impl Place {
    fn take(asked: usize) -> Result<Self, Error> {
        let mut living = LIVING.lock().unwrap_or_else(PoisonError::into_inner);
        let (devices, running) = *living;
        if devices > 0 && running != asked {
            return Err(Error::BuilderThreads { asked, running });
        }
        *living = (devices + 1, asked);
        Ok(Self)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        LIVING.lock().unwrap_or_else(PoisonError::into_inner).0 -= 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opens_and_knows_its_version() {
        let device = Device::new(&DeviceOptions::default()).unwrap();
        let (major, minor, _) = device.version();
        assert!(major == 4 && minor >= 3, "{major}.{minor}");
    }

    #[test]
    fn the_number_of_builder_threads_is_the_processs() {
        let first = Device::new(&DeviceOptions::default()).unwrap();
        let second = Device::new(&DeviceOptions { threads: 2, ..DeviceOptions::default() });
        assert_eq!(second.unwrap_err(), Error::BuilderThreads { asked: 2, running: 1 });
        drop(first);
    }

    #[test]
    fn a_failing_call_becomes_an_error_of_the_thread_that_made_it() {
        let device = Device::new(&DeviceOptions::default()).unwrap();
        // SAFETY: rtcNewGeometry(3) checks the type and reports an unknown one; nothing is created.
        let geometry = unsafe { sys::rtcNewGeometry(device.0.raw(), 9999) };
        assert!(geometry.is_null());
        thread::scope(|scope| scope.spawn(|| assert_eq!(device.0.check("other"), Ok(()))).join().unwrap());
        let error = device.0.check("rtcNewGeometry").unwrap_err();
        let Error::Embree { call, message, .. } = &error else { panic!("{error}") };
        assert_eq!((*call, message.is_empty()), ("rtcNewGeometry", false), "{error}");
        assert_eq!(device.0.check("rtcNewGeometry"), Ok(()));
    }
}
