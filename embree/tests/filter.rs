//! Filters, and panics in callbacks.

mod support;

use embree::{
    BuildQuality, CommittedScene, Device, Features, Geometry, Hit, HitFilter, Ray, SceneBuilder, SceneOptions,
    UserGeometry, UserHit,
};
use glam::{Affine3A, Vec3};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use support::{Spheres, close, device, down, triangle};

fn committed(device: &Device, geometries: Vec<Geometry>) -> CommittedScene {
    let mut builder = SceneBuilder::new(device, SceneOptions::default());
    geometries.into_iter().for_each(|geometry| _ = builder.attach(geometry));
    builder.commit().unwrap()
}

/// An alpha mask as a renderer has it, outside the crate: solid where u + v is below a half.
struct Corner;

impl HitFilter for Corner {
    fn accept(&self, hit: &Hit) -> bool {
        hit.u + hit.v < 0.5
    }
}

#[test]
fn rejected_hits_let_the_ray_through() {
    let device = device();
    let scene = committed(&device, vec![triangle(&device, 0.0), triangle(&device, 2.0).with_hit_filter()]);
    assert!(scene.has_filtered_geometry());
    assert_eq!(scene.features(), Features::TRIANGLES | Features::HIT_FILTER);
    assert_eq!(scene.intersect_filtered(&down(0.125, 0.125), &Corner).unwrap().geometry, 1);
    assert_eq!(scene.intersect_filtered(&down(0.5, 0.25), &Corner).unwrap().geometry, 0);
    assert_eq!(scene.intersect(&down(0.5, 0.25)).unwrap().geometry, 1, "unfiltered queries take every hit");
    let above = Ray { t_far: 9.0, ..down(0.5, 0.25) };
    assert!(!scene.occluded_filtered(&above, &Corner));
    assert!(scene.occluded_filtered(&Ray { t_far: 9.0, ..down(0.125, 0.125) }, &Corner));
    assert!(scene.occluded(&above));
}

/// The filter sees the whole hit, and only those of geometry that takes part.
#[test]
fn the_filter_is_shown_the_hit() {
    let device = device();
    let spheres = || Arc::new(Spheres { centers: vec![Vec3::new(0.25, 0.25, -8.0)], radius: 1.0 });
    let user = |device| Geometry::user(device, spheres()).unwrap();
    let transform = Affine3A::from_translation(Vec3::new(0.0, 0.0, -4.0));
    for quality in [BuildQuality::Medium, BuildQuality::High] {
        let mut inner = SceneBuilder::new(&device, SceneOptions { quality, ..SceneOptions::default() });
        inner.attach(triangle(&device, 0.0));
        inner.attach(triangle(&device, -1.0).with_hit_filter());
        let inner = Arc::new(inner.commit().unwrap());
        let mut builder = SceneBuilder::new(&device, SceneOptions { quality, ..SceneOptions::default() });
        builder.attach(triangle(&device, 0.0));
        builder.attach(triangle(&device, 2.0).with_hit_filter());
        builder.attach(user(&device).with_hit_filter());
        builder.attach(user(&device));
        builder.attach(Geometry::instance(&device, inner, transform).unwrap());
        let scene = builder.commit().unwrap();
        let seen = std::cell::RefCell::new(Vec::new());
        let reject = |hit: &Hit| {
            seen.borrow_mut().push(*hit);
            false
        };
        // Beginning below the unfiltered triangle, so that the ray meets all that is filtered from there on.
        let ray = Ray { t_near: 10.5, ..down(0.25, 0.25) };
        let hit = scene.intersect_filtered(&ray, &reject).unwrap();
        assert_eq!((hit.geometry, hit.instance), (0, Some(4)));
        let ray = Ray { t_near: 14.5, ..down(0.25, 0.25) };
        assert_eq!(scene.intersect_filtered(&ray, &reject).unwrap().geometry, 3);
        let seen = seen.into_inner();
        let find = |geometry, instance, t| {
            let same = |hit: &&Hit| (hit.geometry, hit.instance) == (geometry, instance) && close(hit.t, t);
            *seen.iter().find(same).unwrap_or_else(|| panic!("{geometry} {instance:?} {t} is not in {seen:?}"))
        };
        assert_eq!(find(2, None, 17.0).ng, Vec3::Z);
        let instanced = find(1, Some(4), 15.0);
        assert!(close(instanced.u, 0.25) && close(instanced.v, 0.25) && instanced.ng == Vec3::Z, "{instanced:?}");
        assert!(seen.iter().all(|hit| (hit.geometry, hit.instance) != (0, None) && hit.geometry != 3), "{seen:?}");
    }
}

#[test]
fn the_far_side_of_a_filtered_user_primitive_is_found() {
    let device = device();
    let spheres = Arc::new(Spheres { centers: vec![Vec3::ZERO], radius: 1.0 });
    let scene = committed(&device, vec![Geometry::user(&device, spheres).unwrap().with_hit_filter()]);
    let lower_half = |hit: &Hit| hit.ng.z < 0.0;
    assert_eq!(scene.intersect_filtered(&down(0.0, 0.0), &lower_half).unwrap().t, 11.0);
    assert!(scene.occluded_filtered(&down(0.0, 0.0), &lower_half));
    assert!(!scene.occluded_filtered(&Ray { t_far: 10.0, ..down(0.0, 0.0) }, &lower_half));
    assert_eq!(scene.intersect(&down(0.0, 0.0)).unwrap().t, 9.0);
}

#[test]
fn a_filter_without_filtered_geometry_is_never_asked() {
    let device = device();
    let scene = committed(&device, vec![triangle(&device, 0.0)]);
    let never = |_: &Hit| -> bool { unreachable!() };
    assert!(scene.intersect_filtered(&down(0.25, 0.25), &never).is_some());
    assert!(scene.occluded_filtered(&down(0.25, 0.25), &never));
}

/// The panic of a filter arrives at the caller of the query, and the scene goes on working.
#[test]
fn a_panicking_filter_panics_its_own_query() {
    let device = device();
    let scene = committed(&device, vec![triangle(&device, 0.0).with_hit_filter()]);
    let calls = AtomicU32::new(0);
    let panics = |_: &Hit| -> bool {
        calls.fetch_add(1, Ordering::Relaxed);
        std::panic::panic_any("the filter's own words")
    };
    let ray = down(0.25, 0.25);
    let panicked = |query: &dyn Fn()| {
        let payload = catch_unwind(AssertUnwindSafe(query)).unwrap_err();
        assert_eq!(payload.downcast_ref::<&str>(), Some(&"the filter's own words"));
    };
    panicked(&|| _ = scene.intersect_filtered(&ray, &panics));
    panicked(&|| _ = scene.occluded_filtered(&ray, &panics));
    assert_eq!(calls.into_inner(), 2);
    assert!(scene.intersect_filtered(&ray, &|_: &Hit| true).is_some());
}

/// A shape that panics where it is hit left of x = 0.
struct Trap;

impl UserGeometry for Trap {
    fn len(&self) -> usize {
        1
    }

    fn bounds(&self, _: u32) -> (Vec3, Vec3) {
        (-Vec3::ONE, Vec3::ONE)
    }

    fn intersect(&self, _: u32, origin: Vec3, _: Vec3, _: (f32, f32)) -> Option<UserHit> {
        assert!(origin.x >= 0.0, "trapped");
        Some(UserHit { t: 10.0, u: 0.0, v: 0.0, ng: Vec3::Z })
    }
}

#[test]
fn a_panicking_shape_panics_the_query_that_met_it() {
    let device = device();
    let trap = Arc::new(committed(&device, vec![Geometry::user(&device, Arc::new(Trap)).unwrap()]));
    let scene = committed(&device, vec![Geometry::instance(&device, trap, Affine3A::IDENTITY).unwrap()]);
    let trapped = |query: &dyn Fn()| catch_unwind(AssertUnwindSafe(query)).is_err();
    let packet = |x| std::array::from_fn(|_| down(x, 0.0));
    assert!(trapped(&|| _ = scene.intersect(&down(-0.5, 0.0))));
    assert!(trapped(&|| _ = scene.occluded(&down(-0.5, 0.0))));
    assert!(trapped(&|| _ = scene.intersect4(&packet(-0.5))));
    assert!(trapped(&|| _ = scene.occluded4(&packet(-0.5))));
    assert!(!trapped(&|| assert_eq!(scene.intersect(&down(0.5, 0.0)).unwrap().t, 10.0)));
    assert!(!trapped(&|| assert_eq!(scene.occluded4(&packet(0.5)), [true; 4])));
}

/// A shape whose answers lie outside the range, or are no numbers.
struct Liar(f32);

impl UserGeometry for Liar {
    fn len(&self) -> usize {
        1
    }

    fn bounds(&self, _: u32) -> (Vec3, Vec3) {
        (-Vec3::ONE, Vec3::ONE)
    }

    fn intersect(&self, _: u32, _: Vec3, _: Vec3, _: (f32, f32)) -> Option<UserHit> {
        Some(UserHit { t: self.0, u: 0.0, v: 0.0, ng: Vec3::Z })
    }
}

#[test]
fn hits_outside_the_range_are_ignored() {
    let device = device();
    for t in [f32::NAN, -1.0, 4.0, 31.0, f32::INFINITY] {
        let liar = Geometry::user(&device, Arc::new(Liar(t))).unwrap().with_hit_filter();
        let scene = committed(&device, vec![liar]);
        let ray = Ray { t_near: 5.0, t_far: 30.0, ..down(0.0, 0.0) };
        assert_eq!(scene.intersect(&ray), None, "{t}");
        assert!(!scene.occluded(&Ray { t_far: f32::INFINITY, ..ray }) || t == 31.0, "{t}");
    }
    // One that answers the same whatever the range: rejecting it must not loop.
    let stuck = Geometry::user(&device, Arc::new(Liar(10.0))).unwrap().with_hit_filter();
    let scene = committed(&device, vec![stuck]);
    assert_eq!(scene.intersect_filtered(&down(0.0, 0.0), &|_: &Hit| false), None);
}
