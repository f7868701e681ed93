//! From what was read to a [`Scene`]: names become what they stand for, nested instances become flat.

use std::collections::BTreeMap;

use super::context::{Context, TextureNames};
use super::lights;
use super::materials::MaterialTable;
use super::options::Picture;
use super::reader::{InstanceEntity, MaterialRef, ObjectEntity, Reader, World};
use super::report::{did_you_mean, shown};
use super::textures::{self, TextureValues};
use crate::math::Transform;
use crate::scene::description::{
    AreaLight, AreaLightId, Instance, Material, MaterialId, MaterialKind, Medium, MediumId, Object, ObjectId, Scene,
    Shape, ShapeKind, TextureId, Value,
};
use crate::scene::{Diagnostic, Span};

/// Objects that hold instances of objects multiply: beyond this the file cannot be meant.
const MOST_INSTANCES: usize = 1 << 28;

/// The scene that was read with everything there is to say about it.
pub(super) fn finish(reader: Reader) -> Result<(Scene, Vec<Diagnostic>), Vec<Diagnostic>> {
    let Reader { mut cx, options, world, .. } = reader;
    let Picture { camera, film, filter, spp, seed, integrator } = options.build(&mut cx);
    let World { textures, materials, material_refs, lights, area_lights, media, medium_names, .. } = world;

    let texture_refs = match textures::build_all(&mut cx, textures) {
        TextureNames::Said(names) => names.into_said(),
        TextureNames::Defined(_) => Vec::new(),
    };
    let mut resolver = Resolver {
        textures: texture_refs.iter().map(|((values, name), span)| texture(&mut cx, *values, name, *span)).collect(),
        materials: resolve_materials(&mut cx, materials, &material_refs),
        media: Vec::new(),
        area_lights: area_lights.into_iter().map(|mut params| lights::build_area(&mut cx, &mut params)).collect(),
    };
    let lights = lights
        .into_iter()
        .filter_map(|(mut params, world_from_light)| lights::build(&mut cx, &mut params, world_from_light))
        .collect();
    let media = resolve_media(&mut cx, media, medium_names.into_said(), &mut resolver);

    let mut shapes = world.shapes;
    shapes.iter_mut().for_each(|shape| resolver.resolve(&mut cx, shape));
    let (objects, instances) =
        objects(&mut cx, world.objects, world.object_names.into_said(), world.instances, &resolver);

    let textures = textures::take_built(&mut cx);
    let Context { report, files, .. } = cx;
    let failed = report.failed();
    let diagnostics = report.finish(&files.sources);
    if failed {
        return Err(diagnostics);
    }
    let area_lights = resolver.area_lights.into_iter().flatten().collect();
    let scene = Scene {
        sources: files.sources,
        camera,
        film,
        filter,
        spp,
        seed,
        integrator,
        textures,
        materials: resolver.materials.1,
        lights,
        area_lights,
        media,
        shapes,
        objects,
        instances,
    };
    Ok((scene, diagnostics))
}

fn texture(cx: &mut Context, values: TextureValues, name: &str, span: Span) -> Option<TextureId> {
    textures::resolve(cx, values, name, span)
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

fn resolve_media(
    cx: &mut Context,
    media: BTreeMap<String, Option<Medium>>,
    said: Vec<(String, Span)>,
    resolver: &mut Resolver,
) -> Vec<Medium> {
    let mut ids = BTreeMap::new();
    let mut built = Vec::new();
    for (name, medium) in media {
        let id = medium.map(|medium| {
            built.push(medium);
            MediumId(built.len() as u32 - 1)
        });
        ids.insert(name, id);
    }
    for (name, span) in said {
        resolver.media.push(match ids.get(&name) {
            Some(id) => *id,
            None => {
                let hint = did_you_mean(&name, ids.keys().map(String::as_str));
                cx.report.error(span, format!("there is no medium named \"{}\"{hint}", shown(&name)));
                None
            }
        });
    }
    built
}

/// What the numbers in shapes stand for. `None`: an error that has been told.
struct Resolver {
    textures: Vec<Option<TextureId>>,
    materials: (Vec<Option<MaterialId>>, Vec<Material>),
    media: Vec<Option<MediumId>>,
    area_lights: Vec<Option<AreaLight>>,
}

impl Resolver {
    fn resolve(&self, cx: &mut Context, shape: &mut Shape) {
        let texture = |id: TextureId| self.textures.get(id.index()).copied().flatten();
        let (ids, materials) = &self.materials;
        shape.material = ids.get(shape.material.index()).copied().flatten().unwrap_or(MaterialId(0));
        shape.alpha = match shape.alpha.take() {
            Some(Value::Texture(id)) => texture(id).map(Value::Texture),
            other => other,
        };
        if let ShapeKind::Ply { displacement, .. } = &mut shape.kind {
            *displacement = displacement.and_then(texture);
        }
        shape.media = shape.media.map(|id| id.and_then(|id| self.media.get(id.index()).copied().flatten()));
        shape.area_light = shape.area_light.and_then(|AreaLightId(index)| self.area_light(index));
        let is_interface =
            materials.get(shape.material.index()).is_some_and(|m| matches!(m.kind, MaterialKind::Interface));
        if is_interface && shape.area_light.take().is_some() {
            let text = "a surface of material \"interface\" does not shine: drawn without its area light, as in pbrt";
            cx.report.warning("interface light", shape.span, text);
        }
    }

    /// The place of an area light among those that were built.
    fn area_light(&self, index: u32) -> Option<AreaLightId> {
        self.area_lights.get(index as usize)?.as_ref()?;
        let before = self.area_lights[..index as usize].iter().flatten().count();
        Some(AreaLightId(before as u32))
    }
}

/// Resolves objects and places them; an instance within an object becomes instances of both.
fn objects(
    cx: &mut Context,
    entities: Vec<ObjectEntity>,
    names: Vec<(String, Span)>,
    placed: Vec<InstanceEntity>,
    resolver: &Resolver,
) -> (Vec<Object>, Vec<Instance>) {
    let mut index: BTreeMap<&str, usize> = BTreeMap::new();
    for (at, entity) in entities.iter().enumerate() {
        index.entry(&entity.name).or_insert(at);
    }
    let find = |(name, span): &(String, Span)| {
        let found = index.get(name.as_str()).copied();
        if found.is_none() {
            let hint = did_you_mean(name, index.keys().copied());
            cx.report.error(*span, format!("there is no object \"{}\"{hint}", shown(name)));
        }
        found
    };
    let targets: Vec<Option<usize>> = names.iter().map(find).collect();
    let mut flattener = Flattener { targets, entities: &entities, open: vec![false; entities.len()], out: Vec::new() };
    for instance in &placed {
        flattener.place(cx, instance, &Transform::default());
    }
    let instances = flattener.out;
    let objects = entities.into_iter().map(|entity| {
        let mut shapes = entity.shapes;
        shapes.iter_mut().for_each(|shape| resolver.resolve(cx, shape));
        Object { name: entity.name, shapes, span: entity.span }
    });
    (objects.collect(), instances)
}

struct Flattener<'e> {
    /// The objects that the numbers of names stand for.
    targets: Vec<Option<usize>>,
    entities: &'e [ObjectEntity],
    /// Whether an object is being placed: within itself it must not be.
    open: Vec<bool>,
    out: Vec<Instance>,
}

impl Flattener<'_> {
    fn place(&mut self, cx: &mut Context, instance: &InstanceEntity, outer: &Transform) {
        // As deep as a stack of this function certainly goes.
        const DEEPEST: usize = 100;
        let Some(object) = self.targets[instance.name as usize] else { return };
        let entity = &self.entities[object];
        if self.open[object] {
            cx.report.error(instance.span, format!("object \"{}\" holds an instance of itself", shown(&entity.name)));
            return;
        }
        let world_from_object = *outer * instance.transform;
        if !entity.shapes.is_empty() {
            if self.out.len() == MOST_INSTANCES {
                cx.report.error(instance.span, format!("more than {MOST_INSTANCES} instances"));
                return;
            }
            self.out.push(Instance { object: ObjectId(object as u32), world_from_object, span: instance.span });
        }
        if entity.instances.is_empty() {
            return;
        }
        if self.open.iter().filter(|open| **open).count() == DEEPEST {
            cx.report.error(instance.span, format!("more than {DEEPEST} objects within each other"));
            return;
        }
        self.open[object] = true;
        for inner in &entity.instances {
            self.place(cx, inner, &world_from_object);
        }
        self.open[object] = false;
    }
}
