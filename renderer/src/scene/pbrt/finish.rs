//! From what was read to a [`Scene`]: names become what they stand for, nested instances become flat.

use std::collections::BTreeMap;

use super::context::{Context, TextureNames};
use super::instances;
use super::lights;
use super::materials::MaterialTable;
use super::options::Picture;
use super::params::Params;
use super::reader::Reader;
use super::report::{did_you_mean, shown};
use super::textures;
use super::world::{MaterialRef, World};
use crate::scene::description::{
    AreaLight, AreaLightId, Material, MaterialId, MaterialKind, Medium, MediumId, Object, Scene, Shape, ShapeKind,
    TextureId, Value,
};
use crate::scene::{Diagnostic, Span};

/// The scene that was read with everything there is to say about it.
pub(super) fn finish(reader: Reader) -> Result<(Scene, Vec<Diagnostic>), Vec<Diagnostic>> {
    let Reader { mut cx, options, world, .. } = reader;
    let Picture { camera, film, filter, spp, seed, integrator } = options.build(&mut cx);
    let World { textures, materials, material_refs, lights, area_lights, media, medium_names, .. } = world;

    let texture_refs = match textures::build_all(&mut cx, textures) {
        TextureNames::Said(names) => names.into_said(),
        TextureNames::Defined(_) => Vec::new(),
    };
    let texture_ids =
        texture_refs.iter().map(|((values, name), span)| textures::resolve(&mut cx, *values, name, *span)).collect();
    let (material_ids, materials) = resolve_materials(&mut cx, materials, &material_refs);
    let (area_light_ids, area_lights) = resolve_area_lights(&mut cx, area_lights);
    let lights = lights
        .into_iter()
        .filter_map(|(mut params, world_from_light)| lights::build(&mut cx, &mut params, world_from_light))
        .collect();
    let (medium_ids, media) = resolve_media(&mut cx, media, medium_names.into_said());
    let resolver =
        Resolver { textures: texture_ids, material_ids, materials, media: medium_ids, area_lights: area_light_ids };

    let mut shapes = world.shapes;
    shapes.iter_mut().for_each(|shape| resolver.resolve(&mut cx, shape));
    let instances = instances::place(&mut cx, &world.objects, world.object_names.into_said(), &world.instances);
    let objects = world.objects.into_iter().map(|entity| {
        let mut shapes = entity.shapes;
        shapes.iter_mut().for_each(|shape| resolver.resolve(&mut cx, shape));
        Object { name: entity.name, shapes, span: entity.span }
    });
    let objects = objects.collect();

    let textures = textures::take_built(&mut cx);
    let Context { report, files, .. } = cx;
    let failed = report.failed();
    let diagnostics = report.finish(&files.sources);
    if failed {
        return Err(diagnostics);
    }
    let scene = Scene {
        sources: files.sources,
        origin: glam::DVec3::ZERO,
        camera,
        film,
        filter,
        spp,
        seed,
        integrator,
        textures,
        materials: resolver.materials,
        lights,
        area_lights,
        media,
        shapes,
        objects,
        instances,
    };
    Ok((scene, diagnostics))
}

/// Builds the materials and finds which of them each reference means.
fn resolve_materials(
    cx: &mut Context,
    mut table: MaterialTable,
    refs: &[MaterialRef],
) -> (Vec<Option<MaterialId>>, Vec<Material>) {
    table.build_all(cx);
    let ids = refs
        .iter()
        .map(|reference| match reference {
            MaterialRef::Slot(slot) => table.built(*slot),
            MaterialRef::Named(name, span) => table.find(cx, name, *span).and_then(|slot| table.built(slot)),
        })
        .collect();
    (ids, table.into_built())
}

/// Builds the area lights. Those that cannot be leave a gap in the ids.
fn resolve_area_lights(cx: &mut Context, entities: Vec<Params>) -> (Vec<Option<AreaLightId>>, Vec<AreaLight>) {
    let mut built = Vec::new();
    let ids = entities.into_iter().map(|mut params| {
        lights::build_area(cx, &mut params).map(|light| {
            built.push(light);
            AreaLightId(built.len() as u32 - 1)
        })
    });
    (ids.collect(), built)
}

/// Finds which medium each name means.
fn resolve_media(
    cx: &mut Context,
    media: BTreeMap<String, Option<Medium>>,
    said: Vec<(String, Span)>,
) -> (Vec<Option<MediumId>>, Vec<Medium>) {
    let mut built = Vec::new();
    let mut known = BTreeMap::new();
    for (name, medium) in media {
        let id = medium.map(|medium| {
            built.push(medium);
            MediumId(built.len() as u32 - 1)
        });
        known.insert(name, id);
    }
    let find = |(name, span): (String, Span)| {
        let id = known.get(&name).copied();
        if id.is_none() {
            let hint = did_you_mean(&name, known.keys().map(String::as_str));
            cx.report.error(span, format!("there is no medium named \"{}\"{hint}", shown(&name)));
        }
        id.flatten()
    };
    (said.into_iter().map(find).collect(), built)
}

/// What the numbers in shapes stand for. `None`: an error that has been told.
struct Resolver {
    textures: Vec<Option<TextureId>>,
    material_ids: Vec<Option<MaterialId>>,
    materials: Vec<Material>,
    media: Vec<Option<MediumId>>,
    area_lights: Vec<Option<AreaLightId>>,
}

impl Resolver {
    fn resolve(&self, cx: &mut Context, shape: &mut Shape) {
        let texture = |id: TextureId| self.textures.get(id.index()).copied().flatten();
        shape.material = self.material_ids.get(shape.material.index()).copied().flatten().unwrap_or(MaterialId(0));
        shape.alpha = match shape.alpha.take() {
            Some(Value::Texture(id)) => texture(id).map(Value::Texture),
            other => other,
        };
        if let ShapeKind::Ply { displacement, .. } = &mut shape.kind {
            *displacement = displacement.and_then(texture);
        }
        shape.media = shape.media.map(|id| id.and_then(|id| self.media.get(id.index()).copied().flatten()));
        shape.area_light = shape.area_light.and_then(|id| self.area_lights.get(id.index()).copied().flatten());
        let is_interface =
            self.materials.get(shape.material.index()).is_some_and(|m| matches!(m.kind, MaterialKind::Interface));
        if is_interface && shape.area_light.take().is_some() {
            let text = "a surface of material \"interface\" does not shine: drawn without its area light, as in pbrt";
            cx.report.warning("interface light", shape.span, text);
        }
    }
}
