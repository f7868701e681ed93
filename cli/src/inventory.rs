//! What a scene contains, counted from its description.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use renderer::scene::Scene;
use renderer::scene::description::{
    CameraKind, Conductor, CurveKind, LightKind, Mapping, MaterialKind, PixelFilterKind, Shape, ShapeKind, TextureKind,
    Value,
};
use serde::Serialize;

use crate::stats;

/// Counts by name, sorted by name.
pub type Counts = BTreeMap<&'static str, u64>;

/// The feature of a camera with a lens.
pub const LENS: &str = "depth of field";

/// What a scene contains.
#[derive(Clone, Debug, Serialize)]
pub struct Inventory {
    /// The files that its description was read from.
    #[serde(serialize_with = "stats::shown_paths")]
    pub files: Vec<PathBuf>,
    /// The camera.
    pub camera: &'static str,
    /// The pixel filter.
    pub filter: &'static str,
    /// Size of the frame in pixels.
    pub resolution: [u32; 2],
    /// Samples per pixel.
    pub spp: u64,
    /// Seed.
    pub seed: u64,
    /// Largest number of scattering events of a path.
    pub max_depth: u32,
    /// Shapes, those of objects once.
    pub shapes: Counts,
    /// Groups of shapes for instancing.
    pub objects: u64,
    /// Placed copies of objects.
    pub instances: u64,
    /// Materials.
    pub materials: Counts,
    /// Textures.
    pub textures: Counts,
    /// Lights; area lights by shape.
    pub lights: Counts,
    /// Participating media, by name and kind.
    pub media: Vec<String>,
    /// What the renderer needs to be able to do.
    pub features: Vec<&'static str>,
    /// Image and mesh files.
    #[serde(serialize_with = "stats::shown_paths")]
    pub assets: Vec<PathBuf>,
}

impl Inventory {
    /// Counts everything in a scene.
    pub fn of(scene: &Scene) -> Self {
        let mut inventory = Self {
            files: scene.sources.paths().map(Path::to_owned).collect(),
            camera: camera(&scene.camera.kind),
            filter: filter(&scene.filter.kind),
            resolution: scene.film.resolution,
            spp: scene.spp,
            seed: scene.seed,
            max_depth: scene.integrator.max_depth,
            shapes: count(shapes(scene).map(|shape| shape_kind(&shape.kind))),
            objects: scene.objects.len() as u64,
            instances: scene.instances.len() as u64,
            materials: count(scene.materials.iter().map(|material| material_kind(&material.kind))),
            textures: count(scene.textures.iter().map(|texture| texture_kind(&texture.kind))),
            lights: count(scene.lights.iter().map(|light| light_kind(&light.kind))),
            media: scene.media.iter().map(|medium| format!("{} ({})", medium.name, medium.kind)).collect(),
            features: features(scene),
            assets: scene.assets().into_iter().map(Path::to_owned).collect(),
        };
        let emitters = shapes(scene).filter(|shape| shape.area_light.is_some()).count() as u64;
        if emitters > 0 {
            inventory.lights.insert("area (shapes)", emitters);
        }
        inventory
    }
}

fn count(names: impl Iterator<Item = &'static str>) -> Counts {
    let mut counts = Counts::new();
    names.for_each(|name| *counts.entry(name).or_default() += 1);
    counts
}

fn shapes(scene: &Scene) -> impl Iterator<Item = &Shape> {
    scene.shapes.iter().chain(scene.objects.iter().flat_map(|object| &object.shapes))
}

fn camera(kind: &CameraKind) -> &'static str {
    match kind {
        CameraKind::Perspective { .. } => "perspective",
        CameraKind::Orthographic => "orthographic",
        CameraKind::Spherical { equal_area: true } => "spherical, equal-area",
        CameraKind::Spherical { equal_area: false } => "spherical, latitude-longitude",
    }
}

fn filter(kind: &PixelFilterKind) -> &'static str {
    match kind {
        PixelFilterKind::Box => "box",
        PixelFilterKind::Triangle => "triangle",
        PixelFilterKind::Gaussian { .. } => "gaussian",
        PixelFilterKind::Mitchell { .. } => "mitchell",
        PixelFilterKind::LanczosSinc { .. } => "sinc",
    }
}

fn shape_kind(kind: &ShapeKind) -> &'static str {
    match kind {
        ShapeKind::Triangles(_) => "trianglemesh",
        ShapeKind::Ply { .. } => "plymesh",
        ShapeKind::Bilinear(_) => "bilinearmesh",
        ShapeKind::Loop { .. } => "loopsubdiv",
        ShapeKind::Sphere { .. } => "sphere",
        ShapeKind::Disk { .. } => "disk",
        ShapeKind::Cylinder { .. } => "cylinder",
        ShapeKind::Curve(curve) => match curve.kind {
            CurveKind::Flat => "curve (flat)",
            CurveKind::Cylinder => "curve (cylinder)",
            CurveKind::Ribbon => "curve (ribbon)",
        },
    }
}

fn material_kind(kind: &MaterialKind) -> &'static str {
    match kind {
        MaterialKind::Interface => "interface",
        MaterialKind::Diffuse { .. } => "diffuse",
        MaterialKind::CoatedDiffuse { .. } => "coateddiffuse",
        MaterialKind::CoatedConductor { .. } => "coatedconductor",
        MaterialKind::Conductor { conductor: Conductor::EtaK { .. }, .. } => "conductor (eta, k)",
        MaterialKind::Conductor { conductor: Conductor::Reflectance(_), .. } => "conductor (reflectance)",
        MaterialKind::Dielectric { .. } => "dielectric",
        MaterialKind::ThinDielectric { .. } => "thindielectric",
        MaterialKind::DiffuseTransmission { .. } => "diffusetransmission",
        MaterialKind::Mix { .. } => "mix",
    }
}

fn texture_kind(kind: &TextureKind) -> &'static str {
    match kind {
        TextureKind::Constant(_) => "constant",
        TextureKind::Scale { .. } => "scale",
        TextureKind::Mix { .. } => "mix",
        TextureKind::DirectionMix { .. } => "directionmix",
        TextureKind::Bilerp { .. } => "bilerp",
        TextureKind::Image(_) => "imagemap",
        TextureKind::Checkerboard { mapping: Mapping::Two(_), .. } => "checkerboard (2D)",
        TextureKind::Checkerboard { mapping: Mapping::Three(_), .. } => "checkerboard (3D)",
        TextureKind::Dots { .. } => "dots",
        TextureKind::Fbm { .. } => "fbm",
        TextureKind::Wrinkled { .. } => "wrinkled",
        TextureKind::Windy { .. } => "windy",
        TextureKind::Marble { .. } => "marble",
    }
}

fn light_kind(kind: &LightKind) -> &'static str {
    match kind {
        LightKind::Point { .. } => "point",
        LightKind::Spot { .. } => "spot",
        LightKind::Distant { .. } => "distant",
        LightKind::Infinite { image: None, .. } => "infinite (uniform)",
        LightKind::Infinite { image: Some(_), .. } => "infinite (image)",
        LightKind::Goniometric { .. } => "goniometric",
        LightKind::Projection { .. } => "projection",
    }
}

/// What goes beyond a pinhole, opaque meshes of plain materials, and one light of constant emission.
fn features(scene: &Scene) -> Vec<&'static str> {
    let textured = |alpha: &Option<Value<f32>>| alpha.as_ref().is_some_and(|value| *value != Value::Constant(1.0));
    let any_shape = |wanted: fn(&ShapeKind) -> bool| shapes(scene).any(|shape| wanted(&shape.kind));
    let quadric = |kind: &ShapeKind| {
        matches!(kind, ShapeKind::Sphere { .. } | ShapeKind::Disk { .. } | ShapeKind::Cylinder { .. })
    };
    let portals = |kind: &LightKind| matches!(kind, LightKind::Infinite { portal, .. } if !portal.is_empty());
    let procedural = |kind: &TextureKind| !matches!(kind, TextureKind::Constant(_) | TextureKind::Image(_));
    let window = scene.film.crop_window.is_some() || scene.film.pixel_bounds.is_some();
    [
        ("instances", !scene.instances.is_empty()),
        ("curves", any_shape(|kind| matches!(kind, ShapeKind::Curve(_)))),
        ("quadrics", any_shape(quadric)),
        ("bilinear patches", any_shape(|kind| matches!(kind, ShapeKind::Bilinear(_)))),
        ("subdivision surfaces", any_shape(|kind| matches!(kind, ShapeKind::Loop { .. }))),
        ("alpha masks", shapes(scene).any(|shape| textured(&shape.alpha))),
        ("coats", scene.materials.iter().any(|material| material_kind(&material.kind).starts_with("coated"))),
        ("bump maps", scene.materials.iter().any(|material| material.displacement.is_some())),
        ("normal maps", scene.materials.iter().any(|material| material.normal_map.is_some())),
        ("image textures", scene.textures.iter().any(|texture| matches!(texture.kind, TextureKind::Image(_)))),
        ("procedural textures", scene.textures.iter().any(|texture| procedural(&texture.kind))),
        ("several lights", scene.lights.len() + shapes(scene).filter(|shape| shape.area_light.is_some()).count() > 1),
        ("image environment", scene.lights.iter().any(|light| light_kind(&light.kind) == "infinite (image)")),
        ("portals", scene.lights.iter().any(|light| portals(&light.kind))),
        ("textured area lights", scene.area_lights.iter().any(|light| light.image.is_some())),
        ("participating media", !scene.media.is_empty()),
        (LENS, scene.camera.lens_radius > 0.0),
        ("crop", window),
        ("auxiliary channels", scene.film.gbuffer),
        ("clamping", scene.film.max_component_value.is_finite()),
        ("regularisation", scene.integrator.regularize),
    ]
    .into_iter()
    .filter_map(|(name, needed)| needed.then_some(name))
    .collect()
}
