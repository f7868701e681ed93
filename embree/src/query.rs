//! Single rays: the closest hit and any hit, with and without a filter. The hottest calls of a renderer.

use crate::callback::{self, QueryContext};
use crate::{CommittedScene, Features};
use embree_sys as sys;
use glam::{Vec3, Vec4};
use std::mem::offset_of;
use std::ptr;

/// A ray: the points `origin + t * direction` for `t` between `t_near` and `t_far`.
///
/// **Space** of the scene that is asked. The direction need not be of unit length. An empty range meets nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where `t` is zero.
    pub origin: Vec3,
    /// Where it goes; `t` counts in its lengths.
    pub direction: Vec3,
    /// The least `t`; what is below zero, or NaN, counts as zero.
    pub t_near: f32,
    /// The largest `t`, possibly infinite.
    pub t_far: f32,
}

impl Ray {
    /// The whole ray, from its origin to infinity.
    #[inline]
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction, t_near: 0.0, t_far: f32::INFINITY }
    }
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in lengths of the ray's direction.
    pub t: f32,
    /// First surface parameter: the weight of a triangle's second vertex, the place along a curve.
    pub u: f32,
    /// Second surface parameter: the weight of a triangle's third vertex, the place across a curve.
    pub v: f32,
    /// Geometric normal, not normalised, in the space of the object; counter-clockwise triangles face along it.
    /// For a ray-facing curve it is the tangent.
    pub ng: Vec3,
    /// Number of the geometry in the scene that holds it: the instanced scene if `instance` is given.
    pub geometry: u32,
    /// Number of the triangle, curve or user primitive in the geometry.
    pub primitive: u32,
    /// Number of the instance's geometry in the scene that was asked; none for a hit of the scene's own geometry.
    pub instance: Option<u32>,
}

/// Decides which hits of geometry made [`with_hit_filter`](crate::Geometry::with_hit_filter) count.
///
/// Closures `Fn(&Hit) -> bool` are filters. The order in which hits are offered is unspecified, not all of those behind
/// the closest are, and with [`BuildQuality::High`](crate::BuildQuality) one may be offered twice: the answer must
/// depend on the hit alone. A panic rejects the hit and resumes once Embree has returned.
pub trait HitFilter {
    /// Whether the ray stops here.
    fn accept(&self, hit: &Hit) -> bool;
}

impl<F: Fn(&Hit) -> bool> HitFilter for F {
    #[inline]
    fn accept(&self, hit: &Hit) -> bool {
        self(hit)
    }
}

impl CommittedScene {
    /// The closest hit, or `None`; of several at the same `t`, one that depends on the scene alone.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        if self.features().contains(Features::USER_GEOMETRY) {
            return self.intersect_in(ray, QueryContext::new(), None);
        }
        let mut query = RawRayHit::new(ray);
        let mut arguments = self.intersect_arguments(ptr::null_mut(), None);
        // SAFETY: rtcIntersect1(3). The scene is committed and cannot change: see `CommittedScene`. `query` is aligned
        // by its type and has all fields that the page names set, `arguments` those of rtcInitIntersectArguments(3);
        // without user geometry and filter there are no callbacks to want a context.
        unsafe { sys::rtcIntersect1(self.raw(), query.as_mut_ptr(), &mut arguments) };
        query.closest()
    }

    /// Whether anything lies in the ray's range.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        if self.features().contains(Features::USER_GEOMETRY) {
            return self.occluded_in(ray, QueryContext::new(), None);
        }
        let mut query = RawRay::new(ray);
        let mut arguments = self.occluded_arguments(ptr::null_mut(), None);
        // SAFETY: rtcOccluded1(3), rtcInitOccludedArguments(3): as in `intersect`.
        unsafe { sys::rtcOccluded1(self.raw(), query.as_mut_ptr(), &mut arguments) };
        query.is_occluded()
    }

    /// The closest hit that the filter accepts; it is asked only about geometry made with a hit filter.
    #[inline]
    pub fn intersect_filtered<F: HitFilter>(&self, ray: &Ray, filter: &F) -> Option<Hit> {
        if !self.has_filtered_geometry() {
            return self.intersect(ray);
        }
        self.intersect_in(ray, QueryContext::with_filter(filter), Some(callback::on_filter))
    }

    /// Whether anything that the filter accepts lies in the ray's range; it is asked only about geometry made with a
    /// hit filter.
    #[inline]
    pub fn occluded_filtered<F: HitFilter>(&self, ray: &Ray, filter: &F) -> bool {
        if !self.has_filtered_geometry() {
            return self.occluded(ray);
        }
        self.occluded_in(ray, QueryContext::with_filter(filter), Some(callback::on_filter))
    }

    /// Queries that call back; `filter` is none or Embree's way to the filter of the context.
    fn intersect_in(&self, ray: &Ray, mut context: QueryContext, filter: sys::RTCFilterFunctionN) -> Option<Hit> {
        let mut query = RawRayHit::new(ray);
        let mut arguments = self.intersect_arguments(context.as_mut_ptr(), filter);
        // SAFETY: rtcIntersect1(3): as in `intersect`; the context outlives the call and is the one that callbacks
        // expect, and none of them lets a panic out.
        unsafe { sys::rtcIntersect1(self.raw(), query.as_mut_ptr(), &mut arguments) };
        context.resume_panic();
        query.closest()
    }

    fn occluded_in(&self, ray: &Ray, mut context: QueryContext, filter: sys::RTCFilterFunctionN) -> bool {
        let mut query = RawRay::new(ray);
        let mut arguments = self.occluded_arguments(context.as_mut_ptr(), filter);
        // SAFETY: rtcOccluded1(3): as in `intersect_in`.
        unsafe { sys::rtcOccluded1(self.raw(), query.as_mut_ptr(), &mut arguments) };
        context.resume_panic();
        query.is_occluded()
    }

    /// Arguments of a query, 32 bytes on the stack: Embree takes them by a pointer that is not `const`.
    #[inline]
    pub(crate) fn intersect_arguments(
        &self,
        context: *mut sys::RTCRayQueryContext,
        filter: sys::RTCFilterFunctionN,
    ) -> sys::RTCIntersectArguments {
        let flags = sys::RTC_RAY_QUERY_FLAG_INCOHERENT;
        sys::RTCIntersectArguments { flags, feature_mask: self.features().bits(), context, filter, intersect: None }
    }

    /// As [`intersect_arguments`](Self::intersect_arguments).
    #[inline]
    pub(crate) fn occluded_arguments(
        &self,
        context: *mut sys::RTCRayQueryContext,
        filter: sys::RTCFilterFunctionN,
    ) -> sys::RTCOccludedArguments {
        let flags = sys::RTC_RAY_QUERY_FLAG_INCOHERENT;
        sys::RTCOccludedArguments { flags, feature_mask: self.features().bits(), context, filter, occluded: None }
    }
}

/// `RTCRay`, written as vectors: Embree loads origin and direction with 16 bytes each, which four stores of a float
/// would hold up until they have left the store buffer: 10 ns of a ray.
#[repr(C, align(16))]
struct RawRay {
    origin_and_near: Vec4,
    direction_and_time: Vec4,
    t_far: f32,
    mask: u32,
    id: u32,
    flags: u32,
}

/// `RTCRayHit`.
#[repr(C, align(16))]
struct RawRayHit {
    ray: RawRay,
    hit: sys::RTCHit,
}

const _: () = {
    assert!(size_of::<RawRay>() == size_of::<sys::RTCRay>() && align_of::<RawRay>() == align_of::<sys::RTCRay>());
    assert!(offset_of!(RawRay, origin_and_near) == offset_of!(sys::RTCRay, org_x));
    assert!(offset_of!(RawRay, direction_and_time) == offset_of!(sys::RTCRay, dir_x));
    assert!(offset_of!(RawRay, t_far) == offset_of!(sys::RTCRay, tfar));
    assert!(offset_of!(RawRay, mask) == offset_of!(sys::RTCRay, mask));
    assert!(offset_of!(RawRay, flags) == offset_of!(sys::RTCRay, flags));
    assert!(size_of::<RawRayHit>() == size_of::<sys::RTCRayHit>());
    assert!(offset_of!(RawRayHit, hit) == offset_of!(sys::RTCRayHit, hit));
};

impl RawRay {
    /// Time 0, seen by all masks, no flags; `tnear` is made what rtcIntersect1(3) demands.
    #[inline]
    fn new(ray: &Ray) -> Self {
        Self {
            origin_and_near: ray.origin.extend(ray.t_near.max(0.0)),
            direction_and_time: ray.direction.extend(0.0),
            t_far: ray.t_far,
            mask: u32::MAX,
            id: 0,
            flags: 0,
        }
    }

    #[inline]
    fn as_mut_ptr(&mut self) -> *mut sys::RTCRay {
        ptr::from_mut(self).cast()
    }

    /// What rtcOccluded1(3) left: `tfar` of minus infinity if anything was hit.
    #[inline]
    fn is_occluded(&self) -> bool {
        self.t_far == f32::NEG_INFINITY
    }
}

impl RawRayHit {
    /// The ray with an empty hit.
    #[inline]
    fn new(ray: &Ray) -> Self {
        let hit = sys::RTCHit {
            Ng_x: 0.0,
            Ng_y: 0.0,
            Ng_z: 0.0,
            u: 0.0,
            v: 0.0,
            primID: sys::RTC_INVALID_GEOMETRY_ID,
            geomID: sys::RTC_INVALID_GEOMETRY_ID,
            instID: [sys::RTC_INVALID_GEOMETRY_ID; 1],
            instPrimID: [sys::RTC_INVALID_GEOMETRY_ID; 1],
        };
        Self { ray: RawRay::new(ray), hit }
    }

    #[inline]
    fn as_mut_ptr(&mut self) -> *mut sys::RTCRayHit {
        ptr::from_mut(self).cast()
    }

    /// What rtcIntersect1(3) left: a valid `geomID` if there is a hit.
    #[inline]
    fn closest(&self) -> Option<Hit> {
        let hit = &self.hit;
        if hit.geomID == sys::RTC_INVALID_GEOMETRY_ID {
            return None;
        }
        Some(Hit {
            t: self.ray.t_far,
            u: hit.u,
            v: hit.v,
            ng: Vec3::new(hit.Ng_x, hit.Ng_y, hit.Ng_z),
            geometry: hit.geomID,
            primitive: hit.primID,
            instance: callback::instance(hit.instID[0]),
        })
    }
}
