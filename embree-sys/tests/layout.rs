//! The memory layouts that the wrapper relies on, written down from the man pages RTCRay(3), RTCHit(3), RTCRayHit(3),
//! rtcInitIntersectArguments(3) and the callback pages: bindgen's own checks only compare it with libclang.

use embree_sys::*;
use std::mem::{align_of, offset_of, size_of};

/// Asserts size and alignment of a type and the byte offsets of its fields, which must be named in order.
macro_rules! layout {
    ($type:ty, size $size:expr, align $align:expr, $($field:ident @ $offset:expr),+) => {
        assert_eq!((size_of::<$type>(), align_of::<$type>()), ($size, $align), stringify!($type));
        $(assert_eq!(offset_of!($type, $field), $offset, "{}::{}", stringify!($type), stringify!($field));)+
    };
}

#[test]
fn single_rays_and_hits() {
    layout!(RTCRay, size 48, align 16,
        org_x @ 0, org_y @ 4, org_z @ 8, tnear @ 12, dir_x @ 16, dir_y @ 20, dir_z @ 24, time @ 28,
        tfar @ 32, mask @ 36, id @ 40, flags @ 44);
    // 9 words, padded to the alignment.
    layout!(RTCHit, size 48, align 16,
        Ng_x @ 0, Ng_y @ 4, Ng_z @ 8, u @ 12, v @ 16, primID @ 20, geomID @ 24, instID @ 28, instPrimID @ 32);
    layout!(RTCRayHit, size 96, align 16, ray @ 0, hit @ 48);
}

/// Field `k` of a packet of `n` starts at word `k * n`: the rule by which callbacks reach into packets of any width.
macro_rules! packet_layout {
    ($n:expr, $align:expr, $ray:ty, $hit:ty, $ray_hit:ty) => {
        let row = 4 * $n;
        layout!($ray, size 12 * row, align $align,
            org_x @ 0, org_y @ row, org_z @ 2 * row, tnear @ 3 * row, dir_x @ 4 * row, dir_y @ 5 * row, dir_z @ 6 * row,
            time @ 7 * row, tfar @ 8 * row, mask @ 9 * row, id @ 10 * row, flags @ 11 * row);
        layout!($hit, size 9 * row, align $align,
            Ng_x @ 0, Ng_y @ row, Ng_z @ 2 * row, u @ 3 * row, v @ 4 * row, primID @ 5 * row, geomID @ 6 * row,
            instID @ 7 * row, instPrimID @ 8 * row);
        layout!($ray_hit, size 21 * row, align $align, ray @ 0, hit @ 12 * row);
    };
}

#[test]
fn packets() {
    packet_layout!(4, 16, RTCRay4, RTCHit4, RTCRayHit4);
    packet_layout!(8, 32, RTCRay8, RTCHit8, RTCRayHit8);
    packet_layout!(16, 64, RTCRay16, RTCHit16, RTCRayHit16);
}

#[test]
fn query_arguments() {
    layout!(RTCIntersectArguments, size 32, align 8,
        flags @ 0, feature_mask @ 4, context @ 8, filter @ 16, intersect @ 24);
    layout!(RTCOccludedArguments, size 32, align 8,
        flags @ 0, feature_mask @ 4, context @ 8, filter @ 16, occluded @ 24);
    layout!(RTCRayQueryContext, size 8, align 4, instID @ 0, instPrimID @ 4);
}

#[test]
fn callback_arguments() {
    layout!(RTCFilterFunctionNArguments, size 48, align 8,
        valid @ 0, geometryUserPtr @ 8, context @ 16, ray @ 24, hit @ 32, N @ 40);
    layout!(RTCIntersectFunctionNArguments, size 48, align 8,
        valid @ 0, geometryUserPtr @ 8, primID @ 16, context @ 24, rayhit @ 32, N @ 40, geomID @ 44);
    layout!(RTCOccludedFunctionNArguments, size 48, align 8,
        valid @ 0, geometryUserPtr @ 8, primID @ 16, context @ 24, ray @ 32, N @ 40, geomID @ 44);
    layout!(RTCBoundsFunctionArguments, size 24, align 8,
        geometryUserPtr @ 0, primID @ 8, timeStep @ 12, bounds_o @ 16);
}

#[test]
fn bounds() {
    layout!(RTCBounds, size 32, align 16,
        lower_x @ 0, lower_y @ 4, lower_z @ 8, align0 @ 12, upper_x @ 16, upper_y @ 20, upper_z @ 24, align1 @ 28);
}

/// The header that was read and the library that is linked are of the same version, and it is 4.3 or later.
#[test]
fn header_and_library_agree() {
    // SAFETY: rtcNewDevice(3) takes a NUL-terminated configuration; the device is used only while it is held.
    let (major, minor, patch) = unsafe {
        let device = rtcNewDevice(c"threads=1".as_ptr());
        assert!(!device.is_null());
        let version = (
            rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION_MAJOR),
            rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION_MINOR),
            rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION_PATCH),
        );
        rtcReleaseDevice(device);
        version
    };
    assert_eq!((major * 10000 + minor * 100 + patch) as u32, RTC_VERSION);
    const { assert!(RTC_VERSION >= 40300) };
}

/// One level of instancing at least: the wrapper reads `instID[0]` and refuses anything deeper.
#[test]
fn one_instance_level() {
    const { assert!(RTC_MAX_INSTANCE_LEVEL_COUNT >= 1) };
    assert_eq!(RTC_INVALID_GEOMETRY_ID, u32::MAX);
}
