use super::*;
use crate::scene::Span;
use crate::scene::description::{self, MaterialKind, Roughness, Texture, TextureKind};
use crate::texture::image::{TexelData, Texels};

fn diffuse(reflectance: Value<Rgb>) -> description::Material {
    description::Material {
        name: None,
        kind: MaterialKind::Diffuse { reflectance },
        displacement: None,
        normal_map: None,
        span: Span::default(),
    }
}

fn build(materials: &[description::Material], textures: &Textures) -> Materials {
    Materials::build(materials, textures).expect("materials without files").0
}

fn surface(p: Vec3) -> Surface {
    Surface {
        texture_point: TexturePoint { p, ..TexturePoint::default() },
        p,
        ng: Vec3::Z,
        ns: Vec3::Z,
        dpdu: Vec3::X,
        dpdv: Vec3::Y,
        wo: Vec3::Z,
    }
}

fn albedo(shading: &Shading<'_>) -> Rgb {
    shading.bsdf.albedo(shading.frame.to_local(Vec3::Z))
}

#[test]
fn a_mixture_takes_each_part_as_often_as_its_amount_says() {
    let textures = Textures::default();
    let mut materials = vec![diffuse(Value::Constant(Rgb::ZERO)), diffuse(Value::Constant(Rgb::ONE))];
    let kind = MaterialKind::Mix { materials: [MaterialId(0), MaterialId(1)], amount: Value::Constant(0.3) };
    materials.push(description::Material { kind, ..diffuse(Value::Constant(Rgb::ZERO)) });
    let built = build(&materials, &textures);
    let n = 20_000;
    let ones = (0..n)
        .map(|k| built.shade(MaterialId(2), &surface(Vec3::splat(k as f32 * 0.01)), &textures).unwrap())
        .filter(|shading| albedo(shading) == Rgb::ONE)
        .count();
    // Binomial: 4.4 standard deviations.
    let bound = 4.4 * (0.3 * 0.7 * f64::from(n)).sqrt();
    assert!((ones as f64 - 0.3 * f64::from(n)).abs() < bound, "{ones} of {n}");
}

#[test]
fn a_material_needs_only_what_it_looks_at() {
    let constant = Texture { name: "c".into(), kind: TextureKind::Constant(Rgb::ONE), span: Span::default() };
    let fbm = TextureKind::Fbm { texture_from_world: Default::default(), octaves: 2, omega: 0.5 };
    let varying = Texture { name: "v".into(), kind: fbm, span: Span::default() };
    let (textures, _) = Textures::build(&[constant, varying]).unwrap();
    let texture = |id: u32| Value::Texture(TextureId(id));
    let rough = |u: f32, v: f32| Roughness { u: Value::Constant(u), v: Value::Constant(v), remap: false };
    let glass = |roughness| description::Material {
        kind: MaterialKind::Dielectric { eta: 1.5, roughness },
        ..diffuse(Value::Constant(Rgb::ONE))
    };
    let bumpy = description::Material { displacement: Some(TextureId(1)), ..diffuse(Value::Constant(Rgb::ONE)) };
    let list = [diffuse(texture(0)), diffuse(texture(1)), glass(rough(0.1, 0.1)), glass(rough(0.1, 0.3)), bumpy];
    let built = build(&list, &textures);
    let needs: Vec<_> = (0..5).map(|id| built.needs(MaterialId(id))).map(|n| (n.texture_point, n.tangents)).collect();
    assert_eq!(needs, [(false, false), (true, false), (false, false), (false, true), (true, true)]);
}

#[test]
fn a_conductor_of_given_reflectance_has_it_at_normal_incidence() {
    let textures = Textures::default();
    let reflectance = Rgb::new(0.9, 0.5, 0.04);
    let kind = MaterialKind::Conductor {
        conductor: description::Conductor::Reflectance(Value::Constant(reflectance)),
        roughness: Roughness { u: Value::Constant(0.0), v: Value::Constant(0.0), remap: true },
    };
    let built = build(&[description::Material { kind, ..diffuse(Value::Constant(Rgb::ZERO)) }], &textures);
    let shading = built.shade(MaterialId(0), &surface(Vec3::ZERO), &textures).unwrap();
    let sample = shading.bsdf.sample(shading.frame.to_local(Vec3::Z), 0.5, Vec2::splat(0.5)).unwrap();
    assert!((sample.weight - reflectance).abs().max_element() < 1e-5, "{}", sample.weight);
}

#[test]
fn a_ramp_of_displacement_tilts_the_normal_by_its_slope() {
    // Height 0.5 u over a unit square: the normal of the displaced plane is (−0.5, 0, 1), normalised.
    let corners = [Rgb::ZERO, Rgb::ZERO, Rgb::splat(0.5), Rgb::splat(0.5)];
    for corners in [corners, [corners[0], corners[2], corners[0], corners[2]]] {
        let mapping = description::Mapping2D::Uv { scale: Vec2::ONE, delta: Vec2::ZERO };
        let kind = TextureKind::Bilerp { corners, mapping };
        let (textures, _) = Textures::build(&[Texture { name: "ramp".into(), kind, span: Span::default() }]).unwrap();
        let at = Surface {
            texture_point: TexturePoint { uv: Vec2::splat(0.5), ..TexturePoint::default() },
            ..surface(Vec3::ZERO)
        };
        let (ns, _) = perturb::bump(&at, TextureId(0), &textures);
        // Which of the corners is along u is the texture's business; the tilt is not.
        assert!((ns.z - 1.0 / 1.25f32.sqrt()).abs() < 1e-3, "{ns}");
    }
}

/// A normal map of one texel.
fn map(rgb: [f32; 3]) -> Pyramid {
    let data = TexelData::Float(rgb.to_vec());
    let encoding = description::Encoding::Linear;
    Pyramid::new(Texels {
        width: 1,
        height: 1,
        channels: 3,
        data,
        encoding,
        alpha: false,
        space: Default::default(),
        flaws: Default::default(),
    })
}

#[test]
fn a_normal_map_bends_along_the_tangents() {
    let at = Surface {
        texture_point: TexturePoint { uv: Vec2::new(-7.3, 1.0e9), ..TexturePoint::default() },
        ng: Vec3::Y,
        ns: Vec3::Y,
        dpdu: 3.0 * Vec3::Z,
        ..surface(Vec3::ZERO)
    };
    assert!((perturb::normal_map(&at, &map([0.5, 0.5, 1.0])) - Vec3::Y).length() < 1e-6);
    // 0.6 along ∂p/∂u, then along n × ∂p/∂u.
    assert!((perturb::normal_map(&at, &map([0.8, 0.5, 0.9])) - Vec3::new(0.0, 0.8, 0.6)).length() < 1e-6);
    assert!((perturb::normal_map(&at, &map([0.5, 0.8, 0.9])) - Vec3::new(0.6, 0.8, 0.0)).length() < 1e-6);
    // The side of the geometric normal wins.
    assert!((perturb::normal_map(&Surface { ng: -Vec3::Y, ..at }, &map([0.5, 0.5, 1.0])) + Vec3::Y).length() < 1e-6);
}

#[test]
fn coats_metals_and_maps_that_are_alike_are_made_once() {
    let smooth = || Roughness { u: Value::Constant(0.0), v: Value::Constant(0.0), remap: true };
    let coat = || description::Coat {
        roughness: smooth(),
        thickness: Value::Constant(0.01),
        eta: 1.5,
        g: Value::Constant(0.0),
        albedo: Value::Constant(Rgb::ZERO),
    };
    let coated = |albedo: f32| description::Material {
        kind: MaterialKind::CoatedDiffuse { reflectance: Value::Constant(Rgb::splat(albedo)), coat: coat() },
        ..diffuse(Value::Constant(Rgb::ZERO))
    };
    let spectrum = |name: &str| Value::Constant(crate::spectrum::named(name).unwrap());
    let metal = || description::Material {
        kind: MaterialKind::CoatedConductor {
            conductor: description::Conductor::EtaK { eta: spectrum("metal-Al-eta"), k: spectrum("metal-Al-k") },
            conductor_roughness: smooth(),
            coat: coat(),
        },
        ..diffuse(Value::Constant(Rgb::ZERO))
    };
    let built = build(&[coated(0.2), coated(0.7), metal(), metal()], &Textures::default());
    assert_eq!((built.coats.len(), built.metals.len(), built.curves.len()), (1, 1, 1));
    // Al in a medium of index 1.5 under a coat that reflects 4 %: between the metal's 0.87 alone and 1.
    let shading = built.shade(MaterialId(2), &surface(Vec3::ZERO), &Textures::default()).unwrap();
    let albedo = albedo(&shading);
    assert!(albedo.min_element() > 0.85 && albedo.max_element() < 0.93, "{albedo}");
}

#[test]
fn a_normal_map_that_is_not_there_is_an_error() {
    let material = description::Material { normal_map: Some("none.png".into()), ..diffuse(Value::Constant(Rgb::ONE)) };
    let errors = Materials::build(&[material.clone(), material], &Textures::default()).unwrap_err();
    assert_eq!(errors.len(), 2);
    assert!(errors[0].1.contains("none.png"), "{}", errors[0].1);
}
