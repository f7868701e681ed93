use std::path::Path;

use glam::{Mat3, Vec2, Vec3};

use super::*;
use crate::math::Rgb;
use crate::scene::description::*;
use crate::spectrum::Spectrum;

/// A scene read without an error or a warning.
fn scene(text: &str) -> Scene {
    match parse(text.as_bytes(), Path::new(""), "test.pbrt") {
        Ok((scene, warnings)) if warnings.is_empty() => scene,
        Ok((_, all)) | Err(all) => panic!("{}", all.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")),
    }
}

/// A scene of these directives after `WorldBegin`.
fn world(text: &str) -> Scene {
    scene(&format!("WorldBegin\n{text}"))
}

fn material(text: &str) -> MaterialKind {
    world(text).materials.pop().unwrap().kind
}

fn light(text: &str) -> LightKind {
    world(text).lights.pop().unwrap().kind
}

/// Where a shape's origin is.
fn origin(shape: &Shape) -> Vec3 {
    shape.world_from_shape.point(Vec3::ZERO)
}

#[test]
fn an_empty_world_has_the_defaults_of_pbrt() {
    let scene = world("");
    assert_eq!(scene.camera.kind, CameraKind::Perspective { fov: 90.0 });
    assert_eq!((scene.camera.lens_radius, scene.camera.focal_distance), (0.0, 1e6));
    assert_eq!((scene.film.resolution, scene.film.sensor), ([1280, 720], Mat3::IDENTITY));
    assert_eq!(scene.film.max_component_value, f32::INFINITY);
    assert_eq!(scene.filter.kind, PixelFilterKind::Gaussian { sigma: 0.5 });
    assert_eq!(scene.filter.radius, Vec2::splat(1.5));
    assert_eq!((scene.spp, scene.seed), (16, 0));
    assert_eq!(scene.integrator, Integrator { max_depth: 5, regularize: false });
    let [Material { kind: MaterialKind::Diffuse { reflectance }, .. }] = &scene.materials[..] else { panic!() };
    assert_eq!(*reflectance, Value::Constant(Rgb::splat(0.5)));
}

#[test]
fn the_camera_looks_from_where_the_transforms_put_it() {
    let scene = scene("LookAt 1 2 3  1 2 0  0 1 0 Camera \"perspective\" WorldBegin");
    assert_eq!(scene.camera.world_from_camera.point(Vec3::ZERO), Vec3::new(1.0, 2.0, 3.0));
    assert!((scene.camera.world_from_camera.vector(Vec3::Z) - Vec3::NEG_Z).length() < 1e-6);
}

#[test]
fn the_sensor_scales_by_exposure_time_and_iso() {
    let scene = scene(
        "Camera \"perspective\" \"float shutteropen\" 1 \"float shutterclose\" 3 Film \"rgb\" \"float iso\" 50 WorldBegin",
    );
    assert_eq!(scene.film.sensor, Mat3::IDENTITY);
    let balanced = self::scene("Film \"rgb\" \"float iso\" 200 \"float whitebalance\" 6500 WorldBegin").film.sensor;
    // 6500 K is almost the white of Rec.709.
    assert!((balanced * Rgb::ONE - Rgb::splat(2.0)).abs().max_element() < 0.02, "{balanced}");
    let warm = self::scene("Film \"rgb\" \"float whitebalance\" 3200 WorldBegin").film.sensor * Rgb::ONE;
    assert!(warm.z > 1.2 && warm.x < 1.0, "a white of 6500 K is blue to a sensor balanced for 3200 K: {warm}");
}

#[test]
fn filters_have_their_own_defaults() {
    let third = 1.0 / 3.0;
    for (name, radius, kind) in [
        ("box", 0.5, PixelFilterKind::Box),
        ("triangle", 2.0, PixelFilterKind::Triangle),
        ("mitchell", 2.0, PixelFilterKind::Mitchell { b: third, c: third }),
        ("sinc", 4.0, PixelFilterKind::LanczosSinc { tau: 3.0 }),
    ] {
        let filter = scene(&format!("PixelFilter \"{name}\" \"float yradius\" 1 WorldBegin")).filter;
        assert_eq!((filter.kind, filter.radius), (kind, Vec2::new(radius, 1.0)), "{name}");
    }
}

#[test]
fn samplers_tell_their_number_and_seed() {
    for (text, spp, seed) in [
        ("Sampler \"independent\"", 4, 0),
        ("Sampler \"stratified\" \"integer xsamples\" 3", 12, 0),
        ("Sampler \"zsobol\" \"integer pixelsamples\" 64 \"integer seed\" 9 Option \"seed\" 8", 64, 9),
        ("Option \"seed\" -1 Sampler \"pmj02bn\"", 16, 0xffff_ffff),
    ] {
        let scene = scene(&format!("{text} WorldBegin"));
        assert_eq!((scene.spp, scene.seed), (spp, seed), "{text}");
    }
}

#[test]
fn transforms_compose_in_the_order_of_the_file() {
    let scene = world(
        "Translate 1 0 0 Scale 2 2 2 Translate 0 1 0 Shape \"sphere\"
         Identity Transform [ 1 0 0 0 0 1 0 0 0 0 1 0 7 8 9 1 ] Shape \"sphere\"
         ConcatTransform [ 1 0 0 0 0 1 0 0 0 0 1 0 1 1 1 1 ] Rotate 90 0 0 1 Shape \"sphere\"
         CoordSysTransform \"world\" Shape \"sphere\"",
    );
    let origins: Vec<Vec3> = scene.shapes.iter().map(origin).collect();
    assert_eq!(origins, [Vec3::new(1.0, 2.0, 0.0), Vec3::new(7.0, 8.0, 9.0), Vec3::new(8.0, 9.0, 10.0), Vec3::ZERO]);
    assert!((scene.shapes[2].world_from_shape.vector(Vec3::X) - Vec3::Y).length() < 1e-6);
}

#[test]
fn coordinate_systems_are_remembered_and_the_camera_has_one() {
    let scene = scene(
        "Translate 0 0 -4 Camera \"perspective\" Translate 3 0 0 CoordinateSystem \"mine\" WorldBegin
         CoordSysTransform \"camera\" Shape \"sphere\" CoordSysTransform \"mine\" Shape \"sphere\"",
    );
    assert_eq!(origin(&scene.shapes[0]), Vec3::new(0.0, 0.0, 4.0));
    assert_eq!(origin(&scene.shapes[1]), Vec3::new(3.0, 0.0, -4.0));
}

#[test]
fn attributes_are_restored() {
    let scene = world(
        "Material \"thindielectric\"
         AttributeBegin
           Translate 1 0 0 ReverseOrientation Material \"interface\" Attribute \"shape\" \"float radius\" 3
           Shape \"sphere\" Shape \"sphere\" \"float radius\" 2
         AttributeEnd
         Shape \"sphere\"",
    );
    let radius = |shape: &Shape| match shape.kind {
        ShapeKind::Sphere { radius, .. } => radius,
        _ => panic!("not a sphere"),
    };
    assert_eq!(scene.shapes.iter().map(radius).collect::<Vec<_>>(), [3.0, 2.0, 1.0]);
    assert_eq!(scene.shapes.iter().map(|s| s.reverse_orientation).collect::<Vec<_>>(), [true, true, false]);
    assert_eq!(origin(&scene.shapes[2]), Vec3::ZERO);
    let kind = |shape: &Shape| &scene.materials[shape.material.index()].kind;
    assert!(matches!(kind(&scene.shapes[0]), MaterialKind::Interface));
    assert!(matches!(kind(&scene.shapes[2]), MaterialKind::ThinDielectric { eta } if *eta == 1.5));
}

#[test]
fn area_lights_stay_with_their_block() {
    let scene = world(
        "AttributeBegin AreaLightSource \"diffuse\" \"rgb L\" [ 2 3 4 ] \"float scale\" 2 \"bool twosided\" true
         Shape \"disk\" AttributeEnd Shape \"disk\"",
    );
    assert_eq!(scene.shapes.iter().map(|s| s.area_light).collect::<Vec<_>>(), [Some(AreaLightId(0)), None]);
    assert_eq!((scene.area_lights[0].radiance, scene.area_lights[0].two_sided), (Rgb::new(4.0, 6.0, 8.0), true));
}

#[test]
fn objects_are_placed_and_nested_ones_become_flat() {
    let scene = world(
        "ObjectBegin \"inner\" Translate 0 0 1 Shape \"sphere\" ObjectEnd
         ObjectBegin \"outer\" Shape \"disk\" Translate 0 1 0 ObjectInstance \"inner\" ObjectEnd
         ObjectBegin \"group\" ObjectInstance \"outer\" Translate 5 0 0 ObjectInstance \"outer\" ObjectEnd
         Translate 1 0 0 ObjectInstance \"group\"",
    );
    assert!(scene.shapes.is_empty());
    assert_eq!(origin(&scene.objects[0].shapes[0]), Vec3::Z);
    let placed: Vec<(u32, Vec3)> =
        scene.instances.iter().map(|i| (i.object.0, i.world_from_object.point(Vec3::ZERO))).collect();
    let at = Vec3::new;
    let expected = [(1, at(1.0, 0.0, 0.0)), (0, at(1.0, 1.0, 0.0)), (1, at(6.0, 0.0, 0.0)), (0, at(6.0, 1.0, 0.0))];
    assert_eq!(placed, expected);
}

#[test]
fn instances_that_multiply_without_end_are_refused() {
    let mut text = String::from("WorldBegin ObjectBegin \"0\" Shape \"sphere\" ObjectEnd\n");
    for level in 1..60 {
        let inner = format!("ObjectInstance \"{}\" ", level - 1).repeat(2);
        text += &format!("ObjectBegin \"{level}\" {inner} ObjectEnd\n");
    }
    text += "ObjectInstance \"59\"";
    let all = parse(text.as_bytes(), Path::new(""), "test.pbrt").unwrap_err();
    assert!(all[0].message.contains("instances"), "{}", all[0]);
}

#[test]
fn shapes_have_their_parameters() {
    let kind = |text: &str| world(&format!("Shape {text}")).shapes.pop().unwrap().kind;
    assert!(matches!(
        kind("\"sphere\" \"float radius\" 2 \"float zmin\" -9 \"float zmax\" 1"),
        ShapeKind::Sphere { radius, z_min, z_max, phi_max }
            if (radius, z_min, z_max, phi_max) == (2.0, -2.0, 1.0, 360.0)
    ));
    assert!(matches!(
        kind("\"cylinder\" \"float zmin\" 3"),
        ShapeKind::Cylinder { radius, z_min, z_max, .. } if (radius, z_min, z_max) == (1.0, 1.0, 3.0)
    ));
    assert!(matches!(
        kind("\"disk\" \"float height\" 2 \"float innerradius\" 0.5 \"float phimax\" 90"),
        ShapeKind::Disk { height, radius, inner_radius, phi_max }
            if (height, radius, inner_radius, phi_max) == (2.0, 1.0, 0.5, 90.0)
    ));
    let ShapeKind::Triangles(mesh) = kind(
        "\"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"point2 uv\" [0 0 1 0 0 1] \"normal N\" [0 0 1 0 0 1 0 0 1]",
    ) else {
        panic!("not triangles")
    };
    assert_eq!((mesh.indices, mesh.positions[1], mesh.uvs[2]), (vec![[0, 1, 2]], Vec3::X, Vec2::Y));
    assert_eq!(mesh.normals, [Vec3::Z; 3]);
    let ShapeKind::Curve(curve) = kind(
        "\"curve\" \"string type\" \"cylinder\" \"float width\" 2 \"float width1\" 1
         \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0 4 0 0 5 0 0 6 0 0]",
    ) else {
        panic!("not a curve")
    };
    assert_eq!((curve.kind, curve.width, curve.control.len()), (CurveKind::Cylinder, [2.0, 1.0], 2));
    assert_eq!(curve.control[0][3], curve.control[1][0]);
}

#[test]
fn alpha_of_one_is_none() {
    let alpha = |text: &str| world(&format!("Shape \"sphere\" {text}")).shapes.pop().unwrap().alpha;
    assert_eq!(alpha(""), None);
    assert_eq!(alpha("\"float alpha\" 1"), None);
    assert_eq!(alpha("\"float alpha\" 0"), Some(Value::Constant(0.0)));
}

#[test]
fn materials_have_their_parameters() {
    let MaterialKind::CoatedDiffuse { coat, .. } = material("Material \"coateddiffuse\" \"float roughness\" 0.3")
    else {
        panic!()
    };
    assert_eq!((coat.eta, &coat.thickness, &coat.g), (1.5, &Value::Constant(0.01), &Value::Constant(0.0)));
    assert_eq!((&coat.roughness.u, coat.roughness.remap), (&Value::Constant(0.3), true));

    let MaterialKind::Conductor { conductor: Conductor::EtaK { eta, .. }, roughness } = material(
        "Material \"conductor\" \"float roughness\" 0.3 \"float vroughness\" 0.1 \"bool remaproughness\" false",
    ) else {
        panic!()
    };
    assert_eq!(eta, Value::Constant(crate::spectrum::named("metal-Cu-eta").unwrap()));
    assert_eq!((roughness.u, roughness.v, roughness.remap), (Value::Constant(0.3), Value::Constant(0.1), false));

    assert!(matches!(
        material("Material \"conductor\" \"rgb reflectance\" [ 0.9 0.8 0.7 ]"),
        MaterialKind::Conductor { conductor: Conductor::Reflectance(Value::Constant(rgb)), .. }
            if rgb == Rgb::new(0.9, 0.8, 0.7)
    ));
    assert!(matches!(
        material("Material \"coatedconductor\" \"float interface.eta\" 1.3 \"float conductor.roughness\" 0.5"),
        MaterialKind::CoatedConductor { coat: Coat { eta: 1.3, .. }, conductor_roughness: Roughness { u, .. }, .. }
            if u == Value::Constant(0.5)
    ));
    assert!(matches!(
        material("Material \"diffusetransmission\" \"float scale\" 2"),
        MaterialKind::DiffuseTransmission { reflectance: Value::Constant(r), .. } if r == Rgb::splat(0.5)
    ));
}

#[test]
fn a_mix_comes_after_what_it_mixes() {
    let scene = world(
        "Material \"mix\" \"string materials\" [ \"b\" \"a\" ] \"float amount\" 0.25 Shape \"sphere\"
         MakeNamedMaterial \"a\" \"string type\" \"mix\" \"string materials\" [ \"b\" \"c\" ]
         MakeNamedMaterial \"b\" \"string type\" \"diffuse\" MakeNamedMaterial \"c\" \"string type\" \"interface\"",
    );
    for (index, material) in scene.materials.iter().enumerate() {
        if let MaterialKind::Mix { materials, .. } = &material.kind {
            assert!(materials.iter().all(|id| id.index() < index));
        }
    }
    assert!(matches!(
        &scene.materials[scene.shapes[0].material.index()].kind,
        MaterialKind::Mix { amount: Value::Constant(0.25), .. }
    ));
}

#[test]
fn textures_come_after_what_they_use() {
    let scene = world(
        "Texture \"late\" \"spectrum\" \"scale\" \"texture tex\" \"rgb\" \"texture scale\" \"k\"
         Texture \"rgb\" \"spectrum\" \"constant\" \"rgb value\" [ 0.1 0.2 0.3 ]
         Texture \"k\" \"float\" \"constant\" \"float value\" 2
         Material \"diffuse\" \"texture reflectance\" \"late\"",
    );
    let names: Vec<&str> = scene.textures.iter().map(|texture| texture.name.as_str()).collect();
    assert_eq!(names, ["rgb", "k", "late"]);
    assert!(matches!(
        scene.textures[2].kind,
        TextureKind::Scale { tex: Value::Texture(TextureId(0)), scale: Value::Texture(TextureId(1)) }
    ));
    let MaterialKind::Diffuse { reflectance } = &scene.materials[1].kind else { panic!() };
    assert_eq!(*reflectance, Value::Texture(TextureId(2)));
}

#[test]
fn textures_have_their_parameters() {
    let kind = |text: &str| world(&format!("Translate 1 0 0 Texture \"t\" {text}")).textures.pop().unwrap().kind;
    assert!(matches!(
        kind("\"float\" \"bilerp\" \"float v10\" 0.25 \"float uscale\" 2 \"float vdelta\" 3"),
        TextureKind::Bilerp { corners, mapping: Mapping2D::Uv { scale, delta } }
            if corners == [0.0, 0.25, 1.0, 1.0].map(Rgb::splat)
                && scale == Vec2::new(2.0, 1.0)
                && delta == Vec2::new(0.0, 3.0)
    ));
    assert!(matches!(
        kind("\"float\" \"directionmix\" \"float tex1\" 0.25 \"vector3 dir\" [ 0 0 2 ]"),
        TextureKind::DirectionMix { tex1: Value::Constant(across), tex2: Value::Constant(along), dir }
            if across == Rgb::ONE && along == Rgb::splat(0.25) && dir == Vec3::Z
    ));
    let TextureKind::Checkerboard { mapping: Mapping::Three(texture_from_world), .. } =
        kind("\"spectrum\" \"checkerboard\" \"integer dimension\" 3")
    else {
        panic!()
    };
    assert_eq!(texture_from_world.point(Vec3::X), Vec3::ZERO);
    assert!(matches!(
        kind("\"spectrum\" \"marble\" \"float roughness\" 0.3 \"integer octaves\" 4"),
        TextureKind::Marble { octaves: 4, omega, scale, variation, .. }
            if (omega, scale, variation) == (0.3, 1.0, 0.2)
    ));
}

#[test]
fn image_textures_keep_how_they_are_looked_up() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.png"), b"").unwrap();
    let text = "WorldBegin Texture \"t\" \"float\" \"imagemap\" \"string filename\" \"a.png\" \"string wrap\" \"clamp\"
        \"string filter\" \"EWA\" \"float scale\" 2 \"bool invert\" true \"string encoding\" \"gamma 2.2\"";
    let (scene, warnings) = parse(text.as_bytes(), folder.path(), "test.pbrt").unwrap();
    assert!(warnings.is_empty());
    let TextureKind::Image(image) = &scene.textures[0].kind else { panic!() };
    assert_eq!(image.path, folder.path().join("a.png"));
    assert_eq!((image.wrap, image.filter), (Wrap::Clamp, TextureFilter::Ewa));
    assert_eq!(image.encoding, Some(Encoding::Gamma(2.2)));
    assert!(image.invert && image.monochrome && image.scale == 2.0);
}

#[test]
fn light_spectra_keep_the_level_of_rgb_and_have_luminance_one_otherwise() {
    let LightKind::Point { intensity, power, .. } =
        light("LightSource \"point\" \"rgb I\" [ 2 4 6 ] \"float scale\" 0.5 \"float power\" 7")
    else {
        panic!()
    };
    assert_eq!((intensity, power), (Rgb::new(1.0, 2.0, 3.0), Some(7.0)));
    let LightKind::Point { intensity, .. } = light("LightSource \"point\" \"blackbody I\" 3000 \"float scale\" 10")
    else {
        panic!()
    };
    assert!((crate::math::luminance(intensity) - 10.0).abs() < 1e-3 && intensity.x > intensity.z);
    let LightKind::Infinite { radiance, illuminance: None, image: None, .. } = light("LightSource \"infinite\"") else {
        panic!()
    };
    assert_eq!(radiance, Rgb::ONE);
}

#[test]
fn directed_lights_have_their_axis() {
    assert!(matches!(
        light("LightSource \"spot\" \"point3 from\" [ 1 0 0 ] \"float conedeltaangle\" 40"),
        LightKind::Spot { from: Vec3::X, to: Vec3::Z, cone_angle, cone_delta_angle, .. }
            if (cone_angle, cone_delta_angle) == (30.0, 30.0)
    ));
    assert!(matches!(
        light("LightSource \"distant\" \"float illuminance\" -1"),
        LightKind::Distant { from: Vec3::ZERO, to: Vec3::Z, illuminance: None, .. }
    ));
}

#[test]
fn colour_spaces_become_rec709() {
    let reflectance = |text: &str| match material(text) {
        MaterialKind::Diffuse { reflectance: Value::Constant(rgb) } => rgb,
        other => panic!("{other:?}"),
    };
    let grey = reflectance("ColorSpace \"aces2065-1\" Material \"diffuse\" \"rgb reflectance\" [ 0.5 0.5 0.5 ]");
    assert!((grey - Rgb::splat(0.5)).abs().max_element() < 1e-4, "{grey}");
    let red = reflectance("ColorSpace \"rec2020\" Material \"diffuse\" \"rgb reflectance\" [ 0.5 0.3 0.3 ]");
    assert!(red.x > 0.5 && red.y < 0.3, "a red of a wider space is a deeper one: {red}");
    // `Attribute` keeps the space that was in force where it stands.
    let kept = reflectance(
        "ColorSpace \"rec2020\" Attribute \"material\" \"rgb reflectance\" [ 0.5 0.3 0.3 ]
         ColorSpace \"srgb\" Material \"diffuse\"",
    );
    assert_eq!(kept, red);
}

#[test]
fn spectra_come_as_numbers_names_and_files() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("k.spd"), "400 1 # blue\n700 2").unwrap();
    let text = "WorldBegin Material \"conductor\" \"spectrum eta\" [ 400 0.5 700 0.5 ] \"spectrum k\" \"k.spd\"";
    let (scene, _) = parse(text.as_bytes(), folder.path(), "test.pbrt").unwrap();
    let MaterialKind::Conductor { conductor: Conductor::EtaK { eta, k }, .. } = &scene.materials[1].kind else {
        panic!()
    };
    let sampled = |samples: &[(f32, f32)]| Value::Constant(Spectrum::sampled(samples).unwrap());
    assert_eq!(*eta, sampled(&[(400.0, 0.5), (700.0, 0.5)]));
    assert_eq!(*k, sampled(&[(400.0, 1.0), (700.0, 2.0)]));
}

#[test]
fn media_are_kept_with_the_shapes_between_them() {
    let text = "WorldBegin MakeNamedMedium \"fog\" \"string type\" \"homogeneous\" MediumInterface \"\" \"fog\"
        Shape \"sphere\" MediumInterface \"fog\" Shape \"sphere\"";
    let (scene, warnings) = parse(text.as_bytes(), Path::new(""), "test.pbrt").unwrap();
    assert_eq!(warnings.len(), 1);
    assert_eq!((scene.media[0].name.as_str(), scene.media[0].kind.as_str()), ("fog", "homogeneous"));
    assert_eq!(scene.shapes[0].media, [None, Some(MediumId(0))]);
    assert_eq!(scene.shapes[1].media, [Some(MediumId(0)); 2]);
}

#[test]
fn imports_do_not_change_the_state_and_includes_do() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("parts")).unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("parts/a.pbrt", "Translate 1 0 0 Shape \"sphere\"");
    // Relative to its own folder, since there is no such file in the scene's.
    write("parts/b.pbrt", "Include \"a.pbrt\"");
    write("scene.pbrt", "WorldBegin Import \"parts/b.pbrt\" Shape \"disk\" Include \"parts/b.pbrt\" Shape \"disk\"");
    let (scene, warnings) = load(&folder.path().join("scene.pbrt")).unwrap();
    assert!(warnings.is_empty());
    assert_eq!(scene.shapes.iter().map(|s| origin(s).x).collect::<Vec<_>>(), [1.0, 0.0, 1.0, 1.0]);
    assert_eq!(scene.sources.paths().count(), 5);
    assert_eq!(scene.sources.place(scene.shapes[0].span).path, folder.path().join("parts/a.pbrt"));
}

#[test]
fn damaged_and_absent_files_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.pbrt.gz");
    std::fs::write(&path, [0x1f, 0x8b, 8, 0, 0, 0]).unwrap();
    assert!(load(&path).unwrap_err()[0].message.contains("gzip"));
    assert!(load(folder.path()).unwrap_err()[0].message.contains("not a file"));
    assert!(load(&folder.path().join("absent")).is_err());
}

#[test]
fn names_defined_in_a_long_chain_backwards_do_not_overflow_the_stack() {
    let mut text = String::from("WorldBegin\n");
    for i in 0..20_000 {
        text += &format!("Texture \"{i}\" \"float\" \"scale\" \"texture tex\" \"{}\"\n", i + 1);
        text += &format!(
            "MakeNamedMaterial \"{i}\" \"string type\" \"mix\" \"string materials\" [ \"{0}\" \"{0}\" ]\n",
            i + 1
        );
        text += &format!("ObjectBegin \"{i}\" ObjectInstance \"{}\" ObjectEnd\n", i + 1);
    }
    assert!(parse(text.as_bytes(), Path::new(""), "test.pbrt").is_err());
    let forwards: String =
        (0..20_000).map(|i| format!("ObjectBegin \"{}\" ObjectInstance \"{i}\" ObjectEnd\n", i + 1)).collect();
    let text = format!("WorldBegin ObjectBegin \"0\" Shape \"disk\" ObjectEnd {forwards} ObjectInstance \"20000\"");
    assert!(parse(text.as_bytes(), Path::new(""), "test.pbrt").is_err());
    assert!(parse("AttributeBegin ".repeat(100_000).as_bytes(), Path::new(""), "test.pbrt").is_err());
}

#[test]
fn what_does_not_shine_as_described_is_warned_of_once() {
    let text = "WorldBegin LightSource \"infinite\" \"point3 portal\" [0 0 0 1 0 0 1 1 0 0 1 0]
        AreaLightSource \"diffuse\" ObjectBegin \"o\" Shape \"sphere\" Shape \"disk\" ObjectEnd ObjectInstance \"o\"";
    let (scene, warnings) = parse(text.as_bytes(), Path::new(""), "test.pbrt").unwrap();
    assert!(scene.objects[0].shapes.iter().all(|shape| shape.area_light.is_none()));
    let texts: Vec<String> = warnings.iter().map(ToString::to_string).collect();
    assert_eq!(texts.len(), 2, "{texts:?}");
    assert!(texts[0].contains("portals are not rendered") && texts[1].contains("do not shine"), "{texts:?}");
}
