//! Known hits on every kind of geometry.

mod support;

use embree::{CurveKind, Error, Features, Geometry, MeshError, Ray, SceneBuilder, SceneOptions};
use glam::{Affine3A, Mat3A, Quat, Vec3};
use std::sync::Arc;
use support::{Spheres, close, device, down, mesh, triangle};

fn committed(device: &embree::Device, geometries: Vec<Geometry>) -> embree::CommittedScene {
    let mut builder = SceneBuilder::new(device, SceneOptions::default());
    for (expected, geometry) in geometries.into_iter().enumerate() {
        assert_eq!(builder.attach(geometry), expected as u32);
    }
    builder.commit().unwrap()
}

#[test]
fn the_closest_triangle_is_hit_with_its_barycentrics() {
    let device = device();
    let scene = committed(&device, vec![triangle(&device, 0.0), triangle(&device, 2.0)]);
    let hit = scene.intersect(&down(0.25, 0.5)).unwrap();
    assert!(close(hit.t, 8.0) && close(hit.u, 0.25) && close(hit.v, 0.5), "{hit:?}");
    assert_eq!((hit.geometry, hit.primitive, hit.instance), (1, 0, None));
    // (p1 - p0) × (p2 - p0), towards the side from which the triangle is counter-clockwise.
    assert_eq!(hit.ng, Vec3::Z);
    assert_eq!(scene.intersect(&down(0.75, 0.5)), None);
    assert_eq!(scene.bounds(), (Vec3::ZERO, Vec3::new(1.0, 1.0, 2.0)));
    assert_eq!(scene.features(), Features::TRIANGLES);
}

#[test]
fn both_sides_are_hit_and_t_counts_in_lengths_of_the_direction() {
    let device = device();
    let scene = committed(&device, vec![triangle(&device, 0.0)]);
    let hit = scene.intersect(&Ray::new(Vec3::new(0.25, 0.25, -3.0), 2.0 * Vec3::Z)).unwrap();
    assert!(close(hit.t, 1.5) && hit.ng == Vec3::Z, "{hit:?}");
}

#[test]
fn only_the_range_counts() {
    let device = device();
    let scene = committed(&device, vec![triangle(&device, 0.0), triangle(&device, 2.0)]);
    let range = |t_near, t_far| Ray { t_near, t_far, ..down(0.25, 0.25) };
    assert!(close(scene.intersect(&range(8.5, f32::INFINITY)).unwrap().t, 10.0));
    for (ray, expected) in [
        (range(0.0, 7.9), false),
        (range(0.0, 8.1), true),
        (range(8.1, 9.9), false),
        (range(10.1, f32::INFINITY), false),
        (range(9.0, 8.0), false), // empty
        (range(-5.0, 8.1), true), // what is behind the origin is left out
        (range(-5.0, -1.0), false),
        (range(f32::NAN, f32::INFINITY), true),
    ] {
        assert_eq!(scene.occluded(&ray), expected, "{ray:?}");
        assert_eq!(scene.intersect(&ray).is_some(), expected, "{ray:?}");
    }
}

#[test]
fn an_empty_scene_is_missed() {
    let device = device();
    let scene = committed(&device, vec![]);
    assert_eq!(scene.intersect(&down(0.0, 0.0)), None);
    assert!(!scene.occluded(&down(0.0, 0.0)));
    assert_eq!(scene.bounds(), (Vec3::INFINITY, Vec3::NEG_INFINITY));
    assert_eq!(scene.features(), Features::NONE);
    let hollow = committed(&device, vec![mesh(&device, vec![], vec![])]);
    assert_eq!(hollow.intersect(&down(0.0, 0.0)), None);
}

#[test]
fn a_flat_curve_faces_the_ray() {
    let device = device();
    let control = [0.0, 1.0, 2.0, 3.0].map(|x| [x, 0.0, 0.0, 0.5]);
    let curve = Geometry::curves(&device, CurveKind::FlatBezier, control.to_vec(), vec![0], None).unwrap();
    let scene = committed(&device, vec![curve]);
    let hit = scene.intersect(&down(1.5, 0.25)).unwrap();
    assert!((hit.u - 0.5).abs() < 1e-3, "{hit:?}"); // the ribbon is a few quads
    assert!((hit.v.abs() - 0.5).abs() < 1e-3, "{hit:?}");
    assert!((hit.t - 10.0).abs() < 1e-3, "{hit:?}");
    assert_eq!(scene.intersect(&down(1.5, 0.6)), None);
    assert_eq!(scene.features(), Features::FLAT_BEZIER_CURVES);
}

#[test]
fn a_normal_oriented_curve_vanishes_seen_from_its_edge() {
    let device = device();
    let control = [0.0, 1.0, 2.0, 3.0].map(|x| [x, 0.0, 0.0, 0.5]).to_vec();
    let kind = CurveKind::NormalOrientedBezier;
    let ribbon = |normal| Geometry::curves(&device, kind, control.clone(), vec![0], Some(vec![normal; 4])).unwrap();
    let facing = committed(&device, vec![ribbon([0.0, 0.0, 1.0])]);
    let hit = facing.intersect(&down(1.5, 0.3)).unwrap();
    assert!(hit.ng.normalize().dot(Vec3::Z).abs() > 0.999, "{hit:?}");
    assert_eq!(committed(&device, vec![ribbon([0.0, 1.0, 0.0])]).intersect(&down(1.5, 0.3)), None);
    assert_eq!(facing.features(), Features::NORMAL_ORIENTED_BEZIER_CURVES);
}

#[test]
fn a_user_sphere_is_hit_from_outside_and_inside() {
    let device = device();
    let spheres = Spheres { centers: vec![Vec3::ZERO, 4.0 * Vec3::X], radius: 1.0 };
    let scene = committed(&device, vec![Geometry::user(&device, Arc::new(spheres)).unwrap()]);
    let hit = scene.intersect(&down(4.0, 0.0)).unwrap();
    assert_eq!((hit.t, hit.ng, hit.primitive, hit.instance), (9.0, Vec3::Z, 1, None));
    assert_eq!(scene.intersect(&Ray { t_near: 9.5, ..down(0.0, 0.0) }).unwrap().t, 11.0);
    assert!(scene.occluded(&down(0.5, 0.5)));
    assert!(!scene.occluded(&down(2.0, 0.0)));
    assert_eq!(scene.bounds(), (-Vec3::ONE, Vec3::new(5.0, 1.0, 1.0)));
    assert_eq!(scene.features(), Features::USER_GEOMETRY);
}

#[test]
fn instances_mirror_scale_and_keep_the_normal_in_object_space() {
    let device = device();
    let spheres = Spheres { centers: vec![Vec3::ZERO], radius: 1.0 };
    let object =
        Arc::new(committed(&device, vec![triangle(&device, 0.0), Geometry::user(&device, Arc::new(spheres)).unwrap()]));
    // Mirrored in x, three times as large, turned by a right angle about z, moved: (x, y) goes to (-3y + 9, -3x).
    let linear = Mat3A::from_quat(Quat::from_rotation_z(std::f32::consts::FRAC_PI_2))
        * Mat3A::from_diagonal(Vec3::new(-3.0, 3.0, 3.0));
    let world_from_object = Affine3A::from_mat3_translation(linear.into(), Vec3::new(9.0, 0.0, 0.0));
    let instances = [Affine3A::from_translation(Vec3::new(100.0, 0.0, 0.0)), world_from_object];
    let instances = instances.map(|t| Geometry::instance(&device, Arc::clone(&object), t).unwrap());
    let scene = committed(&device, instances.into());
    assert_eq!(scene.features(), Features::TRIANGLES | Features::USER_GEOMETRY | Features::INSTANCES);

    // Object point (0.25, 0.5, 0), approached from below inside the sphere.
    let p = world_from_object.transform_point3(Vec3::new(0.25, 0.5, 0.0));
    let hit = scene.intersect(&Ray::new(p - 0.5 * Vec3::Z, Vec3::Z)).unwrap();
    assert!((hit.t - 0.5).abs() < 1e-6 && (hit.u - 0.25).abs() < 1e-6 && (hit.v - 0.5).abs() < 1e-6, "{hit:?}");
    assert_eq!((hit.ng, hit.instance, hit.geometry), (Vec3::Z, Some(1), 0));

    // The sphere has world radius 3.
    let hit = scene.intersect(&down(9.0, 0.0)).unwrap();
    assert_eq!((hit.instance, hit.geometry), (Some(1), 1));
    assert!((hit.t - 7.0).abs() < 1e-5 && hit.ng.distance(Vec3::Z) < 1e-5, "{hit:?}");
    let (lower, upper) = scene.bounds();
    assert!(lower.x <= 6.0 && upper.x >= 101.0 && lower.x > 5.99 && upper.x < 101.01, "{lower} {upper}");
}

#[test]
fn packets_see_what_single_rays_see() {
    let device = device();
    let spheres = Spheres { centers: vec![Vec3::new(3.0, 0.0, 0.0)], radius: 1.0 };
    let object = Arc::new(committed(&device, vec![triangle(&device, 0.0)]));
    let transform = Affine3A::from_translation(Vec3::new(-1.0, -1.0, 0.5));
    let geometries = vec![
        triangle(&device, 1.0),
        Geometry::user(&device, Arc::new(spheres)).unwrap(),
        Geometry::instance(&device, object, transform).unwrap(),
    ];
    let scene = committed(&device, geometries);
    let rays = [
        down(0.25, 0.25),
        down(3.0, 0.0),
        down(-0.75, -0.75),
        down(5.0, 5.0),
        Ray { t_far: 1.0, ..down(0.25, 0.25) },
        Ray { t_near: 2.0, t_far: 1.0, ..down(0.25, 0.25) },
        Ray { t_near: 10.0, ..down(3.0, 0.0) },
        Ray { t_far: 10.0, ..down(0.125, 0.25) },
    ];
    let hits = scene.intersect8(&rays);
    assert_eq!(hits.map(|hit| hit.is_some()), [true, true, true, false, false, false, true, true]);
    assert_eq!(scene.occluded8(&rays), hits.map(|hit| hit.is_some()));
    for (ray, hit) in rays.iter().zip(hits) {
        let single = scene.intersect(ray);
        let key = |hit: embree::Hit| (hit.geometry, hit.primitive, hit.instance);
        assert_eq!(hit.map(key), single.map(key), "{ray:?}");
        assert!(hit.zip(single).is_none_or(|(a, b)| close(a.t, b.t)), "{hit:?} {single:?}");
        assert_eq!(hit.is_some(), scene.occluded(ray), "{ray:?}");
    }
    let four = [rays[0], rays[1], rays[4], rays[2]];
    assert_eq!(scene.intersect4(&four), [hits[0], hits[1], hits[4], hits[2]]);
    assert_eq!(scene.occluded4(&four), [true, true, false, true]);
}

#[test]
fn what_cannot_be_traced_is_refused() {
    let device = device();
    let vertices = embree::VertexBuffer::new(vec![[0.0; 3]; 3]).unwrap();
    let triangles = embree::TriangleIndices::new(vec![[0, 1, 3]], 4).unwrap();
    let error = Geometry::triangles(&device, vertices, triangles).err().unwrap();
    assert_eq!(error, Error::Mesh(MeshError::FewerVertices { checked: 4, vertex_count: 3 }));

    let object = Arc::new(committed(&device, vec![triangle(&device, 0.0)]));
    let flat = Affine3A::from_scale(Vec3::new(1.0, 1.0, 0.0));
    let error = Geometry::instance(&device, Arc::clone(&object), flat).err().unwrap();
    assert!(matches!(error, Error::SingularTransform { .. }), "{error}");
    let nan = Affine3A::from_translation(Vec3::NAN);
    assert!(Geometry::instance(&device, Arc::clone(&object), nan).is_err());

    let once = Geometry::instance(&device, Arc::clone(&object), Affine3A::IDENTITY).unwrap();
    let nested = Arc::new(committed(&device, vec![once]));
    assert_eq!(Geometry::instance(&device, nested, Affine3A::IDENTITY).err(), Some(Error::NestedInstance));

    let stranger = support::device();
    assert_eq!(Geometry::instance(&stranger, object, Affine3A::IDENTITY).err(), Some(Error::ForeignScene));
    let mut builder = SceneBuilder::new(&device, SceneOptions::default());
    builder.attach(triangle(&device, 0.0));
    builder.attach(triangle(&stranger, 0.0));
    assert_eq!(builder.commit().err(), Some(Error::ForeignGeometry { geometry: 1 }));
}

#[test]
fn bad_curves_are_refused() {
    let device = device();
    let point = [0.0, 0.0, 0.0, 1.0];
    let curves =
        |kind, control: Vec<[f32; 4]>, first, normals| match Geometry::curves(&device, kind, control, first, normals)
            .err()
        {
            Some(Error::Mesh(error)) => error,
            other => panic!("{other:?}"),
        };
    use CurveKind::{FlatBezier, NormalOrientedBezier};
    assert_eq!(
        curves(FlatBezier, vec![point; 5], vec![1, 2], None),
        MeshError::CurveOutOfRange { curve: 1, first: 2, count: 5 }
    );
    assert!(matches!(
        curves(FlatBezier, vec![point, [0.0, 0.0, 0.0, f32::INFINITY], point, point], vec![0], None),
        MeshError::NonFiniteRadius { point: 1, .. }
    ));
    assert_eq!(
        curves(NormalOrientedBezier, vec![point; 4], vec![0], None),
        MeshError::CurveNormals { needed: 4, count: 0 }
    );
    assert_eq!(
        curves(FlatBezier, vec![point; 4], vec![0], Some(vec![[0.0; 3]; 4])),
        MeshError::CurveNormals { needed: 0, count: 4 }
    );
}

#[test]
fn user_bounds_that_embree_would_ignore_are_refused() {
    let device = device();
    let spheres = Spheres { centers: vec![Vec3::ZERO, Vec3::NAN], radius: 1.0 };
    let error = Geometry::user(&device, Arc::new(spheres)).err().unwrap();
    assert!(matches!(error, Error::Mesh(MeshError::UserBounds { primitive: 1, .. })), "{error}");
    let inverted = Spheres { centers: vec![Vec3::ZERO], radius: -1.0 };
    assert!(Geometry::user(&device, Arc::new(inverted)).is_err());
}

/// Embree's memory grows by its acceleration structure, not by the shared buffers, and is given back.
#[test]
fn memory_is_monitored_and_given_back() {
    let device = device();
    let before = device.memory().current;
    let positions: Vec<_> = (0..30_000).map(|i| [(i % 173) as f32, (i % 211) as f32, i as f32]).collect();
    let triangles = (0..10_000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let mesh = mesh(&device, positions, triangles);
    // The mesh has 480 kB.
    assert!(device.memory().current - before < 10_000, "{before} {:?}", device.memory());
    let scene = committed(&device, vec![mesh]);
    let during = device.memory();
    assert!(during.current > before && during.peak >= during.current, "{during:?}");
    drop(scene);
    assert!(device.memory().current <= before, "{:?} after {during:?}", device.memory());
    assert_eq!(device.memory().peak, during.peak);
}
