//! What every callback needs: the context of its query, the packed rays and hits, and a place for panics.

use crate::{Hit, HitFilter};
use embree_sys as sys;
use std::any::Any;
use std::ffi::c_void;
use std::panic::{self, AssertUnwindSafe};
use std::ptr;

/// Embree's context with what this crate's callbacks need behind it (rtcInitRayQueryContext(3) allows that).
///
/// Invariant: a query that may call back, because it has a filter or its scene holds user geometry, passes one.
#[repr(C)]
pub(crate) struct QueryContext {
    base: sys::RTCRayQueryContext,
    /// The query's filter, if it has one: any `F: HitFilter`, and the function that knows its type.
    filter: Option<(*const c_void, Accept)>,
    /// The first panic of a callback; all later callbacks of the query find nothing.
    panic: Option<Box<dyn Any + Send>>,
}

/// Asks the filter at an address, whose type it knows.
type Accept = unsafe fn(*const c_void, &Hit) -> bool;

impl QueryContext {
    #[inline]
    pub(crate) fn new() -> Self {
        let none = [sys::RTC_INVALID_GEOMETRY_ID; 1];
        let base = sys::RTCRayQueryContext { instID: none, instPrimID: none };
        Self { base, filter: None, panic: None }
    }

    #[inline]
    pub(crate) fn with_filter<F: HitFilter>(filter: &F) -> Self {
        Self { filter: Some((ptr::from_ref(filter).cast(), accept::<F>)), ..Self::new() }
    }

    #[inline]
    pub(crate) fn as_mut_ptr(&mut self) -> *mut sys::RTCRayQueryContext {
        ptr::from_mut(self).cast()
    }

    /// Lets a panic that a callback raised go on, now that Embree has returned.
    #[inline]
    pub(crate) fn resume_panic(self) {
        if let Some(payload) = self.panic {
            panic::resume_unwind(payload);
        }
    }
}

/// Calls into user code; `None` if it panics, or if an earlier callback of the same query did.
///
/// # Safety
/// `context` points at a live [`QueryContext`] to which nobody holds a reference.
#[inline]
pub(crate) unsafe fn guard<R>(context: *mut sys::RTCRayQueryContext, call: impl FnOnce() -> R) -> Option<R> {
    let context = context.cast::<QueryContext>();
    // SAFETY: by contract; the reference ends before `call` begins.
    if unsafe { &(*context).panic }.is_some() {
        return None;
    }
    match panic::catch_unwind(AssertUnwindSafe(call)) {
        Ok(value) => Some(value),
        Err(payload) => {
            // SAFETY: by contract.
            unsafe { (*context).panic = Some(payload) };
            None
        }
    }
}

/// Whether the query's filter, if it has one, accepts the hit; a panic rejects it.
///
/// # Safety
/// As [`guard`]'s, for a context that was made within the lifetime of its filter, as every query does.
pub(crate) unsafe fn accepts(context: *mut sys::RTCRayQueryContext, hit: &Hit) -> bool {
    // SAFETY: by contract.
    let Some((filter, accept)) = (unsafe { (*context.cast::<QueryContext>()).filter }) else { return true };
    // SAFETY: by contract, the filter lives; `with_filter` has paired it with the function for its type.
    unsafe { guard(context, || accept(filter, hit)) }.unwrap_or(false)
}

/// # Safety
/// `filter` points at a live `F`.
unsafe fn accept<F: HitFilter>(filter: *const c_void, hit: &Hit) -> bool {
    // SAFETY: by contract.
    unsafe { &*filter.cast::<F>() }.accept(hit)
}

/// One lane of Embree's structure of arrays: word `field * width + lane`, whatever the packet's width.
///
/// A single ray or hit is a packet of width one.
#[derive(Clone, Copy)]
pub(crate) struct Lane {
    words: *mut u32,
    width: usize,
}

/// Fields of `RTCRayN` (RTCRay(3)).
pub(crate) mod ray {
    pub(crate) const ORIGIN: usize = 0;
    pub(crate) const T_NEAR: usize = 3;
    pub(crate) const DIRECTION: usize = 4;
    pub(crate) const T_FAR: usize = 8;
    /// The number of them: hits follow rays in `RTCRayHitN`.
    pub(crate) const FIELDS: usize = 12;
}

/// Fields of `RTCHitN` (RTCHit(3)).
pub(crate) mod hit {
    pub(crate) const NG: usize = 0;
    pub(crate) const U: usize = 3;
    pub(crate) const V: usize = 4;
    pub(crate) const PRIMITIVE: usize = 5;
    pub(crate) const GEOMETRY: usize = 6;
    pub(crate) const INSTANCE: usize = 7;
    pub(crate) const INSTANCE_PRIMITIVE: usize = 8;
}

impl Lane {
    /// # Safety
    /// `packet` points at a live packet of `width` lanes, `lane` is below `width`, and only fields that the packet's
    /// type has are used.
    #[inline]
    pub(crate) unsafe fn new(packet: *mut u32, width: usize, lane: usize) -> Self {
        // SAFETY: by contract.
        Self { words: unsafe { packet.add(lane) }, width }
    }

    #[inline]
    pub(crate) fn word(self, field: usize) -> u32 {
        // SAFETY: by the contract of `new`: the field lies in the packet, which is made of initialised words.
        unsafe { self.words.add(field * self.width).read() }
    }

    #[inline]
    pub(crate) fn set_word(self, field: usize, value: u32) {
        // SAFETY: as in `word`; callbacks own the packet while they run.
        unsafe { self.words.add(field * self.width).write(value) }
    }

    #[inline]
    pub(crate) fn float(self, field: usize) -> f32 {
        f32::from_bits(self.word(field))
    }

    #[inline]
    pub(crate) fn set_float(self, field: usize, value: f32) {
        self.set_word(field, value.to_bits());
    }

    #[inline]
    pub(crate) fn vec3(self, field: usize) -> glam::Vec3 {
        glam::Vec3::new(self.float(field), self.float(field + 1), self.float(field + 2))
    }

    #[inline]
    pub(crate) fn set_vec3(self, field: usize, value: glam::Vec3) {
        (0..3).for_each(|axis| self.set_float(field + axis, value[axis]));
    }
}

/// Embree's filter callback: clears the lanes that the query's filter rejects.
///
/// # Safety
/// Embree's contract of rtcSetGeometryIntersectFilterFunction(3), with a [`QueryContext`].
pub(crate) unsafe extern "C" fn on_filter(arguments: *const sys::RTCFilterFunctionNArguments) {
    // SAFETY: rtcSetGeometryIntersectFilterFunction(3): the arguments live throughout the call.
    let arguments = unsafe { &*arguments };
    let width = arguments.N as usize;
    for lane in 0..width {
        // SAFETY: the same page: `valid`, `ray` and `hit` hold `N` lanes each.
        let (valid, ray, hit) = unsafe {
            let ray = Lane::new(arguments.ray.cast(), width, lane);
            (arguments.valid.add(lane), ray, Lane::new(arguments.hit.cast(), width, lane))
        };
        // SAFETY: as above; inactive lanes are left alone.
        if unsafe { valid.read() } == 0 {
            continue;
        }
        // SAFETY: queries pass this function only together with a `QueryContext` that outlives them, and Embree hands
        // it on unchanged (rtcInitRayQueryContext(3)).
        if !unsafe { accepts(arguments.context, &candidate(ray, hit)) } {
            // SAFETY: as above: writing 0 rejects the hit.
            unsafe { valid.write(0) };
        }
    }
}

/// The hit that a filter is asked about: its distance is the ray's `tfar`.
#[inline]
fn candidate(ray: Lane, hit: Lane) -> Hit {
    Hit {
        t: ray.float(self::ray::T_FAR),
        u: hit.float(hit::U),
        v: hit.float(hit::V),
        ng: hit.vec3(hit::NG),
        geometry: hit.word(hit::GEOMETRY),
        primitive: hit.word(hit::PRIMITIVE),
        instance: instance(hit.word(hit::INSTANCE)),
    }
}

/// Embree's number of an instance, or none.
#[inline]
pub(crate) fn instance(number: u32) -> Option<u32> {
    (number != sys::RTC_INVALID_GEOMETRY_ID).then_some(number)
}
