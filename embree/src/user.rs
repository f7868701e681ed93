//! Geometry that Rust intersects: quadrics and whatever else Embree does not know.

use crate::callback::{self, Lane, hit, ray};
use crate::{Error, Hit, MeshError};
use embree_sys as sys;
use glam::Vec3;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Primitives that are intersected by a callback.
///
/// All in the space of the object. The methods are called from every thread that traces. They may trace rays
/// themselves. A panic counts as a miss and resumes once Embree has returned to the query that caused it.
pub trait UserGeometry: Send + Sync {
    /// The number of primitives; asked once.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Lower and upper corner of a box around a primitive; asked once for each.
    fn bounds(&self, primitive: u32) -> (Vec3, Vec3);

    /// The closest hit with `t` in the range, of which the lower end may be left out, or `None`; hits outside of it are
    /// ignored.
    ///
    /// `direction` is not of unit length, and `t` counts in its lengths.
    fn intersect(&self, primitive: u32, origin: Vec3, direction: Vec3, t_range: (f32, f32)) -> Option<UserHit>;
}

/// A hit of a user primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UserHit {
    /// Distance in lengths of the direction.
    pub t: f32,
    /// First surface parameter.
    pub u: f32,
    /// Second surface parameter.
    pub v: f32,
    /// Geometric normal in object space; its length is free.
    pub ng: Vec3,
}

/// What Embree's callbacks see of a user geometry; its address is the geometry's user pointer.
pub(crate) struct Binding {
    object: Arc<dyn UserGeometry>,
    bounds: Box<[sys::RTCBounds]>,
    filtered: AtomicBool,
}

impl Binding {
    /// Asks for all bounds, here rather than inside Embree's builder, where neither panic nor error could be reported.
    pub(crate) fn new(object: Arc<dyn UserGeometry>) -> Result<Self, Error> {
        let count = object.len();
        let limit = u32::MAX as usize;
        if count > limit {
            return Err(MeshError::TooMany { what: "user primitives", count, limit }.into());
        }
        let bounds = (0..count).map(|primitive| bounds(&*object, primitive)).collect::<Result<_, _>>()?;
        Ok(Self { object, bounds, filtered: AtomicBool::new(false) })
    }

    pub(crate) fn len(&self) -> u32 {
        self.bounds.len() as u32 // checked in `new`
    }

    /// Lets the query's filter decide on hits of this geometry.
    pub(crate) fn filter(&self) {
        self.filtered.store(true, Ordering::Relaxed);
    }

    /// The closest hit in the lane's range that the query's filter, if this geometry takes part in it, accepts.
    ///
    /// A rejected hit may hide another of the same primitive, so the search goes on behind it.
    ///
    /// # Safety
    /// As [`callback::accepts`]'s.
    unsafe fn search(
        &self,
        context: *mut sys::RTCRayQueryContext,
        (geometry, primitive): (u32, u32),
        lane: Lane,
    ) -> Option<Hit> {
        let (origin, direction) = (lane.vec3(ray::ORIGIN), lane.vec3(ray::DIRECTION));
        let (mut near, far) = (lane.float(ray::T_NEAR), lane.float(ray::T_FAR));
        // SAFETY: this function's own contract. rtcSetGeometryIntersectFunction(3): the context names the instance.
        let instance = callback::instance(unsafe { (*context).instID[0] });
        loop {
            let call = || self.object.intersect(primitive, origin, direction, (near, far));
            // SAFETY: this function's own contract.
            let UserHit { t, u, v, ng } = unsafe { callback::guard(context, call) }??;
            // Written so that NaN fails. The range begins at zero or later, so `t` is not negative.
            if !(t >= near && t <= far && t < f32::INFINITY) {
                return None;
            }
            let hit = Hit { t, u, v, ng, geometry, primitive, instance };
            // SAFETY: this function's own contract.
            if !self.filtered.load(Ordering::Relaxed) || unsafe { callback::accepts(context, &hit) } {
                return Some(hit);
            }
            // The next number above: adding 0 turns -0 into +0, whose bits count upwards.
            near = f32::from_bits((t + 0.0).to_bits() + 1);
        }
    }
}

fn bounds(object: &dyn UserGeometry, primitive: usize) -> Result<sys::RTCBounds, MeshError> {
    let (lower, upper) = object.bounds(primitive as u32);
    let tame = |corner: Vec3| corner.abs().cmple(Vec3::splat(crate::buffer::FARTHEST)).all();
    if !(tame(lower) && tame(upper) && lower.cmple(upper).all()) {
        return Err(MeshError::UserBounds { primitive, lower: lower.into(), upper: upper.into() });
    }
    Ok(sys::RTCBounds {
        lower_x: lower.x,
        lower_y: lower.y,
        lower_z: lower.z,
        align0: 0.0,
        upper_x: upper.x,
        upper_y: upper.y,
        upper_z: upper.z,
        align1: 0.0,
    })
}

/// # Safety
/// Embree's contract of rtcSetGeometryBoundsFunction(3), with the geometry's user data set to a [`Binding`].
pub(crate) unsafe extern "C" fn on_bounds(arguments: *const sys::RTCBoundsFunctionArguments) {
    // SAFETY: rtcSetGeometryBoundsFunction(3): `geometryUserPtr` is the `Binding` that `Geometry` keeps alive,
    // `bounds_o` the place to write to, and `primID` is below the count that was set, the length of `bounds`.
    unsafe {
        let arguments = &*arguments;
        let binding = &*arguments.geometryUserPtr.cast::<Binding>();
        arguments.bounds_o.write(binding.bounds[arguments.primID as usize]);
    }
}

/// # Safety
/// Embree's contract of rtcSetGeometryIntersectFunction(3), with the geometry's user data set to a [`Binding`].
pub(crate) unsafe extern "C" fn on_intersect(arguments: *const sys::RTCIntersectFunctionNArguments) {
    // SAFETY: rtcSetGeometryIntersectFunction(3): the arguments live throughout the call, and `geometryUserPtr` is the
    // `Binding` that `Geometry` keeps alive.
    let (arguments, binding) = unsafe { (&*arguments, &*(*arguments).geometryUserPtr.cast::<Binding>()) };
    let width = arguments.N as usize;
    for lane in 0..width {
        // SAFETY: the same page: `valid` and `rayhit` hold `N` lanes, hits behind the rays (RTCRayHit(3)).
        let (valid, rays, hits) = unsafe {
            let words = arguments.rayhit.cast::<u32>();
            let hits = Lane::new(words.add(ray::FIELDS * width), width, lane);
            (arguments.valid.add(lane).read(), Lane::new(words, width, lane), hits)
        };
        if valid == 0 {
            continue;
        }
        // SAFETY: every query of a scene with user geometry passes a `QueryContext` (its invariant).
        let found = unsafe { binding.search(arguments.context, (arguments.geomID, arguments.primID), rays) };
        if let Some(found) = found {
            rays.set_float(ray::T_FAR, found.t);
            hits.set_vec3(hit::NG, found.ng);
            hits.set_float(hit::U, found.u);
            hits.set_float(hit::V, found.v);
            hits.set_word(hit::PRIMITIVE, arguments.primID);
            hits.set_word(hit::GEOMETRY, arguments.geomID);
            // SAFETY: the same page: the instance is copied from the context, which lives throughout the call.
            let context = unsafe { &*arguments.context };
            hits.set_word(hit::INSTANCE, context.instID[0]);
            hits.set_word(hit::INSTANCE_PRIMITIVE, context.instPrimID[0]);
        }
    }
}

/// # Safety
/// Embree's contract of rtcSetGeometryOccludedFunction(3), with the geometry's user data set to a [`Binding`].
pub(crate) unsafe extern "C" fn on_occluded(arguments: *const sys::RTCOccludedFunctionNArguments) {
    // SAFETY: rtcSetGeometryOccludedFunction(3): as in `on_intersect`.
    let (arguments, binding) = unsafe { (&*arguments, &*(*arguments).geometryUserPtr.cast::<Binding>()) };
    let width = arguments.N as usize;
    for lane in 0..width {
        // SAFETY: the same page: `valid` and `ray` hold `N` lanes.
        let (valid, rays) = unsafe { (arguments.valid.add(lane).read(), Lane::new(arguments.ray.cast(), width, lane)) };
        if valid == 0 {
            continue;
        }
        // SAFETY: every query of a scene with user geometry passes a `QueryContext` (its invariant).
        let found = unsafe { binding.search(arguments.context, (arguments.geomID, arguments.primID), rays) };
        if found.is_some() {
            rays.set_float(ray::T_FAR, f32::NEG_INFINITY);
        }
    }
}
