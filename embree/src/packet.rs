//! Packets: four or eight rays at a time, for rays that start and go alike.

use crate::callback::{self, QueryContext};
use crate::{CommittedScene, Features, Hit, Ray};
use embree_sys as sys;
use glam::Vec3;
use std::ptr;

/// Lanes of a packet that are traced: −1 for yes, 0 for no, aligned like the widest packet.
#[repr(C, align(32))]
struct Valid<const N: usize>([i32; N]);

impl<const N: usize> Valid<N> {
    /// Rays with an empty range are left out; comparing this way leaves out NaN too.
    fn of(rays: &[Ray; N]) -> Self {
        Self(rays.each_ref().map(|ray| if ray.t_near <= ray.t_far { -1 } else { 0 }))
    }
}

/// Defines the two queries of a packet width: Embree has a type and a function for each.
macro_rules! packet {
    ($n:literal, $ray:ident, $hit:ident, $ray_hit:ident, $rtc_intersect:ident, $rtc_occluded:ident,
     $intersect:ident, $occluded:ident) => {
        impl CommittedScene {
            #[doc = concat!("The closest hits of ", stringify!($n), " rays; rays with an empty range take no part.")]
            ///
            /// The hits are those of [`intersect`](Self::intersect) but for rounding, and for the choice among
            /// coincident surfaces.
            pub fn $intersect(&self, rays: &[Ray; $n]) -> [Option<Hit>; $n] {
                const NONE: [u32; $n] = [sys::RTC_INVALID_GEOMETRY_ID; $n];
                const ZERO: [f32; $n] = [0.0; $n];
                let hit = sys::$hit {
                    Ng_x: ZERO,
                    Ng_y: ZERO,
                    Ng_z: ZERO,
                    u: ZERO,
                    v: ZERO,
                    primID: NONE,
                    geomID: NONE,
                    instID: [NONE; 1],
                    instPrimID: [NONE; 1],
                };
                let (valid, mut context) = (Valid::of(rays), QueryContext::new());
                let mut query = sys::$ray_hit { ray: transpose::$ray(rays), hit };
                let mut arguments = self.intersect_arguments(self.context(&mut context), None);
                // SAFETY: rtcIntersect4(3): as rtcIntersect1(3) in `CommittedScene::intersect`, with the packet aligned
                // by its type and a mask of as many lanes.
                unsafe { sys::$rtc_intersect(valid.0.as_ptr(), self.raw(), &mut query, &mut arguments) };
                context.resume_panic();
                let (ray, hit) = (&query.ray, &query.hit);
                std::array::from_fn(|i| {
                    (hit.geomID[i] != sys::RTC_INVALID_GEOMETRY_ID).then(|| Hit {
                        t: ray.tfar[i],
                        u: hit.u[i],
                        v: hit.v[i],
                        ng: Vec3::new(hit.Ng_x[i], hit.Ng_y[i], hit.Ng_z[i]),
                        geometry: hit.geomID[i],
                        primitive: hit.primID[i],
                        instance: callback::instance(hit.instID[0][i]),
                    })
                })
            }

            #[doc = concat!("Whether anything lies in the ranges of ", stringify!($n), " rays.")]
            pub fn $occluded(&self, rays: &[Ray; $n]) -> [bool; $n] {
                let (valid, mut context) = (Valid::of(rays), QueryContext::new());
                let mut query = transpose::$ray(rays);
                let mut arguments = self.occluded_arguments(self.context(&mut context), None);
                // SAFETY: rtcOccluded4(3): as rtcIntersect4(3) above.
                unsafe { sys::$rtc_occluded(valid.0.as_ptr(), self.raw(), &mut query, &mut arguments) };
                context.resume_panic();
                std::array::from_fn(|i| valid.0[i] != 0 && query.tfar[i] == f32::NEG_INFINITY)
            }
        }
    };
}

packet!(4, RTCRay4, RTCHit4, RTCRayHit4, rtcIntersect4, rtcOccluded4, intersect4, occluded4);
packet!(8, RTCRay8, RTCHit8, RTCRayHit8, rtcIntersect8, rtcOccluded8, intersect8, occluded8);

impl CommittedScene {
    /// The context for Embree: only scenes that call back need one.
    fn context(&self, context: &mut QueryContext) -> *mut sys::RTCRayQueryContext {
        match self.features().contains(Features::USER_GEOMETRY) {
            true => context.as_mut_ptr(),
            false => ptr::null_mut(),
        }
    }
}

/// Rays as structures of arrays.
#[allow(non_snake_case)] // named after what they make
mod transpose {
    use super::{Ray, sys};

    macro_rules! transpose {
        ($n:literal, $name:ident) => {
            pub(super) fn $name(rays: &[Ray; $n]) -> sys::$name {
                let of = |field: fn(&Ray) -> f32| rays.each_ref().map(field);
                sys::$name {
                    org_x: of(|ray| ray.origin.x),
                    org_y: of(|ray| ray.origin.y),
                    org_z: of(|ray| ray.origin.z),
                    tnear: of(|ray| ray.t_near.max(0.0)),
                    dir_x: of(|ray| ray.direction.x),
                    dir_y: of(|ray| ray.direction.y),
                    dir_z: of(|ray| ray.direction.z),
                    time: [0.0; $n],
                    tfar: of(|ray| ray.t_far),
                    mask: [u32::MAX; $n],
                    id: [0; $n],
                    flags: [0; $n],
                }
            }
        };
    }

    transpose!(4, RTCRay4);
    transpose!(8, RTCRay8);
}
